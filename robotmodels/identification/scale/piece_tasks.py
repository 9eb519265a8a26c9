"""Pieces of logs reduced here or by workers, in order, a bounded number of them at a time."""

from __future__ import annotations

import os
import pickle
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, TypeVar

from ..._arrays import Array
from ...errors import InvalidValueError
from ...logs import Log
from ..equations import Equations
from ..preparation.signals import Piece, piece_alone

if TYPE_CHECKING:
    from .reduction import Reduction

T = TypeVar("T")
Task = tuple[Callable[..., T], tuple[object, ...], float | None]
"""What to call, and the fraction of the whole that is done when it is."""


def piece_reductions(
    systems: Iterable[Equations],
    executor: Executor | None,
    progress: Callable[[float], None] | None,
    window: int | None,
    logs: int | None,
) -> Iterator[Reduction]:
    """Reduction of each piece of each log, in order."""
    if executor is None:
        tasks = _tasks(systems, _reduced_here, logs)
        found = ((function(*given), done) for function, given, done in tasks)
    else:
        found = in_order(_tasks(systems, _reduced_there, logs), executor, window)
    ended = None
    for reduction, ended in found:
        yield reduction
        if progress is not None and ended is not None:
            progress(ended)
    if progress is not None and ended is None:
        progress(1.0)


def in_order(
    tasks: Iterable[Task[T]], executor: Executor, window: int | None = None
) -> Iterator[tuple[T, float | None]]:
    """Results of tasks in their order, of which no more than ``window`` are submitted at a time."""
    most = 2 * (os.cpu_count() or 1) + 2 if window is None else window
    if most < 1:
        raise InvalidValueError(f"window: expected at least one piece at a time, got {window}.")
    waiting: deque[tuple[Future[T], float | None]] = deque()
    try:
        for function, given, done in tasks:
            if len(waiting) == most:
                first, fraction = waiting.popleft()
                yield first.result(), fraction
            waiting.append((executor.submit(function, *given), done))
        while waiting:
            first, fraction = waiting.popleft()
            yield first.result(), fraction
    finally:
        # after an error, or when nobody asks for more: what was not begun is not needed
        for future, _ in waiting:
            future.cancel()


def _tasks(
    systems: Iterable[Equations],
    reduced: Callable[[Equations, list[Piece]], Iterator[Task[T]]],
    logs: int | None,
) -> Iterator[Task[T]]:
    """A task for each piece, of one log at a time."""
    for k, system in enumerate(systems):
        pieces = system.pieces()
        for i, (function, given, _) in enumerate(reduced(system, pieces)):
            done = None if logs is None else (k + (i + 1) / len(pieces)) / logs
            yield function, given, done


def _reduced_here(system: Equations, pieces: list[Piece]) -> Iterator[Task[Reduction]]:
    for piece in pieces:
        yield _reduced, (system, piece), None


def _reduced_there(system: Equations, pieces: list[Piece]) -> Iterator[Task[Reduction]]:
    """Tasks that hold the rows of their piece alone, and the robot as bytes.

    A robot is rebuilt from its parts when it is unpickled: a worker does that once.
    """
    nothing = Log(system.log.dt, system.log.q[:1], system.log.tau[:1], names=system.log.names)
    told = pickle.dumps(replace(system, log=nothing))
    for piece in pieces:
        log, moved = piece_alone(system.log, system.processing, piece)
        arrays = log.q, log.tau, log.v, log.a
        yield _reduced_rows, (told, arrays, moved), None


def _reduced(system: Equations, piece: Piece) -> Reduction:
    from .reduction import block_reduction

    return block_reduction(system.names, system.block(piece))


def _reduced_rows(
    told: bytes, arrays: tuple[Array, Array, Array | None, Array | None], piece: Piece
) -> Reduction:
    system = _told(told)
    return _reduced(replace(system, log=Log(system.log.dt, *arrays, names=system.log.names)), piece)


@lru_cache(maxsize=4)
def _told(data: bytes) -> Equations:
    return pickle.loads(data)
