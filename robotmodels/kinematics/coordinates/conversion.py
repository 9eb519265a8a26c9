"""Operational coordinates: a pose as a vector X, and back.

Book section 1.2.2, eq. [1.5] to [1.9].

Parameters
----------
T : array_like, shape (..., 4, 4)
    Poses, metres.
kind : OrientationKind or str
    Form of the orientation. **Khalil's roll is about z**; ``"rpy_urdf"`` is the order of URDF.
x : array_like, shape (..., m)
    Position in metres, then the orientation. Angles and rotation vectors may be any.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_vector, batch_shape
from ...errors import NotARotationError, ShapeError
from ...se3 import ROTATION_TOLERANCE, as_pose
from ...se3.orientation import quaternions_of, rotation_vectors_of
from .orientations import (
    ANGLE_SEQUENCES,
    OrientationKind,
    angles_near,
    angles_of,
    continuous_angles,
    continuous_quaternions,
    continuous_vectors,
    in_order,
    orientation_kind,
    quaternions_near,
    quaternions_of_vectors,
    rotation_of_angles,
    rotation_of_quaternions,
    vectors_near,
)


def operational_coordinates(
    T: Any, kind: str | OrientationKind, near: ArrayLike | None = None
) -> Array:
    """Operational coordinates of poses: the position, then the orientation in the chosen form.

    Parameters
    ----------
    near : array_like, shape (..., m), optional
        Coordinates of the same kind, such as those of the sample before; the leading axes
        broadcast. Of all coordinates of the same pose the nearest to these are taken: the other
        solution of three angles, the opposite quaternion, whole turns; at gimbal lock the first
        angle of ``near``.

    Returns
    -------
    ndarray, shape (..., m)
        ``Px Py Pz`` in metres and the orientation: m = 6 with three angles (rad) or a rotation
        vector (rad), 7 with a quaternion, 9 with two axes, 12 with direction cosines. The pose
        comes back to rounding, also at and near gimbal lock (where, without ``near``, the first
        angle is 0) and near half a turn.

    Examples
    --------
    >>> from robotmodels.se3 import rotation, translation
    >>> T = translation(1, 2, 3) @ rotation("z", 0.3) @ rotation("x", 0.2) @ rotation("z", 0.1)
    >>> operational_coordinates(T, "euler").round(12)
    array([1. , 2. , 3. , 0.3, 0.2, 0.1])
    >>> operational_coordinates(T, "euler", near=[1, 2, 3, -2.8, -0.2, 3.3]).round(2)
    array([ 1.  ,  2.  ,  3.  , -2.84, -0.2 ,  3.24])
    """
    kind = orientation_kind(kind)
    T = as_pose(T)
    return coordinates_of_poses(T, kind, near_coordinates(near, kind, T.shape[:-2]))


def pose_from_coordinates(x: ArrayLike, kind: str | OrientationKind) -> Array:
    """Poses of operational coordinates, the inverse of `operational_coordinates`.

    Book eq. [1.8] and [1.9].

    Returns
    -------
    ndarray, shape (..., 4, 4)
        Poses. A quaternion, direction cosines or two axes that are off by no more than 1e-6 are
        brought onto the nearest rotation.
    """
    kind = orientation_kind(kind)
    x = as_coordinates(x, kind, "x")
    T = np.zeros((*x.shape[:-1], 4, 4))
    T[..., :3, 3], T[..., 3, 3] = x[..., :3], 1.0
    y = x[..., 3:]
    if kind in ANGLE_SEQUENCES:
        T[..., :3, :3] = rotation_of_angles(ANGLE_SEQUENCES[kind], in_order(kind, y))
    elif kind is OrientationKind.ANGLE_AXIS:
        T[..., :3, :3] = rotation_of_quaternions(quaternions_of_vectors(y))
    elif kind is OrientationKind.QUATERNION:
        T[..., :3, :3] = rotation_of_quaternions(_unit(y))
    else:
        axes = y.reshape(*y.shape[:-1], y.shape[-1] // 3, 3)
        T[..., :3, 1:3] = np.swapaxes(axes[..., -2:, :], -1, -2)
        T[..., :3, 0] = (
            axes[..., 0, :]
            if kind is OrientationKind.DIRECTION_COSINES
            else np.cross(axes[..., 0, :], axes[..., 1, :])
        )
        T = as_pose(T, f"x ({kind.value.replace('_', ' ')})")
    return T


def continuous_coordinates(
    T: Any, kind: str | OrientationKind, near: ArrayLike | None = None
) -> Array:
    """Operational coordinates of a sequence of poses, without jumps between neighbours.

    Each sample is what `operational_coordinates` gives near the one before it. Angles may leave
    their range, and a quaternion may have a negative scalar.

    Parameters
    ----------
    T : array_like, shape (N, ..., 4, 4)
        Poses in their order along the first axis; further axes hold further sequences.
    near : array_like, shape (..., m), optional
        Coordinates that the first sample is near to. Default: as `operational_coordinates` gives
        it; a sequence that begins at gimbal lock begins with the first angle that it has when it
        leaves.

    Returns
    -------
    ndarray, shape (N, ..., m)
        The coordinates. Where a motion passes a singularity of the representation at a small
        distance, its angles turn quickly.
    """
    kind = orientation_kind(kind)
    T = as_pose(T)
    if T.ndim < 3:
        raise ShapeError(
            "T: expected a sequence of poses, shape (N, ..., 4, 4), got one pose; for one pose "
            "call operational_coordinates(T, kind, near)."
        )
    count, *others = T.shape[:-2]
    start = None
    if near is not None:
        start = in_order(kind, as_coordinates(near, kind, "near")[..., 3:])
        try:
            start = np.broadcast_to(start, (*others, start.shape[-1])).reshape(-1, start.shape[-1])
        except ValueError:
            raise ShapeError(
                f"near: expected coordinates for each sequence, shape {(*others, kind.dimension)}"
                f" or one for all, got leading axes {start.shape[:-1]}."
            ) from None
    rows = int(np.prod(others))
    R = np.swapaxes(T[..., :3, :3].reshape(count, rows, 3, 3), 0, 1)
    out = np.empty((count, rows, kind.dimension - 3))
    for i in range(rows):
        out[:, i] = _continuous(
            np.ascontiguousarray(R[i]), kind, None if start is None else start[i]
        )
    out = in_order(kind, out).reshape(count, *others, kind.dimension - 3)
    return np.concatenate([T[..., :3, 3], out], axis=-1)


def coordinates_of_poses(T: Array, kind: OrientationKind, near: Array | None) -> Array:
    """`operational_coordinates` of checked poses.

    Shapes: T (..., 4, 4), near (..., m) -> (..., m).
    """
    R, p = T[..., :3, :3], T[..., :3, 3]
    y = None if near is None else in_order(kind, near[..., 3:])
    if kind in ANGLE_SEQUENCES:
        sequence = ANGLE_SEQUENCES[kind]
        o, locked = angles_of(sequence, R)
        if y is not None:
            o = angles_near(sequence, R, o, locked, y)
        o = in_order(kind, o)
    elif kind is OrientationKind.QUATERNION:
        o = quaternions_of(R)
        if y is not None:
            o = quaternions_near(o, y)
    elif kind is OrientationKind.ANGLE_AXIS:
        o = rotation_vectors_of(R) if y is None else vectors_near(R, y)
    else:
        o = columns_of(R, kind)
        if y is not None:
            o = np.broadcast_to(o, np.broadcast_shapes(o.shape, y.shape))
    return np.concatenate([np.broadcast_to(p, (*o.shape[:-1], 3)), o], axis=-1)


def as_coordinates(x: ArrayLike, kind: OrientationKind, name: str) -> Array:
    """Finite coordinates of a kind. Shapes: x (..., m) -> (..., m)."""
    try:
        return as_vector(x, kind.dimension, name)
    except ShapeError as error:
        raise ShapeError(
            f"{error} The coordinates {kind.value!r} are {', '.join(kind.labels)}."
        ) from None


def near_coordinates(
    near: ArrayLike | None, kind: OrientationKind, batch: tuple[int, ...]
) -> Array | None:
    """Checked coordinates to be near to, whose leading axes broadcast with those of a batch.

    Shapes: near (..., m) -> (..., m).
    """
    if near is None:
        return None
    checked = as_coordinates(near, kind, "near")
    batch_shape((np.empty((*batch, 1)), checked), ("poses", "near"))
    return checked


def columns_of(R: Array, kind: OrientationKind) -> Array:
    """The columns s, n, a of matrices, or n and a, one behind the other.

    Shapes: R (..., 3, 3) -> (..., 9) or (..., 6).
    """
    first = 0 if kind is OrientationKind.DIRECTION_COSINES else 1
    columns = np.swapaxes(R, -1, -2)[..., first:, :]
    return columns.reshape(*R.shape[:-2], 3 * (3 - first))


def _unit(Q: Array) -> Array:
    """Quaternions of unit length; refused when they are not nearly so."""
    length = np.linalg.norm(Q, axis=-1, keepdims=True)
    if (np.abs(length - 1.0) > ROTATION_TOLERANCE).any():
        raise NotARotationError(
            "x: the quaternion Q1 Q2 Q3 Q4 must have length 1, got "
            f"{length.flat[np.abs(length - 1.0).argmax()]:.9g}; at most {ROTATION_TOLERANCE:g} off "
            "is accepted and rounded away. Divide it by its length if it is meant as a direction."
        )
    return Q / length


def _continuous(R: Array, kind: OrientationKind, near: Array | None) -> Array:
    if kind in ANGLE_SEQUENCES:
        return continuous_angles(ANGLE_SEQUENCES[kind], R, near)
    if kind is OrientationKind.QUATERNION:
        return continuous_quaternions(quaternions_of(R), near)
    if kind is OrientationKind.ANGLE_AXIS:
        return continuous_vectors(R, near)
    return columns_of(R, kind)
