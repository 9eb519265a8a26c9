"""Text of tables and of the sections of reports; angles as fractions of pi, lengths, variables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from math import pi
from typing import NamedTuple

_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
SMALLEST = 1e-9
"""Smaller numbers (rad or m) are rounding errors of a source and print as 0."""


def boxed(columns: list[tuple[str, list[str]]]) -> str:
    """Draw a box around columns of text."""
    widths = [max(len(cell) for cell in (head, *cells)) for head, cells in columns]

    def rule(left: str, middle: str, right: str) -> str:
        return left + middle.join("─" * (w + 2) for w in widths) + right

    def line(cells: list[str]) -> str:
        padded = (f" {c:>{w}} " for c, w in zip(cells, widths, strict=True))
        return "│" + "│".join(padded) + "│"

    body = [
        line([cells[i] for _, cells in columns])
        for i in range(len(columns[0][1]) if columns else 0)
    ]
    head = line([head for head, _ in columns])
    return "\n".join([rule("┌", "┬", "┐"), head, rule("├", "┼", "┤"), *body, rule("└", "┴", "┘")])


def joints_text(columns: Mapping[str, Iterable[float]]) -> str:
    """Box with one line a joint and a column for each quantity."""
    cells = [(name, [f"{x + 0.0:.6g}" for x in values]) for name, values in columns.items()]
    return boxed([("j", [str(j + 1) for j in range(len(cells[0][1]))]), *cells])


def length_text(value: float) -> str:
    """A number with six significant digits and no needless zeros; below 1e-9 it shows as 0."""
    return f"{value:.6g}" if abs(value) >= SMALLEST else "0"


def angle_text(
    value: float, within: float = 1e-12, number: Callable[[float], str] = length_text
) -> str:
    """An angle as a fraction of pi if it is one to rounding, else in radians."""
    ratio = Fraction(value / pi).limit_denominator(12)
    if value and abs(float(ratio) * pi - value) < within and ratio:
        top = {1: "π", -1: "-π"}.get(ratio.numerator, f"{ratio.numerator}π")
        return top if ratio.denominator == 1 else f"{top}/{ratio.denominator}"
    return number(value)


def variable_text(symbol: str, number: int, offset: str, negative: bool) -> str:
    """A joint variable with its offset."""
    name = symbol + str(number).translate(_SUBSCRIPTS)
    return name if offset == "0" else f"{name} {'-' if negative else '+'} {offset}"


class ReportTable(NamedTuple):
    """Columns of text under headings."""

    columns: tuple[tuple[str, tuple[str, ...]], ...]

    @property
    def rows(self) -> int:
        """Number of rows without the headings."""
        return len(self.columns[0][1]) if self.columns else 0

    def text(self) -> str:
        """In a box."""
        return boxed([(head, list(cells)) for head, cells in self.columns])


def table_of(headings: tuple[str, ...], rows: list[tuple[str, ...]]) -> ReportTable:
    """A table from its rows."""
    cells = tuple(zip(*rows, strict=True)) if rows else ((),) * len(headings)
    return ReportTable(tuple(zip(headings, cells, strict=True)))


class ReportSection(NamedTuple):
    """A heading with sentences and tables in the order in which they are read."""

    title: str
    body: tuple[str | ReportTable, ...]

    def text(self, width: int = 100) -> str:
        """Lines of at most a number of columns (tables are as wide as they are)."""
        from textwrap import fill

        parts = [
            part.text()
            if isinstance(part, ReportTable)
            else fill(part, width, subsequent_indent="  " if part.startswith("* ") else "")
            for part in self.body
        ]
        return "\n".join([self.title, "-" * len(self.title), *parts])


def number_text(value: float, digits: int = 4) -> str:
    """A number with significant digits; a dash for NaN."""
    if value != value:
        return "-"
    text = f"{value:.{digits}g}"
    # zeros after the point that are not digits take more room than a power of ten
    return f"{value:.{digits - 1}e}" if value and abs(value) < 1e-4 and "e" not in text else text


def percent_text(ratio: float) -> str:
    """A ratio in per cent; a dash for NaN."""
    if ratio != ratio:
        return "-"
    if ratio >= 9.995:
        return "> 999 %"
    return f"{100.0 * ratio:.2g} %" if ratio < 0.995 else f"{100.0 * ratio:.0f} %"


def millimetres(value: float) -> str:
    """A length in metres as text in millimetres, to a tenth of a micrometre."""
    return _fixed(1e3 * value)


def degrees(value: float) -> str:
    """An angle in radians as text in degrees, to a tenth of a thousandth."""
    return _fixed(57.29577951308232 * value)


def in_unit(value: float, unit: str) -> str:
    """A number in its printed unit: m as mm, rad as deg, others as they are."""
    if unit in ("m", "rad"):
        return millimetres(value) if unit == "m" else degrees(value)
    return "-" if value != value else f"{value:.3e}"


def printed_unit(unit: str) -> str:
    """Name of the unit that `in_unit` prints."""
    return {"m": "mm", "rad": "deg"}.get(unit, unit)


def _fixed(value: float) -> str:
    """Four decimals; a power of ten for what is below the last of them or far above it."""
    if value != value:
        return "-"
    if abs(value) < 1e-8:  # millimetres or degrees: rounding of a source
        return "0"
    return f"{value:.4f}" if 5e-5 <= abs(value) < 1e6 else f"{value:.1e}"
