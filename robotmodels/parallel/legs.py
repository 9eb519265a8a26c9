"""Inverse geometric model: actuated lengths or angles of all working modes, and states of legs.

Parameters
----------
robot, T
    See `robotmodels.parallel`.

Returns
-------
LegSolutions
    One row for each working mode that reaches the pose, ``mode`` ascending (see `ParallelRobot`):
    one for legs of actuated length, 2^m with cranks where no leg is straight. ``q`` (..., S, m) are
    lengths, m, or angles in (-pi, pi], rad; ``valid``, ``within_limits`` (angles modulo whole
    turns) and ``residual``, the largest error of a rod's length, m, are (..., S). Packed: after the
    solutions NaN, mode -1. ``status`` (...) are codes of `LegStatus`.

Examples
--------
>>> from robotmodels.parallel import five_bar
>>> robot = five_bar([[0, 0], [0.5, 0]], 0.4, 0.6)
>>> igm(robot, robot.home).mode, igm(robot, robot.home).q.shape
(array([0, 1, 2, 3]), (4, 2))
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_reals
from .._outcomes import Outcome
from ..errors import InvalidValueError, ShapeError
from .looped import LoopedPlatform
from .robot import ParallelRobot, PlatformResult

if TYPE_CHECKING:
    from typing_extensions import TypeIs

Robot = ParallelRobot | LoopedPlatform
Mode = int | ArrayLike | None
Found = tuple[Array, Array, Array, NDArray[np.int8], NDArray[np.int64]]
"""T (N, S, 4, 4), residual, det (N, S), packed, NaN after; status, complex count (N,)."""
_TOUCHING = 1e-12  # of the cosine of an elbow: both solutions coincide


class LegStatus(Outcome):
    """Outcome of an inverse geometric model."""

    REACHED = 0, "The pose is reached."
    OUTSIDE_LIMITS = 1, "The pose is reached, but only outside the limits of the actuators."
    OUT_OF_REACH = 2, "The pose is out of reach of at least one leg."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LegSolutions(PlatformResult):
    """Actuated lengths or angles that give poses, see the head of the file. Read-only."""

    outcomes: ClassVar = LegStatus
    q: Array
    mode: NDArray[np.int64]
    valid: NDArray[np.bool_]
    within_limits: NDArray[np.bool_]
    residual: Array
    status: NDArray[np.int8]


class LegStates(NamedTuple):
    """Legs at N poses: numbers (N, m), vectors (N, m, 3), rows (N, m, 6), ``speed q' = rows V``.

    arm: anchors from the platform's origin; size: lengths of legs or rods; turning: velocity of
    their other ends for q' = 1.
    """

    q: Array
    speed: Array
    size: Array
    rows: Array
    arm: Array
    direction: Array
    knee: Array
    turning: Array
    reached: NDArray[np.bool_]

    @property
    def jacobian(self) -> Array:
        """Inverse Jacobian (N, m, 6)."""
        return self.rows / self.speed[..., None]


def leg_states(robot: ParallelRobot, T: Array, mode: NDArray[np.int64] | int = 0) -> LegStates:
    """Directions of the legs' forces and their velocities. Shapes: T (N, 4, 4), mode (N,)."""
    arm = robot.platform @ np.swapaxes(T[:, :3, :3], 1, 2)
    d = T[:, None, :3, 3] + arm - robot.base
    knee, q, reached = np.broadcast_to(robot.base, d.shape), d[..., 0], np.ones(len(T), np.bool_)
    if robot.has_cranks:
        q, cosine = _angles(robot, d, np.broadcast_to(mode, len(T)))
        reached = np.asarray((np.abs(cosine) <= 1.0 + _TOUCHING).all(axis=1))
        swing = robot.crank[:, None] * _radial(robot, q)
        knee, d = knee + swing, d - swing
    size = np.linalg.norm(d, axis=-1)
    direction = d / np.where(size > 0.0, size, 1.0)[..., None]
    rows = np.concatenate((direction, np.cross(arm, direction)), axis=-1)
    rows[..., [k for k in range(6) if k not in robot.columns]] = 0.0
    turning, speed = direction, np.where(size > 0.0, 1.0, 0.0)
    if robot.has_cranks:
        turning = robot.crank[:, None] * _radial(robot, q + 0.5 * np.pi)
        speed = (direction * turning).sum(axis=-1)
    q = q if robot.has_cranks else size
    return LegStates(q, speed, size, rows, arm, direction, knee, turning, reached)


def knees(robot: ParallelRobot, q: Array) -> Array:
    """Ends of the rods away from the platform. Shapes: q (..., m) -> (..., m, 3)."""
    if not robot.has_cranks:
        return np.broadcast_to(robot.base, (*q.shape, 3))
    return robot.base + robot.crank[:, None] * _radial(robot, q)


def rods(robot: ParallelRobot, q: Array) -> tuple[Array, Array, Array]:
    """Ends and lengths of the rods with locked actuators. Shapes: (N, m) -> (N, m, 3), ..."""
    if not robot.has_cranks:
        return robot.base[None].repeat(len(q), axis=0), robot.platform, np.ascontiguousarray(q)
    return knees(robot, q), robot.platform, robot.rod[None].repeat(len(q), axis=0)


