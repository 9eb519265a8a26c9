"""Instrumental variables, direct and inverse models, and closed-loop output error.

All simulate the controlled robot with the last parameters, and share these options.

Parameters
----------
controller : Controller, optional
    Controller of the robot; default one tuned for small tracking errors.
start : array_like, shape (b,), optional
    Initial parameters; default weighted least squares.
iterations : int
    Largest number of steps.
lags : int, optional
    Lags of the covariance, see `correlated_covariance`.
width : array_like, scalar or shape (n,), optional
    Velocities below which the simulated dry friction is linear; default by the log.
substeps : int, optional
    Runge-Kutta steps of a sample; default as many as friction requires, up to 64.

References
----------
A. Janot, P.-O. Vandanjon and M. Gautier, IEEE T-CST 22(1), 2014, section III (IV); M. Gautier, A.
Janot and P.-O. Vandanjon, IEEE T-CST 21(2), 2013, section III (DIDIM); A. Janot, M. Gautier, A.
Jubien and P.-O. Vandanjon, IEEE T-CST 22(5), 2014, sections II and III (CLOE).

Examples
--------
>>> Instrumental(iterations=5).name, OutputError(output="both").output
('iv', 'both')
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, Frozen, as_number
from ...errors import InvalidValueError
from ...estimation.covariance import correlated_covariance
from ...estimation.estimate import Estimate
from ...estimation.factor import TriangularFactors, reduced
from ...estimation.linear import group_leverage, solved, value_sizes
from ..equations import Block, Equations
from ..forms import decimated, decimated_samples
from ..signals import Piece
from .loop import ClosedLoop, closed_loop
from .method import GivenBlocks, Pairs, SimulatingMethod, instrument_step
from .simulation import ClosedLoopSimulator, SimulationDivergedError

_PARTS = 8  # holding periods of an assumed controller's torques per sample
_DIFFERENCE = 1e-5  # finite-difference step of a parameter, relative to its torque size
_OUTPUTS = ("torque", "position", "both")


@dataclass(frozen=True, slots=True, eq=False)
class Instrumental(SimulatingMethod):
    """Instrumental variables (IDIM-IV): consistent although noise is in the regressor.

    The regressor Z of the simulated motion, which the noise of the sensors does not reach, is the
    instrument: ``Z^T S (y - W b) = 0``.
    """

    name: ClassVar[str] = "iv"
    title: ClassVar[str] = "instrumental variables of the simulated robot"

    def _simulated(self, simulator: ClosedLoopSimulator, values: Array, size: Array) -> Pairs:
        """The simulated regressor and the measured equations."""
        return instrument_pairs(simulator, values)


def instrument_pairs(simulator: ClosedLoopSimulator, values: Array) -> Pairs:
    """The regressor simulated with values (b,), and the measured equations."""
    signals = simulator.signals(values)

    def pairs() -> Iterator[tuple[Array, Block]]:
        for piece, simulated in simulator.blocks(signals):
            block = simulator.system.block(piece)
            yield simulated.W, replace(block, use=block.use & simulated.use)

    return pairs


@dataclass(frozen=True, slots=True, eq=False)
class Didim(SimulatingMethod):
    """Direct and inverse dynamic identification models (DIDIM): torques alone are measured.

    Weighted least squares explain the measured torque by the regressor of the simulated motion.
    Where the log has references, measured positions serve only for the initial parameters.
    """

    iterations: int = 50
    name: ClassVar[str] = "didim"
    title: ClassVar[str] = "direct and inverse dynamic identification models"
    _memory: ClassVar[int] = 6
    _advice: ClassVar[tuple[str, ...]] = (
        "DIDIM does not converge where the simulated motion depends on the parameters more than "
        "the torques determine them: use instrumental variables, which use the measured motion.",
    )

    def _simulated(self, simulator: ClosedLoopSimulator, values: Array, size: Array) -> Pairs:
        """The simulated regressor and the measured torque."""
        signals = simulator.signals(values)
        return lambda: ((block.W, block) for _, block in simulator.blocks(signals))

    def _loop(self, system: Equations, values: Array) -> ClosedLoop | None:
        """Closed loop; torques of an assumed controller are held for a part of a sample.

        A held torque lags by half of its period, an error of inertia and friction.
        """
        loop = SimulatingMethod._loop(self, system, values)
        if loop is None or self.controller is not None:
            return loop
        quick = replace(loop.controller, period=system.log.dt / _PARTS)
        quicker = closed_loop(system, values, quick, self.width, self.substeps)
        note = (
            f"Its torques are held for one of {_PARTS} parts of a sample. Standard errors of DIDIM "
            "do not include the difference between this controller and that of the robot."
        )
        return quicker and replace(quicker, notes=(*loop.notes, note))


@dataclass(frozen=True, slots=True, eq=False)
class OutputError(SimulatingMethod):
    """Closed-loop output error (CLOE): simulated outputs are fitted to the measured ones.

    Gauss-Newton steps on the differences, both through the same decimation; sensitivities are
    differences of b simulations. Torques are compared where the references keep a joint out of its
    dead band. ``output`` is "torque", "position" or "both" (``sigma`` has the torques first).
    """

    output: Literal["torque", "position", "both"] = "torque"
    name: ClassVar[str] = "cloe"
    title: ClassVar[str] = "closed-loop output error"
    _descends: ClassVar[bool] = True

    def __post_init__(self) -> None:
        SimulatingMethod.__post_init__(self)
        if self.output not in _OUTPUTS:
            raise InvalidValueError(f"output: expected one of {_OUTPUTS}, got {self.output!r:.60}.")

    def _outputs(self, tau: NDArray[Any], q: NDArray[Any]) -> NDArray[Any]:
        return {"torque": tau, "position": q}.get(self.output, np.hstack((tau, q)))

    def _simulated(self, simulator: ClosedLoopSimulator, values: Array, size: Array) -> Pairs:
        """Outputs around values: ``y - y_s + S values = S b`` with the sensitivities S."""
        system = simulator.system
        log, step, pieces = system.log, system.processing.decimation, system.pieces()

        def simulated(values: Array) -> list[Array]:
            signals = simulator.signals(values)
            rows = ((x, simulator.window(x)[1], signals[x.begin]) for x in pieces)
            return [_decimated(system, x, self._outputs(s.tau[at], s.q[at])) for x, at, s in rows]

        centre, moves = simulated(values), _DIFFERENCE * size
        sides = zip(*(simulated(values + move) for move in np.diag(moves)), strict=True)
        pairs = []
        for piece, x, moved in zip(pieces, centre, sides, strict=True):
            S = np.stack([(side - x) / moves[k] for k, side in enumerate(moved)], axis=2)
            rows, inner = simulator.window(piece)
            out = self._outputs(np.array(log.tau[rows]), np.array(log.q[rows]))
            y = _decimated(system, piece, out) - x + S @ values
            v = _decimated(system, piece, simulator.references[piece.begin].v[:-1][inner])
            use = self._outputs(simulator.use(v), np.ones(v.shape, dtype=bool))
            t = log.dt * np.arange(piece.start, piece.stop, step, dtype=np.float64)
            pairs.append((S, Block(t, S, y, use, v)))
        return lambda: pairs

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
    return decimated([rows], *decimated_samples(system, piece))


_EFFECT = 0.5  # least relevant bias, in standard errors of least squares


@dataclass(frozen=True, slots=True, eq=False)
class HausmanResult(Frozen):
    """Result of the Durbin-Wu-Hausman test: bias of least squares by parameter. Read-only.

    Shapes: effect, standard_errors, least_squares_errors, parameter_p (b,).
    """

    names: tuple[str, ...]
    effect: Array
    standard_errors: Array
    least_squares_errors: Array
    parameter_p: Array
    lags: int
    level: float

    @property
    def p(self) -> float:
        """Smallest p-value of the parameters; NaN without a test."""
        return float(self.parameter_p.min())

    @property
    def biased_parameters(self) -> NDArray[np.bool_]:
        """Parameters whose bias exceeds half a standard error of least squares, shape (b,)."""
        return self.parameter_p < self.level

    @property
    def biased(self) -> bool:
        """Whether any parameter is biased."""
        return bool(self.biased_parameters.any())

    @property
    def sentence(self) -> str:
        """Outcome of the test as a sentence."""
        if np.isnan(self.p):
            return "Whether least squares are biased was not tested: the robot was not simulated."
        if not self.biased:
            return (
                "No bias of least squares above half a standard error was found "
                f"(Durbin-Wu-Hausman, p = {self.p:.2g})."
            )
        size = np.abs(self.effect) / self.least_squares_errors
        order = [k for k in np.argsort(-size) if self.biased_parameters[k]]
        named = ", ".join(f"{self.names[k]} ({size[k]:.2g})" for k in order)
        return (
            f"Least squares are biased (Durbin-Wu-Hausman, p = {self.p:.2g}). Bias in standard "
            f"errors: {named}. Use a lower cutoff (processing=) or instrumental variables."
        )


def hausman_test(
    system: Equations, estimate: Estimate, level: float = 0.05, lags: int | None = None
) -> HausmanResult:
    """Durbin-Wu-Hausman test: whether least squares and instrumental variables differ too much.

    Noise of the positions in the regressor biases least squares. The test is whether the difference
    of a parameter exceeds half a standard error of least squares; its variance holds for residuals
    that are correlated in time and between joints.

    Parameters
    ----------
    system : Equations
        The equations that least squares would solve.
    estimate : Estimate
        Estimate of `Instrumental` on these equations, with the simulation of the instruments.
    level : float
        Probability of a false alarm, all parameters together.
    lags : int, optional
        As for `correlated_covariance`.

    Returns
    -------
    HausmanResult
        Differences, standard errors, p-values, and a sentence.

    References
    ----------
    J. Hausman, Econometrica 46(6), 1978; A. Janot, P.-O. Vandanjon and M. Gautier, IEEE ICRA 2014;
    J. Hodges and E. Lehmann, J. Royal Statistical Society B 16(2), 1954 (effects above a bound).

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> from robotmodels.identification import fit
    >>> arm, log = example_log()
    >>> result = fit(arm, log, "iv", drive=("Fv",))
    >>> 0.0 <= hausman_test(result.equations, result.estimate).p <= 1.0
    True
    """
    from scipy.stats import norm

    level = as_number(level, "level", above=0.0, below=1.0)
    if estimate.names != system.names or not hasattr(estimate.details, "loop"):
        raise InvalidValueError(
            "estimate: expected instrumental variables on the parameters of these equations, as "
            "Instrumental().solve(system, ...) gives them."
        )
    b, loop, values = len(system.names), estimate.details.loop, estimate.values
    none = np.full(b, np.nan)
    untested = HausmanResult(system.names, none, none, none, none, 0, level)
    if loop is None or not np.isfinite(estimate.standard_errors).all():
        return untested
    simulator = ClosedLoopSimulator(system, loop)
    try:
        pairs = instrument_pairs(simulator, values)
        factors = reduced(system.names, (block for _, block in pairs()))
        step = instrument_step(system.names, values, pairs, value_sizes(factors))
    except SimulationDivergedError:  # the last step of an estimate that did not converge
        return untested
    ls_values, inverse, _ = solved(factors, step.weights)

    def residuals() -> Iterator[Block]:
        """Scores of the difference of the estimates and of least squares."""
        for Z, block in pairs():
            least = block.W @ inverse
            W = np.concatenate((least - Z @ step.inverse.T, least), axis=2)
            yield replace(block, W=W, y=block.y - block.W @ ls_values)

    blocks, leverage = GivenBlocks(residuals), group_leverage(factors, step.weights, inverse)
    spread = correlated_covariance(
        blocks, np.zeros(2 * b), step.weights, np.eye(2 * b), lags, leverage
    )
    errors, least = np.sqrt(np.maximum(np.diag(spread.covariance), 0.0)).reshape(2, b)
    effect = ls_values - values
    # p-values under the largest allowed bias, with Bonferroni's correction
    safe = np.maximum(errors, np.finfo(float).tiny)
    each = sum(norm.sf((np.abs(effect) + side * _EFFECT * least) / safe) for side in (-1.0, 1.0))
    p = np.minimum(b * each, 1.0)
    return HausmanResult(system.names, effect, errors, least, p, spread.lags, level)
