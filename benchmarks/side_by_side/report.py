"""The table of one run, as Markdown and as JSON."""

from __future__ import annotations

from typing import Any

from benchmarks.machine import head
from benchmarks.rounded import figure, told_goals, told_ratios, way_of
from benchmarks.side_by_side.works import Tool

Row = dict[str, Any]
PEERS = [tool.value for tool in Tool][1:]
CONTEXT = """\
Medians of the processor's time over rounds in which the contestants take turns, one thread.
`ratio`: the fastest of the others to ours, both in the mode that stands with it (one by one, in a
batch, on every row, ...), so above 1 ours is faster; no ratio where nobody else has a mode of ours.
A Pinocchio figure is that of raw calls from Python, without checks, and what does a part of the
work only (a regressor alone, one posture of eight, an answer that is mostly wrong) enters no ratio.
Every way, its spread and what it found are in the second table; `x` there is the ratio to ours of
the same mode."""


def markdown(facts: dict[str, str], rows: list[Row], absent: list[str]) -> str:
    """Both tables."""
    lines = head("Side by side with what people would pick instead", facts)
    lines += [CONTEXT, ""]
    if absent:
        lines += [f"Left out: {'; '.join(absent)}.", ""]
    lines += compact(rows)
    lines += ["", "## Every way", "", *detailed(rows)]
    return "\n".join(lines) + "\n"


def compact(rows: list[Row]) -> list[str]:
    """A line for each work."""
    columns = ["work", "unit", "ours", *PEERS, "ratio", "goal"]
    lines = [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    for r in rows:
        cells = [r["work"], r["unit"]]
        cells += [
            "; ".join(cell(e) for e in r["entries"] if e["tool"] == tool)
            for tool in (Tool.OURS.value, *PEERS)
        ]
        cells += [told_ratios(r, "{ratio} {mode}"), told_goals(r)]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def detailed(rows: list[Row]) -> list[str]:
    """A line for each way."""
    columns = ["work", "way", "unit", "median", "least", "most", "clock", "rounds", "x", "note"]
    lines = [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    for r in rows:
        for e in r["entries"]:
            way = ", ".join(word for word in (e["tool"], e["mode"], e["how"]) if word)
            numbers = [figure(e[k]) for k in ("median", "least", "most", "clock")]
            ratio = "" if e["ratio"] is None else figure(e["ratio"])
            cells = [r["work"], way, r["unit"], *numbers, f"{e['rounds']}", ratio, e["note"]]
            lines.append(f"| {' | '.join(cells)} |")
    return lines


def line(row: Row) -> str:
    """What is printed as soon as a work is done."""
    ways = "; ".join(f"{e['tool']} {cell(e)}" for e in row["entries"])
    return f"{row['work']} [{row['unit']}]: {ways}"


def cell(entry: Row) -> str:
    """A median with its mode and way."""
    return " ".join([figure(entry["median"]), way_of(entry)]).strip()
