"""Check of length units against the nominal robot."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations
from math import exp, log
from typing import NamedTuple

import numpy as np

from .. import se3
from .._arrays import Array
from ..errors import InvalidValueError
from ..kinematics import dgm
from ..kinematics.lengths import characteristic_length
from ..model import RobotModel
from .alignment import best_motion
from .extended_table import Frame
from .measurements import (
    CameraPose,
    Distance,
    KnownDistance,
    Measurement,
    PointContact,
    Pose,
    Position,
    RelativePose,
)

_UNITS = {"metres": 1.0, "centimetres": 1e-2, "inches": 0.0254, "millimetres": 1e-3}
_SLIPS = {
    (unit, taken): _UNITS[taken] / _UNITS[unit]
    for unit, taken in permutations(_UNITS, 2)
    if {unit, taken} != {"centimetres", "inches"}
}
"""Ratio of stated to true lengths, by their unit and the unit that was assumed."""
_TENFOLD = {
    ("millimetres", "centimetres"): "ten times too long: a misplaced decimal point, or mm for cm",
    ("centimetres", "millimetres"): "ten times too short: a misplaced decimal point, or cm for mm",
}
"""Sentences on a known distance that is ten times too long or too short."""
_NEAR = 0.15
"""Relative tolerance of a unit factor."""
_ALIKE = 0.3
"""Largest relative residual of measured against scaled nominal lengths."""
_FAR = 3.0
"""Difference of a known distance, in scatters of the nominal points, for a check of its unit."""
_SPREAD, _STILL = 50.0, 200.0
"""Implausible ratios: of a measured spread to the robot's reach, and of nominal to measured."""
_FEW = 7
"""Smallest number of lengths for the check of a pivot."""


class UnitError(NamedTuple):
    """Ratio of measured to nominal lengths explained by the actual and the assumed unit."""

    unit: str
    taken: str
    ratio: float

    def sentence(self, stated: str = "metres") -> str:
        """Text of the message."""
        text = f"{self.ratio:.4g} times what the robot's nominal geometry gives"
        if self.taken == stated:
            return f"{text}; these look like {self.unit}"
        return f"{text}, as if {self.unit} had been converted as {self.taken}"

    @property
    def factor(self) -> float:
        """Factor that corrects the numbers."""
        return 1.0 / _SLIPS[self.unit, self.taken]


def unit_error_of(ratio: float, near: float = _NEAR) -> UnitError | None:
    """The unit error whose factor is near a ratio of measured to nominal lengths."""
    if not 0.0 < ratio < np.inf:
        return None
    pair = min(_SLIPS, key=lambda key: abs(log(ratio / _SLIPS[key])))
    close = abs(log(ratio / _SLIPS[pair])) < log(1.0 + near)
    return UnitError(*pair, ratio) if close else None


def unit_error_of_positions(nominal: Array, measured: Array) -> UnitError | None:
    """Unit error of positions, by a similarity fit. Shapes: nominal, measured (N, 3)."""
    if len(nominal) < 3:
        return None
    R = best_motion(nominal, measured)[:3, :3]
    turned = (nominal - nominal.mean(axis=0)) @ R.T
    return _unit_error_of_lengths(turned, measured - measured.mean(axis=0))


def unit_error_of_spread(model: RobotModel, frame: Frame, spread: float) -> UnitError | None:
    """Unit error by measured spread over reach, for lengths not proportional to nominal ones."""
    ratio = spread / characteristic_length(model, frame)
    return UnitError("millimetres", "metres", ratio) if ratio > _SPREAD else None


def _unit_error_of_lengths(nominal: Array, measured: Array) -> UnitError | None:
    """Unit error by the ratio of measured to nominal displacements, if they are proportional."""
    size = float((nominal * nominal).sum())
    ratio = float((nominal * measured).sum()) / size if size > 0.0 else 0.0
    left = float(np.linalg.norm(measured - ratio * nominal))
    return unit_error_of(ratio) if left < _ALIKE * float(np.linalg.norm(measured)) else None


def _unit_error_of_pivot(p: Array, length: Array) -> UnitError | None:
    """Unit error of lengths from a pivot, by ``|p - c|^2 = s length^2``, linear in c, c.c, s."""
    if len(p) < _FEW:
        return None
    x = p - p.mean(axis=0)
    square = (x * x).sum(axis=1)
    A = np.column_stack([x, np.ones(len(x)), (length / length.max()) ** 2])
    found = np.linalg.lstsq(A, square, rcond=None)[0]
    left = np.linalg.norm(A @ found - square)
    if left > _ALIKE * np.linalg.norm(square - square.mean()) or found[-1] <= 0.0:
        return None
    return unit_error_of(float(length.max() / np.sqrt(found[-1])))


