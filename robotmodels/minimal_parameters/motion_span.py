"""Rotations and translations that each link can have, and gravity along each axis.

The rules of base parameters for one joint (seed book section 1.5.3) hold wherever a link can move
freely. Near the base it cannot: before the first revolute joint it only translates, and as long as
all revolute axes are parallel it rotates about one direction, which is fixed in the world and in
the link. Computed once for all links, from the table's constants.
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
"""Tolerance for parallel (sine), perpendicular (cosine) and intersecting axes (relative length)."""


_LEAST = 1e-4
"""Least reach of a robot, m."""


class RotationRank(Enum):
    """Directions about which a link can rotate."""

    NONE, ONE, SEVERAL = range(3)


@dataclass(frozen=True, slots=True, eq=False)
class MotionSpan:
    """Possible rotations and translations of a link, in the axes of its frame."""

    rotations: RotationRank
    direction: Array
    slides: tuple[Array, ...]
    centre: Array | None

    def slides_along(self, direction: Array, tolerance: float) -> bool:
        """Whether an earlier prismatic joint has a component along a direction."""
        return any(abs(slide @ direction) > tolerance for slide in self.slides)

    def slides_across(self, direction: Array, tolerance: float) -> bool:
        """Whether an earlier prismatic joint moves it in another direction."""
        return any(not parallel(slide, direction, tolerance) for slide in self.slides)


_FIXED = MotionSpan(RotationRank.NONE, np.zeros(3), (), np.zeros(3))


def parallel(a: Array, b: Array, tolerance: float = EXACT) -> bool:
    """Whether two unit vectors are parallel."""
    return _length_of_cross(a, b) <= tolerance


def motion_spans(model: RobotModel, tolerance: float = EXACT) -> tuple[MotionSpan, ...]:
    """The span of every link, R_0 first."""
    chain = model.chain
    within = _Tolerance(tolerance, tolerance * reach(model))
    spans = [_FIXED]
    for k in range(model.f):
        before = spans[int(chain.antecedent[k])]
        R, P = chain.rotation[k], chain.position[k]
        after = _with_joint(before, int(chain.sigma[k]), R[:, 2], P, within)
        spans.append(
            MotionSpan(
                after.rotations,
                after.direction @ R,
                tuple(slide @ R for slide in after.slides),
                None if after.centre is None else (after.centre - P) @ R,
            )
        )
    return tuple(spans)


@dataclass(frozen=True, slots=True)
class _Tolerance:
    """Zero tolerances of angles (rad) and lengths (m)."""

    angle: float
    length: float


def reach(model: RobotModel) -> float:
    """Reach of the table, metres; 1 where its lengths are zero."""
    table = model.table
    lengths = float(np.sqrt(table.d**2 + table.r**2 + table.b**2).sum())
    return lengths if lengths > _LEAST else 1.0


def _with_joint(
    before: MotionSpan, sigma: int, z: Array, P: Array, within: _Tolerance
) -> MotionSpan:
    """The span behind a joint with axis z through P, still in the axes of the antecedent."""
    if sigma == FIXED:
        return before
    along = before.rotations is RotationRank.ONE and parallel(z, before.direction, within.angle)
    if sigma != REVOLUTE:
        slides = (*before.slides, z) if before.rotations is not RotationRank.SEVERAL else ()
        # a slide along the only axis does not move the axis
        keeps = before.rotations is RotationRank.NONE or along
        return replace(before, slides=slides, centre=before.centre if keeps else None)
    if before.rotations is RotationRank.NONE:
        return MotionSpan(RotationRank.ONE, z, before.slides, P)
    centre = _common_point(before, z, P, within)
    if along:
        return replace(before, centre=centre)
    return MotionSpan(RotationRank.SEVERAL, np.zeros(3), (), None if before.slides else centre)


def _common_point(before: MotionSpan, z: Array, P: Array, within: _Tolerance) -> Array | None:
    """A point on the axis (z, P) and on the axes before it; any point of a common axis."""
    if before.centre is None:
        return None
    way = before.centre - P
    if before.rotations is RotationRank.SEVERAL:
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


EARTH = 9.81
"""Reference gravity of the tolerances, m/s^2."""


def weight_of(model: RobotModel, tolerance: float = EXACT) -> float:
    """Magnitude of gravity, exactly 0 where it is none."""
    weight = float(np.linalg.norm(model.gravity))
    return weight if weight > tolerance * EARTH else 0.0


def loads_of(model: RobotModel, tolerance: float = EXACT) -> list[float]:
    """Gravity along the axis of each frame with every joint at zero; none is exactly 0."""
    weight = weight_of(model, tolerance)
    if weight == 0.0:
        return [0.0] * model.f
    gravity = np.asarray(model.gravity) @ model.chain.base_rotation
    slight = tolerance * weight
    loads = [float(gravity @ axes_in_base(model, j)[:, 2]) for j in range(1, model.f + 1)]
    return [0.0 if abs(load) <= slight else load for load in loads]


def axes_in_base(model: RobotModel, j: int) -> Array:
    """Axes of frame j in frame 0 with every joint at zero."""
    R = np.eye(3)
    for number in model.table.path(j) if j else ():
        R = R @ model.chain.rotation[number - 1]
    return R
