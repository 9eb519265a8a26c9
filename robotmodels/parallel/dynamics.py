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
tau : array_like, shape (..., m)
    Forces of the actuators, N, or torques, N m.
wrench : array_like, shape (..., 6), optional
    Wrench [f; m] of the platform on the environment at its origin, world axes, N and N m.
mode : int or array_like of int, shape (...), optional
    Working mode of robots with cranks; default 0.

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

from .._arrays import Array
from ..errors import InvalidValueError
from .legs import LegStates, Mode, Robot, is_looped
from .robot import Masses, ParallelRobot, only_freedoms
from .velocities import rates_of_rows, scales, states

_SINGULAR = 1e-12  # smallest singular value, relative
_POSE = (
    "T: the pose of row {} is singular: no bounded forces of the legs balance every load; see "
    "classify_singularity and leg_forces."
)
_MASS = (
    "robot: the mass matrix of the platform is singular at row {}; give the platform mass and "
    "inertia by with_masses."
)


def idm(
    robot: Robot,
    T: ArrayLike,
    V: ArrayLike,
    A: ArrayLike,
    wrench: ArrayLike | None = None,
    mode: Mode = None,
) -> Array:
    """Inverse dynamic model: forces or torques of the actuators for a motion of the platform."""
    load = np.zeros(6) if wrench is None else wrench
    if is_looped(robot, mode):
        return robot.idm(T, V, A, load)
    batch, T, legs, (V, A, W) = states(robot, mode, T, V=V, A=A, wrench=load)
    columns, unit = list(robot.columns), scales(robot, robot.length)
    B = np.swapaxes(legs.jacobian[..., columns] * unit, -1, -2)
    total = (_wrench(robot, T, legs, V, A) + W)[:, columns]
    return _solved(B, total * unit, _POSE).reshape(*batch, robot.m)


def ddm(
    robot: Robot,
    T: ArrayLike,
    V: ArrayLike,
    tau: ArrayLike,
    wrench: ArrayLike | None = None,
    mode: Mode = None,
) -> Array:
    """Direct dynamic model: acceleration of the platform under forces of the actuators."""
    load = np.zeros(6) if wrench is None else wrench
    if is_looped(robot, mode):
        return robot.ddm(T, V, tau, load)
    batch, T, legs, (V, force, W) = states(robot, mode, T, V=V, tau=tau, wrench=load)
    columns, unit = list(robot.columns), scales(robot, robot.length)
    M, h = _mass_matrix(robot, T, legs, V)
    rest = (np.einsum("nij,ni->nj", legs.jacobian, force) - h - W)[:, columns]
    out = np.zeros((len(T), 6))
    out[:, columns] = _solved(M * unit * unit[:, None], rest * unit, _MASS) * unit
    return out.reshape(*batch, 6)


def energies(
    robot: ParallelRobot, T: ArrayLike, V: ArrayLike, mode: Mode = None
) -> tuple[Array, Array]:
    """Kinetic and potential energy (...) of platform and legs, J; potential zero at the origin."""
    if is_looped(robot, mode):
        raise InvalidValueError("robot: energies of kinematic loops are those of their tree.")
    batch, T, legs, (V,) = states(robot, mode, T, V=V)
    masses, v = _masses(robot), V[:, list(robot.columns)]
    kinetic = 0.5 * np.einsum("ni,nij,nj->n", v, _mass_matrix(robot, T, legs, V)[0], v)
    (m1, s1, _), (m2, s2, _) = masses.first.T[..., None], masses.second.T[..., None]
    if robot.has_cranks:
        along = (legs.knee - robot.base) / robot.crank[:, None]
        second = legs.knee + s2 * legs.direction
    else:
        along = legs.direction
        second = T[:, None, :3, 3] + legs.arm - s2 * along
    moment = masses.mass * (T[:, :3, 3] + T[:, :3, :3] @ masses.com)
    moment += (m1 * (robot.base + s1 * along) + m2 * second).sum(axis=1)
    return kinetic.reshape(batch), (-moment @ robot.gravity).reshape(batch)


