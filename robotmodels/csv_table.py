"""Columns of numbers and labels in text files, with every cell that is none named by its line."""

from __future__ import annotations

import csv
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from ._arrays import Array
from .errors import InvalidValueError, nearest_names

Column = int | str
"""A column: its number, from 0, or its name in the header."""

_COMMENT = "#"
_LONGEST = 2**20
"""Letters of a line; a longer one is no row of a table, but a file without line ends."""


@dataclass(frozen=True, slots=True)
class CsvTable:
    """Text file of columns, read column by column on demand."""

    path: Path
    names: tuple[str, ...]
    delimiter: str | None
    width: int
    first: int

    def find(self, names: Sequence[str]) -> tuple[int, ...] | None:
        """Numbers of columns by their names, whatever their capitals; None if one is missing."""
        lower = [name.lower() for name in self.names]
        wanted = [name.lower() for name in names]
        if any(lower.count(name) != 1 for name in wanted):
            return None
        return tuple(lower.index(name) for name in wanted)

    def number(self, column: Column, what: str) -> int:
        """Number of a column."""
        return column_number(self.path, self.names, self.width, column, what)

    def numbers(self, columns: Sequence[int]) -> Array:
        """Columns of finite numbers. Shapes: -> (N, number of columns)."""
        values = self.numbers_with_gaps(columns)
        for row, place in np.argwhere(np.isnan(values))[:1].tolist():
            line, cells = next(islice(self._rows(), row, None))
            cell = cells[columns[place]]
            raise InvalidValueError(
                f"{self.path}, line {line}: {self._called(columns[place])} is "
                f"{repr(cell) if cell else 'empty'}. A row that was not measured is left out: "
                "delete the line."
            )
        return values

    def numbers_with_gaps(self, columns: Sequence[int]) -> Array:
        """Columns of numbers, NaN where a cell is empty or infinite.

        Shapes: -> (N, number of columns).
        """
        options: dict[str, Any] = {"delimiter": self.delimiter, "skiprows": self.first}
        options |= {"comments": _COMMENT, "encoding": "utf-8-sig", "ndmin": 2, "quotechar": '"'}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # no data: an error below
                values = np.loadtxt(self.path, usecols=list(columns), **options)
        except ValueError:
            values = self._cell_by_cell(columns)
        if not len(values):
            raise InvalidValueError(
                f"{self.path}: no line of numbers. Give a file with a row for each measurement."
            )
        # a quotation mark without its end takes the lines up to the next one into its cell
        with self.path.open("rb") as file:
            quoted = any(b'"' in line for line in file)
        if quoted and len(values) != sum(1 for _ in self._rows()):
            raise InvalidValueError(
                f"{self.path}: a cell begins with a quotation mark that has no end in its line, so "
                "that rows would be lost. Close it, or take it out."
            )
        values[~np.isfinite(values)] = np.nan
        return values

    def _cell_by_cell(self, columns: Sequence[int]) -> Array:
        """Columns of numbers; raises with the line and the cell that is none."""
        rows = []
        for line, cells in self._rows():
            if len(cells) <= max(columns):
                raise InvalidValueError(
                    f"{self.path}, line {line}: expected {self.width} columns as in the first "
                    f"line, got {len(cells)}. Delete the line if it was cut off."
                )
            for column in columns:
                if not is_number(cells[column]):
                    comma = "," in cells[column] and self.delimiter != ","
                    raise InvalidValueError(
                        f"{self.path}, line {line}: {self._called(column)} is "
                        f"{cells[column]!r:.60}, not a number."
                        + (" Write a point for the decimal comma." if comma else "")
                    )
            rows.append([float(cells[column] or "nan") for column in columns])
        return np.array(rows, dtype=np.float64).reshape(len(rows), len(columns))

    def cells(self, column: int) -> Iterator[tuple[int, str]]:
        """Cells of a column as text, each with the number of its line, from 1."""
        for line, cells in self._rows():
            yield line, cells[column] if column < len(cells) else ""

    def first_row(self) -> tuple[int, list[str]]:
        """Number of the first line of data, from 1, and its cells; none if there is no data."""
        return next(self._rows(), (self.first + 1, []))

    def labels(self, column: int) -> tuple[str, ...]:
        """A column of labels."""
        found = []
        for line, cells in self._rows():
            if len(cells) <= column or not cells[column]:
                raise InvalidValueError(
                    f"{self.path}, line {line}: {self._called(column)} is empty; a label is needed."
                )
            found.append(cells[column])
        return tuple(found)

    def _called(self, column: int) -> str:
        name = f" ({self.names[column]})" if column < len(self.names) else ""
        return f"column {column}{name}"

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        """Number of the line, from 1, and cells of every line of data."""
        for number, text in _lines(self.path):
            if number > self.first and text.strip():
                yield number, cells_of(text, self.delimiter)


