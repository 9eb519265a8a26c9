"""Base parameters, and least squares from a log to parameters."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import robotmodels as rm
from benchmarks.bench_base_parameters import Motion, motion_of, rank_of
from benchmarks.bench_identification import DT, simulate
from benchmarks.measure import loop
from benchmarks.side_by_side.works import Entry, Goal, Settings, Tool, Work, at_most
from robotmodels.identification import choose_processing, fit
from robotmodels.identification.signals import signals
from robotmodels.logs import Log

RULES, NUMBERS = "by rules", "by numbers"
DECIMATED, EVERY_ROW = "decimated", "every row"
FLAT = 1.25
"""Memory of a log ten times as long is at most this much more."""


def base_parameters(settings: Settings) -> Iterator[Work]:
    """Base parameters of a UR10: by the rules, and by the columns of the regressor."""
    model = rm.load("erd:ur10")
    # neither is asked for offsets
    drive = rm.DriveParameters.zeros(model.n)

    def said(base: rm.BaseParameters) -> str:
        return f"rank {rank_of(base)}"

    def by_numbers(motion: Motion | None = None) -> rm.BaseParameters:
        return rm.base_parameters(model, "numeric", motion=motion)

    entries = [
        Entry(Tool.OURS, "", lambda: rm.base_parameters(model), said=said, mode=RULES),
        Entry(Tool.OURS, "", by_numbers, said=said, mode=NUMBERS),
    ]
    urdf = rm.to_urdf(model.with_drive(None))
    for count in (2_000,) if settings.quick else (10_000, 100_000):
        motion = motion_of(model.n, count)
        mode = f"{NUMBERS} of {count:g} samples"
        run = partial(by_numbers, motion)
        entries.append(Entry(Tool.OURS, "", run, said=said, rounds=3, mode=mode))
        if settings.figaroh is not None:
            q, v, a = motion
            job = settings.figaroh.job(
                urdf=urdf, q=q, v=v, a=a, Ia=drive.Ia, Fv=drive.Fv, Fc=drive.Fc
            )
            run = settings.figaroh.task("base", job)
            rounds = 1 if count > 10_000 else 3
            entries.append(Entry(Tool.FIGAROH, "", run, rounds=rounds, mode=mode))

    off = _disagreement(model)
    goals = [
        at_most(100.0, "ms", RULES),
        Goal("by numbers too", at_most(100.0, "ms", NUMBERS).met),
        Goal("the two agree", lambda _: off <= 1e-12),
    ]
    title = "base parameters, 6R with friction and rotors"
    yield Work("base_parameters", title, "ms", entries, goals)


def _disagreement(model: rm.RobotModel) -> float:
    """Largest relative difference of the torques that the two sets of base parameters give."""
    W = rm.torque_regressor(model, *motion_of(model.n, 1000), drive=("Ia", "Fv", "Fc"))
    bases = rm.base_parameters(model), rm.base_parameters(model, "numeric")
    if len(bases[0]) != len(bases[1]):
        return float("inf")
    first, second = (base.reduce(W) @ base.values(model) for base in bases)
    return float(np.abs(first - second).max() / np.abs(first).max())


def least_squares(settings: Settings) -> Iterator[Work]:
    """Identification of a simulated RX-90 from positions and torques."""
    with tempfile.TemporaryDirectory() as folder:
        yield _least_squares(settings, Path(folder))


def _least_squares(settings: Settings, folder: Path) -> Work:
    count = settings.number(100_000, 10_000)
    model = rm.load("rx90")
    simulate(folder, "rx90", count)
    log = Log(DT, np.load(folder / "q.npy"), np.load(folder / "tau.npy"))
    grown: dict[int, float] = {}
    if not settings.quick:
        grown = {n: _memory(n) for n in (count, 10 * count)}

    def said(found: Any) -> str:
        error = float(np.sqrt(np.mean(found.validation.in_sample.rmse**2)))
        more = [f"{mb:.0f} MB more memory for {n:g} samples" for n, mb in grown.items()]
        return ", ".join(
            [f"rank {len(found.names)}", f"RMSE {error:.3f} N m of the raw torques", *more]
        )

    sig = signals(log, choose_processing(log, decimation=1))
    pm, data = model.pin_model, model.pin_model.createData()

    def one(*x: np.ndarray) -> np.ndarray:
        return pin.computeJointTorqueRegressor(pm, data, *x)

    entries = [
        Entry(Tool.OURS, "", lambda: fit(model, log), said=said, mode=DECIMATED),
        Entry(
            Tool.OURS, "", lambda: fit(model, log, processing={"decimation": 1}), rounds=3,
            mode=EVERY_ROW,
        ),
        Entry(
            Tool.PINOCCHIO, "the regressor alone, Python loop", loop(one, sig.q, sig.v, sig.a),
            rounds=3, whole=False, mode=EVERY_ROW,
        ),
    ]  # fmt: skip
    if settings.figaroh is not None:
        urdf = rm.to_urdf(model.with_drive(None))
        job = settings.figaroh.job(urdf=urdf, q=sig.q, v=sig.v, a=sig.a, tau=sig.tau)
        run = settings.figaroh.task("identify", job)
        how = "ordinary, of signals that ours filtered"
        entries.append(Entry(Tool.FIGAROH, how, run, rounds=1, mode=EVERY_ROW))
    goals = [at_most(2.0, "s", DECIMATED)]
    if grown:
        least, most = grown[count], grown[10 * count]
        told = f"{least:.0f} MB more memory, {most:.0f} MB for ten times the samples"
        flat = most <= FLAT * least
        goals.append(Goal(f"memory independent of the samples ({told})", lambda _: flat))
    title = f"least squares, {count:g} samples x 6 joints, from log to parameters"
    return Work("least_squares", title, "s", entries, goals)


def _memory(count: int) -> float:
    """Highest anonymous memory of `fit` on a log in files, MB above that before."""
    with tempfile.TemporaryDirectory() as folder:
        simulate(Path(folder), "rx90", count)
        (Path(folder) / "dt").write_text(repr(DT))
        command = [sys.executable, "-W", "ignore", "-m", "benchmarks.bench_identification"]
        command += ["--child", "rx90", "fit", folder, "--rounds", "1"]
        done = subprocess.run(
            command, capture_output=True, text=True, check=True, cwd=Path(__file__).parents[2]
        )
    said = json.loads(done.stdout.splitlines()[-1])
    return said["anonymous"]


WORKS = {"base_parameters": base_parameters, "least_squares": least_squares}