def _masses(robot: ParallelRobot) -> Masses:
    if robot.masses is None:
        raise InvalidValueError(
            "robot: it has no masses; give them by robot.with_masses((mass, com, inertia))."
        )
    return robot.masses


def _mass_matrix(robot: ParallelRobot, T: Array, legs: LegStates, V: Array) -> tuple[Array, Array]:
    """Mass matrix of the platform's freedoms, and wrench (N, 6) at zero acceleration."""
    columns, parts = list(robot.columns), LegStates(*(x[:, None] for x in legs))
    A = np.concatenate((np.zeros((1, 6)), np.eye(6)[columns]))
    F = _wrench(robot, T[:, None], parts, V[:, None], A)
    M = (F[:, 1:] - F[:, :1])[..., columns]
    return 0.5 * (M + np.swapaxes(M, 1, 2)), F[:, 0]


def _wrench(robot: ParallelRobot, T: Array, legs: LegStates, V: Array, A: Array) -> Array:
    """Wrench that moves platform and legs, at the platform's origin. Shapes: (..., 6)."""
    masses = _masses(robot)
    v, w, a, alpha = V[..., :3], V[..., 3:], A[..., :3], A[..., 3:]
    R = T[..., :3, :3]
    r, inertia = R @ masses.com, R @ masses.inertia @ np.swapaxes(R, -1, -2)
    force = masses.mass * (a + np.cross(alpha, r) + np.cross(w, np.cross(w, r)) - robot.gravity)
    moment = np.einsum("...ij,...j->...i", inertia, alpha) + np.cross(r, force)
    moment = moment + np.cross(w, np.einsum("...ij,...j->...i", inertia, w))
    # anchors on the platform
    w, alpha = w[..., None, :], alpha[..., None, :]
    spin = np.cross(w, legs.arm)
    acceleration = a[..., None, :] + np.cross(alpha, legs.arm) + np.cross(w, spin)
    if robot.has_cranks:
        at_anchor, torque = _crank_forces(robot, masses, legs, V, A, acceleration)
    else:
        torque = np.zeros(legs.q.shape)
        at_anchor = _strut_forces(robot, masses, legs, v[..., None, :] + spin, acceleration)
    force = force + at_anchor.sum(axis=-2)
    moment = moment + np.cross(legs.arm, at_anchor).sum(axis=-2)
    total = only_freedoms(robot, np.concatenate((force, moment), axis=-1))
    return total + np.einsum("...ij,...i->...j", legs.jacobian, torque)


def _strut_forces(
    robot: ParallelRobot, masses: Masses, legs: LegStates, velocity: Array, acceleration: Array
) -> Array:
    """Forces on the anchors that move legs of variable length. Shapes: (..., m, 3)."""
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
    """Forces on the anchors, torques that move cranks and rods. Shapes: (..., m, 3), (..., m)."""
    m1, s1, i1 = masses.first.T
    m2, s2, i2 = (x[:, None] for x in masses.second.T)
    rate = np.einsum("...ij,...j->...i", legs.jacobian, V)
    second = np.einsum("...ij,...j->...i", legs.jacobian, A)
    second += np.einsum("...ij,...j->...i", rates_of_rows(robot, legs, V), V)
    swing, rod, turning = legs.knee - robot.base, robot.rod[:, None], legs.turning
    knee = second[..., None] * turning - (rate**2)[..., None] * swing
    bend = (acceleration - knee) / rod  # u''
    force, couple = m2 * (knee + s2 * bend - robot.gravity), i2 * bend / rod
    torque = (i1 + m1 * s1**2) * second - m1 * s1 / robot.crank * (turning @ robot.gravity)
    at_knee = (1.0 - s2 / rod) * force - couple
    return s2 / rod * force + couple, torque + (turning * at_knee).sum(axis=-1)


def _solved(B: Array, x: Array, words: str) -> Array:
    """Solutions of B y = x; raises for singular matrices. Shapes: (N, m, m), (N, m) -> (N, m)."""
    s = np.linalg.svd(B, compute_uv=False)
    for n in np.flatnonzero(~(s[:, -1] > _SINGULAR * s[:, 0]))[:1]:
        raise InvalidValueError(words.format(n))
    return np.linalg.solve(B, x[..., None])[..., 0]
