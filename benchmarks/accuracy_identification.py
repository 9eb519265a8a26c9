"""Errors and deviations of identified parameters over many noisy logs of a simulated RX-90.

    python -m benchmarks.accuracy_identification [--logs 500] [--processes 2] [--state FOLDER]

Set OPENBLAS_NUM_THREADS=1 when other work runs beside.

Each case draws the noise of its logs from seeds of its own, so that a log is the same whoever
computes it. With ``--state`` every log that is done is kept there and not done again: what was
stopped goes on where it was, and a table can be made of what there is.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import numpy as np

import robotmodels as rm
from robotmodels.estimation import Estimate, EstimateStatus, TriangularFactors
from robotmodels.estimation.linear import inverse_std, ordinary, solved, weighted
from robotmodels.identification import (
    Log,
    Processing,
    choose_processing,
    correlated_covariance,
    equations,
    exciting_trajectory,
    fit,
    reduce_equations,
)
from robotmodels.identification.closed_loop import (
    Controller,
    Didim,
    Instrumental,
    OutputError,
    hausman_test,
    simulated_log,
    tuned_controller,
)
from robotmodels.identification.closed_loop.loop import friction_rates
from robotmodels.identification.equations import Equations
from robotmodels.logs import with_delay

DT = 1e-3
PERIOD = 10.0
POSITION_NOISE, TORQUE_NOISE = 1e-4, 0.05
BANDWIDTH = 8.0
"""Hz, of the controller."""
FILTER = {"cutoff": 15.0, "dead_band": 0.1}
"""Choices for logs of the closed loop, where the default filter is too low: see the table."""
LEAST = 10
"""Logs that a table is made of at least."""
QUANTITIES = ("values", "deviations", "white")
Row = dict[str, np.ndarray]


@cache
def robot() -> rm.RobotModel:
    """The RX-90 with drives of plausible size."""
    drive = rm.DriveParameters(
        Ia=[4.0, 4.0, 1.5, 0.3, 0.2, 0.1], Fv=[20.0, 20.0, 10.0, 3.0, 2.0, 1.0],
        Fc=[10.0, 10.0, 6.0, 2.0, 1.5, 1.0], offset=[0.3, -0.2, 0.1, 0.05, -0.05, 0.02],
    )  # fmt: skip
    return rm.load("rx90").with_drive(drive)


@cache
def base() -> rm.BaseParameters:
    """Its base parameters."""
    return rm.base_parameters(robot(), drive=True)


@cache
def trajectory() -> rm.trajectories.Trajectory:
    """One period of an exciting trajectory."""
    found = exciting_trajectory(
        robot(), duration=PERIOD, drive=True, starts=1, baseline=1, iterations=60, rng=0
    )
    return found.trajectory


def references(seconds: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, velocities and accelerations that are asked for."""
    t = (DT * np.arange(round(seconds / DT))) % PERIOD
    way = trajectory()
    return way.q(t), way.v(t), way.a(t)


@cache
def followed(seconds: float) -> Log:
    """The references followed exactly, with the torques of the inverse dynamic model."""
    q, v, a = references(seconds)
    return Log(DT, q, rm.idm(robot(), q, v, a))


@cache
def controller() -> tuple[Controller, np.ndarray]:
    """Gains, torques of a robot 10 % off fed forward; and the width of dry friction at rest."""
    arm, rng = robot(), np.random.default_rng(1)
    q, _, _ = references(PERIOD)
    bodies = arm.inertia.values * rng.uniform(0.9, 1.1, (arm.f, 1))
    terms = {
        name: getattr(arm.drive, name) * rng.uniform(0.9, 1.1, arm.n)
        for name in ("Ia", "Fv", "Fc", "offset")
    }
    near = arm.with_inertia(type(arm.inertia)(bodies)).with_drive(rm.DriveParameters(**terms))
    gains = tuned_controller(arm, q, BANDWIDTH, period=DT, feed_forward=False)
    return Controller(gains.kp, gains.kd, feed_forward=near), DT * friction_rates(arm, q).dry


@cache
def controlled(seconds: float) -> Log:
    """The references followed by the controlled robot, its torque held from sample to sample."""
    q, v, _ = references(seconds)
    own, width = controller()
    return simulated_log(robot(), own, q, v, DT, width=width)


def noisy(clean: Log, case: str, seed: int) -> Log:
    """What sensors would have recorded of it; they do not act on the controller."""
    rng = np.random.default_rng([seed, *case.encode()])
    q = clean.q + POSITION_NOISE * rng.normal(size=clean.q.shape)
    tau = clean.tau + TORQUE_NOISE * rng.normal(size=clean.q.shape)
    return Log(DT, q, tau, q_ref=clean.q_ref, v_ref=clean.v_ref)


