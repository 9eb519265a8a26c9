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
from ..forms.torque import decimated
from ..methods.estimate import EstimateStatus, Method
from ..methods.least_squares import check_count
from ..preparation.signals import Piece, piece_signals
from ..scale.reduction import Reduction
from .blocks import given, reduced, sandwich
from .controller import Controller
from .didim import DidimStep, weighted_step
from .estimate import SimulatedEstimate
from .instrumental import first_values, ran_away, torque_sizes
from .iteration import ROUNDING, reweighted
from .loop import ClosedLoop, closed_loop
from .references import references
from .simulated import asked_of, simulated_signals, simulated_use

_DIFFERENCE = 1e-5
"""Part of the torque that a parameter is moved by for its sensitivity."""
_ROUNDING = 1e-10
"""Part of the outputs below which an error is rounding."""
_SLACK = 1e-9
"""Of an equation, by which the weighted squares of the errors may grow."""
_KEPT = 64_000_000
"""Bytes of sensitivities that are kept from one step to the next."""
_BENT = 0.05
"""Part of a change of the outputs that kept sensitivities may miss."""
_NEAR = 0.3
"""Move, in deviations, below which the sensitivities are to be those of the last parameters."""


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
    decimation, weighted by their own deviations. Sensitivities are differences of simulations, b
    of them; they are kept over steps for which they foretell the outputs, and made anew for the
    last ones. Torques are compared where the references keep a joint out of
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

    Examples
    --------
    >>> from robotmodels.identification import (
    ...     Log,
    ...     choose_processing,
    ...     equations,
    ...     reduce_equations,
    ... )
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(1600)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> base = base_parameters(arm, drive=("Fv",))
    >>> system = equations(base, log, choose_processing(log))
    >>> found = output_error(system, reduce_equations(system))
    >>> round(float(found.values[found.names.index("Fv1")]))
    2
    """
    which = chosen(Output, output, "output")
    check_count(reduction)
    first = first_values(reduction, start)
    if loop is None:
        loop = closed_loop(system, first, controller)
    if loop is None:
        return ran_away(Method.CLOE, system, loop)
    way = loop
    size = torque_sizes(reduction)

    outputs = _Outputs(system, way, size, which)

    def advance(values: Array, weights: Array | None) -> DidimStep:
        step, bent = outputs.step(values, weights)
        if outputs.stale(values, step.deviations) and (
            bent or (np.abs(step.values - values) <= _NEAR * step.deviations).all()
        ):
            outputs.kept = None
            step, _ = outputs.step(values, weights)
        return step

    ended = reweighted(first, advance, size, iterations, _SLACK * reduction.rows)
    last = ended.last
    if last is None or ended.status is EstimateStatus.UNSTABLE:
        return ran_away(Method.CLOE, system, loop, ended.iterations)
    equations = given(system, lambda: outputs.blocks(ended.values))
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


class _Outputs:
    """Outputs linear in the parameters, whose sensitivities are kept if they are small."""

    def __init__(self, system: Equations, loop: ClosedLoop, size: Array, which: Output) -> None:
        self.system, self.loop, self.which = system, loop, which
        self.moves, self.size = _DIFFERENCE * size, size
        joints = system.model.n * (2 if which is Output.BOTH else 1)
        rows = len(system.log) // system.processing.decimation + len(system.pieces())
        self.small = 8 * joints * (len(size) + 1) * rows <= _KEPT
        self.kept: tuple[Array, list[Array], list[Array]] | None = None

    def blocks(self, values: Array) -> Iterator[Block]:
        """Outputs around values: ``y - y_s + S values = S b``, with the S that are kept."""
        system, log, step = self.system, self.system.log, self.system.processing.decimation
        asked = asked_of(system, self.loop)
        centre = simulated_signals(system, self.loop, values, asked)
        kept = None if self.kept is None else iter(self.kept[1])
        sides = [
            simulated_signals(system, self.loop, values + move, asked)
            for move in np.diag(self.moves)[: None if kept is None else 0]
        ]
        for piece, found in centre:
            first = max(piece.start - system.processing.reach, piece.low)
            rows = slice(first, first + len(found))
            out = _outputs(self.which, found.tau, found.q)
            measured = _outputs(self.which, np.array(log.tau[rows]), np.array(log.q[rows]))
            y = _thinned(system, piece, measured - out)
            v = _thinned(system, piece, _reference_speeds(system, self.loop, piece, first))
            if kept is not None:
                S = next(kept)
            else:
                S = np.empty((*y.shape, len(values)))
                for k, (_, moved) in enumerate(map(next, sides)):
                    change = _outputs(self.which, moved.tau, moved.q) - out
                    S[:, :, k] = _thinned(system, piece, change) / self.moves[k]
            moving = simulated_use(system, self.loop, v)
            always = np.ones(moving.shape, dtype=bool)
            uses = {
                Output.TORQUE: moving,
                Output.POSITION: always,
                Output.BOTH: np.hstack((moving, always)),
            }
            t = log.dt * np.arange(piece.start, piece.stop, step, dtype=np.float64)
            yield Block(t, S, y + S @ values, uses[self.which], v)

    def step(self, values: Array, weights: Array | None) -> tuple[DidimStep, bool]:
        """Step of the simulation with given parameters; whether kept sensitivities miss it."""
        bent = False
        blocks: Iterator[Block] = self.blocks(values)
        if self.small:
            made = list(blocks)
            blocks = iter(made)
            if self.kept is None:
                self.kept = values, [x.W for x in made], [x.y for x in made]
            else:
                # with the same sensitivities both sides agree as far as outputs are linear
                move, scale = values - self.kept[0], 1.0 if weights is None else weights
                foretold = (np.where(x.use, x.W @ move, 0.0) * scale for x in made)
                pairs = zip(made, self.kept[2], strict=True)
                missed = (np.where(x.use, x.y - y, 0.0) * scale for x, y in pairs)
                bent = _length(missed) > _BENT * _length(foretold)
        found = reduced(self.system, blocks)
        step = weighted_step(found, values, weights)
        # errors that are rounding do not count
        lengths = np.array([float(R[:, -1] @ R[:, -1]) for R in found.factors])
        errors = np.maximum(found.sums(values), _ROUNDING**2 * lengths)
        return replace(step, cost=float(step.weights**2 @ errors)), bent

    def stale(self, values: Array, deviations: Array) -> bool:
        """Whether kept sensitivities are those of clearly other parameters."""
        if self.kept is None:
            return False
        return bool((np.abs(values - self.kept[0]) > deviations + ROUNDING * self.size).any())


def _length(parts: Iterator[Array]) -> float:
    return float(np.sqrt(sum(float((part * part).sum()) for part in parts)))


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


def _thinned(system: Equations, piece: Piece, rows: Array) -> Array:
    """The same decimation as that of the measured equations."""
    step = system.processing.decimation
    centre = piece.start - max(piece.start - system.processing.reach, piece.low)
    count = -(-(piece.stop - piece.start) // step)
    return decimated(iter((rows,)), step, centre, count, rows.shape[1])
