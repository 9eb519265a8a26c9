"""Long work in tasks of fixed size: the same results from one worker and from many."""

from __future__ import annotations

import logging
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidValueError

_LOG = logging.getLogger("robotmodels")
T = TypeVar("T")
Task = tuple[Callable[[], T], float]
"""A piece of work, and the fraction of all work that is done after it."""
Progress = bool | Callable[[float], None] | None
"""Receiver of the fraction done: none, the log of Python (True), or a function."""


def results(
    tasks: Iterable[Task[T]], executor: Executor | None, window: int | None = None
) -> Iterator[tuple[T, float]]:
    """Results in the order of the tasks, of which at most ``window`` are submitted at a time."""
    if executor is None:
        yield from ((task(), fraction) for task, fraction in tasks)
        return
    most = 2 * (os.cpu_count() or 1) + 2 if window is None else window
    waiting: deque[tuple[Future[T], float]] = deque()
    try:
        for task, fraction in tasks:
            if len(waiting) == most:
                first, done = waiting.popleft()
                yield first.result(), done
            waiting.append((executor.submit(task), fraction))
        while waiting:
            first, done = waiting.popleft()
            yield first.result(), done
    finally:
        # after an error the pending pieces are cancelled
        for future, _ in waiting:
            future.cancel()


@dataclass(frozen=True, slots=True)
class Workers:
    """An executor, and the receiver of the fraction done, between ``low`` and ``high``."""

    executor: Executor | None = None
    progress: Progress = None
    low: float = 0.0
    high: float = 1.0

    def __post_init__(self) -> None:
        executor, progress = self.executor, self.progress
        if executor is not None and not hasattr(executor, "submit"):
            raise InvalidValueError(
                f"executor: expected a concurrent.futures.Executor or None, got {executor!r:.60}."
            )
        if not (progress is None or isinstance(progress, bool) or callable(progress)):
            raise InvalidValueError(
                "progress: expected a flag or a function of the fraction done, got "
                f"{progress!r:.60}."
            )

    def part(self, low: float, high: float) -> Workers:
        """The same workers for a part of the work, from one fraction of it to another."""
        width = self.high - self.low
        return replace(self, low=self.low + low * width, high=self.low + high * width)

    def done(self, fraction: float = 1.0) -> None:
        """Report a fraction of the work."""
        fraction = self.low + fraction * (self.high - self.low)
        if callable(self.progress):
            self.progress(fraction)
        elif self.progress:
            _LOG.info("%.0f %% done", 100.0 * fraction)

    def each(self, calls: Iterable[Callable[[], T]], count: int) -> Iterator[T]:
        """Results of ``count`` calls in their order."""
        tasks = ((call, (k + 1) / count) for k, call in enumerate(calls))
        for result, fraction in results(tasks, self.executor):
            self.done(fraction)
            yield result

    def rows(
        self, function: Callable[..., tuple[NDArray[Any], ...]], size: int, *arrays: NDArray[Any]
    ) -> tuple[NDArray[Any], ...]:
        """Arrays that a function returns for arrays of equal length, ``size`` rows at a time."""
        starts = range(0, max(len(arrays[0]), 1), size)
        calls = (partial(function, *(a[k : k + size] for a in arrays)) for k in starts)
        parts = list(self.each(calls, len(starts)))
        return parts[0] if len(parts) == 1 else tuple(map(np.concatenate, zip(*parts, strict=True)))
