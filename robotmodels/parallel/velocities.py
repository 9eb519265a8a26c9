"""Kinematic models: inverse Jacobian, velocities and accelerations of legs and platform.

``q' = J^-1 [v; w]`` with the velocity v of the platform's origin and its angular velocity w, world
axes. Columns of components that the platform does not have are zero.

Parameters
----------
robot : ParallelRobot or LoopedPlatform
    The robot, m legs.
T : array_like, shape (..., 4, 4)
    Poses of the platform in the world.
mode : int or array_like of int, shape (...), optional
    Working mode of robots with cranks, as numbered by `igm`; default 0.
twist, acceleration : array_like, shape (..., 6)
    Velocity [v; w] of the platform and its time derivative, m/s, rad/s and per s.
q_rate, q_acceleration : array_like, shape (..., m)
    Velocities and accelerations of the actuators, m/s or rad/s and per s.

Returns
-------
ndarray
    Matrices (..., m, 6), motion of the actuators (..., m), or of the platform (..., 6).

Raises
------
ShapeError, InvalidValueError, NotARotationError
    Arrays of the wrong shape, NaN, poses that the platform cannot have or the legs do not reach, no
    such mode, and positions where a leg is straight or has no length.

References
----------
Seed book section 2.3.2.

Examples
--------
>>> from robotmodels.parallel import gough_symmetric
>>> robot, V = gough_symmetric(1.0), [0.1, 0.2, 0.3, 0.1, 0.0, 0.2]
>>> rates = ikm(robot, robot.home, V)
>>> inverse_jacobian(robot, robot.home).shape, dkm(robot, robot.home, rates).round(6).tolist()
((6, 6), [0.1, 0.2, 0.3, 0.1, 0.0, 0.2])
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_core
from ..errors import InvalidValueError, ShapeError
from .legs import LegStates, check_robot, leg_states
from .looped import LoopedPlatform
from .robot import ParallelRobot

Robot = ParallelRobot | LoopedPlatform
Mode = int | ArrayLike | None
_STRAIGHT = 1e-12
_SINGULAR = 1e-13  # singular values below this, relative, are zero in `dkm`


def inverse_jacobian(robot: Robot, T: ArrayLike, mode: Mode = None) -> Array:
    """Inverse Jacobian (..., m, 6): rows ``[u, (R b) x u]`` of legs with unit vectors u.

    Of robots with cranks they are divided by the velocities of the knees along the rods.
    """
    check_robot(robot)
    if isinstance(robot, LoopedPlatform):
        _only_mode_zero(mode)
        return robot.inverse_jacobian(T)
    poses, legs = states(robot, T, mode)
    return legs.jacobian.reshape(*poses.shape[:-2], robot.m, 6)


def inverse_jacobian_rate(robot: Robot, T: ArrayLike, twist: ArrayLike, mode: Mode = None) -> Array:
    """Time derivative (..., m, 6) of the inverse Jacobian along a motion of the platform."""
    check_robot(robot)
    V = as_core(twist, (6,), "twist")
    if isinstance(robot, LoopedPlatform):
        _only_mode_zero(mode)
        return robot.inverse_jacobian_rate(T, V)
    poses = robot.checked(T)
    batch = broadcast(poses.shape[:-2], V.shape[:-1])
    _, legs = states(robot, np.broadcast_to(poses, (*batch, 4, 4)), mode)
    V = only_freedoms(robot, np.broadcast_to(V, (*batch, 6)).reshape(-1, 6))
    return rates_of_rows(robot, legs, V).reshape(*batch, robot.m, 6)


def ikm(robot: Robot, T: ArrayLike, twist: ArrayLike, mode: Mode = None) -> Array:
    """Inverse kinematic model: velocities of the actuators."""
    return _times(inverse_jacobian(robot, T, mode), as_core(twist, (6,), "twist"))


def dkm(robot: Robot, T: ArrayLike, q_rate: ArrayLike, mode: Mode = None) -> Array:
    """Direct kinematic model: twist of the platform.

    At parallel singularities the twist is not unique: the one of least norm is returned, angles
    times the characteristic length. See `classify_singularity`.
    """
    check_robot(robot)
    rate = as_core(q_rate, (robot.m,), "q_rate")
    columns, unit = list(robot.columns), scales(robot, robot.length)
    J = inverse_jacobian(robot, T, mode)[..., columns] * unit
    inverse: Array = np.linalg.pinv(J, rcond=_SINGULAR)  # type: ignore[assignment]
    part = _times(inverse, rate) * unit
    V = np.zeros((*part.shape[:-1], 6))
    V[..., columns] = part
    return V


def ikm_second_order(
    robot: Robot, T: ArrayLike, twist: ArrayLike, acceleration: ArrayLike, mode: Mode = None
) -> Array:
    """Inverse kinematic model of second order: accelerations of the actuators."""
    drift = _times(inverse_jacobian_rate(robot, T, twist, mode), as_core(twist, (6,), "twist"))
    return ikm(robot, T, acceleration, mode) + drift


def dkm_second_order(
    robot: Robot, T: ArrayLike, q_rate: ArrayLike, q_acceleration: ArrayLike, mode: Mode = None
) -> Array:
    """Direct kinematic model of second order: time derivative of the twist; see `dkm`."""
    V = dkm(robot, T, q_rate, mode)
    drift = _times(inverse_jacobian_rate(robot, T, V, mode), V)
    return dkm(robot, T, as_core(q_acceleration, (robot.m,), "q_acceleration") - drift, mode)


def rates_of_rows(robot: ParallelRobot, legs: LegStates, V: Array) -> Array:
    """Time derivative of the inverse Jacobian. Shapes: legs of N poses, V (N, 6) -> (N, m, 6)."""
    v, w = V[:, None, :3], V[:, None, 3:]
    J, u = legs.jacobian, legs.direction
    rate = np.einsum("nij,nj->ni", J, V)[..., None]
    spin = np.cross(w, legs.arm)
    swing = legs.knee - robot.base
    turning = np.cross(np.cross(robot.outward, robot.downward), swing)
    # rate of the unit vectors
    if robot.has_cranks:
        turn = (v + spin - rate * turning) / robot.rod[:, None]
    else:
        turn = (v + spin - rate * u) / legs.q[..., None]
    moments: Array = np.cross(spin, u) + np.cross(legs.arm, turn)  # type: ignore[assignment]
    rows = np.concatenate((turn, moments), axis=-1)
    rows = only_freedoms(robot, rows)
    if robot.has_cranks:
        slower = (turn * turning).sum(-1, keepdims=True) - rate * (u * swing).sum(-1, keepdims=True)
        rows = rows - J * slower
    return rows / legs.speed[..., None]


def scales(robot: Robot, length: float) -> Array:
    """Units of the twist's components that the platform has: 1 m, or 1/length rad."""
    return np.where(np.array(robot.columns) < 3, 1.0, 1.0 / length)


