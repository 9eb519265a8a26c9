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

Raises
------
ShapeError, InvalidValueError, NotARotationError
    Arrays of the wrong shape, NaN, poses that the platform cannot have or the legs do not reach, no
    such mode, and positions where a leg is straight or has no length.

References
----------
Seed book section 2.3.2.
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
    """Inverse Jacobian of the platform: rows ``[u, (R b) x u]`` of legs with unit vector u.

    Of robots with cranks the rows are divided by the velocities of the knees along the rods.

    Returns
    -------
    ndarray, shape (..., m, 6)
        Matrices from the twist [v; w] to the actuators' velocities.

    Examples
    --------
    >>> from robotmodels.parallel import gough_symmetric
    >>> robot = gough_symmetric(1.0)
    >>> inverse_jacobian(robot, robot.home).shape
    (6, 6)
    """
    check_robot(robot)
    if isinstance(robot, LoopedPlatform):
        return robot.inverse_jacobian(T)
    poses, legs = states(robot, T, mode)
    return (legs.rows / legs.speed[..., None]).reshape(*poses.shape[:-2], robot.m, 6)


def inverse_jacobian_rate(robot: Robot, T: ArrayLike, twist: ArrayLike, mode: Mode = None) -> Array:
    """Time derivative of the inverse Jacobian along a motion of the platform.

    Returns
    -------
    ndarray, shape (..., m, 6)
        ``q'' = J^-1 acceleration + (dJ^-1/dt) twist``.

    Examples
    --------
    >>> from robotmodels.parallel import gough_symmetric
    >>> robot = gough_symmetric(1.0)
    >>> inverse_jacobian_rate(robot, robot.home, [0, 0, 1, 0, 0, 0]).shape
    (6, 6)
    """
    check_robot(robot)
    V = as_core(twist, (6,), "twist")
    if isinstance(robot, LoopedPlatform):
        return robot.inverse_jacobian_rate(T, V)
    poses = np.asarray(robot.checked(T))
    batch = _broadcast(poses.shape[:-2], V.shape[:-1])
    poses = np.broadcast_to(poses, (*batch, 4, 4))
    poses, legs = states(robot, poses, mode)
    V = only_freedoms(robot, np.broadcast_to(V, (*batch, 6)).reshape(-1, 6))
    return rates_of_rows(robot, legs, V).reshape(*batch, robot.m, 6)


def rates_of_rows(robot: ParallelRobot, legs: LegStates, V: Array) -> Array:
    """Time derivative of the inverse Jacobian. Shapes: legs of N poses, V (N, 6) -> (N, m, 6)."""
    v, w = V[:, None, :3], V[:, None, 3:]
    J = legs.rows / legs.speed[..., None]
    q_rate = np.einsum("nij,nj->ni", J, V)
    if robot.has_cranks:
        swing = legs.knee - robot.base
        axis = np.cross(robot.outward, robot.downward)
        turning = np.cross(axis, swing)
        across = v + np.cross(w, legs.arm) - q_rate[..., None] * turning
        size = robot.rod[:, None]
    else:
        size = legs.q[..., None]
        across = v + np.cross(w, legs.arm) - q_rate[..., None] * legs.direction
    turn = across / size  # rate of the unit vector
    arm_rate = np.cross(w, legs.arm)
    rows = np.concatenate(
        (turn, np.cross(arm_rate, legs.direction) + np.cross(legs.arm, turn)), axis=-1
    )
    rows[..., [k for k in range(6) if k not in robot.columns]] = 0.0
    if robot.has_cranks:
        speed_rate = (turn * turning).sum(-1) - q_rate * (legs.direction * swing).sum(-1)
        rows = rows - J * speed_rate[..., None]
    return rows / legs.speed[..., None]


def ikm(robot: Robot, T: ArrayLike, twist: ArrayLike, mode: Mode = None) -> Array:
    """Inverse kinematic model: velocities of the actuators.

    Returns
    -------
    ndarray, shape (..., m)
        m/s or rad/s.

    Examples
    --------
    >>> from robotmodels.parallel import delta, five_bar
    >>> robot = five_bar([[-0.2, 0], [0.2, 0]], 0.4, 0.6)
    >>> ikm(robot, robot.home, [0, 0.1, 0, 0, 0, 0]).round(3) + 0.0
    array([-0.145,  0.145])
    """
    return np.einsum("...ij,...j->...i", *_pair(robot, T, as_core(twist, (6,), "twist"), mode))


def dkm(robot: Robot, T: ArrayLike, q_rate: ArrayLike, mode: Mode = None) -> Array:
    """Direct kinematic model: twist of the platform.

    At parallel singularities the twist is not unique: the one of least norm is returned, angles
    times `ParallelRobot.length`. See `classify_singularity`.

    Returns
    -------
    ndarray, shape (..., 6)
        Twist [v; w], m/s and rad/s.

    Examples
    --------
    >>> from robotmodels.parallel import gough_symmetric
    >>> robot = gough_symmetric(1.0)
    >>> V = [0.1, 0.2, 0.3, 0.1, 0.0, 0.2]
    >>> bool(abs(dkm(robot, robot.home, ikm(robot, robot.home, V)) - V).max() < 1e-12)
    True
    """
    check_robot(robot)
    rate = as_core(q_rate, (robot.m,), "q_rate")
    J, rate = _pair(robot, T, rate, mode)
    return _solved(robot, J, rate)


