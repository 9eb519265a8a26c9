"""Six-joint arms that have a closed form but for calibration errors or rounded numbers.

A calibrated wrist has axes that miss each other by a tenth of a millimetre, a URDF writes 1.5708:
the closed forms do not hold for such an arm, and the elimination for general arms is at its worst.
So the structured arm next to it is built, every posture of that arm found in closed form, and
brought home to the arm itself branch by branch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array, read_only
from .check import checked
from .closed_form import closed_form_postures
from .general import GeneralSolver, general_postures, prepare_general
from .loop import JointChain
from .solver import Found, Tolerances, nothing_found, postures
from .structure import Family, LoopPlan, plan_loop

__all__ = ["OFFSET_TOLERANCE", "TILT_TOLERANCE", "Neighbour", "prepare_neighbour"]

OFFSET_TOLERANCE = 8e-3
"""Farthest that an axis may be moved (m) to meet another. Parameters that are each off by up to
5 mm make 7 mm where a distance between axes and a length along one come together."""
TILT_TOLERANCE = 0.014
"""Largest angle (rad) by which an axis may be turned. Two parameters (alpha, beta) that are each
off by 0.5 deg make 0.0124."""
SLANTED = 0.05  # sine between axes that meet, at least
STAGES = 16  # arms between the neighbour and the arm, for branches that have to be followed
REACH = 6.0  # deviations by which a best approach of the neighbour may miss
NEARLY_SINGULAR = 3.0  # deviations up to which a singular value may hide more postures
JUMP = 6.0  # deviations by which a joint of a regular branch may move
VALLEY = 1.5  # roots of the deviation up to which a valley is followed
FAR = 6.0  # deviations missing in a valley beyond which it is left
ASIDE = 24  # poses nearby that are asked where doubts are left
SPREAD = 0.25  # distance of starts nearby above which both are followed [rad]
FEW = 8  # and where the neighbour's reach may end without a sign
MOST = 16  # postures of one pose
CHUNK = 1024


@dataclass(frozen=True, slots=True, eq=False)
class Neighbour:
    """A six-joint arm and the structured arm next to it.

    Parameters
    ----------
    chain : JointChain
        The arm.
    near : JointChain
        The neighbour: the same joints, constants that have the structure. The frames of revolute
        and prismatic joints are slid along their axes, which changes no pose.
    plan : LoopPlan
        Its loop in normal form.
    offset : float
        Farthest that an axis was moved [m].
    tilt : float
        Largest angle by which an axis was turned [rad].
    unit : float
        Length by which lengths are divided [m].
    deviation : float
        Largest distance of the two arms' poses at the same joint values, in units of the arm and
        radians: the scale of what can happen near singular postures.
    abrupt : bool
        Whether the neighbour's closed form can end without a best approach.
    path : ndarray, shape (17, 7, 4, 4)
        Constants from the neighbour's to the arm's, lengths in ``unit``.
    """

    chain: JointChain
    near: JointChain
    plan: LoopPlan
    offset: float
    tilt: float
    unit: float
    deviation: float
    abrupt: bool
    path: Array

    @property
    def method(self) -> str:
        """The family in words."""
        return (
            f"{self.plan.family.value}, to within {1e3 * self.offset:.2g} mm and "
            f"{np.rad2deg(self.tilt):.2g} deg; solved on that arm and brought home by Newton steps"
        )


def prepare_neighbour(chain: JointChain) -> Neighbour | None:
    """The structured arm next to a six-joint arm.

    Three consecutive revolute axes are made to meet in the point nearest to them, or turned to be
    parallel; of all arms that result the nearest is taken. A pair of axes that the closed form
    likes to be simple (parallel, meeting or square) is made so where it nearly is.

    Parameters
    ----------
    chain : JointChain
        The arm.

    Returns
    -------
    Neighbour or None
        None if no axis triple meets within `OFFSET_TOLERANCE` or is parallel within
        `TILT_TOLERANCE`.

    Examples
    --------
    >>> import numpy as np
    >>> from robotmodels.igm.loop import joint_chain
    >>> from robotmodels.robots import load
    >>> arm = load("rx90")
    >>> worn = arm.with_table(arm.table.replace(d=arm.table.d + [0, 0, 0, 0, 1e-3, 0]))
    >>> print(prepare_neighbour(joint_chain(worn)).method)
    three revolute axes that meet in a point (Pieper), to within 1 mm and 0 deg; solved on that \
