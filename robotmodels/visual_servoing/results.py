"""Bases of descriptions and results: checked, equal by value, printed in one line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np

from .. import _arrays
from .._arrays import (
    LARGEST,
    Array,
    as_bounded,
    as_core,
    as_exact,
    as_flag,
    as_number,
    read_only,
)
from .._choices import one_of
from ..errors import InvalidValueError, ShapeError
from ..se3 import as_single_pose

THIN = 1e-9  # relative: lengths, areas and angles below are zero


class Checked(_arrays.Value):
    """Base of descriptions, whose fields are checked by their names."""

    __slots__ = ()

    def __post_init__(self) -> None:
        self._check(*(f.name for f in fields(self)))  # type: ignore[arg-type]

    def _check(self, *names: str) -> None:
        for name in names:
            self._set(name, _CHECKS[name](getattr(self, name), name))

    def _set(self, name: str, value: Any) -> None:
        value = read_only(value) if isinstance(value, np.ndarray) else value
        object.__setattr__(self, name, value)


def taken(x: Array, order: Any) -> Array:
    """Rows of solutions in an order. Shapes: x (..., S, *core), order (..., s)."""
    core = (1,) * (x.ndim - order.ndim)
    return np.take_along_axis(x, order.reshape(*order.shape, *core), order.ndim - 1)


def packed(valid: Any, *solutions: Array) -> list[Any]:
    """Flags and solutions with the valid rows first and NaN in the others, as few as possible."""
    order = np.argsort(~valid, axis=-1, kind="stable")
    order = order[..., : int(valid.sum(axis=-1).max(initial=0))]
    kept = taken(valid, order)
    core = [(1,) * (x.ndim - kept.ndim) for x in solutions]
    return [kept] + [
        np.where(kept.reshape(*kept.shape, *k), taken(x, order), np.nan)
        for x, k in zip(solutions, core, strict=True)
    ]


def as_sized(value: Any, core: tuple[int, ...], name: str) -> Array:
    """Floats of shape (..., *core), zero or of a size whose powers are floats."""
    return as_bounded(as_core(value, core, name), name, LARGEST, 1.0 / LARGEST)


def as_points(value: Any, name: str, least: int = 1) -> Array:
    """Points of an object. Shapes: -> (k, 3)."""
    points = as_sized(value, (3,), name)
    points = points[None] if points.ndim == 1 else points
    if points.ndim != 2 or len(points) < least:
        raise ShapeError(f"{name}: expected shape (k, 3), k from {least}, got {points.shape}.")
    return points


def _pairs(value: Any, name: str) -> Array:
    """Distinct pairs of points. Shapes: -> (k, 2, 3)."""
    pairs = as_sized(value, (2, 3), name)
    pairs = pairs[None] if pairs.ndim == 2 else pairs
    if pairs.ndim != 3 or not len(pairs):
        raise ShapeError(f"{name}: expected shape (k, 2, 3), k from 1, got {pairs.shape}.")
    if not (np.linalg.norm(pairs[:, 1] - pairs[:, 0], axis=1) > THIN * np.abs(pairs).max()).all():
        raise InvalidValueError(f"{name}: expected two different points on each line or segment.")
    return pairs


def _vector(value: Any, name: str) -> Array:
    return as_sized(as_exact(value, (3,), name), (3,), name)


def _unit(value: Any, name: str) -> Array:
    """A direction as a unit vector."""
    array = _vector(value, name)
    length = float(np.linalg.norm(array))
    if not length > 0.0:
        raise InvalidValueError(f"{name}: expected a vector that is not zero.")
    # unit vectors stay as they are, so that copies are equal
    return array if abs(length - 1.0) < 4e-16 else array / length


def _positive(value: Any, name: str) -> float:
    return as_number(value, name, above=0.0, below=LARGEST)


def _depth(value: Any, name: str) -> str | float:
    if isinstance(value, str):
        return one_of(value, ("true", "desired"), f"{name}, if not metres")
    return _positive(value, name)


_CHECKS: dict[str, Callable[[Any, str], Any]] = {
    **dict.fromkeys(("centre", "point"), _vector),
    **dict.fromkeys(("normal", "axis"), _unit),
    **dict.fromkeys(("radius", "gain", "process", "noise"), _positive),
    **dict.fromkeys(("distance", "weight"), as_number),
    **dict.fromkeys(("desired", "T_tool_camera", "T_world_camera"), as_single_pose),
    "interaction": lambda value, name: one_of(value, ("current", "desired", "mean"), name),
    "object_points": as_points,
    "points": _pairs,
    "depth": _depth,
    "kalman": as_flag,
}
