"""Checks of joint readings: their number, and the limits of the joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError
from ..geometry import REVOLUTE
from ..model import RobotModel
from .measurements import Measurement

_TURNS = 30.0  # largest plausible reading of a revolute joint, rad; beyond it, degrees are assumed
_TOLERANCE = 0.02  # tolerance beyond a limit, rad or m and relative to the range
_MOST = 0.6
"""Share of readings beyond a limit above which they are refused; simulated readings over a
symmetric range have a share of 0.5 where a limit is at zero."""


def expected_joints_text(model: RobotModel) -> str:
    """Sentence on the expected joints; empty if all move the tool."""
    moving = model.twin.frame(None).path.tolist()
    names = model.table.joint_names
    rows = zip(names, model.table.joint_rows, strict=True)
    idle = [name for name, row in rows if row + 1 not in moving]
    if not idle:
        return ""
    return (
        f" Readings of all {model.n} joints of the model are needed: {', '.join(names)}. "
        f"{', '.join(idle)} do not move the tool; read the robot with tip_link='LINK' to leave "
        "them out."
    )


def check_readings(
    model: RobotModel, measurements: Sequence[Measurement], rows: set[int]
) -> list[str]:
    """Compare readings with the limits of the joints: notes, or an error."""
    notes: list[str] = []
    revolute = model.table.sigma[model.table.joint_rows] == REVOLUTE
    for k, m in enumerate(measurements):
        if not m.views:
            continue
        where = f"measurements[{k}] ({m.name})"
        q = np.concatenate([view.q for view in m.views])
        largest = float(np.abs(q[:, revolute]).max(initial=0.0))
        if largest > _TURNS:
            raise InvalidValueError(
                f"{where}: a revolute joint reads {largest:.4g} rad; these look like degrees. "
                "Pass radians: np.deg2rad(q)."
            )
        sentences, most = beyond_limits(model, q, rows)
        if not sentences:
            continue
        note = (
            f"{where}: readings beyond the limits of the joints: {'; '.join(sentences)}. Check "
            "that the columns are readings in the order of the joints, with the signs and zeros "
            "of the model, in rad and m. If the limits of the model are wrong, give it others: "
            "model.with_table(model.table.replace(lower=..., upper=...))."
        )
        if most:
            raise InvalidValueError(note)
        notes.append(note)
    return notes


def beyond_limits(model: RobotModel, q: Array, rows: set[int]) -> tuple[list[str], bool]:
    """Sentences on joints beyond their limits, and whether to refuse them. Shapes: q (N, n)."""
    lower, upper = model.lower, model.upper
    width = np.where(np.isfinite(upper - lower), upper - lower, 0.0)
    tolerance = _TOLERANCE * np.maximum(1.0, width)
    checked = (upper > lower) & [row + 1 in rows for row in model.table.joint_rows]
    over = np.where(checked, np.maximum(lower - q, q - upper), -np.inf)
    number = (over > tolerance).sum(axis=0)
    sentences = []
    for j in np.flatnonzero(number):
        is_revolute = model.table.sigma[model.table.joint_rows[j]] == REVOLUTE
        sentences.append(
            f"joint {j + 1} ({model.table.joint_names[j]}) in {number[j]} of {len(q)} readings, by "
            f"up to {over[:, j].max():.3g} {'rad' if is_revolute else 'm'} (reads "
            f"{q[:, j].min():.4g} to {q[:, j].max():.4g}, limits {lower[j]:.4g} to {upper[j]:.4g})"
        )
    return sentences, bool((number > _MOST * len(q)).any())
