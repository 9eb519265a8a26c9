"""Instrumental variables: the regressor of the simulated robot separates signal from noise."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ..._arrays import Array
from ...estimation.factor import TriangularFactors
from ...estimation.linear import inverse_std
from ..equations import Block
from ..signals import Signals
from .method import Advance, Scores, SimulatingMethod, Step, check_excited
from .simulation import ClosedLoopSimulator

Pairs = Iterable[tuple[Array, Block]]
"""Instruments (k, m, b) and the measured equations."""


@dataclass(frozen=True, slots=True, eq=False)
class Instrumental(SimulatingMethod):
    """Instrumental variables (IDIM-IV): consistent although noise is in the regressor.

    The controlled robot is simulated with the last parameters; the regressor Z of its motion, which
    the noise of the sensors does not reach, is the instrument: ``Z^T S (y - W b) = 0``.

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
    A. Janot, P.-O. Vandanjon and M. Gautier, "A generic instrumental variable approach for
    industrial robot identification", IEEE T-CST 22(1), 2014, section III.

    Examples
    --------
    >>> Instrumental(iterations=5).name
    'iv'
    """

    name: ClassVar[str] = "iv"
    title: ClassVar[str] = "instrumental variables of the simulated robot"

    def _prepare(
        self, simulator: ClosedLoopSimulator, factors: TriangularFactors, size: Array
    ) -> tuple[Advance, Scores]:
        """One step with weights from its residuals, and its blocks with ``Z`` for ``W``."""
        pairs = paired(simulator)

        def advance(values: Array, weights: Array | None) -> Step:
            return instrument_step(factors, values, pairs(simulator.signals(values)), size)

        def scores(values: Array) -> Callable[[], Iterable[Block]]:
            signals = simulator.signals(values)

            def blocks() -> Iterator[Block]:
                for Z, block in pairs(signals):
                    yield replace(block, W=Z, y=block.y - block.W @ values + Z @ values)

            return blocks

        return advance, scores


def paired(simulator: ClosedLoopSimulator) -> Callable[[dict[int, Signals]], Pairs]:
    """Function from simulated signals to pairs of their regressor and the measured equations."""

    def pairs(signals: dict[int, Signals]) -> Pairs:
        for piece, simulated in simulator.blocks(signals):
            block = simulator.system.block(piece)
            yield simulated.W, replace(block, use=block.use & simulated.use)

    return pairs


def instrument_step(factors: TriangularFactors, values: Array, both: Pairs, size: Array) -> Step:
    """Solve ``Z^T S (y - W b) = 0`` for the correction of the values, which limits rounding."""
    from scipy.linalg import eigh

    b, m = len(values), len(factors.factors)
    sums, Ze = np.zeros((m, 3, b, b)), np.zeros((m, b))
    squares, counts = np.zeros(m), np.zeros(m)
    for Z, block in both:
        e = block.y - block.W @ values
        for j in range(m):
            use = block.use[:, j]
            z, w, r = Z[use, j] * size, block.W[use, j] * size, e[use, j]
            sums[j] += z.T @ w, z.T @ z, w.T @ w
            Ze[j] += z.T @ r
            squares[j] += float(r @ r)
            counts[j] += len(r)
    left = max(1.0 - b / max(float(counts.sum()), 1.0), 1e-3)
    sigma = np.sqrt(squares / np.maximum(counts * left, 1e-300))
    weights = inverse_std(factors, sigma)
    ZW, ZZ, WW = np.einsum("j,jkxy->kxy", weights**2, sums)
    rows, columns = np.sqrt(np.diag(ZZ)), np.sqrt(np.diag(WW))
    check_excited(factors.names, (rows > 0.0) & (columns > 0.0))
    scaled = ZW / np.outer(rows, columns)
    inverse = np.linalg.inv(scaled) / np.outer(columns, rows)
    spread = inverse @ ZZ @ inverse.T
    # squared canonical correlations; rounding on the diagonals makes the products definite
    B, C = (X / np.outer(x, x) + 1e-13 * np.eye(b) for X, x in ((ZZ, rows), (WW, columns)))
    least = eigh(scaled.T @ np.linalg.solve(B, scaled), C, eigvals_only=True)[0]
    return Step(
        values=values + inverse @ (weights**2 @ Ze) * size,
        standard_errors=np.sqrt(np.maximum(np.diag(spread), 0.0)) * size,
        inverse=inverse * np.outer(size, size),
        sigma=sigma,
        weights=weights,
        next_weights=None,
        condition=float(np.linalg.cond(scaled)),
        strength=float(np.sqrt(np.clip(least, 0.0, 1.0))),
    )