def coloured(case: str, seed: int) -> Row:
    """Weighted least squares where the torque's noise is correlated over half a second."""
    from scipy.signal import lfilter

    clean = followed(40.0)
    rng = np.random.default_rng([seed, *case.encode()])
    q = clean.q + POSITION_NOISE * rng.normal(size=clean.q.shape)
    stay = np.exp(-DT / 0.5)
    e = lfilter([np.sqrt(1.0 - stay**2)], [1.0, -stay], rng.normal(size=clean.q.shape), axis=0)
    log = Log(DT, q, clean.tau + TORQUE_NOISE * np.asarray(e))
    clock = Clock()
    row = squares(*system_of(log, choose_processing(log)))
    return named("WLS", {**row, "time": clock()})


def system_of(log: Log, choices: Processing) -> tuple[Equations, TriangularFactors]:
    """Equations and their triangular factors."""
    system = equations(base(), log, choices)
    return system, reduce_equations(system)


def squares(system: Equations, factors: TriangularFactors, equal: bool = False) -> Row:
    """Least squares as `fit` has them: ordinary or weighted, and both kinds of deviations."""
    found: Estimate = ordinary(factors) if equal else weighted(factors)
    w = np.ones(system.groups) if equal else inverse_std(factors, found.sigma)
    _, inverse, _ = solved(factors, w)
    spread = correlated_covariance(system, found.values, w, inverse)
    deviations = np.sqrt(np.maximum(np.diag(spread.covariance), 0.0))
    return {"values": found.values, "deviations": deviations, "white": found.standard_errors}


def start_of(log: Log) -> np.ndarray:
    """Parameters that a robot can be simulated with: of filtered equations."""
    return weighted(system_of(log, choose_processing(log, **FILTER))[1]).values


def named(prefix: str, row: Row) -> Row:
    """Quantities under the name of their method."""
    return {f"{prefix}.{key}": value for key, value in row.items()}


class Clock:
    """Processor seconds since the last look."""

    def __init__(self) -> None:
        self.last = time.process_time()

    def __call__(self) -> np.ndarray:
        now = time.process_time()
        spent, self.last = now - self.last, now
        return np.array(spent)


def plain(seconds: float, case: str, seed: int) -> Row:
    """Weighted least squares with the default choices on exactly followed references."""
    log = noisy(followed(seconds), case, seed)
    clock = Clock()
    row = squares(*system_of(log, choose_processing(log)))
    return named("WLS", {**row, "time": clock()})


def whole(seconds: float, case: str, seed: int) -> Row:
    """The same through `fit`, which checks the log and validates the result."""
    log = noisy(followed(seconds), case, seed)
    clock = Clock()
    found = fit(robot(), log, base=base())
    return named("fit", {
        "values": found.values, "deviations": found.standard_errors,
        "white": found.details.iid_standard_errors, "time": clock(),
    })  # fmt: skip


def simulating(
    method: Callable, system: Equations, factors: TriangularFactors, start: np.ndarray
) -> Estimate:
    """One of the methods that simulate the robot, in the loop that made the log."""
    own, width = controller()
    return method(own, start=start, width=width).solve(system, factors)


def simulated_row(found: Estimate, clock: Clock) -> Row:
    """What is kept of it."""
    return {
        "values": found.values, "deviations": found.standard_errors,
        "white": found.details.iid_standard_errors,
        "solved": np.array(found.status is EstimateStatus.SOLVED),
        "iterations": np.array(found.iterations), "time": clock(),
    }  # fmt: skip


def compared(seconds: float, choices: dict, equal: bool, case: str, seed: int) -> Row:
    """Least squares, instruments, their test and DIDIM on one log of the closed loop."""
    log = noisy(controlled(seconds), case, seed)
    # a torque that is held acts half a period later than it was sampled
    moved = with_delay(log, -0.5 * DT)
    chosen = choose_processing(moved, **choices)
    clock = Clock()
    system, factors = system_of(moved, chosen)
    row = named("OLS" if equal else "WLS", {**squares(system, factors, equal), "time": clock()})
    start = start_of(moved)
    found = simulating(Instrumental, system, factors, start)
    row |= named("IV", simulated_row(found, clock))
    verdict = hausman_test(system, found)
    row |= named("DWH", {
        "p": np.array(verdict.p), "effect": verdict.effect / verdict.least_squares_errors,
        "time": clock(),
    })  # fmt: skip
    # the simulated torque is held as well
    system, factors = system_of(log, chosen)
    return row | named("DIDIM", simulated_row(simulating(Didim, system, factors, start), clock))


def default_on_loop(seconds: float, case: str, seed: int) -> Row:
    """Default choices on logs of the closed loop, for the bias that its sharp motion leaves."""
    log = noisy(controlled(seconds), case, seed)
    moved = with_delay(log, -0.5 * DT)
    chosen = choose_processing(moved)
    clock = Clock()
    row = named("WLS", {**squares(*system_of(moved, chosen)), "time": clock()})
    found = simulating(Didim, *system_of(log, chosen), start_of(moved))
    return row | named("DIDIM", simulated_row(found, clock))


