"""Check of length units against the nominal robot."""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, log
from typing import NamedTuple

import numpy as np

from .. import se3
from .._arrays import Array
from ..errors import InvalidValueError
from ..kinematics import dgm
from ..kinematics.lengths import characteristic_length
from ..model import RobotModel
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
from .registration import best_motion

_UNITS = {"metres": 1.0, "centimetres": 1e-2, "inches": 0.0254, "millimetres": 1e-3}
_SLIPS = {
    (unit, taken): _UNITS[taken] / _UNITS[unit]
    for unit, taken in (
        ("millimetres", "metres"), ("centimetres", "metres"), ("inches", "metres"),
        ("millimetres", "centimetres"), ("millimetres", "inches"),
    )
}  # fmt: skip
_SLIPS |= {(taken, unit): 1.0 / factor for (unit, taken), factor in _SLIPS.items()}
_TENFOLD = {
    ("millimetres", "centimetres"): "ten times too long: a slip of a decimal, or mm for cm",
    ("centimetres", "millimetres"): "ten times too short: a slip of a decimal, or cm for mm",
}
"""Sentences on a known distance that is ten times too long or too short."""
_NEAR = 0.15
"""Relative tolerance of a unit factor."""
_ALIKE = 0.3
"""Largest relative residual of measured against scaled nominal lengths."""
_FAR = 3.0
"""Difference of a known distance, in scatters of the nominal points, from which units are checked.
"""
_SPREAD = 50.0
"""Implausible measured spread, relative to the robot's reach."""
_STILL = 200.0
"""Ratio of nominal to measured spread from which the measured point counts as fixed."""
_FEW = 7
"""Smallest number of lengths for the check of a pivot."""


class UnitError(NamedTuple):
    """Ratio of measured to nominal lengths explained by a unit."""

    unit: str
    """Actual unit."""
    taken: str
    """Assumed unit."""
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
    """The slip of units whose factor is near a ratio of measured to nominal lengths."""
    if not 0.0 < ratio < np.inf:
        return None
    pair = min(_SLIPS, key=lambda key: abs(log(ratio / _SLIPS[key])))
    close = abs(log(ratio / _SLIPS[pair])) < log(1.0 + near)
    return UnitError(*pair, ratio) if close else None


def unit_error_of_positions(nominal: Array, measured: Array) -> UnitError | None:
    """Unit error of positions, by a similarity fit. Shapes: nominal, measured (N, 3)."""
    if len(nominal) < 3:
        return None
    T = best_motion(nominal, measured)
    turned = (nominal - nominal.mean(axis=0)) @ T[:3, :3].T
    return unit_error_of_lengths(turned.ravel(), (measured - measured.mean(axis=0)).ravel())


def unit_error_of_lengths(nominal: Array, measured: Array) -> UnitError | None:
    """By the ratio of lengths (N,), where they are of the same movements."""
    size = float(nominal @ nominal)
    ratio = float(nominal @ measured) / size if size > 0.0 else 0.0
    left = float(np.linalg.norm(measured - ratio * nominal))
    return unit_error_of(ratio) if left < _ALIKE * float(np.linalg.norm(measured)) else None


def unit_error_of_spread(model: RobotModel, frame: Frame, spread: float) -> UnitError | None:
    """By the reach of the robot, where measured lengths do not follow the nominal ones."""
    ratio = spread / characteristic_length(model, frame)
    return UnitError("millimetres", "metres", ratio) if ratio > _SPREAD else None


def _unit_error_of_pivot(p: Array, length: Array) -> UnitError | None:
    """By ``|p - c|^2 = s length^2``, which is linear in c, c.c and s."""
    if len(p) < _FEW:
        return None
    x = p - p.mean(axis=0)
    square = (x * x).sum(axis=1)
    scaled = (length / length.max()) ** 2
    A = np.column_stack([x, np.ones(len(x)), scaled])
    found = np.linalg.lstsq(A, square, rcond=None)[0]
    left = np.linalg.norm(A @ found - square)
    if left > _ALIKE * np.linalg.norm(square - square.mean()) or found[-1] <= 0.0:
        return None
    return unit_error_of(float(length.max() / np.sqrt(found[-1])))


def check_units(model: RobotModel, measurements: Sequence[Measurement]) -> None:
    """Refuse lengths in another unit than metres."""
    for k, m in enumerate(measurements):
        found = _slip(model, m)
        if found is not None:
            what, slip = found
            raise InvalidValueError(
                f"measurements[{k}] ({m.name}): {what} are {slip.sentence()}. Pass metres: "
                f"multiply by {slip.factor:.4g}."
            )
        if isinstance(m, Pose | Position):
            _check_spread(model, m, f"measurements[{k}] ({m.name})")
    points = _touched(model, measurements)
    for m in measurements:
        if isinstance(m, KnownDistance) and m.point in points and m.other in points:
            _check_distance(m, points[m.point], points[m.other])


