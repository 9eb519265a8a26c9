"""Columns of files as samples: what was asked for, or found by its names, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from .._arrays import Array
from ..csv_table import Column
from ..errors import InvalidValueError, ShapeError
from ..file_units import AngleUnit, TimeUnit
from .finding_columns import (
    Quantity,
    angle_unit_of,
    find_quantity,
    find_time,
    joints_of,
    time_unit_of,
)
from .interpolation import splined
from .log import RefusedRows
from .table import LogTable
from .units import check_headers, check_position_units, check_torque_units

Choice = Column | Sequence[Column]
_NEAR = 1.5
"""Periods of the torques within which a position must have them."""
EXTRA: tuple[Quantity, ...] = (
    Quantity.VELOCITY,
    Quantity.ACCELERATION,
    Quantity.POSITION_REFERENCE,
    Quantity.VELOCITY_REFERENCE,
)
Extras = dict[Quantity, Choice | Literal[False] | None]


@dataclass(frozen=True, slots=True, eq=False)
class RawSamples:
    """Samples as the files have them, quantities beside each other.

    Shapes: t (N,), values (N, k n).
    """

    t: Array | None
    values: Array
    order: tuple[Quantity, ...]
    n: int
    names: tuple[str, ...] | None
    refused: tuple[RefusedRows, ...]
    notes: tuple[str, ...]


def raw_samples(
    table: LogTable, second: LogTable | None, positions: Choice | None, torques: Choice | None,
    extras: Extras, names: tuple[str, ...] | None,
    time: Column | Sequence[Column] | Literal[False] | None, unit: TimeUnit | None,
    angle: AngleUnit, currents: bool,
) -> RawSamples:  # fmt: skip
    """Samples of one file, or of one of positions and one of torques."""
    notes: list[str] = []
    t, t_columns = _time(table, time, unit, notes)
    where = _quantity(table, Quantity.POSITION, positions, names, notes, t_columns, second is None)
    n = len(where)
    notes += check_position_units(table, where)
    _refuse_twice(table, "positions", where, "time", t_columns)
    check_headers([angle_unit_of(table.names[i]) for i in where if table.names], angle,
                  str(table.path))  # fmt: skip
    values = [_read(table, where, notes)]
    owners = [joints_of(table, Quantity.POSITION, where)]
    order = [Quantity.POSITION, Quantity.TORQUE]
    refused: list[RefusedRows] = []
    if second is None:
        taken = _torques(table, torques, names, notes, t_columns, currents, n, True)
        _refuse_twice(table, "torques", taken, "positions", where)
        _refuse_twice(table, "torques", taken, "time", t_columns)
        notes += check_torque_units(table, taken, currents)
        values.append(_read(table, taken, notes))
        owners.append(joints_of(table, Quantity.TORQUE, taken))
    else:
        t2, columns = _time(second, time, unit, notes)
        taken = _torques(second, torques, names, notes, columns, currents, n, False)
        _refuse_twice(second, "torques", taken, "time", columns)
        notes += check_torque_units(second, taken, currents)
        tau = _read(second, taken, notes)
        values.append(_beside(t, t2, len(values[0]), tau, table, second, notes, refused))
        owners.append(joints_of(second, Quantity.TORQUE, taken))
    for quantity, given in extras.items():
        if given is False:
            continue
        found = (
            find_quantity(table, quantity, names)
            if given is None
            else table.choice(given, quantity.argument)
        )
        if found is None:
            continue
        if len(found) != n:
            raise ShapeError(
                f"{quantity.argument}: {len(found)} columns of {table.path} "
                f"({table.called(found)}) for {n} joints; say {quantity.argument}=[...], or False "
                "to leave them out."
            )
        if given is None:
            notes.append(_told(table, quantity, found))
        notes += check_position_units(table, found)
        if quantity in (Quantity.VELOCITY, Quantity.ACCELERATION):
            _refuse_twice(table, quantity.argument, found, "positions", where)
        check_headers([angle_unit_of(table.names[i]) for i in found if table.names], angle,
                      str(table.path))  # fmt: skip
        values.append(_read(table, found, notes))
        owners.append(joints_of(table, quantity, found))
        order.append(quantity)
    own = owners[0]
    for k, other in enumerate(owners):
        if own is not None and other is not None and other != own and set(other) == set(own):
            values[k] = values[k][:, [other.index(name) for name in own]]
    if names is not None and own is not None and set(names) & set(own) and own != names:
        missing = [name for name in names if name not in own]
        if missing:
            raise InvalidValueError(
                f"positions: {table.path} has no joint {', '.join(missing)}; it has "
                f"{', '.join(own)}. Say which in joints=."
            )
        # the file has the robot's joints in another order or among others, and says so
        place = [own.index(name) for name in names]
        values = [block[:, place] for block in values]
        notes.append(
            f"{table.path.name}: its joints are {', '.join(own)}; those of the model were taken, "
            "in its order."
        )
        own, n = names, len(names)
    if names is not None and len(names) != n:
        raise ShapeError(
            f"positions: {n} columns of {table.path} ({table.called(where)}), but {len(names)} "
            f"joints: {', '.join(names)}."
        )
    if names is not None and own is not None and set(own) != set(names):
        notes.append(
            f"{table.path.name}: its joints are called {', '.join(own)}; they were taken as "
            f"{', '.join(names)}, in this order."
        )
    lengths = {len(block) for block in values} | (set() if t is None else {len(t)})
    if len(lengths) > 1:
        raise InvalidValueError(
            f"{table.path}: the columns asked for have {', '.join(map(str, sorted(lengths)))} "
            "samples; give times, positions and torques of one recording."
        )
    return RawSamples(
        t, np.concatenate(values, axis=1), tuple(order), n, own, tuple(refused), tuple(notes)
    )


def _read(table: LogTable, columns: Sequence[int], notes: list[str]) -> Array:
    """Samples of columns, noted where their array was transposed."""
    arrays = {table.names[i].rpartition("[")[0] for i in columns if table.names}
    notes += [
        f"{table.path.name}: {name} has shape (joints, samples) and was transposed."
        for name in sorted(arrays & table.transposed)
    ]
    return table.read(columns)


def _refuse_twice(
    table: LogTable, what: str, columns: Sequence[int], other: str, others: Sequence[int]
) -> None:
    """Refuse columns that are said to be two things at once."""
    both = sorted(set(columns) & set(others))
    if both:
        raise InvalidValueError(
            f"{what}: {table.called(both)} of {table.path} would be {what} and {other} at once; "
            f"say {what}=[...] and {other}= so that they differ."
        )


def _quantity(
    table: LogTable, kind: Quantity, given: Choice | None, names: tuple[str, ...] | None,
    notes: list[str], time: Sequence[int], alone: bool,
) -> tuple[int, ...]:  # fmt: skip
    if given is not None:
        return table.choice(given, kind.argument)
    found = find_quantity(table, kind, names)
    if found is None and not alone:
        # a file of this quantity and nothing else
        rest = tuple(i for i in range(table.width) if i not in time)
        found = rest if names is None or len(rest) == len(names) else None
    if found is None:
        word = kind.argument
        raise InvalidValueError(
            f"{word}: no columns of {table.path} have a usual name, such as {kind.value[0]}1; give "
            f"them as {word}=[...], names or numbers from 0, or as a pattern. It has "
            f"{table.described()}."
        )
    notes.append(_told(table, kind, found))
    return found


def _torques(
    table: LogTable, given: Choice | None, names: tuple[str, ...] | None, notes: list[str],
    time: Sequence[int], currents: bool, n: int, alone: bool,
) -> tuple[int, ...]:  # fmt: skip
    if given is None and find_quantity(table, Quantity.TORQUE, names) is None:
        found = find_quantity(table, Quantity.CURRENT, names)
        if found is not None and not currents:
            raise InvalidValueError(
                f"torques: {table.path} has currents ({table.called(found)}); say drive_gains= (N "
                "m for one unit of them), or drive_gains=1 to take them as they are."
            )
        if found is not None:
            notes.append(_told(table, Quantity.CURRENT, found))
            given = found
    chosen_columns = _quantity(table, Quantity.TORQUE, given, names, notes, time, alone)
    if len(chosen_columns) != n:
        raise ShapeError(
            f"torques: {len(chosen_columns)} columns of {table.path} "
            f"({table.called(chosen_columns)}) for {n} columns of positions."
        )
    return chosen_columns


def _told(table: LogTable, kind: Quantity, found: Sequence[int]) -> str:
    word = "currents" if kind is Quantity.CURRENT else kind.argument.replace("_", " ")
    return f"{table.path.name}: {word} were found in {table.called(found)}."


def _time(
    table: LogTable, given: Column | Sequence[Column] | Literal[False] | None,
    unit: TimeUnit | None, notes: list[str],
) -> tuple[Array | None, tuple[int, ...]]:  # fmt: skip
    """Seconds of each row, and the columns that say them."""
    if given is False:
        return None, ()
    if given is None:
        found = find_time(table)
        if found is None:
            return None, ()
        columns, said = found.columns, found.unit
        told = (said or TimeUnit.SECOND) if unit is None else unit
        notes.append(
            f"{table.path.name}: times were found in {table.called(columns)}, "
            f"{told.value} by {_reason(unit, said)}."
        )
    else:
        columns = table.choice(given, "time")
        said = time_unit_of(table.names[columns[0]]) if table.names else None
        told = (said or TimeUnit.SECOND) if unit is None else unit
    if unit is not None and said is not None and said is not unit and len(columns) == 1:
        raise InvalidValueError(
            f"{table.path}: the header says that times are in {said.value!r}, the argument "
            f"times={unit.value!r}; leave it out, or give the right column as time=."
        )
    if len(columns) > 2:
        raise InvalidValueError("time: expected one column, or two (seconds, nanoseconds).")
    values = table.read(columns)
    if len(columns) == 1:
        return values[:, 0] * told.factor, columns
    # seconds since 1970 and nanoseconds: digits are kept by counting from the first
    finite = values[np.isfinite(values[:, 0]), 0]
    zero = finite[0] if len(finite) else 0.0
    return (values[:, 0] - zero) + 1e-9 * values[:, 1] + zero, columns


def _reason(unit: TimeUnit | None, said: TimeUnit | None) -> str:
    if unit is not None:
        return "the argument"
    return "their names" if said is not None else "default"


def _beside(
    t: Array | None, t2: Array | None, N: int, tau: Array, table: LogTable, second: LogTable,
    notes: list[str], refused: list[RefusedRows],
) -> Array:  # fmt: skip
    """Torques of another file for each row of positions; NaN where it has none near in time."""
    names = f"{table.path.name} and {second.path.name}"
    if t is None and t2 is None:
        if len(tau) != N:
            raise ShapeError(
                f"torques_from: {table.path} has {N} rows, {second.path} has {len(tau)}; without "
                "times in both they are put side by side and must be as many."
            )
        notes.append(f"{names} have no times: their rows were put side by side.")
        return tau
    if t is None or t2 is None:
        raise InvalidValueError(
            f"torques_from: one of {names} has times and the other has none; say time=False and "
            "dt= to put their rows side by side."
        )
    if len(t) == len(t2) and np.array_equal(t, t2, equal_nan=True):
        return tau
    good = np.isfinite(t2) & np.isfinite(tau).all(axis=1)
    stamps, rows = t2[good], tau[good]
    if len(stamps) < 2 or (np.diff(stamps) <= 0.0).any() or (np.diff(t[np.isfinite(t)]) < 0).any():
        raise InvalidValueError(
            f"torques_from: times of {names} go back or repeat, so that they cannot be joined by "
            "time; cut the files there and give the parts as several files."
        )
    lost = np.flatnonzero(~good)
    if len(lost):
        refused.append(
            RefusedRows(second.path.name, tuple(lost.tolist()), "a number is missing or not finite")
        )
    found = np.full((N, tau.shape[1]), np.nan)
    step = float(np.median(np.diff(stamps)))
    after = np.searchsorted(stamps, t, side="left")
    inside = np.isfinite(t) & (t >= stamps[0]) & (t <= stamps[-1])
    high = np.clip(after, 1, len(stamps) - 1)
    exact = stamps[np.clip(after, 0, len(stamps) - 1)] == t
    near = inside & (exact | (stamps[high] - stamps[high - 1] <= _NEAR * step))
    if near.any():
        found[near] = splined(stamps, rows, t[near], second.path.name)
    notes.append(
        f"{names} were joined by time: torques by cubic splines at the times of the positions; "
        f"{int((~near).sum())} of {N} rows have no torque near in time."
    )
    return found