def outputs(seconds: float, case: str, seed: int) -> Row:
    """Closed-loop output error."""
    log = noisy(controlled(seconds), case, seed)
    clock = Clock()
    system, factors = system_of(log, choose_processing(log, **FILTER))
    found = simulating(OutputError, system, factors, weighted(factors).values)
    return named("CLOE", simulated_row(found, clock))


@dataclass(frozen=True, slots=True)
class Case:
    """Some logs and what is done with them."""

    sentence: str
    share: float
    """Part of the logs that are asked for."""
    run: Callable[[str, int], Row]


RAW = {"filtered": False, "decimation": 1, "edges": 0.2}


def _plain_20(case: str, seed: int) -> Row:
    return plain(20.0, case, seed)


def _plain_40(case: str, seed: int) -> Row:
    return plain(40.0, case, seed)


def _plain_80(case: str, seed: int) -> Row:
    return plain(80.0, case, seed)


def _whole(case: str, seed: int) -> Row:
    return whole(40.0, case, seed)


def _loop(case: str, seed: int) -> Row:
    return compared(20.0, FILTER, False, case, seed)


def _raw(case: str, seed: int) -> Row:
    return compared(PERIOD, RAW, True, case, seed)


def _sharp(case: str, seed: int) -> Row:
    return default_on_loop(20.0, case, seed)


def _outputs(case: str, seed: int) -> Row:
    return outputs(PERIOD, case, seed)


CASES = {
    "plain-40": Case("40 s, references followed exactly, default choices", 1.0, _plain_40),
    "coloured-40": Case(
        "40 s, references followed exactly, torque noise correlated over 0.5 s, default choices",
        0.2,
        coloured,
    ),
    "loop-20": Case("20 s of the closed loop, filtered at 15 Hz, dead band 0.1 rad/s", 1.0, _loop),
    "raw-10": Case("10 s of the closed loop, no filter, no decimation", 0.1, _raw),
    "plain-20": Case("20 s, references followed exactly, default choices", 1.0, _plain_20),
    "plain-80": Case("80 s, references followed exactly, default choices", 1.0, _plain_80),
    "sharp-20": Case("20 s of the closed loop, default choices", 0.1, _sharp),
    "outputs-10": Case(
        "10 s of the closed loop, filtered at 15 Hz, dead band 0.1 rad/s", 0.008, _outputs
    ),
    "fit-40": Case("40 s, references followed exactly, through `fit`", 0.02, _whole),
}


def done_log(case: str, seed: int, state: Path | None) -> Row:
    """One log, or what is kept of it."""
    path = None if state is None else state / f"{case}-{seed:04d}.npz"
    if path is not None and path.exists():
        with np.load(path) as kept:
            return dict(kept)
    row = CASES[case].run(case, seed)
    if path is not None:
        part = path.with_suffix(f".{os.getpid()}.part.npz")
        np.savez(part, **row)
        part.replace(path)
    return row


def _task(job: tuple[str, int, Path | None]) -> tuple[str, Row]:
    return job[0], done_log(*job)


def method_line(method: str, rows: list[Row]) -> str:
    """A row of the table of errors."""
    truth = base().values(robot())
    values, deviations, white = (
        np.array([row[f"{method}.{key}"] for row in rows]) for key in QUANTITIES
    )
    seconds = np.array([float(row[f"{method}.time"]) for row in rows])
    errors = values - truth
    N = len(rows)
    z = errors / deviations
    inside, inside_white = np.abs(z) < 1.959964, np.abs(errors) < 1.959964 * white
    by_parameter = inside.mean(axis=0)
    true = errors.std(axis=0, ddof=1)
    t = errors.mean(axis=0) / (true / np.sqrt(N))
    worst = int(np.abs(t).argmax())
    offset = np.abs(errors.mean(axis=0)) / true
    ratio = np.sqrt(np.mean(deviations**2, axis=0)) / true
    return (
        f"| {method} | {N} | {100 * inside.mean():.1f} | {100 * by_parameter.min():.0f} to "
        f"{100 * by_parameter.max():.0f} | {100 * inside_white.mean():.1f} | "
        f"{ratio.min():.2f} {np.median(ratio):.2f} {ratio.max():.2f} | "
        f"{np.abs(t).max():.1f} ({base().names[worst]}) | {int((np.abs(t) > 4).sum())} | "
        f"{np.median(offset):.2f}, {offset.max():.2f} | {np.median(seconds):.2f} |"
    )


