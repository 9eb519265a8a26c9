"""Cuspidality: can an arm change posture without meeting a singular position (section 3.4.4).

Limits of revolute joints do not count, those of slides do. Of an arm whose position three joints
determine (or two in a plane) the position counts, of others the pose. Straight lines, and lines
over a third configuration, are tried between postures with equal signs of all factors; with three
joints level curves of the determinant too, which near a cusp meet two postures of one position.

Parameters
----------
arm, executor, progress
    See `robotmodels.performance`.
rng : int or numpy.random.Generator, optional
    Chooses the poses; default the seed 0.
poses : int
    Random poses that are tried, at least 1.

Returns
-------
Cuspidality
    CUSPIDAL with a path on which the least singular value is proved to stay above ``margin``
    between samples too; NOT_CUSPIDAL if the signs of the factors of the determinant are the
    labels of the postures (of 50 or more), or, in a section, if all postures of every region
    lie in different aspects; NONE_FOUND after a search without success.

References
----------
P. Wenger, Robotica 25 (2007); D. Salunkhe et al., arXiv 2202.08686; A. Elias and J. Wen, arXiv
2501.18505.

Examples
--------
>>> from robotmodels.robots import load
>>> cuspidality(load("puma560")).status.name
'NOT_CUSPIDAL'
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, as_count
from .._arrays.tasks import Progress, Workers
from .._outcomes import Outcome, Result
from ..igm import igm
from ..kinematics import dgm
from ..kinematics.lengths import spread_configurations
from ..kinematics.singular.task import generator_of
from ..model import RobotModel, check_model
from .arms import Flags, SectionArm, section_arm, turning, wrapped
from .arrangement import counted_cut, cut, lines_of
from .aspects import aspects
from .curves import cusps_of
from .level_curves import level_set
from .singularity import Bound, Factors, bound_of, certified, determinant, sign_factors

_LEVELS = 24  # of the determinant, each 0.6 of the one before
_KNOTS = 33
_VIAS = 24
_APART = 1e-3  # rad or m, between different postures
_CHUNK = 4096
_POSTURES = 50  # fewer may agree with the signs of factors by chance


class CuspidalityStatus(Outcome):
    """Outcome of `cuspidality`."""

    CUSPIDAL = 0, "A path between two postures of one pose was proved to meet no singular position."
    NOT_CUSPIDAL = 1, "The postures of a pose lie in different aspects: changes are singular."
    NONE_FOUND = 2, "No change of posture without a singular position was found; this is no proof."
    NOT_DEFINED = 3, "The Jacobian of the task is not square, or never regular."


_NONE = CuspidalityStatus.NONE_FOUND


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Cuspidality(Result):
    """Outcome of a search for a change of posture that meets no singular position.

    ``path`` (N, n) is a polyline of joints, rad or m, ``ends`` (2, n) are two postures of one pose,
    ``pose`` (4, 4) that of the first; for a task of positions the orientation differs at the other.
    ``margin`` is the proved lower bound of the least singular value along the path, linear rows
    over the reach of the arm. Empty, NaN and 0 without a path; ``tried`` counts pairs of postures.
    """

    status: CuspidalityStatus
    path: Array
    ends: Array
    pose: Array
    margin: float
    tried: int


def cuspidality(
    arm: RobotModel,
    rng: int | np.random.Generator | None = None,
    poses: int = 200,
    executor: Executor | None = None,
    progress: Progress = None,
) -> Cuspidality:
    """Cuspidality: whether an arm can change its posture without meeting a singular position."""
    check_model(arm)
    poses = as_count(poses, "poses")
    rng, work = generator_of(0 if rng is None else rng), Workers(executor, progress)
    section = section_arm(arm)
    cusped = section is not None and len(cusps_of(section, lines_of(arm, False)[0])[0]) > 0
    # beside cusps the sign of the determinant serves: what is found is proved
    factors = determinant(arm) if cusped else sign_factors(arm)
    if factors is None:
        return _result(arm, CuspidalityStatus.NOT_DEFINED)
    if not factors.joints:  # the determinant is constant
        return _result(arm, CuspidalityStatus.NOT_CUSPIDAL)
    if section is not None and not cusped:
        apart = _all_apart(arm, section)
        return _result(arm, CuspidalityStatus.NOT_CUSPIDAL if apart else _NONE)
    found = _by_search(arm, factors, rng, poses, work)
    for path in _level_paths(arm, section) if section is not None and found.status == _NONE else ():
        margin = _certified_margin(arm, factors, path)
        if margin > 0.0:
            return _result(arm, CuspidalityStatus.CUSPIDAL, path, margin, found.tried + 1)
    return found


def _result(
    arm: RobotModel, status: CuspidalityStatus, path: Array | None = None, margin: float = 0.0,
    tried: int = 0,
) -> Cuspidality:  # fmt: skip
    if path is None:
        ends, pose = np.full((2, arm.n), np.nan), np.full((4, 4), np.nan)
        return Cuspidality(status, np.zeros((0, arm.n)), ends, pose, margin, tried)
    return Cuspidality(status, path, path[[0, -1]], dgm(arm, path[0]), margin, tried)


def _level_paths(arm: RobotModel, section: SectionArm) -> Iterator[Array]:
    """Parts of level curves of the determinant between two postures of one point."""
    two = level_set(arm, section, False)
    axes = [np.linspace(ends[0], ends[1], 60) for ends in two.ends]
    mesh = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    top = float(np.abs(section.values(mesh)[:, 6]).max())
    for k in range(2 * _LEVELS):
        lines, _ = replace(two, level=(-1) ** k * top * 0.6 ** (k // 2 + 1)).curves()
        for (a, start), (b, stop) in cut(tuple(lines)).crossings if lines else ():
            line, places = lines[int(a)], sorted((int(start), int(stop)))
            if a != b:
                continue
            parts = [line.part(places[0], places[1] + 1)]
            if line.closed:
                parts.append(line.part(places[1], places[0] + len(line.x)))
            yield from (path for part in parts for path in _closed(arm, section, part.x))


def _closed(arm: RobotModel, section: SectionArm, x: Array) -> list[Array]:
    """The path in all joints, its last point moved onto a posture of the first one's position."""
    q = section.model_postures(arm, np.column_stack((np.zeros(len(x)), x)))
    column, first = int(section.columns[0]), dgm(arm, q[0])[:3, 3]
    if section.radial:
        # the first joint turns the last point to the first one along the way
        ends = np.array((first, dgm(arm, q[-1])[:3, 3])) - section.frame[:3, 3]
        ends = ends @ section.frame[:3, :3]
        turn = np.diff(np.arctan2(ends[:, 2], ends[:, 0]))[0]
        turn = (turn + np.pi) % (2.0 * np.pi) - np.pi
        q[:, column] = np.linspace(0.0, turn if section.local[0, 2, 2] > 0.0 else -turn, len(q))
    solved, valid, _ = section.postures(first[None])
    moved = wrapped(section.model_postures(arm, solved[valid]) - q[-1], turning(arm))
    if not len(moved):
        return []
    step = moved[np.abs(moved).max(axis=1).argmin()]
    q[-1] += step
    far = np.abs(wrapped(q[-1] - q[0], turning(arm))).max() > _APART
    return [q] if far and np.abs(step).max() < 0.2 else []


