"""Singular curves of three-joint arms, their cusps and nodes.

They are the same for all values of the first joint: the section is half a plane through its axis,
or a plane across it if it slides; for a planar arm of two joints its plane. Other arms have a
status instead.

Parameters
----------
arm : RobotModel
    The robot.
limits : bool
    Whether the limits of the last two joints cut the curves and add curves of their own; for
    cusps and nodes limits of revolute joints do not count.

Raises
------
InvalidValueError
    A slide without limits, or something that is no robot.

References
----------
Seed book sections 3.3.6, 3.4.2 and 3.4.4; M. Baili, P. Wenger and D. Chablat, "A classification of
3R orthogonal manipulators by the topology of their workspace", ICRA 2004.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from .._arrays import Array, read_only
from .._outcomes import Outcome
from ..model import RobotModel, check_model
from .arms import Result, SectionArm, checked_flag, section_arm
from .arrangement import Line, cut, pieces
from .level_curves import Curve, last_two_ranges, level_curves

Equations = Callable[[SectionArm, Array], Array]
_SAME = 1e-6  # rad or m, between special points
_STEPS = 50


class SectionStatus(Outcome):
    """Outcome of an analysis of the section of an arm."""

    FOUND = 0, "All curves were followed to their ends."
    INCOMPLETE = 1, "Some curve could not be followed to its end: points may be missing."
    NOT_DEFINED = (
        2, "The arm has no section: its position is not determined by three joints, or by two in "
        "a plane.",
    )  # fmt: skip


class CurveKind(Enum):
    """Kinds of curves by the regions that they separate.

    Examples
    --------
    >>> CurveKind("limit")
    <CurveKind.LIMIT: 'limit'>
    """

    BOUNDARY = "boundary"
    INTERNAL = "internal"
    LIMIT = "limit"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SingularCurves(Result):
    """Singular curves of an arm in joint space and in its section.

    Parameters
    ----------
    joint : tuple of ndarray, shape (K, n)
        Points of each curve, rad or m; the first joint is zero, angles run on beyond pi.
    section : tuple of ndarray, shape (K, 2)
        The same points in the section, m.
    kind : tuple of CurveKind
        ``BOUNDARY`` has no posture on one side, ``INTERNAL`` has postures on both; on ``LIMIT`` a
        joint is at its limit. A curve is broken where its kind changes.
    status : SectionStatus
        Whether all of them were found.
    """

    joint: tuple[Array, ...]
    section: tuple[Array, ...]
    kind: tuple[CurveKind, ...]
    status: SectionStatus

    def reason(self) -> str:
        """The status as a sentence."""
        return self.status.sentence

    def __repr__(self) -> str:
        kinds = [kind.value for kind in self.kind]
        text = ", ".join(f"{kinds.count(k.value)} {k.value}" for k in CurveKind)
        return f"<SingularCurves: {text}; {self.reason()}>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SpecialPoints(Result):
    """Cusps or nodes of the singular curves in the section of an arm.

    Parameters
    ----------
    q : ndarray, shape (k, n) or (k, 2, n)
        Configurations, rad or m, the first joint at zero; of a node the two that meet.
    section : ndarray, shape (k, 2)
        Where they are in the section, m.
    residual : ndarray, shape (k,)
        What is left of the equations, in units of the arm.
    status : SectionStatus
        Whether all of them were found.
    """

    q: Array
    section: Array
    residual: Array
    status: SectionStatus

    def __len__(self) -> int:
        return len(self.section)

    def reason(self) -> str:
        """The status as a sentence."""
        return self.status.sentence

    def __repr__(self) -> str:
        return f"<SpecialPoints: {len(self)} in the section; {self.reason()}>"


def singular_curves(arm: RobotModel, limits: bool = True) -> SingularCurves:
    """Singular curves of an arm whose position three joints determine, or two in a plane.

    Returns
    -------
    SingularCurves
        Curves in joint space and in the section.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> curves = singular_curves(load("planar_2r"), limits=False)
    >>> [kind.value for kind in curves.kind], curves.joint[0].shape[1]
    (['boundary', 'internal'], 2)
    """
    check_model(arm)
    section = section_arm(arm)
    if section is None:
        return SingularCurves((), (), (), SectionStatus.NOT_DEFINED)
    found, lines = pieces(arm, checked_flag(limits, "limits"))
    joint, image, kinds = [], [], []
    for k, line in enumerate(lines):
        runs: list[tuple[CurveKind, list[Array], list[Array]]] = []
        for piece in (p for p in found if p.line == k):
            edge = (piece.left == 0) != (piece.right == 0)
            kind = CurveKind.BOUNDARY if edge else CurveKind.INTERNAL
            kind = CurveKind.LIMIT if line.of_limit else kind
            if not runs or runs[-1][0] is not kind:
                runs.append((kind, [], []))
            runs[-1][1].append(piece.x)
            runs[-1][2].append(piece.section)
        for kind, x, points in runs:
            joint.append(read_only(_postures(arm, section, np.concatenate(x))))
            image.append(read_only(np.concatenate(points)))
            kinds.append(kind)
    own = [Curve(line.x, line.closed) for line in lines if not line.of_limit]
    status = _status(own, last_two_ranges(arm, section, limits).bounds)
    return SingularCurves(tuple(joint), tuple(image), tuple(kinds), status)


def cusps(arm: RobotModel) -> SpecialPoints:
    """Cusps: points of the section where three postures of an arm meet.

    There the singular curve in joint space is tangent to the direction in which the arm moves
    without moving its tool. An arm with cusps can change posture without being singular.

    Returns
    -------
    SpecialPoints
        One configuration for each cusp.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> cusps(load("planar_2r"))
    <SpecialPoints: 0 in the section; All curves were followed to their ends.>
    """
    check_model(arm)
    section = section_arm(arm)
    if section is None:
        return _nothing(arm.n, False)
    ranges = last_two_ranges(arm, section, False)
    curves = level_curves(section, ranges)
    x, residual = cusps_of(section, curves)
    return SpecialPoints(
        read_only(_postures(arm, section, x)),
        read_only(section.values(x)[:, :2]),
        read_only(residual),
        _status(curves, ranges.bounds),
    )


def nodes(arm: RobotModel) -> SpecialPoints:
    """Nodes: points of the section where singular curves cross.

    Returns
    -------
    SpecialPoints
        Two configurations for each node.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> nodes(load("planar_2r")).q.shape
    (0, 2, 2)
    """
    check_model(arm)
    section = section_arm(arm)
    if section is None:
        return _nothing(arm.n, True)
    ranges = last_two_ranges(arm, section, False)
    curves = level_curves(section, ranges)
    lines = [Line(c.x, section.values(c.x)[:, :2], c.closed, False) for c in curves]
    pairs = []
    for places in cut(lines).crossings:
        ends = []
        for k, along in places:
            x, at = lines[int(k)].x, min(int(along), len(lines[int(k)].x) - 2)
            ends.append(x[at] + (along - at) * (x[at + 1] - x[at]))
        pairs.append(np.concatenate(ends))
    x, residual = _solved(section, np.array(pairs).reshape(-1, 4), _node_equations)
    away = np.abs(_wrapped(section, x[:, :2] - x[:, 2:])).max(axis=1, initial=0.0)
    good = (residual < 1e-9) & (away > 1e-3)
    x, residual = _distinct(section, x[good], residual[good])
    both = np.stack((x[:, :2], x[:, 2:]), axis=1)
    return SpecialPoints(
        read_only(_postures(arm, section, both)),
        read_only(section.values(both[:, 0])[:, :2]),
        read_only(residual),
        _status(curves, ranges.bounds),
    )


def cusps_of(arm: SectionArm, curves: list[Curve]) -> tuple[Array, Array]:
    """Cusps on curves and what they lack of the equations. Shapes: -> (k, 2), (k,)."""
    starts = []
    for curve in curves:
        values = arm.values(curve.x)
        extent = np.ptp(values[:, :2], axis=0)
        if extent.max() < 1e-6 * arm.size or (arm.radial and values[:, 0].max() < 1e-6 * arm.size):
            continue  # a point on the second axis, or the first axis: no fold
        along = np.gradient(curve.x, axis=0)
        forward = _forward(values)
        # the direction keeps its sense along the curve
        sense = np.sign(np.einsum("ij,ij->i", forward[1:], forward[:-1]))
        sense = np.cumprod(np.append(1.0, np.where(sense == 0.0, 1.0, sense)))
        speed = np.einsum("ij,ij->i", along, forward) * sense
        at = np.flatnonzero((speed[1:] > 0.0) != (speed[:-1] > 0.0))
        share = speed[at] / (speed[at] - speed[at + 1])
        starts.append(curve.x[at] + share[:, None] * (curve.x[at + 1] - curve.x[at]))
    if not starts:
        return np.zeros((0, 2)), np.zeros(0)
    x = np.concatenate([*starts, _cusp_cells(arm, curves)])
    x, residual = _solved(arm, x, _cusp_equations)
    values = arm.values(x)
    # where the determinant has no slope, singular curves touch or cross: no fold either
    good = (residual < 1e-12) & (np.linalg.norm(values[:, 7:9], axis=1) > 1e-7 * arm.size**3)
    # on a curve whose image is a point the equations hold along it
    s = np.linalg.svd(_slopes(arm, x, _cusp_equations), compute_uv=False)
    good &= s[:, 1] > 1e-6 * s[:, 0]
    if arm.radial:
        good &= values[:, 0] > 1e-6 * arm.size
    x, residual = _distinct(arm, x[good], residual[good])
    # a cusp takes three of at most four postures, so that a point has no second one
    points = arm.values(x)[:, :2]
    away = np.linalg.norm(points[:, None] - points, axis=2) > 1e-7 * arm.size
    first = np.array([away[k, :k].all() for k in range(len(x))], np.bool_)
    return x[first], residual[first]


def _cusp_cells(arm: SectionArm, curves: list[Curve]) -> Array:
    """Points of curves at which both equations of a cusp change sign beside them: (N, 2)."""
    x = np.concatenate([curve.x for curve in curves])
    values = arm.values(x)
    A, slope = values[:, 2:6].reshape(-1, 2, 2), values[:, 7:9]
    # both of the rows are across the direction that keeps the point
    still = np.stack((-A[..., 1], A[..., 0]), axis=-1)
    along = np.einsum("nij,nj->ni", still, slope)
    change = (along[1:] > 0.0) != (along[:-1] > 0.0)
    return x[:-1][change.any(axis=1)]


def _forward(values: Array) -> Array:
    """Direction of the last two joints that moves the point most: (N, 2), its sense arbitrary."""
    A = values[:, 2:6].reshape(-1, 2, 2)
    length = np.linalg.norm(A, axis=2)
    row = np.take_along_axis(A, length.argmax(axis=1)[:, None, None], axis=1)[:, 0]
    return np.asarray(row / np.maximum(length.max(axis=1), 1e-300)[:, None])


def _cusp_equations(arm: SectionArm, x: Array) -> Array:
    """Determinant, and its slope in the direction that keeps the point. (N, 2) -> (N, 2)."""
    values = arm.values(x)
    forward = _forward(values)
    still = np.column_stack((-forward[:, 1], forward[:, 0]))
    # of a fixed sense, so that differences are smooth
    still *= np.where(still[:, :1] + 0.5 * still[:, 1:] >= 0.0, 1.0, -1.0)
    slope = np.einsum("ij,ij->i", values[:, 7:9], still)
    return np.column_stack((values[:, 6], slope)) / arm.size**3


def _node_equations(arm: SectionArm, x: Array) -> Array:
    """Two determinants, and the difference of the two points. (N, 4) -> (N, 4)."""
    a, b = arm.values(x[:, :2]), arm.values(x[:, 2:])
    det = np.column_stack((a[:, 6], b[:, 6])) / arm.size**3
    return np.column_stack((det, (a[:, :2] - b[:, :2]) / arm.size))


def _solved(arm: SectionArm, x: Array, equations: Equations) -> tuple[Array, Array]:
    """Newton's method from starts (N, d) with central differences; the points and residuals."""
    for _ in range(_STEPS if len(x) else 0):
        F = equations(arm, x)
        J = _slopes(arm, x, equations)
        step = -np.einsum("nij,nj->ni", np.linalg.pinv(J, rcond=1e-13), F)
        size = np.abs(step).max(axis=1, keepdims=True)
        x = x + step * np.minimum(1.0, 0.02 / np.maximum(size, 1e-300))
        if size.max() < 1e-14:
            break
    residual = np.abs(equations(arm, x)).max(axis=1) if len(x) else np.zeros(0)
    return x, residual


