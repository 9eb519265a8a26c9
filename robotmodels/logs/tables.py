"""Files and mappings as columns with names, whatever their format."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from .._arrays import Array
from ..csv_table import Column, CsvTable, column_number, is_number, open_table
from ..errors import InvalidValueError, MissingExtraError, nearest_names

Choice = Column | Sequence[Column]


class NoFileError(InvalidValueError, FileNotFoundError):
    """A file that does not exist."""


@dataclass(frozen=True, slots=True)
class LogTable:
    """Columns of a file; the first ``alike`` of them have the common number of samples."""

    path: Path
    names: tuple[str, ...]
    width: int
    source: CsvTable | list[Array | str]
    alike: int

    def read(self, columns: Sequence[int]) -> Array:
        """Columns of numbers, not all of them finite. Shapes: -> (N, number of columns)."""
        if isinstance(self.source, CsvTable):
            return self.source.numbers_with_gaps(columns)
        chosen = [x for i in columns if not isinstance(x := self.source[i], str)]
        if len(chosen) < len(columns) or len({len(x) for x in chosen}) > 1:
            raise InvalidValueError(
                f"{self.path}: {self.called(columns)} are not numbers of one recording."
            )
        return np.column_stack(chosen)

    def text(self, column: int) -> str:
        """First cell of a column, or the text of an array."""
        if isinstance(self.source, CsvTable):
            cells = self.source.first_row()[1]
            return cells[column] if column < len(cells) else ""
        values = self.source[column]
        return values if isinstance(values, str) else repr(float(values[0]))

    def choice(self, given: Choice, what: str) -> tuple[int, ...]:
        """Columns that an argument names: by number, name, matrix or pattern."""
        numbers: list[int] = []
        for column in [given] if isinstance(given, int | str) else given:
            # columns of a matrix q are called q[0], q[1], ...
            matrix = [i for i, name in enumerate(self.names) if name.rpartition("[")[0] == column]
            if matrix and column not in self.names:
                numbers += matrix
            elif isinstance(column, str) and "*" in column and column not in self.names:
                numbers += self._pattern(column, what)
            else:
                numbers.append(column_number(self.path, self.names, self.width, column, what))
        twice = [column for column in numbers if numbers.count(column) > 1]
        if twice or not numbers:
            got = f"{self.called(twice[:1])} of {self.path} twice" if twice else "none"
            raise InvalidValueError(f"{what}: expected different columns, got {got}.")
        return tuple(numbers)

    def called(self, columns: Sequence[int]) -> str:
        """Columns in words."""
        if not self.names:
            return f"columns {', '.join(map(str, columns))}"
        return ", ".join(self.names[column] for column in columns)

    def _pattern(self, pattern: str, what: str) -> list[int]:
        """Columns whose names have a number in place of the star, by these numbers."""
        expression = re.escape(pattern).replace(r"\*", r"(\d+)")
        matches = [re.fullmatch(expression, name) for name in self.names]
        numbered = {i: int(match[1]) for i, match in enumerate(matches) if match}
        if not numbered:
            raise InvalidValueError(
                f"{what}: no column of {self.path} is {pattern!r} with a number in place of the "
                f"star; give a list of names. Its columns: {self.called(range(self.width))}."
            )
        return sorted(numbered, key=numbered.__getitem__)


def open_log_table(path: Path, delimiter: str | None = None) -> LogTable:
    """Open a file as columns: NPZ, Parquet and MAT by the suffix, text otherwise."""
    if path.is_dir():
        raise InvalidValueError(
            f"path: {path} is a folder; give its files, such as sorted(Path(...).glob('*.csv'))."
        )
    if not path.exists():
        near = nearest_names(path.name, [each.name for each in path.parent.glob("*")])
        words = f"; near it: {', '.join(near)}" if near else ""
        raise NoFileError(f"{path}: there is no such file{words}.")
    read = {".npz": _npz, ".parquet": _parquet, ".pq": _parquet, ".mat": _mat}
    suffix = path.suffix.lower()
    if suffix in read:
        if delimiter is not None:
            raise InvalidValueError(f"delimiter: {path} is no text file; leave it out.")
        return table_of(path, read[suffix](path), transpose=read[suffix] is not _parquet)
    table = open_table(path, delimiter)
    first = table.first_row()[1]
    if table.names and any(cell.startswith(("[", "(")) for cell in first):
        return table_of(path, _list_columns(table, first))
    return LogTable(path, table.names, table.width, table, table.width)


def _list_columns(table: CsvTable, first: list[str]) -> dict[str, Any]:
    """Columns of a text file some of whose cells are lists, "[0.1, 0.2]"."""
    columns: dict[str, Any] = {}
    for i, (name, cell) in enumerate(zip(table.names, first, strict=False)):
        if cell.startswith(("[", "(")):
            cells = [text.strip("[]() ").split(",") for _, text in table.cells(i)]
            parts = [[word.strip(" '\"") for word in row if word.strip()] for row in cells]
            columns[name] = _from_lists(table.path, name, parts)
        elif is_number(cell):
            columns[name] = table.numbers_with_gaps([i])[:, 0]
        else:
            columns[name] = cell
    return columns


def _from_lists(path: Path, name: str, rows: Sequence[Any]) -> Array | str:
    """Cells that are lists as a matrix, or as one text where they are names."""
    width = len(rows[0])
    odd = next((i for i, row in enumerate(rows) if len(row) != width), None)
    if odd is not None:
        raise InvalidValueError(
            f"{path}: {name} has {len(rows[odd])} entries in row {odd}; expected {width} as in the "
            "first."
        )
    try:
        return np.array(list(rows), np.float64)
    except ValueError:
        return ", ".join(map(str, rows[0]))


@contextmanager
def _opened(path: Path, what: str, advice: str) -> Iterator[BinaryIO]:
    """Binary file; errors of the reader are raised with its name."""
    with path.open("rb") as file:
        try:
            yield file
        except (InvalidValueError, MissingExtraError):
            raise
        except Exception as error:  # noqa: BLE001 - parsers raise anything
            raise InvalidValueError(
                f"{path}: this is no {what} file that can be read ({type(error).__name__}: "
                f"{error!s:.300}); {advice}."
            ) from None


def _npz(path: Path) -> dict[str, Any]:
    advice = "write it with numpy.savez(file, q=..., tau=...), without objects in it"
    with _opened(path, "NPZ", advice) as file, np.load(file, allow_pickle=False) as stored:
        return {name: np.asarray(stored[name]) for name in stored.files}


def _mat(path: Path) -> dict[str, Any]:
    """Variables of a MAT file, of version 7.3 (HDF5) too; those of structures as "log.q"."""
    from scipy.io import loadmat

    def flat(values: Mapping[str, Any], head: str = "") -> Iterator[tuple[str, Any]]:
        for name, value in values.items():
            if isinstance(value, dict):
                yield from flat(value, f"{head}{name}.")
            elif not name.startswith("__"):
                yield head + name, value

    with _opened(path, "MAT", "in MATLAB save it with save(file, '-v7'), or write CSV") as file:
        if file.read(10) == b"MATLAB 7.3":
            return _hdf5(path)
        file.seek(0)
        return dict(flat(loadmat(file, simplify_cells=True)))


def _hdf5(path: Path) -> dict[str, Any]:
    try:
        import h5py
    except ImportError:
        raise MissingExtraError(
            "MAT files of version 7.3 need h5py: pip install 'robotmodels[logs]'; or save the file "
            "with save(file, '-v7')."
        ) from None
    variables: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and not name.startswith("#"):
            value, key = item[()], name.replace("/", ".")
            if item.attrs.get("MATLAB_class", b"") == b"char":
                variables[key] = "".join(map(chr, np.ravel(value)))
            elif value.dtype.kind in "fiub":
                variables[key] = value.T  # MATLAB stores columns first

    with h5py.File(path, "r") as stored:
        stored.visititems(visit)
    return variables


def _parquet(path: Path) -> dict[str, Any]:
    try:
        import pyarrow.parquet as pq
    except ImportError:
        raise MissingExtraError(
            "Parquet files need pyarrow: pip install 'robotmodels[logs]'."
        ) from None
    variables: dict[str, Any] = {}
    with _opened(path, "Parquet", "write it again") as file:
        stored = pq.read_table(file)
    for name in stored.column_names:
        column = stored[name].to_numpy()
        if column.dtype.kind == "M":
            nanoseconds = column.astype("datetime64[ns]").astype(np.float64)
            column = np.where(np.isnat(column), np.nan, nanoseconds)
        elif column.dtype.kind == "O":
            first: Any = next((cell for cell in column if cell is not None), None)
            missing = [np.nan] * np.size(first)
            rows = [missing if cell is None else cell for cell in column]
            listed = isinstance(first, np.ndarray)
            column = _from_lists(path, name, rows) if listed else str(first)
        variables[name] = column
    return variables


def table_of(path: Path, stored: Mapping[str, Any], transpose: bool = True) -> LogTable:
    """Columns of named arrays and texts, those of the most frequent length first.

    With ``transpose`` arrays whose second axis is that of the samples are transposed.
    """
    matrices: dict[str, Array] = {}
    texts: dict[str, str] = {}
    for name, value in stored.items():
        array = np.asarray(value)
        if array.dtype.kind in "fiub" and array.ndim <= 2 and array.size > 1:
            with np.errstate(invalid="ignore"):  # signalling NaN of damaged files
                whole = array.astype(np.float64)
            flat = whole.ndim == 1 or 1 in whole.shape
            matrices[name] = whole.reshape(-1, 1) if flat else whole
        elif array.dtype.kind in "UO" and all(isinstance(x, str | int | float) for x in array.flat):
            texts[name] = ", ".join(str(word).strip() for word in array.flat)
    if not matrices:
        raise InvalidValueError(f"{path}: no array of numbers in it; it has {list(stored)!r:.200}.")
    axes = 2 if transpose else 1
    lengths = Counter(k for x in matrices.values() for k in set(x.shape[:axes]) - {1})
    N = max(lengths, key=lambda length: (lengths[length], length))
    for name, x in matrices.items():
        rows, width = x.shape
        if transpose and rows != N and width > 1 and (width == N or rows < width):
            matrices[name] = x.T
    blocks = {name: list(x.T) for name, x in matrices.items() if len(x) == N}
    count = sum(map(len, blocks.values()))
    blocks |= {name: [text] for name, text in texts.items()}
    blocks |= {name: list(x.T) for name, x in matrices.items() if name not in blocks}
    names: list[str] = []
    for name, block in blocks.items():
        names += [name] if len(block) == 1 else [f"{name}[{i}]" for i in range(len(block))]
    columns = [column for block in blocks.values() for column in block]
    return LogTable(path, tuple(names), len(names), columns, count)