def _all_apart(arm: RobotModel, section: SectionArm) -> bool:
    """Whether in every region of the section all postures lie in different aspects."""
    found, _ = counted_cut(arm, False)
    middle = found.middle[found.area > 1e-9 * section.size**2]
    divided = aspects(arm, limits=False)
    if not divided.is_complete:
        return False
    for k in range(0, len(middle), _CHUNK):
        q, valid, _ = section.postures(section.world(middle[k : k + _CHUNK]))
        rows = np.where(valid[..., None], section.model_postures(arm, q), 0.0)
        label = np.where(valid, divided.of(rows), -1 - np.arange(valid.shape[1]))
        doubtful = (valid & (label < 0)).any(axis=1)
        label = np.sort(label[~doubtful], axis=1)
        if (label[:, 1:] == label[:, :-1]).any():
            return False
    return True


def _within_strokes(arm: RobotModel, q: Array) -> Flags:
    """Whether prismatic joints of configurations (..., n) are within limits, up to rounding."""
    slides = ~turning(arm)
    over = np.maximum(arm.lower - q, q - arm.upper)[..., slides]
    return np.asarray((over <= 1e-9 * (1.0 + np.abs(q[..., slides]))).all(axis=-1))


def _certified_margin(arm: RobotModel, factors: Factors, path: Array) -> float:
    """Certified lower bound of the least singular value along a path (N, n); 0 if none is."""
    if not _within_strokes(arm, path).all():
        return 0.0
    return certified(bound_of(arm, factors.rows, np.abs(path).max(axis=0)), path)


