"""Full calibration of a UR10 on simulated poses."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.bench_calibration import GOALS, rolled, simulated
from benchmarks.side_by_side.works import Entry, Settings, Tool, Work, at_most
from robotmodels.calibration import CalibrationResult, Pose, fit
from robotmodels.datasets import ur10_camera

SIZES = (30, 100, 500)


def calibration(settings: Settings) -> Iterator[Work]:
    """Three sizes; of a short run the smallest."""
    urdf = ur10_camera().urdf
    for count in SIZES[:1] if settings.quick else SIZES:
        model, q, T = simulated(count)

        def ours(m=model, x=q, y=T) -> CalibrationResult:
            return fit(m, Pose(x, y), folds=0, held_out=0)

        def said(found: CalibrationResult) -> str:
            error = 1e3 * found.validation.in_sample.rms["m"]
            return f"{len(found.names)} parameters, {error:.3f} mm"

        entries = [Entry(Tool.OURS, "", ours, said=said)]
        if settings.figaroh is not None:
            rows = np.array([rolled(x) + y.tolist() for x, y in zip(T, q, strict=True)])
            job = settings.figaroh.job(urdf=urdf, rows=rows)
            run = settings.figaroh.task("calibrate", job)
            entries.append(Entry(Tool.FIGAROH, "", run, rounds=_rounds(count)))
        if settings.pybotics is not None:
            run = settings.pybotics.task("calibrate", f"{count}")
            how = "distances of positions"
            entries.append(Entry(Tool.PYBOTICS, how, run, rounds=_rounds(count)))
        title = f"UR10 full calibration, {count} poses"
        yield Work("calibration", title, "s", entries, [at_most(GOALS[count], "s")])


def _rounds(count: int) -> int:
    """Of the slow ones; they compile nothing, so one round needs no run before it."""
    return 1 if count > 100 else 3


WORKS = {"calibration": calibration}
