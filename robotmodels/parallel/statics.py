"""Statics and indices: forces of the legs, stiffness, maneuverability, condition number.

Parameters
----------
robot : ParallelRobot or LoopedPlatform
    The robot, m legs.
T : array_like, shape (..., 4, 4)
    Poses of the platform in the world.
mode : int or array_like of int, shape (...), optional
    Working mode of robots with cranks, as numbered by `igm`; default 0.
wrench : array_like, shape (..., 6)
    Wrench [f; m] of the platform at its origin, exerted on the environment, world axes, N and N m.
k : array_like, scalar or shape (m,)
    Stiffness of the actuators, N/m or N m/rad, not negative.
length : float, optional
    Metres that equal a radian; default `ParallelRobot.length`. The indices mean nothing without
    it where the platform also rotates.

Returns
-------
ndarray, shape (...) or (..., 6, 6)
    The index or matrix.

Raises
------
ShapeError, InvalidValueError, NotARotationError
    As for `inverse_jacobian`; negative stiffness, a length that is not positive.

References
----------
Seed book sections 2.3.3.1 (statics) and 2.3.3.4 (maneuverability and condition number).

Examples
--------
>>> from robotmodels.parallel import gough_symmetric
>>> robot = gough_symmetric(1.0)
>>> leg_forces(robot, robot.home, [0, 0, 60, 0, 0, 0]).forces.round(2)
array([12., 12., 12., 12., 12., 12.])
>>> stiffness(robot, robot.home, 1e6).shape, bool(condition(robot, robot.home) < 10.0)
((6, 6), True)
>>> turned = robot.pose([0, 0, 1, 0, 0, np.pi / 2])
>>> bool(abs(determinant(robot, turned)) < 1e-12), leg_forces(robot, turned, np.ones(6)).reason()
(True, 'The pose is singular: no bounded forces of the legs balance every wrench.')
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_core, as_floats, as_number
from .._outcomes import Outcome
from ..errors import InvalidValueError, ShapeError
from .legs import check_robot, leg_states
from .looped import LoopedPlatform
from .results import Result
from .robot import ParallelRobot
from .velocities import Mode, Robot, broadcast, inverse_jacobian, modes_of, scales

_SINGULAR = 1e-12  # smallest singular value, relative


class ForceStatus(Outcome):
    """Outcome of the statics of a pose."""

    BALANCED = 0, "The forces of the legs balance the wrench."
    UNBOUNDED = 1, "The pose is singular: no bounded forces of the legs balance every wrench."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LegForces(Result):
    """Forces of the actuators that balance a wrench. Read-only.

    Parameters
    ----------
    forces : ndarray, shape (..., m)
        N, positive where a leg pushes, or N m of cranks; NaN at singular poses.
    status : ndarray of int8, shape (...)
        Codes of `ForceStatus`.
    """

    outcomes: ClassVar = ForceStatus
    forces: Array
    status: NDArray[np.int8]


def leg_forces(robot: Robot, T: ArrayLike, wrench: ArrayLike, mode: Mode = None) -> LegForces:
    """Forces or torques of the actuators for a wrench: ``J^-T forces = wrench``.

    Components of the wrench that the platform cannot move along are borne by the joints.
    """
    J, W = _unitless(robot, T, None, mode), as_core(wrench, (6,), "wrench")
    batch = broadcast(J.shape[:-2], W.shape[:-1])
    U, s, Vt = np.linalg.svd(np.swapaxes(J, -1, -2))
    singular = s[..., -1] <= _SINGULAR * s[..., 0]
    w = W[..., list(robot.columns)] * scales(robot, robot.length)
    part = np.einsum("...ji,...j->...i", U, w) / np.where(singular[..., None], np.nan, s)
    status = np.broadcast_to(singular, batch).astype(np.int8)
    return LegForces(np.einsum("...ji,...j->...i", Vt, part), status)


def stiffness(robot: Robot, T: ArrayLike, k: ArrayLike, mode: Mode = None) -> Array:
    """Stiffness matrix (..., 6, 6) of the platform on elastic actuators, ``J^-T diag(k) J^-1``."""
    J, values = inverse_jacobian(robot, T, mode), as_floats(k, "k")
    if values.shape not in ((), (robot.m,)):
        raise ShapeError(f"k: expected a number or shape ({robot.m},), got {values.shape}.")
    if (values < 0.0).any():
        raise InvalidValueError(f"k: expected values that are not negative, got {values.min():g}.")
    return np.swapaxes(J, -1, -2) @ (np.broadcast_to(values, (robot.m,))[:, None] * J)


def maneuverability(
    robot: Robot, T: ArrayLike, length: float | None = None, mode: Mode = None
) -> Array:
    """Maneuverability ``sqrt(det(J J^T)) = 1 / |det J^-1|``: volume of the velocity ellipsoid.

    Yoshikawa's manipulability of the Jacobian J; infinite at parallel singularities.
    """
    s = np.linalg.svd(_unitless(robot, T, length, mode), compute_uv=False)
    det = np.where(s[..., -1] <= _SINGULAR * s[..., 0], 0.0, s.prod(axis=-1))
    return np.divide(1.0, det, out=np.full(det.shape, np.inf), where=det > 0.0)


def condition(robot: Robot, T: ArrayLike, length: float | None = None, mode: Mode = None) -> Array:
    """Condition number of the Jacobian: 1 where isotropic, infinite at parallel singularities."""
    s = np.linalg.svd(_unitless(robot, T, length, mode), compute_uv=False)
    singular = s[..., -1] <= _SINGULAR * s[..., 0]
    return np.where(singular, np.inf, s[..., 0] / np.where(singular, 1.0, s[..., -1]))


def determinant(robot: ParallelRobot, T: ArrayLike, mode: Mode = None) -> Array:
    """Determinant of the unit lines of the legs: zero at parallel singularities, NaN out of reach.

    Its sign tells the sides of singular positions apart, see `assembly_modes`; its zeros in a
    section are the singular curves. Unit m for each rotation of the platform.
    """
    check_robot(robot)
    if isinstance(robot, LoopedPlatform):
        raise InvalidValueError(
            "robot: the legs of kinematic loops are not known; see condition and "
            "classify_singularity."
        )
    poses = robot.checked(T)
    modes = modes_of(robot, mode, poses.shape[:-2])
    legs = leg_states(robot, poses.reshape(-1, 4, 4), modes)
    det = np.linalg.det(legs.rows[..., list(robot.columns)])
    return np.where(legs.reached, det, np.nan).reshape(poses.shape[:-2])


def _unitless(robot: Robot, T: ArrayLike, length: float | None, mode: Mode) -> Array:
    """Inverse Jacobian of the platform's freedoms with angles times a length."""
    J = inverse_jacobian(robot, T, mode)
    metres = robot.length if length is None else as_number(length, "length", above=0.0)
    return J[..., list(robot.columns)] * scales(robot, metres)
