"""A work of the benchmark: who does it, the goal that was set, and its line in the tables."""

from __future__ import annotations

import importlib
import json
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from benchmarks.machine import head
from benchmarks.measure import Contestant, Timing, in_turns
from benchmarks.peers.process import Foreign

Row = dict[str, Any]
OURS = "robotmodels"
RESULTS = Path(__file__).parent / "results"
UNITS = {"us": 1e6, "ms": 1e3, "s": 1.0}
PACKAGES = {
    "roboticstoolbox-python": "roboticstoolbox", "eaik": "eaik", "ssik": "ssik",
    "ik-geo": "ik_geo", "ruckig": "ruckig", "toppra": "toppra", "pycapacity": "pycapacity",
    "mujoco": "mujoco", "drake": "pydrake", "exudyn": "exudyn",
    "machinevision-toolbox-python": "machinevisiontoolbox", "opencv-python-headless": "cv2",
}  # fmt: skip
"""Peers of this process: distribution and module."""
CLOSE = 1e-10
"""Largest difference of two tools' arrays, relative to the largest number in them."""


def module(package: str) -> ModuleType | None:
    """A peer's module, None where it is not installed."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return importlib.import_module(PACKAGES[package])
    except ImportError:
        return None


@dataclass(frozen=True, slots=True)
class Settings:
    """How much is measured, and the peers of other interpreters."""

    rounds: int = 15
    budget: float = 8.0
    quick: bool = False
    figaroh: Foreign | None = None
    pybotics: Foreign | None = None

    def number(self, full: int, quick: int) -> int:
        """Number of samples."""
        return quick if self.quick else full


class Goal(NamedTuple):
    """A goal as a sentence, and whether the timings (ours first) and notes meet it."""

    text: str
    met: Callable[[list[Timing]], bool]


def at_most(limit: float, unit: str) -> Goal:
    """The median of ours is at most this long."""
    return Goal(f"<= {limit:g} {unit}", lambda t: t[0].processor.median * UNITS[unit] <= limit)


def no_longer(times: float, text: str) -> Goal:
    """The median of ours is at most so many times that of the second way."""
    return Goal(text, lambda t: t[0].processor.median <= times * t[1].processor.median)


@dataclass(frozen=True, slots=True)
class Work:
    """One line of the tables; the first contestant is ours."""

    title: str
    unit: str
    contestants: Sequence[Contestant]
    goals: Sequence[Goal] = field(default_factory=tuple)

    def measured(self, settings: Settings) -> Row:
        """Time the contestants; everything as lists and numbers, times in the unit of the work."""
        found = in_turns(self.contestants, settings.rounds, settings.budget)
        timings = [found[c.name] for c in self.contestants]
        ways = []
        for c, t in zip(self.contestants, timings, strict=True):
            factor = UNITS[self.unit]
            times = {word: factor * x for word, x in t.processor._asdict().items()}
            told = {"clock": factor * t.clock.median, "rounds": t.rounds, "note": t.note}
            ways.append({"name": c.name} | times | told | {"whole": c.whole})
        others = [w["median"] for w in ways[1:] if w["whole"]]
        ratio = min(others) / ways[0]["median"] if others else None
        goals = [{"text": g.text, "met": bool(g.met(timings))} for g in self.goals]
        return {"work": self.title, "unit": self.unit, "ways": ways, "ratio": ratio, "goals": goals}


class DisagreementError(RuntimeError):
    """Two tools gave different answers: their times must not be compared."""


def same(title: str, ours: Any, theirs: Any, tolerance: float = CLOSE) -> Callable[[Any], str]:
    """A note of the largest difference of two arrays; `DisagreementError` if it is too large."""
    first, second = np.asarray(ours), np.asarray(theirs)
    if first.shape != second.shape:
        raise DisagreementError(f"{title}: shape {second.shape}, ours {first.shape}.")
    off = float(np.abs(first - second).max() / max(1.0, np.abs(first).max()))
    if not off <= tolerance:
        raise DisagreementError(f"{title} differs from ours by {off:.1e}, more than {tolerance:g}.")
    return lambda _: f"equal to {off:.0e}"


# --- tables ---------------------------------------------------------------------------------------

CONTEXT = """\
Medians of the processor's time over rounds in which the contestants take turns, one thread. Ratio:
the fastest of the others to ours, so above 1 ours is faster; contestants that do a part of the work
only are in brackets and enter no ratio."""


def figure(x: float) -> str:
    """Two or three digits, no exponents."""
    if x >= 100.0:
        return f"{x:.0f}"
    digits = 1 if x >= 10.0 else 2 if x >= 0.1 else 3 if x >= 0.01 else 4
    return f"{x:.{digits}f}"


def cells(row: Row) -> list[str]:
    """Work, ours, the others, ratio, goals."""
    ours, *others = row["ways"]
    told = [
        f"{w['name']} {figure(w['median'])}" if w["whole"] else f"({w['name']} "
        f"{figure(w['median'])})" for w in others
    ]  # fmt: skip
    goals = [f"{g['text']}, {'met' if g['met'] else 'not met'}" for g in row["goals"]]
    ratio = "" if row["ratio"] is None else figure(row["ratio"])
    mine = f"{figure(ours['median'])} {row['unit']}"
    return [row["work"], mine, "; ".join(told), ratio, "; ".join(goals)]


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a Markdown table."""
    lines = [f"| {' | '.join(header)} |", "|---" * len(header) + "|"]
    return [*lines, *(f"| {' | '.join(row)} |" for row in rows)]


def main_table(rows: Iterable[Row]) -> list[str]:
    """A line for each work."""
    return table(("work", "robotmodels", "others", "ratio", "goal"), map(cells, rows))


def markdown(facts: Mapping[str, str], rows: Sequence[Row], absent: Sequence[str]) -> str:
    """Both tables: works, and every way with its spread."""
    lines = [*head("Measured side by side", facts), CONTEXT, ""]
    if absent:
        lines += [f"Left out: {'; '.join(absent)}.", ""]
    lines += [*main_table(rows), "", "## Every way", ""]
    columns = ("work", "way", "unit", "median", "least", "most", "clock", "rounds", "note")
    each = (
        [r["work"], w["name"], r["unit"], *(figure(w[k]) for k in columns[3:7]),
         f"{w['rounds']}", w["note"]]
        for r in rows for w in r["ways"]
    )  # fmt: skip
    return "\n".join([*lines, *table(columns, each)]) + "\n"


def keep(out: Path, name: str, text: str, numbers: Any) -> None:
    """Write ``name.md`` and ``name.json``."""
    out.mkdir(parents=True, exist_ok=True)
    (out / f"{name}.md").write_text(text, encoding="utf-8")
    (out / f"{name}.json").write_text(json.dumps(numbers, indent=2) + "\n", encoding="utf-8")


def works_of(module_name: str) -> dict[str, Callable[[Settings], Iterator[Work]]]:
    """The works of ``bench_<name>.py`` by the word that selects them."""
    return importlib.import_module(f"benchmarks.bench_{module_name}").WORKS
