"""Labels with too few blocks to determine more than their own unknowns.

Source: Seed book section 1.4.5.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from .labelled import Labelled
from .measurement import Measurement


class LonelyLabel(NamedTuple):
    """Label whose measurements determine only its own unknowns."""

    label: str
    rows: int
    unknowns: int
    blocks: int

    def __str__(self) -> str:
        times = "once" if self.blocks == 1 else f"{self.blocks} times"
        return (
            f"{self.label} is measured {times}: {self.rows} rows for {self.unknowns} unknown "
            "coordinates of its own say nothing about the robot. Measure it in more postures, "
            "or leave it out."
        )


def lonely_labels(measurements: Iterable[Measurement]) -> tuple[LonelyLabel, ...]:
    """Labels with no more rows, over all measurements, than unknowns of their own."""
    unknowns: dict[str, set[str]] = {}
    rows: dict[str, int] = {}
    blocks: dict[str, int] = {}
    for m in measurements:
        own: dict[str, set[str]] = {}
        for fixture in m.fixtures:
            thing = fixture.name.rpartition(".")[0]
            own.setdefault(thing, set()).add(fixture.name)
        for thing, names in own.items():
            label = thing.removeprefix(f"{m.name}:")
            # kinds without labels have things that all blocks share
            count = m.label.count(label) if isinstance(m, Labelled) else m.blocks
            unknowns.setdefault(thing, set()).update(names)
            rows[thing] = rows.get(thing, 0) + count * len(m.axes)
            blocks[thing] = blocks.get(thing, 0) + count
    return tuple(
        LonelyLabel(thing, rows[thing], len(names), blocks[thing])
        for thing, names in unknowns.items()
        if rows[thing] <= len(names)
    )
