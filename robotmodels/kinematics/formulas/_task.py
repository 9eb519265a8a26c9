"""Which rows and columns of the third matrix decide, and in which frames they are simplest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray

from ...model import RobotModel
from ..factors import jacobian_factors
from ..singular.events import random_postures
from ..singular.task import position_decides
from ._blocks import cost, triangular_blocks
from ._chain import TOOL

_ROWS = ("vx", "vy", "vz", "wx", "wy", "wz")
_ZERO = 1e-11
"""Entries that stay below this in random postures are zero."""
MOST_MINORS = 60

Pattern = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Minor:
    """A square part of the third matrix, rows by number and columns by place among the joints."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]
    projection: int
    intermediate: int


@dataclass(frozen=True, slots=True)
class Task:
    """Minors that decide about the rank of a task."""

    words: str
    minors: tuple[Minor, ...]
    square: bool
    full_rank: bool
    position_only: bool = False
    too_many: bool = False


class Patterns:
    """Where the third matrix is not zero, for every pair of frames on the way to a frame."""

    def __init__(
        self, model: RobotModel, frame: str | int | None, path: list[int], places: list[int]
    ) -> None:
        q = random_postures(model, 4, seed=3)
        at_frame = model.twin.names.tool if frame is None else frame
        frames = [0, *path]
        self.middle = (len(path) / 2, (len(path) + 1) / 2)
        self.order = {j: k for k, j in enumerate(frames)} | {TOOL: len(frames)}
        self.filled: dict[tuple[int, int], Pattern] = {}
        for i in frames:
            for j in [*frames, TOOL]:
                name = at_frame if j == TOOL else j
                J = jacobian_factors(model, q, i, name, frame).reduced[..., places]
                self.filled[i, j] = np.asarray(np.any(np.abs(J) > _ZERO, axis=0))
        at_tool = jacobian_factors(model, q, 0, at_frame, frame).reduced[..., places]
        self.rank = _rank(at_tool)
        self.position_only = position_decides(model, frame)

    def best(self, rows: Sequence[int] | None, columns: Sequence[int]) -> Minor:
        """The frames in which a square part has the simplest determinant.

        rows None: those that are not zero, where there are as many as columns.
        """
        found = []
        for (i, j), filled in self.filled.items():
            own = nonzero_rows(filled) if rows is None else tuple(rows)
            if len(own) != len(columns):
                continue
            part = filled[np.ix_(own, columns)]
            away = abs(self.order[i] - self.middle[0]) + abs(self.order[j] - self.middle[1])
            # the tool's place is a constant more
            key = (*cost(triangular_blocks(part), part), j == TOOL, away)
            found.append((key, Minor(own, tuple(columns), i, j)))
        return min(found, key=lambda option: option[0])[1]

    def fewest_rows(self) -> int:
        """Smallest number of rows that are not zero."""
        return min(len(nonzero_rows(filled)) for filled in self.filled.values())


def nonzero_rows(filled: Pattern) -> tuple[int, ...]:
    """Rows with an entry."""
    return tuple(int(r) for r in np.flatnonzero(filled.any(axis=1)))


def task_of(patterns: Patterns, count: int) -> Task:
    """Choose the minors that decide about the rank of a frame's motion."""
    columns = range(count)
    rank = patterns.rank
    if patterns.position_only:
        frames = {ij: f[:3] for ij, f in patterns.filled.items() if ij[1] == TOOL}
        task = _row_minors(patterns, frames, count)
        words = f"the position of the frame, rows {_row_words(task[0].rows)}"
        if len(task) > 1:
            words = "the position of the frame"
        return Task(words, task, len(task) == 1, True, position_only=True)
    if rank == 6 or rank == patterns.fewest_rows():
        rows = range(6) if rank == 6 else None
        subsets = list(combinations(columns, rank)) if comb(count, rank) <= MOST_MINORS else []
        minors = tuple(patterns.best(rows, subset) for subset in subsets)
        words = "all six rows"
        if rank < 6 and minors:
            words = f"the rows that are not zero, {_row_words(minors[0].rows)}"
        return Task(words, minors, count == rank, True, too_many=not subsets)
    if rank < count:
        return Task("all six rows", (), False, False)
    task = _row_minors(patterns, patterns.filled, count)
    return Task("all six rows", task, len(task) == 1, True)


def _row_minors(
    patterns: Patterns, filled: dict[tuple[int, int], Pattern], count: int
) -> tuple[Minor, ...]:
    """Square parts of a matrix with more rows than columns, in the frames that suit all."""
    best: tuple[tuple[float, ...], tuple[Minor, ...]] | None = None
    for (i, j), pattern in filled.items():
        minors, work = [], 0
        for rows in combinations(nonzero_rows(pattern), count):
            part = pattern[list(rows)]
            blocks = triangular_blocks(part)
            if blocks is not None:
                work += cost(blocks, part)[0]
                minors.append(Minor(rows, tuple(range(count)), i, j))
        away = abs(patterns.order[i] - patterns.middle[0])
        key = (work, int(pattern.sum()), j == TOOL, away)
        if minors and (best is None or key < best[0]):
            best = key, tuple(minors)
    assert best is not None  # the rank is full somewhere
    return best[1]


def _row_words(rows: Sequence[int]) -> str:
    words = [_ROWS[r] for r in rows]
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def _rank(J: NDArray[np.float64]) -> int:
    return int(np.linalg.matrix_rank(J, tol=1e-9).max()) if J.size else 0
