"""Operational coordinates of a sequence of poses, without jumps from one sample to the next."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array
from ...errors import ShapeError
from ...se3 import as_pose
from ...se3.orientation import quaternions_of
from ._angles import ANGLE_SEQUENCES, continuous_angles
from ._quaternions import continuous_quaternions, continuous_vectors
from .conversion import as_coordinates, columns_of, in_order
from .kinds import OrientationKind, orientation_kind


def continuous_coordinates(
    T: Any, kind: str | OrientationKind, near: ArrayLike | None = None
) -> Array:
    """Operational coordinates of a sequence of poses, without jumps between neighbours.

    Each sample is what `operational_coordinates` gives near the one before it, without a loop over
    the samples. Angles may leave their range, and a quaternion may have a negative scalar.

    Parameters
    ----------
    T : array_like, shape (N, ..., 4, 4)
        Poses in their order along the first axis; further axes hold further sequences.
    kind : OrientationKind or str
        How the orientation is written.
    near : array_like, shape (..., m), optional
        Coordinates that the first sample is near to. Without it the first sample is as
        `operational_coordinates` gives it; a sequence that begins at gimbal lock begins with the
        first angle that it has when it leaves.

    Returns
    -------
    ndarray, shape (N, ..., m)
        The coordinates. Where a motion goes past a singularity of the representation at a
        distance, its angles do turn quickly; that is in the nature of the angles.

    Raises
    ------
    InvalidValueError, ShapeError, NotARotationError
        As `operational_coordinates`; a single pose is no sequence.

    References
    ----------
    Seed book eq. [1.5] to [1.9].

    Examples
    --------
    >>> from robotmodels.se3 import rotation
    >>> T = np.array([rotation("z", angle) for angle in (3.0, 3.1, 3.2, 3.3)])
    >>> continuous_coordinates(T, "rpy")[:, 3]
    array([3. , 3.1, 3.2, 3.3])
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
            start = np.broadcast_to(start, (*others, start.shape[-1]))
        except ValueError:
            raise ShapeError(
                f"near: expected coordinates for each sequence, shape {(*others, kind.dimension)}"
                f" or one for all, got leading axes {start.shape[:-1]}."
            ) from None
        start = start.reshape(-1, start.shape[-1])
    rows = int(np.prod(others))
    R = np.swapaxes(T[..., :3, :3].reshape(count, rows, 3, 3), 0, 1)
    out = np.empty((count, rows, kind.dimension - 3))
    for i in range(rows):
        out[:, i] = _continuous(
            np.ascontiguousarray(R[i]), kind, None if start is None else start[i]
        )
    out = in_order(kind, out).reshape(count, *others, kind.dimension - 3)
    return np.concatenate([T[..., :3, 3], out], axis=-1)


def _continuous(R: Array, kind: OrientationKind, near: Array | None) -> Array:
    if kind in ANGLE_SEQUENCES:
        return continuous_angles(ANGLE_SEQUENCES[kind], R, near)
    if kind is OrientationKind.QUATERNION:
        return continuous_quaternions(quaternions_of(R), near)
    if kind is OrientationKind.ANGLE_AXIS:
        return continuous_vectors(R, near)
    return columns_of(R, kind)