def ikm_second_order(
    robot: Robot, T: ArrayLike, twist: ArrayLike, acceleration: ArrayLike, mode: Mode = None
) -> Array:
    """Inverse kinematic model of second order: accelerations of the actuators.

    Returns
    -------
    ndarray, shape (..., m)
        m/s^2 or rad/s^2.

    Examples
    --------
    >>> from robotmodels.parallel import gough_symmetric
    >>> robot = gough_symmetric(1.0)
    >>> ikm_second_order(robot, robot.home, [0, 0, 1, 0, 0, 0], np.zeros(6)).shape
    (6,)
    """
    V = as_core(twist, (6,), "twist")
    drift = np.einsum("...ij,...j->...i", inverse_jacobian_rate(robot, T, V, mode), V)
    return ikm(robot, T, as_core(acceleration, (6,), "acceleration"), mode) + drift


def dkm_second_order(
    robot: Robot, T: ArrayLike, q_rate: ArrayLike, q_acceleration: ArrayLike, mode: Mode = None
) -> Array:
    """Direct kinematic model of second order: acceleration of the platform.

    Returns
    -------
    ndarray, shape (..., 6)
        Time derivative of the twist [v; w], m/s^2 and rad/s^2; at parallel singularities as for
        `dkm`.

    Examples
    --------
    >>> from robotmodels.parallel import gough_symmetric
    >>> robot = gough_symmetric(1.0)
    >>> dkm_second_order(robot, robot.home, np.ones(6), np.zeros(6)).shape
    (6,)
    """
    V = dkm(robot, T, q_rate, mode)
    drift = np.einsum("...ij,...j->...i", inverse_jacobian_rate(robot, T, V, mode), V)
    return dkm(robot, T, as_core(q_acceleration, (robot.m,), "q_acceleration") - drift, mode)


def reduced(robot: Robot, J: Array) -> Array:
    """Columns of the twist's components that the platform has. Shapes: (..., m, 6) -> (..., m, m)."""
    return J[..., list(robot.columns)]


def scales(robot: Robot, length: float) -> Array:
    """Units of the twist's components that the platform has: 1 m, or 1/length rad."""
    return np.where(np.array(robot.columns) < 3, 1.0, 1.0 / length)


def states(robot: ParallelRobot, T: ArrayLike, mode: Mode) -> tuple[Array, LegStates]:
    """Poses and the states of the legs of N = product of the batch; raises where one is missing."""
    poses = robot.checked(T)
    rows = poses.reshape(-1, 4, 4)
    legs = leg_states(robot, rows, modes_of(robot, mode, poses.shape[:-2]))
    size = robot.crank if robot.has_cranks else np.ones(robot.m)
    straight = np.abs(legs.speed) <= _STRAIGHT * size
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
    given = np.asarray(0 if mode is None else mode)
    largest = 2**robot.m if robot.has_cranks else 1
    if given.dtype.kind not in "iu" or (
        given.size and not (0 <= given.min() <= given.max() < largest)
    ):
        raise InvalidValueError(
            f"mode: expected whole numbers from 0 to {largest - 1}, as igm(robot, T).mode numbers "
            f"the working modes, got {mode!r:.60}."
        )
    try:
        return np.broadcast_to(given, batch).reshape(-1).astype(np.int64)
    except ValueError:
        raise ShapeError(f"mode: expected a number or shape {batch}, got {given.shape}.") from None


def only_freedoms(robot: Robot, V: Array) -> Array:
    """Twists without the components that the platform does not have."""
    kept = np.zeros(6)
    kept[list(robot.columns)] = 1.0
    return V * kept


def _pair(robot: Robot, T: ArrayLike, x: Array, mode: Mode) -> tuple[Array, Array]:
    """Inverse Jacobians and vectors with the same batch."""
    J = inverse_jacobian(robot, T, mode)
    batch = _broadcast(J.shape[:-2], x.shape[:-1])
    return np.broadcast_to(J, (*batch, *J.shape[-2:])), np.broadcast_to(x, (*batch, x.shape[-1]))


def _broadcast(first: tuple[int, ...], second: tuple[int, ...]) -> tuple[int, ...]:
    try:
        return np.broadcast_shapes(first, second)
    except ValueError:
        raise ShapeError(
            f"The batch axes of poses {first} and vectors {second} do not broadcast; give the same "
            "number of each, or a single one."
        ) from None


def _solved(robot: Robot, J: Array, rate: Array) -> Array:
    """Twists from the actuators' velocities, of least norm at singular poses."""
    unit = scales(robot, robot.length)
    inverse = np.linalg.pinv(reduced(robot, J) * unit, rcond=_SINGULAR)
    V = np.zeros((*rate.shape[:-1], 6))
    V[..., list(robot.columns)] = np.einsum("...ij,...j->...i", inverse, rate) * unit
    return V