def column_number(path: Path, names: Sequence[str], width: int, column: Column, what: str) -> int:
    """Number of a column given by its number or its name; capitals matter only between equals."""
    if isinstance(column, str):
        found = [i for i, name in enumerate(names) if name == column]
        found = found or [i for i, name in enumerate(names) if name.lower() == column.lower()]
        if len(found) == 1:
            return found[0]
        if not names:
            raise InvalidValueError(
                f"{what}: {path} has no header, so that {column!r} names none; give numbers of "
                f"columns, from 0 to {width - 1}."
            )
        if found:
            raise InvalidValueError(
                f"{what}: {path} has several columns {column!r}; give their numbers, from 0."
            )
        near = ", ".join(nearest_names(column, names))
        near = f"; near it: {near}" if near else ""
        raise InvalidValueError(
            f"{what}: {path} has no column {column!r}{near}. Its columns: {', '.join(names)}."
        )
    if isinstance(column, bool) or not isinstance(column, int):
        raise InvalidValueError(
            f"{what}: expected numbers or names of columns, got {column!r:.60}."
        )
    if not -width <= column < width:
        raise InvalidValueError(f"{what}: {path} has columns 0 to {width - 1}, got {column}.")
    return column % width


def cells_of(line: str, delimiter: str | None) -> list[str]:
    """Cells of a line without blanks and quotation marks around them."""
    if delimiter is not None and '"' in line and line.count('"') % 2 == 0:
        # a cell in quotation marks may have the delimiter in it; blanks may stand before them
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
    else:
        cells = line.split(delimiter)
    return [cell.strip().strip("\"'") for cell in cells]


def open_table(path: str | Path, delimiter: str | None = None) -> CsvTable:
    """Look at the first line of a file: if most of its cells are no numbers it is a header."""
    path = Path(path)
    if delimiter is not None and len(delimiter) != 1:
        raise InvalidValueError(
            f"delimiter: expected one character, got {delimiter!r}; leave it out for blanks."
        )
    found = next((line for line in _lines(path) if line[1].strip()), None)
    if found is None:
        raise InvalidValueError(f"{path}: the file is empty.")
    number, text = found
    if delimiter is None:
        delimiter = next((mark for mark in (";", "\t", ",") if mark in text), None)
    cells = cells_of(text, delimiter)
    # labels of a file without a header are words too, but most of its cells are numbers
    header = 2 * sum(not is_number(cell) for cell in cells) > len(cells)
    return CsvTable(
        path, tuple(cells) if header else (), delimiter, len(cells), number - 1 + header
    )


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Number of every line, from 1, and its text without comment, as NumPy counts them."""
    try:
        with path.open(encoding="utf-8-sig") as file:
            for number, line in enumerate(iter(partial(file.readline, _LONGEST), ""), 1):
                if len(line) == _LONGEST:
                    raise InvalidValueError(
                        f"{path}, line {number}: it is longer than {_LONGEST} letters; expected a "
                        "text file of columns (CSV) with a row on each line."
                    )
                yield number, line.split(_COMMENT, 1)[0].strip("\r\n")
    except UnicodeDecodeError:
        raise InvalidValueError(f"{path}: expected a text file of columns (CSV).") from None


def is_number(cell: str) -> bool:
    """Whether a cell is empty or a number."""
    try:
        float(cell or "0")  # an empty cell is a gap in the data, not a name
    except ValueError:
        return False
    return True
