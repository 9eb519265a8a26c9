"""Inverse geometric model: actuated lengths or angles of all working modes, and states of legs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array
from .._outcomes import Outcome
from ..errors import InvalidValueError
from .looped import LoopedPlatform
from .results import Result
from .robot import ParallelRobot

_TOUCHING = 1e-12  # of the cosine of an elbow: both solutions coincide


class LegStatus(Outcome):
    """Outcome of an inverse geometric model."""

    REACHED = 0, "The pose is reached."
    OUTSIDE_LIMITS = 1, "The pose is reached, but only outside the limits of the actuators."
    OUT_OF_REACH = 2, "The pose is out of reach of at least one leg."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LegSolutions(Result):
    """Actuated lengths or angles that give poses, one row for each working mode. Read-only.

    Parameters
    ----------
    q : ndarray, shape (..., S, m)
        Actuated lengths, m, or angles in (-pi, pi], rad; packed, NaN where there is no solution.
    mode : ndarray of int64, shape (..., S)
        Working modes, ascending; -1 where there is no solution. See `ParallelRobot`.
    valid : ndarray of bool, shape (..., S)
        Whether the row is a solution.
    within_limits : ndarray of bool, shape (..., S)
        Whether the row is a solution within the limits; angles count modulo whole turns.
    residual : ndarray, shape (..., S)
        Largest error of a rod's length, m.
    status : ndarray of int8, shape (...)
        Codes of `LegStatus`.

    Examples
    --------
    >>> from robotmodels.parallel import five_bar, igm
    >>> robot = five_bar([[0, 0], [0.5, 0]], 0.4, 0.6)
    >>> igm(robot, robot.home).mode
    array([0, 1, 2, 3])
    """

    outcomes: ClassVar = LegStatus
    q: Array
    mode: NDArray[np.int64]
    valid: NDArray[np.bool_]
    within_limits: NDArray[np.bool_]
    residual: Array
    status: NDArray[np.int8]


class LegStates(NamedTuple):
    """Legs at poses in one working mode.

    Shapes: q, speed, crossing (N, m), arm, direction, knee (N, m, 3), rows (N, m, 6), reached (N,).
    ``speed q' = rows [v; w]``; arm are the anchors' positions from the platform's origin.
    """

    q: Array
    speed: Array
    rows: Array
    arm: Array
    direction: Array
    knee: Array
    reached: NDArray[np.bool_]

    @property
    def jacobian(self) -> Array:
        """Inverse Jacobian (N, m, 6)."""
        return self.rows / self.speed[..., None]


def leg_states(robot: ParallelRobot, T: Array, mode: NDArray[np.int64]) -> LegStates:
    """Directions of the legs' forces and their velocities. Shapes: T (N, 4, 4), mode (N,)."""
    arm = robot.platform @ np.swapaxes(T[:, :3, :3], 1, 2)
    d = T[:, None, :3, 3] + arm - robot.base
    knee = np.broadcast_to(robot.base, d.shape)
    reached, q = np.ones(len(T), np.bool_), np.zeros(d.shape[:-1])
    if robot.has_cranks:
        q, cosine = _angles(robot, d, mode)
        reached = np.asarray((np.abs(cosine) <= 1.0 + _TOUCHING).all(axis=1))
        swing = robot.crank[:, None] * _radial(robot, q)
        knee, d = knee + swing, d - swing
    size = np.linalg.norm(d, axis=-1)
    direction = d / np.where(size > 0.0, size, 1.0)[..., None]
    rows = np.concatenate((direction, np.cross(arm, direction)), axis=-1)
    rows[..., [k for k in range(6) if k not in robot.columns]] = 0.0
    if robot.has_cranks:
        turning = robot.crank[:, None] * _radial(robot, q + 0.5 * np.pi)
        speed = (direction * turning).sum(axis=-1)
    else:
        q, speed = size, np.where(size > 0.0, 1.0, 0.0)
    return LegStates(q, speed, rows, arm, direction, knee, reached)


def knees(robot: ParallelRobot, q: Array) -> Array:
    """Ends of the rods away from the platform. Shapes: q (..., m) -> (..., m, 3)."""
    if not robot.has_cranks:
        return np.broadcast_to(robot.base, (*q.shape, 3))
    return robot.base + robot.crank[:, None] * _radial(robot, q)


def _radial(robot: ParallelRobot, q: Array) -> Array:
    """Unit vectors along cranks. Shapes: q (..., m) -> (..., m, 3)."""
    return np.cos(q)[..., None] * robot.outward + np.sin(q)[..., None] * robot.downward