def _by_search(
    arm: RobotModel, factors: Factors, rng: np.random.Generator, poses: int, work: Workers
) -> Cuspidality:
    """Labels of a closed form, else straight lines between postures with equal signs."""
    mask = None if factors.rows.sum() == 6 else factors.rows
    # pose by pose, for which nothing is compiled
    T = np.array([dgm(arm, q) for q in spread_configurations(arm, poses, rng)])
    section = section_arm(arm)
    if section is None:
        found = igm(arm, T, mask=mask)
        q, several = found.q, found.valid & ~found.double & ~found.free_joints.any(axis=-1)
    else:
        q, _, several = section.postures(T[:, :3, 3])
        q = section.model_postures(arm, q)
    several &= _within_strokes(arm, q)
    codes = np.full(several.shape, -1)
    codes[several] = factors.codes(q[several])
    apart = all(np.unique(c[c >= 0]).size == np.sum(c >= 0) for c in codes)
    if apart and section is None and _signs_are_labels(factors, q[several], found.branch[several]):
        return _result(arm, CuspidalityStatus.NOT_CUSPIDAL)
    pairs = np.array([
        (rows[s], wrapped(rows[r] - rows[s], turning(arm)))
        for code, rows in zip(codes, q, strict=True)
        for s, r in combinations(range(len(code)), 2)
        if code[s] == code[r] >= 0
    ]).reshape(-1, 2, arm.n)  # fmt: skip
    start, step = np.moveaxis(pairs[np.abs(pairs[:, 1]).max(axis=1) > _APART], 1, 0)
    if not len(start):
        return _result(arm, _NONE)

    bound = bound_of(arm, factors.rows)

    def tasks() -> Iterator[Callable[[], tuple[Array, float]]]:
        for via in range(1 + _VIAS):
            offset = rng.normal(0.0, 0.25 + 0.05 * via, step.shape) * (bound.slopes > 0.0)
            yield partial(_most_regular, factors, bound, start, step, offset * (via > 0))

    for tried, (knots, margin) in enumerate(work.each(tasks(), 1 + _VIAS), 1):
        if margin > 0.0:
            t = np.linspace(0.0, 1.0, 51)[:-1, None]
            path = np.concatenate([*(a + t * (b - a) for a, b in pairwise(knots)), knots[-1:]])
            return _result(arm, CuspidalityStatus.CUSPIDAL, path, margin, tried * len(start))
    return _result(arm, _NONE, tried=(1 + _VIAS) * len(start))


def _signs_are_labels(factors: Factors, q: Array, labels: NDArray[np.str_]) -> bool:
    """Whether each word of the labels is the sign of a factor, the same way in all postures."""
    ends = ["".join(word[-1] for word in str(label).split()) for label in labels]
    same = len({*map(len, ends)}) == 1 and {*"".join(ends)} == {"+", "-"}
    if len(ends) < _POSTURES or not same:
        return False
    signs = np.where(np.array([*map(list, ends)]) == "+", 1, -1)
    own = np.where(factors.values(q) > 0.0, 1, -1)
    # a label that is the same in all postures needs no factor
    varying = np.ptp(signs, axis=0) > 0
    products = signs[:, varying].T @ own / len(own)
    return bool((np.abs(products).max(axis=1, initial=0.0) == 1.0).all()) and bool(varying.any())


def _most_regular(
    factors: Factors, bound: Bound, start: Array, step: Array, offset: Array
) -> tuple[Array, float]:
    """The line (over the middle moved by an offset) that is proved regular, with its margin, or 0.

    Of the lines that seem regular the most regular ones are tried.
    """
    t = np.linspace(0.0, 1.0, _KNOTS)[:, None, None]
    q = start + t * step + (1.0 - np.abs(2.0 * t - 1.0)) * offset
    n = q.shape[-1]
    codes = factors.codes(q.reshape(-1, n)).reshape(q.shape[:2])
    inside = _within_strokes(bound.model, q).all(axis=0)
    same = np.flatnonzero((codes == codes[0]).all(axis=0) & inside)
    least = bound.least(q[:, same].reshape(-1, n)).reshape(_KNOTS, -1).min(axis=0)
    for k in np.argsort(-least)[:6]:
        knots = q[[0, _KNOTS // 2, _KNOTS - 1], same[k]]
        margin = _certified_margin(bound.model, factors, knots) if least[k] > 1e-4 else 0.0
        if margin > 0.0:
            return knots, margin
    return q[:0, 0], 0.0
