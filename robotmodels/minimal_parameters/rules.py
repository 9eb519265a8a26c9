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
from .restraint import EXACT, Restraint, Turning, parallel, restraints

EARTH = 9.81
"""Gravity that motion and torques are compared with, m/s^2."""

Combination = dict[int, Any]
"""Coefficients of standard parameters by their number; numbers or formulas."""

_J = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
_XX, _YY, _ZZ, _MX, _MY, _MZ, _M = 0, 3, 5, 6, 7, 8, 9


@dataclass(frozen=True, slots=True, eq=False)
class RowConstants:
    """Where the joint of a row stands in the frame before it; numbers or formulas.

    Parameters
    ----------
    rotation : ndarray, shape (3, 3)
        Axes of frame j at ``q = 0`` in frame a(j).
    position : ndarray, shape (3,)
        A point of the joint's axis in frame a(j), metres: of a revolute or fixed joint the origin.
    load : float or formula
        Gravity along the axis with every joint at zero, m/s^2.

    Examples
    --------
    >>> RowConstants(np.eye(3), np.zeros(3), -9.81).rotation[2, 2]
    np.float64(1.0)
    """

    rotation: Array
    position: Array
    load: Any


class _Regrouping:
    """The standard parameters that stay, and what has been regrouped into each, while rules run."""

    def __init__(self, model: RobotModel, columns: int) -> None:
        self.antecedent = [int(a) for a in model.chain.antecedent]
        self.stays: dict[int, Combination] = {k: {k: 1} for k in range(columns)}

    def take(self, parameter: int) -> Combination:
        """Remove a parameter; what stood for it."""
        return self.stays.pop(parameter)

    def add(self, parameter: int, factor: Any, combination: Combination) -> None:
        """Regroup a combination into a parameter; one without effect takes nothing."""
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
                self.add(10 * (frame - 1) + _MX + i, moment[i], combination)
            crossed = _skew(P).T @ _skew(moment)
            self.add_tensor(frame, crossed + crossed.T, combination)

    def add_mass(self, frame: int, P: Array, combination: Combination) -> None:
        """Regroup a mass at P into a frame."""
        if frame:
            self.add(10 * (frame - 1) + _M, 1, combination)
            for i in range(3):
                self.add(10 * (frame - 1) + _MX + i, P[i], combination)
            self.add_tensor(frame, _skew(P).T @ _skew(P), combination)


def regrouped(
    model: RobotModel,
    rows: Sequence[RowConstants],
    directions: Sequence[Array],
    drive: Drives,
    tolerance: float = EXACT,
) -> dict[int, Combination]:
    """Apply the rules to all joints, from the last to the first.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames, n joints; decides which rules hold.
    rows : sequence of RowConstants
        The numbers, or the formulas, that the coefficients are made of, row by row.
    directions : sequence of ndarray, shapes (3,)
        The direction of `Restraint` of each frame 1..f, as numbers or formulas.
    drive : bool or collection of DriveKind
        Which of ``Ia``, ``Fv``, ``Fc`` and ``offset`` are among the parameters.
    tolerance : float
        Sine of an angle, and length relative to that of the robot, that count as none.

    Returns
    -------
    dict of int to Combination
        For each parameter that stays, by its number in `parameter_names`, what it stands for.

    References
    ----------
    Seed book section 1.5.3; W. Khalil and F. Bennis, "Comments on direct calculation of minimum set
    of inertial parameters of serial robots", IEEE T-RA 10(1), 1994.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.minimal_parameters.rules import rows_of_numbers
    >>> arm = load("planar_2r")
    >>> len(regrouped(arm, *rows_of_numbers(arm), drive=False))
    4
    """
    f, n = model.f, model.n
    kinds = drive_kinds(drive)
    starts = {kind: 10 * f + n * i for i, kind in enumerate(kinds)}
    work = _Regrouping(model, 10 * f + n * len(kinds))
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
            _drop(work, j, range(_M))
        elif sigma == REVOLUTE:
            _regroup_revolute(work, j, own, row, unloaded, weight == 0.0, tolerance)
        else:
            _regroup_prismatic(work, j, own, row, e, tolerance)
    return work.stays


def rows_of_numbers(
    model: RobotModel, tolerance: float = EXACT
) -> tuple[list[RowConstants], list[Array]]:
    """What `regrouped` takes, as numbers of the table.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames.
    tolerance : float
        As for `regrouped`.

    Returns
    -------
    rows : list of RowConstants
        One per frame.
    directions : list of ndarray, shapes (3,)
        One per frame.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> rows, directions = rows_of_numbers(load("rx90"))
    >>> len(rows), directions[0]
    (6, array([0., 0., 1.]))
    """
    chain = model.chain
    rows = [
        RowConstants(R, P, load)
        for R, P, load in zip(
            chain.rotation, chain.position, loads_of(model, tolerance), strict=True
        )
    ]
    return rows, [restraint.direction for restraint in restraints(model, tolerance)[1:]]


