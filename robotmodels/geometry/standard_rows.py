"""Classical (distal) Denavit-Hartenberg rows, written as rows of the Khalil-Kleinfinger table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from .. import se3
from .._arrays import Array, as_floats
from .columns import LIMITS
from .joint_kinds import PRISMATIC
from .rows import checked_rows

_KEYS = ("theta", "d", "a", "alpha", "sigma", "offset", *LIMITS, "name")


def rows_of_standard(
    rows: Iterable[Mapping[str, Any]], degrees: bool
) -> tuple[list[dict[str, Any]], Array]:
    """Rows for `DHTable.from_rows` and the tool: see `DHTable.from_standard`."""
    rows = checked_rows(rows, _KEYS)
    ours: list[dict[str, Any]] = []
    d, alpha = 0.0, 0.0
    for row in rows:
        row = dict(row)
        offset = row.pop("offset", 0.0)
        own = "r" if row.get("sigma", 0) == PRISMATIC else "theta"
        next_d, next_alpha = row.pop("a", 0.0), row.pop("alpha", 0.0)
        row["r"] = row.pop("d", 0.0)
        row[own] = row.get(own, 0.0) + offset
        ours.append({**row, "d": d, "alpha": alpha})
        d, alpha = next_d, next_alpha
    angle = np.deg2rad(alpha) if degrees else alpha
    d, angle = as_floats([d, angle], "the last row's a and alpha")
    tool = se3.translation(d, 0.0, 0.0) @ se3.rotation("x", angle)
    return ours, tool
