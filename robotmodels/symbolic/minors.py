"""Minors of the third matrix: those that decide about rank, and the factors that make all vanish.

The determinant of a sparse square part is the product of those of the diagonal blocks of its
block triangular form (A. L. Dulmage and N. S. Mendelsohn, "Coverings of bipartite graphs", 1958).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
from .polynomials import Poly, PolynomialChain

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


class Task(NamedTuple):
    """Minors that decide about the rank of a task."""

    words: str
    minors: tuple[Minor, ...]
    square: bool = False
    position_only: bool = False
    too_many: bool = False


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
        self._middle = (len(chain.path) / 2, (len(chain.path) + 1) / 2)
        self._order = {j: k for k, j in enumerate(frames)} | {TOOL: len(frames)}
        J = jacobian(model, random_postures(model, 4, seed=3), frame)[..., places]
        self.rank = int(np.linalg.matrix_rank(J, tol=1e-9).max())
        self.position_only = position_decides(model, frame)

    def _away(self, i: int, j: int) -> float:
        a, b = self._middle
        return abs(self._order[i] - a) + abs(self._order[j] - b)

    def best(self, rows: Sequence[int] | None, columns: Sequence[int]) -> Minor:
        """The frames in which a square part has the simplest determinant.

        rows None: those that are not zero, where there are as many as columns.
        """
        found = []
        for (i, j), filled in self.filled.items():
            own = nonzero_rows(filled) if rows is None else tuple(rows)
            if len(own) == len(columns):
                part = filled[np.ix_(own, columns)]
                # the tool's place is a constant more
                key = (*_cost(triangular_blocks(part), part), j == TOOL, self._away(i, j))
                found.append((key, Minor(own, tuple(columns), i, j)))
        return min(found, key=lambda option: option[0])[1]

    def row_minors(self, position: bool = False) -> tuple[Minor, ...]:
        """Square parts of a matrix with more rows than columns, in the frames that suit all."""
        found = []
        for (i, j), filled in self.filled.items():
            if position and j != TOOL:
                continue
            pattern = filled[:3] if position else filled
            minors, work = [], 0
            for rows in combinations(nonzero_rows(pattern), self.count):
                part = pattern[list(rows)]
                blocks = triangular_blocks(part)
                if blocks is not None:
                    work += _cost(blocks, part)[0]
                    minors.append(Minor(rows, tuple(range(self.count)), i, j))
            away = abs(self._order[i] - self._middle[0])
            if minors:
                found.append(((work, int(pattern.sum()), j == TOOL, away), tuple(minors)))
        return min(found, key=lambda option: option[0])[1]


def triangular_blocks(filled: Pattern) -> tuple[Block, ...] | None:
    """Diagonal blocks of the finest block triangular form, None if the determinant is zero."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

    column_of = maximum_bipartite_matching(csr_array(filled.astype(np.int8)), perm_type="column")
    if (column_of < 0).any():
        return None
    # row r stands for the pair (r, column_of[r]): pairs that reach each other make a block
    reach = csr_array(filled[:, column_of].astype(np.int8))
    count, label = connected_components(reach, directed=True, connection="strong")
    rows = [np.flatnonzero(label == k) for k in range(count)]
    blocks = [Block(tuple(r.tolist()), tuple(sorted(column_of[r].tolist()))) for r in rows]
    return tuple(sorted(blocks, key=lambda block: block.columns))


def _cost(blocks: tuple[Block, ...] | None, filled: Pattern) -> tuple[int, int]:
    """Work of a determinant: smaller blocks first, then fewer entries."""
    if blocks is None:
        return 10**6, 0
    entries = sum(int(filled[np.ix_(block.rows, block.columns)].sum()) for block in blocks)
    return sum(len(block.rows) ** 3 for block in blocks), entries


def nonzero_rows(filled: Pattern) -> tuple[int, ...]:
    """Rows with an entry."""
    return tuple(int(r) for r in np.flatnonzero(filled.any(axis=1)))


def task_of(patterns: Patterns) -> Task:
    """Choose the minors that decide about the rank of a motion; none if it is never full."""
    count, rank = patterns.count, patterns.rank
    if patterns.position_only:
        task = patterns.row_minors(position=True)
        rows = f", rows {_row_words(task[0].rows)}" if len(task) == 1 else ""
        return Task(f"the position of the frame{rows}", task, len(task) == 1, True)
    fewest = min(len(nonzero_rows(filled)) for filled in patterns.filled.values())
    if rank == 6 or rank == fewest:
        if comb(count, rank) > _MOST_MINORS:
            return Task("all six rows", (), too_many=True)
        rows = range(6) if rank == 6 else None
        minors = tuple(patterns.best(rows, columns) for columns in combinations(range(count), rank))
        words = "all six rows"
        if rank < 6:
            words = f"the rows that are not zero, {_row_words(minors[0].rows)}"
        return Task(words, minors, count == rank)
    if rank < count:
        return Task("all six rows", ())
    task = patterns.row_minors()
    return Task("all six rows", task, len(task) == 1)


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
    reduced = _Reduced(chain)
    for minor in sorted(minors, key=lambda factors: sum(map(_length, factors))):
        grown: set[frozenset[Any]] = set()
        for case in cases:
            parts = [reduced(p, case) for p in minor]
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


class _Reduced:
    """Factors of a polynomial where some sines, cosines and strokes are zero."""

    def __init__(self, chain: PolynomialChain) -> None:
        self.chain = chain
        self._known: dict[Any, tuple[Poly, ...] | None] = {}
        self._partner = {a: b for pair in chain.ring.pairs for a, b in (pair, pair[::-1])}

    def __call__(self, p: Any, case: frozenset[Any]) -> tuple[Any, ...] | None:
        """Factors of which one has to vanish for p to vanish; None if p vanishes already."""
        if p in case:
            return None
        if isinstance(p, tuple):
            return (p,)
        zeros = frozenset(k for factor in case if (k := self._generator(factor)) is not None)
        present = self.chain.ring.occurring(p)
        zeros &= present | {self._partner[k] for k in present if k in self._partner}
        if not zeros:
            return (p,)
        if (p, zeros) not in self._known:
            self._known[p, zeros] = self._factors(p, zeros)
        parts = self._known[p, zeros]
        return None if parts is None or any(part in case for part in parts) else parts

    def _generator(self, p: Any) -> int | None:
        """Number of the sine, cosine or stroke that p is."""
        if isinstance(p, tuple) or len(p) != 1:
            return None
        (monomial,) = p
        return monomial.index(1) if sum(monomial) == 1 else None

    def _factors(self, p: Poly, zeros: frozenset[int]) -> tuple[Poly, ...] | None:
        ring = self.chain.ring
        # where a sine is zero the cosine is 1 or -1, so that its square is 1
        units = {self._partner[k] for k in zeros if k in self._partner}
        left = {m: c for m, c in p.items() if not any(m[k] for k in zeros)}
        out = ring.ring(left) if left else ring.zero
        for k in units:
            out = ring.replaced(out, k, ring.one)
        if not out:
            return None
        constant, found = factored(out, self.chain)
        return tuple(q for q in found if self._generator(q) not in units) if constant else None
