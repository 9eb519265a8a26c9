"""Readings and measured values at the border of every kind of measurement."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ... import se3
from ..._arrays import Array, as_floats, read_only
from ...errors import InvalidValueError, ShapeError


def as_readings(value: ArrayLike, name: str = "q") -> Array:
    """Check the joint readings of a measurement. Shapes: value (N, n) -> (N, n)."""
    q = as_floats(value, name)
    if q.ndim != 2:
        raise ShapeError(
            f"{name}: expected shape (N, n), a row for each measurement, got {q.shape}."
        )
    if not len(q):
        raise InvalidValueError(f"{name}: expected one or more measurements, got none.")
    return read_only(q)


def same_number_of_readings(q: Array, q_other: ArrayLike) -> Array:
    """Readings at the other of two configurations, as many as at the first.

    Shapes: q, q_other (N, n) -> (N, n).
    """
    other = as_readings(q_other, "q_other")
    if other.shape != q.shape:
        raise ShapeError(f"q_other: expected the shape of q, {q.shape}, got {other.shape}.")
    return other


def as_rows(rows: Sequence[int | bool], count: int) -> tuple[bool, ...]:
    """Check which rows of a block are measured."""
    asked = tuple(rows)
    if len(asked) != count or any(r not in (0, 1) for r in asked) or not any(asked):
        raise InvalidValueError(
            f"rows: expected {count} numbers 0 or 1, not all 0, got {rows!r:.80}."
        )
    return tuple(bool(r) for r in asked)


def as_measured_poses(T: Any, blocks: int) -> Array:
    """Check measured poses. Shapes: T (B, 4, 4) -> (B, 4, 4)."""
    poses = se3.as_pose(T, "T")
    if poses.shape != (blocks, 4, 4):
        raise ShapeError(
            f"T: expected a pose for each row of q, shape ({blocks}, 4, 4), got {poses.shape}."
        )
    return read_only(poses)


def as_values(values: ArrayLike, blocks: int, name: str) -> Array:
    """Check the measured number of each block. Shapes: values (B,) or () -> (B,)."""
    numbers = as_floats(values, name)
    if numbers.shape not in ((), (blocks,)):
        raise ShapeError(
            f"{name}: expected a number for each row of q, shape ({blocks},), got {numbers.shape}."
        )
    return read_only(np.broadcast_to(numbers, (blocks,)))
