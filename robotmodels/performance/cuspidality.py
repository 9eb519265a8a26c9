"""Cuspidality: can an arm change posture without meeting a singular position."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, pairwise
from math import tau

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, read_only
from .._outcomes import Outcome
from ..errors import InvalidValueError
from ..geometry import REVOLUTE
from ..igm import igm
from ..kinematics import dgm
from ..kinematics.lengths import spread_configurations
from ..kinematics.singular.task import generator_of
from ..model import RobotModel, check_model
from .arms import Result, SectionArm, section_arm, task_rows, wrapped
from .arrangement import cut, section_lines
from .aspects import aspects
from .certificate import Bound, bound_of, certified
from .curves import cusps_of
from .factors import Factors, sign_factors
from .level_curves import last_two_ranges, level_curves

_LEVELS = 14  # of the determinant that are tried around a cusp, each a third of the one before
_KNOTS = 33
_VIAS = 24
_APART = 1e-3  # rad or m, between different postures
_CHUNK = 4096


class CuspidalityStatus(Outcome):
    """Outcome of `cuspidality`."""

    CUSPIDAL = 0, "A path between two postures of one pose was proved to meet no singular position."
    NOT_CUSPIDAL = (
        1, "The postures of a pose lie in different aspects: a change of posture is singular.",
    )  # fmt: skip
    NONE_FOUND = 2, "No change of posture without a singular position was found; this is no proof."
    NOT_DEFINED = (
        3, "The Jacobian of the task is not square, or never regular: postures are not isolated.",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Cuspidality(Result):
    """Outcome of a search for a change of posture that meets no singular position.

    Parameters
    ----------
    status : CuspidalityStatus
        Outcome.
    path : ndarray, shape (N, n)
        Joint path, a polyline, rad or m; empty without one.
    ends : ndarray, shape (2, n)
        Its ends, two postures of one pose; NaN without a path.
    pose : ndarray, shape (4, 4)
        World pose of the tool at the first end; for a task of positions the orientation differs
        at the other.
    margin : float
        Proved lower bound of the least singular value along the path, linear rows over the reach
        of the arm; 0 without a path.
    tried : int
        Pairs of postures that were looked at.
    """

    status: CuspidalityStatus
    path: Array
    ends: Array
    pose: Array
    margin: float
    tried: int

    def reason(self) -> str:
        """The status as a sentence."""
        more = f" Pairs of postures tried: {self.tried}." if self.status == 2 else ""
        return self.status.sentence + more

    def __repr__(self) -> str:
        return f"<Cuspidality: {self.status.name}, margin {self.margin:.3g}; {self.reason()}>"


def cuspidality(
    arm: RobotModel, rng: int | np.random.Generator | None = None, poses: int = 200
) -> Cuspidality:
    """Cuspidality: whether an arm can change its posture without meeting a singular position.

    Limits of revolute joints do not count. Of an arm whose position three joints determine (or
    two in a plane) the position counts, of others the pose.

    Parameters
    ----------
    arm : RobotModel
        The robot.
    rng : int or numpy.random.Generator, optional
        Chooses the poses; default the seed 0.
    poses : int
        Random poses that are tried, at least 1.

    Returns
    -------
    Cuspidality
        CUSPIDAL with a path on which the least singular value is proved to stay above ``margin``
        between samples too; NOT_CUSPIDAL if the signs of the factors of the determinant are the
        labels of the postures, or, in a section, if all postures of every region lie in different
        aspects; NONE_FOUND after a search without success.

    Raises
    ------
    InvalidValueError
        ``poses`` is no number of poses, a slide without limits.

    Notes
    -----
    Three joints: near a cusp a level curve of the determinant meets two postures of one position.
    Others: straight lines, and lines over a third configuration, between postures with equal signs
    of all factors.

    References
    ----------
    Seed book section 3.4.4; P. Wenger, "Cuspidal and noncuspidal robot manipulators", Robotica 25
    (2007); D. Salunkhe et al., arXiv 2202.08686; A. Elias and J. Wen, arXiv 2501.18505.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> cuspidality(load("puma560")).status.name
    'NOT_CUSPIDAL'
    """
    check_model(arm)
    if isinstance(poses, bool) or not isinstance(poses, (int, np.integer)) or poses < 1:
        raise InvalidValueError(f"poses: expected a number of poses of at least 1, got {poses!r}.")
    rng = generator_of(0 if rng is None else rng)
    factors = sign_factors(arm)
    if factors is None:
        return _without(arm, CuspidalityStatus.NOT_DEFINED)
    if not factors.joints:  # the determinant is constant
        return _without(arm, CuspidalityStatus.NOT_CUSPIDAL)
    section = section_arm(arm)
    if section is not None:
        return _of_section(arm, section, factors, rng, int(poses))
    return _by_search(arm, factors, rng, int(poses))


def _without(arm: RobotModel, status: CuspidalityStatus, tried: int = 0) -> Cuspidality:
    """A result without a path."""
    path, ends, pose = np.zeros((0, arm.n)), np.full((2, arm.n), np.nan), np.full((4, 4), np.nan)
    return Cuspidality(
        status, read_only(path), read_only(ends), read_only(pose), 0.0, tried,
    )  # fmt: skip


def _with(arm: RobotModel, path: Array, margin: float, tried: int) -> Cuspidality:
    """A result with a proved path."""
    return Cuspidality(
        CuspidalityStatus.CUSPIDAL, read_only(path), read_only(path[[0, -1]]),
        read_only(dgm(arm, path[0])), margin, tried,
    )  # fmt: skip


# --- three joints --------------------------------------------------------------------------------


def _of_section(
    arm: RobotModel, section: SectionArm, factors: Factors, rng: np.random.Generator, poses: int
) -> Cuspidality:
    """Around the cusps; without cusps by the aspects of all regions of the section."""
    ranges = last_two_ranges(arm, section, False)
    curves = level_curves(section, ranges)
    x, _ = cusps_of(section, curves)
    strokes = np.where(arm.table.sigma[arm.table.joint_rows] == REVOLUTE, 0.0, _stroke(arm))
    bound = bound_of(arm, task_rows(arm), strokes)
    best, tried = _without(arm, CuspidalityStatus.NONE_FOUND), 0
    if len(x):
        best = _by_search(arm, factors, rng, poses)
        tried = best.tried
    for cusp in x if best.status != 0 else ():
        for path in _around(section, cusp):
            tried += 1
            whole = _closed(arm, section, path)
            margin = 0.0 if whole is None else certified(bound, whole)
            if whole is not None and margin > best.margin:
                best = _with(arm, whole, margin, tried)
                break  # lower levels are nearer to the singular curve
    if best.status == 0:
        return best
    if len(x) == 0 and _all_apart(arm, section):
        return _without(arm, CuspidalityStatus.NOT_CUSPIDAL)
    return _without(arm, CuspidalityStatus.NONE_FOUND, tried)


def _stroke(arm: RobotModel) -> Array:
    bounds = np.maximum(np.abs(arm.lower), np.abs(arm.upper))
    return np.where(np.isfinite(bounds), bounds, 0.0)


def _around(section: SectionArm, cusp: Array) -> list[Array]:
    """Parts of level curves of the determinant around a cusp whose ends reach one point."""
    from .kernels import level_curve

    unit = section.size**3
    slope = section.values(cusp[None])[0, 7:9]
    size = float(np.linalg.norm(slope))
    found = []
    rows, shut = np.empty((4001, 2)), np.zeros(1)
    for k in range(_LEVELS):
        away = 0.3 * 3.0**-k  # of the level curve from the singular one, about
        for side in (1.0, -1.0):
            level = side * away * size
            seed = cusp + side * away * slope / size
            step = 0.05 * np.sqrt(away) * min(1.0, np.sqrt(away) * 20.0)
            count = level_curve(
                section.kinds, section.local, level, unit, seed, section.periods, step, rows, shut
            )
            if count < 8:
                continue
            x = rows[:count].copy()
            at = int(np.argmin(np.linalg.norm(x - seed, axis=1)))
            pair = _crossing(section, x, at)
            if pair is not None:
                found.append(x[pair[0] : pair[1] + 1])
    return found


def _crossing(section: SectionArm, x: Array, at: int) -> tuple[int, int] | None:
    """Ends of the shortest part around a place whose image crosses itself; None without one."""
    p = section.values(x)[:, :2]
    low, high = max(0, at - 600), min(len(x) - 1, at + 600)
    a, b = p[low:at], p[low + 1 : at + 1]
    c, d = p[at:high], p[at + 1 : high + 1]
    if not len(a) or not len(c):
        return None

    def side(p: Array, q: Array, r: Array) -> Array:
        return (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1]) - (q[..., 1] - p[..., 1]) * (
            r[..., 0] - p[..., 0]
        )

    A, B, C, E = a[:, None], b[:, None], c[None], d[None]
    meets = (side(A, B, C) * side(A, B, E) < 0.0) & (side(C, E, A) * side(C, E, B) < 0.0)
    i, j = np.nonzero(meets)
    if not i.size:
        return None
    best = int(np.argmin((at - low - i) + j))
    return low + int(i[best]), at + int(j[best]) + 1


def _closed(arm: RobotModel, section: SectionArm, x: Array) -> Array | None:
    """The path in all joints, its last point moved onto a posture of the first one's position."""
    q = section.model_postures(arm, np.column_stack((np.zeros(len(x)), x)))
    first = dgm(arm, q[0])[:3, 3]
    solved, valid = section.postures(first[None])
    if section.radial:
        # the first joint turns the last point to the first one along the way
        last = dgm(arm, q[-1])[:3, 3]
        local = np.linalg.inv(section.frame)[:3, :3]
        u, v = local @ (first - section.frame[:3, 3]), local @ (last - section.frame[:3, 3])
        turn = np.arctan2(u[2], u[0]) - np.arctan2(v[2], v[0])
        turn = (turn + np.pi) % tau - np.pi
    else:
        turn = 0.0
    rows = section.model_postures(arm, solved[0][valid[0]])
    sense = -1.0 if section.radial and section.flip[1, 1] > 0.0 else 1.0
    goal = q[-1].copy()
    column = int(section.columns[0])
    if column >= 0 and section.radial:
        goal[column] = sense * turn
    if not len(rows):
        return None
    turning = arm.table.sigma[arm.table.joint_rows] == REVOLUTE
    moved = wrapped(rows - goal, turning)
    best = int(np.argmin(np.abs(moved).max(axis=1)))
    end = goal + moved[best]
    if np.abs(moved[best]).max() > 0.2 or _far(arm, q[0], end) < 1e-6:
        return None
    if column >= 0:
        q[:, column] = np.linspace(0.0, end[column], len(q))
    q[-1] = end
    return q


