"""Columns of numbers and labels in text files, with every cell that is none named by its line."""

from __future__ import annotations

import csv
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

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
        """Columns of numbers. Shapes: -> (N, number of columns)."""
        try:
            values = self._loaded(columns)
        except InvalidValueError:
            raise
        except ValueError:
            values = np.zeros((0, len(columns)))
        if not len(values) or not np.isfinite(values).all():
            self._raise_bad_cell(columns)
        return values

    def _loaded(self, columns: Sequence[int]) -> Array:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # no data: the callers raise
            values = np.loadtxt(
                self.path, delimiter=self.delimiter, skiprows=self.first, quotechar='"',
                usecols=list(columns), comments=_COMMENT, ndmin=2, encoding="utf-8-sig",
            )  # fmt: skip
        # a quotation mark without its end takes the lines up to the next one into its cell
        if _has_quotes(self.path) and len(values) != sum(1 for _ in self._rows()):
            raise InvalidValueError(
                f"{self.path}: a cell begins with a quotation mark that has no end in its line, so "
                "that rows would be lost. Close it, or take it out."
            )
        return values

    def numbers_with_gaps(self, columns: Sequence[int]) -> Array:
        """Columns of numbers, NaN where a cell is empty, infinite or not a number.

        Shapes: -> (N, number of columns).
        """
        try:
            values = self._loaded(columns)
        except InvalidValueError:
            raise
        except ValueError:
            values = self._cell_by_cell(columns)
        if not len(values):
            self._raise_bad_cell(columns)
        values[~np.isfinite(values)] = np.nan
        return values

    def _cell_by_cell(self, columns: Sequence[int]) -> Array:
        rows = []
        for line, cells in self._rows():
            if len(cells) != self.width:
                raise InvalidValueError(
                    f"{self.path}, line {line}: expected {self.width} columns as in the first "
                    f"line, got {len(cells)}. Delete the line if it was cut off."
                )
            row = []
            for column in columns:
                cell = cells[column]
                try:
                    row.append(float(cell or "nan"))
                except ValueError:
                    raise self._no_number(line, column, cell) from None
            rows.append(row)
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

    def _raise_bad_cell(self, columns: Sequence[int]) -> None:
        for line, cells in self._rows():
            for column in columns:
                where = f"{self.path}, line {line}"
                if column >= len(cells):
                    raise InvalidValueError(
                        f"{where}: expected {self.width} columns as in the first line, got "
                        f"{len(cells)}."
                    )
                cell = cells[column]
                if not cell:
                    raise InvalidValueError(
                        f"{where}: {self._called(column)} is empty. Fill it in, or delete the line."
                    )
                try:
                    finite = np.isfinite(float(cell))
                except ValueError:
                    raise self._no_number(line, column, cell) from None
                if not finite:
                    raise InvalidValueError(
                        f"{where}: {self._called(column)} is {cell!r}. A row that was not measured "
                        "is left out: delete the line."
                    )
        raise InvalidValueError(
            f"{self.path}: no line of numbers. Give a file with a row for each measurement."
        )

    def _no_number(self, line: int, column: int, cell: str) -> InvalidValueError:
        comma = "," in cell and self.delimiter != ","
        return InvalidValueError(
            f"{self.path}, line {line}: {self._called(column)} is {cell!r:.60}, not a number."
            + (" Write a point for the decimal comma." if comma else "")
        )


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
        near = ", ".join(nearest_names(column, names)) or "none"
        raise InvalidValueError(
            f"{what}: {path} has no column {column!r}; near it: {near}. Its columns: "
            f"{', '.join(names)}."
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
            number = 0
            while line := file.readline(_LONGEST + 1):
                number += 1
                if len(line) > _LONGEST:
                    raise InvalidValueError(
                        f"{path}, line {number}: it is longer than {_LONGEST} letters; expected "
                        "a text file of columns (CSV) with a row on each line."
                    )
                yield number, line.split(_COMMENT, 1)[0].strip("\r\n")
    except UnicodeDecodeError:
        raise InvalidValueError(f"{path}: expected a text file of columns (CSV).") from None


def _has_quotes(path: Path) -> bool:
    with path.open("rb") as file:
        return any(b'"' in part for part in iter(lambda: file.read(_LONGEST), b""))


def is_number(cell: str) -> bool:
    """Whether a cell is empty or a number."""
    try:
        float(cell or "0")  # an empty cell is a gap in the data, not a name
    except ValueError:
        return False
    return True