def _slopes(arm: SectionArm, x: Array, equations: Equations) -> Array:
    """Derivatives of equations by central differences. (N, d) -> (N, d, d)."""
    h, d = 1e-6, x.shape[1]
    columns = [
        (equations(arm, x + h * e) - equations(arm, x - h * e)) / (2.0 * h) for e in np.eye(d)
    ]
    return np.stack(columns, axis=2)


def _distinct(arm: SectionArm, x: Array, residual: Array) -> tuple[Array, Array]:
    """Each point once, angles in (-pi, pi]; of a pair the order does not count."""
    kept: list[int] = []
    for k in range(len(x)):
        swapped = np.concatenate((x[k, 2:], x[k, :2]))
        near = [
            np.abs(_wrapped(arm, x[m] - other)).max() < _SAME
            for m in kept
            for other in (x[k], swapped)
        ]
        if not any(near):
            kept.append(k)
    return _wrapped(arm, x[kept]), residual[kept]


def _wrapped(arm: SectionArm, x: Array) -> Array:
    """Angles in [-pi, pi)."""
    turns = np.tile(arm.periods, x.shape[-1] // 2)
    period = np.where(turns > 0.0, turns, 1.0)
    return np.where(turns > 0.0, (x + np.pi) % period - np.pi, x)


def _postures(model: RobotModel, arm: SectionArm, x: Array) -> Array:
    """Configurations of the model (..., n) from the last two joints (..., 2)."""
    return arm.model_postures(model, np.concatenate((np.zeros((*x.shape[:-1], 1)), x), axis=-1))


def _status(curves: list[Curve], bounds: Array) -> SectionStatus:
    """Whether every curve closes, or ends on a bound."""
    for curve in (c for c in curves if not c.closed):
        away = np.abs(curve.x[[0, -1], :, None] - bounds).min(axis=(1, 2))
        if away.max() > 1e-6:
            return SectionStatus.INCOMPLETE
    return SectionStatus.FOUND


def _nothing(n: int, pairs: bool) -> SpecialPoints:
    shape = (0, 2, n) if pairs else (0, n)
    return SpecialPoints(
        read_only(np.zeros(shape)), read_only(np.zeros((0, 2))), read_only(np.zeros(0)),
        SectionStatus.NOT_DEFINED,
    )  # fmt: skip
