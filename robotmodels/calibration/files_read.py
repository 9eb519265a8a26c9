"""Files of a measurement: their rows and consistency."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._arrays import Array
from ..csv_table import CsvTable
from ..errors import InvalidValueError
from ..model import RobotModel
from .extended_table import Frame
from .measurements.measurement import FileRow
from .reading_limits import beyond_limits

_UNIT = 1e-3
"""How far from 1 the length of a quaternion of few digits may be."""
_ROWS = 3
"""Rows of unit length that are no chance."""


def rows_read(tables: Sequence[CsvTable], counts: Sequence[int]) -> tuple[FileRow, ...]:
    """Every row of the files, by the name of its file with the folder."""
    names = [f"{t.path.resolve().parent.name}/{t.path.name}" for t in tables]
    return tuple(
        FileRow(name, row + 1)
        for name, count in zip(names, counts, strict=True)
        for row in range(count)
    )


def check_columns(tables: Sequence[CsvTable]) -> None:
    """Refuse files of a folder whose columns differ in number or name."""
    kinds: dict[str, list[str]] = {}
    for t in tables:
        columns = f"columns {', '.join(t.names)}" if t.names else f"{t.width} columns, no header"
        kinds.setdefault(columns, []).append(t.path.name)
    if len(kinds) > 1:
        listed = "; ".join(f"{', '.join(names)}: {columns}" for columns, names in kinds.items())
        raise InvalidValueError(
            f"path: the files of {tables[0].path.parent} do not have the same columns ({listed}). "
            "Select the files by pattern='*.csv', or name them."
        )


def check_contents(
    tables: Sequence[CsvTable], readings: Sequence[Array], model: RobotModel, frame: Frame
) -> None:
    """Refuse files whose columns are not joint readings. Shapes: readings (N, n)."""
    rows = set(model.twin.frame(frame).path.tolist())
    other: dict[str, str] = {}
    for t, q in zip(tables, readings, strict=True):
        said, most = beyond_limits(model, q, rows)
        if _has_quaternions(q):
            other[t.path.name] = "four columns are unit quaternions: poses"
        elif most:
            other[t.path.name] = f"beyond limits: {said[0]}"
    if other and len(other) < len(tables):
        raise InvalidValueError(
            f"path: among {', '.join(t.path.name for t in tables)}, these are not readings of the "
            f"joints of {model.name}: "
            + "; ".join(f"{name} ({why})" for name, why in other.items())
            + ". Select the files by pattern='*.csv', or name them."
        )


def _has_quaternions(q: Array) -> bool:
    """Whether four neighbouring columns have length 1 in every row."""
    if len(q) < _ROWS or q.shape[1] < 4:
        return False
    square = np.lib.stride_tricks.sliding_window_view(q**2, 4, axis=1).sum(axis=-1)
    return bool((np.abs(square - 1.0) < 2.0 * _UNIT).all(axis=0).any())
