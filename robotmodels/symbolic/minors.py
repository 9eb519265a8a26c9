"""Minors of the third matrix: those that decide about rank, and the factors that make all vanish.

The determinant of a sparse square part is the product of those of the diagonal blocks of its
block triangular form (A. L. Dulmage and N. S. Mendelsohn, "Coverings of bipartite graphs", 1958).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial
from itertools import combinations
from math import comb
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kinematics import jacobian
from ..kinematics.factors import jacobian_factors
from ..kinematics.singular.events import random_postures
from ..kinematics.singular.task import position_decides
from ..model import RobotModel
from .chain import TOOL, Chain
from .factoring import factored
from .polynomials import Poly, PolynomialChain, TrigRing

ROWS = ("vx", "vy", "vz", "wx", "wy", "wz")
_ZERO = 1e-11
"""Entries that stay below this in random configurations are zero."""
_MOST_MINORS = 60
_MOST_SETS = 300

Pattern = NDArray[np.bool_]


class Block(NamedTuple):
    """Rows and columns of a diagonal block."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


class Minor(NamedTuple):
    """A square part of the third matrix, rows by number and columns by place among the joints."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]
    projection: int
    intermediate: int
    blocks: tuple[Block, ...]


def filled_entries(
    model: RobotModel, frame: str | int | None, pairs: Sequence[tuple[int, int]]
) -> dict[tuple[int, int], Pattern]:
    """Nonzero entries of the third matrix (6, n), for pairs of frames."""
    q = random_postures(model, 4, seed=3)
    at_frame = model.twin.names.tool if frame is None else frame
    out = {}
    for pair in pairs:
        i, j = (at_frame if node == TOOL else node for node in pair)
        J = jacobian_factors(model, q, i, j, frame).reduced
        out[pair] = np.asarray((np.abs(J) > _ZERO).any(axis=0))
    return out


class Patterns:
    """Nonzero entries of the third matrix, for every pair of frames on the path to a frame."""

    def __init__(self, model: RobotModel, frame: str | int | None, chain: Chain) -> None:
        frames = [0, *chain.path]
        places = [chain.joints[j] for j in chain.path_joints]
        pairs = [(i, j) for i in frames for j in [*frames, TOOL]]
        patterns = filled_entries(model, frame, pairs)
        self.count = len(places)
        self.filled = {ij: pattern[:, places] for ij, pattern in patterns.items()}
        # places of the frames along the path, from its middle
        self._place = {j: k - len(chain.path) / 2 for k, j in enumerate([*frames, TOOL])}
        J = jacobian(model, random_postures(model, 4, seed=3), frame)[..., places]
        self.rank = int(np.linalg.matrix_rank(J, tol=1e-9).max())
        self.position_only = position_decides(model, frame)

    def best(self, columns: tuple[int, ...]) -> list[Minor]:
        """The square part in the frames of its simplest determinant; empty if that is zero.

        Its rows are those that are not zero, in frames where there are as many as columns.
        """
        found = []
        for (i, j), filled in self.filled.items():
            rows = nonzero_rows(filled) if self.rank < 6 else tuple(range(6))
            blocks = triangular_blocks(filled, rows, columns) if len(rows) == self.rank else ()
            if blocks:
                # the tool's place is a constant more
                away = abs(self._place[i]) + abs(self._place[j] - 0.5)
                key = (*_cost(blocks, filled), j == TOOL, away)
                found.append((key, Minor(rows, columns, i, j, blocks)))
        return [minor for _, minor in sorted(found, key=lambda option: option[0])[:1]]

    def row_minors(self) -> list[Minor]:
        """Square parts of a matrix with more rows than columns, in the frames that suit all."""
        found = []
        columns = tuple(range(self.count))
        for (i, j), filled in self.filled.items():
            if self.position_only and j != TOOL:
                continue
            pattern = filled[:3] if self.position_only else filled
            parts = [
                Minor(rows, columns, i, j, blocks)
                for rows in combinations(nonzero_rows(pattern), self.count)
                if (blocks := triangular_blocks(pattern, rows, columns))
            ]
            work = sum(_cost(minor.blocks, pattern)[0] for minor in parts)
            if parts:
                key = (work, int(pattern.sum()), j == TOOL, abs(self._place[i]))
                found.append((key, parts))
        return min(found, key=lambda option: option[0])[1]


def triangular_blocks(
    filled: Pattern, rows: Sequence[int], columns: Sequence[int]
) -> tuple[Block, ...]:
    """Diagonal blocks of the finest block triangular form; empty if the determinant is zero."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

    part = filled[np.ix_(rows, columns)].astype(np.int8)
    column_of = maximum_bipartite_matching(csr_array(part), perm_type="column")
    if (column_of < 0).any():
        return ()
    # row r stands for the pair (r, column_of[r]): pairs that reach each other make a block
    reach = csr_array(part[:, column_of])
    count, label = connected_components(reach, directed=True, connection="strong")
    places = [np.flatnonzero(label == k).tolist() for k in range(count)]
    blocks = [
        Block(
            tuple(rows[r] for r in own), tuple(columns[c] for c in sorted(column_of[own].tolist()))
        )
        for own in places
    ]
    return tuple(sorted(blocks, key=lambda block: block.columns))


