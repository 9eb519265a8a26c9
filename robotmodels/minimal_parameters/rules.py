"""Khalil's rules: which standard parameters a joint moves to its antecedent, or has no effect.

Seed book section 1.5.3. Each rule is an identity between the effects of parameters. From the last
frame to the first, the parameters a rule names are added, with its coefficients, to those that
stay; what is added there moves on when that frame's turn comes.

For joint j with antecedent a, z its axis and P its origin in frame a, S(.) the matrix of the vector
product:

- revolute: ``YY_j`` goes to ``-XX_j`` and ``J_a += 1 - z z^T``; ``MZ_j`` to ``MS_a += z`` and
  ``J_a += S(P)^T S(z) + S(z)^T S(P)``; ``M_j`` to ``M_a += 1``, ``MS_a += P``,
  ``J_a += S(P)^T S(P)``;
- prismatic: the inertia tensor goes to ``J_a``, turned; fixed: all ten parameters go;
- a link that only translates shows only its mass; one that turns about one direction e shows only
  ``e^T J e``, and no first moment along e;
- prismatic along e: the first moments across e go to ``MS_a`` and ``J_a``, as if it did not slide;
  where nothing before it slides along it, ``Ia_j`` goes to ``M_j`` less what ``M_j`` is in frame a.
  Where gravity loads it the three together are the constant ``offset_j``, which then goes instead;
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

from .._arrays import Array
from ..drive import DriveKind, Drives, drive_kinds
from ..geometry import FIXED, REVOLUTE
from ..model import RobotModel
from .gravity import axes_in_base, loads_of, weight_of
from .regrouping import MX, MY, MZ, XX, YY, ZZ, Combination, M, Regrouping, unit_tensor
from .restraint import EXACT, Restraint, Turning, parallel, restraints


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
    found = restraints(model, tolerance)
    gravity = np.asarray(model.gravity) @ model.chain.base_rotation
    weight = weight_of(model, tolerance)
    down = gravity / weight if weight > 0 else np.zeros(3)
    vertical = _directions_along(model, found, down, tolerance)
    loads = loads_of(model, tolerance)
    for j in range(f, 0, -1):
        joint = int(model.chain.joint[j - 1])
        sigma = int(model.chain.sigma[j - 1])
        before, own = found[work.antecedent[j - 1]], found[j]
        row, e = rows[j - 1], directions[j - 1]
        unloaded = weight == 0.0 or vertical[j]
        if sigma != FIXED:
            drives = {kind: start + joint for kind, start in starts.items()}
            _regroup_drive(work, model, j, drives, before, row, loads[j - 1] != 0.0, tolerance)
        if sigma == FIXED:
            _regroup_body(work, j, row)
        elif own.turning is Turning.NONE:
            _drop(work, j, range(M))
        elif sigma == REVOLUTE:
            _regroup_revolute(work, j, own, row, unloaded, weight == 0.0, tolerance)
        else:
            _regroup_prismatic(work, j, own, row, e, tolerance)
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
    return rows, [restraint.direction for restraint in restraints(model, tolerance)[1:]]


def _regroup_revolute(
    work: Regrouping, j: int, own: Restraint, row: RowConstants, unloaded: bool, weightless: bool,
    tolerance: float,
) -> None:  # fmt: skip
    first, a = 10 * (j - 1), work.antecedent[j - 1]
    z, P = row.rotation[:, 2], row.position
    work.add_mass(a, P, work.take(first + M))
    if own.turning is Turning.ONE_DIRECTION:
        _drop(work, j, (*range(ZZ), MZ))
        across = own.slides_across(own.direction, tolerance)
        if own.centre is not None and unloaded and not across:
            _drop(work, j, (MX, MY))
        return
    yy = work.take(first + YY)
    work.add(first + XX, -1, yy)
    work.add_tensor(a, np.eye(3, dtype=np.int64) - np.outer(z, z), yy)
    work.add_moment(a, z, P, work.take(first + MZ))
    if own.centre is not None and weightless:
        # all turns about one point: first moments are those of an inertia about it
        for i, place in ((0, 2), (1, 4)):
            work.add(first + place, own.centre[2], work.take(first + MX + i))


def _regroup_prismatic(
    work: Regrouping, j: int, own: Restraint, row: RowConstants, e: Array, tolerance: float
) -> None:
    first, a, R = 10 * (j - 1), work.antecedent[j - 1], row.rotation
    for place in range(6):
        tensor = R @ unit_tensor(place) @ R.T
        work.add_tensor(a, tensor, work.take(first + place))
    if own.turning is not Turning.ONE_DIRECTION:
        return
    last = max(i for i in range(3) if abs(own.direction[i]) > tolerance)
    along = work.take(first + MX + last)
    for i in range(last):
        if abs(own.direction[i]) > tolerance:
            work.add(first + MX + i, -e[i] / e[last], along)
    if parallel(own.direction, np.array([0.0, 0.0, 1.0]), tolerance):
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
    work: Regrouping, model: RobotModel, j: int, drives: Mapping[DriveKind, int],
    before: Restraint, row: RowConstants, loaded: bool, tolerance: float,
) -> None:  # fmt: skip
    first, Ia, offset = 10 * (j - 1), drives.get(DriveKind.IA), drives.get(DriveKind.OFFSET)
    if Ia is None:
        return
    z = model.chain.rotation[j - 1][:, 2]
    if model.chain.sigma[j - 1] == REVOLUTE:
        is_first = before.turning is Turning.NONE
        crosses = before.turning is Turning.ONE_DIRECTION and abs(z @ before.direction) <= tolerance
        if is_first or crosses:
            work.add(first + ZZ, 1, work.take(Ia))
        return
    still = before.turning is Turning.NONE or (
        before.turning is Turning.ONE_DIRECTION and parallel(z, before.direction, tolerance)
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
    model: RobotModel, found: tuple[Restraint, ...], down: Array, tolerance: float
) -> list[bool]:
    """Of each frame, whether it turns about one direction and gravity acts along it."""
    return [
        restraint.turning is Turning.ONE_DIRECTION
        and parallel(axes_in_base(model, j) @ restraint.direction, down, tolerance)
        for j, restraint in enumerate(found)
    ]


def _drop(work: Regrouping, j: int, places: Sequence[int] | range) -> None:
    for place in places:
        work.take(10 * (j - 1) + place)
