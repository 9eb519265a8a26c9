"""Choice of one posture for each pose, such that the motion is continuous."""

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
    """One posture of every pose. Shapes: q (N, n); reached, status, branch (N,)."""

    q: Array
    reached: NDArray[np.bool_]
    status: NDArray[np.int8]
    branch: NDArray[np.str_]
    reason: Callable[[int], str]


def revolute_joints(model: RobotModel) -> NDArray[np.bool_]:
    """Which joints turn (n,)."""
    return model.table.sigma[model.table.joint_rows] == REVOLUTE


def follow(
    model: RobotModel,
    found: IGMSolutions,
    start: Array | None,
    solve: Callable[[int, Array], IGMSolutions],
) -> Followed:
    """Choose the posture of every pose that continues the one before. Shapes: start (n,)."""
    names, revolute = np.array((*found.labels, "")), revolute_joints(model)
    reached = np.atleast_1d(found.valid.any(axis=-1))
    q, branch = np.full((reached.size, model.n), np.nan), np.zeros(reached.size, names.dtype)
    rows = Followed(q, reached, np.array(found.status), branch, found.reason)
    index = np.flatnonzero(reached)
    if index.size == 0:
        return rows
    postures, valid, code = found.q[index], found.valid[index], found.code[index]
    after = following(postures, valid, revolute)
    if start is not None:
        s = _nearest(postures[0], valid[0], start, revolute)
    else:
        s = _best_start(postures, valid, found.within_limits[index], after, revolute)
    loose = np.any(found.free_joints[index], axis=-1)
    if not loose.any() and (after == np.arange(after.shape[-1])).all():
        q[index], branch[index] = postures[:, s], names[code[:, s]]
        return rows
    for k, i in enumerate(index.tolist()):
        before = q[index[k - 1]] if k else start
        if k and before is not None:  # free joints depend on the posture before
            freed, s = loose[k - 1, s], int(after[k - 1, s])
            s = _nearest(postures[k], valid[k], before, revolute) if freed else s
        q[i], branch[i] = postures[k, s], names[code[k, s]]
        if loose[k, s] and before is not None:
            one = solve(i, before)
            best = _nearest(one.q, one.valid, before, revolute)
            q[i], branch[i] = one.q[best], one.branch[best]
    return rows


def _nearest(q: Array, valid: NDArray[np.bool_], near: Array, revolute: NDArray[np.bool_]) -> int:
    """Number of the posture (S, n) that is nearest to another one (n,)."""
    return int(np.where(valid, posture_distance(q, near, revolute), np.inf).argmin())


def follow_singly(
    model: RobotModel,
    N: int,
    start: Array | None,
    solve: Callable[[int, Array | None], IGMSolutions],
    go_on: Callable[[int, Array], IGMSolutions],
) -> Followed:
    """Solve pose by pose, each from the posture before: for arms with a choice of postures."""
    revolute = revolute_joints(model)
    q, reached = np.full((N, model.n), np.nan), np.zeros(N, np.bool_)
    status, labels, reasons = np.zeros(N, np.int8), [""] * N, [""] * N
    before, steps = start, False
    for k in range(N):
        if steps and before is not None and reached[k - 1]:
            one = go_on(k, before)
            # from far away the search may end at another branch
            if one.valid[0] and posture_distance(one.q[0], before, revolute) < _STEP:
                before = q[k] = one.q[0]
                reached[k], status[k], reasons[k] = True, one.status, one.reason()
                continue
        one = solve(k, before)
        status[k], reasons[k] = one.status, one.reason()
        if one.valid.any():
            s = 0 if before is None else _nearest(one.q, one.valid, before, revolute)
            before = q[k] = one.q[s]
            reached[k], labels[k] = True, str(one.branch[s])
            steps = not one.method.endswith("arm angle")
    branch = np.array(labels, dtype=np.str_)
    return Followed(q, reached, status, branch, reasons.__getitem__)


def continuous(
    model: RobotModel, q: Array, reached: NDArray[np.bool_], start: Array | None
) -> Array:
    """The same postures with whole turns added for continuous angles.

    Shapes: q (N, n), reached (N,), start (n,) -> (N, n).
    """
    turn, revolute, out = 2.0 * np.pi, revolute_joints(model), q.copy()
    if not reached.any():
        return out
    rows = q[reached]
    rows[:, revolute] = np.unwrap(rows[:, revolute], axis=0)
    if start is not None:
        shift = np.round((start - rows[0]) / turn)
    else:
        with np.errstate(invalid="ignore"):
            up = np.ceil((model.lower - rows.min(axis=0)) / turn - 1e-12)
            down = np.floor((model.upper - rows.max(axis=0)) / turn + 1e-12)
        shift = np.where(up > 0.0, up, np.where(down < 0.0, down, 0.0))
        # only where the whole of the path then fits
        shift = np.where(np.isfinite(shift) & (up <= down), shift, 0.0)
    out[reached] = rows + np.where(revolute, shift * turn, 0.0)
    return out


def following(q: Array, valid: NDArray[np.bool_], revolute: NDArray[np.bool_]) -> NDArray[np.intp]:
    """For every posture (M, S, n) the one of the next pose that continues it, shape (M - 1, S)."""
    M, S, _ = q.shape
    # also False for NaN, where the next pose lacks this posture
    near = (np.abs(np.diff(q, axis=0)) < _NEAR).all(axis=-1)
    after = np.tile(np.arange(S), (max(M - 1, 0), 1))
    rows = np.flatnonzero((valid[:-1] & ~near).any(axis=1))
    apart = posture_distance(q[rows + 1, None], q[rows, :, None], revolute)
    nearest = np.where(valid[rows + 1, None], apart, np.inf).argmin(axis=-1)
    after[rows] = np.where(valid[rows], nearest, after[rows])
    return after


def _best_start(
    postures: Array,
    valid: NDArray[np.bool_],
    inside: NDArray[np.bool_],
    after: NDArray[np.intp],
    revolute: NDArray[np.bool_],
) -> int:
    """The first posture whose branch goes through best."""
    M, S = valid.shape
    chains = np.tile(np.arange(S), (M, 1))
    if (after != chains[0]).any():
        for k in range(M - 1):
            chains[k + 1] = after[k][chains[k]]
    ways = np.take_along_axis(postures, chains[..., None], axis=1)
    steps = posture_distance(ways[1:], ways[:-1], revolute)
    ordinary = np.median(steps, axis=0) if M > 1 else np.zeros(S)
    jumps = (steps > np.maximum(0.3, 8.0 * ordinary)).sum(axis=0)
    outside = (~np.take_along_axis(inside, chains, axis=1)).sum(axis=0)
    return int(np.lexsort((steps.sum(axis=0), outside, jumps, ~valid[0]))[0])
