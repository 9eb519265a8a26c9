"""Times of contestants that take turns, so that a drifting machine is fair to all of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

LEAST_ROUNDS = 3


@dataclass(frozen=True, slots=True)
class Spent:
    """What a run took that was timed by the process that did it, seconds."""

    processor: float
    clock: float
    note: str = ""


@dataclass(frozen=True, slots=True)
class Contestant:
    """One way to do the work of a row.

    ``run`` does it ``count`` times; it returns `Spent` where another process timed it. ``said``
    makes a note of an answer. ``rounds`` limits the rounds of slow ones; with 1 there is no run
    before the first round either. ``whole`` is False for a part of the work.
    """

    name: str
    run: Callable[[], object]
    count: int = 1
    said: Callable[[Any], str] = lambda _: ""
    rounds: int | None = None
    whole: bool = True


@dataclass(frozen=True, slots=True)
class Spread:
    """Median, least and most over the rounds."""

    median: float
    least: float
    most: float

    def times(self, factor: float) -> Spread:
        """In another unit."""
        return Spread(self.median * factor, self.least * factor, self.most * factor)


@dataclass(frozen=True, slots=True)
class Timing:
    """Seconds for each of the ``count`` of a run, of the processor and on the clock."""

    name: str
    processor: Spread
    clock: Spread
    rounds: int
    note: str


def in_turns(
    contestants: Iterable[Contestant], rounds: int, budget: float = float("inf")
) -> dict[str, Timing]:
    """Time contestants in turns, by name.

    The rounds end early, but not before `LEAST_ROUNDS`, when ``budget`` seconds are over.
    """
    field = list(contestants)
    spent: dict[str, list[tuple[float, float]]] = {c.name: [] for c in field}
    if len(spent) < len(field):
        raise ValueError(f"Two contestants have one name: {[c.name for c in field]}.")
    notes = dict.fromkeys(spent, "")
    for c in field:
        if c.rounds != 1:
            notes[c.name] = _timed(c)[1]  # compile, page in
    start = time.perf_counter()
    for r in range(rounds):
        if r >= LEAST_ROUNDS and time.perf_counter() - start > budget:
            break
        for c in field:
            if c.rounds is not None and r >= c.rounds:
                continue
            took, note = _timed(c)
            spent[c.name].append(took)
            notes[c.name] = notes[c.name] or note
    return {
        c.name: Timing(
            c.name, _spread([p for p, _ in spent[c.name]]), _spread([t for _, t in spent[c.name]]),
            len(spent[c.name]), notes[c.name],
        )
        for c in field
    }  # fmt: skip


def _timed(c: Contestant) -> tuple[tuple[float, float], str]:
    clock, processor = time.perf_counter(), time.process_time()
    answer = c.run()
    took = time.process_time() - processor, time.perf_counter() - clock
    if isinstance(answer, Spent):
        return (answer.processor / c.count, answer.clock / c.count), answer.note
    return (took[0] / c.count, took[1] / c.count), c.said(answer)


def _spread(values: list[float]) -> Spread:
    return Spread(float(np.median(values)), min(values), max(values))


def loop(call: Callable[..., object], *arrays: Any) -> Callable[[], None]:
    """A call for each row, from Python."""

    def run() -> None:
        for row in zip(*arrays, strict=True):
            call(*row)

    return run
