"""Reader of log files: columns by name or number, units by argument, notes on omissions."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_floats, as_number
from ..csv_table import Column
from ..drive import Transmission
from ..errors import InvalidValueError
from ..file_units import AngleUnit, LengthUnit, TimeUnit, as_file_unit
from ..geometry import PRISMATIC
from ..model import RobotModel, check_model
from .columns import Quantity, Request, read_samples
from .log import Log, LogSource, join_logs
from .tables import Choice, LogTable, open_log_table, table_of
from .time_base import regular_rows

Source = str | Path | Mapping[str, Any]
_SHORTEST, _LONGEST = 1e-6, 10.0  # sampling periods of files, s


def read_log(
    path: Source | Iterable[Source],
    *,
    torques_from: Source | Iterable[Source] | None = None,
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
    largest_gap: float | None = None,
    largest_jitter: float = 0.5,
    delimiter: str | None = None,
) -> Log:
    r"""Read positions and torques of joints from CSV, NPZ, Parquet, MAT, ROS tables or arrays.

    Columns are given by name, by number (from 0), as the name of a matrix, or by a pattern
    (``"pos_*"``). Those that are not given are found by the usual names (q1 to qn, tau1 to taun,
    position, effort, ...), which a note states. Of ROS: the output of ``rostopic echo -p``,
    PlotJuggler's CSV, and tables of joint states with lists in cells or numbered columns.

    From the file's columns c to the joints: ``q = K (s u c) + q_0 + offsets`` and
    ``tau = K^-T (s g c)`` with signs s, unit u, drive gains g, and K of gears (``1 / gears``) or
    of the transmission.

    Parameters
    ----------
    path : str, Path, mapping of columns, or iterable of these
        One file (or dictionary of arrays, or data frame) or several, each of which is a recording
        of its own. ``.npz``, ``.parquet`` and ``.mat`` files are read as such, others as text.
    torques_from : same as path, optional
        Files of the torques, one for each of ``path``: joined by time (cubic splines between the
        rows) where both have times, by row otherwise.
    positions, torques : column, name, pattern or sequence of columns, optional
        Of each joint.
    velocities, accelerations, position_references, velocity_references : same, or False, optional
        Where the file has them; False leaves them out.
    time : column, two columns (seconds, nanoseconds) or False, optional
        Default found by the usual names; False: none, rows are ``dt`` apart.
    dt : float, optional
        Sampling period, s; needed without times. With times the log is interpolated to it; it may
        be at most 1.5 times the file's, since decimation needs a filter.
    times : TimeUnit or {"s", "ms", "us", "ns"}, optional
        Default the unit of the header, or seconds.
    angles, lengths : {"rad", "deg"}, {"m", "mm"}
        Unit of positions and their derivatives, and that of prismatic joints of the model; motors
        have angles.
    signs : array_like, shape (n,), optional
        1 or -1, for positions and torques.
    gears : float or array_like, shape (n,), optional
        Turns of the motor for one of the joint, where the file has motor angles and torques.
    transmission : Transmission, optional
        The same with couplings, such as ``model.transmission``.
    drive_gains : float or array_like, shape (n,), optional
        N m of torque for one unit of the torque columns (motor side where there are gears); needed
        for columns found as currents.
    offsets : float or array_like, shape (n,), optional
        Added to positions, rad or m of the joints.
    joints : sequence of str, optional
        Names of the joints, in order; default the model's, or those of the file.
    model : RobotModel, optional
        Gives the number of joints, their names and kinds.
    largest_gap, largest_jitter : float, optional
        In periods: samples missing in shorter gaps are interpolated, longer gaps split the log
        (default a tenth of the shortest period of the motion); larger deviations of the
        differences of stamps are an error.
    delimiter : str, optional
        Delimiter of text files; default detected.

    Returns
    -------
    Log
        Joint side, rad or m, N m or N. `Log.refused` lists the rows left out, `Log.notes` the
        columns found and the corrections, `Log.sources` the files and their SHA-256.

    Raises
    ------
    InvalidValueError, ShapeError
        Columns that are missing or ambiguous, cells that are not numbers (with line), a time base
        that cannot be made regular, units that are not known, arguments that contradict each other.
    FileNotFoundError
        There is no such file; it is an InvalidValueError too.
    MissingExtraError
        Parquet without pyarrow, MAT of version 7.3 without h5py.

    References
    ----------
    Book section 1.6.2.5.

    Examples
    --------
    >>> columns = {"t": [0.0, 0.01, 0.02], "q1": [0.0, 90.0, 180.0], "tau1": [1.0, 1.0, 2.0]}
    >>> log = read_log(columns, angles="deg", gears=2.0)
    >>> log.q.ravel().round(4), log.tau.ravel(), round(log.dt, 9)
    (array([0.    , 0.7854, 1.5708]), array([2., 2., 4.]), 0.01)
    """
    if model is not None:
        check_model(model)
    files = _sources(path, "path")
    others: Sequence[Any] = [None] * len(files)
    if torques_from is not None:
        others = _sources(torques_from, "torques_from")
    if len(others) != len(files):
        raise InvalidValueError(
            f"torques_from: expected a file for each of the {len(files)} of path, got "
            f"{len(others)}."
        )
    dt = None if dt is None else as_number(dt, "dt", above=0.0)
    angle = as_file_unit(AngleUnit, angles, "angles")
    length = as_file_unit(LengthUnit, lengths, "lengths")
    unit = None if times is None else as_file_unit(TimeUnit, times, "times")
    names = None if joints is None else tuple(map(str, joints))
    if names is None and model is not None:
        names = model.table.joint_names
    choices = {
        Quantity.POSITION: positions,
        Quantity.TORQUE: torques,
        Quantity.VELOCITY: velocities,
        Quantity.ACCELERATION: accelerations,
        Quantity.POSITION_REFERENCE: position_references,
        Quantity.VELOCITY_REFERENCE: velocity_references,
    }
    request = Request(choices, names, time, unit, angle, drive_gains is not None)
    motors = gears is not None or transmission is not None
    logs = []
    for each in zip(files, others, strict=True):
        table = _table(each[0], delimiter)
        raw = read_samples(table, None if each[1] is None else _table(each[1], delimiter), request)
        n = raw.blocks[Quantity.POSITION].shape[1]
        units = np.full(n, angle.factor)
        if model is not None and not motors:
            units[model.table.sigma[model.table.joint_rows] == PRISMATIC] = length.factor
        of_q, of_tau, offset = joint_side(units, signs, gears, transmission, drive_gains, offsets)
        columns, name = np.concatenate(list(raw.blocks.values()), axis=1), table.path.name
        if raw.t is None and dt is None:
            raise InvalidValueError(
                f"{name}: no column of times was given or found; give dt=, the sampling period in "
                f"seconds, or time=, the column. Its columns: {table.called(range(table.width))}."
            )
        rows = regular_rows(raw.t, columns, name, dt, largest_gap, largest_jitter, n)
        if raw.t is not None and not _SHORTEST <= rows.dt <= _LONGEST:
            raise InvalidValueError(
                f"{table.path}: rows would be {rows.dt:.4g} s apart; give times='ms', 'us' or 'ns' "
                "if the column of times is not in seconds."
            )
        arrays: dict[str, Any] = {}
        blocks = np.split(rows.values, len(raw.blocks), axis=1)
        with np.errstate(over="ignore", invalid="ignore"):  # Log raises for infinite numbers
            for quantity, block in zip(raw.blocks, blocks, strict=True):
                values = block @ (of_tau if quantity is Quantity.TORQUE else of_q)
                moved = quantity in (Quantity.POSITION, Quantity.POSITION_REFERENCE)
                arrays[quantity.field] = values + offset if moved else values
        notes = [*raw.notes, *rows.notes]
        K = None if model is None or motors else model.transmission
        if K is not None and not K.is_mimicry:
            notes.append(
                "The model has a transmission, but positions and torques were read as those of "
                "the joints; give transmission=model.transmission if they are those of the motors."
            )
        sources = [_source(one, columns, len(rows.values)) for one in each if one is not None]
        more = {"sources": sources, "refused": rows.refused, "notes": notes}
        logs.append(Log(rows.dt, **arrays, starts=rows.starts, names=raw.names, **more))
    return logs[0] if len(logs) == 1 else join_logs(logs)


def _sources(given: Any, what: str) -> tuple[Source, ...]:
    one = isinstance(given, str | Path | Mapping) or hasattr(given, "columns")
    sources: Any = [given] if one else given
    if not (files := tuple(sources)):
        raise InvalidValueError(f"{what}: expected a file or several, got none.")
    return files


def _table(source: Source, delimiter: str | None) -> LogTable:
    if isinstance(source, str | Path):
        return open_log_table(Path(source), delimiter)
    return table_of(Path("arrays"), {str(name): source[name] for name in source})


def _source(given: Source, values: np.ndarray, rows: int) -> LogSource:
    """A source with the SHA-256 of its file, or of the samples that a mapping gave."""
    if not isinstance(given, str | Path):
        return LogSource("arrays", hashlib.sha256(values.tobytes()).hexdigest(), rows)
    with Path(given).open("rb") as stream:
        return LogSource(Path(given).name, hashlib.file_digest(stream, "sha256").hexdigest(), rows)


def joint_side(
    units: Array,
    signs: ArrayLike | None,
    gears: ArrayLike | None,
    transmission: Transmission | None,
    drive_gains: ArrayLike | None,
    offsets: ArrayLike | None,
) -> tuple[Array, Array, Array]:
    """Matrices (n, n) from the columns of positions and torques to the joints, and an offset."""
    n = len(units)
    sign = _each(signs, n, "signs", 1.0)
    if (np.abs(sign) != 1.0).any():
        raise InvalidValueError(f"signs: expected 1 or -1 for each of the {n} joints, got {signs}.")
    gain = sign * _each(drive_gains, n, "drive_gains", 1.0)
    ratio = _each(gears, n, "gears", 1.0)
    for name, value in (("drive_gains", gain), ("gears", ratio)):
        if not value.all():
            raise InvalidValueError(f"{name}: expected numbers other than zero.")
    K, zero = np.diag(1.0 / ratio), np.zeros(n)
    if transmission is not None:
        if gears is not None or transmission.n != n or not transmission.is_invertible:
            raise InvalidValueError(
                "gears, transmission: expected one of them, and a transmission that can be "
                f"inverted, of the {n} joints of the log; it includes the gear ratios."
            )
        K, zero = transmission.matrix, transmission.offset
    offset = zero + _each(offsets, n, "offsets", 0.0)
    return (sign * units)[:, None] * K.T, gain[:, None] * np.linalg.inv(K), offset


def _each(value: ArrayLike | None, n: int, name: str, default: float) -> Array:
    array = as_floats(default if value is None else value, name)
    return np.full(n, float(array)) if array.ndim == 0 else as_exact(array, (n,), name)
