"""Size of the torques of a log beside those of the model's own inertia."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...dynamics import idm
from ...logs import FindingKind, Log, LogFinding, Severity
from ...model import RobotModel
from .joint_hypotheses import JointSamples

_OFF = 20.0
"""Factor beyond which torques are in another unit or of the motors: catalogues are less wrong."""
_EXPLAINED = 0.5
"""Part of the variance of a torque, friction taken off, that the prediction must explain."""
_SAME = 3.0


def check_torque_sizes(
    log: Log, model: RobotModel, samples: JointSamples, found: list[LogFinding]
) -> None:
    """Report joints whose torques differ in size from those of the model's inertia.

    Models without masses, and joints whose torque the inertia does not explain, are skipped.
    """
    inertia = model.inertia
    if inertia is None or not (inertia.values[:, 9] > 0.0).any():
        return
    predicted = idm(model, samples.q, samples.v, samples.a, drive=False)
    gains = {}
    for j in range(log.n):
        v, a, tau = samples.v[:, j], samples.a[:, j], samples.tau[:, j]
        others = np.column_stack([v, np.sign(v), a, np.ones(len(v))])
        x, y = (z - others @ np.linalg.lstsq(others, z)[0] for z in (predicted[:, j], tau))
        xx, yy, xy = float(x @ x), float(y @ y), float(x @ y)
        if xy > 0.0 and xy**2 > _EXPLAINED * xx * yy:
            gains[j] = xy / xx
    large = {j: gain for j, gain in gains.items() if gain > _OFF}
    small = {j: gain for j, gain in gains.items() if gain < 1.0 / _OFF}
    thousand = all(1.0 / _SAME < gain / 1e3 < _SAME for gain in large.values())
    if large:
        _add(
            found, log, large, lambda gain: f"{gain:.3g} times", "much larger than",
            "they may be in mN m: use drive_gains=0.001."
            if thousand else "check units, drive_gains= and gears= of read_log.",
        )  # fmt: skip
    if small:
        every = len(small) == len(gains) > 1
        _add(
            found, log, small, lambda gain: f"1/{1.0 / gain:.3g}", "much smaller than",
            "they may be motor torques"
            + (" or in kN m" if every else " at these joints only")
            + ": see gears=, transmission= and drive_gains= of read_log.",
        )  # fmt: skip


def _add(
    found: list[LogFinding],
    log: Log,
    gains: dict[int, float],
    number: Callable[[float], str],
    joining: str,
    advice: str,
) -> None:
    """Add one finding of several joints."""
    names = tuple(log.names[j] for j in gains)
    listed = ", ".join(f"{log.names[j]}: {number(gain)}" for j, gain in gains.items())
    found.append(
        LogFinding(
            FindingKind.TORQUE_OFF_INERTIA, Severity.DOUBTFUL, names,
            f"Torques without friction are {joining} those computed from the model's inertia "
            f"({listed}); {advice}",
        )
    )  # fmt: skip