arm and brought home by Newton steps
    """
    if chain.k != 6:
        return None
    slid = _slid(chain.D)
    best: tuple[float, _Change, LoopPlan] | None = None
    for first in range(4):
        if chain.sigma[first : first + 3].any():
            continue
        for family, make in ((Family.CONCURRENT, _meeting), (Family.PARALLEL, _parallel)):
            change = make(slid, first)
            if change is None or not change.small:
                continue
            found = _planned(chain, change, family)
            if found is not None and (best is None or found[0].size < best[0]):
                best = found[0].size, *found
    if best is None:
        return None
    _, change, plan = best
    unit = max(0.5 * float(np.linalg.norm(slid[1:, :3, 3], axis=1).sum()), 1e-3)
    deviation = _deviation(chain.sigma, change.D, slid, unit)
    return Neighbour(
        chain=chain,
        near=replace(chain, D=read_only(change.D)),
        plan=plan,
        offset=change.offset,
        tilt=change.tilt,
        unit=unit,
        deviation=deviation,
        abrupt=_abrupt(plan),
        path=read_only(_path(change.D, slid, unit)),
    )


@postures.register
def _(solver: Neighbour, U: Array, references: Array, tolerances: Tolerances) -> Found:
    N = U.shape[0]
    out = nothing_found(N, MOST, 6)
    wanted = np.zeros((N, 6))
    wanted[:] = references
    for start in range(0, N, CHUNK):
        rows = slice(start, start + CHUNK)
        _solve(solver, np.ascontiguousarray(U[rows]), wanted[rows], tolerances, rows, out)
    return out


# --- the structured arm -------------------------------------------------------------------------


class _Change(NamedTuple):
    """Constants that were changed, and by how much at most."""

    D: Array
    offset: float
    tilt: float

    @property
    def small(self) -> bool:
        return self.offset <= OFFSET_TOLERANCE and self.tilt <= TILT_TOLERANCE

    @property
    def size(self) -> float:
        return max(self.offset / OFFSET_TOLERANCE, self.tilt / TILT_TOLERANCE)


def _slid(D: Array) -> Array:
    """Constants with each frame slid along its axis towards its neighbours.

    Sliding commutes with the motion. It keeps numbers small where a table put frames far out, as
    at nearly parallel axes, and a turn of an axis about the origin of its frame then moves little.
    """
    D = np.array(D)
    for i in (1, 2, 3, 4, 5):
        way = D[i][:3, 3] @ D[i][:3, 2]
        D[i][:3, 3] -= way * D[i][:3, 2]
        D[i + 1][2, 3] += way
    for i in (4, 3, 2, 1, 0):
        way = D[i + 1][2, 3]
        D[i + 1][2, 3] = 0.0
        D[i][:3, 3] += way * D[i][:3, 2]
    return D


def _meeting(D: Array, first: int) -> _Change | None:
    """Axes first, first + 1, first + 2 moved to the nearest point of the middle one."""
    (R, t), (S, s) = ((E[:3, :3], E[:3, 3]) for E in (D[first + 1], D[first + 2]))
    slant, other = np.hypot(R[0, 2], R[1, 2]), np.hypot(S[0, 2], S[1, 2])
    if min(slant, other) < SLANTED:
        return None
    # the point at height h on the middle axis misses the first by |a + h b|, the last by |c + h d|
    a, b = t[:2], R[:2, 2]
    across = np.eye(3) - np.outer(S[:, 2], S[:, 2])
    c, d = -across @ s, across[:, 2]
    h = -(a @ b + c @ d) / (b @ b + d @ d)
    D = D.copy()
    D[first + 1][:2, 3] -= a + h * b
    D[first + 2][:3, 3] += c + h * d
    offset = max(np.linalg.norm(a + h * b), np.linalg.norm(c + h * d))
    return _Change(D, float(offset), 0.0)


def _parallel(D: Array, first: int) -> _Change | None:
    """Axes first, first + 1, first + 2 turned parallel."""
    D = D.copy()
    tilt = 0.0
    for E in (D[first + 1], D[first + 2]):
        tilt = max(tilt, abs(_turned(E, 1.0)))
        if np.hypot(E[0, 3], E[1, 3]) <= 2.0 * OFFSET_TOLERANCE:
            return None  # axes that nearly coincide
    return _Change(D, 0.0, tilt)


def _turned(E: Array, cosine: float) -> float:
    """Turn the next axis so that it makes an angle with this cosine (0, +-1), in place; the way."""
    x, y, z = E[:3, 2]
    across = np.hypot(x, y)
    now = np.arctan2(across, z)
    goal = 0.5 * np.pi if cosine == 0.0 else (0.0 if z > 0.0 else np.pi)
    if across == 0.0 or now == goal:
        return 0.0
    axis = np.array([-y, x, 0.0]) / across
    way = goal - now
    K = se3.skew(axis)
    E[:3, :3] = (np.eye(3) + np.sin(way) * K + (1.0 - np.cos(way)) * K @ K) @ E[:3, :3]
    # what rounding left is taken out, so that the structure is exact
    if cosine == 0.0:
        E[2, 2] = 0.0
    else:
        E[:2, 2], E[2, :2] = 0.0, 0.0
        E[2, 2] = np.sign(z)
    return float(way)


def _crossed(E: Array) -> float:
    """Move the next axis so that it meets this one, in place; the way."""
    normal = np.array([-E[1, 2], E[0, 2], 0.0]) / np.hypot(E[0, 2], E[1, 2])
    way = float(normal @ E[:3, 3])
    E[:3, 3] -= way * normal
    return way


def _planned(chain: JointChain, change: _Change, family: Family) -> tuple[_Change, LoopPlan] | None:
    """The loop of the changed arm, with its simple pairs made exact where they nearly are."""
    plan = plan_loop(replace(chain, D=change.D))
    if plan is None or plan.family is not family:
        return None
    simpler = (
        _one_simple_pair(change, plan) if family is Family.CONCURRENT else _square(change, plan)
    )
    if simpler is not None:
        again = plan_loop(replace(chain, D=simpler.D))
        if again is not None and again.family is family:
            return simpler, again
    return change, plan


def _constant(plan: LoopPlan, place: int) -> int | None:
    """Which constant of the chain stands behind a place of the loop; None for the pose."""
    if plan.slot == place:
        return None
    return int(max(plan.order[place], plan.order[(place + 1) % 6]))


def _one_simple_pair(change: _Change, plan: LoopPlan) -> _Change | None:
    """The first or the second two axes of the loop made parallel or meeting: no quartic."""
    options = []
    for place in (0, 1):
        i = _constant(plan, place)
        if i is None:
            continue
        if plan.sigma[place] or plan.sigma[place + 1]:
            return None  # simple as it is
        E = change.D[i]
        across = np.hypot(E[0, 2], E[1, 2])
        D = change.D.copy()
        if across > SLANTED:
            options.append(_Change(D, abs(_crossed(D[i])), 0.0))
        elif np.hypot(E[0, 3], E[1, 3]) > 2.0 * OFFSET_TOLERANCE:
            options.append(_Change(D, 0.0, abs(_turned(D[i], 1.0))))
    options = [option for option in options if option.small]
    if not options:
        return None
    option = min(options, key=lambda option: option.size)
    return _Change(option.D, max(change.offset, option.offset), max(change.tilt, option.tilt))


def _square(change: _Change, plan: LoopPlan) -> _Change | None:
    """The axes behind three parallel ones made square, and meeting: no quartic."""
    D = change.D.copy()
    offset, tilt = change.offset, change.tilt
    for place in (3, 4):
        i = _constant(plan, place)
        if i is None or np.hypot(D[i][0, 2], D[i][1, 2]) < SLANTED:
            return None
        tilt = max(tilt, abs(_turned(D[i], 0.0)))
        if place == 4:
            offset = max(offset, abs(_crossed(D[i])))
    simpler = _Change(D, offset, tilt)
    return simpler if simpler.small else None


def _abrupt(plan: LoopPlan) -> bool:
    """Whether the closed form can end without a best approach that is next to the arm's posture.

    A quadratic or quartic gives no best approach. Three parallel axes give one for the turn of the
    wrist that the pose asks for, and beside an aligned wrist the arm may take any other.
    """
    if plan.family is Family.PARALLEL or plan.sigma[:3].any():
        return True
    for place in (0, 1):
        E = plan.constants[place]
        beside = abs(E[0, 2] * E[1, 3] - E[1, 2] * E[0, 3])
        if plan.slot != place and min(np.hypot(E[0, 2], E[1, 2]), beside) < 1e-9:
            return False
    return True


def _poses(sigma: NDArray[np.int64], D: Array, q: Array) -> Array:
    """Tool in R_0, ``q (N, 6)``."""
    T = np.broadcast_to(D[0], (len(q), 4, 4))
    for k in range(6):
        M = np.tile(np.eye(4), (len(q), 1, 1))
        if sigma[k] == 1:
            M[:, 2, 3] = q[:, k]
        else:
            M[:, 0, 0] = M[:, 1, 1] = np.cos(q[:, k])
            M[:, 1, 0] = np.sin(q[:, k])
            M[:, 0, 1] = -M[:, 1, 0]
        T = T @ M @ D[k + 1]
    return T


def _deviation(sigma: NDArray[np.int64], near: Array, D: Array, unit: float) -> float:
    """Largest distance of the poses of two arms at the same joint values."""
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (256, 6))
    q[:, sigma == 1] *= unit / np.pi
    A, B = _poses(sigma, near, q), _poses(sigma, D, q)
    way = np.linalg.norm(A[:, :3, 3] - B[:, :3, 3], axis=1).max() / unit
    # |R_a - R_b| is sqrt(2) times the angle, while that is small
    angle = np.linalg.norm(A[:, :3, :3] - B[:, :3, :3], axis=(1, 2)).max() / np.sqrt(2.0)
    return float(max(way, angle))


def _path(near: Array, D: Array, unit: float) -> Array:
    """Constants on the way from the neighbour to the arm."""
    path = np.tile(np.eye(4), (STAGES + 1, 7, 1, 1))
    for i in range(7):
        turn = near[i][:3, :3].T @ D[i][:3, :3]
        half = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0],
                               turn[1, 0] - turn[0, 1]])  # fmt: skip
        sine = float(np.linalg.norm(half))
        K = se3.skew(half / sine) if sine > 0.0 else np.zeros((3, 3))
        for stage in range(STAGES + 1):
            share = stage / STAGES
            angle = share * np.arcsin(min(sine, 1.0))
            R = np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K
            path[stage, i, :3, :3] = near[i][:3, :3] @ R
            path[stage, i, :3, 3] = near[i][:3, 3] + share * (D[i][:3, 3] - near[i][:3, 3])
    path[STAGES] = D
    path[:, :, :3, 3] /= unit
    return path


# --- solving ------------------------------------------------------------------------------------


def _solve(
    solver: Neighbour,
    U: Array,
    references: Array,
    tolerances: Tolerances,
    rows: slice,
    out: Found,
) -> None:
    """Postures of some poses into rows of the result."""
    from . import _neighbour as kernels

    N = U.shape[0]
    goals, scaled = _scaled(solver, U, references)
    candidates, there = _candidates(solver, U, references)
    finite = np.isfinite(goals).all(axis=(1, 2))
    there &= finite[:, None]
    found, count = np.zeros((N, MOST, 6)), np.zeros(N, np.int64)
    arrived, doubtful = np.zeros((2, *there.shape), np.bool_)
    exact, doubt = np.zeros(N, np.int64), np.zeros(N, np.bool_)
    double, free = np.zeros((N, MOST), np.bool_), np.zeros((N, MOST), np.int64)
    sigma = np.ascontiguousarray(solver.chain.sigma)
    kernels.arrivals(
        sigma, solver.path[0], solver.path[-1], goals, candidates, there,
        max(REACH * solver.deviation, 1e-7), _small(solver), min(JUMP * solver.deviation, 0.2),
        found, count, arrived, exact, doubtful, doubt,
    )  # fmt: skip
    if solver.abrupt:
        doubt |= finite & (there.sum(axis=1) < 8)
    chosen = np.flatnonzero(doubt)
    if chosen.size:
        part = _Search(
            *(
                np.ascontiguousarray(array[chosen])
                for array in (goals, scaled, candidates, there, arrived, doubtful)
            ),
            *(np.ascontiguousarray(array[chosen]) for array in (exact, found, count, double, free)),
        )
        _search(solver, U[chosen], part, tolerances)
        found[chosen], count[chosen] = part.found, part.count
        double[chosen], free[chosen] = part.double, part.free
    turned = sigma == 1
    found[:, :, turned] *= solver.unit
    rows_in_use = np.arange(MOST) < count[:, None]
    freed = free[:, :, None] == np.arange(1, 7)
    part = checked(solver.chain, U, found, rows_in_use, tolerances, free=freed, double=double)
    for whole, piece in zip(
        (out.q, out.valid, out.residual, out.double, out.free, out.family),
        (part.q, part.valid, part.residual, part.double, part.free, part.family),
        strict=True,
    ):
        whole[rows] = piece


class _Search(NamedTuple):
    """What is known of poses that are in doubt; lengths in units of the arm."""

    goals: Array
    references: Array
    candidates: Array
    there: NDArray[np.bool_]
    arrived: NDArray[np.bool_]
    doubtful: NDArray[np.bool_]
    exact: NDArray[np.int64]
    found: Array
    count: NDArray[np.int64]
    double: NDArray[np.bool_]
    free: NDArray[np.int64]


def _small(solver: Neighbour) -> float:
    """Singular value below which the arm may have postures that its neighbour has not."""
    return min(max(NEARLY_SINGULAR * solver.deviation, 1e-6), 0.3)


def _valley(solver: Neighbour) -> float:
    """Singular value at which a valley ends: folds are as far as the root of the deviation."""
    return min(max(VALLEY * np.sqrt(solver.deviation), 1e-3), 0.4)


def _scaled(solver: Neighbour, U: Array, references: Array) -> tuple[Array, Array]:
    goals, scaled = U.copy(), references.copy()
    goals[:, :3, 3] /= solver.unit
    scaled[:, solver.chain.sigma == 1] /= solver.unit
    return goals, scaled


def _candidates(solver: Neighbour, U: Array, references: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Postures of the neighbour, or its best approach; lengths in units of the arm."""
    slack = max(3.0 * solver.deviation * max(1.0, solver.unit / solver.plan.size), 1e-9)
    q, there, _ = closed_form_postures(
        solver.plan, solver.near, U, references, slack=slack, accepted=np.inf
    )
    q[:, :, solver.chain.sigma == 1] /= solver.unit
    return q, there


