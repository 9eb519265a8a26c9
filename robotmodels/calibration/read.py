"""Measurements from text files: columns by name or number, units by argument, never guessed."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array
from ..csv_table import Column, CsvTable, open_table
from ..errors import InvalidValueError
from ..file_units import AngleUnit, LengthUnit, as_file_unit
from ..geometry import REVOLUTE
from ..kinematics import OrientationKind, pose_from_coordinates
from ..kinematics.coordinates.orientations import orientation_kind
from ..model import RobotModel, check_model
from .checks import beyond_limits, check_units
from .extended_table import Frame
from .measurements import FileRow, Measurement
from .measurements.base import fields_of, required
from .measurements.kinds import Kind, as_kind
from .problem import expected_joints_text

_QUATERNION_TOLERANCE = 1e-3  # largest deviation from 1 of the length of a quaternion of few digits
_LARGEST_ANGLE = 30.0  # largest plausible angle, rad; beyond it, degrees are assumed


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

    Lines that begin with ``#`` are comments; a first line of words is a header. Without one,
    columns are given by number, from 0, unless the file holds the readings of the joints alone.

    Parameters
    ----------
    path : str, Path or iterable of them
        A file, several, or a folder with files that fit ``pattern``, in the order of their names.
    kind : str or class
        Such as ``"position"``, ``"pose"``, ``"distance"``, ``"point_contact"``; or its class.
    model, sigma, frame
        See `robotmodels.calibration`; the model gives names, number and types of the joints.
    joints, other_joints : sequence of str or int, length n, optional
        Columns of the readings, default those named as the joints or q1 to qn; of the other end of
        a distance (without them it is from a pivot) or of a relative pose.
    columns : sequence of str or int, optional
        Columns of position, then orientation (a quaternion scalar first); default x, y, z and the
        names of the orientation's coordinates; ``distance``. Contacts have none.
    label : str or int, optional
        Column of the labels of targets; default the names of the files if there are several.
    lengths : ``"m"`` or ``"mm"``
        Unit of lengths in the file, also of the readings of prismatic joints.
    angles, joint_angles : ``"rad"`` or ``"deg"``
        Unit of the angles in the file; of the readings of revolute joints, if another.
    orientation : OrientationKind or str, optional
        How orientations are written; needed where some are. ``"rpy_urdf"`` is Rot(z) Rot(y) Rot(x)
        listed x, y, z; ``"rpy"`` the same listed z, y, x; ``"quaternion"``; ``"angle_axis"``.
    rows : sequence of 0 or 1, optional
        As `Position` and `Pose`: which coordinates count. All columns are read.
    pattern, delimiter : str
        Of the files in a folder; between cells, default the first of semicolon, tab, comma in the
        first line, else blanks.
    name : str, optional
        In reports, and in front of labels; default the folder's name, or as the kind.

    Returns
    -------
    Measurement
        Metres and radians; ``files`` lists the files and their rows.

    Raises
    ------
    InvalidValueError, OSError
        Missing columns; a cell that is no finite number, with its line; units that cannot be right.

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
    kind = as_kind(kind, among=is_readable)
    length = as_file_unit(LengthUnit, lengths, "lengths")
    angle = as_file_unit(AngleUnit, angles, "angles")
    turn = angle if joint_angles is None else as_file_unit(AngleUnit, joint_angles, "joint_angles")
    written = None if orientation is None else orientation_kind(orientation)
    needs = _needed(kind, written)
    for argument, value, is_used in (
        ("label", label, fields_of(kind, "label") and other_joints is None),
        ("other_joints", other_joints, len(fields_of(kind, "joints")) > 1),
        ("rows", rows, "rows" in (f.name for f in fields(kind))),
        ("columns", columns, needs),
    ):
        if value is not None and not is_used:
            raise InvalidValueError(f"{argument}: {kind.word} does not use it here; leave it out.")
    files, folder = _files(path, pattern)
    tables = [open_table(file, delimiter) for file in files]
    if folder is not None and len({(t.names, t.width) for t in tables}) > 1:
        listed = "; ".join(f"{t.path.name}: {', '.join(t.names) or t.width}" for t in tables)
        raise InvalidValueError(
            f"path: the files of {folder} do not have the same columns ({listed}). Select the "
            "files by pattern='*.csv', or name them."
        )
    revolute = model.table.sigma[model.table.joint_rows] == REVOLUTE

    names = model.table.joint_names
    spellings = [names, [f"q{j + 1}" for j in range(model.n)]]

    def readings(given: Sequence[Column] | None, what: str) -> list[Array]:
        if given is None and what == "other_joints":
            raise InvalidValueError("other_joints: two measured ends need the readings of both.")
        parts = []
        for t in tables:
            alone = not (t.names or needs or given) and t.width == model.n
            columns = range(model.n) if alone else given
            try:
                found = _columns(t, what, spellings, columns)
            except InvalidValueError as error:
                raise InvalidValueError(f"{error}{expected_joints_text(model)}") from None
            parts.append(t.numbers(found))
        units = "joint_angles" if joint_angles else "angles"
        _check_angles(np.concatenate(parts)[:, revolute], turn, files[0], units)
        return [part * np.where(revolute, turn.factor, length.factor) for part in parts]

    parts = readings(joints, "joints")
    q = np.concatenate(parts)
    if len(tables) > 1:
        _check_contents(tables, parts, model, frame)
    values = np.zeros((len(q), 0))
    if needs:
        values = np.concatenate([t.numbers(_columns(t, "columns", needs, columns)) for t in tables])
    given: dict[str, Any] = {"q": q, "sigma": sigma, "frame": frame}
    for f in fields(kind):
        content = f.metadata.get("content")
        if content == "joints" and f.name != "q":
            if other_joints is not None or "joints" in required(kind):
                given[f.name] = np.concatenate(readings(other_joints, "other_joints"))
        elif content == "point":
            given[f.name] = length.factor * values
        elif content == "length":
            given[f.name] = length.factor * values[:, 0]
        elif content == "pose" and written is not None:
            given[f.name] = _poses(written, values, length, angle, files[0])
        elif content == "label" and other_joints is None:
            given[f.name] = _labels(tables, label, parts)
    if rows is not None:
        given["rows"] = rows
    if name or folder is not None:
        given["name"] = name or Path(folder or "").resolve().name
    origin = [
        FileRow(f"{t.path.resolve().parent.name}/{t.path.name}", k + 1)
        for t, part in zip(tables, parts, strict=True)
        for k in range(len(part))
    ]
    measurement = kind(**given, origin=tuple(origin))
    try:
        check_units(model, [measurement])
    except InvalidValueError as error:
        text, other = str(error), LengthUnit.METRE
        if length is LengthUnit.METRE:
            other = LengthUnit.MILLIMETRE
        if re.search(f"(look like|as if) {other.name.lower()}s", text):
            text = f"{text.partition(' Pass metres')[0]} Use lengths={other.value!r}."
        raise InvalidValueError(f"{files[0]}: {text}") from None
    return measurement


def is_readable(kind: Kind) -> bool:
    """Whether files can hold all that a kind needs."""
    contents = {"joints", "pose", "point", "length", "label"}
    return bool(fields_of(kind, "joints")) and required(kind) <= contents


def _pose_parts(kind: Kind) -> tuple[bool, bool]:
    """Whether a kind measures a position and an orientation of a pose, by default."""
    rows: Any = next((f.default for f in fields(kind) if f.name == "rows"), ())
    has_pose = bool(fields_of(kind, "pose"))
    return has_pose and any(rows[:3]), has_pose and any(rows[3:])


def _needed(kind: Kind, written: OrientationKind | None) -> list[tuple[str, ...]]:
    """Names of the measured columns, in one or more spellings; none for contacts."""
    for f in fields_of(kind, "length"):
        return [(name,) for name in f.metadata["names"]]
    has_position, has_orientation = _pose_parts(kind)
    position = ("x", "y", "z") if has_position or fields_of(kind, "point") else ()
    if not has_orientation:
        return [position] if position else []
    if written is None:
        raise InvalidValueError(
            "orientation: expected 'rpy_urdf' (angles about x, y, z in this order of columns), "
            "'rpy' (about z, y, x), 'quaternion' (scalar first), 'angle_axis' or another of "
            "OrientationKind."
        )
    names = [tuple(written.labels[3:])]
    if written is OrientationKind.QUATERNION:
        names.append(("qw", "qx", "qy", "qz"))
    return [(*position, *each) for each in names]


# --- files and columns ----------------------------------------------------------------------------


def _files(path: str | Path | Iterable[str | Path], pattern: str) -> tuple[list[Path], Path | None]:
    """Files to be read, and their folder if that was given."""
    folder = Path(path) if isinstance(path, str | Path) and Path(path).is_dir() else None
    if folder is not None:
        files, error = sorted(folder.glob(pattern)), f"the folder {folder} has no file {pattern!r}"
    else:
        files = [Path(each) for each in ([path] if isinstance(path, str | Path) else path)]
        error = "expected a file, a folder or several files, got none"
    if not files:
        raise InvalidValueError(f"path: {error}.")
    return files, folder


def _columns(
    table: CsvTable, what: str, spellings: Sequence[Sequence[str]], given: Sequence[Column] | None
) -> tuple[int, ...]:
    """Columns that are given, or those of the first spelling that the header has."""
    count = len(spellings[0])
    if given is not None:
        if isinstance(given, str) or len(given) != count:
            raise InvalidValueError(
                f"{what}: expected {count} columns ({', '.join(spellings[0])}), got {given!r:.80}."
            )
        return tuple(table.number(column, what) for column in given)
    for found in map(table.find, spellings):
        if found is not None:
            return found
    wanted = " or ".join(", ".join(names) for names in spellings)
    has = f"the header is {', '.join(table.names)}" if table.names else "the file has no header"
    raise InvalidValueError(
        f"{table.path}: expected columns {wanted}; {has}. Give them as {what}=[...], a name or "
        "number (from 0) for each."
    )


def _labels(
    tables: Sequence[CsvTable], label: Column | None, parts: Sequence[Array]
) -> tuple[str, ...]:
    if label is not None:
        return tuple(x for table in tables for x in table.labels(table.number(label, "label")))
    stems = [table.path.stem if len(tables) > 1 else "0" for table in tables]
    if len(set(stems)) < len(stems):
        # files of the same name in several folders are different targets
        stems = [f"{table.path.parent.name}/{table.path.stem}" for table in tables]
    return tuple(stem for stem, part in zip(stems, parts, strict=True) for _ in part)


# --- plausibility ---------------------------------------------------------------------------------


def _check_contents(
    tables: Sequence[CsvTable], readings: Sequence[Array], model: RobotModel, frame: Frame
) -> None:
    """Refuse files whose columns are not joint readings. Shapes: readings (N, n)."""
    rows = set(model.twin.frame(frame).path.tolist())
    checked = [
        (t.path.name, *beyond_limits(model, q, rows)) for t, q in zip(tables, readings, strict=True)
    ]
    other = [
        f"{name} (beyond limits: {sentences[0]})" for name, sentences, refused in checked if refused
    ]
    if other and len(other) < len(tables):
        raise InvalidValueError(
            f"path: among {', '.join(t.path.name for t in tables)}, these are not readings of the "
            f"joints of {model.name}: {'; '.join(other)}. Select the files by pattern='*.csv', or "
            "name them."
        )


def _poses(
    written: OrientationKind, values: Array, length: LengthUnit, angle: AngleUnit, file: Path
) -> Array:
    """Poses of columns: position if it is measured, then orientation. Shapes: values (N, m)."""
    count = values.shape[1] - (written.dimension - 3)
    p = length.factor * values[:, :3] if count else np.zeros((len(values), 3))
    o = values[:, count:]
    if written is OrientationKind.QUATERNION:
        size = np.linalg.norm(np.clip(o, -1e9, 1e9), axis=1)
        wrong = np.flatnonzero(abs(size - 1.0) > _QUATERNION_TOLERANCE)
        if len(wrong):
            raise InvalidValueError(
                f"{file}: the quaternion of row {wrong[0] + 1} has length {size[wrong[0]]:.4g}; "
                "expected 1. Check that columns names the right ones, the scalar first."
            )
        o = o / size[:, None]
    elif written not in (OrientationKind.DIRECTION_COSINES, OrientationKind.TWO_AXES):
        _check_angles(o, angle, file, "angles")
        o = angle.factor * o
    return se3.as_pose(pose_from_coordinates(np.hstack([p, o]), written), "columns")


def _check_angles(values: Array, unit: AngleUnit, file: Path, argument: str) -> None:
    largest = float(np.abs(values).max(initial=0.0))
    look = ""
    if unit is AngleUnit.RADIAN and largest > _LARGEST_ANGLE:
        look = f"an angle of {largest:.4g} rad; these look like degrees. Use {argument}='deg'"
    elif unit is AngleUnit.DEGREE and largest <= 2 * np.pi and values.size and np.ptp(values) > 1.0:
        look = (
            f"no angle is larger than {largest:.4g} deg; these look like radians. Use "
            f"{argument}='rad'"
        )
    if look:
        raise InvalidValueError(f"{file}: {look}.")
