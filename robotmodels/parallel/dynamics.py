"""Dynamic models in Khalil's form: the wrench of the platform and of all legs on its coordinates.

``J^-T tau = F_platform + sum (dq_i/dX)^T H_i + wrench``; the motion of the legs follows from that
of their anchors on the platform.

Parameters
----------
robot : ParallelRobot or LoopedPlatform
    The robot with masses, see `ParallelRobot.with_masses`.
T : array_like, shape (..., 4, 4)
    Poses of the platform in the world.
V, A : array_like, shape (..., 6)
    Twist [v; w] of the platform and its time derivative, world axes, m/s, rad/s and per s.
wrench : array_like, shape (..., 6), optional
    Wrench [f; m] of the platform on the environment at its origin, world axes, N and N m.
mode : int, optional
    Working mode of robots with cranks; default 0.

tau : array_like, shape (..., m)
    Forces of the actuators, N, or torques, N m.

Returns
-------
ndarray
    Forces (..., m), or the acceleration (..., 6) of the platform.

Raises
------
ShapeError, InvalidValueError, NotARotationError
    As for `inverse_jacobian`; a robot without masses; singular poses, where no bounded forces move
    the platform or the accelerations are not unique.

References
----------
W. Khalil and O. Ibrahim, "General solution for the dynamic modeling of parallel robots", J. of
Intelligent and Robotic Systems 49 (2007) 19-37.

Examples
--------
>>> from robotmodels.parallel import gough_symmetric
>>> robot = gough_symmetric(1.0).with_masses(platform=(6.0, [0, 0, 0], 0.1 * np.eye(3)))
>>> idm(robot, robot.home, np.zeros(6), np.zeros(6)).round(3)
array([11.772, 11.772, 11.772, 11.772, 11.772, 11.772])
>>> ddm(robot, robot.home, np.zeros(6), np.zeros(6)).round(2) + 0.0
array([ 0.  ,  0.  , -9.81,  0.  ,  0.  ,  0.  ])
>>> float(energies(robot, robot.home, [0, 0, 1, 0, 0, 0])[0].round(6))
3.0
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_core
from ..errors import InvalidValueError
from .legs import LegStates, check_robot
from .looped import LoopedPlatform
from .robot import Masses, ParallelRobot
from .velocities import Mode, Robot, broadcast, only_freedoms, rates_of_rows, scales, states

_SINGULAR = 1e-12  # smallest singular value, relative


def idm(
    robot: Robot,
    T: ArrayLike,
    V: ArrayLike,
    A: ArrayLike,
    wrench: ArrayLike | None = None,
    mode: Mode = None,
) -> Array:
    """Inverse dynamic model: forces or torques of the actuators for a motion of the platform."""
    check_robot(robot)
    if isinstance(robot, LoopedPlatform):
        return robot.idm(T, V, A, wrench)
    batch, T, V, A, W = _rows(robot, T, V, A, wrench)
    legs = states(robot, T, mode)[1]
    total = _wrench(robot, T, legs, V, A) + W
    columns, unit = list(robot.columns), scales(robot, robot.length)
    B = np.swapaxes(legs.jacobian[..., columns] * unit, -1, -2)
    _check_regular(B)
    tau: Array = np.linalg.solve(B, (total[..., columns] * unit)[..., None])  # type: ignore[assignment]
    return tau.reshape(*batch, robot.m)


def ddm(
    robot: Robot,
    T: ArrayLike,
    V: ArrayLike,
    tau: ArrayLike,
    wrench: ArrayLike | None = None,
    mode: Mode = None,
) -> Array:
    """Direct dynamic model: acceleration of the platform under forces of the actuators."""
    check_robot(robot)
    force = as_core(tau, (robot.m,), "tau")
    if isinstance(robot, LoopedPlatform):
        return robot.ddm(T, V, force, wrench)
    zero = np.zeros((*force.shape[:-1], 6))
    batch, T, V, _, W = _rows(robot, T, V, zero, wrench)
    legs, columns = states(robot, T, mode)[1], list(robot.columns)
    force = np.broadcast_to(force, (*batch, robot.m)).reshape(-1, robot.m)
    M, h = _mass_matrix(robot, T, legs, V)
    unit = scales(robot, robot.length)
    M = M * unit * unit[:, None]
    _check_regular(M, "mass")
    rest = np.einsum("nij,ni->nj", legs.jacobian, force)[:, columns] - (h + W)[:, columns]
    out = np.zeros((len(T), 6))
    out[:, columns] = np.linalg.solve(M, (rest * unit)[..., None])[..., 0] * unit
    return out.reshape(*batch, 6)


def energies(
    robot: ParallelRobot, T: ArrayLike, V: ArrayLike, mode: Mode = None
) -> tuple[Array, Array]:
    """Kinetic and potential energy (...) of platform and legs, J; potential zero at the origin."""
    check_robot(robot)
    if isinstance(robot, LoopedPlatform):
        raise InvalidValueError("robot: energies of kinematic loops are those of their tree.")
    batch, T, V, _, _ = _rows(robot, T, V, np.zeros(6), None)
    legs = states(robot, T, mode)[1]
    M, _ = _mass_matrix(robot, T, legs, V)
    v = V[:, list(robot.columns)]
    kinetic = 0.5 * np.einsum("ni,nij,nj->n", v, M, v)
    masses = _masses(robot)
    (m1, s1, _), (m2, s2, _) = masses.first.T, masses.second.T
    if robot.has_cranks:
        along = (legs.knee - robot.base) / robot.crank[:, None]
        second = legs.knee + s2[:, None] * legs.direction
    else:
        along = legs.direction
        second = T[:, None, :3, 3] + legs.arm - s2[:, None] * along
    moment = masses.mass * (T[:, :3, 3] + T[:, :3, :3] @ masses.com)
    moment += np.einsum("i,nij->nj", m1, robot.base + s1[:, None] * along)
    moment += np.einsum("i,nij->nj", m2, second)
    return kinetic.reshape(batch), (-moment @ robot.gravity).reshape(batch)


def _masses(robot: ParallelRobot) -> Masses:
    if robot.masses is None:
        raise InvalidValueError(
            "robot: it has no masses; give them by robot.with_masses((mass, com, inertia))."
        )
    return robot.masses


def _rows(
    robot: ParallelRobot, T: ArrayLike, V: ArrayLike, A: ArrayLike, wrench: ArrayLike | None
) -> tuple[tuple[int, ...], Array, Array, Array, Array]:
    """Checked arguments as N rows."""
    T = robot.checked(T)
    V, A = as_core(V, (6,), "V"), as_core(A, (6,), "A")
    W = as_core(np.zeros(6) if wrench is None else wrench, (6,), "wrench")
    batch = T.shape[:-2]
    for x in (V, A, W):
        batch = broadcast(batch, x.shape[:-1])
    flat = [np.broadcast_to(x, (*batch, 6)).reshape(-1, 6) for x in (V, A, W)]
    V, A = only_freedoms(robot, flat[0]), only_freedoms(robot, flat[1])
    return batch, np.broadcast_to(T, (*batch, 4, 4)).reshape(-1, 4, 4), V, A, flat[2]


def _mass_matrix(robot: ParallelRobot, T: Array, legs: LegStates, V: Array) -> tuple[Array, Array]:
    """Mass matrix of the platform's freedoms and wrench at zero acceleration."""
    columns = list(robot.columns)
    h = _wrench(robot, T, legs, V, np.zeros_like(V))
    M = np.empty((len(T), robot.m, robot.m))
    for k, column in enumerate(columns):
        unit = np.zeros_like(V)
        unit[:, column] = 1.0
        M[:, :, k] = (_wrench(robot, T, legs, V, unit) - h)[:, columns]
    return 0.5 * (M + np.swapaxes(M, 1, 2)), h


