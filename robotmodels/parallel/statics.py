"""Statics and indices: forces of the legs, stiffness, maneuverability, condition number.

Parameters
----------
robot : ParallelRobot or LoopedPlatform
    The robot, m legs.
T : array_like, shape (..., 4, 4)
    Poses of the platform in the world.
mode : int or array_like of int, shape (...), optional
    Working mode of robots with cranks, as numbered by `igm`; default 0.
length : float, optional
    Metres that equal a radian; default `ParallelRobot.length`. Both indices mean nothing without
    it where the platform also rotates.

Raises
------
ShapeError, InvalidValueError, NotARotationError
    As for `inverse_jacobian`.

References
----------
Seed book sections 2.3.3.1 (statics) and 2.3.3.4 (maneuverability and condition number).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_core, as_floats, as_number
from .._outcomes import Outcome
from ..errors import InvalidValueError, ShapeError
from .legs import leg_states
from .results import Result, at_index
from .robot import ParallelRobot
from .velocities import Mode, Robot, _broadcast, inverse_jacobian, modes_of, reduced, scales

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

    forces: Array
    status: NDArray[np.int8]

    def reason(self, i: int | tuple[int, ...] = ()) -> str:
        """Outcome of one pose as a sentence.

        Parameters
        ----------
        i : int or tuple of int
            Which pose; left out for a single one.

        Returns
        -------
        str
            The sentence of its status.
        """
        return ForceStatus(int(at_index(self.status, i))).sentence


def leg_forces(robot: Robot, T: ArrayLike, wrench: ArrayLike, mode: Mode = None) -> LegForces:
    """Forces or torques of the actuators for a wrench that the platform exerts.

    ``J^-T forces = wrench``; components of the wrench that the platform cannot move along are
    borne by the joints.

    Parameters
    ----------
    robot, T, mode
        See the head of the file.
    wrench : array_like, shape (..., 6)
        Wrench [f; m] at the platform's origin exerted on the environment, world axes, N and N m.

    Returns
    -------
    LegForces
        Forces, with a status each.

    Examples
    --------
    >>> from robotmodels.parallel import gough_symmetric
    >>> robot = gough_symmetric(1.0)
    >>> leg_forces(robot, robot.home, [0, 0, 60, 0, 0, 0]).forces.round(2)
    array([13.4, 13.4, 13.4, 13.4, 13.4, 13.4])
    """
    J = inverse_jacobian(robot, T, mode)
    W = as_core(wrench, (6,), "wrench")
    batch = _broadcast(J.shape[:-2], W.shape[:-1])
    unit = scales(robot, robot.length)
    A = np.swapaxes(reduced(robot, J) * unit, -1, -2)
    U, s, Vt = np.linalg.svd(A)
    singular = s[..., -1] <= _SINGULAR * s[..., 0]
    w = np.broadcast_to(W, (*batch, 6))[..., list(robot.columns)] * unit
    s = np.where(singular[..., None], 1.0, s)
    forces = np.einsum("...ji,...j->...i", Vt, np.einsum("...ji,...j->...i", U, w) / s)
    status = np.broadcast_to(singular, batch)
    return LegForces(np.where(status[..., None], np.nan, forces), status.astype(np.int8))


def stiffness(robot: Robot, T: ArrayLike, k: ArrayLike, mode: Mode = None) -> Array:
    """Stiffness matrix of the platform with elastic actuators, ``J^-T diag(k) J^-1``.

    Parameters
    ----------
    robot, T, mode
        See the head of the file.
    k : array_like, scalar or shape (m,)
        Stiffness of the actuators, N/m or N m/rad, not negative.

    Returns
    -------
    ndarray, shape (..., 6, 6)
        From small displacements [v; w] to wrenches; zero for components the platform does not have.

    Examples
    --------
    >>> from robotmodels.parallel import gough_symmetric
    >>> robot = gough_symmetric(1.0)
    >>> stiffness(robot, robot.home, 1e6).shape
    (6, 6)
    """
    J = inverse_jacobian(robot, T, mode)
    values = as_floats(k, "k")
    if values.shape not in ((), (robot.m,)):
        raise ShapeError(f"k: expected a number or shape ({robot.m},), got {values.shape}.")
    if (values < 0.0).any():
        raise InvalidValueError(f"k: expected values that are not negative, got {values.min():g}.")
    return np.swapaxes(J, -1, -2) @ (np.broadcast_to(values, (robot.m,))[:, None] * J)


def maneuverability(
    robot: Robot, T: ArrayLike, length: float | None = None, mode: Mode = None
) -> Array:
    """Maneuverability ``sqrt(det(J J^T)) = 1 / |det J^-1|``: volume of the velocity ellipsoid.

    Yoshikawa's manipulability of the Jacobian J from actuators to the platform; infinite at parallel
    singularities. Rows of angular velocities are multiplied by the length.

    Returns
    -------
    ndarray, shape (...)
        Volume in units of the ball of unit actuator velocities.

    Examples
    --------
    >>> from robotmodels.parallel import gough_symmetric
    >>> robot = gough_symmetric(1.0)
    >>> bool(maneuverability(robot, robot.home) > 0.0)
    True
    """
    J = _unitless(robot, T, length, mode)
    det = np.abs(np.linalg.det(J))
    return np.divide(1.0, det, out=np.full(det.shape, np.inf), where=det > 0.0)


def condition(robot: Robot, T: ArrayLike, length: float | None = None, mode: Mode = None) -> Array:
    """Condition number of the Jacobian: 1 where isotropic, infinite at parallel singularities.

    Returns
    -------
    ndarray, shape (...)
        Ratio of the largest to the smallest singular value.

    Examples
    --------
    >>> from robotmodels.parallel import gough_symmetric
    >>> robot = gough_symmetric(1.0)
    >>> bool(1.0 <= condition(robot, robot.home) < 10.0)
    True
    """
    s = np.linalg.svd(_unitless(robot, T, length, mode), compute_uv=False)
    singular = s[..., -1] <= 1e-15 * s[..., 0]
    return np.where(singular, np.inf, s[..., 0] / np.where(singular, 1.0, s[..., -1]))


def _unitless(robot: Robot, T: ArrayLike, length: float | None, mode: Mode) -> Array:
    """Inverse Jacobian of the platform's freedoms with angles times a length."""
    J = inverse_jacobian(robot, T, mode)
    metres = robot.length if length is None else as_number(length, "length", above=0.0)
    return reduced(robot, J) * scales(robot, metres)


def determinant(robot: ParallelRobot, T: ArrayLike, mode: Mode = None) -> Array:
    """Determinant of the unit lines of the legs: zero at parallel singularities.

    Its sign tells the sides of singular positions apart, see `assembly_modes`; its curves of zeros
    are the singular curves of a section. NaN out of reach.

    Returns
    -------
    ndarray, shape (...)
        In m^k of the k rotations of the platform.

    Examples
    --------
    >>> from robotmodels.parallel import gough_symmetric
    >>> robot = gough_symmetric(1.0)
    >>> bool(abs(determinant(robot, robot.pose([0, 0, 1, 0, 0, np.pi / 2]))) < 1e-12)
    True
    """
    poses = robot.checked(T)
    rows = poses.reshape(-1, 4, 4)
    legs = leg_states(robot, rows, modes_of(robot, mode, poses.shape[:-2]))
    det = np.linalg.det(legs.rows[..., list(robot.columns)])
    return np.where(legs.reached, det, np.nan).reshape(poses.shape[:-2])
