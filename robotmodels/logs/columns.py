"""Columns of positions, torques and time, found by the usual names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from enum import Enum

from ..errors import InvalidValueError
from ..file_units import AngleUnit, TimeUnit
from .tables import LogTable

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