def _wrench(robot: ParallelRobot, T: Array, legs: LegStates, V: Array, A: Array) -> Array:
    """Wrench that moves platform and legs, at the platform's origin. Shapes: (N, 6) -> (N, 6)."""
    masses = _masses(robot)
    v, w, a, alpha = V[:, :3], V[:, 3:], A[:, :3], A[:, 3:]
    R = T[:, :3, :3]
    r = R @ masses.com
    inertia = R @ masses.inertia @ np.swapaxes(R, 1, 2)
    force = masses.mass * (a + np.cross(alpha, r) + np.cross(w, np.cross(w, r)) - robot.gravity)
    moment = np.einsum("nij,nj->ni", inertia, alpha) + np.cross(r, force)
    moment = moment + np.cross(w, np.einsum("nij,nj->ni", inertia, w))
    total = np.concatenate((force, moment), axis=1)
    # anchors on the platform
    w, alpha = w[:, None], alpha[:, None]
    spin = np.cross(w, legs.arm)
    velocity = v[:, None] + spin
    acceleration = a[:, None] + np.cross(alpha, legs.arm) + np.cross(w, spin)
    total = only_freedoms(robot, total)
    if robot.has_cranks:
        at_anchor, torque = _crank_forces(robot, masses, legs, V, A, acceleration)
        total += np.einsum("nij,ni->nj", legs.jacobian, torque)
    else:
        at_anchor = _strut_forces(robot, masses, legs, velocity, acceleration)
    on_platform = (at_anchor.sum(axis=1), np.cross(legs.arm, at_anchor).sum(axis=1))
    return total + only_freedoms(robot, np.concatenate(on_platform, axis=1))