def _slip(model: RobotModel, m: Measurement) -> tuple[str, UnitError] | None:
    """What is measured and its slip of units, if there is one."""
    slip = None
    if isinstance(m, Pose | Position) and all(m.rows[:3]):
        p = m.T[:, :3, 3] if isinstance(m, Pose) else m.p
        what, slip = "positions", unit_error_of_positions(dgm(model, m.q, m.frame)[:, :3, 3], p)
        slip = slip or unit_error_of_spread(
            model, m.frame, float(np.linalg.norm(np.ptp(p, axis=0)))
        )
    elif isinstance(m, CameraPose) and all(m.rows):
        what = "positions of the boards"
        camera, seen = dgm(model, m.q, m.frame)[:, :3, 3], se3.inverse(m.T)[:, :3, 3]
        for group in range(len(m.labels)):
            of = m.groups == group
            slip = slip or unit_error_of_positions(camera[of], seen[of])
    elif isinstance(m, RelativePose) and all(m.rows[:3]):
        what = "displacements"
        moved = se3.inverse(dgm(model, m.q, m.frame)) @ dgm(model, m.q_other, m.frame)
        slip = unit_error_of_lengths(moved[:, :3, 3].ravel(), m.T[:, :3, 3].ravel())
    elif isinstance(m, Distance) and not m.offset:
        what = "lengths"
        p = dgm(model, m.q, m.frame)[:, :3, 3]
        if m.q_other is not None:
            apart = p - dgm(model, m.q_other, m.frame)[:, :3, 3]
            slip = unit_error_of_lengths(np.linalg.norm(apart, axis=1), m.length)
        else:
            for group in range(len(m.labels)):
                of = m.groups == group
                slip = slip or _unit_error_of_pivot(p[of], m.length[of])
        slip = slip or unit_error_of_spread(model, m.frame, float(np.median(m.length)))
    return None if slip is None else (what, slip)


def _check_spread(model: RobotModel, m: Pose | Position, where: str) -> None:
    """Refuse positions that do not move although the robot does."""
    p = m.T[:, :3, 3] if isinstance(m, Pose) else m.p
    spread = float(np.linalg.norm(np.ptp(p, axis=0)))
    nominal = float(np.linalg.norm(np.ptp(dgm(model, m.q, m.frame)[:, :3, 3], axis=0)))
    if 0.0 < spread < nominal / _STILL:
        raise InvalidValueError(
            f"{where}: positions are spread over {spread:.3g} m, but those of the robot over "
            f"{nominal:.3g} m: these look like the same position all the time, or like kilometres. "
            "Pass metres."
        )


def _touched(model: RobotModel, measurements: Sequence[Measurement]) -> dict[str, Array]:
    """Nominal positions of the end, by the name of the point that it touches."""
    found: dict[str, list[Array]] = {}
    for m in measurements:
        if isinstance(m, PointContact):
            p = dgm(model, m.q, m.frame)[:, :3, 3]
            for label, place in zip(m.label, p, strict=True):
                found.setdefault(f"{m.name}:{label}", []).append(place)
    return {name: np.array(places) for name, places in found.items()}


def _check_distance(m: KnownDistance, one: Array, other: Array) -> None:
    """Refuse a known distance in another unit."""
    apart = float(np.linalg.norm(one.mean(axis=0) - other.mean(axis=0)))
    spread = np.concatenate([one - one.mean(axis=0), other - other.mean(axis=0)])
    scatter = float(np.sqrt((spread**2).sum(axis=1).mean()))
    if abs(m.length - apart) <= _FAR * scatter:
        return
    # halfway to the next factor, that of inches, if the nominal robot knows no better
    near = min(_NEAR + scatter / max(apart, 1e-12), exp(0.5 * log(39.37 / 25.4)) - 1.0)
    slip = unit_error_of(m.length / max(apart, 1e-12), near)
    if slip is not None:
        raise InvalidValueError(
            f"{m.name} {m.point} to {m.other}: {m.length:.6g} m is "
            f"{_TENFOLD.get((slip.unit, slip.taken)) or slip.sentence()}. The nominal robot gives "
            f"{apart:.4g} m. Pass metres: {slip.factor * m.length:.5g}."
        )
