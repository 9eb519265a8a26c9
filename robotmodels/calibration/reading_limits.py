"""Check of joint readings against the joint limits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError
from ..geometry import REVOLUTE
from ..model import RobotModel
from .measurements import Measurement

_TURNS = 30.0
"""Largest plausible reading of a revolute joint, rad; beyond it, degrees are assumed."""
_BEYOND, _PART = 0.02, 0.02
"""Tolerance beyond a limit, rad or m, or relative to the range."""
_MOST = 0.6
"""Fraction of the readings of a joint beyond its limits from which they are refused: more than that
of a symmetric range where a limit is at zero, as in simulated data that ignore limits."""


def check_readings(
    model: RobotModel, measurements: Sequence[Measurement], rows: set[int]
) -> list[str]:
    """Compare readings with the limits of the joints."""
    wheres: dict[str, list[str]] = {}
    revolute = model.table.sigma[model.table.joint_rows] == REVOLUTE
    for k, m in enumerate(measurements):
        where = f"measurements[{k}] ({m.name})"
        if not m.views:
            continue
        q = np.concatenate([view.q for view in m.views])
        largest = float(np.abs(q[:, revolute]).max(initial=0.0))
        if largest > _TURNS:
            raise InvalidValueError(
                f"{where}: a revolute joint reads {largest:.4g} rad; these look like degrees. "
                "Pass radians: np.deg2rad(q)."
            )
        said, most = beyond_limits(model, q, rows)
        if most:
            raise InvalidValueError(
                f"{where}: readings beyond the limits of the joints: {'; '.join(said)}. See "
                "whether the columns are readings in the order of the joints, with the signs and "
                "zeros of the model, in rad and m. If the limits of the model are wrong, give it "
                "others: model.with_table(model.table.replace(lower=..., upper=...))."
            )
        if said:
            wheres.setdefault("; ".join(said), []).append(where)
    if not wheres:
        return []
    listed = "; ".join(f"{', '.join(where)}: {said}" for said, where in wheres.items())
    return [
        f"Readings beyond the limits of the joints: {listed}. See whether sign, zero and unit of "
        "these readings are those of the model."
    ]


def beyond_limits(model: RobotModel, q: Array, rows: set[int]) -> tuple[list[str], bool]:
    """Sentences on joints beyond their limits, and whether to refuse them. Shapes: q (N, n)."""
    lower, upper = model.lower, model.upper
    room = np.maximum(_BEYOND, _PART * np.where(np.isfinite(upper - lower), upper - lower, 0.0))
    checked = (upper > lower) & [row + 1 in rows for row in model.table.joint_rows]
    over = np.where(checked, np.maximum(lower - q, q - upper) - room, -np.inf)
    number = (over > 0.0).sum(axis=0)
    said = []
    for j in np.flatnonzero(number):
        is_revolute = model.table.sigma[model.table.joint_rows[j]] == REVOLUTE
        unit = "rad" if is_revolute else "m"
        beyond = over[over[:, j] > 0.0, j] + room[j]
        said.append(
            f"joint {j + 1} ({model.table.joint_names[j]}) in {number[j]} of {len(q)} readings, by "
            f"up to {beyond.max():.3g} {unit} (reads {q[:, j].min():.4g} to "
            f"{q[:, j].max():.4g}, limits {lower[j]:.4g} to {upper[j]:.4g})"
        )
    return said, bool((number > _MOST * len(q)).any())
