"""Checks that a matrix is a pose; rotations that are nearly orthogonal are made so.

Parameters
----------
T : array_like, shape (..., 4, 4)
    Poses, last row 0 0 0 1.
name : str
    Used in error messages.

Returns
-------
ndarray, shape (..., 4, 4)
    Checked poses.

Raises
------
ShapeError, InvalidValueError, NotARotationError
    Not (..., 4, 4); NaN or infinity; the last row or the rotation is off by more than the
    tolerance, or it is a reflection.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .._arrays import Array, as_core
from ..errors import NotARotationError, ShapeError

ROTATION_TOLERANCE = 1e-6
"""Largest entry of ``R R^T - 1`` (and of ``det R - 1``) that still counts as a rotation."""
_ROUNDED = 0.1
"""Largest deviation of ``R R^T`` from 1 that `nearest_pose` takes for rounding."""


def as_pose(T: Any, name: str = "T") -> Array:
    """Check poses and bring them exactly onto the rotation group.

    Anything with a ``homogeneous`` attribute (``pinocchio.SE3``) is accepted. A rotation that
    is off by more than rounding, but less than `ROTATION_TOLERANCE`, is replaced by the nearest
    rotation (polar decomposition); rotations exact to rounding are left untouched.
    """
    try:
        T = as_core(getattr(T, "homogeneous", T), (4, 4), name)
    except ShapeError as error:
        if np.shape(T) != (3,):
            raise
        mask = " and mask='position'" if name == "T" else ""  # not for a tool or a base
        hint = f"For a position give se3.translation(x, y, z){mask}."
        raise ShapeError(f"{error} {hint}") from None
    if T.size == 0:
        return T
    wanted = (0.0, 0.0, 0.0, 1.0)
    if np.abs(T[..., 3, :] - wanted).max() > ROTATION_TOLERANCE:
        column = np.abs(T[..., :, 3] - wanted).max() <= ROTATION_TOLERANCE
        hint = " It looks transposed: its last column is 0 0 0 1." if column else ""
        raise NotARotationError(f"{name}: the last row of a pose must be 0 0 0 1.{hint}")
    R = T[..., :3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.abs(R @ np.swapaxes(R, -1, -2) - np.eye(3)).max(axis=(-1, -2))
        det = np.linalg.det(R)
    worst = float(off.max())
    if not worst <= ROTATION_TOLERANCE or (det < 0).any():
        fault = det < 0 if worst <= ROTATION_TOLERANCE else off
        i = np.unravel_index(int(fault.argmax()), fault.shape) if off.ndim else ()
        row = f" (row {', '.join(map(str, i))})" if i else ""
        raise NotARotationError(
            f"{name}: the 3x3 block is not a rotation{row}: R R^T differs from 1 by "
            f"{float(off[i]):.2g} and det R = {float(det[i]):.6g}; at most "
            f"{ROTATION_TOLERANCE:g} is accepted and rounded away. `se3.nearest_pose(T)` makes a "
            "typed or rounded matrix a pose."
        )
    T = T.copy()
    T[..., 3, :] = 0.0, 0.0, 0.0, 1.0
    if worst > 4e-15:
        U, _, Vt = np.linalg.svd(R)
        T[..., :3, :3] = np.where((off > 4e-15)[..., None, None], U @ Vt, R)
    return T


def nearest_pose(T: Any) -> Array:
    """The poses nearest to matrices with rounded rotations: typed, read from a file, averaged.

    The 3x3 blocks of the matrices (..., 4, 4) are rotations to 0.1 (entries of ``R R^T - 1``); they
    become the nearest rotations (polar decomposition), positions are unchanged.

    Examples
    --------
    >>> typed = [[0.707, -0.707, 0, 0.1], [0.707, 0.707, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    >>> nearest_pose(typed)[0].round(6)
    array([ 0.707107, -0.707107,  0.      ,  0.1     ])
    """
    T = as_core(getattr(T, "homogeneous", T), (4, 4), "T").copy()
    U, sizes, Vt = np.linalg.svd(T[..., :3, :3])
    off = float(np.abs(sizes**2 - 1.0).max(initial=0.0))
    if off > _ROUNDED:
        raise NotARotationError(
            f"T: the 3x3 block is no rounded rotation: R R^T differs from 1 by {off:.2g}, "
            f"expected at most {_ROUNDED:g}."
        )
    T[..., :3, :3] = U @ Vt
    return as_pose(T)


def as_single_pose(T: Any, name: str) -> Array:
    """One checked pose, shape (4, 4); None is the identity."""
    if T is None:
        return np.eye(4)
    T = as_pose(T, name)
    if T.ndim != 2:
        raise ShapeError(f"{name}: expected one pose of shape (4, 4), got {T.shape}.")
    return T
