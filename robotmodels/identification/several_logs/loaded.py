"""Equations of several logs in common unknowns: the robot's, and those of the loads it carried.

Source: W. Khalil, M. Gautier and P. Lemoine, "Identification of the payload inertial parameters of
industrial manipulators", IEEE ICRA 2007, (8)-(12).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from ..._arrays import Array, Rebuilt, read_only
from ...errors import InvalidValueError
from ...estimation.merging import merged_tree
from ...inertia import InertialParameters
from ...minimal_parameters import BaseParameters
from ..equations import Block, Equations
from ..forms.rows import combined, formed_block
from ..preparation.signals import Piece
from ..scale.reduction import Reduction, block_reduction, merge

_LEAST_NOISE = 1e-8
"""Deviation relative to what is measured, below which residuals are rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class MappedEquations(Rebuilt):
    """Equations of one log whose base parameters are a linear map of common unknowns.

    Shapes: matrix (b, c), side (n, n).
    """

    system: Equations
    matrix: Array
    names: tuple[str, ...]
    side: Array | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "matrix", read_only(self.matrix))
        if self.side is not None:
            object.__setattr__(self, "side", read_only(self.side))

    def block(self, piece: Piece) -> Block:
        """Equations of one piece in the common unknowns."""
        block = side_block(self.system, piece, self.side)
        return Block(block.t, block.W @ self.matrix, block.y, block.use, block.v)

    def blocks(self) -> Iterator[Block]:
        """Equations of the whole log in the common unknowns, piece by piece."""
        for piece in self.system.pieces():
            yield self.block(piece)


@dataclass(frozen=True, slots=True, eq=False)
class SeveralLogs(Rebuilt):
    """Equations of several logs in the same unknowns, one log after the other."""

    parts: tuple[MappedEquations, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The c unknowns."""
        return self.parts[0].names

    def blocks(self) -> Iterator[Block]:
        """Equations of all logs, piece by piece."""
        for part in self.parts:
            yield from part.blocks()


def side_block(system: Equations, piece: Piece, side: Array | None) -> Block:
    """Equations of a piece, or combinations of the joints' equations. Shapes: side (n, n)."""
    if side is None or np.array_equal(side, np.eye(len(side))):
        return system.block(piece)
    return formed_block(system, piece, combined(side))


def reduced_side(
    system: Equations, side: Array | None = None, executor: Executor | None = None
) -> Reduction:
    """Factors of one log in all its base parameters. Shapes: side (n, n)."""
    parts = system.pieces()
    if executor is None:
        leaves = (_leaf(system, piece, side) for piece in parts)
    else:
        leaves = executor.map(_leaf, [system] * len(parts), parts, [side] * len(parts))
    found = merged_tree(leaves, merge)
    if found is None:
        raise InvalidValueError("log: no equations are left; cut less off its edges.")
    return found


def _leaf(system: Equations, piece: Piece, side: Array | None) -> Reduction:
    return block_reduction(system.names, side_block(system, piece, side))


def mapped_reduction(
    reductions: Sequence[Reduction], matrices: Sequence[Array], names: tuple[str, ...]
) -> Reduction:
    """Factors of several logs in common unknowns. Shapes: matrices (b, c)."""
    parts = []
    for reduction, matrix in zip(reductions, matrices, strict=True):
        factors = tuple(
            np.asarray(np.linalg.qr(np.column_stack((F[:, :-1] @ matrix, F[:, -1])), mode="r"))
            for F in reduction.factors
        )
        parts.append(Reduction(names, factors, reduction.counts, reduction.left_out))
    found = merged_tree(parts, merge)
    if found is None:
        raise InvalidValueError("logs: expected at least one log.")
    return found


def residual_noise(reduction: Reduction) -> Array:
    """Noise standard deviation of each kind, from its own equations alone."""
    found = np.ones(len(reduction.factors))
    for m, F in enumerate(reduction.factors):
        size = np.linalg.norm(F[:, -1])
        count = max(int(reduction.counts[m]), 1)
        if not size > 0.0:
            continue
        U, s, _ = np.linalg.svd(F[:, :-1] / column_lengths(F[:, :-1]), full_matrices=False)
        U = U[:, s > 1e-12 * s.max(initial=0.0)]
        rest = np.linalg.norm(F[:, -1] - U @ (U.T @ F[:, -1]))
        left = max(count - U.shape[1], 1)
        found[m] = max(float(rest) / np.sqrt(left), _LEAST_NOISE * float(size) / np.sqrt(count))
    return found


def column_lengths(R: Array) -> Array:
    """Lengths of columns, 1 for those that are zero."""
    lengths = np.linalg.norm(R, axis=0)
    return np.where(lengths > 0.0, lengths, 1.0)


def payload_columns(base: BaseParameters, frame: str | int | None) -> Array:
    """Base parameter columns of the ten inertial parameters of a body on a frame.

    Shapes: -> (b, 10).
    """
    place = base.model.twin.frame(frame)
    if place.parent == 0:
        raise InvalidValueError(
            f"frame: {frame!r} is fixed to the base, where a body loads no joint; give a frame of "
            "a link."
        )
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = place.rotation, place.position
    moved = InertialParameters(np.eye(10)).moved(np.broadcast_to(pose, (10, 4, 4))).values
    first = 10 * (place.parent - 1)
    return base.matrix[:, first : first + 10] @ moved.T
