"""Singular curves of three-joint arms, their cusps and nodes: sections 3.3.6, 3.4.2 and 3.4.4.

The position of the arm is determined by three joints, or two in a plane. The results are the same
for all values of the first joint: the section is half a plane through its axis, or a plane across
it if it slides; for a planar arm of two joints its plane. At a cusp three postures meet: the
singular curve in joint space is tangent to the direction in which the arm moves without moving its
tool. An arm with cusps can change posture without being singular. At a node singular curves cross.

Parameters
----------
arm, limits
    The robot; whether limits of its last two joints cut the curves and add their own. Limits of
    revolute joints do not count for cusps and nodes.

Returns
-------
SingularCurves or SpecialPoints
    Curves, or points: none, with a status, for other arms. The first joint is at zero.

References
----------
M. Baili, P. Wenger and D. Chablat, "A classification of 3R orthogonal manipulators by the topology
of their workspace", ICRA 2004.

Examples
--------
>>> from robotmodels.robots import load
>>> curves = singular_curves(load("planar_2r"), limits=False)
>>> [kind.value for kind in curves.kind], curves.joint[0].shape[1]
(['boundary', 'internal'], 2)
>>> len(cusps(load("planar_2r")))
0
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import partial

import numpy as np

from .._arrays import Array
from .._outcomes import Outcome, Result
from ..model import RobotModel
from .arms import Flags, SectionArm, joint_space, section_arm, wrapped
from .arrangement import cut, lines_of, pieces
from .level_curves import Line

Equations = Callable[[SectionArm, Array], Array]
_SAME = 1e-6  # rad or m, between special points
_STEPS = 50


class SectionStatus(Outcome):
    """Outcome of an analysis of the section of an arm."""

    FOUND = 0, "All curves were found."
    INCOMPLETE = 1, "Singular curves touch or cross in joint space: cusps and nodes may be missing."
    NOT_DEFINED = 2, "The position is not determined by three joints, or by two in a plane."


class CurveKind(Enum):
    """Kinds of curves by the regions that they separate."""

    BOUNDARY = "boundary"
    INTERNAL = "internal"
    LIMIT = "limit"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SingularCurves(Result):
    """Singular curves of an arm, each broken where its kind changes.

    ``joint`` and ``section`` are tuples of points (K, n), rad or m, and (K, 2), m; angles run on
    beyond pi. Of ``kind`` BOUNDARY has no posture on one side, INTERNAL has some on both; on LIMIT
    a joint is at its limit.
    """

    joint: tuple[Array, ...]
    section: tuple[Array, ...]
    kind: tuple[CurveKind, ...]
    status: SectionStatus


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SpecialPoints(Result):
    """Cusps or nodes in the ``section`` (k, 2), m, of an arm.

    ``q`` are configurations (k, n), rad or m, of a node the two that meet, (k, 2, n); ``residual``
    (k,) is what is left of the equations, in units of the arm.
    """

    q: Array
    section: Array
    residual: Array
    status: SectionStatus

    def __len__(self) -> int:
        return len(self.section)


def singular_curves(arm: RobotModel, limits: bool = True) -> SingularCurves:
    """Singular curves of an arm whose position three joints determine, or two in a plane."""
    bounded, section = joint_space(arm, limits).limits, section_arm(arm)
    if section is None:
        return SingularCurves((), (), (), SectionStatus.NOT_DEFINED)
    runs: list[tuple[Line, CurveKind, list[Line]]] = []
    for line, part, left, right in pieces(arm, bounded):
        kind = CurveKind.BOUNDARY if (left == 0) != (right == 0) else CurveKind.INTERNAL
        kind = CurveKind.LIMIT if line.of_limit else kind
        if not runs or runs[-1][0] is not line or runs[-1][1] is not kind:
            runs.append((line, kind, []))
        runs[-1][2].append(part)
    return SingularCurves(
        tuple(_postures(arm, section, np.concatenate([p.x for p in run])) for *_, run in runs),
        tuple(np.concatenate([p.section for p in run]) for *_, run in runs),
        tuple(kind for _, kind, _ in runs),
        SectionStatus(int(lines_of(arm, bounded)[1])),
    )


def cusps(arm: RobotModel) -> SpecialPoints:
    """Cusps: points of the section where three postures of an arm meet."""
    section = section_arm(joint_space(arm).model)
    if section is None:
        return _nowhere(np.zeros((0, arm.n)))
    lines, touch = lines_of(arm, False)
    x, residual = cusps_of(section, lines)
    points, status = section.values(x)[:, :2], SectionStatus(int(touch))
    return SpecialPoints(_postures(arm, section, x), points, residual, status)


def nodes(arm: RobotModel) -> SpecialPoints:
    """Nodes: points of the section where singular curves cross."""
    section = section_arm(joint_space(arm).model)
    if section is None:
        return _nowhere(np.zeros((0, 2, arm.n)))
    lines, touch = lines_of(arm, False)
    lines = tuple(line for line in lines if not line.of_limit)
    pairs = [
        np.concatenate([lines[int(k)].x[int(along)] for k, along in places])
        for places in cut(lines).crossings
    ]
    x, residual = _solved(section, np.reshape(pairs, (-1, 4)), _node_equations)
    away = np.abs(wrapped(x[:, :2] - x[:, 2:], section.turns)).max(axis=1, initial=0.0)
    good = (residual < 1e-9) & (away > 1e-3) & _isolated(section, x, _node_equations)
    x, residual = _distinct(section, x[good], residual[good])
    points, status = section.values(x[:, :2])[:, :2], SectionStatus(int(touch))
    return SpecialPoints(_postures(arm, section, x.reshape(-1, 2, 2)), points, residual, status)


def _nowhere(q: Array) -> SpecialPoints:
    return SpecialPoints(q, np.zeros((0, 2)), np.zeros(0), SectionStatus.NOT_DEFINED)


def cusps_of(arm: SectionArm, lines: tuple[Line, ...]) -> tuple[Array, Array]:
    """Cusps on curves and what they lack of the equations. Shapes: -> (k, 2), (k,)."""
    singular = [line for line in lines if not line.of_limit]
    roots = {float(line.x[0, 1]) for line in singular if np.ptp(line.x[:, 1]) == 0.0}
    found = [(np.zeros((0, 2)), np.zeros(0))]
    for line in singular:
        values = arm.values(line.x)
        if np.ptp(values[:, :2], axis=0).max() < 1e-6 * arm.size:
            continue  # a point on the second axis: no fold
        A, starts = values[:, 2:6].reshape(-1, 2, 2), []
        # both rows are along the direction that keeps the point
        still = np.stack((-A[..., 1], A[..., 0]), axis=-1)
        for g in np.einsum("nij,nj->in", still, values[:, 7:9]):
            at = np.flatnonzero((g[1:] > 0.0) != (g[:-1] > 0.0))
            share = (g[at] / (g[at] - g[at + 1]))[:, None]
            # from both ends too: about an axis of symmetry two cusps lie between them
            starts += [line.x[at] + t * (line.x[at + 1] - line.x[at]) for t in (0.0, share, 1.0)]
        # other curves of constant x3 are divided out, so that none of their points is found
        own = {float(line.x[0, 1])} if np.ptp(line.x[:, 1]) == 0.0 else set()
        others = tuple(roots - own)
        equations = partial(_cusp_equations, roots=others)
        x, residual = _solved(arm, np.concatenate(starts), equations)
        values, whole = arm.values(x), np.abs(_cusp_equations(arm, x)).max(axis=1, initial=0.0)
        # where the determinant has no slope, singular curves touch or cross: no fold either
        slope = np.linalg.norm(values[:, 7:9], axis=1) / _others(arm, x, others)
        good = (whole < 1e-12) & (residual < 1e-9) & (slope > 1e-7 * arm.size**3)
        good &= _isolated(arm, x, equations)
        if arm.radial:
            good &= values[:, 0] > 1e-6 * arm.size
        found.append((x[good], whole[good]))
    x, residual = _distinct(arm, *map(np.concatenate, zip(*found, strict=True)))
    # a cusp takes three of at most four postures, so that a point has no second one
    points = arm.values(x)[:, :2]
    near = np.linalg.norm(points[:, None] - points, axis=2) < 1e-9 * arm.size
    first = ~np.tril(near, -1).any(axis=1)
    return x[first], residual[first]


def _forward(values: Array) -> Array:
    """Direction of the last two joints that moves the point most: (N, 2), its sense arbitrary."""
    A = values[:, 2:6].reshape(-1, 2, 2)
    length = np.linalg.norm(A, axis=2)
    row = np.take_along_axis(A, length.argmax(axis=1)[:, None, None], axis=1)[:, 0]
    return np.asarray(row / np.maximum(length.max(axis=1), 1e-300)[:, None])


def _others(arm: SectionArm, x: Array, roots: tuple[float, ...]) -> Array:
    """Product (N,) of the factors of the determinant that vanish at values of x3, not signed."""
    away = x[:, 1:] - np.array(roots)
    product = np.abs(np.prod(np.sin(0.5 * away) if arm.turns[1] else away, axis=1))
    return np.maximum(product, 1e-12)


def _cusp_equations(arm: SectionArm, x: Array, roots: tuple[float, ...] = ()) -> Array:
    """Determinant, and its slope in the direction that keeps the point. (N, 2) -> (N, 2)."""
    values = arm.values(x)
    forward = _forward(values)
    still = np.column_stack((-forward[:, 1], forward[:, 0]))
    # of a fixed sense, so that differences are smooth
    still *= np.where(still[:, :1] + 0.5 * still[:, 1:] >= 0.0, 1.0, -1.0)
    slope = np.einsum("ij,ij->i", values[:, 7:9], still)
    unit = _others(arm, x, roots) * arm.size**3
    return np.column_stack((values[:, 6], slope)) / unit[:, None]


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


def _isolated(arm: SectionArm, x: Array, equations: Equations) -> Flags:
    """Which solutions are alone: not on curves whose images are points, or lie on each other."""
    s = np.linalg.svd(_slopes(arm, x, equations), compute_uv=False)
    return np.asarray(s[:, -1] > 1e-6 * s[:, 0])


def _distinct(arm: SectionArm, x: Array, residual: Array) -> tuple[Array, Array]:
    """Each point once, angles in [-pi, pi); of a pair the order does not count."""
    turns = np.tile(arm.turns, x.shape[1] // 2)
    same = np.zeros((len(x), len(x)), np.bool_)
    for other in (x, np.roll(x, 2, axis=1)):
        same |= np.abs(wrapped(x[:, None] - other, turns)).max(axis=2) < _SAME
    first = ~np.tril(same, -1).any(axis=1)
    return wrapped(x[first], turns), residual[first]


def _postures(model: RobotModel, arm: SectionArm, x: Array) -> Array:
    """Configurations of the model (..., n) from the last two joints (..., 2)."""
    return arm.model_postures(model, np.concatenate((np.zeros((*x.shape[:-1], 1)), x), axis=-1))
