"""A table written row by row: the rows are checked and turned into columns."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from math import pi
from typing import Any

import numpy as np

from .. import se3
from .._arrays import Array, as_floats, as_reals
from ..errors import InvalidValueError, RobotModelsWarning, TableError, nearest_names
from .columns import ANGLES, LENGTHS, LIMITS
from .joint_kinds import FIXED, PRISMATIC, REVOLUTE
from .names import default_names

_CLASSICAL = ("theta", "d", "a", "alpha", "sigma", "offset", *LIMITS, "name")
_KEYS = ("antecedent", "sigma", "mu", *ANGLES, *LENGTHS, *LIMITS, "name")


def columns_of_rows(rows: Iterable[Mapping[str, Any]], degrees: bool) -> dict[str, Any]:
    """Columns of `DHTable`, in radians, from one mapping per row: see `DHTable.from_rows`."""
    rows = checked_rows(rows, _KEYS)
    sigma = [row.get("sigma", 0) for row in rows]
    columns: dict[str, Any] = {
        "antecedent": [row.get("antecedent", j) for j, row in enumerate(rows)],
        "sigma": sigma,
        "mu": [row.get("mu", 1) for row in rows],
    }
    for key in (*ANGLES, *LENGTHS):
        column = as_floats([row.get(key, 0.0) for row in rows], key)
        columns[key] = np.deg2rad(column) if degrees and key in ANGLES else column
        if key in ("gamma", "beta", "alpha") and not degrees and (np.abs(column) > 2 * pi).any():
            warnings.warn(
                f"{key} holds {column.tolist()}, more than a turn in radians: if these are "
                "degrees, pass degrees=True.",
                RobotModelsWarning,
                stacklevel=3,
            )
    columns |= _limits_of_rows(rows, sigma, degrees)
    names = default_names(np.asarray(sigma))
    columns["names"] = [str(row.get("name", d)) for row, d in zip(rows, names, strict=True)]
    return columns


def checked_rows(
    rows: Iterable[Mapping[str, Any]], known: Sequence[str]
) -> list[Mapping[str, Any]]:
    """The rows as a list of mappings of known keys to single numbers."""
    if not isinstance(rows, Iterable):
        raise TableError(f"rows: expected a list with a mapping per row, got {rows!r:.80}.")
    listed = list(rows)
    for j, row in enumerate(listed, start=1):
        if not isinstance(row, Mapping):
            raise TableError(f"Row {j}: expected a mapping such as {{'sigma': 0, 'd': 0.1}}, got "
                             f"{type(row).__name__}.")  # fmt: skip
        for key, value in row.items():
            if key not in known:
                raise TableError(f"Row {j}: " + unknown_name("key", str(key), known))
            if key != "name" and as_reals(value, f"Row {j}: {key}").ndim:
                raise InvalidValueError(f"Row {j}: {key} must be one number, got {value!r:.80}.")
    return listed


def unknown_name(kind: str, name: str, known: Sequence[str]) -> str:
    """Sentence about a column or key that no table has, with the nearest that one has."""
    near = nearest_names(name, known)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    return f"unknown {kind} {name!r}.{hint} Known: {', '.join(known)}."


def _limits_of_rows(
    rows: Sequence[Mapping[str, Any]], sigma: Sequence[int], degrees: bool
) -> dict[str, list[float]]:
    limits: dict[str, list[float]] = {key: [] for key in LIMITS}
    for j, (row, s) in enumerate(zip(rows, sigma, strict=True), start=1):
        if s == FIXED:
            given = [key for key in LIMITS if key in row]
            if given:
                raise TableError(f"Row {j}: a fixed frame has no limits, got {', '.join(given)}.")
            continue
        for key in LIMITS:
            default = -np.inf if key == "lower" else np.inf
            value = row.get(key, default)
            scale = pi / 180 if degrees and s == REVOLUTE and key != "effort" else 1.0
            limits[key].append(float(value) * scale)
    return limits


def rows_of_standard(
    rows: Iterable[Mapping[str, Any]], degrees: bool
) -> tuple[list[dict[str, Any]], Array]:
    """Rows for `DHTable.from_rows` and the tool: see `DHTable.from_standard`."""
    rows = checked_rows(rows, _CLASSICAL)
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