def check_units(model: RobotModel, measurements: Sequence[Measurement]) -> None:
    """Refuse lengths in another unit than metres."""
    points: dict[str, list[Array]] = {}
    for k, m in enumerate(measurements):
        where = f"measurements[{k}] ({m.name})"
        quantity, error = _unit_error(model, m)
        if error is not None:
            raise InvalidValueError(
                f"{where}: {quantity} are {error.sentence()}. Pass metres: multiply by "
                f"{error.factor:.4g}."
            )
        if isinstance(m, Pose | Position):
            _check_spread(model, m, where)
        elif isinstance(m, PointContact):
            for label, p in zip(m.label, dgm(model, m.q, m.frame)[:, :3, 3], strict=True):
                points.setdefault(f"{m.name}:{label}", []).append(p)
    for m in measurements:
        if isinstance(m, KnownDistance) and m.point in points and m.other in points:
            _check_distance(m, np.array(points[m.point]), np.array(points[m.other]))


def _unit_error(model: RobotModel, m: Measurement) -> tuple[str, UnitError | None]:
    """The measured quantity and its unit error, if there is one."""
    if isinstance(m, Pose | Position) and all(m.rows[:3]):
        p = _positions(m)
        error = unit_error_of_positions(dgm(model, m.q, m.frame)[:, :3, 3], p)
        size = float(np.linalg.norm(np.ptp(p, axis=0)))
        return "positions", error or unit_error_of_spread(model, m.frame, size)
    if isinstance(m, CameraPose) and all(m.rows):
        p, seen = dgm(model, m.q, m.frame)[:, :3, 3], se3.inverse(m.T)[:, :3, 3]
        boards = (m.groups == k for k in range(len(m.labels)))
        errors = (unit_error_of_positions(p[board], seen[board]) for board in boards)
        return "positions of the boards", next(filter(None, errors), None)
    if isinstance(m, RelativePose) and all(m.rows[:3]):
        moved = se3.inverse(dgm(model, m.q, m.frame)) @ dgm(model, m.q_other, m.frame)
        return "displacements", _unit_error_of_lengths(moved[:, :3, 3], m.T[:, :3, 3])
    if isinstance(m, Distance) and not m.offset:
        p = dgm(model, m.q, m.frame)[:, :3, 3]
        if m.q_other is not None:
            apart = np.linalg.norm(p - dgm(model, m.q_other, m.frame)[:, :3, 3], axis=1)
            error = _unit_error_of_lengths(apart, m.length)
        else:
            pivots = (m.groups == k for k in range(len(m.labels)))
            errors = (_unit_error_of_pivot(p[one], m.length[one]) for one in pivots)
            error = next(filter(None, errors), None)
        size = float(np.median(m.length))
        return "lengths", error or unit_error_of_spread(model, m.frame, size)
    return "", None


def _positions(m: Pose | Position) -> Array:
    return m.T[:, :3, 3] if isinstance(m, Pose) else m.p


def _check_spread(model: RobotModel, m: Pose | Position, where: str) -> None:
    """Refuse positions that do not move although the robot does."""
    measured, nominal = _positions(m), dgm(model, m.q, m.frame)[:, :3, 3]
    spread, expected = (float(np.linalg.norm(np.ptp(p, axis=0))) for p in (measured, nominal))
    if 0.0 < spread < expected / _STILL:
        raise InvalidValueError(
            f"{where}: positions are spread over {spread:.3g} m, but those of the robot over "
            f"{expected:.3g} m: the positions seem to be constant, or in "
            "kilometres. Pass metres."
        )


def _check_distance(m: KnownDistance, one: Array, other: Array) -> None:
    """Refuse a known distance in another unit."""
    apart = float(np.linalg.norm(one.mean(axis=0) - other.mean(axis=0)))
    spread = np.concatenate([one - one.mean(axis=0), other - other.mean(axis=0)])
    scatter = float(np.sqrt((spread**2).sum(axis=1).mean()))
    if abs(m.length - apart) <= _FAR * scatter:
        return
    # halfway to the next factor, that of inches, if the nominal robot is no better
    near = min(_NEAR + scatter / max(apart, 1e-12), exp(0.5 * log(39.37 / 25.4)) - 1.0)
    error = unit_error_of(m.length / max(apart, 1e-12), near)
    if error is not None:
        raise InvalidValueError(
            f"{m.name} {m.point} to {m.other}: {m.length:.6g} m is "
            f"{_TENFOLD.get((error.unit, error.taken)) or error.sentence()}. The nominal robot "
            f"gives {apart:.4g} m. Pass metres: {error.factor * m.length:.5g}."
        )
