"""Kinematic and static models: inverse Jacobian, velocities, forces of the legs, indices.

``q' = J^-1 [v; w]``. Columns of components that the platform does not have are zero.

Parameters
----------
robot, T, mode, twist, wrench
    See `robotmodels.parallel`.
acceleration, q_rate, q_acceleration : array_like, shape (..., 6) or (..., m)
    Time derivative of the twist; velocities and accelerations of the actuators. SI, rad.
k : array_like, scalar or shape (m,)
    Stiffness of the actuators, N/m or N m/rad, not negative.
length : float, optional
    Metres that equal a radian; default `ParallelRobot.length`.

Returns
-------
ndarray
    Matrices (..., m, 6) or (..., 6, 6), motion of the actuators (..., m) or of the platform
    (..., 6), indices (...); `LegForces` with ``forces`` (..., m), N or N m, and ``status`` (...).
    Straight legs and legs without length are refused.

References
----------
Book sections 2.3.2, 2.3.3.1 (statics) and 2.3.3.4 (maneuverability and condition number).

Examples
--------
>>> from robotmodels.parallel import gough_symmetric
>>> robot, V = gough_symmetric(1.0), [0.1, 0.2, 0.3, 0.1, 0.0, 0.2]
>>> dkm(robot, robot.home, ikm(robot, robot.home, V)).round(6).tolist()
[0.1, 0.2, 0.3, 0.1, 0.0, 0.2]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_core, as_floats, as_number, batch_rows
from .._outcomes import Outcome
from ..errors import InvalidValueError, ShapeError
from .legs import LegStates, Mode, Robot, is_looped, leg_states, modes_of
from .looped import times
from .robot import ParallelRobot, PlatformResult, only_freedoms

_STRAIGHT = 1e-12
SINGULAR = 1e-12  # smallest singular value, relative


def inverse_jacobian(robot: Robot, T: ArrayLike, mode: Mode = None) -> Array:
    """Inverse Jacobian (..., m, 6): rows ``[u, (R b) x u]`` of legs with unit vectors u.

    Of robots with cranks they are divided by the velocities of the knees along the rods.
    """
    if is_looped(robot, mode):
        return robot.inverse_jacobian(T)
    batch, _, legs, _ = states(robot, mode, T)
    return legs.jacobian.reshape(*batch, robot.m, 6)


def inverse_jacobian_rate(robot: Robot, T: ArrayLike, twist: ArrayLike, mode: Mode = None) -> Array:
    """Time derivative (..., m, 6) of the inverse Jacobian along a motion of the platform."""
    if is_looped(robot, mode):
        return robot.inverse_jacobian_rate(T, as_core(twist, (6,), "twist"))
    batch, _, legs, (V,) = states(robot, mode, T, twist=twist)
    return rates_of_rows(robot, legs, V).reshape(*batch, robot.m, 6)


def ikm(robot: Robot, T: ArrayLike, twist: ArrayLike, mode: Mode = None) -> Array:
    """Inverse kinematic model: velocities of the actuators."""
    return times(inverse_jacobian(robot, T, mode), as_core(twist, (6,), "twist"))


def dkm(robot: Robot, T: ArrayLike, q_rate: ArrayLike, mode: Mode = None) -> Array:
    """Direct kinematic model: twist of the platform, at singularities that of least norm."""
    inverse: Array = np.linalg.pinv(_unitless(robot, T, None, mode), rcond=0.1 * SINGULAR)  # type: ignore[assignment]
    part = times(inverse, as_core(q_rate, (robot.m,), "q_rate"))
    V = np.zeros((*part.shape[:-1], 6))
    V[..., list(robot.columns)] = part * scales(robot, robot.length)
    return V


def ikm_second_order(
    robot: Robot, T: ArrayLike, twist: ArrayLike, acceleration: ArrayLike, mode: Mode = None
) -> Array:
    """Inverse kinematic model of second order: accelerations of the actuators."""
    drift = times(inverse_jacobian_rate(robot, T, twist, mode), as_core(twist, (6,), "twist"))
    return ikm(robot, T, acceleration, mode) + drift


def dkm_second_order(
    robot: Robot, T: ArrayLike, q_rate: ArrayLike, q_acceleration: ArrayLike, mode: Mode = None
) -> Array:
    """Direct kinematic model of second order: time derivative of the twist; see `dkm`."""
    V = dkm(robot, T, q_rate, mode)
    drift = times(inverse_jacobian_rate(robot, T, V, mode), V)
    return dkm(robot, T, as_core(q_acceleration, (robot.m,), "q_acceleration") - drift, mode)


class ForceStatus(Outcome):
    """Outcome of the statics of a pose."""

    BALANCED = 0, "The forces of the legs balance the wrench."
    UNBOUNDED = 1, "The pose is singular: no bounded forces of the legs balance every wrench."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LegForces(PlatformResult):
    """Forces (..., m) of the actuators, positive where a leg pushes; NaN at singular poses."""

    outcomes: ClassVar = ForceStatus
    forces: Array
    status: NDArray[np.int8]


def leg_forces(robot: Robot, T: ArrayLike, wrench: ArrayLike, mode: Mode = None) -> LegForces:
    """Forces or torques of the actuators for a wrench: ``J^-T forces = wrench``."""
    J, W = _unitless(robot, T, None, mode), as_core(wrench, (6,), "wrench")
    U, s, Vt = np.linalg.svd(J)
    singular = s[..., -1:] <= SINGULAR * s[..., :1]
    part = times(Vt, W[..., list(robot.columns)] * scales(robot, robot.length))
    forces = times(U, part / np.where(singular, np.nan, s))
    return LegForces(forces, np.isnan(forces[..., 0]).astype(np.int8))


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
    """``sqrt(det(J J^T)) = 1 / |det J^-1|`` (Yoshikawa), infinite at parallel singularities."""
    with np.errstate(divide="ignore"):
        return 1.0 / _singular_values(robot, T, length, mode).prod(axis=-1)


def condition(robot: Robot, T: ArrayLike, length: float | None = None, mode: Mode = None) -> Array:
    """Condition number of the Jacobian: 1 where isotropic, infinite at parallel singularities."""
    s = _singular_values(robot, T, length, mode)
    with np.errstate(divide="ignore"):
        return s[..., 0] / s[..., -1]


def determinant(robot: ParallelRobot, T: ArrayLike, mode: Mode = None) -> Array:
    """Determinant of the unit lines of the legs, NaN out of reach, m for each rotation.

    Zero at parallel singularities; its sign distinguishes their sides, see `assembly_modes`.
    """
    if is_looped(robot, mode):
        raise InvalidValueError(
            "robot: the legs of kinematic loops are not known; see classify_singularity."
        )
    poses = robot.checked(T)
    modes = modes_of(robot, mode, poses.shape[:-2])
    legs = leg_states(robot, poses.reshape(-1, 4, 4), modes)
    det = np.linalg.det(legs.rows[..., list(robot.columns)])
    return np.where(legs.reached, det, np.nan).reshape(poses.shape[:-2])


def rates_of_rows(robot: ParallelRobot, legs: LegStates, V: Array) -> Array:
    """Time derivative of the inverse Jacobian. Shapes: V (..., 6) -> (..., m, 6)."""
    v, w = V[..., None, :3], V[..., None, 3:]
    J, u = legs.jacobian, legs.direction
    rate = np.einsum("...ij,...j->...i", J, V)[..., None]
    spin = np.cross(w, legs.arm)
    # rates of the unit vectors, then of their moments
    turn = (v + spin - rate * legs.turning) / legs.size[..., None]
    moments: Array = np.cross(spin, u) + np.cross(legs.arm, turn)  # type: ignore[assignment]
    rows = only_freedoms(robot, np.concatenate((turn, moments), axis=-1))
    if robot.has_cranks:
        swing = legs.knee - robot.base
        slower = (turn * legs.turning - rate * u * swing).sum(axis=-1, keepdims=True)
        rows = rows - J * slower
    return rows / legs.speed[..., None]


def states(
    robot: ParallelRobot, mode: Mode, T: ArrayLike, **vectors: ArrayLike
) -> tuple[tuple[int, ...], Array, LegStates, list[Array]]:
    """Batch; poses, states of legs and vectors in N rows; raises where a leg has no velocity."""
    poses = robot.checked(T)
    given = [as_core(x, (robot.m if k == "tau" else 6,), k) for k, x in vectors.items()]
    flat = (poses.reshape(*poses.shape[:-2], 16), *given)
    batch, (rows, *others) = batch_rows(flat, ("T", *vectors))
    rows = rows.reshape(-1, 4, 4)
    legs = leg_states(robot, rows, modes_of(robot, mode, batch))
    straight = np.abs(legs.speed) <= _STRAIGHT * (robot.crank if robot.has_cranks else 1.0)
    for n, i in np.argwhere(straight | ~legs.reached[:, None])[:1]:
        row = f" of row {n}" if batch else ""
        if not legs.reached[n]:
            raise InvalidValueError(
                f"T: the pose{row} is out of reach of the legs; see igm(robot, T).status."
            )
        why = "is straight (serial singularity)" if robot.has_cranks else "has no length"
        raise InvalidValueError(f"T: leg {i + 1} {why} at the pose{row}; see classify_singularity.")
    pairs = zip(vectors, others, strict=True)
    return batch, rows, legs, [x if k == "tau" else only_freedoms(robot, x) for k, x in pairs]


def scales(robot: Robot, length: float) -> Array:
    """Units of the twist's components that the platform has: 1 m, or 1/length rad."""
    return np.where(np.array(robot.columns) < 3, 1.0, 1.0 / length)


def _unitless(robot: Robot, T: ArrayLike, length: float | None, mode: Mode) -> Array:
    """Inverse Jacobian of the platform's freedoms with angles times a length."""
    J = inverse_jacobian(robot, T, mode)
    metres = robot.length if length is None else as_number(length, "length", above=0.0)
    return J[..., list(robot.columns)] * scales(robot, metres)


def _singular_values(robot: Robot, T: ArrayLike, length: float | None, mode: Mode) -> Array:
    """Singular values (..., m) of the inverse Jacobian; 0 below those of a singular one."""
    s = np.linalg.svd(_unitless(robot, T, length, mode), compute_uv=False)
    return np.where(s <= SINGULAR * s[..., :1], 0.0, s)