def _cost(blocks: tuple[Block, ...], filled: Pattern) -> tuple[int, int]:
    """Work of a determinant: smaller blocks first, then fewer entries."""
    entries = sum(int(filled[np.ix_(block.rows, block.columns)].sum()) for block in blocks)
    return sum(len(block.rows) ** 3 for block in blocks), entries


def nonzero_rows(filled: Pattern) -> tuple[int, ...]:
    """Rows with an entry."""
    return tuple(int(r) for r in np.flatnonzero(filled.any(axis=1)))


def deciding_minors(patterns: Patterns) -> tuple[str, list[Minor] | None]:
    """Rows that count, in words, and the minors that decide about the rank.

    None of them if it is never full, and None in their place if they are too many.
    """
    count, rank, words = patterns.count, patterns.rank, "all six rows"
    if patterns.position_only:
        minors = patterns.row_minors()
        rows = f", rows {_row_words(minors[0].rows)}" if len(minors) == 1 else ""
        return f"the position of the frame{rows}", minors
    fewest = min(len(nonzero_rows(filled)) for filled in patterns.filled.values())
    if rank == 6 or rank == fewest:
        if comb(count, rank) > _MOST_MINORS:
            return words, None
        minors = [m for columns in combinations(range(count), rank) for m in patterns.best(columns)]
        if rank < 6:
            words = f"the rows that are not zero, {_row_words(minors[0].rows)}"
        return words, minors
    return words, patterns.row_minors() if rank == count else []


def _row_words(rows: Sequence[int]) -> str:
    *first, last = (ROWS[r] for r in rows)
    return f"{', '.join(first)} and {last}" if first else last


def smallest_sets(
    minors: Sequence[Sequence[Any]],
    chain: PolynomialChain,
    impossible: Callable[[frozenset[Any]], bool],
) -> list[frozenset[Any]] | None:
    """Smallest sets of factors whose zeros are zeros of every minor; None if they are too many.

    A factor is a polynomial, or the entries of a matrix whose determinant is not written out.
    """
    cases: list[frozenset[Any]] = [frozenset()]
    factors_at = cache(partial(_factors_at, chain=chain))
    for minor in sorted(minors, key=lambda factors: sum(map(_length, factors))):
        grown: set[frozenset[Any]] = set()
        for case in cases:
            parts = [_remaining(p, case, chain.ring, factors_at) for p in minor]
            if None in parts:
                grown.add(case)
            else:
                grown |= {case | {part} for found in parts for part in found or ()}
        grown = {option for option in grown if not impossible(option)}
        cases = [s for s in grown if not any(other < s for other in grown)]
        if len(cases) > _MOST_SETS:
            return None
    return cases


def _length(p: Any) -> int:
    return 10**6 if isinstance(p, tuple) else len(p)


def _remaining(
    p: Any, case: frozenset[Any], ring: TrigRing, factors_at: Callable[..., Any]
) -> tuple[Any, ...] | None:
    """Factors of which one has to vanish for p to vanish in a case; None if p vanishes there."""
    if p in case:
        return None
    if isinstance(p, tuple):
        return (p,)
    present = ring.occurring(p)
    present |= {ring.partner[k] for k in present if k in ring.partner}
    zeros = present & {_generator(factor) for factor in case}
    parts = factors_at(p, zeros) if zeros else (p,)
    return None if parts is None or any(part in case for part in parts) else parts


def _generator(p: Any) -> int | None:
    """Number of the sine, cosine or stroke that p is."""
    if isinstance(p, tuple) or len(p) != 1:
        return None
    (monomial,) = p
    return monomial.index(1) if sum(monomial) == 1 else None


def _factors_at(p: Poly, zeros: frozenset[int], chain: PolynomialChain) -> tuple[Poly, ...] | None:
    """Factors of a polynomial where some sines, cosines and strokes are zero; None if it is."""
    ring = chain.ring
    # where a sine is zero the cosine is 1 or -1, so that its square is 1
    units = {ring.partner[k] for k in zeros if k in ring.partner}
    left = {m: c for m, c in p.items() if not any(m[k] for k in zeros)}
    out = ring.ring(left) if left else ring.zero
    for k in units:
        out = ring.replaced(out, k, ring.one)
    constant, found = factored(out, chain)
    return tuple(q for q in found if _generator(q) not in units) if constant else None
