"""Logs from files: columns by name or number, units by argument, all that is left out said."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_floats
from .._choices import chosen
from ..csv_table import Column
from ..drive import Transmission
from ..errors import InvalidValueError, ShapeError
from ..file_units import AngleUnit, LengthUnit, TimeUnit, as_file_unit
from ..model import RobotModel, check_model
from .finding_columns import (
    Quantity,
    angle_unit_of,
    find_quantity,
    find_time,
    joints_of,
    time_unit_of,
)
from .formats import open_log_table
from .joining import join_logs
from .log import Log, LogSource, RefusedRows
from .table import LogFormat, LogTable
from .time_base import regular_rows
from .units import check_headers, joint_side

Paths = str | Path | Iterable[str | Path]
Choice = Column | Sequence[Column]
_SHORTEST, _LONGEST = 1e-6, 10.0
_NEAR = 1.5
_EXTRA: tuple[Quantity, ...] = (
    Quantity.VELOCITY,
    Quantity.ACCELERATION,
    Quantity.POSITION_REFERENCE,
    Quantity.VELOCITY_REFERENCE,
)
_Extras = dict[Quantity, Choice | Literal[False] | None]


def read_log(
    path: Paths,
    *,
    torques_from: Paths | None = None,
    positions: Choice | None = None,
    torques: Choice | None = None,
    velocities: Choice | Literal[False] | None = None,
    accelerations: Choice | Literal[False] | None = None,
    position_references: Choice | Literal[False] | None = None,
    velocity_references: Choice | Literal[False] | None = None,
    time: Column | Sequence[Column] | Literal[False] | None = None,
    dt: float | None = None,
    times: TimeUnit | str | None = None,
    angles: AngleUnit | str = "rad",
    lengths: LengthUnit | str = "m",
    signs: ArrayLike | None = None,
    gears: ArrayLike | None = None,
    transmission: Transmission | None = None,
    drive_gains: ArrayLike | None = None,
    offsets: ArrayLike | None = None,
    joints: Sequence[str] | None = None,
    model: RobotModel | None = None,
    largest_gap: float = 1.5,
    largest_jitter: float = 0.5,
    format: LogFormat | str | None = None,  # noqa: A002 - what it is called everywhere
    delimiter: str | None = None,
) -> Log:
    r"""Read positions and torques of joints from CSV, NPZ, Parquet, MAT or a table made by ROS.

    Columns are given by name, by number (from 0), as the name of a matrix, or by a pattern
    (``"pos_*"``). Those that are not given are found by the usual names (q1 to qn, tau1 to taun,
    position, effort, ...), which a note says. Understood of ROS are what ``rostopic echo -p``
    prints (``%time``, ``field.position0``), PlotJuggler's CSV
    (``/joint_states/joint_1/position``, ``/joint_states/position[0]``), and tables with
    ``header.stamp.secs``, ``header.stamp.nsecs``, ``name`` and lists in cells or numbered columns.

    From the file's columns c to the joints: ``q = K (s u c) + q_0 + offsets`` and
    ``tau = K^-T (s g c)`` with signs s, unit u, drive gains g, and K of gears (``1 / gears``) or
    of the transmission.

    Parameters
    ----------
    path : str, Path or iterable of these
        One file or several, each of which is a recording of its own: nothing is filtered over
        where one ends.
    torques_from : same as path, optional
        Files that have the torques, one for each of ``path``. With times in both they are joined
        by time (cubic splines between the rows), without by row.
    positions, torques : column, name, pattern or sequence of columns, optional
        Of each joint.
    velocities, accelerations, position_references, velocity_references : same, or False, optional
        Where the file has them; False leaves them out.
    time : column, two columns (seconds, nanoseconds) or False, optional
        Default found by the usual names; False: none, rows are ``dt`` apart.
    dt : float, optional
        Sampling period, s; needed without times. With times the log is interpolated to it.
    times : TimeUnit or {"s", "ms", "us", "ns"}, optional
        Default what the header says, seconds if nothing.
    angles : AngleUnit or {"rad", "deg"}
        Unit of positions and their derivatives.
    lengths : LengthUnit or {"m", "mm"}
        Of prismatic joints, as the model has them; with gears or a transmission motors turn, and
        the unit of all is ``angles``.
    signs : array_like, shape (n,), optional
        1 or -1: joints that the controller counts the other way, positions and torques.
    gears : float or array_like, shape (n,), optional
        The file has motor angles and motor torques: turns of the motor for one of the joint.
    transmission : Transmission, optional
        The same with couplings, such as ``model.transmission``.
    drive_gains : float or array_like, shape (n,), optional
        The torque columns are currents: N m of torque for one unit of the file (motor side where
        there are gears). Needed for columns found as currents.
    offsets : float or array_like, shape (n,), optional
        Added to positions, rad or m of the joints.
    joints : sequence of str, optional
        Names of the joints, in order; default the model's, or those of the file.
    model : RobotModel, optional
        Says how many joints there are, their names and kinds.
    largest_gap : float
        Periods; longer ones split the log.
    largest_jitter : float
        Periods; differences of stamps that are further off are an error.
    format : LogFormat or str, optional
        "csv", "npz", "parquet" or "mat"; default by the suffix.
    delimiter : str, optional
        Of text files; default found.

    Returns
    -------
    Log
        Joint side, rad or m, N m or N. `Log.refused` lists what was left out, `Log.notes` what was
        found and done, `Log.sources` files and their SHA-256.

    Raises
    ------
    InvalidValueError, ShapeError
        Columns that are missing or that several could be, cells that are no numbers (with line),
        a time base that cannot be made regular, arguments that contradict each other.
    MissingExtraError
        Parquet without pyarrow.

    References
    ----------
    Seed book section 1.6.2.5.

    Examples
    --------
    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "run.csv"
    >>> _ = file.write_text("t,q1,tau1\n0.00,0,1\n0.01,90,1\n0.02,180,2\n")
    >>> log = read_log(file, angles="deg", gears=2.0)
    >>> log.q.ravel().round(4), log.tau.ravel(), round(log.dt, 9)
    (array([0.    , 0.7854, 1.5708]), array([2., 2., 4.]), 0.01)
    """
    if model is not None:
        check_model(model)
    kind = None if format is None else chosen(LogFormat, format, "format")
    files = _files(path, "path")
    others = (None,) * len(files) if torques_from is None else _files(torques_from, "torques_from")
    if len(others) != len(files):
        raise InvalidValueError(
            f"torques_from: expected a file for each of the {len(files)} of path, got "
            f"{len(others)}."
        )
    if dt is not None and (as_floats(dt, "dt").ndim or not dt > 0.0):
        raise InvalidValueError(f"dt: expected the sampling period in seconds, got {dt!r:.60}.")
    angle = as_file_unit(AngleUnit, angles, "angles")
    length = as_file_unit(LengthUnit, lengths, "lengths")
    unit = None if times is None else as_file_unit(TimeUnit, times, "times")
    names = _names(joints, model)
    given = (velocities, accelerations, position_references, velocity_references)
    extras: _Extras = dict(zip(_EXTRA, given, strict=True))
    logs = []
    for file, other in zip(files, others, strict=True):
        table = open_log_table(file, kind, delimiter)
        second = None if other is None else open_log_table(other, kind, delimiter)
        raw = _raw(
            table, second, positions, torques, extras, names, time, unit, angle,
            drive_gains is not None,
        )  # fmt: skip
        n = raw.n
        side = joint_side(
            n, angles=angle, lengths=length, signs=signs, gears=gears, transmission=transmission,
            drive_gains=drive_gains, offsets=offsets, model=model,
        )  # fmt: skip
        rows = regular_rows(raw.t, raw.values, file.name, dt, largest_gap, largest_jitter)
        if raw.t is not None and not _SHORTEST <= rows.dt <= _LONGEST:
            raise InvalidValueError(
                f"{file}: rows would be {rows.dt:.4g} s apart; say times='ms', 'us' or 'ns' if "
                "the column of times is not in seconds."
            )
        blocks = {
            quantity: rows.values[:, n * k : n * (k + 1)] for k, quantity in enumerate(raw.order)
        }
        more: dict[str, Any] = {}
        for quantity, name in zip(_EXTRA, ("v", "a", "q_ref", "v_ref"), strict=True):
            if quantity in blocks:
                place = side.q if quantity is Quantity.POSITION_REFERENCE else side.rate
                more[name] = place(blocks[quantity])
        sources = [LogSource(file.name, _sha256(file), len(rows.values))]
        if other is not None:
            sources.append(LogSource(other.name, _sha256(other), len(rows.values)))
        notes = [*raw.notes, *rows.notes]
        if model is not None and gears is None and transmission is None:
            _say_transmission(model, notes)
        logs.append(
            Log(
                rows.dt, side.q(blocks[Quantity.POSITION]), side.tau(blocks[Quantity.TORQUE]),
                starts=rows.starts, names=names or raw.names, sources=sources,
                refused=[*raw.refused, *rows.refused], notes=notes, **more,
            )
        )  # fmt: skip
    return logs[0] if len(logs) == 1 else join_logs(logs)


@dataclass(frozen=True, slots=True, eq=False)
class _Raw:
    """Samples as the files have them, quantities beside each other."""

    t: Array | None
    values: Array
    order: tuple[Quantity, ...]
    n: int
    names: tuple[str, ...] | None
    refused: tuple[RefusedRows, ...]
    notes: tuple[str, ...]


def _raw(
    table: LogTable, second: LogTable | None, positions: Choice | None, torques: Choice | None,
    extras: _Extras, names: tuple[str, ...] | None,
    time: Column | Sequence[Column] | Literal[False] | None, unit: TimeUnit | None,
    angle: AngleUnit, currents: bool,
) -> _Raw:  # fmt: skip
    notes: list[str] = []
    t, t_columns = _time(table, time, unit, notes)
    where = _quantity(table, Quantity.POSITION, positions, names, notes, t_columns, second is None)
    n = len(where)
    check_headers([angle_unit_of(table.names[i]) for i in where if table.names], angle,
                  str(table.path))  # fmt: skip
    values = [table.read(where)]
    owners = [joints_of(table, Quantity.POSITION, where)]
    order = [Quantity.POSITION, Quantity.TORQUE]
    refused: list[RefusedRows] = []
    if second is None:
        taken = _torques(table, torques, names, notes, t_columns, currents, n, True)
        values.append(table.read(taken))
        owners.append(joints_of(table, Quantity.TORQUE, taken))
    else:
        t2, columns = _time(second, time, unit, notes)
        taken = _torques(second, torques, names, notes, columns, currents, n, False)
        tau = second.read(taken)
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
        check_headers([angle_unit_of(table.names[i]) for i in found if table.names], angle,
                      str(table.path))  # fmt: skip
        values.append(table.read(found))
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
    return _Raw(
        t, np.concatenate(values, axis=1), tuple(order), n, own, tuple(refused), tuple(notes)
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
    from scipy.interpolate import CubicSpline

    found = np.full((N, tau.shape[1]), np.nan)
    step = float(np.median(np.diff(stamps)))
    after = np.searchsorted(stamps, t, side="left")
    inside = np.isfinite(t) & (t >= stamps[0]) & (t <= stamps[-1])
    high = np.clip(after, 1, len(stamps) - 1)
    exact = stamps[np.clip(after, 0, len(stamps) - 1)] == t
    near = inside & (exact | (stamps[high] - stamps[high - 1] <= _NEAR * step))
    if near.any():
        found[near] = CubicSpline(stamps, rows)(t[near])
    notes.append(
        f"{names} were joined by time: torques by cubic splines at the times of the positions; "
        f"{int((~near).sum())} of {N} rows have no torque near in time."
    )
    return found


def _files(path: Paths, what: str) -> tuple[Path, ...]:
    files = (Path(path),) if isinstance(path, str | Path) else tuple(Path(each) for each in path)
    if not files:
        raise InvalidValueError(f"{what}: expected a file or several, got none.")
    for file in files:
        if file.is_dir():
            raise InvalidValueError(
                f"{what}: {file} is a folder; give its files, such as sorted(Path(...).glob("
                "'*.csv'))."
            )
    return files


def _names(joints: Sequence[str] | None, model: RobotModel | None) -> tuple[str, ...] | None:
    own = None if model is None else model.table.joint_names
    if joints is None:
        return own
    names = tuple(map(str, joints))
    if own is not None and len(names) != len(own):
        raise ShapeError(
            f"joints: {len(names)} names were given; the model has the {len(own)} joints "
            f"{', '.join(own)}."
        )
    return names


def _say_transmission(model: RobotModel, notes: list[str]) -> None:
    if model.transmission is not None and not model.transmission.is_mimicry:
        notes.append(
            f"{model.name} has a transmission, but positions and torques were read as those of "
            "the joints; say transmission=model.transmission if they are those of the motors."
        )


def _sha256(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
