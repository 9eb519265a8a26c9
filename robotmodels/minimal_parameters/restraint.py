"""How the first joints of a path restrain the motion of the links behind them.

The rules of base parameters for one joint (seed book section 1.5.3) hold wherever a link can move
freely. Near the base it cannot: before the first revolute joint it only translates, and as long as
all revolute axes are parallel it turns about one direction only, which stands still in the world
and in the link. Found here once for all links, from the table's constants.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from math import sqrt

import numpy as np

from .._arrays import Array
from ..geometry import FIXED, REVOLUTE
from ..model import RobotModel

EXACT = 1e-11
"""Sine of an angle, cosine of one, or length relative to the robot's, below which two axes are one
direction, perpendicular, or through one point."""


_LEAST = 1e-4
"""Metres: the least reach of a robot."""


class Turning(Enum):
    """Which rotations a link can have."""

    NONE = "none: only prismatic joints before it"
    ONE_DIRECTION = "about one direction"
    FREE = "about more than one direction"


@dataclass(frozen=True, slots=True, eq=False)
class Restraint:
    """Possible rotations and translations of a link, in the axes of its frame."""

    turning: Turning
    direction: Array
    slides: tuple[Array, ...]
    centre: Array | None

    def slides_along(self, direction: Array, tolerance: float) -> bool:
        """Whether a prismatic joint before it moves it along a direction, in part or wholly."""
        return any(abs(slide @ direction) > tolerance for slide in self.slides)

    def slides_across(self, direction: Array, tolerance: float) -> bool:
        """Whether a prismatic joint before it moves it in another direction."""
        return any(not parallel(slide, direction, tolerance) for slide in self.slides)


_STANDING = Restraint(Turning.NONE, np.zeros(3), (), np.zeros(3))


def parallel(a: Array, b: Array, tolerance: float = EXACT) -> bool:
    """Whether two unit vectors are parallel."""
    return _length_of_cross(a, b) <= tolerance


def restraints(model: RobotModel, tolerance: float = EXACT) -> tuple[Restraint, ...]:
    """The restraint of every link, R_0 first."""
    chain = model.chain
    within = _Tolerance(tolerance, tolerance * reach(model))
    found = [_STANDING]
    for k in range(model.f):
        before = found[int(chain.antecedent[k])]
        R, P = chain.rotation[k], chain.position[k]
        after = _with_joint(before, int(chain.sigma[k]), R[:, 2], P, within)
        found.append(
            Restraint(
                after.turning,
                after.direction @ R,
                tuple(slide @ R for slide in after.slides),
                None if after.centre is None else (after.centre - P) @ R,
            )
        )
    return tuple(found)


@dataclass(frozen=True, slots=True)
class _Tolerance:
    """What counts as nothing: of angles, and of lengths in metres."""

    angle: float
    length: float


def reach(model: RobotModel) -> float:
    """Reach of the table, metres; 1 where its lengths come to nothing."""
    table = model.table
    lengths = float(np.sqrt(table.d**2 + table.r**2 + table.b**2).sum())
    return lengths if lengths > _LEAST else 1.0


def _with_joint(before: Restraint, sigma: int, z: Array, P: Array, within: _Tolerance) -> Restraint:
    """The restraint behind a joint with axis z through P, still in the axes of the antecedent."""
    if sigma == FIXED:
        return before
    along = before.turning is Turning.ONE_DIRECTION and parallel(z, before.direction, within.angle)
    if sigma != REVOLUTE:
        slides = (*before.slides, z) if before.turning is not Turning.FREE else ()
        # a slide along the only axis moves a point of it along it, and no other in the plane
        keeps = before.turning is Turning.NONE or along
        return replace(before, slides=slides, centre=before.centre if keeps else None)
    if before.turning is Turning.NONE:
        return Restraint(Turning.ONE_DIRECTION, z, before.slides, P)
    centre = _common_point(before, z, P, within)
    if along:
        return replace(before, centre=centre)
    return Restraint(Turning.FREE, np.zeros(3), (), None if before.slides else centre)


def _common_point(before: Restraint, z: Array, P: Array, within: _Tolerance) -> Array | None:
    """A point on the axis (z, P) and on the axes before it; any point of a common axis."""
    if before.centre is None:
        return None
    way = before.centre - P
    if before.turning is Turning.FREE:
        return before.centre if _length_of_cross(z, way) <= within.length else None
    e = before.direction
    if parallel(z, e, within.angle):
        return P if _length_of_cross(z, way) <= within.length else None
    # both axes pass through P + s z = centre + t e
    s, t = np.linalg.lstsq(np.stack((z, -e), axis=1), way, rcond=None)[0]
    point = P + s * z
    return point if float(np.linalg.norm(point - before.centre - t * e)) <= within.length else None


def _length_of_cross(a: Array, b: Array) -> float:
    x, y, z = a.tolist()
    u, v, w = b.tolist()
    return sqrt((y * w - z * v) ** 2 + (z * u - x * w) ** 2 + (x * v - y * u) ** 2)