def _search(solver: Neighbour, U: Array, part: _Search, tolerances: Tolerances) -> None:
    """Find the postures of poses in doubt, in place."""
    from . import _neighbour as kernels

    sigma = np.ascontiguousarray(solver.chain.sigma)
    kernels.followed(
        sigma, solver.path, part.goals, part.candidates, part.there, part.arrived,
        part.found, part.count,
    )  # fmt: skip
    _walk(solver, part, part.candidates, part.doubtful, tolerances)
    uneven = (part.count + part.double.sum(axis=1)) % 2 == 1
    own = part.there.sum(axis=1)
    unsure = uneven | (np.minimum(part.count, part.exact) < own)
    _ask_aside(solver, U, part, np.flatnonzero(unsure), ASIDE, tolerances)
    if solver.abrupt:
        _ask_aside(solver, U, part, np.flatnonzero(~unsure & (own < 8)), FEW, tolerances)


def _ask_aside(
    solver: Neighbour,
    U: Array,
    part: _Search,
    chosen: NDArray[np.int64],
    shifts: int,
    tolerances: Tolerances,
) -> None:
    """Start from the neighbour's postures at poses nearby, in place.

    With few shifts only from poses with another number of postures: without those there is no edge
    of the neighbour's reach nearby.
    """
    from . import _neighbour as kernels

    if chosen.size == 0:
        return
    rest = _Search(*(np.ascontiguousarray(array[chosen]) for array in part))
    starts, there = _aside(solver, U[chosen], rest.references, shifts)
    if shifts < ASIDE:
        there[there.sum(axis=2) == rest.there.sum(axis=1)[:, None]] = False
    starts, there = starts.reshape(chosen.size, -1, 6), there.reshape(chosen.size, -1)
    arrived = np.zeros_like(there)
    sigma = np.ascontiguousarray(solver.chain.sigma)
    kernels.tried(
        sigma, solver.path[-1], rest.goals, starts, there, arrived, rest.found, rest.count
    )
    _walk(solver, rest, starts, there & ~arrived, tolerances, SPREAD)
    _ask_general(solver, U[chosen], rest, tolerances)
    part.found[chosen], part.count[chosen] = rest.found, rest.count
    part.double[chosen], part.free[chosen] = rest.double, rest.free