def _strut_forces(
    robot: ParallelRobot, masses: Masses, legs: LegStates, velocity: Array, acceleration: Array
) -> Array:
    """Forces on the anchors that move legs of variable length. Shapes: (N, m, 3)."""
    u, size = legs.direction, legs.q[..., None]
    (m1, s1, i1), (m2, s2, i2) = (part.T[:, :, None] for part in (masses.first, masses.second))
    rate = (u * velocity).sum(axis=-1, keepdims=True)
    turn = (velocity - rate * u) / size
    second = (u * acceleration + size * turn**2).sum(axis=-1, keepdims=True)
    bend = (acceleration - second * u - 2.0 * rate * turn) / size  # u''
    first = m1 * (s1 * bend - robot.gravity)
    last = m2 * (acceleration - s2 * bend - robot.gravity)
    across = (s1 * first - s2 * last + (i1 + i2) * bend) / size
    return last + across - (u * across).sum(axis=-1, keepdims=True) * u


def _crank_forces(
    robot: ParallelRobot, masses: Masses, legs: LegStates, V: Array, A: Array, acceleration: Array
) -> tuple[Array, Array]:
    """Forces on the anchors and torques that move cranks and rods. Shapes: (N, m, 3), (N, m)."""
    m1, s1, i1 = masses.first.T
    m2, s2, i2 = (x[:, None] for x in masses.second.T)
    rate = np.einsum("nij,nj->ni", legs.jacobian, V)
    second = np.einsum("nij,nj->ni", legs.jacobian, A)
    second += np.einsum("nij,nj->ni", rates_of_rows(robot, legs, V), V)
    swing, rod = legs.knee - robot.base, robot.rod[:, None]
    turning = np.cross(np.cross(robot.outward, robot.downward), swing)
    knee = second[..., None] * turning - (rate**2)[..., None] * swing
    bend = (acceleration - knee) / rod  # u''
    force, couple = m2 * (knee + s2 * bend - robot.gravity), i2 * bend / rod
    torque = (i1 + m1 * s1**2) * second - m1 * s1 / robot.crank * (turning @ robot.gravity)
    at_knee = (1.0 - s2 / rod) * force - couple
    return s2 / rod * force + couple, torque + (turning * at_knee).sum(axis=-1)


def _check_regular(B: Array, what: str = "") -> None:
    """Raise for singular matrices. Shapes: (N, m, m)."""
    s = np.linalg.svd(B, compute_uv=False)
    for n in np.flatnonzero(~(s[:, -1] > _SINGULAR * s[:, 0]))[:1]:
        if what:
            raise InvalidValueError(
                f"robot: the mass matrix of the platform is singular at row {n}; give the platform "
                "mass and inertia by with_masses."
            )
        raise InvalidValueError(
            f"T: the pose of row {n} is singular: no bounded forces of the legs balance every "
            "load; see classify_singularity and leg_forces."
        )
