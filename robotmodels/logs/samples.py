"""Samples of one recording from the given or detected columns of one or two files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError, ShapeError
from ..file_units import AngleUnit, TimeUnit
from .columns import Quantity, check_units, find_quantity, find_time, joints_of, time_unit_of
from .tables import Choice, LogTable
from .time_base import splined

_NEAR = 1.5  # sampling periods: longest interpolated gap of the torques
Given = Choice | Literal[False] | None


@dataclass(frozen=True, slots=True)
class Request:
    """Arguments of `read_log` that choose columns and their units."""

    columns: Mapping[Quantity, Given]
    joints: tuple[str, ...] | None
    time: Given
    times: TimeUnit | None
    angle: AngleUnit
    gains: bool


@dataclass(slots=True, eq=False)
class Samples:
    """Samples of a file: times (N,), a block (N, n) of each quantity, and the names of joints."""

    t: Array | None
    blocks: dict[Quantity, Array] = field(default_factory=dict)
    names: tuple[str, ...] | None = None
    notes: list[str] = field(default_factory=list)


def read_samples(table: LogTable, second: LogTable | None, request: Request) -> Samples:
    """Samples of one file, or of one with positions and one with torques."""
    torque = Quantity.TORQUE
    kinds = [kind for kind in request.columns if second is None or kind is not torque]
    samples = _of_file(table, kinds, request, request.joints, second is not None)
    if second is not None:
        other = _of_file(second, [torque], request, request.joints or samples.names, True)
        files = f"{table.path.name} and {second.path.name}"
        samples.blocks[torque] = _joined(samples, other, files)
        samples.notes += other.notes
    n = samples.blocks[Quantity.POSITION].shape[1]
    lengths = set() if samples.t is None else {len(samples.t)}
    for kind, block in samples.blocks.items():
        lengths.add(len(block))
        if block.shape[1] != n:
            raise ShapeError(
                f"{kind.argument}: {block.shape[1]} columns of {table.path} for {n} columns of "
                f"positions; give {kind.argument}=[...]."
            )
    if len(lengths) > 1:
        raise InvalidValueError(
            f"{table.path}: the columns have {', '.join(map(str, sorted(lengths)))} samples; give "
            "times, positions and torques of one recording."
        )
    if request.joints is not None and len(request.joints) != n:
        raise ShapeError(
            f"positions: {n} columns of {table.path}, but {len(request.joints)} joints: "
            f"{', '.join(request.joints)}."
        )
    samples.names = request.joints or samples.names
    return samples


def _of_file(
    table: LogTable,
    kinds: list[Quantity],
    request: Request,
    wanted: tuple[str, ...] | None,
    alone: bool,
) -> Samples:
    """Quantities of a file, in the order of the wanted joints, else of those of the first one.

    ``alone``: the first one may be in all columns but those of time.
    """
    t, columns, notes = _times(table, request)
    taken = dict.fromkeys(columns, "time")
    samples = Samples(t, notes=notes)
    for kind in kinds:
        name, given = kind.argument, request.columns[kind] is not None
        chosen = _columns(table, kind, request)
        if chosen is None and alone and not samples.blocks:
            chosen = tuple(i for i in range(table.width) if i not in taken)
        needed = kind in (Quantity.POSITION, Quantity.TORQUE)
        if chosen is None and needed:
            raise InvalidValueError(
                f"{name}: no columns of {table.path} have a usual name, such as {kind.usual[0]}1; "
                f"give {name}=[...], names or numbers from 0, or a pattern. Its columns: "
                f"{table.called(range(table.width))}."
            )
        if chosen is None or (not needed and not given and taken.keys() & set(chosen)):
            continue
        if not given:
            where = f"were found in {table.called(chosen)}"
            notes.append(f"{table.path.name}: {name.replace('_', ' ')} {where}.")
        for i in chosen:
            if i in taken:
                raise InvalidValueError(
                    f"{name}: {table.called([i])} of {table.path} would be {taken[i]} and {name} "
                    f"at once; give {name}= and {taken[i]}= that differ."
                )
            taken[i] = name
        check_units(table, chosen, kind, request.angle, request.gains)
        names = joints_of(table, kind, chosen, request.joints)
        order = _wanted_columns(names, wanted or samples.names, table)
        if names and wanted and wanted != names and not samples.blocks:
            listed = f"{table.path.name}: its joints are {', '.join(names)}"
            notes.append(f"{listed}; they were taken as {', '.join(wanted)}, in this order.")
        samples.names = samples.names or names
        samples.blocks[kind] = table.read(chosen)[:, order]
    return samples


def _wanted_columns(
    names: tuple[str, ...] | None, wanted: tuple[str, ...] | None, table: LogTable
) -> slice | list[int]:
    """Numbers of the wanted joints among those that the file names."""
    if not names or not wanted or not set(names) & set(wanted):
        return slice(None)
    if not set(wanted) <= set(names):
        raise InvalidValueError(
            f"joints: expected {', '.join(wanted)}; {table.path.name}: its joints are "
            f"{', '.join(names)}. Give joints=."
        )
    return [names.index(name) for name in wanted]


def _columns(table: LogTable, kind: Quantity, request: Request) -> tuple[int, ...] | None:
    """Columns of a quantity that were given, or found by the usual names."""
    given = request.columns[kind]
    if given is False:
        return None
    if given is not None:
        return table.choice(given, kind.argument)
    columns = find_quantity(table, kind, request.joints)
    if columns is None and kind is Quantity.TORQUE:
        columns = find_quantity(table, Quantity.CURRENT, request.joints)
        if columns is not None and not request.gains:
            raise InvalidValueError(
                f"torques: {table.path} has currents ({table.called(columns)}); give drive_gains= "
                "(N m for one unit of them), or drive_gains=1 to read them unchanged."
            )
    return columns


def _times(table: LogTable, request: Request) -> tuple[Array | None, tuple[int, ...], list[str]]:
    """Seconds of each row, their columns, and a note if these were found."""
    given, unit = request.time, request.times
    detected = find_time(table) if given is None else None
    if detected is not None:
        columns, header = detected
    elif given is None or given is False:
        return None, (), []
    else:
        columns = table.choice(given, "time")
        header = time_unit_of(table.names[columns[0]]) if table.names else None
    if len(columns) > 2:
        raise InvalidValueError("time: expected one column, or two (seconds, nanoseconds).")
    if unit and header and header is not unit and len(columns) == 1:
        raise InvalidValueError(
            f"{table.path}: the header has times in {header.value!r}, the argument is "
            f"times={unit.value!r}; leave it out, or give the right column as time=."
        )
    used = unit or header or TimeUnit.SECOND
    reason = "the argument" if unit else "their names" if header else "default"
    where = f"{table.called(columns)}, {used.value} by {reason}"
    notes = [f"{table.path.name}: times were found in {where}."] if detected else []
    values = table.read(columns)
    if len(columns) == 1:
        return values[:, 0] * used.factor, columns, notes
    # seconds since 1970 and nanoseconds: differences keep their digits
    zero = np.nan_to_num(values[0, 0])
    return (values[:, 0] - zero) + 1e-9 * values[:, 1] + zero, columns, notes


def _joined(positions: Samples, other: Samples, files: str) -> Array:
    """Torques of another file at each row of positions; NaN where none is near in time."""
    t, stamps = positions.t, other.t
    tau = other.blocks[Quantity.TORQUE]
    N = len(positions.blocks[Quantity.POSITION])
    if t is None or stamps is None or np.array_equal(t, stamps, equal_nan=True):
        if len(tau) != N:
            raise ShapeError(
                f"torques_from: {files} have {N} and {len(tau)} rows; without times in both they "
                "must have as many."
            )
        return tau
    good = np.isfinite(stamps) & np.isfinite(tau).all(axis=1)
    stamps, tau = stamps[good], tau[good]
    steps = np.diff(stamps)
    if len(steps) == 0 or (steps <= 0.0).any() or (np.diff(t[np.isfinite(t)]) < 0.0).any():
        raise InvalidValueError(
            f"torques_from: times of {files} go back or repeat, so that they cannot be joined by "
            "time; cut the files there and give the parts as several files."
        )
    before = np.clip(np.searchsorted(stamps, t, side="right") - 1, 0, len(steps) - 1)
    near = (steps[before] <= _NEAR * np.median(steps)) | np.isin(t, stamps)
    near &= (t >= stamps[0]) & (t <= stamps[-1])
    torques = np.full((N, tau.shape[1]), np.nan)
    torques[near] = splined(stamps, tau, t[near], files)
    positions.notes.append(f"{files} were joined by time: torques by cubic splines.")
    return torques
