"""Text of tables and of the sections of reports; angles as fractions of pi, lengths, variables."""

from __future__ import annotations

from fractions import Fraction
from math import pi
from typing import NamedTuple

_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
SMALLEST = 1e-9
"""What is smaller (rad or m) is rounding of a source, not geometry to read: it prints as 0."""


def boxed(columns: list[tuple[str, list[str]]]) -> str:
    """Draw a box around columns of text.

    Parameters
    ----------
    columns : list of (heading, cells)
        All of the same length.

    Returns
    -------
    str
        Text of several lines, right-aligned cells.

    Examples
    --------
    >>> print(boxed([("x", ["1"])]))
    ┌───┐
    │ x │
    ├───┤
    │ 1 │
    └───┘
    """
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


def angle_text(value: float) -> str:
    """An angle as a fraction of pi if it is one to rounding, else in radians.

    Parameters
    ----------
    value : float
        Radians.

    Returns
    -------
    str
        For instance ``-π/2``, ``0`` or ``0.3``.

    Examples
    --------
    >>> angle_text(-pi / 2), angle_text(0.3)
    ('-π/2', '0.3')
    """
    ratio = Fraction(value / pi).limit_denominator(12)
    if value and abs(float(ratio) * pi - value) < 1e-12 and ratio:
        top = {1: "π", -1: "-π"}.get(ratio.numerator, f"{ratio.numerator}π")
        return top if ratio.denominator == 1 else f"{top}/{ratio.denominator}"
    return length_text(value)


def length_text(value: float) -> str:
    """A number with six significant digits and no needless zeros; below 1e-9 it shows as 0.

    Parameters
    ----------
    value : float
        Any number.

    Returns
    -------
    str
        Its text.

    Examples
    --------
    >>> length_text(0.45), length_text(-0.0)
    ('0.45', '0')
    """
    return f"{value:.6g}" if abs(value) >= SMALLEST else "0"


def variable_text(symbol: str, number: int, offset: str, negative: bool) -> str:
    """A joint variable with its offset.

    Parameters
    ----------
    symbol : str
        ``θ`` or ``r``.
    number : int
        Of the joint, printed as a subscript.
    offset : str
        Magnitude of what is added to it, as text; ``"0"`` for nothing.
    negative : bool
        Whether it is subtracted.

    Returns
    -------
    str
        For instance ``θ₂ - π/2``.

    Examples
    --------
    >>> variable_text("θ", 2, "π/2", True), variable_text("r", 3, "0", False)
    ('θ₂ - π/2', 'r₃')
    """
    name = symbol + str(number).translate(_SUBSCRIPTS)
    return name if offset == "0" else f"{name} {'-' if negative else '+'} {offset}"


class ReportTable(NamedTuple):
    """Columns of text under headings.

    Attributes
    ----------
    columns : tuple of (str, tuple of str)
        Heading and cells of each.

    Examples
    --------
    >>> print(ReportTable((("n", ("1",)),)).text())
    ┌───┐
    │ n │
    ├───┤
    │ 1 │
    └───┘
    """

    columns: tuple[tuple[str, tuple[str, ...]], ...]

    @property
    def rows(self) -> int:
        """Number of rows without the headings."""
        return len(self.columns[0][1]) if self.columns else 0

    def text(self) -> str:
        """In a box."""
        return boxed([(head, list(cells)) for head, cells in self.columns])


def table_of(headings: tuple[str, ...], rows: list[tuple[str, ...]]) -> ReportTable:
    """A table from its rows.

    Parameters
    ----------
    headings : tuple of str
        One for each column.
    rows : list of tuple of str
        Cells.

    Returns
    -------
    ReportTable
        The same by columns.

    Examples
    --------
    >>> table_of(("a", "b"), [("1", "2")]).rows
    1
    """
    cells = tuple(zip(*rows, strict=True)) if rows else ((),) * len(headings)
    return ReportTable(tuple(zip(headings, cells, strict=True)))


class ReportSection(NamedTuple):
    """A heading with sentences and tables in the order in which they are read.

    Attributes
    ----------
    title : str
        The heading.
    body : tuple of str or ReportTable
        Paragraphs and tables.

    Examples
    --------
    >>> print(ReportSection("Outliers", ("None.",)).text())
    Outliers
    --------
    None.
    """

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
