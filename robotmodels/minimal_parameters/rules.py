"""Khalil's rules: standard parameters regrouped into the antecedent, or without effect.

Book section 1.5.3. Each rule is an identity between the effects of parameters. From the last
frame to the first, the parameters of a rule are added, with its coefficients, to those kept; later
rules of that frame regroup them further.

For joint j with antecedent a, z its axis and P its origin in frame a, S(.) the matrix of the vector
product:

- revolute: ``YY_j`` goes to ``-XX_j`` and ``J_a += 1 - z z^T``; ``MZ_j`` to ``MS_a += z`` and
  ``J_a += S(P)^T S(z) + S(z)^T S(P)``; ``M_j`` to ``M_a += 1``, ``MS_a += P``,
  ``J_a += S(P)^T S(P)``;
- prismatic: the inertia tensor goes to ``J_a``, turned; fixed: all ten parameters go;
- a link that only translates shows only its mass; one that turns about one direction e shows only
  ``e^T J e``, and no first moment along e;
- prismatic along e: the first moments across e go to ``MS_a`` and ``J_a``, as if it did not slide;
  where no prismatic joint before it moves along e, ``Ia_j`` goes to ``M_j`` minus
  ``M_j`` in frame a. Where gravity loads it the three together are the constant ``offset_j``,
  which then goes instead;
- ``Ia`` of the first revolute joint goes to its ``ZZ``, and that of the first one that is not
  parallel to it, if it is perpendicular to it.

The rules for one joint hold wherever a link can move freely. Near the base it cannot: before the
first revolute joint it only translates, and as long as all revolute axes are parallel it rotates
about one direction, which is fixed in the world and in the link (`MotionSpan`). Without gravity
rotations about one point leave fewer parameters: the numeric method decides there.

Source: W. Khalil and F. Bennis, "Comments on direct calculation of minimum set of inertial
parameters of serial robots", IEEE T-RA 10(1), 1994.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from math import sqrt
from typing import Any

import numpy as np

from .._arrays import Array
from ..drive import DriveKind, Drives, drive_kinds
from ..geometry import FIXED, REVOLUTE
from ..model import RobotModel

EXACT = 1e-11
"""Tolerance for parallel (sine), perpendicular (cosine) and intersecting axes (relative length)."""
EARTH = 9.81
"""Reference gravity of the tolerances, m/s^2."""
_LEAST = 1e-4
"""Least reach of a robot, m."""

Combination = dict[int, Any]
"""Coefficients of standard parameters by their number; numbers or formulas."""

_J = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
XX, YY, ZZ, MX, MY, MZ, M = 0, 3, 5, 6, 7, 8, 9


# --- motion of links -----------------------------------------------------------------------------


class RotationRank(Enum):
    """Directions about which a link can rotate."""

    NONE, ONE, SEVERAL = range(3)


@dataclass(frozen=True, slots=True, eq=False)
class MotionSpan:
    """Possible rotations and translations of a link, in the axes of its frame.

    The centre is a point on the only axis of rotation, None where there are several.
    """

    rotations: RotationRank
    direction: Array
    slides: tuple[Array, ...]
    centre: Array | None


def motion_spans(model: RobotModel, tolerance: float = EXACT) -> tuple[MotionSpan, ...]:
    """The span of every link, R_0 first."""
    chain, length = model.chain, tolerance * reach(model)
    spans = [MotionSpan(RotationRank.NONE, np.zeros(3), (), np.zeros(3))]
    for k in range(model.f):
        before, R, P = spans[int(chain.antecedent[k])], chain.rotation[k], chain.position[k]
        after = _with_joint(before, int(chain.sigma[k]), R[:, 2], P, tolerance, length)
        slides = tuple(slide @ R for slide in after.slides)
        centre = None if after.centre is None else (after.centre - P) @ R
        spans.append(MotionSpan(after.rotations, after.direction @ R, slides, centre))
    return tuple(spans)


def _with_joint(
    before: MotionSpan, sigma: int, z: Array, P: Array, angle: float, length: float
) -> MotionSpan:
    """The span behind a joint with axis z through P, still in the axes of the antecedent."""
    if sigma == FIXED:
        return before
    along = before.rotations is RotationRank.ONE and parallel(z, before.direction, angle)
    if sigma != REVOLUTE:
        slides = (*before.slides, z) if before.rotations is not RotationRank.SEVERAL else ()
        # a slide along the only axis does not move the axis
        keeps = before.rotations is RotationRank.NONE or along
        return replace(before, slides=slides, centre=before.centre if keeps else None)
    if before.rotations is RotationRank.NONE:
        return MotionSpan(RotationRank.ONE, z, before.slides, P)
    if not along:
        return MotionSpan(RotationRank.SEVERAL, np.zeros(3), (), None)
    same = before.centre is not None and _length_of_cross(z, before.centre - P) <= length
    return replace(before, centre=P if same else None)


def parallel(a: Array, b: Array, tolerance: float = EXACT) -> bool:
    """Whether two unit vectors are parallel."""
    return _length_of_cross(a, b) <= tolerance


def _length_of_cross(a: Array, b: Array) -> float:
    x, y, z = a.tolist()
    u, v, w = b.tolist()
    return sqrt((y * w - z * v) ** 2 + (z * u - x * w) ** 2 + (x * v - y * u) ** 2)


def reach(model: RobotModel) -> float:
    """Reach of the table, metres; 1 where its lengths are zero."""
    table = model.table
    lengths = float(np.sqrt(table.d**2 + table.r**2 + table.b**2).sum())
    return lengths if lengths > _LEAST else 1.0


def gravities(model: RobotModel, tolerance: float = EXACT) -> list[Array]:
    """Gravity in the axes of each frame, R_0 first, with every joint at zero; none is exactly 0."""
    gravity = np.asarray(model.gravity) @ model.chain.base_rotation
    found = [gravity * (np.linalg.norm(gravity) > tolerance * EARTH)]
    for k, antecedent in enumerate(model.chain.antecedent.tolist()):
        found.append(found[antecedent] @ model.chain.rotation[k])
    return found


def loads_of(model: RobotModel, tolerance: float = EXACT) -> list[float]:
    """Gravity along the axis of each frame with every joint at zero; none is exactly 0."""
    least = tolerance * float(np.linalg.norm(model.gravity))
    loads = (float(gravity[2]) for gravity in gravities(model, tolerance)[1:])
    return [load if abs(load) > least else 0.0 for load in loads]


# --- regrouping ----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class RowConstants:
    """Constants of a joint in the frame before it; numbers or formulas."""

    rotation: Array
    position: Array
    load: Any


def regrouped(
    model: RobotModel,
    rows: Sequence[RowConstants],
    directions: Sequence[Array],
    drive: Drives,
    tolerance: float = EXACT,
) -> dict[int, Combination]:
    """Apply the rules to all joints, from the last to the first."""
    work = _Regrouping(model, rows, directions, drive_kinds(drive), tolerance)
    for j in range(model.f, 0, -1):
        work.apply(j)
    return work.stays


def rows_of_numbers(
    model: RobotModel, tolerance: float = EXACT
) -> tuple[list[RowConstants], list[Array]]:
    """Numeric arguments of `regrouped` from the table."""
    chain, loads = model.chain, loads_of(model, tolerance)
    rows = [RowConstants(*row) for row in zip(chain.rotation, chain.position, loads, strict=True)]
    return rows, [span.direction for span in motion_spans(model, tolerance)[1:]]


class _Regrouping:
    """State of the rules: kept standard parameters, and the combination regrouped into each."""

    def __init__(
        self,
        model: RobotModel,
        rows: Sequence[RowConstants],
        directions: Sequence[Array],
        kinds: Sequence[DriveKind],
        tolerance: float,
    ) -> None:
        f, n = model.f, model.n
        self.model, self.rows, self.directions = model, rows, directions
        self.tolerance = tolerance
        self.starts = {kind: 10 * f + n * i for i, kind in enumerate(kinds)}
        self.stays: dict[int, Combination] = {k: {k: 1} for k in range(10 * f + n * len(kinds))}
        self.spans, self.gravity = motion_spans(model, tolerance), gravities(model, tolerance)

    # --- sums ---

    def drop(self, j: int, places: Iterable[int]) -> None:
        """Remove parameters of a link that have no effect."""
        for place in places:
            self.stays.pop(10 * (j - 1) + place)

    def add(self, parameter: int, factor: Any, combination: Combination) -> None:
        """Regroup a combination into a parameter; one without effect is skipped."""
        place = self.stays.get(parameter)
        if place is None or _is_zero(factor):
            return
        for k, coefficient in combination.items():
            total = place.get(k, 0) + factor * coefficient
            if _is_zero(total):
                place.pop(k, None)
            else:
                place[k] = total

    def add_tensor(self, frame: int, tensor: Array, combination: Combination) -> None:
        """Regroup into the inertia tensor of a frame; frame 0 does not move."""
        if frame:
            for place, (i, k) in enumerate(_J):
                self.add(10 * (frame - 1) + place, tensor[i, k], combination)

    def add_moment(self, frame: int, moment: Array, P: Array, combination: Combination) -> None:
        """Regroup a first moment at P into a frame."""
        if frame:
            for i in range(3):
                self.add(10 * (frame - 1) + MX + i, moment[i], combination)
            crossed = _skew(P).T @ _skew(moment)
            self.add_tensor(frame, crossed + crossed.T, combination)

    def add_mass(self, frame: int, P: Array, combination: Combination) -> None:
        """Regroup a mass at P into a frame."""
        if frame:
            self.add(10 * (frame - 1) + M, 1, combination)
            for i in range(3):
                self.add(10 * (frame - 1) + MX + i, P[i], combination)
            self.add_tensor(frame, _skew(P).T @ _skew(P), combination)

    def move_tensor(self, j: int, frame: int) -> None:
        """Regroup the inertia tensor of a link, turned, into a frame."""
        R = self.rows[j - 1].rotation
        for place, (i, k) in enumerate(_J):
            unit = np.zeros((3, 3), dtype=np.int64)
            unit[i, k] = unit[k, i] = 1
            self.add_tensor(frame, R @ unit @ R.T, self.stays.pop(10 * (j - 1) + place))

    # --- rules ---

    def apply(self, j: int) -> None:
        """Apply the rules of a joint; those of its drive are the first."""
        a, sigma = int(self.model.chain.antecedent[j - 1]), self.model.chain.sigma[j - 1]
        if sigma == FIXED:
            self._regroup_body(j, a)
            return
        self._regroup_drive(j, a)
        if self.spans[j].rotations is RotationRank.NONE:
            self.drop(j, range(M))
        elif sigma == REVOLUTE:
            self._regroup_revolute(j, a)
        else:
            self._regroup_prismatic(j, a)

    def _regroup_revolute(self, j: int, a: int) -> None:
        first, span, row = 10 * (j - 1), self.spans[j], self.rows[j - 1]
        z, P = row.rotation[:, 2], row.position
        weight = float(np.linalg.norm(self.gravity[j]))
        self.add_mass(a, P, self.stays.pop(first + M))
        if span.rotations is RotationRank.ONE:
            e = span.direction
            self.drop(j, (*range(ZZ), MZ))
            unloaded = not weight or parallel(e, self.gravity[j] / weight, self.tolerance)
            across = any(not parallel(slide, e, self.tolerance) for slide in span.slides)
            if span.centre is not None and unloaded and not across:
                self.drop(j, (MX, MY))
            return
        yy = self.stays.pop(first + YY)
        self.add(first + XX, -1, yy)
        self.add_tensor(a, np.eye(3, dtype=np.int64) - np.outer(z, z), yy)
        self.add_moment(a, z, P, self.stays.pop(first + MZ))

    def _regroup_prismatic(self, j: int, a: int) -> None:
        first, span, row, e = 10 * (j - 1), self.spans[j], self.rows[j - 1], self.directions[j - 1]
        self.move_tensor(j, a)
        if span.rotations is not RotationRank.ONE:
            return
        last = max(i for i in range(3) if abs(span.direction[i]) > self.tolerance)
        along = self.stays.pop(first + MX + last)
        for i in range(last):
            if abs(span.direction[i]) > self.tolerance:
                self.add(first + MX + i, -e[i] / e[last], along)
        if parallel(span.direction, np.array([0.0, 0.0, 1.0]), self.tolerance):
            for i in range(2):
                moment = self.stays.pop(first + MX + i)
                self.add_moment(a, row.rotation[:, i], row.position, moment)

    def _regroup_body(self, j: int, a: int) -> None:
        first, R, P = 10 * (j - 1), self.rows[j - 1].rotation, self.rows[j - 1].position
        self.move_tensor(j, a)
        for i in range(3):
            self.add_moment(a, R[:, i], P, self.stays.pop(first + MX + i))
        self.add_mass(a, P, self.stays.pop(first + M))

    def _regroup_drive(self, j: int, a: int) -> None:
        joint, first = int(self.model.chain.joint[j - 1]), 10 * (j - 1)
        if DriveKind.IA not in self.starts:
            return
        Ia, row, before = self.starts[DriveKind.IA] + joint, self.rows[j - 1], self.spans[a]
        z = self.model.chain.rotation[j - 1][:, 2]
        is_first, one = before.rotations is RotationRank.NONE, before.rotations is RotationRank.ONE
        if self.model.chain.sigma[j - 1] == REVOLUTE:
            crosses = one and abs(z @ before.direction) <= self.tolerance
            if is_first or crosses:
                self.add(first + ZZ, 1, self.stays.pop(Ia))
            return
        still = is_first or (one and parallel(z, before.direction, self.tolerance))
        if not still or any(abs(slide @ z) > self.tolerance for slide in before.slides):
            return
        # M_j less the same mass in frame a acts on joint j alone, as Ia_j and, loaded, a constant
        if row.load != 0:
            if DriveKind.OFFSET not in self.starts:
                return
            moved, factor = self.stays.pop(self.starts[DriveKind.OFFSET] + joint), -1 / row.load
            self.add(Ia, -factor, moved)
        else:
            moved, factor = self.stays.pop(Ia), 1
        self.add(first + M, factor, moved)
        self.add_mass(a, row.position, {k: -factor * c for k, c in moved.items()})


def _skew(p: Array) -> Array:
    return np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0]])


def _is_zero(value: Any) -> bool:
    return bool(value == 0) or (isinstance(value, float) and abs(value) < 1e-14)
