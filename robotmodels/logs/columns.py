"""Columns of positions, torques and time, given or found by the usual names, and their samples."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Literal

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError, ShapeError
from ..file_units import AngleUnit, TimeUnit
from .tables import Choice, LogTable
from .time_base import splined

_REFERENCE = re.compile(r"^(target|desired)_|_(ref|reference|des|desired|d|cmd)$")


class Quantity(Enum):
    """Quantity of columns: argument of `read_log`, field of `Log`, and their usual names."""

    argument: str
    field: str
    usual: list[str]

    POSITION = "positions", "q", "q pos position angle theta"
    TORQUE = "torques", "tau", "tau tau_j torque effort motor_torque gamma trq"
    CURRENT = "torques", "tau", "current cur curr motor_current i_q iq i"
    VELOCITY = "velocities", "v", "v dq qd qdot vel velocity velocitie"
    ACCELERATION = "accelerations", "a", "a ddq qdd qddot acc acceleration"
    POSITION_REFERENCE = "position_references", "q_ref", "q pos position angle theta"
    VELOCITY_REFERENCE = "velocity_references", "v_ref", "v dq qd qdot vel velocity velocitie"

    def __init__(self, argument: str, field: str, usual: str) -> None:
        self.argument, self.field, self.usual = argument, field, usual.split()

    def names(self, word: str) -> bool:
        """Whether a word is a usual name: "joint_positions", "q_meas", of references "q_des"."""
        plain = _REFERENCE.sub("", word.lower())
        is_reference = plain != word.lower()
        plain = re.sub(r"^(joint|actual)_|_(meas|mes)$", "", plain)
        usual = plain in self.usual or plain.removesuffix("s") in self.usual
        return usual and is_reference == self.field.endswith("_ref")


_ANGLES = {"rad": "rad", "deg": "deg", "°": "deg", "degree": "deg", "degrees": "deg"}
_OTHER_POSITIONS = re.compile(r"grad|gon|mrad|(turn|rev|count|tick|step)s?|rpm|in|ft")
_OTHER_TORQUES = re.compile(r"[mcku]nm|[kmc]n|n[cm]m|lbf?(ft|in)|m?a|arms|amps?|m?v|%|counts?")
_TIME_UNIT = re.compile(r"(?<=[a-z])_(s|sec|ms|us|ns)$")
_UNIT = re.compile(r"\s*[\[(]\s*([a-zA-Z°%·⋅/ ._*^-]+[0-9]?)\s*[\])]\s*$")
_INDEX = re.compile(r"^(?P<stem>.*?)[ _./-]*[\[(]?(?P<index>\d+)[\])]?$")
_SPLIT = re.compile(r"[./]")
_STAMPS = (
    ("header.stamp.secs", "header.stamp.sec"),
    ("header.stamp.nsecs", "header.stamp.nanosec"),
)
_TIMES = ("time", "t", "timestamp", "stamp", "times", "timestamps", "__time", "elapsed")


def split_unit(name: str) -> tuple[str, str]:
    """A header without the unit in brackets at its end, and that unit in small letters."""
    match = _UNIT.search(name)
    if match is None:
        return name.strip(), ""
    return name[: match.start()].strip(), match.group(1).strip().lower()


def time_unit_of(name: str) -> TimeUnit | None:
    """Unit of a header such as "time [ms]" or "time_ms"; None without one."""
    bare, unit = split_unit(name)
    ending = _TIME_UNIT.search(bare.lower())
    unit = ending[1] if ending and not unit else unit
    unit = {"sec": "s"}.get(unit, unit)
    return TimeUnit(unit) if unit in ("s", "ms", "us", "ns") else None


def find_time(table: LogTable) -> tuple[tuple[int, ...], TimeUnit | None] | None:
    """Columns of the time (one, or seconds and nanoseconds) and their unit."""
    names = [split_unit(name)[0].lower() for name in table.names[: table.alike]]
    pair = [[i for i, x in enumerate(names) if x.endswith(ends)] for ends in _STAMPS]
    if all(len(found) == 1 for found in pair):
        return (pair[0][0], pair[1][0]), TimeUnit.SECOND
    # of ROS, the time of measurement rather than that of recording; last a column of a structure,
    # such as "log.t"
    last = [_SPLIT.split(name)[-1] for name in names]
    ends = [_TIME_UNIT.sub("", name) for name in last]
    ours = ((last, _TIMES), (ends, _TIMES))
    for words, wanted in ((names, ("field.header.stamp", "%time", *_TIMES)), *ours):
        for name in wanted:
            if words.count(name) == 1:
                i = words.index(name)
                usual = name in _TIMES
                return (i,), time_unit_of(table.names[i]) if usual else TimeUnit.NANOSECOND
    return None


def find_quantity(
    table: LogTable, kind: Quantity, joints: Sequence[str] | None
) -> tuple[int, ...] | None:
    """Columns of one quantity by the usual names: by their numbers, or in the file's order."""
    families: dict[str, dict[str, int]] = {}
    for i, name in enumerate(table.names[: table.alike]):
        place = _family_and_joint(name, kind, joints)
        if place is not None:
            families.setdefault(place[0], {}).setdefault(place[1].lower(), i)
    if len(families) > 1:
        words = " or ".join(table.called(list(each.values())) for each in families.values())
        raise InvalidValueError(
            f"{kind.argument}: {table.path} has several candidates: {words}. Give "
            f"{kind.argument}=[...]."
        )
    if not families:
        return None
    (found,) = families.values()
    if all(joint.isdecimal() for joint in found):
        numbered = {int(joint): i for joint, i in found.items()}
        first = min(numbered)
        if first > 1 or max(numbered) != first + len(found) - 1:
            raise InvalidValueError(
                f"{kind.argument}: columns {table.called(list(found.values()))} of {table.path} "
                f"are not numbered from 0 or 1 without gaps; give them as {kind.argument}=[...]."
            )
        return tuple(numbered[k] for k in sorted(numbered))
    return tuple(found.values())