def _ask_general(solver: Neighbour, U: Array, part: _Search, tolerances: Tolerances) -> None:
    """Add what the elimination finds where the postures are still odd in number, in place."""
    from . import _neighbour as kernels

    chosen = np.flatnonzero((part.count + part.double.sum(axis=1)) % 2 == 1)
    general = _general(solver.chain) if chosen.size else None
    if general is None:
        return
    rest = _Search(*(np.ascontiguousarray(array[chosen]) for array in part))
    starts, there, _ = general_postures(general, U[chosen])
    starts[:, :, solver.chain.sigma == 1] /= solver.unit
    arrived = np.zeros_like(there)
    kernels.tried(
        np.ascontiguousarray(solver.chain.sigma), solver.path[-1], rest.goals, starts, there,
        arrived, rest.found, rest.count,
    )  # fmt: skip
    _walk(solver, rest, starts, np.zeros_like(there), tolerances)
    part.found[chosen], part.count[chosen] = rest.found, rest.count
    part.double[chosen], part.free[chosen] = rest.double, rest.free


def _aside(
    solver: Neighbour, U: Array, references: Array, count: int
) -> tuple[Array, NDArray[np.bool_]]:
    """Postures of the neighbour at poses nearby ``(N, count, 8, 6)``, lengths in arm units."""
    shifts = _shifts(solver)[:count]
    aside = (U[:, None] @ shifts).reshape(-1, 4, 4)
    scale = np.where(solver.chain.sigma == 1, solver.unit, 1.0)
    q, there = _candidates(solver, aside, np.repeat(scale * references, count, axis=0))
    return q.reshape(len(U), count, 8, 6), there.reshape(len(U), count, 8)


