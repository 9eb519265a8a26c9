"""Khalil's rules: standard parameters regrouped into the antecedent, or without effect.

Seed book section 1.5.3. Each rule is an identity between the effects of parameters. From the last
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

Source: W. Khalil and F. Bennis, "Comments on direct calculation of minimum set of inertial
parameters of serial robots", IEEE T-RA 10(1), 1994.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..drive import DriveKind, Drives, drive_kinds
from ..geometry import FIXED, REVOLUTE
from ..model import RobotModel
from .motion_span import (
    EXACT,
    MotionSpan,
    RotationRank,
    axes_in_base,
    loads_of,
    motion_spans,
    parallel,
    weight_of,
)

Combination = dict[int, Any]
"""Coefficients of standard parameters by their number; numbers or formulas."""

_J = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
XX, YY, ZZ, MX, MY, MZ, M = 0, 3, 5, 6, 7, 8, 9


class Regrouping:
    """State of the rules: kept standard parameters, and the combination regrouped into each."""

    def __init__(self, model: RobotModel, columns: int) -> None:
        self.antecedent = [int(a) for a in model.chain.antecedent]
        self.stays: dict[int, Combination] = {k: {k: 1} for k in range(columns)}

    def take(self, parameter: int) -> Combination:
        """Remove a parameter and return its combination."""
        return self.stays.pop(parameter)

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


def unit_tensor(place: int) -> NDArray[np.int64]:
    """The inertia tensor whose parameter at a place, XX to ZZ, is 1 and whose others are 0."""
    tensor = np.zeros((3, 3), dtype=np.int64)
    i, k = _J[place]
    tensor[i, k] = tensor[k, i] = 1
    return tensor


def _skew(p: Array) -> Array:
    return np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0]])


def _is_zero(value: Any) -> bool:
    return bool(value == 0) or (isinstance(value, float) and abs(value) < 1e-14)


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
    f, n = model.f, model.n
    kinds = drive_kinds(drive)
    starts = {kind: 10 * f + n * i for i, kind in enumerate(kinds)}
    work = Regrouping(model, 10 * f + n * len(kinds))
    spans = motion_spans(model, tolerance)
    gravity = np.asarray(model.gravity) @ model.chain.base_rotation
    weight = weight_of(model, tolerance)
    down = gravity / weight if weight > 0 else np.zeros(3)
    vertical = _directions_along(model, spans, down, tolerance)
    loads = loads_of(model, tolerance)
    for j in range(f, 0, -1):
        joint = int(model.chain.joint[j - 1])
        sigma = int(model.chain.sigma[j - 1])
        before, span = spans[work.antecedent[j - 1]], spans[j]
        row, e = rows[j - 1], directions[j - 1]
        unloaded = weight == 0.0 or vertical[j]
        if sigma != FIXED:
            drives = {kind: start + joint for kind, start in starts.items()}
            _regroup_drive(work, model, j, drives, before, row, loads[j - 1] != 0.0, tolerance)
        if sigma == FIXED:
            _regroup_body(work, j, row)
        elif span.rotations is RotationRank.NONE:
            _drop(work, j, range(M))
        elif sigma == REVOLUTE:
            _regroup_revolute(work, j, span, row, unloaded, weight == 0.0, tolerance)
        else:
            _regroup_prismatic(work, j, span, row, e, tolerance)
    return work.stays


def rows_of_numbers(
    model: RobotModel, tolerance: float = EXACT
) -> tuple[list[RowConstants], list[Array]]:
    """Numeric arguments of `regrouped` from the table."""
    chain = model.chain
    rows = [
        RowConstants(R, P, load)
        for R, P, load in zip(
            chain.rotation, chain.position, loads_of(model, tolerance), strict=True
        )
    ]
    return rows, [span.direction for span in motion_spans(model, tolerance)[1:]]


def _regroup_revolute(
    work: Regrouping,
    j: int,
    span: MotionSpan,
    row: RowConstants,
    unloaded: bool,
    weightless: bool,
    tolerance: float,
) -> None:
    first, a = 10 * (j - 1), work.antecedent[j - 1]
    z, P = row.rotation[:, 2], row.position
    work.add_mass(a, P, work.take(first + M))
    if span.rotations is RotationRank.ONE:
        _drop(work, j, (*range(ZZ), MZ))
        across = span.slides_across(span.direction, tolerance)
        if span.centre is not None and unloaded and not across:
            _drop(work, j, (MX, MY))
        return
    yy = work.take(first + YY)
    work.add(first + XX, -1, yy)
    work.add_tensor(a, np.eye(3, dtype=np.int64) - np.outer(z, z), yy)
    work.add_moment(a, z, P, work.take(first + MZ))
    if span.centre is not None and weightless:
        # all rotations about one point: first moments act as an inertia about it
        for i, place in ((0, 2), (1, 4)):
            work.add(first + place, span.centre[2], work.take(first + MX + i))


def _regroup_prismatic(
    work: Regrouping, j: int, span: MotionSpan, row: RowConstants, e: Array, tolerance: float
) -> None:
    first, a, R = 10 * (j - 1), work.antecedent[j - 1], row.rotation
    for place in range(6):
        tensor = R @ unit_tensor(place) @ R.T
        work.add_tensor(a, tensor, work.take(first + place))
    if span.rotations is not RotationRank.ONE:
        return
    last = max(i for i in range(3) if abs(span.direction[i]) > tolerance)
    along = work.take(first + MX + last)
    for i in range(last):
        if abs(span.direction[i]) > tolerance:
            work.add(first + MX + i, -e[i] / e[last], along)
    if parallel(span.direction, np.array([0.0, 0.0, 1.0]), tolerance):
        for i in range(2):
            work.add_moment(a, R[:, i], row.position, work.take(first + MX + i))


def _regroup_body(work: Regrouping, j: int, row: RowConstants) -> None:
    first, a, R, P = 10 * (j - 1), work.antecedent[j - 1], row.rotation, row.position
    for place in range(6):
        work.add_tensor(a, R @ unit_tensor(place) @ R.T, work.take(first + place))
    for i in range(3):
        work.add_moment(a, R[:, i], P, work.take(first + MX + i))
    work.add_mass(a, P, work.take(first + M))


def _regroup_drive(
    work: Regrouping,
    model: RobotModel,
    j: int,
    drives: Mapping[DriveKind, int],
    before: MotionSpan,
    row: RowConstants,
    loaded: bool,
    tolerance: float,
) -> None:
    first, Ia, offset = 10 * (j - 1), drives.get(DriveKind.IA), drives.get(DriveKind.OFFSET)
    if Ia is None:
        return
    z = model.chain.rotation[j - 1][:, 2]
    if model.chain.sigma[j - 1] == REVOLUTE:
        is_first = before.rotations is RotationRank.NONE
        crosses = before.rotations is RotationRank.ONE and abs(z @ before.direction) <= tolerance
        if is_first or crosses:
            work.add(first + ZZ, 1, work.take(Ia))
        return
    still = before.rotations is RotationRank.NONE or (
        before.rotations is RotationRank.ONE and parallel(z, before.direction, tolerance)
    )
    if not still or before.slides_along(z, tolerance):
        return
    # M_j less the same mass in frame a acts on joint j alone: as Ia_j and, loaded, as a constant
    if loaded:
        if offset is None:
            return
        moved, factor = work.take(offset), -1 / row.load
        work.add(Ia, -factor, moved)
    else:
        moved, factor = work.take(Ia), 1
    work.add(first + M, factor, moved)
    a = work.antecedent[j - 1]
    work.add_mass(a, row.position, {k: -factor * c for k, c in moved.items()})


def _directions_along(
    model: RobotModel, spans: tuple[MotionSpan, ...], down: Array, tolerance: float
) -> list[bool]:
    """Of each frame, whether it turns about one direction and gravity acts along it."""
    return [
        span.rotations is RotationRank.ONE
        and parallel(axes_in_base(model, j) @ span.direction, down, tolerance)
        for j, span in enumerate(spans)
    ]


def _drop(work: Regrouping, j: int, places: Sequence[int] | range) -> None:
    for place in places:
        work.take(10 * (j - 1) + place)