def _angles(robot: ParallelRobot, d: Array, mode: NDArray[np.int64]) -> tuple[Array, Array]:
    """Angles of cranks, and the cosines that decide. Shapes: d (N, m, 3), mode (N,) -> (N, m)."""
    x, y = (d * robot.outward).sum(axis=-1), (d * robot.downward).sum(axis=-1)
    rho = np.hypot(x, y)
    square = (d * d).sum(axis=-1) + robot.crank**2 - robot.rod**2
    far = 2.0 * robot.crank * rho
    cosine = np.where(far > 0.0, square / np.where(far > 0.0, far, 1.0), np.inf)
    sign = robot.elbow * (1 - 2 * ((mode[:, None] >> np.arange(robot.m)) & 1))
    q = np.arctan2(y, x) + sign * np.arccos(np.clip(cosine, -1.0, 1.0))
    return np.pi - np.mod(np.pi - q, 2.0 * np.pi), cosine


def igm(robot: ParallelRobot | LoopedPlatform, T: ArrayLike) -> LegSolutions:
    """Inverse geometric model (inverse kinematics): actuated lengths or angles of all modes.

    Parameters
    ----------
    robot : ParallelRobot or LoopedPlatform
        The robot, m legs.
    T : array_like, shape (..., 4, 4)
        Poses of the platform in the world.

    Returns
    -------
    LegSolutions
        One working mode for legs of actuated length, 2^m with cranks where no leg is straight.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        No poses, or poses that the platform cannot have.

    References
    ----------
    Seed book section 2.3.1.

    Examples
    --------
    >>> from robotmodels.parallel import gough_symmetric, igm
    >>> robot = gough_symmetric(1.0)
    >>> igm(robot, robot.home).q.shape
    (1, 6)
    """
    if isinstance(robot, LoopedPlatform):
        return _igm_looped(robot, T)
    check_robot(robot)
    T = robot.checked(T)
    batch, m = T.shape[:-2], robot.m
    modes = np.arange(2**m if robot.has_cranks else 1)
    rows = np.repeat(T.reshape(-1, 4, 4), len(modes), axis=0)
    N, S = len(rows) // len(modes), len(modes)
    states = leg_states(robot, rows, np.tile(modes, N))
    q, valid = states.q.reshape(N, S, m), states.reached.reshape(N, S).copy()
    residual = np.zeros((N, S))
    if robot.has_cranks:
        ends = rows[:, None, :3, 3] + states.arm - states.knee
        error = np.abs(np.linalg.norm(ends, axis=-1) - robot.rod)
        residual = error.max(axis=-1, initial=0.0).reshape(N, S)
        # both solutions of a straight leg coincide: of mode 0 and the one with all bits
        straight = np.abs(np.exp(1j * q[:, :1]) - np.exp(1j * q[:, -1:])) < 1e-9
        valid &= ~(straight & ((modes[:, None] >> np.arange(m)) & 1 == 1)).any(axis=-1)
    order = np.argsort(~valid, axis=1, kind="stable")[:, : valid.sum(axis=1).max(initial=0)]
    keep, mode = np.take_along_axis(valid, order, 1), modes[order]
    q, residual = np.take_along_axis(q, order[..., None], 1), np.take_along_axis(residual, order, 1)
    inside = keep & within(robot, q)
    status = np.where(inside.any(axis=1), 0, np.where(keep.any(axis=1), 1, 2)).astype(np.int8)
    found = (
        np.where(keep[..., None], q, np.nan),
        np.where(keep, mode, -1),
        keep,
        inside,
        np.where(keep, residual, np.nan),
        status,
    )
    fields: list[Any] = [x.reshape((*batch, *x.shape[1:])) for x in found]
    return LegSolutions(*fields)


def within(robot: ParallelRobot, q: Array) -> NDArray[np.bool_]:
    """Whether q is within limits, angles modulo whole turns. Shapes: (..., m) -> (...)."""
    if robot.has_cranks:
        turns = np.ceil((robot.lower - 1e-12 - q) / (2.0 * np.pi))
        q = q + 2.0 * np.pi * np.where(np.isfinite(turns), turns, 0.0)
    inside = (q >= robot.lower - 1e-12) & (q <= robot.upper + 1e-12)
    return np.asarray(inside.all(axis=-1))


def check_robot(robot: Any) -> None:
    """Raise unless the argument is a parallel robot."""
    if not isinstance(robot, ParallelRobot | LoopedPlatform):
        raise InvalidValueError(
            "robot: expected a parallel robot, as made by parallel.gough and others, got "
            f"{type(robot).__name__}."
        )


def _igm_looped(robot: LoopedPlatform, T: ArrayLike) -> LegSolutions:
    """One solution by Newton's method on all joints."""
    q, residual, reached = robot.postures(T)
    q = np.where(reached[..., None], q[..., robot.actuated], np.nan)
    mode, status = np.where(reached, 0, -1), np.where(reached, 0, 2).astype(np.int8)
    rows: list[Any] = [mode, reached, reached, np.where(reached, residual, np.nan)]
    mode, valid, within, error = (x[..., None] for x in rows)
    return LegSolutions(q[..., None, :], mode, valid, within, error, status)
