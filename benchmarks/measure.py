"""Times of contestants that take turns, so that a drifting machine is fair to all of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

LEAST_ROUNDS = 3


class Spent(NamedTuple):
    """Seconds of a run, of the processor and on the clock, told by the process that did it."""

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


class Spread(NamedTuple):
    """Median, least and most over the rounds."""

    median: float
    least: float
    most: float


class Timing(NamedTuple):
    """Seconds for each of the ``count`` of a run, of the processor and on the clock."""

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
    spent: dict[str, list[Spent]] = {c.name: [] for c in field}
    if len(spent) < len(field):
        raise ValueError(f"Two contestants have one name: {[c.name for c in field]}.")
    # a run before the rounds compiles and pages in
    notes = {c.name: _timed(c).note if c.rounds != 1 else "" for c in field}
    start = time.perf_counter()
    for r in range(rounds):
        if r >= LEAST_ROUNDS and time.perf_counter() - start > budget:
            break
        for c in field:
            if c.rounds is None or r < c.rounds:
                spent[c.name].append(_timed(c))
    found = {}
    for name, runs in spent.items():
        processor, clock = (
            Spread(float(np.median(x)), min(x), max(x))
            for x in ([run.processor for run in runs], [run.clock for run in runs])
        )
        note = next((run.note for run in runs if run.note), notes[name])
        found[name] = Timing(processor, clock, len(runs), note)
    return found


def _timed(c: Contestant) -> Spent:
    """One run, for each of its count."""
    clock, processor = time.perf_counter(), time.process_time()
    answer = c.run()
    took = Spent(time.process_time() - processor, time.perf_counter() - clock)
    took = answer if isinstance(answer, Spent) else took._replace(note=c.said(answer))
    return Spent(took.processor / c.count, took.clock / c.count, took.note)


def loop(call: Callable[..., object], *arrays: Any) -> Callable[[], None]:
    """A call for each row, from Python."""

    def run() -> None:
        for row in zip(*arrays, strict=True):
            call(*row)

    return run
