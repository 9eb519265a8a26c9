"""Estimates that are frozen in `oracles/frozen_*.json`: the cases, and what is kept of a result.

The first five functions are the only ones that read attributes of results and pass options of
methods: where a name or a signature of the package changes, change it there.
"""

from __future__ import annotations

import json
import warnings
from functools import cache
from pathlib import Path

import numpy as np
from frozen_kinds import KINDS, measured, simulated_ur10, touched

import robotmodels as rm
from robotmodels import calibration, identification
from robotmodels.errors import RobotModelsWarning


def identified(model, log, method, **options):
    """Result of a fit, without its warnings about bad predictions."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotModelsWarning)
        return identification.fit(model, log, method, **options)


def words_of_identification(result) -> dict:
    """What is kept of an identification."""
    processing, validation = result.equations.processing, result.validation
    kept = {
        "names": result.names,
        "values": result.values,
        "standard_errors": result.standard_errors,
        "status": result.status.name,
        "unidentifiable": result.details.unidentifiable,
        "equations": result.factors.rows,
        "cutoff": processing.cutoff,
        "decimation": processing.decimation,
        "in_sample": validation.in_sample.rmse,
    }
    if validation.held_out is not None:
        kept["held_out"] = validation.held_out.rmse
    if isinstance(result.method, identification.Robust):
        kept["outliers"] = result.estimate.details.counts
    return kept


def words_of_calibration(result) -> dict:
    """What is kept of a calibration; errors are mean, rms and largest, by unit."""

    def errors(blocks):
        return {unit: [blocks.mean[unit], blocks.rms[unit], blocks.max[unit]]
                for unit in blocks.count}  # fmt: skip

    kept = {
        "names": result.names, "corrections": result.corrections,
        "standard_errors": result.standard_errors, "status": result.status.name,
        "unidentifiable": {k: v.name for k, v in result.identifiable.reasons.items()},
        "nominal": errors(result.validation.nominal),
        "in_sample": errors(result.validation.in_sample),
    }  # fmt: skip
    for word, aside in (("folds", result.validation.folds),
                        ("held_out", result.validation.held_out)):  # fmt: skip
        if aside is not None:
            kept[word] = errors(aside)
    return kept


def words_of_consistency(fit, result) -> dict:
    """What is kept of a physically consistent robot, with standard errors of least squares."""
    return {
        "names": fit.base.names, "values": fit.base_values,
        "standard_errors": result.standard_errors,
        "status": fit.status.name, "price": fit.residual_increase, "distance": fit.distance,
        "physical": bool(fit.inertia.is_physical.all()),
    }  # fmt: skip


def says_biased(result) -> bool:
    """Verdict of the Durbin-Wu-Hausman test on a fit by instrumental variables."""
    return bool(identification.hausman_test(result.equations, result.estimate).biased)


# --- files ----------------------------------------------------------------------------------------

FOLDER = Path(__file__).parent / "oracles"


def plain(value):
    """Arrays as lists, numbers with twelve significant digits, names as one text."""
    if isinstance(value, dict):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, (tuple, list)) and all(isinstance(x, str) for x in value):
        return " ".join(value)
    if isinstance(value, (tuple, list, np.ndarray)):
        return [plain(entry) for entry in value]
    if isinstance(value, (float, np.floating)):
        return float(f"{float(value):.12g}")
    return value.item() if isinstance(value, np.generic) else value


@cache
def read(name: str) -> dict:
    """A file of the folder."""
    return json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))


def frozen(part: str, case: str) -> dict:
    """What is frozen of a case."""
    return read(f"frozen_{part}")["cases"][case]


# --- comparison -----------------------------------------------------------------------------------

ESTIMATES = ("values", "corrections", "errors")
SAME = 0.02
"""Standard errors that estimates of the same method may differ by."""
ITERATED = 0.1
"""The same where the robot is simulated: another start alone moves the TX40's by 0.015."""
CONSISTENT = 0.4
"""The same under physical consistency: squares within 1.4e-4 of the least, the gap that the solver
leaves, are within this of the least."""
RELATIVE = {
    "standard_errors": 0.02, "nominal": 0.01, "in_sample": 0.01, "folds": 0.01, "held_out": 0.01,
    "cutoff": 0.01, "equations": 0.01, "distance": 0.05,
}  # fmt: skip
PRICE = 0.01
"""Percent of the residual's size, absolute: half of what the solver's gap allows is 0.007."""
COEFFICIENTS = 1e-7
"""Of base parameters, relative: the numeric method's rounding."""


