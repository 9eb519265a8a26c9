"""Signals of a simulated closed loop, piece by piece."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, as_exact
from ...errors import InvalidValueError
from ...logs import Log
from ...model import RobotModel, check_model
from ..equations import Equations
from ..preparation.processing import Processing
from ..preparation.signals import Piece, Signals
from .controller import Controller
from .loop import MOST, ClosedLoop, robot_of, steps_of
from .references import Targets, references
from .stiffness import stiffness

Asked = Callable[[Piece, int, int], Targets]


class RanAwayError(Exception):
    """A simulated robot left its references, or its mass matrix was not positive definite."""


@dataclass(slots=True, eq=False)
class MovingRobot:
    """Closed-loop simulation along a recording. Shapes: state (5, n)."""

    robot: RobotModel
    loop: ClosedLoop
    dt: float
    state: Array | None = None

    def advance(self, q_ref: Array, v_ref: Array, feed: Array) -> tuple[Array, Array, Array, Array]:
        """Simulate N samples along the references.

        Shapes: q_ref, v_ref, feed (N + 1, n) -> q, v, a, tau (N, n).
        """
        from ...kernels.closed_loop import follow_references

        robot, loop, n = self.robot, self.loop, self.robot.n
        own = loop.controller
        if self.state is None:
            self.state = np.zeros((5, n))
            self.state[0], self.state[1] = q_ref[0], v_ref[0]
        rotor, viscous = np.zeros((n, n)), np.zeros((n, n))
        drives, coupling = np.zeros((3, n)), np.zeros((0, n))
        coupled = np.zeros(0)
        if (found := robot.drive_matrices) is not None:
            rotor, viscous = found.rotor, found.viscous
            drives[:] = found.coulomb, found.offset, loop.width
            coupling = found.coupling
            if robot.transmission is not None and coupling.size:
                motors = np.array(robot.transmission.coupled_motors) - 1
                coupled = np.concatenate((found.coupled_coulomb, loop.width[motors]))
        out = np.empty((4, len(q_ref) - 1, n))
        failed = follow_references(
            q_ref, v_ref, feed, np.stack((own.kp, own.kd, own.ki, own.limit)), loop.astray,
            loop.hold, loop.substeps, self.dt, *robot.chain, robot.inertia.values, robot.gravity,
            np.ascontiguousarray(rotor), np.ascontiguousarray(viscous), drives,
            np.ascontiguousarray(coupling), coupled, self.state, *out,
        )  # fmt: skip
        if failed >= 0:
            raise RanAwayError
        return out[0], out[1], out[2], out[3]


def simulated_signals(
    system: Equations, loop: ClosedLoop, values: Array, asked: Asked | None = None
) -> Iterator[tuple[Piece, Signals]]:
    """Signals of the simulated robot for each piece of the log and the windows at its ends."""
    log, choices = system.log, system.processing
    follow = asked_of(system, loop) if asked is None else asked
    robot = robot_of(system, values)
    loop = steps_for(robot, loop, log)
    runner = MovingRobot(robot, loop, log.dt)
    begin, done, held = -1, 0, 0
    kept = np.zeros((4, 0, log.n))
    for piece in system.pieces():
        if piece.begin != begin:
            begin = piece.begin
            runner = MovingRobot(robot, loop, log.dt)
            done = held = piece.begin if loop.referenced else piece.low
            kept = kept[:, :0]
        last = min(piece.stop + choices.reach, piece.high)
        if last > done:
            targets = follow(piece, done, last)
            rows = runner.advance(targets.q, targets.v, targets.feed)
            kept = np.concatenate((kept, np.stack(rows)), axis=1)
            done = last
        first = max(piece.start - choices.reach, piece.low)
        kept = kept[:, first - held :]
        found = kept[:, : last - first].copy()
        # the next window looks back no farther than this: many robots may be on their way at once
        held = max(first, min(piece.stop - choices.reach, done))
        kept = kept[:, held - first :].copy()
        yield piece, Signals(log.dt * np.arange(first, last, dtype=np.float64), *found)


def asked_of(system: Equations, loop: ClosedLoop) -> Asked:
    """Function that gives the references of rows of a piece, with a cache of the last ones."""
    last: tuple[tuple[int, int], Targets] | None = None

    def made(piece: Piece, first: int, stop: int) -> Targets:
        nonlocal last
        if last is None or last[0] != (first, stop):
            feed = loop.controller.feed_forward
            found = references(system.log, system.processing, piece, first, stop, feed, loop.width)
            last = (first, stop), found
        return last[1]

    return made


def steps_for(robot: RobotModel, loop: ClosedLoop, log: Log) -> ClosedLoop:
    """Closed loop with enough integration steps for these parameters."""
    found = stiffness(robot, log.q)
    if found is None:
        raise RanAwayError
    if found.stable(log.dt / loop.substeps):
        return loop
    times = -(-found.steps(log.dt, np.zeros(robot.n)) // loop.substeps)
    if loop.substeps * times > MOST:
        raise RanAwayError
    return replace(loop, substeps=loop.substeps * times, hold=loop.hold * times)


def simulated_use(system: Equations, loop: ClosedLoop, v: Array) -> NDArray[np.bool_]:
    """Whether dry friction of the simulation equals that of the equations: not near rest.

    Shapes: v (k, n) -> (k, n).
    """
    band = np.maximum(system.processing.dead_band, loop.width)
    use = ~(np.abs(v) < band)
    K = system.model.transmission
    if K is not None:
        for m in K.coupled_motors:
            if f"Fcm{int(system.model.table.joint_rows[m - 1]) + 1}" in system.names:
                w = K.weights[m - 1]
                use &= ~((np.abs(v @ w) < band[m - 1])[:, None] & (w != 0.0))
    return use


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
        What moves it.
    q_ref, v_ref : array_like, shape (N, n)
        References at the samples, rad or m; it starts on them.
    dt : float
        Sampling period, seconds.
    width : array_like, scalar or shape (n,), optional
        Velocities around rest over which dry friction rises linearly; default what a step of the
        integration can follow.
    substeps : int, optional
        Runge-Kutta steps of a sample; default 1, or as many as viscous friction asks for.

    Returns
    -------
    Log
        Positions, exact velocities and accelerations, torques, references.

    Raises
    ------
    InvalidValueError
        The robot ran away from its references, or its mass matrix is not positive definite.
    ShapeError
        References that do not fit the robot.

    References
    ----------
    Seed book section 1.5; M. Gautier, A. Janot and P.-O. Vandanjon, IEEE T-CST 21(2), 2013.

    Examples
    --------
    >>> from robotmodels.identification.closed_loop import tuned_controller
    >>> from robotmodels.robots import load
    >>> arm = load("rx90")
    >>> rest = np.zeros((100, 6))
    >>> controller = tuned_controller(arm, rest[:1], bandwidth=8.0, period=0.001)
    >>> log = simulated_log(arm, controller, rest, rest, 0.001)
    >>> len(log), log.v is not None
    (100, True)
    """
    check_model(model)
    n = model.n
    targets = as_exact(q_ref, (len(np.atleast_1d(q_ref)), n), "q_ref")  # type: ignore[arg-type]
    speeds = as_exact(v_ref, targets.shape, "v_ref")
    given = Log(dt, targets, np.zeros(targets.shape), q_ref=targets, v_ref=speeds)
    stiff = stiffness(model, targets)
    if substeps is None:
        substeps = 1 if stiff is None else stiff.steps(given.dt, np.zeros(n))
        if substeps > MOST:
            raise InvalidValueError(
                f"substeps: expected up to {MOST} to be enough, but viscous friction asks for "
                f"{substeps} in a sample of {given.dt:g} s; give substeps= of your own, or more "
                "inertia (of rotors, for instance)."
            )
    parts, hold = steps_of(controller, given.dt, substeps)
    step = given.dt / parts
    band = (np.zeros(n) if stiff is None else stiff.width(step)) if width is None else width
    wide = np.broadcast_to(np.asarray(band, np.float64), (n,))
    loop = ClosedLoop(controller, wide, np.full(n, np.inf), hold, parts, True, ())
    choices = Processing(given.dt, None, 4, 4, 1, np.zeros(n), 0, 0.0, ())
    N = len(targets)
    asked = references(given, choices, Piece(0, N, 0, N, 0, N), 0, N, controller.feed_forward, wide)
    try:
        q, v, a, tau = MovingRobot(model, loop, given.dt).advance(asked.q, asked.v, asked.feed)
    except RanAwayError:
        raise InvalidValueError(
            "controller: the robot runs away, or its mass matrix is not positive definite; give "
            "lower gains, more substeps, or a robot whose joints all move inertia."
        ) from None
    return Log(given.dt, q, tau, v, a, targets, speeds)
