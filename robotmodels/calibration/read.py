"""Measurements from text files: columns by name or number, units by argument, never guessed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array
from ..csv_table import Column, CsvTable, open_table, stacked_columns
from ..errors import InvalidValueError
from ..file_units import AngleUnit, LengthUnit, as_file_unit
from ..geometry import REVOLUTE
from ..kinematics import OrientationKind, dgm, pose_from_coordinates
from ..kinematics.coordinates.kinds import orientation_kind
from ..model import RobotModel, check_model
from .expected_joints import expected_joints_text
from .extended_table import Frame
from .file_kinds import CONTACTS, FileKind, as_file_kind
from .files_read import check_columns, check_contents, rows_read
from .length_units import unit_error_of_positions, unit_error_of_spread
from .measurements import Distance, Measurement, Pose, Position, RelativePose
from .measurements.measurement import of_files

_POSITION_NAMES = ("x", "y", "z")
_QUATERNION_NAMES = ("qw", "qx", "qy", "qz")
_DIGITS = 1e-3
"""How far from 1 the length of a quaternion of few digits may be."""
_TURNS = 30.0
_TURN = 2.0 * np.pi


def read_measurements(
    path: str | Path | Iterable[str | Path],
    kind: Any,
    model: RobotModel,
    *,
    joints: Sequence[Column] | None = None,
    columns: Sequence[Column] | None = None,
    label: Column | None = None,
    other_joints: Sequence[Column] | None = None,
    lengths: LengthUnit | str = "m",
    angles: AngleUnit | str = "rad",
    joint_angles: AngleUnit | str | None = None,
    orientation: OrientationKind | str | None = None,
    rows: Sequence[int] | None = None,
    pattern: str = "*.csv",
    delimiter: str | None = None,
    sigma: ArrayLike | None = None,
    frame: Frame = None,
    name: str | None = None,
) -> Measurement:
    r"""Read measurements of one kind from one or more text files (CSV), a row each.

    Lines that begin with ``#`` are comments. A first line of words is a header; the columns are
    then found by the names below, or by those given. Without a header they are given by number,
    from 0, unless the file holds the readings of the joints and nothing else.

    Parameters
    ----------
    path : str, Path or iterable of them
        A file, several, or a folder, whose files that fit ``pattern`` are read in the order of
        their names. The rows of several files follow each other.
    kind : FileKind, str or class
        ``"position"``, ``"pose"``, ``"orientation"``, ``"distance"``, ``"point_contact"``,
        ``"frame_contact"``, ``"plane_contact"``, ``"relative_pose"``.
    model : RobotModel
        The robot: names, number and types of its joints.
    joints : sequence of str or int, length n, optional
        Columns of the readings; default those named as the joints of the robot, or q1 to qn.
    columns : sequence of str or int, optional
        Columns of what was measured, in the order of its coordinates: position, then orientation
        as ``orientation`` orders it (a quaternion scalar first). Default x, y, z and the names of
        the orientation's coordinates (for quaternions also qw, qx, qy, qz); ``distance`` for
        distances. Contacts have none.
    label : str or int, optional
        Contacts: column that says which point, pose or plane each row touches; distances from a
        pivot: which pivot. Default: the names of the files without their suffix where there are
        several; else all the same.
    other_joints : sequence of str or int, length n, optional
        Columns of the readings at the other end of a distance (without them it is from a pivot),
        or of a relative pose.
    lengths : ``"m"`` or ``"mm"``
        Unit of positions, distances and the readings of prismatic joints in the file.
    angles, joint_angles : ``"rad"`` or ``"deg"``
        Unit of the angles in the file; of the readings of revolute joints, if another.
    orientation : OrientationKind or str, optional
        How orientations are written; needed where some are. ``"rpy_urdf"`` is Rot(z) Rot(y) Rot(x)
        listed x, y, z; ``"rpy"`` the same listed z, y, x; ``"quaternion"``; ``"angle_axis"``.
    rows : sequence of 0 or 1, optional
        As `Position` and `Pose`: which coordinates count. All columns are read.
    pattern : str
        Of the files in a folder.
    delimiter : str, optional
        Between cells; default the first of semicolon, tab, comma in the first line, else blanks.
    sigma : array_like, optional
        Standard deviations of the rows of a measurement, in metres and radians.
    frame : str, int or None
        The measured end; None is the tool.
    name : str, optional
        In reports, and in front of labels; default the folder's name, or as the kind.

    Returns
    -------
    Measurement
        Metres and radians; ``files`` lists what was read.

    Raises
    ------
    InvalidValueError
        Columns that are not there; a cell that is empty or no finite number, with its line; units
        that cannot be right; files of a folder that do not hold the same.
    OSError
        A file cannot be opened.

    References
    ----------
    Seed book sections 1.4.4 and 1.4.5.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from robotmodels.robots import load
    >>> text = "joint_1,joint_2,x,y,z\n0,90,200,300,0\n45,30,250,400,0\n"
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "tracker.csv"
    ...     _ = file.write_text(text)
    ...     read_measurements(file, "position", load("planar_2r"), lengths="mm", angles="deg").p[0]
    array([0.2, 0.3, 0. ])
    """
    check_model(model)
    kind = as_file_kind(kind)
    _check_arguments(kind, label, other_joints, rows)
    length = as_file_unit(LengthUnit, lengths, "lengths")
    angle = as_file_unit(AngleUnit, angles, "angles")
    turn = angle if joint_angles is None else as_file_unit(AngleUnit, joint_angles, "joint_angles")
    files, folder = _files(path, pattern)
    tables = [open_table(file, delimiter) for file in files]
    written = None if orientation is None else orientation_kind(orientation)
    needs = _needed(kind, written, columns)

    if folder is not None:
        check_columns(tables)
    counts: list[int] = []

    def readings(given: Sequence[Column] | None, what: str) -> Array:
        found = [_joint_columns(t, model, given, what, alone=not needs) for t in tables]
        parts = [t.numbers(c) for t, c in zip(tables, found, strict=True)]
        counts[:] = [len(part) for part in parts]
        q = np.concatenate(parts)
        revolute = model.table.sigma[model.table.joint_rows] == REVOLUTE
        _check_turns(q[:, revolute], turn, files[0], "joint_angles" if joint_angles else "angles")
        return q * np.where(revolute, turn.factor, length.factor)

    q = readings(joints, "joints")
    if len(tables) > 1:
        check_contents(tables, np.split(q, np.cumsum(counts)[:-1]), model, frame)
    found = [_measured_columns(t, needs, columns) for t in tables]
    values = stacked_columns(tables, found) if needs else np.zeros((len(q), 0))
    more: dict[str, Any] = {"sigma": sigma, "frame": frame}
    called = name or (folder.resolve().name if folder is not None else None)
    if called is not None:
        more["name"] = called

    def measurement() -> Measurement:
        if kind is FileKind.POSITION:
            p = length.factor * values
            _check_lengths(p, q, model, length, files[0], frame)
            return Position(q, p, (1, 1, 1) if rows is None else rows, **more)
        if written is not None and kind.has_orientation:
            T = _poses(kind, written, values, length, angle, files[0])
            if kind is FileKind.RELATIVE_POSE:
                other = readings(other_joints, "other_joints")
                return RelativePose(q, other, T, (1,) * 6 if rows is None else rows, **more)
            if kind is FileKind.ORIENTATION:
                more.setdefault("name", "orientation")
                return Pose(q, T, (0, 0, 0, 1, 1, 1) if rows is None else rows, **more)
            _check_lengths(T[:, :3, 3], q, model, length, files[0], frame)
            return Pose(q, T, (1,) * 6 if rows is None else rows, **more)
        if kind is FileKind.DISTANCE:
            measured = length.factor * values[:, 0]
            if other_joints is not None:
                return Distance(q, measured, readings(other_joints, "other_joints"), **more)
            return Distance(q, measured, pivot=_labels(tables, label, q), **more)
        return CONTACTS[kind](q, _labels(tables, label, q), **more)

    return of_files(measurement(), rows_read(tables, counts))


def _check_arguments(
    kind: FileKind, label: Column | None, other_joints: Sequence[Column] | None,
    rows: Sequence[int] | None,
) -> None:  # fmt: skip
    """Refuse arguments that say nothing about a kind."""
    word = kind.name.lower()
    if label is not None and (
        not (kind.is_contact or kind is FileKind.DISTANCE) or other_joints is not None
    ):
        raise InvalidValueError(f"label: {word} has no labels here; leave it out.")
    if other_joints is not None and kind not in (FileKind.DISTANCE, FileKind.RELATIVE_POSE):
        raise InvalidValueError(f"other_joints: {word} has one end; leave them out.")
    if rows is not None and not (kind.has_orientation or kind is FileKind.POSITION):
        raise InvalidValueError(f"rows: {word} has no rows to choose; leave them out.")


def _files(
    path: str | Path | Iterable[str | Path], pattern: str
) -> tuple[tuple[Path, ...], Path | None]:
    """Files to be read, and their folder if that was given."""
    if not isinstance(path, str | Path):
        files = tuple(Path(each) for each in path)
        if not files:
            raise InvalidValueError("path: expected a file, a folder or several files, got none.")
        return files, None
    path = Path(path)
    if not path.is_dir():
        return (path,), None
    found = tuple(sorted(path.glob(pattern)))
    if not found:
        raise InvalidValueError(
            f"path: the folder {path} has no file {pattern!r}; say which in pattern."
        )
    return found, path


def _needed(
    kind: FileKind, written: OrientationKind | None, columns: Sequence[Column] | None
) -> tuple[tuple[str, ...], ...]:
    """Names of the measured columns, in one or more spellings; none for contacts."""
    if kind.is_contact:
        if columns is not None:
            raise InvalidValueError("columns: a contact measures nothing; see label.")
        return ()
    if kind is FileKind.POSITION:
        return (_POSITION_NAMES,)
    if kind is FileKind.DISTANCE:
        return (("distance",), ("length",))
    if written is None:
        raise InvalidValueError(
            "orientation: say how orientations are written: 'rpy_urdf' (turns about x, y, z in "
            "this order of columns), 'rpy' (about z, y, x), 'quaternion' (scalar first), "
            "'angle_axis' or another of OrientationKind."
        )
    own = [written.labels[3:]]
    if written is OrientationKind.QUATERNION:
        own.append(_QUATERNION_NAMES)
    return tuple(tuple(o) if kind is FileKind.ORIENTATION else (*_POSITION_NAMES, *o) for o in own)


def _joint_columns(
    table: CsvTable, model: RobotModel, given: Sequence[Column] | None, what: str, alone: bool
) -> tuple[int, ...]:
    n = model.n
    if given is not None:
        if isinstance(given, str) or len(given) != n:
            raise InvalidValueError(
                f"{what}: expected a column for each of the {n} joints, got {given!r:.80}."
                f"{expected_joints_text(model)}"
            )
        return tuple(table.number(column, what) for column in given)
    names = model.table.joint_names
    advice = f"Give them as {what}=[...], a name or number (from 0) for each of the {n} joints."
    advice += expected_joints_text(model)
    if what == "other_joints":
        raise InvalidValueError(f"other_joints: two ends need two readings. {advice}")
    if table.names:
        numbered = [f"q{j + 1}" for j in range(n)]
        found = table.find(names)
        found = table.find(numbered) if found is None else found
        if found is None:
            raise InvalidValueError(
                f"{table.path}: the header has neither the joints of {model.name} "
                f"({', '.join(names)}) nor q1 to q{n}; it has {', '.join(table.names)}. {advice}"
            )
        return found
    if alone and table.width == n:
        return tuple(range(n))
    raise InvalidValueError(
        f"{table.path}: no header says which of its {table.width} columns are the joints. {advice}"
    )


def _measured_columns(
    table: CsvTable, needs: Sequence[Sequence[str]], given: Sequence[Column] | None
) -> tuple[int, ...]:
    if not needs:
        return ()
    count = len(needs[0])
    if given is not None:
        if isinstance(given, str) or len(given) != count:
            raise InvalidValueError(
                f"columns: expected {count} columns ({', '.join(needs[0])}), got {given!r:.80}."
            )
        return tuple(table.number(column, "columns") for column in given)
    for names in needs:
        found = table.find(names)
        if found is not None:
            return found
    wanted = " or ".join(", ".join(names) for names in needs)
    has = f"the header is {', '.join(table.names)}" if table.names else "there is no header"
    raise InvalidValueError(
        f"{table.path}: expected columns {wanted}; {has}. Give them as columns=[...], a name or "
        "number (from 0) for each."
    )


def _labels(tables: Sequence[CsvTable], label: Column | None, q: Array) -> tuple[str, ...]:
    if label is not None:
        return tuple(x for table in tables for x in table.labels(table.number(label, "label")))
    if len(tables) == 1:
        return ("0",) * len(q)
    stems = [table.path.stem for table in tables]
    if len(set(stems)) < len(stems):
        # the same name in several folders: these are different points
        stems = [f"{table.path.parent.name}/{table.path.stem}" for table in tables]
    counts = [len(table.numbers([0])) for table in tables]
    return tuple(stem for stem, count in zip(stems, counts, strict=True) for _ in range(count))


def _poses(
    kind: FileKind, written: OrientationKind, values: Array, length: LengthUnit, angle: AngleUnit,
    file: Path,
) -> Array:  # fmt: skip
    turned_only = kind is FileKind.ORIENTATION
    p = np.zeros((len(values), 3)) if turned_only else length.factor * values[:, :3]
    o = values if turned_only else values[:, 3:]
    if written is OrientationKind.QUATERNION:
        size = np.sqrt(np.minimum(np.abs(o), 1e9) ** 2 @ np.ones(o.shape[1]))
        wrong = np.flatnonzero(abs(size - 1.0) > _DIGITS)
        if len(wrong):
            raise InvalidValueError(
                f"{file}: the quaternion of row {wrong[0] + 1} has length {size[wrong[0]]:.4g}; "
                "expected 1. See whether columns names the right ones, the scalar first."
            )
        o = o / size[:, None]
    elif written not in (OrientationKind.DIRECTION_COSINES, OrientationKind.TWO_AXES):
        _check_turns(o, angle, file, "angles")
        o = angle.factor * o
    return se3.as_pose(pose_from_coordinates(np.hstack([p, o]), written), "columns")


def _check_turns(values: Array, unit: AngleUnit, file: Path, argument: str) -> None:
    largest = float(np.abs(values).max(initial=0.0))
    if unit is AngleUnit.RADIAN and largest > _TURNS:
        raise InvalidValueError(
            f"{file}: an angle of {largest:.4g} rad; these look like degrees. Say {argument}='deg'."
        )
    if unit is AngleUnit.DEGREE and values.size and largest <= _TURN and np.ptp(values) > 1.0:
        raise InvalidValueError(
            f"{file}: no angle is larger than {largest:.4g} deg; these look like radians. Say "
            f"{argument}='rad'."
        )


def _check_lengths(
    p: Array, q: Array, model: RobotModel, unit: LengthUnit, file: Path, frame: Frame
) -> None:
    # squares of what is farther apart than this are no numbers
    nominal, p = dgm(model, np.clip(q, -1e3, 1e3), frame)[:, :3, 3], np.clip(p, -1e150, 1e150)
    spread = float(np.linalg.norm(np.ptp(p, axis=0)))
    slip = unit_error_of_positions(nominal, p) or unit_error_of_spread(model, frame, spread)
    if slip is None:
        return
    stated = "metres" if unit is LengthUnit.METRE else "millimetres"
    symbol = {"metres": "m", "millimetres": "mm"}.get(slip.unit)
    advice = f"Multiply them by {slip.factor:.4g}."
    if symbol and slip.taken == stated:
        advice = f"Say lengths={symbol!r}."
    raise InvalidValueError(f"{file}: positions are {slip.sentence(stated)}. {advice}")
