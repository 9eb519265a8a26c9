"""Files of each format opened as columns."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

from .._arrays import Array
from ..csv_table import CsvTable, open_table
from ..errors import InvalidValueError, MissingExtraError
from .mat_file import read_mat
from .sizes import check_unpacked, unpacked_npz, unpacked_parquet
from .table import LogFormat, LogTable


class _NoFileError(InvalidValueError, FileNotFoundError):
    """A file that is not there."""


def open_log_table(path: Path, kind: LogFormat | None, delimiter: str | None = None) -> LogTable:
    """Open a file as columns."""
    kind = LogFormat.of(path) if kind is None else kind
    if not path.exists():
        near = get_close_matches(path.name, [each.name for each in path.parent.glob("*")])
        advice = f"near it are {', '.join(near)}" if near else "see its folder and its name"
        raise _NoFileError(f"{path}: there is no such file; {advice}.")
    if delimiter is not None and kind is not LogFormat.CSV:
        raise InvalidValueError(f"delimiter: {path} is no text file; leave it out.")
    if kind is LogFormat.CSV:
        return _text(open_table(path, delimiter))
    if kind is LogFormat.NPZ:
        return _arrays(path, _npz(path), True)
    if kind is LogFormat.MAT:
        return _arrays(path, read_mat(path), True)
    return _arrays(path, _parquet(path), False)


def _text(table: CsvTable) -> LogTable:
    def words(column: int) -> str:
        _, cells = table.first_row()
        return cells[column] if column < len(cells) else ""

    lists = _lists(table)
    if lists is not None:
        return _arrays(table.path, lists, False)
    return LogTable(
        table.path, table.names, table.width, {}, table.numbers_with_gaps, words
    )  # fmt: skip


def _lists(table: CsvTable) -> dict[str, Any] | None:
    """Columns of a table some of whose cells are lists, "[0.1, 0.2]"; None if there are none."""
    _, first = table.first_row()
    listed = [i for i, cell in enumerate(first) if cell[:1] in "[(" and cell[:1]]
    if not listed or not table.names:
        return None
    found: dict[str, Any] = {}
    for i, name in enumerate(table.names):
        if i in listed:
            found[name] = _list_column(table, i)
        elif _reads_as_number(first[i] if i < len(first) else ""):
            found[name] = table.numbers_with_gaps([i])[:, 0]
        else:
            found[name] = table.labels(i)[0]
    return found


def _list_column(table: CsvTable, column: int) -> Any:
    rows: list[list[str]] = []
    for line, cell in table.cells(column):
        parts = [part.strip().strip("'\"") for part in cell.strip("[]() ").split(",")]
        parts = [part for part in parts if part]
        if rows and len(parts) != len(rows[0]):
            raise InvalidValueError(
                f"{table.path}, line {line}: {table.names[column]} has {len(parts)} entries; "
                f"expected {len(rows[0])} as in the first line."
            )
        rows.append(parts)
    try:
        return np.array(rows, dtype=np.float64)
    except ValueError:
        return ", ".join(rows[0])  # names, which are the same in every row


def _reads_as_number(cell: str) -> bool:
    try:
        float(cell or "nan")
    except ValueError:
        return False
    return True


@contextmanager
def _unpacking(path: Path, what: str, advice: str = "") -> Iterator[None]:
    """Say of a file that other packages unpack what is wrong with it."""
    path.open("rb").close()  # what cannot be opened is an OSError; what is damaged is not
    try:
        yield
    except InvalidValueError:
        raise
    # damaged bytes raise whatever the insides of a parser raise
    except Exception as error:  # noqa: BLE001
        raise InvalidValueError(
            f"{path}: this is no {what} file that can be read ({type(error).__name__}: "
            f"{error!s:.300}){advice}."
        ) from None


def _npz(path: Path) -> dict[str, Any]:
    advice = "; write it with numpy.savez(file, q=..., tau=...), without objects in it"
    with _unpacking(path, "NPZ", advice):
        check_unpacked(path, unpacked_npz(path))
        with np.load(path, allow_pickle=False) as stored:
            return {name: np.asarray(stored[name]) for name in stored.files}


def _parquet(path: Path) -> dict[str, Any]:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise MissingExtraError(
            "Parquet files need pyarrow: pip install 'robotmodels[logs]'."
        ) from None
    found: dict[str, Any] = {}
    with _unpacking(path, "Parquet"):
        file = pq.ParquetFile(path)
        check_unpacked(path, unpacked_parquet(file.metadata))
        stored = file.read()
        for name, column in zip(stored.column_names, stored.columns, strict=True):
            kind = column.type
            if pa.types.is_timestamp(kind):
                nanoseconds = column.cast(pa.timestamp("ns", kind.tz)).cast(pa.int64())
                found[name] = nanoseconds.to_numpy()
            elif pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind):
                found[name] = _parquet_lists(path, name, column)
            elif pa.types.is_integer(kind) or pa.types.is_floating(kind):
                found[name] = column.to_numpy()
            elif len(column):
                found[name] = str(column[0].as_py())
    return found


def _parquet_lists(path: Path, name: str, column: Any) -> Any:
    rows = column.to_pylist()
    width = max((len(row) for row in rows if row is not None), default=0)
    if any(isinstance(cell, str) for row in rows[:1] for cell in row or ()):
        return ", ".join(rows[0])
    values = np.full((len(rows), width), np.nan)
    for i, row in enumerate(rows):
        if row is None:
            continue
        if len(row) != width:
            raise InvalidValueError(
                f"{path}: {name} has {len(row)} entries in row {i}, and {width} in others."
            )
        values[i] = [np.nan if cell is None else cell for cell in row]
    return values


def _arrays(path: Path, stored: dict[str, Any], transpose: bool) -> LogTable:
    """Columns of arrays with names, those as long as most first, then texts, then the others.

    With ``transpose`` arrays whose second axis is the samples' are transposed.
    """
    matrices: dict[str, Array] = {}
    texts: dict[str, str] = {}
    for name, value in stored.items():
        array = np.asarray(value)
        if array.dtype.kind in "USO":
            texts[name] = ", ".join(str(word).strip() for word in array.reshape(-1))
        elif array.dtype.kind in "fiub" and array.ndim <= 2 and array.size > 1:
            whole = array.astype(np.float64)
            flat = whole.ndim == 1 or 1 in whole.shape
            matrices[name] = whole.reshape(-1, 1) if flat else whole
    if not matrices:
        raise InvalidValueError(f"{path}: no array of numbers in it; it has {list(stored)!r:.200}.")
    lengths = Counter(
        length
        for value in matrices.values()
        for length in {
            len(value),
            value.shape[1] if transpose and value.shape[1] > 1 else len(value),
        }
    )
    N = max(lengths, key=lambda length: (lengths[length], length))
    transposed = {
        name for name, value in matrices.items() if transpose and _has_samples_last(value, N)
    }
    matrices = {name: x.T if name in transposed else x for name, x in matrices.items()}
    alike = [name for name, value in matrices.items() if len(value) == N]
    names: list[str] = []
    groups: dict[str, tuple[int, ...]] = {}
    columns: list[Array | str] = []
    for name in (*alike, *texts, *(name for name in matrices if name not in alike)):
        if name in texts:
            names.append(name)
            columns.append(texts[name])
            continue
        value = matrices[name]
        k = value.shape[1]
        if k > 1:
            groups[name] = tuple(range(len(names), len(names) + k))
        names += [name] if k == 1 else [f"{name}[{i}]" for i in range(k)]
        columns += list(value.T)

    def read(wanted: Sequence[int]) -> Array:
        found: list[Array] = []
        for i in wanted:
            column = columns[i]
            if isinstance(column, str):
                raise InvalidValueError(f"{path}: {names[i]} is text, not numbers.")
            if found and len(column) != len(found[0]):
                raise InvalidValueError(
                    f"{path}: {names[i]} has {len(column)} samples, {names[wanted[0]]} has "
                    f"{len(found[0])}; give columns of one recording."
                )
            found.append(column)
        values = np.column_stack(found)
        values[~np.isfinite(values)] = np.nan
        return values

    def words(column: int) -> str:
        found = columns[column]
        return found if isinstance(found, str) else repr(float(found[0]))

    return LogTable(
        path, tuple(names), len(names), groups, read, words,
        sum(matrices[name].shape[1] for name in alike), frozenset(transposed),
    )  # fmt: skip


def _has_samples_last(value: Array, N: int) -> bool:
    """Whether the samples of an array are along its second axis."""
    rows, width = value.shape
    return rows != N and width > 1 and (width == N or rows < width)
