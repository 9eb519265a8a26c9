"""What a work is: who does it, what is asked of ours, and what came out."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from types import ModuleType
from typing import Any

from benchmarks.foreign import Foreign
from benchmarks.measure import Contestant, Timing, in_turns


class Tool(Enum):
    """Whose way it is; columns of the table, in this order."""

    OURS = "robotmodels"
    PINOCCHIO = "Pinocchio"
    RTB = "RTB"
    FIGAROH = "FIGAROH"
    EAIK = "EAIK"
    SSIK = "ssik"
    IK_GEO = "ik-geo"
    PYBOTICS = "pybotics"
    RUCKIG = "ruckig"


PACKAGES = {
    Tool.RTB: ("roboticstoolbox-python", "roboticstoolbox"),
    Tool.EAIK: ("eaik", "eaik"),
    Tool.SSIK: ("ssik", "ssik"),
    Tool.IK_GEO: ("ik-geo", "ik_geo"),
    Tool.RUCKIG: ("ruckig", "ruckig"),
}
"""Peers of this process: distribution and module."""

UNITS = {"us": 1e6, "ms": 1e3, "s": 1.0}
ONE, BATCH = "one by one", "batch"
"""The modes that most works have; a work may name others."""


def module(tool: Tool) -> ModuleType | None:
    """A peer's module, None where it is not installed."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return importlib.import_module(PACKAGES[tool][1])
    except ImportError:
        return None


@dataclass(frozen=True, slots=True)
class Settings:
    """How much is measured, and the peers of other interpreters."""

    rounds: int = 15
    budget: float = 8.0
    quick: bool = False
    slow: bool = False
    figaroh: Foreign | None = None
    pybotics: Foreign | None = None

    def number(self, full: int, quick: int) -> int:
        """Of samples, by how much is measured."""
        return quick if self.quick else full


@dataclass(frozen=True, slots=True)
class Entry:
    """One way of one tool.

    Only entries of one ``mode`` are set in ratio: like with like. ``how`` tells a way from the
    tool's others of that mode. What does not do the ``whole`` work is shown, but enters no ratio.
    """

    tool: Tool
    how: str
    run: Callable[[], object]
    count: int = 1
    said: Callable[[Any], str] = lambda _: ""
    rounds: int | None = None
    whole: bool = True
    mode: str = ""

    @property
    def name(self) -> str:
        """Tool, mode and way."""
        return named(self.tool, self.mode, self.how)


def named(tool: Tool, mode: str = "", how: str = "") -> str:
    """The name of an entry."""
    return ", ".join(word for word in (tool.value, mode, how) if word)


@dataclass(frozen=True, slots=True)
class Goal:
    """What is asked of ours: a sentence, and whether it is met by the timings by name."""

    text: str
    met: Callable[[dict[str, Timing]], bool]


def at_most(limit: float, unit: str, mode: str = "", how: str = "", said: str = "") -> Goal:
    """The median of ours is no longer than this."""
    name = named(Tool.OURS, mode, how)
    text = f"<= {limit:g} {unit}" + (f" {said}" if said else "")
    return Goal(text, lambda t: t[name].processor.median * UNITS[unit] <= limit)


@dataclass(frozen=True, slots=True)
class Work:
    """One line: ``row`` is the word by which it is asked for; ours has each mode once."""

    row: str
    title: str
    unit: str
    entries: list[Entry]
    goals: list[Goal] = field(default_factory=list)

    def __post_init__(self) -> None:
        ours = [e.mode for e in self.entries if e.tool is Tool.OURS]
        if len(set(ours)) < len(ours):
            raise ValueError(f"{self.title}: two entries of ours have one mode: {ours}.")


@dataclass(frozen=True, slots=True)
class Measured:
    """What came out of a work."""

    work: Work
    timings: dict[str, Timing]

    def as_json(self) -> dict[str, Any]:
        """Everything as lists and numbers; times in the unit of the work."""
        factor = UNITS[self.work.unit]
        ours = {
            e.mode: self.timings[e.name].processor.median
            for e in self.work.entries
            if e.tool is Tool.OURS
        }
        entries = []
        for e in self.work.entries:
            t = self.timings[e.name]
            p = t.processor.times(factor)
            entries.append({
                "tool": e.tool.value, "mode": e.mode, "how": e.how, "whole": e.whole,
                "median": p.median, "least": p.least, "most": p.most,
                "clock": t.clock.median * factor, "rounds": t.rounds,
                "ratio": t.processor.median / ours[e.mode] if e.mode in ours else None,
                "note": t.note,
            })  # fmt: skip
        ratios = {}
        for mode in ours:
            others = [
                e["ratio"] for e in entries
                if e["mode"] == mode and e["whole"] and e["tool"] != Tool.OURS.value
            ]  # fmt: skip
            if others:
                ratios[mode] = min(others)
        return {
            "row": self.work.row, "work": self.work.title, "unit": self.work.unit,
            "entries": entries, "ratios": ratios,
            "goals": [
                {"text": goal.text, "met": bool(goal.met(self.timings))}
                for goal in self.work.goals
            ],
        }  # fmt: skip


def measured(works: Iterator[Work], settings: Settings) -> Iterator[Measured]:
    """Measure one work after the other; its arrays are made when it is its turn."""
    for work in works:
        field = [Contestant(e.name, e.run, e.count, e.said, e.rounds) for e in work.entries]
        yield Measured(work, in_turns(field, settings.rounds, settings.budget))
