"""Jacobian of operational coordinates by differentiating the direct geometric model.

Seed book section 1.3.1.1: ``J = df/dq`` of eq. [1.5]. First the entries of the pose are
differentiated with respect to the joints, as the product of factors that they are, then the
coordinates with respect to these entries. The screws of the joints take no part, so that this and
``coordinate_rates @ jacobian`` are two ways to the same matrix.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, as_vector, batch_shape
from ...model import RobotModel, check_model
from ._differentials import orientation_differential, orientation_differential_rate
from ._orientation_rates import singular_coordinates
from .conversion import coordinates_of_poses, near_coordinates
from .kinds import OrientationKind, orientation_kind


def coordinate_jacobian(
    model: RobotModel,
    q: ArrayLike,
    kind: str | OrientationKind,
    frame: str | int | None = None,
    near: ArrayLike | None = None,
) -> Array:
    """Jacobian of the operational coordinates, ``dX/dt = J(q) dq/dt``; the analytic Jacobian.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q : array_like, shape (..., n)
        Joint variables, rad or m.
    kind : OrientationKind or str
        How the orientation is written.
    frame : str or int, optional
        Name or number of a frame; default the tool.
    near : array_like, shape (..., m), optional
        The coordinates whose solution is meant, as in `operational_coordinates`.

    Returns
    -------
    ndarray, shape (..., m, n)
        Derivatives of the m coordinates (m and rad) with respect to the joints, in table order.
        Where the representation is singular (`is_representation_singular`; the robot need not be)
        the derivatives of the orientation do not exist, and their rows are NaN.

    Raises
    ------
    ShapeError, InvalidValueError
        ``q`` or ``near`` of the wrong length, or with NaN or infinity; an unknown kind.
    FrameNotFoundError
        No such frame.

    References
    ----------
    Seed book eq. [1.5] and section 1.3.1.1.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> coordinate_jacobian(arm, [0.0, 0.5], "rpy")[[0, 1, 3]]
    array([[0. , 0. ],
           [0.3, 0. ],
           [1. , 1. ]])
    """
    check_model(model)
    q = as_vector(q, model.n, "q")
    kind = orientation_kind(kind)
    point = model.twin.frame(frame)
    from ...kernels.differentiated_poses import differentiated_poses

    batch, (rows,), close = _laid_out((q,), ("q",), kind, near)
    poses, T_j = _room(rows, model.n)
    differentiated_poses(rows, *model.chain, *point.kernel_arguments, poses, T_j)
    y = coordinates_of_poses(poses, kind, close)[:, 3:]
    with np.errstate(divide="ignore", invalid="ignore"):
        y_j = orientation_differential(kind, y[:, None], poses[:, None, :3, :3], T_j[..., :3])
    return _assembled(batch, T_j, y_j, singular_coordinates(y, kind))


def coordinate_jacobian_rate(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    kind: str | OrientationKind,
    frame: str | int | None = None,
    near: ArrayLike | None = None,
) -> Array:
    """Time derivative of `coordinate_jacobian` along a motion, by differentiating twice.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q, v : array_like, shape (..., n)
        Joint variables (rad or m) and velocities; the leading axes broadcast.
    kind, frame, near
        As in `coordinate_jacobian`.

    Returns
    -------
    ndarray, shape (..., m, n)
        ``dJ/dt``, so that ``d2X/dt2 = J a + dJ/dt v``; NaN rows as in `coordinate_jacobian`.

    Raises
    ------
    ShapeError, InvalidValueError, FrameNotFoundError
        As `coordinate_jacobian`.

    References
    ----------
    Seed book section 1.3.1.1 (differentiated).

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> coordinate_jacobian_rate(arm, [0.0, 0.5], [1.0, 0.0], "rpy")[0]
    array([-0.3,  0. ])
    """
    check_model(model)
    q, v = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    kind = orientation_kind(kind)
    point = model.twin.frame(frame)
    from ...kernels.differentiated_poses import differentiated_pose_rates

    batch, (rows, speeds), close = _laid_out((q, v), ("q", "v"), kind, near)
    poses, T_j = _room(rows, model.n)
    T_jt = np.empty(T_j.shape)
    differentiated_pose_rates(rows, speeds, *model.chain, *point.kernel_arguments, poses, T_j, T_jt)
    y = coordinates_of_poses(poses, kind, close)[:, 3:]
    R_t = np.einsum("ij,ijkl->ikl", speeds, T_j[..., :3])
    with np.errstate(divide="ignore", invalid="ignore"):
        y_jt = orientation_differential_rate(
            kind,
            y[:, None],
            poses[:, None, :3, :3],
            T_j[..., :3],
            R_t[:, None],
            T_jt[..., :3],
        )
    return _assembled(batch, T_jt, y_jt, singular_coordinates(y, kind))


def _laid_out(
    vectors: tuple[Array, ...],
    names: tuple[str, ...],
    kind: OrientationKind,
    near: ArrayLike | None,
) -> tuple[tuple[int, ...], list[Array], Array | None]:
    """Joint vectors and coordinates to be near to, broadcast and as contiguous rows."""
    batch = batch_shape(vectors, names)
    close = near_coordinates(near, kind, batch)
    if close is not None:
        batch = np.broadcast_shapes(batch, close.shape[:-1])
    count = int(np.prod(batch))
    rows = [
        np.ascontiguousarray(np.broadcast_to(x, (*batch, x.shape[-1]))).reshape(count, x.shape[-1])
        for x in (vectors if close is None else (*vectors, close))
    ]
    return batch, rows[: len(vectors)], None if close is None else rows[-1]


def _room(rows: Array, n: int) -> tuple[Array, Array]:
    """Poses and their derivatives, to be written."""
    return np.empty((len(rows), 4, 4)), np.empty((len(rows), n, 3, 4))


def _assembled(
    batch: tuple[int, ...], T_j: Array, y_j: Array, singular: NDArray[np.bool_]
) -> Array:
    """Position rows and orientation rows, one column for each joint."""
    N, n, k = y_j.shape
    J = np.empty((N, k + 3, n))
    J[:, :3] = np.swapaxes(T_j[..., 3], 1, 2)
    J[:, 3:] = np.where(singular[:, None, None], np.nan, np.swapaxes(y_j, 1, 2))
    return J.reshape(*batch, k + 3, n)
