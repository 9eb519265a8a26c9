"""Which of the postures of every pose belong together."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..geometry import REVOLUTE
from ..igm import IGMSolutions
from ..igm.solutions import posture_distance
from ..model import RobotModel

_STEP = 0.5
"""A posture found by steps from the last is taken when it is as near as this, rad or m."""

_NEAR = 0.05
"""A posture with the same number that is as near as this goes on from the last, rad or m."""


class Followed(NamedTuple):
    """One posture of every pose. Shapes: q (N, n); reached, status, branch (N,); missing (N, 6)."""

    q: Array
    reached: NDArray[np.bool_]
    status: NDArray[np.int8]
    branch: NDArray[np.str_]
    missing: Array
    reason: Callable[[int], str]


def follow(
    model: RobotModel,
    T: Array,
    found: IGMSolutions,
    start: Array | None,
    solve: Callable[[int, Array], IGMSolutions],
) -> Followed:
    """Choose the posture of every pose that continues the one before.

    Shapes: T (N, 4, 4), start (n,).
    """
    N, n = len(T), model.n
    names = np.array((*found.labels, ""))
    q, branch = np.full((N, n), np.nan), np.zeros(N, names.dtype)
    status, missing = np.array(found.status), _missing(found)
    index = np.flatnonzero(found.valid.any(axis=-1)) if N else np.zeros(0, np.int64)
    reached = np.zeros(N, np.bool_)
    reached[index] = True
    if index.size == 0:
        return Followed(q, reached, status, branch, missing, found.reason)
    revolute = model.table.sigma[model.table.joint_rows] == REVOLUTE
    postures, valid = found.q[index], found.valid[index]
    following = _following(postures, valid, revolute)
    if start is not None:
        distance = posture_distance(postures[0], start, revolute)
        s = int(np.where(valid[0], distance, np.inf).argmin())
    else:
        s = _best_start(postures, valid, found.within_limits[index], following, revolute)
    loose: NDArray[np.bool_] = np.any(found.free_joints[index], axis=-1)
    picks, settled = [s] * len(index), {}
    if loose.any():
        picks, settled = _settled(
            postures, valid, names[found.code[index]], loose, following, s, revolute, start,
            lambda k, near: solve(int(index[k]), near),
        )  # fmt: skip
    elif (following != np.arange(following.shape[-1])).any():
        after = following.tolist()
        for k in range(1, len(index)):
            picks[k] = after[k - 1][picks[k - 1]]
    q[index] = postures[np.arange(len(index)), picks]
    branch[index] = names[found.code[index, picks]]
    for k, (posture, label) in settled.items():
        q[index[k]], branch[index[k]] = posture, label
    return Followed(q, reached, status, branch, missing, found.reason)


def _settled(
    postures: Array,
    valid: NDArray[np.bool_],
    branch: NDArray[np.str_],
    loose: NDArray[np.bool_],
    following: NDArray[np.int64],
    s: int,
    revolute: NDArray[np.bool_],
    start: Array | None,
    solve: Callable[[int, Array], IGMSolutions],
) -> tuple[list[int], dict[int, tuple[Array, str]]]:
    """Numbers of the postures taken, and those that were solved again, with their labels.

    Postures with free joints depend on the reference, which is the posture before.
    """
    after, again = following.tolist(), False
    picks = [s] * len(postures)
    settled: dict[int, tuple[Array, str]] = {}
    before = start
    for k in range(len(postures)):
        if again and before is not None:
            distance = posture_distance(postures[k], before, revolute)
            s = int(np.where(valid[k], distance, np.inf).argmin())
        elif k:
            s = after[k - 1][s]
        picks[k] = s
        again = bool(loose[k, s])
        if again:
            reference = before if k == 0 or k - 1 in settled else postures[k - 1, picks[k - 1]]
            if reference is not None:
                one = solve(k, reference)
                distance = posture_distance(one.q, reference, revolute)
                best = int(np.where(one.valid, distance, np.inf).argmin())
                settled[k] = one.q[best], str(one.branch[best])
            before = settled[k][0] if k in settled else postures[k, s]
            settled.setdefault(k, (before, str(branch[k, s])))
    return picks, settled


def follow_singly(
    model: RobotModel,
    N: int,
    start: Array | None,
    solve: Callable[[int, Array | None], IGMSolutions],
    go_on: Callable[[int, Array], IGMSolutions],
) -> Followed:
    """Solve pose by pose, each from the posture before: for arms with a choice of postures."""
    revolute = model.table.sigma[model.table.joint_rows] == REVOLUTE
    q, reached = np.full((N, model.n), np.nan), np.zeros(N, np.bool_)
    status, labels, reasons = np.zeros(N, np.int8), [""] * N, [""] * N
    missing = np.full((N, 6), np.nan)
    before, steps = start, False
    for k in range(N):
        if steps and before is not None and reached[k - 1]:
            one = go_on(k, before)
            # from far away the search may end at another branch
            if one.valid[0] and posture_distance(one.q[0], before, revolute) < _STEP:
                before = q[k] = one.q[0]
                reached[k], status[k], reasons[k] = True, one.status, one.reason()
                missing[k] = 0.0
                continue
        one = solve(k, before)
        status[k], reasons[k], missing[k] = one.status, one.reason(), _missing(one)
        if not one.valid.any():
            continue
        s = 0
        if before is not None:
            distance = posture_distance(one.q, before, revolute)
            s = int(np.where(one.valid, distance, np.inf).argmin())
        before = q[k] = one.q[s]
        reached[k], labels[k] = True, str(one.branch[s])
        steps = not one.method.endswith("arm angle")
    branch = np.array(labels, dtype=np.str_)
    return Followed(q, reached, status, branch, missing, reasons.__getitem__)


def _missing(found: IGMSolutions) -> Array:
    """What the closest postures miss of what was asked for, shape (..., 6)."""
    lacking = found.missing if found.error is None else found.error[..., 0, :]
    if lacking is None:
        return np.full((*found.status.shape, 6), np.nan)
    return np.where(found.mask, lacking, 0.0)


def continuous(
    model: RobotModel, q: Array, reached: NDArray[np.bool_], start: Array | None
) -> Array:
    """The same postures with whole turns added for continuous angles.

    Shapes: q (N, n), reached (N,), start (n,) -> (N, n).
    """
    turn = 2.0 * np.pi
    revolute = model.table.sigma[model.table.joint_rows] == REVOLUTE
    out = q.copy()
    if not reached.any():
        return out
    rows = q[reached]
    rows[:, revolute] = np.unwrap(rows[:, revolute], axis=0)
    if start is not None:
        shift = np.round((start - rows[0]) / turn)
    else:
        low, high = rows.min(axis=0), rows.max(axis=0)
        with np.errstate(invalid="ignore"):
            up = np.ceil((model.lower - low) / turn - 1e-12)
            down = np.floor((model.upper - high) / turn + 1e-12)
        shift = np.where(up > 0.0, up, np.where(down < 0.0, down, 0.0))
        # only where the whole of the path then fits
        shift = np.where(np.isfinite(shift) & (up <= down), shift, 0.0)
    out[reached] = rows + np.where(revolute, shift * turn, 0.0)
    return out


def _following(
    postures: Array, valid: NDArray[np.bool_], revolute: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """For every posture the one of the next pose that goes on from it, shape (M - 1, S)."""
    from ..kernels.posture_chains import following_postures

    M, S = valid.shape
    following = np.empty((max(M - 1, 0), S), np.int64)
    following_postures(
        np.ascontiguousarray(postures), np.ascontiguousarray(valid), revolute, _NEAR, following
    )
    return following


def _best_start(
    postures: Array,
    valid: NDArray[np.bool_],
    inside: NDArray[np.bool_],
    following: NDArray,
    revolute: NDArray[np.bool_],
) -> int:
    """The first posture whose branch goes through best."""
    M, S = valid.shape
    chains = np.tile(np.arange(S), (M, 1))
    if (following != chains[0]).any():
        for k in range(M - 1):
            chains[k + 1] = following[k][chains[k]]
    ways = np.take_along_axis(postures, chains[..., None], axis=1)
    steps = posture_distance(ways[1:], ways[:-1], revolute)
    ordinary = np.median(steps, axis=0) if M > 1 else np.zeros(S)
    jumps = (steps > np.maximum(0.3, 8.0 * ordinary)).sum(axis=0)
    outside = (~np.take_along_axis(inside, chains, axis=1)).sum(axis=0)
    ranks = [
        (int(jumps[s]), int(outside[s]), float(steps[:, s].sum()))
        if valid[0, s]
        else (M + 1, 0, 0.0)
        for s in range(S)
    ]
    return min(range(S), key=ranks.__getitem__)