def weight_of(model: RobotModel, tolerance: float = EXACT) -> float:
    """Magnitude of gravity, exactly 0 where it is none.

    Parameters
    ----------
    model : RobotModel
        The robot.
    tolerance : float
        Part of the earth's gravity that counts as none.

    Returns
    -------
    float
        m/s^2.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> weight_of(load("rx90"))
    9.81
    """
    weight = float(np.linalg.norm(model.gravity))
    return weight if weight > tolerance * EARTH else 0.0


def loads_of(model: RobotModel, tolerance: float = EXACT) -> list[float]:
    """Gravity along the axis of each frame with every joint at zero; none is exactly 0.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames.
    tolerance : float
        As for `regrouped`.

    Returns
    -------
    list of float, length f
        m/s^2.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> loads_of(load("cobra_s600"))[2]
    9.81
    """
    weight = weight_of(model, tolerance)
    if weight == 0.0:
        return [0.0] * model.f
    gravity = np.asarray(model.gravity) @ model.chain.base_rotation
    slight = tolerance * weight
    loads = [float(gravity @ _in_base(model, j)[:, 2]) for j in range(1, model.f + 1)]
    return [0.0 if abs(load) <= slight else load for load in loads]


def _regroup_revolute(
    work: _Regrouping, j: int, own: Restraint, row: RowConstants, unloaded: bool, weightless: bool,
    tolerance: float,
) -> None:  # fmt: skip
    first, a = 10 * (j - 1), work.antecedent[j - 1]
    z, P = row.rotation[:, 2], row.position
    work.add_mass(a, P, work.take(first + _M))
    if own.turning is Turning.ONE_DIRECTION:
        _drop(work, j, (*range(_ZZ), _MZ))
        across = own.slides_across(own.direction, tolerance)
        if own.centre is not None and unloaded and not across:
            _drop(work, j, (_MX, _MY))
        return
    yy = work.take(first + _YY)
    work.add(first + _XX, -1, yy)
    work.add_tensor(a, np.eye(3, dtype=np.int64) - np.outer(z, z), yy)
    work.add_moment(a, z, P, work.take(first + _MZ))
    if own.centre is not None and weightless:
        # all turns about one point: first moments are those of an inertia about it
        for i, place in ((0, 2), (1, 4)):
            work.add(first + place, own.centre[2], work.take(first + _MX + i))


def _regroup_prismatic(
    work: _Regrouping, j: int, own: Restraint, row: RowConstants, e: Array, tolerance: float
) -> None:
    first, a, R = 10 * (j - 1), work.antecedent[j - 1], row.rotation
    for place in range(6):
        tensor = R @ _symmetric(place) @ R.T
        work.add_tensor(a, tensor, work.take(first + place))
    if own.turning is not Turning.ONE_DIRECTION:
        return
    last = max(i for i in range(3) if abs(own.direction[i]) > tolerance)
    along = work.take(first + _MX + last)
    for i in range(last):
        if abs(own.direction[i]) > tolerance:
            work.add(first + _MX + i, -e[i] / e[last], along)
    if parallel(own.direction, np.array([0.0, 0.0, 1.0]), tolerance):
        for i in range(2):
            work.add_moment(a, R[:, i], row.position, work.take(first + _MX + i))


def _regroup_body(work: _Regrouping, j: int, row: RowConstants) -> None:
    first, a, R, P = 10 * (j - 1), work.antecedent[j - 1], row.rotation, row.position
    for place in range(6):
        work.add_tensor(a, R @ _symmetric(place) @ R.T, work.take(first + place))
    for i in range(3):
        work.add_moment(a, R[:, i], P, work.take(first + _MX + i))
    work.add_mass(a, P, work.take(first + _M))


def _regroup_drive(
    work: _Regrouping, model: RobotModel, j: int, drives: Mapping[DriveKind, int],
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
            work.add(first + _ZZ, 1, work.take(Ia))
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
    work.add(first + _M, factor, moved)
    a = work.antecedent[j - 1]
    work.add_mass(a, row.position, {k: -factor * c for k, c in moved.items()})


def _directions_along(
    model: RobotModel, found: tuple[Restraint, ...], down: Array, tolerance: float
) -> list[bool]:
    """Of each frame, whether it turns about one direction and gravity acts along it."""
    return [
        restraint.turning is Turning.ONE_DIRECTION
        and parallel(_in_base(model, j) @ restraint.direction, down, tolerance)
        for j, restraint in enumerate(found)
    ]


def _in_base(model: RobotModel, j: int) -> Array:
    """Axes of frame j in frame 0 with every joint at zero."""
    R = np.eye(3)
    for number in model.table.path(j) if j else ():
        R = R @ model.chain.rotation[number - 1]
    return R


def _drop(work: _Regrouping, j: int, places: Sequence[int] | range) -> None:
    for place in places:
        work.take(10 * (j - 1) + place)


def _symmetric(place: int) -> NDArray[np.int64]:
    tensor = np.zeros((3, 3), dtype=np.int64)
    i, k = _J[place]
    tensor[i, k] = tensor[k, i] = 1
    return tensor


def _skew(p: Array) -> Array:
    return np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0]])


def _is_zero(value: Any) -> bool:
    return bool(value == 0) or (isinstance(value, float) and abs(value) < 1e-14)
