"""Which columns of a file are positions, torques and time, by the names that people give them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from ..errors import InvalidValueError
from ..file_units import AngleUnit, TimeUnit
from .table import LogTable


class Quantity(Enum):
    """What columns of a log are; the value are the usual names, in small letters."""

    POSITION = (
        "q", "pos", "position", "positions", "joint_position", "joint_positions", "actual_q",
        "angle", "angles", "joint_angle", "joint_angles", "q_meas", "q_mes", "joint_pos", "theta",
    )  # fmt: skip
    TORQUE = (
        "tau", "torque", "torques", "effort", "efforts", "joint_torque", "joint_torques",
        "joint_effort", "joint_efforts", "tau_meas", "tau_mes", "tau_j", "motor_torque",
        "motor_torques", "actual_torque", "gamma", "trq",
    )  # fmt: skip
    CURRENT = (
        "current", "currents", "cur", "curr", "actual_current", "motor_current", "motor_currents",
        "i_q", "iq", "i",
    )  # fmt: skip
    VELOCITY = (
        "v", "dq", "qd", "qdot", "vel", "velocity", "velocities", "joint_velocity",
        "joint_velocities", "actual_qd", "dq_meas", "joint_vel",
    )  # fmt: skip
    ACCELERATION = (
        "a", "ddq", "qdd", "qddot", "acc", "acceleration", "accelerations", "joint_acceleration",
        "joint_accelerations",
    )  # fmt: skip
    POSITION_REFERENCE = (
        "q_ref", "q_des", "q_d", "target_q", "desired_position", "desired_positions",
        "position_reference", "position_ref", "pos_ref", "pos_des", "q_cmd", "q_desired",
    )  # fmt: skip
    VELOCITY_REFERENCE = (
        "v_ref", "v_des", "dq_ref", "dq_des", "qd_ref", "qd_des", "dq_d", "target_qd", "vel_ref",
        "velocity_reference", "velocity_ref", "desired_velocity", "desired_velocities", "dq_cmd",
    )  # fmt: skip

    @property
    def argument(self) -> str:
        """The argument of `read_log` that gives these columns."""
        return {
            "POSITION": "positions", "TORQUE": "torques", "CURRENT": "torques",
            "VELOCITY": "velocities", "ACCELERATION": "accelerations",
            "POSITION_REFERENCE": "position_references",
            "VELOCITY_REFERENCE": "velocity_references",
        }[self.name]  # fmt: skip


_UNIT = re.compile(r"\s*[\[(]\s*([a-zA-Z°%·⋅/ ._*^-]+[0-9]?)\s*[\])]\s*$")
_INDEX = re.compile(r"^(?P<stem>.*?)[ _./-]*[\[(]?(?P<index>\d+)[\])]?$")
_TIMES = ("time", "t", "timestamp", "stamp", "times", "timestamps", "__time", "elapsed")
_NANOSECONDS = ("%time", "field.header.stamp")
_SECONDS = ("header.stamp.secs", "header.stamp.sec", "header.stamp.nsecs", "header.stamp.nanosec")


@dataclass(frozen=True, slots=True)
class FoundTime:
    """Columns of the time: one, or seconds and nanoseconds."""

    columns: tuple[int, ...]
    unit: TimeUnit | None


def find_quantity(
    table: LogTable, kind: Quantity, joints: Sequence[str] | None
) -> tuple[int, ...] | None:
    """Columns of one quantity by the usual names."""
    sets: dict[str, dict[str, int]] = {}
    for i, name in enumerate(table.names[: table.alike]):
        where = _stem_and_joint(name, kind, joints)
        if where is not None:
            sets.setdefault(where[0], {}).setdefault(where[1], i)
    if not sets:
        return None
    if len(sets) > 1:
        words = " or ".join(table.called(list(s.values())) for s in sets.values())
        raise InvalidValueError(
            f"{kind.argument}: {table.path} has several that may be meant: {words}. Say which."
        )
    (found,) = sets.values()
    if all(key.isdecimal() for key in found):
        numbers = sorted(int(key) for key in found)
        if numbers[0] > 1 or numbers != list(range(numbers[0], numbers[0] + len(numbers))):
            raise InvalidValueError(
                f"{kind.argument}: columns {table.called(list(found.values()))} of {table.path} "
                f"are not numbered from 0 or 1 without gaps; give them as {kind.argument}=[...]."
            )
        ordered = {int(key): i for key, i in found.items()}
        return tuple(ordered[k] for k in numbers)
    if joints is not None and set(found) & {name.lower() for name in joints}:
        missing = [name for name in joints if name.lower() not in found]
        if missing:
            raise InvalidValueError(
                f"{kind.argument}: {table.path} has no column for {', '.join(missing)}; give "
                f"them as {kind.argument}=[...]."
            )
        return tuple(found[name.lower()] for name in joints)
    return tuple(found.values())


def joints_of(table: LogTable, kind: Quantity, columns: Sequence[int]) -> tuple[str, ...] | None:
    """Names of joints that the file gives to columns; None if it gives none."""
    listed = [i for i, name in enumerate(table.names) if _last(name) in ("name", "names")]
    for i in listed:
        names = tuple(word.strip().strip("'\"") for word in table.words(i).strip("[]()").split(","))
        if len(names) == len(columns):
            return names
    numbered = []
    for i, name in enumerate(table.names):
        match = _INDEX.match(_last(name))
        if match and match["stem"].lower() in ("name", "names"):
            numbered.append((int(match["index"]), i))
    if len(numbered) == len(columns):
        return tuple(table.words(i) for _, i in sorted(numbered))
    found = [_stem_and_joint(table.names[i], kind, None) for i in columns if i < len(table.names)]
    keys = [where[1] for where in found if where is not None]
    if len(keys) < len(columns) or any(key.isdecimal() for key in keys):
        return None
    places = [table.names[i].lower().find(key) for i, key in zip(columns, keys, strict=True)]
    return tuple(
        table.names[i][place : place + len(key)]  # capitals as they are
        for i, key, place in zip(columns, keys, places, strict=True)
    )


def find_time(table: LogTable) -> FoundTime | None:
    """Columns of the time by the usual names."""
    names = [_without_unit(name)[0].lower() for name in table.names[: table.alike]]
    whole, parts = (
        [i for i, name in enumerate(names) if any(name.endswith(end) for end in ends)]
        for ends in (_SECONDS[:2], _SECONDS[2:])
    )
    if len(whole) == 1 and len(parts) == 1:
        return FoundTime((whole[0], parts[0]), TimeUnit.SECOND)
    for wanted in _NANOSECONDS[::-1]:  # when it was measured, rather than when it was recorded
        if names.count(wanted) == 1:
            return FoundTime((names.index(wanted),), TimeUnit.NANOSECOND)
    for wanted in _TIMES:
        if names.count(wanted) == 1:
            i = names.index(wanted)
            return FoundTime((i,), time_unit_of(table.names[i]))
    return None


def time_unit_of(name: str) -> TimeUnit | None:
    """Unit that a header says, "time [ms]"; None if it says none."""
    unit = _without_unit(name)[1]
    words = {"s": "s", "sec": "s", "ms": "ms", "us": "us", "ns": "ns"}
    return TimeUnit(words[unit]) if unit in words else None


def angle_unit_of(name: str) -> AngleUnit | None:
    """Unit of an angle that a header says, "q1 [deg]"; None if it says none."""
    unit = _without_unit(name)[1].split("/")[0]
    words = {"rad": "rad", "deg": "deg", "°": "deg", "degree": "deg", "degrees": "deg"}
    return AngleUnit(words[unit]) if unit in words else None


def unit_of(name: str) -> str:
    """What stands in brackets at the end of a header, in small letters; empty if nothing does."""
    return _without_unit(name)[1]


def _without_unit(name: str) -> tuple[str, str]:
    match = _UNIT.search(name)
    if match is None:
        return name.strip(), ""
    return name[: match.start()].strip(), match.group(1).strip().lower()


def _last(name: str) -> str:
    return re.split(r"[./]", _without_unit(name)[0])[-1].lower()


def _stem_and_joint(
    name: str, kind: Quantity, joints: Sequence[str] | None
) -> tuple[str, str] | None:
    """What stands before and after a usual name: its set, and the number or name of the joint."""
    bare = _without_unit(name)[0].lower()
    match = _INDEX.match(bare)
    if match is not None:
        stem = match["stem"]
        last = re.split(r"[./]", stem)[-1]
        if last in kind.value:
            return stem, match["index"]
    # a joint before or after: /joint_states/joint_1/position, position/joint_1, joint_1_position
    parts = re.split(r"[./]", bare)
    if len(parts) > 1 and parts[-1] in kind.value and parts[-2] != "field":
        return "/".join((*parts[:-2], "*", parts[-1])), parts[-2]
    if len(parts) > 1 and parts[-2] in kind.value and not parts[-1].isdecimal():
        return "/".join((*parts[:-1], "*")), parts[-1]
    for joint in joints or ():
        low = joint.lower()
        for stem in kind.value:
            if bare in (f"{low}_{stem}", f"{stem}_{low}", f"{low} {stem}", f"{stem} {low}"):
                return f"{stem}*", low
    for stem in sorted(kind.value, key=len, reverse=True):
        ended = re.match(rf"^(j|joint|axis|a)[ _]?(\d+)[ _]{re.escape(stem)}$", bare)
        if ended:
            return f"{ended[1]}*{stem}", ended[2]
    return None
