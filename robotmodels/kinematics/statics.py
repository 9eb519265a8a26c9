"""Static model: joint torques that balance a wrench, and wrenches seen from elsewhere.

A wrench ``[f; m]`` is what the tool exerts on the environment, as in `idm`; by the principle of
virtual work ``tau = J^T w`` (Khalil and Dombre, Modeling, identification and control of robots,
section 5.9).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector, batch_rows, batch_shape
from ..model import RobotModel, check_model
from ..se3 import as_pose
from .jacobians import Reference, jacobian


def static_torque(
    model: RobotModel,
    q: ArrayLike,
    wrench: ArrayLike,
    frame: str | int | None = None,
    reference: Reference = "world_aligned",
    gravity: bool = False,
) -> Array:
    """Joint torques that balance a wrench on a frame, ``J^T w``; also called the static model.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q : array_like, shape (..., n)
        Joint variables, rad or m; the leading axes broadcast with those of the wrench.
    wrench : array_like, shape (..., 6)
        Force and moment ``[f; m]`` (N, N m) that the frame exerts on the environment.
    frame : str or int, optional
        Name or number of the frame that exerts it; default the tool.
    reference : {"world_aligned", "local", "world"}
        Where the wrench is taken and in which axes, as in `jacobian`: at the frame's origin in
        world axes, at the frame's origin in its own axes, or at the world's origin.
    gravity : bool
        Whether the torques that hold the links against gravity are added. Drives are not: at rest
        dry friction can be anything within its bounds.

    Returns
    -------
    ndarray, shape (..., n)
        Torques (N m) or forces (N) in table order.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity; an unknown reference.
    FrameNotFoundError
        No such frame.

    References
    ----------
    Khalil and Dombre, section 5.9.2.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> static_torque(arm, [0.0, 0.0], [0.0, 10.0, 0.0, 0.0, 0.0, 0.0])
    array([3., 0.])
    """
    check_model(model)
    q, w = as_vector(q, model.n, "q"), as_vector(wrench, 6, "wrench")
    batch_shape((q, w), ("q", "wrench"))
    tau = np.einsum("...ij,...i->...j", jacobian(model, q, frame, reference), w, order="C")
    return tau + weight_torque(model, q) if gravity else tau


def transported_wrench(wrench: ArrayLike, T: Any) -> Array:
    """The same wrench at another point and in other axes.

    ``f' = R f`` and ``m' = R m + P x R f``.

    Parameters
    ----------
    wrench : array_like, shape (..., 6)
        Force and moment ``[f; m]`` (N, N m) in a frame, about its origin.
    T : array_like, shape (..., 4, 4)
        Pose of that frame in the frame in which the wrench is wanted; the leading axes broadcast.

    Returns
    -------
    ndarray, shape (..., 6)
        Force and moment about the origin of the other frame, in its axes.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        No wrench, or no pose.

    References
    ----------
    Khalil and Dombre, section 5.9.1.

    Examples
    --------
    >>> from robotmodels.se3 import translation
    >>> transported_wrench([0.0, 10.0, 0.0, 0.0, 0.0, 0.0], translation(0.3, 0.0, 0.0))
    array([ 0., 10.,  0.,  0.,  0.,  3.])
    """
    w, T = as_vector(wrench, 6, "wrench"), as_pose(T)
    batch_shape((w, T[..., 0, :]), ("wrench", "T"))
    R, P = T[..., :3, :3], T[..., :3, 3]
    force = np.einsum("...ij,...j->...i", R, w[..., :3])
    moment = np.einsum("...ij,...j->...i", R, w[..., 3:]) + np.cross(P, force)
    return np.concatenate((force, moment), axis=-1)


def weight_torque(model: RobotModel, q: Array) -> Array:
    """Torques that hold the links against gravity."""
    from ..kernels.torques import joint_torques

    batch, (rows,) = batch_rows((q,), ("q",))
    rest = np.zeros_like(rows)
    out = np.empty(rows.shape)
    joint_torques(rows, rest, rest, model.chain, model.inertia.values, model.gravity, out)
    return out.reshape(*batch, model.n)