def _far(arm: RobotModel, a: Array, b: Array) -> float:
    """Greatest difference of two postures, angles by the shorter way round."""
    turning = arm.table.sigma[arm.table.joint_rows] == REVOLUTE
    return float(np.abs(wrapped(b - a, turning)).max())


def _all_apart(arm: RobotModel, section: SectionArm) -> bool:
    """Whether in every region of the section all postures lie in different aspects."""
    area, middle, *_ = cut(section_lines(arm, section, False))
    middle = middle[area > 1e-9 * section.size**2]
    divided = aspects(arm, limits=False)
    if not divided.is_complete:
        return False
    for k in range(0, len(middle), _CHUNK):
        q, valid = section.postures(section.world(middle[k : k + _CHUNK]))
        rows = np.where(valid[..., None], section.model_postures(arm, q), 0.0)
        label = np.where(valid, divided.of(rows), -1 - np.arange(valid.shape[1]))
        doubtful = (valid & (label < 0)).any(axis=1)
        label = np.sort(label[~doubtful], axis=1)
        if (label[:, 1:] == label[:, :-1]).any():
            return False
    return True


# --- other arms ----------------------------------------------------------------------------------


def _by_search(
    arm: RobotModel, factors: Factors, rng: np.random.Generator, poses: int
) -> Cuspidality:
    """Labels of a closed form, else straight lines between postures with equal signs."""
    q = spread_configurations(arm, poses, rng)
    found = igm(arm, dgm(arm, q), mask=_asked(arm, factors))
    several = found.valid & ~found.double & ~found.free_joints.any(axis=-1)
    codes = np.full(found.valid.shape, -1)
    codes[several] = factors.codes(found.q[several])
    apart = all(np.unique(c[c >= 0]).size == np.sum(c >= 0) for c in codes)
    if apart and _signs_are_labels(factors, found.q[several], found.branch[several]):
        return _without(arm, CuspidalityStatus.NOT_CUSPIDAL)
    pairs = [
        (rows[s], rows[r])
        for code, rows in zip(codes, found.q, strict=True)
        for s, r in combinations(range(len(code)), 2)
        if code[s] == code[r] >= 0 and _far(arm, rows[s], rows[r]) > _APART
    ]
    if not pairs:
        return _without(arm, CuspidalityStatus.NONE_FOUND)
    turning = arm.table.sigma[arm.table.joint_rows] == REVOLUTE
    start = np.array([a for a, _ in pairs])
    step = wrapped(np.array([b for _, b in pairs]) - start, turning)
    bound = bound_of(arm, factors.rows, _stroke(arm))
    tried = len(pairs)
    for via in range(1 + _VIAS):
        offset = np.zeros_like(step)
        if via:
            offset = rng.normal(0.0, 0.25 + 0.05 * via, step.shape) * (bound.slopes > 0.0)
        best = _most_regular(arm, factors, bound, start, step, offset)
        for _, knots in best:
            margin = certified(bound, knots)
            if margin > 0.0:
                return _with(arm, _dense(knots), margin, tried * (via + 1))
    return _without(arm, CuspidalityStatus.NONE_FOUND, tried * (1 + _VIAS))


