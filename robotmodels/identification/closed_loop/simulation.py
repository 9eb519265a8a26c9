"""Simulation of the controlled robot along the recordings of a log, and equations of its motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, as_exact
from ...dynamics.inverse import motion_torques
from ...errors import InvalidValueError
from ...logs import Log
from ...model import RobotModel, check_model
from ..equations import Block, Equations
from ..forms import moving_joints, signals_block
from ..signals import Piece, Signals, central_differences, piece_signals
from .loop import MOST, ClosedLoop, Controller, friction_rates, robot_of, steps_of


class SimulationDivergedError(Exception):
    """The simulation diverged, or its mass matrix was not positive definite."""


class References(NamedTuple):
    """References from a row of the log on, the last one repeated. Shapes: q, v, feed (N + 1, n)."""

    first: int
    q: Array
    v: Array
    feed: Array


class ClosedLoopSimulator:
    """Simulator of one log with given parameters; the references are prepared once."""

    def __init__(self, system: Equations, loop: ClosedLoop) -> None:
        self.system, self.loop = system, loop
        self.references: dict[int, References] = {}
        for piece in system.pieces():
            if piece.begin not in self.references:
                self.references[piece.begin] = self._references(piece)

    def _references(self, piece: Piece) -> References:
        """References of the recording of a piece: those of the log, or its filtered positions."""
        log, processing, loop = self.system.log, self.system.processing, self.loop
        ahead = loop.controller.feed_forward
        if log.q_ref is not None:
            rows = slice(piece.begin, piece.end)
            v_ref = None if log.v_ref is None else np.array(log.v_ref[rows])
            q_ref = np.array(log.q_ref[rows])
            signals = _derivatives(q_ref, v_ref, log.dt, processing.accuracy)
            return references_from(piece.begin, *signals, ahead, loop.width)
        whole = replace(piece, start=piece.low, stop=piece.high)
        filtered = piece_signals(log, processing, whole, 0)
        return references_from(piece.low, filtered.q, filtered.v, filtered.a, ahead, loop.width)

    def signals(self, values: Array) -> dict[int, Signals]:
        """Signals of the simulated robot for each recording, by its first row."""
        log, loop, robot = self.system.log, self.loop, robot_of(self.system, values)
        rates = friction_rates(robot, log.q)
        if rates is None or not rates.stable(log.dt / loop.substeps):
            raise SimulationDivergedError
        signals = {}
        for begin, references in self.references.items():
            t = log.dt * (references.first + np.arange(len(references.q) - 1.0))
            signals[begin] = Signals(t, *follow(robot, loop, log.dt, references))
        return signals

    def window(self, piece: Piece) -> tuple[slice, slice]:
        """Rows that the equations of a piece use, of the log and of its recording's arrays."""
        reach, offset = self.system.processing.reach, self.references[piece.begin].first
        first, last = max(piece.start - reach, piece.low), min(piece.stop + reach, piece.high)
        return slice(first, last), slice(first - offset, last - offset)

    def blocks(self, signals: dict[int, Signals]) -> Iterator[tuple[Piece, Block]]:
        """Equations of the simulated regressor and the measured torque, piece by piece."""
        for piece in self.system.pieces():
            rows, inner = self.window(piece)
            whole = signals[piece.begin]
            tau = np.array(self.system.log.tau[rows])
            part = Signals(whole.t[inner], whole.q[inner], whole.v[inner], whole.a[inner], tau)
            block = signals_block(self.system, piece, part)
            yield piece, replace(block, use=self.use(block.v))

    def use(self, v: Array) -> NDArray[np.bool_]:
        """Mask of equations outside the friction regularisation. Shapes: v (k, n)."""
        band = np.maximum(self.system.processing.dead_band, self.loop.width)
        return moving_joints(self.system.model, band, v)


def references_from(
    first: int, q: Array, v: Array, a: Array, ahead: RobotModel | None, width: Array
) -> References:
    """References with feed-forward torques, and the last sample repeated."""
    q, v, a = (np.ascontiguousarray(np.vstack((x, x[-1:]))) for x in (q, v, a))
    feed = np.zeros(q.shape)
    if ahead is not None:
        feed = motion_torques(ahead, q, v, a, drive=False)
        if (drives := ahead.drive_matrices) is not None:
            feed += a @ drives.rotor + v @ drives.viscous + drives.offset
            feed += drives.coulomb * _direction(v, width)
            if ahead.transmission is not None and drives.coupling.size:
                motors = np.array(ahead.transmission.coupled_motors) - 1
                turns = _direction(v @ drives.coupling.T, width[motors])
                feed += (turns * drives.coupled_coulomb) @ drives.coupling
    return References(first, q, v, feed)


