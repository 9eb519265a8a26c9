"""The structured arm next to a six-joint arm: axes moved to meet or turned to be parallel."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array
from .loop import JointChain
from .structure import Family, LoopPlan, plan_loop

OFFSET_TOLERANCE = 8e-3
"""Farthest that an axis may be moved (m) to meet another. Parameters that are each off by up to
5 mm make 7 mm where a distance between axes and a length along one come together."""
TILT_TOLERANCE = 0.014
"""Largest angle (rad) by which an axis may be turned. Two parameters (alpha, beta) that are each
off by 0.5 deg make 0.0124."""
SLANTED = 0.05  # sine between axes that meet, at least
STAGES = 16  # arms between the neighbour and the arm, for branches that have to be followed


class Change(NamedTuple):
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


def slid(D: Array) -> Array:
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


def meeting(D: Array, first: int) -> Change | None:
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
    return Change(D, float(offset), 0.0)


def parallel(D: Array, first: int) -> Change | None:
    """Axes first, first + 1, first + 2 turned parallel."""
    D = D.copy()
    tilt = 0.0
    for E in (D[first + 1], D[first + 2]):
        tilt = max(tilt, abs(_turned(E, 1.0)))
        if np.hypot(E[0, 3], E[1, 3]) <= 2.0 * OFFSET_TOLERANCE:
            return None  # axes that nearly coincide
    return Change(D, 0.0, tilt)


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


def planned(chain: JointChain, change: Change, family: Family) -> tuple[Change, LoopPlan] | None:
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


def _one_simple_pair(change: Change, plan: LoopPlan) -> Change | None:
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
            options.append(Change(D, abs(_crossed(D[i])), 0.0))
        elif np.hypot(E[0, 3], E[1, 3]) > 2.0 * OFFSET_TOLERANCE:
            options.append(Change(D, 0.0, abs(_turned(D[i], 1.0))))
    options = [option for option in options if option.small]
    if not options:
        return None
    option = min(options, key=lambda option: option.size)
    return Change(option.D, max(change.offset, option.offset), max(change.tilt, option.tilt))


def _square(change: Change, plan: LoopPlan) -> Change | None:
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
    simpler = Change(D, offset, tilt)
    return simpler if simpler.small else None


def abrupt(plan: LoopPlan) -> bool:
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


def poses(sigma: NDArray[np.int64], D: Array, q: Array) -> Array:
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


def deviation(sigma: NDArray[np.int64], near: Array, D: Array, unit: float) -> float:
    """Largest distance of the poses of two arms at the same joint values."""
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (256, 6))
    q[:, sigma == 1] *= unit / np.pi
    A, B = poses(sigma, near, q), poses(sigma, D, q)
    way = np.linalg.norm(A[:, :3, 3] - B[:, :3, 3], axis=1).max() / unit
    # |R_a - R_b| is sqrt(2) times the angle, while that is small
    angle = np.linalg.norm(A[:, :3, :3] - B[:, :3, :3], axis=(1, 2)).max() / np.sqrt(2.0)
    return float(max(way, angle))


def path_between(near: Array, D: Array, unit: float) -> Array:
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