def states(robot: ParallelRobot, T: ArrayLike, mode: Mode) -> tuple[Array, LegStates]:
    """Checked poses and the states of the legs in N rows; raises where one is missing."""
    poses = robot.checked(T)
    legs = leg_states(robot, poses.reshape(-1, 4, 4), modes_of(robot, mode, poses.shape[:-2]))
    straight = np.abs(legs.speed) <= _STRAIGHT * (robot.crank if robot.has_cranks else 1.0)
    for n, i in np.argwhere(straight | ~legs.reached[:, None])[:1]:
        row = f" of row {n}" if poses.ndim > 2 else ""
        if not legs.reached[n]:
            raise InvalidValueError(
                f"T: the pose{row} is out of reach of the legs, so that there is no Jacobian; see "
                "igm(robot, T).status."
            )
        why = "is straight (serial singularity)" if robot.has_cranks else "has no length"
        raise InvalidValueError(
            f"T: leg {i + 1} {why} at the pose{row}, so that its velocity is not determined; see "
            "classify_singularity."
        )
    return poses, legs


def modes_of(robot: ParallelRobot, mode: Mode, batch: tuple[int, ...]) -> NDArray[np.int64]:
    """Checked working modes of N poses. Shapes: -> (N,)."""
    given, most = np.asarray(0 if mode is None else mode), 2**robot.m if robot.has_cranks else 1
    if given.dtype.kind not in "iu" or ((given < 0) | (given >= most)).any():
        raise InvalidValueError(
            f"mode: expected whole numbers from 0 to {most - 1}, as igm(robot, T).mode numbers the "
            f"working modes, got {mode!r:.60}."
        )
    if broadcast(given.shape, batch) != batch:
        raise ShapeError(f"mode: expected a number or shape {batch}, got {given.shape}.")
    return np.broadcast_to(given, batch).reshape(-1).astype(np.int64)


def _only_mode_zero(mode: Mode) -> None:
    """Raise for working modes of kinematic loops, which are not numbered."""
    if mode is not None and np.any(np.asarray(mode) != 0):
        raise InvalidValueError(
            f"mode: a robot from from_loops has the working mode of its home alone, got "
            f"{mode!r:.40}; give from_loops another q_home."
        )


def only_freedoms(robot: Robot, V: Array) -> Array:
    """Twists or rows without the components that the platform does not have."""
    return V * np.isin(np.arange(6), robot.columns)


def broadcast(first: tuple[int, ...], second: tuple[int, ...]) -> tuple[int, ...]:
    """Batch of two arguments."""
    try:
        return np.broadcast_shapes(first, second)
    except ValueError:
        raise ShapeError(
            f"The batch axes {first} and {second} do not broadcast; give the same number of rows "
            "in each, or a single one."
        ) from None


def _times(J: Array, x: Array) -> Array:
    """Products of matrices and vectors with batches."""
    broadcast(J.shape[:-2], x.shape[:-1])
    return np.einsum("...ij,...j->...i", J, x)
