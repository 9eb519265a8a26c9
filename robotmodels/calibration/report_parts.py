"""What a report on a calibration is made of: sections of sentences and tables, told once."""

from __future__ import annotations

from typing import NamedTuple

from ..table_text import boxed


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


def millimetres(value: float) -> str:
    """A length as text in millimetres: to a tenth of a micrometre.

    Parameters
    ----------
    value : float
        Metres.

    Returns
    -------
    str
        Millimetres; a dash for NaN.

    Examples
    --------
    >>> millimetres(0.00123456), millimetres(float("nan"))
    ('1.2346', '-')
    """
    return _fixed(1e3 * value)


def degrees(value: float) -> str:
    """An angle as text in degrees, to a tenth of a thousandth.

    Parameters
    ----------
    value : float
        Radians.

    Returns
    -------
    str
        Degrees; a dash for NaN.

    Examples
    --------
    >>> degrees(3.141592653589793)
    '180.0000'
    """
    return _fixed(57.29577951308232 * value)


def in_unit(value: float, unit: str) -> str:
    """A number of a unit as it is printed: m as mm, rad as deg, others as they are.

    Parameters
    ----------
    value : float
        SI.
    unit : str
        ``"m"``, ``"rad"`` or another.

    Returns
    -------
    str
        Text.

    Examples
    --------
    >>> in_unit(0.001, "m"), in_unit(2.5e-5, "rad/N m")
    ('1.0000', '2.500e-05')
    """
    if unit == "m":
        return millimetres(value)
    if unit == "rad":
        return degrees(value)
    return "-" if value != value else f"{value:.3e}"


def printed_unit(unit: str) -> str:
    """Name of the unit that `in_unit` prints.

    Parameters
    ----------
    unit : str
        SI.

    Returns
    -------
    str
        ``mm`` for m, ``deg`` for rad.

    Examples
    --------
    >>> printed_unit("m"), printed_unit("rad"), printed_unit("1")
    ('mm', 'deg', '1')
    """
    return {"m": "mm", "rad": "deg"}.get(unit, unit)


_NOTHING = 1e-8
"""Millimetres or degrees: rounding of a source."""


def _fixed(value: float) -> str:
    if value != value:
        return "-"
    # what is below the last digit, or far above it, is told by its power of ten
    if abs(value) < _NOTHING:
        return "0"
    if not 5e-5 <= abs(value) < 1e6:
        return f"{value:.1e}"
    return f"{value:.4f}"
