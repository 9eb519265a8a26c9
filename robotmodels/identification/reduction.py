"""Reduction of equations to triangular factors, in pieces, serially or by an executor."""

from __future__ import annotations

import os
import pickle
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sized
from concurrent.futures import Executor, Future
from functools import lru_cache
from typing import Any

import numpy as np

from ..errors import InvalidValueError
from ..estimation.factor import TriangularFactors, factors_of, merged, merged_all
from ..logs import Log
from .equations import Equations
from .signals import Piece, slice_with_margin

_Task = tuple[Callable[..., TriangularFactors], tuple[Any, ...], float | None]
"""Function, its arguments, and the fraction of the work that is done after it."""


def reduce_equations(
    system: Equations | Iterable[Equations],
    executor: Executor | None = None,
    progress: Callable[[float], None] | None = None,
    window: int | None = None,
) -> TriangularFactors:
    """Reduce equations to one triangular factor for each group (joint).

    The pieces of a log are fixed and their factors are merged in a fixed tree, so that the result
    does not depend on the number of workers.

    Parameters
    ----------
    system : Equations or iterable of Equations
        One log, or several of the same robot and parameters; an iterator may open one file at a
        time.
    executor : concurrent.futures.Executor, optional
        Threads, processes, or a cluster with this interface (such as ``client.get_executor()`` of
        Dask) that computes the pieces; default this thread. A task contains the samples of its
        piece and the margin of the filters, not the whole log.
    progress : callable, optional
        Called with the fraction done; for an iterator without length only at the end.
    window : int, optional
        Largest number of pieces in work at a time, default twice the processors and 2.

    Returns
    -------
    TriangularFactors
        Its size depends on the number of parameters alone.

    Raises
    ------
    InvalidValueError
        No equations; logs of different parameters or groups; a window below 1.

    References
    ----------
    Seed book section 1.6.2.1; J. Demmel, L. Grigori, M. Hoemmen and J. Langou,
    "Communication-optimal parallel and sequential QR and LU factorizations", SIAM J. Scientific
    Computing 34(1), 2012.

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> from robotmodels.identification import choose_processing, equations
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> arm, log = example_log()
    >>> base = base_parameters(arm, drive=("Fv",))
    >>> factors = reduce_equations(equations(base, log, choose_processing(log)))
    >>> len(factors.names), factors.rows > 100
    (8, True)
    """
    systems = (system,) if isinstance(system, Equations) else system
    tasks = _tasks(systems, executor is not None, len(systems) if isinstance(systems, Sized) else 0)
    done = _in_order(tasks, executor, window)
    return merged_all(_reported(done, progress))


def _tasks(systems: Iterable[Equations], sent: bool, logs: int) -> Iterator[_Task]:
    """One task per piece, without a fraction if the number of logs is unknown (0)."""
    for k, system in enumerate(systems):
        pieces = system.pieces()
        # a robot is rebuilt when it is unpickled: each worker does that once
        empty = Log(system.log.dt, system.log.q[:1], system.log.tau[:1], names=system.log.names)
        robot = pickle.dumps(system.with_log(empty)) if sent else b""
        for i, piece in enumerate(pieces):
            fraction = (k + (i + 1) / len(pieces)) / logs if logs else None
            if sent:
                part, moved = slice_with_margin(system.log, system.processing, piece)
                yield _of_worker, (robot, part, moved), fraction
            else:
                yield _of_piece, (system, piece), fraction


def _in_order(
    tasks: Iterable[_Task], executor: Executor | None, window: int | None
) -> Iterator[tuple[TriangularFactors, float | None]]:
    """Results in the order of the tasks, of which at most ``window`` are submitted at a time."""
    most = 2 * (os.cpu_count() or 1) + 2 if window is None else window
    if most < 1:
        raise InvalidValueError(f"window: expected at least one piece at a time, got {window}.")
    if executor is None:
        yield from ((function(*given), fraction) for function, given, fraction in tasks)
        return
    waiting: deque[tuple[Future[TriangularFactors], float | None]] = deque()
    try:
        for function, given, fraction in tasks:
            if len(waiting) == most:
                first, done = waiting.popleft()
                yield first.result(), done
            waiting.append((executor.submit(function, *given), fraction))
        while waiting:
            first, done = waiting.popleft()
            yield first.result(), done
    finally:
        # after an error the pending pieces are cancelled
        for future, _ in waiting:
            future.cancel()


def _reported(
    done: Iterable[tuple[TriangularFactors, float | None]],
    progress: Callable[[float], None] | None,
) -> Iterator[TriangularFactors]:
    last = 0.0
    for factors, fraction in done:
        yield factors
        if progress is not None and fraction is not None:
            progress(last := fraction)
    if progress is not None and last < 1.0:
        progress(1.0)


def _of_piece(system: Equations, piece: Piece) -> TriangularFactors:
    block = system.block(piece)
    return factors_of(system.names, block.W, block.y, block.use)


def _of_worker(robot: bytes, log: Log, piece: Piece) -> TriangularFactors:
    return _of_piece(_rebuilt(robot).with_log(log), piece)


def segments(system: Equations, count: int) -> tuple[TriangularFactors, ...]:
    """Factors of contiguous segments of a log, as folds: neighbouring equations are correlated."""
    total = sum(len(block) for block in system.blocks())
    if not 2 <= count <= total:
        raise InvalidValueError(f"count: expected from 2 to {total} parts, got {count!r:.40}.")
    ends = np.linspace(0, total, count + 1).astype(int)
    parts: list[TriangularFactors | None] = [None] * count
    first = 0
    for block in system.blocks():
        for k, part in enumerate(parts):
            rows = slice(*np.clip(ends[k : k + 2] - first, 0, len(block)).tolist())
            if rows.start < rows.stop:
                new = factors_of(system.names, block.W[rows], block.y[rows], block.use[rows])
                parts[k] = new if part is None else merged(part, new)
        first += len(block)
    return tuple(part for part in parts if part is not None)


@lru_cache(maxsize=4)
def _rebuilt(robot: bytes) -> Equations:
    return pickle.loads(robot)