def _radial(robot: ParallelRobot, q: Array) -> Array:
    """Unit vectors along cranks. Shapes: q (..., m) -> (..., m, 3)."""
    return np.cos(q)[..., None] * robot.outward + np.sin(q)[..., None] * robot.downward


def _angles(robot: ParallelRobot, d: Array, mode: NDArray[np.int64]) -> tuple[Array, Array]:
    """Angles of cranks, and the cosines that decide. Shapes: d (N, m, 3), mode (N,) -> (N, m)."""
    x, y = (d * robot.outward).sum(axis=-1), (d * robot.downward).sum(axis=-1)
    square = (d * d).sum(axis=-1) + robot.crank**2 - robot.rod**2
    far = 2.0 * robot.crank * np.hypot(x, y)
    cosine = np.divide(square, far, out=np.full(far.shape, np.inf), where=far > 0.0)
    sign = robot.elbow * (1 - 2 * _bits(robot, mode))
    q = np.arctan2(y, x) + sign * np.arccos(np.clip(cosine, -1.0, 1.0))
    return np.pi - np.mod(np.pi - q, 2.0 * np.pi), cosine


def _bits(robot: ParallelRobot, mode: NDArray[np.int64]) -> NDArray[np.int64]:
    """Which elbows a working mode changes, 0 or 1. Shapes: (...) -> (..., m)."""
    return (mode[..., None] >> np.arange(robot.m)) & 1


def igm(robot: Robot, T: ArrayLike) -> LegSolutions:
    """Inverse geometric model (inverse kinematics): actuated lengths or angles of all modes."""
    modes = np.arange(1)
    if is_looped(robot):
        joints, residual, valid = robot.postures(T)
        batch, q = residual.shape, joints[..., robot.actuated].reshape(-1, 1, robot.m)
        residual, valid = residual.reshape(-1, 1), valid.reshape(-1, 1)
        inside = valid
    else:
        poses, m = robot.checked(T), robot.m
        modes = np.arange(2**m if robot.has_cranks else 1)
        batch, rows = poses.shape[:-2], np.repeat(poses.reshape(-1, 4, 4), len(modes), axis=0)
        shape = (len(rows) // len(modes), len(modes))
        legs = leg_states(robot, rows, np.tile(modes, shape[0]))
        q, valid, residual = legs.q.reshape(*shape, m), legs.reached.reshape(shape), np.zeros(shape)
        if robot.has_cranks:
            residual = np.abs(legs.size - robot.rod).max(axis=-1, initial=0.0).reshape(shape)
            # both solutions of a straight leg coincide: of mode 0 and the one with all bits
            straight = np.abs(np.exp(1j * q[:, :1]) - np.exp(1j * q[:, -1:])) < 1e-9
            valid = valid & ~(straight & (_bits(robot, modes) == 1)).any(axis=-1)
        inside = valid & within(robot, q)
    order = np.argsort(~valid, axis=1, kind="stable")[:, : valid.sum(axis=1).max(initial=0)]
    status = np.where(inside.any(axis=1), 0, np.where(valid.any(axis=1), 1, 2)).astype(np.int8)
    valid, inside, residual = (np.take_along_axis(x, order, 1) for x in (valid, inside, residual))
    q = np.where(valid[..., None], np.take_along_axis(q, order[..., None], 1), np.nan)
    mode, residual = np.where(valid, modes[order], -1), np.where(valid, residual, np.nan)
    fields: Any = (q, mode, valid, inside, residual, status)
    return LegSolutions(*(x.reshape((*batch, *x.shape[1:])) for x in fields))


def within(robot: ParallelRobot, q: Array) -> NDArray[np.bool_]:
    """Whether q is within limits, angles modulo whole turns. Shapes: (..., m) -> (...)."""
    if robot.has_cranks:
        turns = np.ceil((robot.lower - 1e-12 - q) / (2.0 * np.pi))
        q = q + 2.0 * np.pi * np.where(np.isfinite(turns), turns, 0.0)
    inside = (q >= robot.lower - 1e-12) & (q <= robot.upper + 1e-12)
    return np.asarray(inside.all(axis=-1))


def is_looped(robot: Any, mode: Mode = None) -> TypeIs[LoopedPlatform]:
    """Whether a parallel robot is one of loops; raises for other objects and modes of loops."""
    if isinstance(robot, ParallelRobot):
        return False
    if not isinstance(robot, LoopedPlatform):
        raise InvalidValueError(
            f"robot: expected one made by parallel.gough and others, got {type(robot).__name__}."
        )
    if mode is not None and np.any(as_reals(mode, "mode") != 0):
        raise InvalidValueError(
            f"mode: a robot from from_loops has mode 0 only, that of its home, got {mode!r:.40}."
        )
    return True


def modes_of(robot: ParallelRobot, mode: Mode, batch: tuple[int, ...]) -> NDArray[np.int64]:
    """Checked working modes of N poses. Shapes: -> (N,)."""
    given = as_reals(0 if mode is None else mode, "mode")
    most = 2**robot.m if robot.has_cranks else 1
    if not np.isin(given, np.arange(most)).all():
        raise InvalidValueError(
            f"mode: expected whole numbers from 0 to {most - 1} as of igm, got {mode!r:.40}."
        )
    try:
        return np.broadcast_to(given, batch).reshape(-1).astype(np.int64)
    except ValueError:
        raise ShapeError(f"mode: expected a number or shape {batch}, got {given.shape}.") from None