def _asked(arm: RobotModel, factors: Factors) -> NDArray[np.bool_] | None:
    """Mask of the inverse model: None for whole poses."""
    if section_arm(arm) is not None:
        return np.repeat((True, False), 3)
    return None if factors.rows.sum() == 6 else factors.rows


def _signs_are_labels(factors: Factors, q: Array, labels: NDArray[np.str_]) -> bool:
    """Whether each word of the labels is the sign of a factor, the same way in all postures."""
    words = [str(label).split() for label in labels]
    if not words or not all(words) or len({len(w) for w in words}) != 1:
        return False
    count = len(words[0])
    if any(word[-1] not in "+-" for row in words for word in row):
        return False
    signs = np.array([[1 if word[-1] == "+" else -1 for word in row] for row in words])
    own = np.where(factors.values(q) > 0.0, 1, -1)
    # a label that is the same in all postures tells nothing and needs no factor
    told = [c for c in range(count) if np.ptp(signs[:, c])]
    products = signs[:, told].T @ own / max(len(own), 1)
    return bool((np.abs(products).max(axis=1, initial=0.0) == 1.0).all()) and bool(told)


def _most_regular(
    arm: RobotModel, factors: Factors, bound: Bound, start: Array, step: Array, offset: Array
) -> list[tuple[int, Array]]:
    """Lines (over the middle moved by an offset) that seem regular, the most regular first."""
    t = np.linspace(0.0, 1.0, _KNOTS)[:, None, None]
    q = start + t * step + (1.0 - np.abs(2.0 * t - 1.0)) * offset
    codes = factors.codes(q.reshape(-1, arm.n)).reshape(q.shape[:2])
    same = np.flatnonzero((codes == codes[0]).all(axis=0))
    if not same.size:
        return []
    least = bound.least(q[:, same].reshape(-1, arm.n)).reshape(_KNOTS, -1).min(axis=0)
    order = np.argsort(-least)[:6]
    keep = np.array([0, _KNOTS // 2, _KNOTS - 1])
    return [(int(same[k]), q[keep][:, same[k]]) for k in order if least[k] > 1e-4]


def _dense(knots: Array) -> Array:
    """A polyline with many points on each piece."""
    t = np.linspace(0.0, 1.0, 51)[:-1, None]
    parts = [a + t * (b - a) for a, b in pairwise(knots)]
    return np.concatenate((*parts, knots[-1:]))