def _derivatives(q: Array, v: Array | None, dt: float, accuracy: int) -> tuple[Array, Array, Array]:
    if len(q) < 2:
        return q, np.zeros(q.shape) if v is None else v, np.zeros(q.shape)
    v = central_differences(q, dt, accuracy) if v is None else v
    return q, v, central_differences(v, dt, accuracy)


def _direction(v: Array, width: Array) -> Array:
    """Regularised sign of a velocity: linear within the width around zero."""
    return np.where(np.abs(v) > width, np.sign(v), v / np.where(width > 0.0, width, 1.0))


def follow(robot: RobotModel, loop: ClosedLoop, dt: float, references: References) -> Array:
    """Positions, velocities, accelerations and torques along references, shape (4, N, n)."""
    from ...kernels.closed_loop import follow_references

    n, control = robot.n, loop.controller
    state = np.zeros((5, n))
    state[0], state[1] = references.q[0], references.v[0]
    rotor, viscous = np.zeros((n, n)), np.zeros((n, n))
    drives, coupling, coupled = np.zeros((3, n)), np.zeros((0, n)), np.zeros(0)
    if (terms := robot.drive_matrices) is not None:
        rotor, viscous, coupling = terms.rotor, terms.viscous, terms.coupling
        drives[:] = terms.coulomb, terms.offset, loop.width
        if robot.transmission is not None and coupling.size:
            motors = np.array(robot.transmission.coupled_motors) - 1
            coupled = np.concatenate((terms.coupled_coulomb, loop.width[motors]))
    gains = np.stack((control.kp, control.kd, control.ki, control.limit))
    settings = gains, loop.tracking_limit, loop.hold, loop.substeps, dt
    bodies = robot.chain, robot.inertia.values, robot.gravity
    matrices = map(np.ascontiguousarray, (rotor, viscous, drives, coupling))
    out = np.empty((4, len(references.q) - 1, n))
    signals = references.q, references.v, references.feed
    failed = follow_references(*signals, *settings, *bodies, *matrices, coupled, state, *out)
    if failed >= 0:
        raise SimulationDivergedError
    return out


def simulated_log(
    model: RobotModel,
    controller: Controller,
    q_ref: ArrayLike,
    v_ref: ArrayLike,
    dt: float,
    *,
    width: ArrayLike | None = None,
    substeps: int | None = None,
) -> Log:
    """Log of a simulated robot that follows references under its controller, without noise.

    Parameters
    ----------
    model : RobotModel
        The robot, its drives included.
    controller : Controller
        Its controller.
    q_ref, v_ref : array_like, shape (N, n)
        References at the samples, rad or m; the robot starts on them.
    dt : float
        Sampling period, seconds.
    width, substeps : optional
        See `Instrumental`; default the least width for a step of the integration, and one step of
        a sample or as many as viscous friction requires.

    Returns
    -------
    Log
        Positions, exact velocities and accelerations, torques, references.

    Raises
    ------
    InvalidValueError, ShapeError
        The simulation diverged, a mass matrix is not positive definite, or references do not fit.

    Examples
    --------
    >>> from robotmodels.identification.closed_loop import tuned_controller
    >>> from robotmodels.robots import load
    >>> arm, rest = load("rx90"), np.zeros((100, 6))
    >>> controller = tuned_controller(arm, rest[:1], bandwidth=8.0, period=0.001)
    >>> len(simulated_log(arm, controller, rest, rest, 0.001))
    100
    """
    check_model(model)
    n = model.n
    q_ref = as_exact(q_ref, (len(np.atleast_1d(np.asarray(q_ref))), n), "q_ref")
    v_ref = as_exact(v_ref, q_ref.shape, "v_ref")
    dt = Log(dt, q_ref, np.zeros(q_ref.shape)).dt
    rates = friction_rates(model, q_ref)
    if substeps is None:
        substeps = 1 if rates is None else rates.steps(dt)
        if substeps > MOST:
            raise InvalidValueError(
                f"substeps: viscous friction requires {substeps} in a sample of {dt:g} s, more "
                f"than {MOST}; give substeps=, or more inertia (of rotors, for instance)."
            )
    parts, hold = steps_of(controller, dt, substeps)
    least = np.zeros(n) if rates is None else dt / parts * rates.dry
    wide = np.broadcast_to(np.asarray(least if width is None else width, np.float64), (n,))
    loop = ClosedLoop(controller, wide, np.full(n, np.inf), hold, parts)
    signals = _derivatives(q_ref, v_ref, dt, 4)
    references = references_from(0, *signals, controller.feed_forward, wide)
    try:
        q, v, a, tau = follow(model, loop, dt, references)
    except SimulationDivergedError:
        raise InvalidValueError(
            "controller: the simulation diverges, or the mass matrix is not positive definite; "
            "give lower gains, more substeps, or a robot whose joints all move inertia."
        ) from None
    return Log(dt, q, tau, v, a, q_ref, v_ref)
