"""From what a file has to SI on the joint side."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_floats
from ..drive import Transmission
from ..errors import InvalidValueError, ShapeError
from ..file_units import AngleUnit, LengthUnit
from ..geometry import PRISMATIC
from ..model import RobotModel
from .finding_columns import unit_of
from .table import LogTable

_ANGLES = ("rad", "deg", "°", "degree", "degrees", "m", "mm")
_OTHER_ANGLES = (
    "grad", "gon", "mrad", "urad", "turn", "turns", "rev", "revs", "rpm", "arcmin", "arcsec", "min",
    "count", "counts", "inc", "incs", "tick", "ticks", "pulse", "pulses", "step", "steps", "cm",
    "um", "in", "inch", "ft", "km",
)  # fmt: skip
_TORQUES = ("nm", "n", "n/m")
_OTHER_TORQUES = (
    "mnm", "cnm", "knm", "unm", "kn", "mn", "ncm", "nmm", "kgm", "kgfm", "kgcm", "kgfcm", "lbft",
    "lbfft", "ftlb", "ftlbf", "lbin", "lbfin", "inlb", "inlbf", "ozin", "ozfin", "a", "ma", "arms",
    "amp", "amps", "ampere", "v", "mv", "%", "percent", "permille", "permil", "count", "counts",
)  # fmt: skip
_JOINING = re.compile(r"[ .*·⋅_-]")


@dataclass(frozen=True, slots=True, eq=False)
class JointSide:
    """Factors of positions and torques, from the file's columns to the joints.

    Shapes: positions, torques (n, n); offset (n,).
    """

    positions: Array
    torques: Array
    offset: Array

    def q(self, raw: Array) -> Array:
        """Positions of the joints, shape (N, n)."""
        return _times(raw, self.positions) + self.offset

    def rate(self, raw: Array) -> Array:
        """Their derivatives."""
        return _times(raw, self.positions)

    def tau(self, raw: Array) -> Array:
        """Torques of the joints, shape (N, n)."""
        return _times(raw, self.torques)


def _times(raw: Array, matrix: Array) -> Array:
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused by the log
        return raw @ matrix


def joint_side(
    n: int,
    *,
    angles: AngleUnit,
    lengths: LengthUnit,
    signs: ArrayLike | None,
    gears: ArrayLike | None,
    transmission: Transmission | None,
    drive_gains: ArrayLike | None,
    offsets: ArrayLike | None,
    model: RobotModel | None,
) -> JointSide:
    """Factors for what the arguments of `read_log` say."""
    unit = np.full(n, angles.factor)
    if gears is not None and transmission is not None:
        raise InvalidValueError(
            "gears, transmission: give one of them; a transmission has the gear ratios in it."
        )
    if gears is None and transmission is None and model is not None:
        prismatic = model.table.sigma[model.table.joint_rows] == PRISMATIC
        unit[prismatic] = lengths.factor
    turn = _each(signs, n, "signs", 1.0)
    if (np.abs(turn) != 1.0).any():
        raise InvalidValueError(f"signs: expected 1 or -1 for each of the {n} joints, got {signs}.")
    gain = turn * _each(drive_gains, n, "drive_gains", 1.0)
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
                "transmission: joints mimic others, so that torques of motors do not tell those "
                "of the joints; take the model of the free joints."
            )
        K, zero = transmission.matrix, transmission.offset
    return JointSide(
        (turn * unit)[:, None] * K.T,
        gain[:, None] * np.linalg.inv(K),
        zero + _each(offsets, n, "offsets", 0.0),
    )


def _each(value: ArrayLike | None, n: int, name: str, default: float) -> Array:
    if value is None:
        return np.full(n, default)
    array = as_floats(value, name)
    return np.full(n, float(array)) if array.ndim == 0 else as_exact(array, (n,), name)


def check_headers(said: Sequence[AngleUnit | None], given: AngleUnit, source: str) -> None:
    """Refuse an argument that contradicts the header."""
    for unit in said:
        if unit is not None and unit is not given:
            raise InvalidValueError(
                f"{source}: the header says {unit.value!r}, the argument angles={given.value!r}; "
                f"say angles={unit.value!r}, or name the right columns."
            )


def check_position_units(table: LogTable, columns: Sequence[int]) -> list[str]:
    """Refuse positions and their derivatives in units that are not understood."""
    odd: dict[str, str] = {}
    for name in _names(table, columns):
        unit = unit_of(name).split("/")[0].strip()
        if unit in _OTHER_ANGLES:
            raise InvalidValueError(
                f"{table.path}: the column {name!r} is in {unit!r}, which is not read; write it in "
                "rad or deg (m or mm for prismatic joints), or give gears= where it is a constant "
                "factor and the brackets are taken out of the header."
            )
        if unit and unit not in _ANGLES:
            odd.setdefault(unit, name)
    return [_odd(table, unit, name, "angles=") for unit, name in odd.items()]


def check_torque_units(table: LogTable, columns: Sequence[int], gains: bool) -> list[str]:
    """Refuse torques in units other than N m and N, but where drive gains convert them."""
    if gains:
        return []
    odd: dict[str, str] = {}
    for name in _names(table, columns):
        unit = _JOINING.sub("", unit_of(name))
        if unit in _OTHER_TORQUES:
            raise InvalidValueError(
                f"{table.path}: the column {name!r} is in {unit_of(name)!r}, not in N m; say "
                "drive_gains=, the N m (N for prismatic joints) for one unit of it."
            )
        if unit and unit not in _TORQUES:
            odd.setdefault(unit_of(name), name)
    return [_odd(table, unit, name, "drive_gains=") for unit, name in odd.items()]


def _names(table: LogTable, columns: Sequence[int]) -> list[str]:
    return [table.names[i] for i in columns if table.names]


def _odd(table: LogTable, unit: str, name: str, option: str) -> str:
    return (
        f"{table.path.name}: {unit!r} in the header {name!r} is no unit that is known and was left "
        f"aside; see {option} if it is one."
    )
