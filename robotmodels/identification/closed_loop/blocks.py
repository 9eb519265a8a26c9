"""Equations whose blocks are given, so that what is built for measured ones serves them too."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..._arrays import Array
from ...estimation.merging import merged_tree
from ..correlated import CorrelatedCovariance, correlated_covariance
from ..equations import Block, Equations
from ..forms.torque import signals_block
from ..preparation.signals import Piece
from ..scale.reduction import Reduction, block_reduction, merge
from .loop import ClosedLoop
from .simulated import simulated_signals, simulated_use

_KEPT = 64_000_000
"""Bytes of measured blocks that are kept from one iteration to the next."""


@dataclass(frozen=True, slots=True, eq=False)
class GivenEquations(Equations):
    """Equations with blocks from another source, such as simulated signals."""

    source: Callable[[], Iterator[Block]] = lambda: iter(())

    def blocks(self) -> Iterator[Block]:
        """The blocks that are given."""
        return self.source()


def given(system: Equations, source: Callable[[], Iterator[Block]]) -> GivenEquations:
    """Replace the blocks of a system of equations."""
    return GivenEquations(
        system.base, system.names, system.log, system.processing, system.form, source
    )


def simulated_blocks(
    system: Equations, loop: ClosedLoop, values: Array
) -> Iterator[tuple[Piece, Block]]:
    """Regressor of the simulated robot's motion beside the torque that was measured."""
    for piece, found in simulated_signals(system, loop, values):
        first = max(piece.start - system.processing.reach, piece.low)
        tau = np.array(system.log.tau[first : first + len(found)])
        block = signals_block(system, piece, replace(found, tau=tau))
        yield piece, replace(block, use=simulated_use(system, loop, block.v))


def measured_blocks(system: Equations) -> Callable[[Piece], Block]:
    """The measured equations of a piece, kept if all of them together are small."""
    n, b = system.model.n, len(system.names)
    size = 8 * n * (b + 1) * (len(system.log) // system.processing.decimation + 1)
    if size > _KEPT:
        return system.block
    kept = {(piece.start, piece.stop): system.block(piece) for piece in system.pieces()}
    return lambda piece: kept[piece.start, piece.stop]


def reduced(system: Equations, blocks: Iterator[Block]) -> Reduction:
    """Reduction of blocks, in the fixed tree of `reduce_equations`."""
    found = merged_tree((block_reduction(system.names, block) for block in blocks), merge)
    if found is None:
        raise ValueError("blocks: none.")
    return found


def sandwich(
    system: GivenEquations, values: Array, weights: Array, inverse: Array, lags: int | None
) -> CorrelatedCovariance:
    """Sandwich covariance for correlated residuals; the inverse need not be symmetric.

    Shapes: values (b,), weights (m,), inverse (b, b).
    """

    def turned() -> Iterator[Block]:
        for block in system.blocks():
            e = block.y - block.W @ values
            W = block.W @ inverse.T
            yield replace(block, W=W, y=W @ values + e)

    spread = correlated_covariance(
        given(system, turned), values, weights, np.eye(len(values)), lags
    )
    return replace(spread, covariance=0.5 * (spread.covariance + spread.covariance.T))