def differences(case: str, new: dict, old: dict) -> dict[str, float]:
    """Largest difference of each quantity in units of its bound; infinite for what must be equal.

    Shapes: all as in the file.
    """
    assert new.keys() == old.keys()
    found = {}
    for word, there in old.items():
        here = new[word]
        if isinstance(there, dict):
            found |= {f"{word} {k}": v for k, v in differences(word, here, there).items()}
        elif np.shape(here) != np.shape(there):
            found[word] = np.inf
        elif word in ESTIMATES:
            bound = ITERATED if set(case.split()) & {"iv", "didim", "cloe"} else SAME
            bound = CONSISTENT if "consistent" in case else bound
            unit = np.array(old["standard_errors"])
            found[word] = _largest((np.array(here) - there) / unit / bound)
        elif word in RELATIVE or case in RELATIVE:
            bound = RELATIVE[word if word in RELATIVE else case]
            found[word] = _largest((np.array(here) / there - 1.0) / bound)
        elif word == "price":
            found[word] = abs(here - there) / PRICE
        elif word == "combinations":
            size = np.maximum(np.abs(there), 1.0)
            found[word] = _largest((np.array(here) - there) / size / COEFFICIENTS)
        else:
            found[word] = 0.0 if here == there else np.inf
    return found


def _largest(ratios) -> float:
    return float(np.abs(ratios).max(initial=0.0))


# --- TX40 -----------------------------------------------------------------------------------------

TX40 = {
    **{name: (name, {}) for name in (
        "wls", "ols", "irls", "ridge", "robust", "tls", "sequential", "recursive", "iv",
    )},
    "robust tukey": ("robust:loss=tukey", {}),
    "wls essential": ("wls:essential=True", {}),
    "wls shrunk": ("wls:shrinkage=True", {}),
    **{f"wls {form}": ("wls", {"form": form}) for form in ("filtered", "power", "energy")},
    "didim": ("didim", {}),
    "cloe": ("cloe", {}),
}  # fmt: skip


@cache
def tx40(case: str) -> dict:
    """A fit of the published training rows, tested on the others; or a consistent robot of it."""
    if case.startswith("consistent"):
        result = tx40_result("wls")
        return words_of_consistency(identification.consistent_robot(result), result)
    return words_of_identification(tx40_result(case))


@cache
def tx40_result(case: str):
    """Its result."""
    data = rm.datasets.load_tx40()
    log, test = (data.log.rows(part.start or 0, part.stop or len(data.log))
                 for part in (data.training, data.held_out))  # fmt: skip
    method, options = TX40[case]
    return identified(data.model, log, method, test=test, **options)


# --- calibration ----------------------------------------------------------------------------------

PRIORS = {"prior": {}, "no prior": {"prior": None}}
"""The default prior, and none."""
PANDA = {
    "panda front": {},
    **{f"panda front {loss}": {"loss": loss} for loss in ("huber", "cauchy", "tukey")},
    "panda compliance": {"compliance": "isotropic"},
    "panda links": {"compliance": "links", "eccentricity": True},
}
RX90 = {f"rx90 {kind}": kind for kind in KINDS}
CALIBRATION = tuple(
    f"{work}, {prior}" for work in ("ur10", "camera", "board", *PANDA, *RX90) for prior in PRIORS
)


