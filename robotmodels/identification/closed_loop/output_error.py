"""Closed-loop output error: parameters with which the simulated robot does what was measured."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from enum import Enum
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array
from ..._choices import chosen
from ..equations import Block, Equations
from ..estimate import EstimateStatus, Method
from ..least_squares import check_count
from ..reduction import Reduction
from ..signals import Piece, piece_signals
from ..torque_block import decimated
from .blocks import given, reduced, sandwich
from .controller import Controller
from .didim import DidimStep, weighted_step
from .estimate import SimulatedEstimate
from .instrumental import first_values, ran_away, torque_sizes
from .iteration import reweighted
from .loop import ClosedLoop, closed_loop
from .references import references
from .simulated import simulated_signals, simulated_use

_DIFFERENCE = 1e-5
"""Part of the torque that a parameter is moved by for its sensitivity."""
_ROUNDING = 1e-10
"""Part of the outputs below which an error is rounding."""
_SLACK = 1e-9
"""Of an equation, by which the weighted squares of the errors may grow."""


class Output(Enum):
    """Which outputs of the simulated robot are compared with the log.

    Examples
    --------
    >>> Output.TORQUE.name
    'TORQUE'
    """

    TORQUE = "torques"
    POSITION = "positions"
    BOTH = "torques and positions"


def output_error(
    system: Equations,
    reduction: Reduction,
    controller: Controller | None = None,
    start: ArrayLike | None = None,
    *,
    output: Output | Literal["torque", "position", "both"] = Output.TORQUE,
    loop: ClosedLoop | None = None,
    iterations: int = 20,
    lags: int | None = None,
) -> SimulatedEstimate:
    """Closed-loop output error (CLOE): the simulated robot does what the measured one did.

    Gauss-Newton steps on the differences of measured and simulated outputs, both through the same
    decimation, weighted by their own deviations; sensitivities are central differences of
    simulations, 2 b of them a step. Torques are compared where the references keep a joint out of
    its dead band.

    Parameters
    ----------
    system : Equations
        Robot, log and choices.
    reduction : Reduction
        Of these equations; for the start and the sizes of the parameters.
    controller : Controller, optional
        That of the robot; default one that is tuned to follow closely.
    start : array_like, shape (b,), optional
        Parameters to begin with; default weighted least squares.
    output : Output or str
        "torque", "position" or "both".
    loop : ClosedLoop, optional
        How the robot is simulated, instead of ``controller``.
    iterations : int
        Steps at most.
    lags : int, optional
        As for `correlated_covariance`.

    Returns
    -------
    SimulatedEstimate
        ``sigma`` has an entry for each output: torques first, then positions.

    Raises
    ------
    InvalidValueError, ShapeError
        Fewer equations than parameters; a controller that does not fit; a friction model; another
        output.

    References
    ----------
    A. Janot, M. Gautier, A. Jubien and P.-O. Vandanjon, "Comparison between the CLOE method and the
    DIDIM method for robots identification", IEEE T-CST 22(5), 2014, sections II and III.
    """
    which = chosen(Output, output, "output")
    check_count(reduction)
    first = first_values(reduction, start)
    if loop is None:
        loop = closed_loop(system, first, controller)
    if loop is None:
        return ran_away(Method.CLOE, system, first, loop)
    way = loop
    size = torque_sizes(reduction)

    def advance(values: Array, weights: Array | None) -> DidimStep:
        found = reduced(system, _blocks(system, way, values, size, which))
        step = weighted_step(found, values, weights)
        # errors that are rounding do not count
        lengths = np.array([float(R[:, -1] @ R[:, -1]) for R in found.factors])
        errors = np.maximum(found.sums(values), _ROUNDING**2 * lengths)
        return replace(step, cost=float(step.weights**2 @ errors))

    ended = reweighted(first, advance, size, iterations, _SLACK * reduction.rows)
    last = ended.last
    if last is None:
        return ran_away(Method.CLOE, system, first, loop)
    equations = given(system, lambda: _blocks(system, way, ended.values, size, which))
    spread = sandwich(equations, ended.values, last.weights, last.inverse, lags)
    notes = loop.notes
    if which is not Output.TORQUE and system.log.q_ref is None:
        notes = (
            *notes,
            "Positions are compared with a simulation that follows them; give references.",
        )
    if ended.status is not EstimateStatus.SOLVED:
        notes = (*notes, ended.status.sentence)
    return SimulatedEstimate(
        Method.CLOE, system.names, ended.values, spread.covariance, last.sigma, ended.status,
        ended.iterations, notes, last.deviations, spread.lags, last.condition, 1.0, loop,
    )  # fmt: skip


def _blocks(
    system: Equations, loop: ClosedLoop, values: Array, size: Array, which: Output
) -> Iterator[Block]:
    """Outputs linear in the parameters around values: ``y - y_s + S values = S b``."""
    b = len(values)
    moves = _DIFFERENCE * size
    log = system.log
    centre = simulated_signals(system, loop, values)
    sides = [
        [simulated_signals(system, loop, values + side * move) for side in (1.0, -1.0)]
        for move in np.diag(moves)
    ]
    for piece, found in centre:
        first = max(piece.start - system.processing.reach, piece.low)
        rows = slice(first, first + len(found))
        measured = _outputs(which, np.array(log.tau[rows]), np.array(log.q[rows]))
        y = measured - _outputs(which, found.tau, found.q)
        S = np.empty((*y.shape, b))
        for k, runs in enumerate(sides):
            up, down = (_outputs(which, x.tau, x.q) for _, x in map(next, runs))
            S[:, :, k] = (up - down) / (2.0 * moves[k])
        speeds = _reference_speeds(system, loop, piece, first)
        S, y, v = _thinned(system, piece, S, y, speeds)
        moving = simulated_use(system, loop, v)
        always = np.ones(moving.shape, dtype=bool)
        uses = {
            Output.TORQUE: moving,
            Output.POSITION: always,
            Output.BOTH: np.hstack((moving, always)),
        }
        t = log.dt * np.arange(
            piece.start, piece.stop, system.processing.decimation, dtype=np.float64
        )
        yield Block(t, S, y + S @ values, uses[which], v)


def _outputs(which: Output, tau: Array, q: Array) -> Array:
    if which is Output.TORQUE:
        return tau
    return q if which is Output.POSITION else np.hstack((tau, q))


def _reference_speeds(system: Equations, loop: ClosedLoop, piece: Piece, first: int) -> Array:
    """Velocities that are followed: they do not change with the parameters."""
    log, choices = system.log, system.processing
    last = min(piece.stop + choices.reach, piece.high)
    if not loop.referenced:
        return piece_signals(log, choices, replace(piece, start=first, stop=last), 0).v
    return references(log, choices, piece, first, last, None, loop.width).v[: last - first]


def _thinned(
    system: Equations, piece: Piece, S: Array, y: Array, v: Array
) -> tuple[Array, Array, Array]:
    """The same decimation as that of the measured equations."""
    step = system.processing.decimation
    k, m, b = S.shape
    wide = np.concatenate((S.reshape(k, -1), y, v), axis=1)
    centre = piece.start - max(piece.start - system.processing.reach, piece.low)
    count = -(-(piece.stop - piece.start) // step)
    kept = decimated(iter((wide,)), step, centre, count, wide.shape[1])
    return (
        kept[:, : m * b].reshape(-1, m, b),
        kept[:, m * b : m * b + m],
        np.ascontiguousarray(kept[:, m * b + m :]),
    )