def _walk(
    solver: Neighbour,
    part: _Search,
    starts: Array,
    there: NDArray[np.bool_],
    tolerances: Tolerances,
    spread: float = 0.0,
) -> None:
    """Search the valleys through starts and nearly singular postures, in place."""
    from . import _neighbour_valley as kernels

    kernels.valleys(
        np.ascontiguousarray(solver.chain.sigma), solver.path[-1], part.goals, starts, there,
        part.references, np.array([tolerances.position / solver.unit, tolerances.orientation]),
        _small(solver), _valley(solver), FAR * solver.deviation,
        spread, part.found, part.count, part.double, part.free,
    )  # fmt: skip


def _shifts(solver: Neighbour) -> Array:
    """Small motions of the tool, some of which bring it into the neighbour's reach."""
    rng = np.random.default_rng(0)
    shifts = np.tile(np.eye(4), (ASIDE, 1, 1))
    for k in range(ASIDE):
        K = se3.skew(solver.deviation * rng.normal(size=3))
        shifts[k, :3, :3] = np.linalg.solve(np.eye(3) - 0.5 * K, np.eye(3) + 0.5 * K)
        shifts[k, :3, 3] = solver.deviation * solver.unit * rng.normal(size=3)
    return shifts


@lru_cache(maxsize=16)
def _general(chain: JointChain) -> GeneralSolver | None:
    """The elimination for the arm itself, where it is well conditioned."""
    solver = prepare_general(chain)
    return solver if solver is not None and solver.reliable else None