def calibrated(case: str) -> dict:
    """A fit with held-out data that do not depend on how folds are dealt."""
    work, prior = case.split(", ")
    options = {"folds": 0, **PRIORS[prior]}
    if work == "ur10":
        nominal, q, T = simulated_ur10()
        kept = calibration.Pose(q[:150], T[:150])
        options["held_out"] = calibration.Pose(q[150:], T[150:])
    elif work in RX90:
        nominal, kept, its = measured(RX90[work])
        options |= {"held_out": 0, **its}
    elif work in ("camera", "board"):
        data = rm.datasets.ur10_camera()
        nominal, (q, T) = data.model, data.measured
        kind = calibration.Pose
        if work == "board":  # which is 0.45 m in front of the camera
            kind, board = calibration.CameraPose, np.eye(4)
            board[:3, 3] = (T[:, :3, 3] + 0.45 * T[:, :3, 2]).mean(axis=0)
            T = np.linalg.inv(T) @ board
        kept, options["held_out"] = kind(q[:18], T[:18]), kind(q[18:], T[18:])
    else:
        data = rm.datasets.panda_double_socket()
        nominal, options = data.model, {**options, **PANDA[work]}
        front = "front" in work
        kept = [x for place in (["front"] if front else data.places) for x in touched(data, place)]
        # places are fewer than folds: each is left out in turn
        others = [touched(data, place)[0] for place in data.places if place != "front"]
        options |= {"held_out": others} if front else {"folds": 5, "held_out": 0}
    return words_of_calibration(calibration.fit(nominal, kept, **options))


# --- base parameters ------------------------------------------------------------------------------


def base_parameters(robot: str) -> dict:
    """Names, and of each kept parameter the number of terms and its value for sines as standard."""
    model, kept = rm.load(robot), []
    for method in ("symbolic", "numeric"):
        base = rm.base_parameters(model, method)
        B = np.asarray(base.matrix)
        kept.append({
            "names": base.names, "no_effect": base.no_effect,
            "terms": np.count_nonzero(B, axis=1).tolist(),
            "combinations": np.round(B @ np.sin(1.0 + np.arange(B.shape[1])), 9),
        })  # fmt: skip
    apart = max(differences(robot, *kept).values())
    return {**kept[0], "numeric_method_agrees": bool(apart <= 1.0)}


# --- the study of an RX-90 ------------------------------------------------------------------------

DT, PERIOD = 1e-3, 10.0
FILTER = {"cutoff": 15.0, "dead_band": 0.1}
METHODS = ("wls", "wls shrunk", "iv", "didim")


