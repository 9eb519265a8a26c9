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
    """Readings of joints at the border of a kind of measurement.

    Parameters
    ----------
    value : array_like, shape (N, n)
        rad or m.
    name : str
        Used in error messages.

    Returns
    -------
    ndarray, shape (N, n)
        Read-only.

    Raises
    ------
    ShapeError, InvalidValueError
        Not a matrix, no rows, NaN.
    """
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

    Parameters
    ----------
    q : ndarray, shape (N, n)
        At the first.
    q_other : array_like, shape (N, n)
        At the other, rad or m.

    Returns
    -------
    ndarray, shape (N, n)
        Read-only.

    Raises
    ------
    ShapeError, InvalidValueError
        Another shape, NaN.
    """
    other = as_readings(q_other, "q_other")
    if other.shape != q.shape:
        raise ShapeError(f"q_other: expected the shape of q, {q.shape}, got {other.shape}.")
    return other


def as_rows(rows: Sequence[int | bool], count: int) -> tuple[bool, ...]:
    """Which rows of a block are measured, at the border of a kind of measurement.

    Parameters
    ----------
    rows : sequence of 0 or 1
        One for each.
    count : int
        How many there are.

    Returns
    -------
    tuple of bool
        At least one is True.

    Raises
    ------
    InvalidValueError
        Another number of them, something else than 0 and 1, none asked.
    """
    asked = tuple(rows)
    if len(asked) != count or any(r not in (0, 1) for r in asked) or not any(asked):
        raise InvalidValueError(
            f"rows: expected {count} numbers 0 or 1, not all 0, got {rows!r:.80}."
        )
    return tuple(bool(r) for r in asked)


def as_measured_poses(T: Any, blocks: int) -> Array:
    """Measured poses at the border of a kind of measurement.

    Parameters
    ----------
    T : array_like, shape (B, 4, 4)
        Metres.
    blocks : int
        Number of blocks B.

    Returns
    -------
    ndarray, shape (B, 4, 4)
        Read-only.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        Another number of them, NaN, no poses.
    """
    poses = se3.as_pose(T, "T")
    if poses.shape != (blocks, 4, 4):
        raise ShapeError(
            f"T: expected a pose for each row of q, shape ({blocks}, 4, 4), got {poses.shape}."
        )
    return read_only(poses)


def as_values(values: ArrayLike, blocks: int, name: str) -> Array:
    """A measured number for each block, at the border of a kind of measurement.

    Parameters
    ----------
    values : array_like, shape (B,) or ()
        One number holds for all.
    blocks : int
        Number of blocks B.
    name : str
        Used in error messages.

    Returns
    -------
    ndarray, shape (B,)
        Read-only.

    Raises
    ------
    ShapeError, InvalidValueError
        Another number of them, NaN.
    """
    numbers = as_floats(values, name)
    if numbers.shape not in ((), (blocks,)):
        raise ShapeError(
            f"{name}: expected a number for each row of q, shape ({blocks},), got {numbers.shape}."
        )
    return read_only(np.broadcast_to(numbers, (blocks,)))