HEADER = """\
| method | logs | inside 95 % interval, % | by parameter, % | with white deviations, % | \
stated / true deviation: least, middle, most | greatest mean error / its standard error | \
parameters beyond 4 | mean error / deviation: middle, greatest | processor s a log |
|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|"""


def extra_lines(rows: list[Row]) -> list[str]:
    """Verdicts of the test, and how the iterations ended."""
    lines = []
    for method in ("IV", "DIDIM", "CLOE"):
        if f"{method}.solved" in rows[0]:
            ended = np.array([bool(row[f"{method}.solved"]) for row in rows])
            count = np.median([int(row[f"{method}.iterations"]) for row in rows])
            lines.append(
                f"{method}: {int(ended.sum())} of {len(rows)} converged, {count:g} simulations in "
                "the middle."
            )
    if "DWH.p" in rows[0]:
        p = np.array([float(row["DWH.p"]) for row in rows])
        effect = np.abs([row["DWH.effect"] for row in rows]).max(axis=1)
        spent = np.median([float(row["DWH.time"]) for row in rows])
        lines.append(
            f"Durbin-Wu-Hausman test at 5 %: least squares rejected in "
            f"{100 * (p < 0.05).mean():.1f} % of the logs (largest difference from instrumental "
            f"variables {np.median(effect):.2g} standard errors in the middle); "
            f"{spent:.2f} processor s a log."
        )
    return lines


def text_of(found: dict[str, list[Row]], command: str) -> str:
    """The results as Markdown."""
    from importlib.metadata import version

    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "numba", "pin"))
    lines = [
        "# Identified parameters over many noisy logs", "",
        f"RX-90 with {len(base())} base parameters (rotor inertias, viscous and dry friction and "
        f"offsets among them); noise of {POSITION_NOISE:g} rad and {TORQUE_NOISE:g} N m at "
        f"{1 / DT:g} Hz; an exciting trajectory of {PERIOD:g} s, repeated. In the closed loop the "
        f"controller has {BANDWIDTH:g} Hz and feeds the torques of a robot 10 % off forward; its "
        "torque is held from sample to sample, so that least squares and instruments take it half "
        "a period later (`with_delay`). The noise of the log does not act on the controller.", "",
        f"{datetime.now(UTC):%Y-%m-%d}; {platform.machine()}, {os.cpu_count()} cores, Python "
        f"{platform.python_version()}, {packages}; `{command}`. Processor times were taken while "
        "other work ran on the machine.", "",
    ]  # fmt: skip
    for case, rows in found.items():
        if len(rows) < LEAST:
            lines += [f"{CASES[case].sentence}: {len(rows)} logs so far, too few to tell.", ""]
            continue
        methods = [key.split(".")[0] for key in rows[0] if key.endswith(".values")]
        lines += [f"## {CASES[case].sentence}", "", HEADER]
        lines += [method_line(method, rows) for method in methods]
        extra = extra_lines(rows)
        lines += ["", *extra, ""] if extra else [""]
    return "\n".join(line for line in lines).rstrip() + "\n"


def main() -> None:
    """Run what is not done yet, and write the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    parser.add_argument("--logs", type=int, default=500)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--state", type=Path)
    parser.add_argument("--cases", nargs="*", choices=list(CASES), default=list(CASES))
    parser.add_argument("--kept", action="store_true", help="a table of what is kept, no new logs")
    options = parser.parse_args()
    state: Path | None = options.state
    if state is not None:
        state.mkdir(parents=True, exist_ok=True)
    elif options.kept:
        parser.error("--kept needs --state.")
    # round after round, so that what is stopped has something of every case
    jobs = [
        (max(seed / CASES[case].share, 0.0), place, case, seed)
        for place, case in enumerate(options.cases)
        for seed in range(max(LEAST, round(options.logs * CASES[case].share)))
    ]
    tasks = [(case, seed, state) for _, _, case, seed in sorted(jobs)]
    if options.kept:
        tasks = [
            (case, seed, state) for case, seed, _ in tasks
            if state is not None and (state / f"{case}-{seed:04d}.npz").exists()
        ]  # fmt: skip
    found: dict[str, list[Row]] = {case: [] for case in options.cases}
    if options.processes == 1 or options.kept:
        for k, job in enumerate(tasks):
            found[job[0]].append(_task(job)[1])
            print(f"\r{k + 1} of {len(tasks)}", end="", file=sys.stderr)
    else:
        pool = ProcessPoolExecutor(options.processes, mp_context=get_context("spawn"))
        with pool:
            for k, (case, row) in enumerate(pool.map(_task, tasks)):
                found[case].append(row)
                print(f"\r{k + 1} of {len(tasks)}", end="", file=sys.stderr)
    print(file=sys.stderr)
    command = f"python -m benchmarks.accuracy_identification --logs {options.logs}"
    text = text_of(found, command)
    print(text)
    (options.out / "accuracy_identification.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