class Study:
    """Noisy logs of an RX-90 with known parameters.

    Motion, controller and friction at rest are numbers of the file, so that a search for exciting
    trajectories or controllers may change; noise has seeds.
    """

    def __init__(self, given: dict):
        drive = rm.DriveParameters(
            Ia=[4.0, 4.0, 1.5, 0.3, 0.2, 0.1], Fv=[20.0, 20.0, 10.0, 3.0, 2.0, 1.0],
            Fc=[10.0, 10.0, 6.0, 2.0, 1.5, 1.0], offset=[0.3, -0.2, 0.1, 0.05, -0.05, 0.02],
        )  # fmt: skip
        self.given = given
        self.arm = arm = rm.load("rx90").with_drive(drive)
        self.base = rm.base_parameters(arm, drive=True)
        self.truth = self.base.values(arm)
        near = arm.with_inertia(rm.InertialParameters(1.1 * arm.inertia.values))
        self.controller = identification.Controller(given["kp"], given["kd"], feed_forward=near)

    def references(self, seconds: float):
        """Positions, velocities and accelerations: sums of sines with a period of 10 s."""
        t = DT * np.arange(round(seconds / DT))[:, None]
        A, B = np.array(self.given["cosines"]), np.array(self.given["sines"])
        w = 2.0 * np.pi / PERIOD * np.arange(len(A))
        c, s = np.cos(t * w), np.sin(t * w)
        return c @ A + s @ B, c * w @ B - s * w @ A, -(c * w**2) @ A - s * w**2 @ B

    @cache  # noqa: B019
    def followed(self, seconds: float):
        """The references with the torques of the inverse dynamic model."""
        q, v, a = self.references(seconds)
        return identification.Log(DT, q, rm.idm(self.arm, q, v, a))

    @cache  # noqa: B019
    def controlled(self):
        """20 s of the references followed by the controlled robot."""
        q, v, _ = self.references(20.0)
        return identification.simulated_log(
            self.arm, self.controller, q, v, DT, width=self.given["width"]
        )

    def noisy(self, clean, seed: int):
        """With 0.1 mrad and 0.05 N m of white noise."""
        rng = np.random.default_rng(seed)
        q = clean.q + 1e-4 * rng.normal(size=clean.q.shape)
        tau = clean.tau + 0.05 * rng.normal(size=clean.q.shape)
        return identification.Log(DT, q, tau, q_ref=clean.q_ref, v_ref=clean.v_ref)

    def default(self, seed: int) -> dict:
        """The default fit of 40 s that follow the references exactly."""
        log = self.noisy(self.followed(40.0), seed)
        return {"wls": self.judged(identified(self.arm, log, "wls", base=self.base))}

    def loop(self, seed: int, methods=METHODS) -> dict:
        """Methods on 20 s of the closed loop, and the Durbin-Wu-Hausman test."""
        from scipy.interpolate import CubicSpline

        log = self.noisy(self.controlled(), seed)
        # a torque that is held acts half a period later than it was sampled
        t = np.arange(len(log))
        tau = CubicSpline(t, log.tau)(t[1:] - 0.5)
        moved = identification.Log(
            DT, log.q[1:], tau, q_ref=log.q_ref[1:], v_ref=log.v_ref[1:]
        )  # fmt: skip
        processing = identification.choose_processing(moved, **FILTER)
        some = {"base": self.base, "processing": processing, "checked": False}
        found = {}
        for method in methods:
            own = log if method == "didim" else moved  # the simulated torque is held as well
            way = {
                "wls": identification.Wls(shrinkage=False),
                "wls shrunk": identification.Wls(shrinkage=True),
                "iv": identification.Instrumental(self.controller),
                "didim": identification.Didim(self.controller),
            }[method]
            result = identified(self.arm, own, way, **some)
            found[method] = self.judged(result)
            if method == "iv":
                found["biased"] = says_biased(result)
        return found

    def judged(self, result) -> dict:
        """Errors in standard errors (b,), with four decimals, and standard errors, four digits."""
        kept = words_of_identification(result)
        assert kept["names"] == self.base.names
        error = np.array(kept["values"]) - self.truth
        return {
            "status": kept["status"], "errors": [float(f"{x:.4g}") for x in error],
            "standard_errors": [float(f"{x:.4g}") for x in kept["standard_errors"]],
        }  # fmt: skip


LOGS = 51
"""Of the closed loop; six more follow the references exactly."""


@cache
def study() -> Study:
    """With the numbers of the file."""
    return Study(read("study_motion"))


def studied(case: str) -> dict:
    """Of one log, by method: the errors of the parameters and their standard errors."""
    kind, seed = case.split()
    return study().default(int(seed)) if kind == "default" else study().loop(int(seed))


def summary(cases: dict) -> dict[str, dict[str, float]]:
    """By method: how many 95 % intervals hold the truth, size and largest mean of z."""
    found = {}
    logs = [case for name, case in cases.items() if name.startswith("loop")]
    for method in METHODS:
        z = np.array([np.divide(x[method]["errors"], x[method]["standard_errors"]) for x in logs])
        found[method] = {
            "logs": len(z), "solved": sum(x[method]["status"] == "SOLVED" for x in logs),
            "inside": int((np.abs(z) < 1.959964).sum()), "rms": float(np.sqrt((z**2).mean())),
            "bias": float(np.abs(z.mean(axis=0)).max()),
        }  # fmt: skip
    return found


# --- all ------------------------------------------------------------------------------------------

COMPUTED = {
    "tx40": tx40, "calibration": calibrated, "base_parameters": base_parameters, "study": studied,
}  # fmt: skip
CASES = {
    "tx40": (*TX40, "consistent"), "calibration": CALIBRATION, "base_parameters": rm.robots(),
    "study": (*(f"default {k}" for k in range(6)), *(f"loop {k}" for k in range(LOGS))),
}  # fmt: skip
SLOW = ("didim", "cloe", "ols", "irls", "robust", "wls energy")
QUICK = {
    **CASES, "tx40": tuple(x for x in CASES["tx40"] if x not in SLOW),
    "study": ("default 0", "loop 0"),
}  # fmt: skip
"""Those that the tests compute; the others are compared by `make_estimates.py --check`."""
