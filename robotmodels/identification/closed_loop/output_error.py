"""Closed-loop output error: outputs of the simulated robot fitted to the measured ones."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...errors import InvalidValueError
from ...estimation.estimate import Estimate
from ...estimation.factor import TriangularFactors, reduced
from ..equations import Block, Equations
from ..forms import decimated
from ..signals import Piece
from .method import Advance, Scores, SimulatingMethod, Step, weighted_step
from .simulation import ClosedLoopSimulator

_DIFFERENCE = 1e-5
"""Finite-difference step of a parameter, relative to its torque size."""
_ROUNDING = 1e-10
"""Rounding tolerance: relative error of the outputs."""
_OUTPUTS = ("torque", "position", "both")


@dataclass(frozen=True, slots=True, eq=False)
class OutputError(SimulatingMethod):
    """Closed-loop output error (CLOE): simulated outputs are fitted to the measured ones.

    Gauss-Newton steps on the differences of measured and simulated outputs, both through the same
    decimation, weighted by their standard deviations. Sensitivities are differences of b
    simulations, recomputed where a parameter has changed by a standard error. Torques are compared
    where the references keep a joint out of its dead band.

    Parameters
    ----------
    controller, start, iterations, lags, width, substeps
        See `Instrumental`.
    output : str
        "torque", "position" or "both"; ``sigma`` then has an entry for each output, torques first.

    Raises
    ------
    InvalidValueError
        Another output.

    References
    ----------
    A. Janot, M. Gautier, A. Jubien and P.-O. Vandanjon, "Comparison between the CLOE method and the
    DIDIM method for robots identification", IEEE T-CST 22(5), 2014, sections II and III.

    Examples
    --------
    >>> OutputError(output="both").output
    'both'
    """

    output: Literal["torque", "position", "both"] = "torque"
    name: ClassVar[str] = "cloe"
    title: ClassVar[str] = "closed-loop output error"
    _slack: ClassVar[float] = 1e-9

    def __post_init__(self) -> None:
        SimulatingMethod.__post_init__(self)
        if self.output not in _OUTPUTS:
            raise InvalidValueError(f"output: expected one of {_OUTPUTS}, got {self.output!r:.60}.")

    def _prepare(
        self, simulator: ClosedLoopSimulator, factors: TriangularFactors, size: Array
    ) -> tuple[Advance, Scores]:
        """One Gauss-Newton step, and its equations."""
        system, moves = simulator.system, _DIFFERENCE * size
        log, step, pieces = system.log, system.processing.decimation, system.pieces()

        def outputs(tau: NDArray[Any], q: NDArray[Any]) -> NDArray[Any]:
            return {"torque": tau, "position": q}.get(self.output, np.hstack((tau, q)))

        def simulated(values: Array) -> list[Array]:
            signals = simulator.signals(values)
            rows = ((x, simulator.window(x)[1], signals[x.begin]) for x in pieces)
            return [_decimated(system, x, outputs(s.tau[at], s.q[at])) for x, at, s in rows]

        measured, uses, speeds = [], [], []
        for piece in pieces:
            rows, inner = simulator.window(piece)
            out = outputs(np.array(log.tau[rows]), np.array(log.q[rows]))
            measured.append(_decimated(system, piece, out))
            speeds.append(_decimated(system, piece, simulator.targets[piece.begin].v[:-1][inner]))
            moving = simulator.use(speeds[-1])
            always = np.ones(moving.shape, dtype=bool)
            uses.append(outputs(moving, always))

        # sensitivities are kept while the parameters change by less than their standard errors
        S: list[Array] = []
        made_at = near = np.full(len(size), np.nan)

        def blocks(values: Array) -> list[Block]:
            """Outputs around values: ``y - y_s + S values = S b`` with the sensitivities S."""
            nonlocal S, made_at
            centre = simulated(values)
            if not (np.abs(values - made_at) <= near).all():
                new = [np.empty((*x.shape, len(values))) for x in centre]
                for k, move in enumerate(np.diag(moves)):
                    for part, x, moved in zip(new, centre, simulated(values + move), strict=True):
                        part[:, :, k] = (moved - x) / moves[k]
                S, made_at = new, values
            t = [log.dt * np.arange(x.start, x.stop, step, dtype=np.float64) for x in pieces]
            y = [m - x + s @ values for m, x, s in zip(measured, centre, S, strict=True)]
            return [Block(*parts) for parts in zip(t, S, y, uses, speeds, strict=True)]

        def advance(values: Array, weights: Array | None) -> Step:
            nonlocal near
            linear = reduced(factors.names, blocks(values))
            step = weighted_step(linear, values, weights)
            near = step.standard_errors
            lengths = np.array([float(R[:, -1] @ R[:, -1]) for R in linear.factors])
            errors = np.maximum(linear.sums(values), _ROUNDING**2 * lengths)
            return step._replace(cost=float(step.weights**2 @ errors))

        def scores(values: Array) -> Callable[[], Iterable[Block]]:
            last = blocks(values)
            return lambda: last

        return advance, scores

    def solve(self, system: Equations, factors: TriangularFactors) -> Estimate:
        """Estimate the parameters."""
        found = SimulatingMethod.solve(self, system, factors)
        if self.output == "torque" or system.log.q_ref is not None:
            return found
        note = (
            "The log has no references: its measured positions are compared with a simulation that "
            "follows them, which hardly depends on the parameters. Give q_ref to the log."
        )
        return replace(found, notes=(*found.notes, note))


def _decimated(system: Equations, piece: Piece, rows: Array) -> Array:
    """Decimation as for the measured equations."""
    step = system.processing.decimation
    centre = piece.start - max(piece.start - system.processing.reach, piece.low)
    count = -(-(piece.stop - piece.start) // step)
    return decimated([rows], step, centre, count)
