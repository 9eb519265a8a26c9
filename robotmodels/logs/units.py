"""Units of headers, and the conversion of a file's columns to SI on the joint side."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_floats
from ..drive import Transmission
from ..errors import InvalidValueError, ShapeError
from ..file_units import AngleUnit, LengthUnit
from ..geometry import PRISMATIC
from ..model import RobotModel
from .columns import Quantity, split_unit
from .tables import LogTable

_ANGLES = {"rad": "rad", "deg": "deg", "°": "deg", "degree": "deg", "degrees": "deg"}
_OTHER_POSITIONS = re.compile(r"grad|gon|mrad|(turn|rev|count|tick|step)s?|rpm|in|ft")
_OTHER_TORQUES = re.compile(r"[mcku]nm|[kmc]n|n[cm]m|lbf?(ft|in)|m?a|arms|amps?|m?v|%|counts?")


def joint_side(
    n: int,
    angles: AngleUnit,
    lengths: LengthUnit,
    signs: ArrayLike | None,
    gears: ArrayLike | None,
    transmission: Transmission | None,
    drive_gains: ArrayLike | None,
    offsets: ArrayLike | None,
    model: RobotModel | None,
) -> tuple[Array, Array, Array]:
    """Matrices (n, n) from the columns of positions and torques to the joints, and an offset."""
    unit = np.full(n, angles.factor)
    if gears is not None and transmission is not None:
        raise InvalidValueError(
            "gears, transmission: give one of them; a transmission includes the gear ratios."
        )
    if gears is None and transmission is None and model is not None:
        prismatic = model.table.sigma[model.table.joint_rows] == PRISMATIC
        unit[prismatic] = lengths.factor
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
        if transmission.n != n:
            raise ShapeError(
                f"transmission: it has {transmission.n} joints, the log has {n} columns of "
                "positions."
            )
        if not transmission.is_invertible:
            raise InvalidValueError(
                "transmission: joints mimic others, so that motor torques do not determine those "
                "of the joints; give the model of the independent joints."
            )
        K, zero = transmission.matrix, transmission.offset
    offset = zero + _each(offsets, n, "offsets", 0.0)
    return (sign * unit)[:, None] * K.T, gain[:, None] * np.linalg.inv(K), offset


def _each(value: ArrayLike | None, n: int, name: str, default: float) -> Array:
    if value is None:
        return np.full(n, default)
    array = as_floats(value, name)
    return np.full(n, float(array)) if array.ndim == 0 else as_exact(array, (n,), name)


def check_units(
    table: LogTable, columns: Sequence[int], kind: Quantity, angle: AngleUnit, gains: bool
) -> None:
    """Raise for units of headers that contradict the arguments or are not supported."""
    torques = kind in (Quantity.TORQUE, Quantity.CURRENT)
    for name in [table.names[i] for i in columns if table.names]:
        unit = split_unit(name)[1]
        plain = unit.split("/")[0].strip()
        header = _ANGLES.get(plain, angle.value)
        advice = ""
        if torques:
            if not gains and _OTHER_TORQUES.fullmatch(re.sub("[ .*·⋅_-]", "", unit)):
                advice = "not in N m; give drive_gains=, the N m (N for slides) for one unit of it."
        elif _OTHER_POSITIONS.fullmatch(plain):
            advice = "which is not read; write it in rad or deg (m or mm for slides), or remove "
            advice += "the unit from the header and give its factor by gears=."
        elif header != angle.value:
            advice = f"the argument is angles={angle.value!r}; give angles={header!r}, or the "
            advice += "right columns."
        if advice:
            raise InvalidValueError(f"{table.path}: the column {name!r} is in {unit!r}, {advice}")