def joints_of(
    table: LogTable, kind: Quantity, columns: Sequence[int], joints: Sequence[str] | None
) -> tuple[str, ...] | None:
    """Names of the joints of some columns that the file gives; None without them."""
    numbered = {}
    for i, name in enumerate(table.names):
        last = _SPLIT.split(split_unit(name)[0])[-1].lower()
        if last in ("name", "names"):
            words = table.text(i).strip("[]()").split(",")
            if len(words) == len(columns):
                return tuple(word.strip(" '\"") for word in words)
        elif (match := _INDEX.match(last)) and match["stem"] in ("name", "names"):
            numbered[int(match["index"])] = table.text(i)
    if len(numbered) == len(columns):
        return tuple(numbered[k] for k in sorted(numbered))
    places = [_family_and_joint(table.names[i], kind, joints) for i in columns if table.names]
    spelt = {joint.lower(): joint for joint in joints or ()}
    names = [place[1] for place in places if place and not place[1].isdecimal()]
    return tuple(spelt.get(x.lower(), x) for x in names) if len(names) == len(columns) else None


def _family_and_joint(
    name: str, kind: Quantity, joints: Sequence[str] | None
) -> tuple[str, str] | None:
    """Column name without its joint, and the number or name of the joint."""
    bare = split_unit(name)[0]
    match = _INDEX.match(bare)
    if match and kind.names(_SPLIT.split(match["stem"])[-1]):
        return match["stem"].lower(), match["index"]
    # a joint before or after: /joint_states/joint_1/position, position/joint_1
    parts = _SPLIT.split(bare)
    if len(parts) > 1 and kind.names(parts[-1]) and parts[-2].lower() != "field":
        return "/".join((*parts[:-2], "*", parts[-1])).lower(), parts[-2]
    if len(parts) > 1 and kind.names(parts[-2]) and not parts[-1].isdecimal():
        return "/".join((*parts[:-1], "*")).lower(), parts[-1]
    # joint_1_position, position_joint_1, axis 1 position
    given = [f"({re.escape(joint)})" for joint in joints or ()]
    for word in (*given, r"(?:j|joint|axis|a)[ _]?(\d+)"):
        match = re.fullmatch(
            rf"{word}[ _](?P<stem>\w+)|(?P<head>\w+)[ _]{word}", bare, re.IGNORECASE
        )
        if match and kind.names(match["stem"] or match["head"]):
            return (match["stem"] or match["head"]).lower(), match[1] or match[4]
    return None


def check_units(
    table: LogTable, columns: Sequence[int], kind: Quantity, angle: AngleUnit, gains: bool
) -> None:
    """Raise for units of headers that contradict the arguments or are not supported."""
    for name in [table.names[i] for i in columns if table.names]:
        unit = split_unit(name)[1]
        plain = unit.split("/")[0].strip()
        if kind.field == "tau":
            if not gains and _OTHER_TORQUES.fullmatch(re.sub("[ .*·⋅_-]", "", unit)):
                raise InvalidValueError(
                    f"{table.path}: the column {name!r} is in {unit!r}, not in N m; give "
                    "drive_gains=, the N m (N for slides) for one unit of it."
                )
        elif _OTHER_POSITIONS.fullmatch(plain) or _ANGLES.get(plain, angle.value) != angle.value:
            raise InvalidValueError(
                f"{table.path}: the column {name!r} is in {unit!r}, the argument is "
                f"angles={angle.value!r}; expected 'rad' or 'deg' (m, mm if prismatic). Without "
                "the unit in the header, its factor may be given by gears=."
            )


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
