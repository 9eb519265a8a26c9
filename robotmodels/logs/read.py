"""Logs from files: columns by name or number, units by argument, all that is left out said."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Literal

from numpy.typing import ArrayLike

from .._arrays import as_floats
from .._choices import chosen
from ..csv_table import Column
from ..drive import Transmission
from ..errors import InvalidValueError, ShapeError
from ..file_units import AngleUnit, LengthUnit, TimeUnit, as_file_unit
from ..model import RobotModel, check_model
from .finding_columns import (
    Quantity,
)
from .formats import open_log_table
from .joining import join_logs
from .log import Log, LogSource
from .raw_samples import EXTRA, Choice, Extras, raw_samples
from .table import LogFormat
from .time_base import regular_rows
from .units import joint_side

Paths = str | Path | Iterable[str | Path]
_SHORTEST, _LONGEST = 1e-6, 10.0


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
    largest_gap: float | None = None,
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
        Sampling period, s; needed without times. With times the log is interpolated to it, and it
        may be at most 1.5 times the file's: nothing is left out without a filter.
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
    largest_gap : float, optional
        Periods; samples missing in shorter gaps are interpolated, longer ones split the log.
        Default a tenth of the shortest period of the motion, that of the frequency below which
        velocities have 99.9 % of their power.
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
        a time base that cannot be made regular, units that are not understood, arguments that
        contradict each other.
    FileNotFoundError
        There is no such file; it is an InvalidValueError too.
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
    extras: Extras = dict(zip(EXTRA, given, strict=True))
    logs = []
    for file, other in zip(files, others, strict=True):
        table = open_log_table(file, kind, delimiter)
        second = None if other is None else open_log_table(other, kind, delimiter)
        raw = raw_samples(
            table, second, positions, torques, extras, names, time, unit, angle,
            drive_gains is not None,
        )  # fmt: skip
        n = raw.n
        side = joint_side(
            n, angles=angle, lengths=length, signs=signs, gears=gears, transmission=transmission,
            drive_gains=drive_gains, offsets=offsets, model=model,
        )  # fmt: skip
        rows = regular_rows(raw.t, raw.values, file.name, dt, largest_gap, largest_jitter, n)
        if raw.t is not None and not _SHORTEST <= rows.dt <= _LONGEST:
            raise InvalidValueError(
                f"{file}: rows would be {rows.dt:.4g} s apart; say times='ms', 'us' or 'ns' if "
                "the column of times is not in seconds."
            )
        blocks = {
            quantity: rows.values[:, n * k : n * (k + 1)] for k, quantity in enumerate(raw.order)
        }
        more: dict[str, Any] = {}
        for quantity, name in zip(EXTRA, ("v", "a", "q_ref", "v_ref"), strict=True):
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
