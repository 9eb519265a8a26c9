"""Reduction of equations to triangular factors, in pieces, serially or by an executor."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sized
from concurrent.futures import Executor
from functools import partial

import numpy as np

from .._arrays.tasks import Progress, Task, Workers, results
from ..errors import InvalidValueError
from ..estimation.factor import TriangularFactors, factors_of, merged, merged_all
from .equations import Equations
from .signals import Piece, slice_with_margin


def reduce_equations(
    system: Equations | Iterable[Equations],
    executor: Executor | None = None,
    progress: Progress = None,
    window: int | None = None,
) -> TriangularFactors:
    """Reduce equations to one triangular factor for each group (joint).

    Pieces are fixed and merged in a fixed tree: the result does not depend on the workers.

    Parameters
    ----------
    system : Equations or iterable of Equations
        One log, or several of the same robot and parameters; an iterator may open one file at a
        time.
    executor, progress
        As for `fit`; also a cluster (``client.get_executor()`` of Dask). A task contains the
        samples of its piece and the margin of the filters, not the whole log.
    window : int, optional
        Largest number of pieces in work at a time, default twice the processors and 2.

    Returns
    -------
    TriangularFactors
        Its size depends on the number of parameters alone.

    References
    ----------
    J. Demmel, L. Grigori, M. Hoemmen and J. Langou, SIAM J. Scientific Computing 34(1), 2012.

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> from robotmodels.identification import choose_processing, equations
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> arm, log = example_log()
    >>> base = base_parameters(arm, drive=("Fv",))
    >>> len(reduce_equations(equations(base, log, choose_processing(log))).names)
    8
    """
    systems = (system,) if isinstance(system, Equations) else system
    if window is not None and window < 1:
        raise InvalidValueError(f"window: expected at least one piece at a time, got {window}.")

    work = Workers(executor, progress)

    def leaves() -> Iterator[TriangularFactors]:
        fraction = 0.0
        for factors, fraction in results(_tasks(systems, executor is not None), executor, window):
            yield factors
            if fraction > 0.0:
                work.done(fraction)
        if fraction < 1.0:
            work.done()

    return merged_all(leaves())


def parts(system: Equations, sent: bool) -> Iterator[tuple[Equations, Piece]]:
    """Pieces and their equations; what is sent to a worker has the samples of its piece alone."""
    for piece in system.pieces():
        if sent:
            log, inner = slice_with_margin(system.log, system.processing, piece)
            yield system.with_log(log), inner
        else:
            yield system, piece


def _tasks(systems: Iterable[Equations], sent: bool) -> Iterator[Task[TriangularFactors]]:
    """One task per piece."""
    logs = len(systems) if isinstance(systems, Sized) else 0
    for k, system in enumerate(systems):
        count = len(system.pieces())
        for i, (part, piece) in enumerate(parts(system, sent)):
            fraction = (k + (i + 1) / count) / logs if logs else 0.0
            yield partial(_piece_factors, part, piece), fraction


def _piece_factors(system: Equations, piece: Piece) -> TriangularFactors:
    block = system.block(piece)
    return factors_of(system.names, block.W, block.y, block.use)


def segments(system: Equations, count: int) -> tuple[TriangularFactors, ...]:
    """Factors of contiguous segments of a log, as folds: neighbouring equations are correlated."""
    total = sum(len(block) for block in system.blocks())
    if not 2 <= count <= total:
        raise InvalidValueError(f"count: expected from 2 to {total} parts, got {count!r:.40}.")
    ends, first = np.linspace(0, total, count + 1).astype(int)[1:], 0
    parts: dict[int, TriangularFactors] = {}
    for block in system.blocks():
        place = np.searchsorted(ends, first + np.arange(len(block)), side="right")
        for k in np.unique(place).tolist():
            rows = place == k
            new = factors_of(system.names, block.W[rows], block.y[rows], block.use[rows])
            parts[k] = merged(parts[k], new) if k in parts else new
        first += len(block)
    return tuple(parts.values())
