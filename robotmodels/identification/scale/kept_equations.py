"""Equations whose blocks are made once, as far as a bounded memory holds them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..equations import Block, Equations
from ..preparation.signals import Piece

KEPT_BYTES = 2**25
"""Of the blocks that are kept."""


class _Store:
    """Blocks of the first pieces of a log, in all columns."""

    def __init__(self, system: Equations, most: int) -> None:
        self.system = system
        self.most = most
        self.size = 0
        self.blocks: dict[Piece, Block] = {}

    def serves(self, system: Equations) -> bool:
        """Whether equations are the same but for their columns, which are some of these."""
        own = self.system
        return (
            system.log is own.log
            and system.processing is own.processing
            and system.form is own.form
            and system.base.model is own.base.model
            and system.base.drive == own.base.drive
            and system.base.friction is own.base.friction
            and set(system.names) <= set(own.names)
        )

    def block(self, piece: Piece) -> Block:
        """Equations of a piece, kept if there is room."""
        block = self.blocks.get(piece)
        if block is None:
            block = self.system.block(piece)
            size = sum(x.nbytes for x in (block.t, block.W, block.y, block.use, block.v))
            if self.size + size <= self.most:
                self.size += size
                self.blocks[piece] = block
        return block


@dataclass(frozen=True, slots=True, eq=False)
class KeptEquations(Equations):
    """Equations with a cache of their first blocks."""

    store: Any = None

    def block(self, piece: Piece) -> Block:
        """Equations of one piece, as `Equations.block`; not to be written to."""
        if self.store is None or not self.store.serves(self):
            return plain(self).block(piece)
        block = self.store.block(piece)
        every = self.store.system.names
        if self.names == every:
            return block
        columns = [every.index(name) for name in self.names]
        return replace(block, W=np.take(block.W, columns, axis=2))

    def __reduce__(self) -> tuple[Any, ...]:
        return Equations, (self.base, self.names, self.log, self.processing, self.form)


def kept_equations(system: Equations, most: int = KEPT_BYTES) -> KeptEquations:
    """Equations with a cache of blocks, as far as memory allows."""
    own = plain(system)
    return KeptEquations(own.base, own.names, own.log, own.processing, own.form, _Store(own, most))


def plain(system: Equations) -> Equations:
    """Equations without a cache of blocks."""
    return Equations(system.base, system.names, system.log, system.processing, system.form)
