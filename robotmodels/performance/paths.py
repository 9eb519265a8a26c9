"""Feasibility of paths of poses: section 3.5.3 of the book.

A posture is continued to the next pose by Newton steps along the straight motion between the two,
not by nearness, so that it never changes to another one unnoticed.

Parameters
----------
arm, limits, mask
    See `robotmodels.performance`; whole turns are added so that as much as possible of the path
    lies within the limits, and by default the position alone counts for three joints.
poses : array_like, shape (N, 4, 4)
    World poses of the tool.
through_singular : bool
    Whether a motion may pass singular positions, to the posture that goes on most smoothly.
cost : {"length", "conditioning"}
    The best motion is the shortest, or has the least mean of one over the least singular value.

Returns
-------
FeasiblePath
    The best motion, and for every starting posture where it breaks.

References
----------
A. Elias and J. Wen, arXiv 2501.18505.

Examples
--------
>>> from robotmodels.kinematics import dgm
>>> from robotmodels.robots import load
>>> arm, t = load("rx90"), np.linspace(0.0, 1.0, 50)[:, None]
>>> q = [0.1, 0.2, 1.3, 0.4, 0.5, 0.6] + t * [0.5, 0.2, 0.1, 0.3, 0.4, 1.0]
>>> found = feasible_path(arm, dgm(arm, q), limits=False)
>>> found.status.name, len(found.reached)
('FOLLOWED', 8)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_flag, as_mask
from .._choices import one_of
from .._outcomes import Outcome, Result
from ..errors import ShapeError
from ..igm.loop import joint_chain
from ..igm.request import poses_of
from ..kinematics import dgm, jacobian
from ..kinematics.lengths import characteristic_length
from ..model import RobotModel
from ..se3.orientation import rotation_vectors_of
from . import arms
from .accessibility import postures_of
from .arms import Flags, Ints, JointSpace, joint_space, turning, wrapped
from .singularity import bound_of, sign_factors

COSTS = ("length", "conditioning")
_THROUGH = 0.5  # rad or m: longest step through a singular position


class PathStatus(Outcome):
    """Outcome of `feasible_path`."""

    FOLLOWED = 0, "The path is followed from at least one starting posture."
    BROKEN = 1, "The path is followed to its end from no starting posture."
    NOT_DEFINED = 2, "The task leaves infinitely many postures, or none moves: lock a joint."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FeasiblePath(Result):
    """Joint motions that follow a path of poses, from every starting posture.

    ``q`` (N, n) is the best motion, rad or m, NaN from where it breaks. Of each posture of the
    first pose ``reached`` (S,) says whether the path is followed to its end, ``breaks`` (S,) the
    first pose that is not reached: N if none, 0 if it starts outside the limits. ``aspect`` (N,)
    has bit i set where factor i of the determinant is positive along ``q``; -1 without motion.
    ``postures`` (N, S, n) are all of all poses, NaN where there are fewer, and ``following``
    (N - 1, S) the number of the posture of the next pose that continues each; -1 for none.
    """

    q: Array
    reached: Flags
    breaks: Ints
    aspect: Ints
    postures: Array
    following: Ints
    status: PathStatus

    def reason(self) -> str:
        """The status as a sentence, with where the path breaks."""
        if self.status is not PathStatus.BROKEN:
            return self.status.sentence
        if not len(self.breaks):
            return f"{self.status.sentence} The first pose has no posture."
        last, count = int(self.breaks.max()), len(self.breaks)
        if last == 0:
            return f"{self.status.sentence} All {count} start outside the limits."
        there = not np.isnan(self.postures[last]).all()
        why = "its posture ends at a singular position or a limit" if there else "it has none"
        return f"{self.status.sentence} Of {count} the best breaks before pose {last}: {why}."


def feasible_path(
    arm: RobotModel,
    poses: ArrayLike,
    limits: bool = True,
    mask: ArrayLike | str | None = None,
    through_singular: bool = False,
    cost: str = "length",
) -> FeasiblePath:
    """Follow a path of poses from every posture of its first pose."""
    joints = joint_space(arm, limits)
    one_of(cost, COSTS, "cost")
    as_flag(through_singular, "through_singular")
    T = poses_of(poses)
    if T.ndim != 3:
        raise ShapeError(f"poses: expected shape (N, 4, 4), got {T.shape}.")
    rows, requested = arms.task_rows(arm, mask), None if mask is None else as_mask(mask)
    if mask is None and arms.section_arm(arm) is not None:
        requested = arms.PLACE
    if len(T) == 0 or not rows.any() or arms.leaves_a_family(arm, rows):
        status = PathStatus.NOT_DEFINED if len(T) else PathStatus.FOLLOWED
        q, valid = np.zeros((len(T), 0, arm.n)), np.zeros((len(T), 0), np.bool_)
    else:
        q, valid, _ = postures_of(arm, T, requested)
        status = PathStatus.BROKEN
    following, way = Continuation(arm, rows).successors(
        T[:-1], T[1:], q[:-1], valid[:-1], q[1:], valid[1:]
    )
    U, ends = _chains(arm, q, valid, following, way, bool(through_singular))
    breaks, turns = _within(joints, U, ends)
    best, path = _best(arm, U, breaks, rows, cost), np.full((len(T), arm.n), np.nan)
    if best >= 0:
        last = int(breaks[best])
        path[:last] = U[:last, best] + turns[max(last - 1, 0), best]
    there, aspect = ~np.isnan(path).any(axis=1), np.full(len(T), -1)
    factors = sign_factors(arm, mask) if there.any() else None
    if factors is not None:
        aspect[there] = factors.codes(path[there]) if factors.joints else 0
    reached = breaks == len(T)
    if reached.any():
        status = PathStatus.FOLLOWED
    postures = np.where(valid[..., None], q, np.nan)
    return FeasiblePath(path, reached, breaks, aspect, postures, following, status)


def _chains(
    arm: RobotModel, q: Array, valid: Flags, following: Ints, way: Array, through: bool
) -> tuple[Array, Ints]:
    """Continuous motions (N, S, n) from the starting postures, and how many poses each reaches."""
    at = np.flatnonzero(valid[:1].any(axis=0))
    U = np.full((len(q), len(at), arm.n), np.nan)
    U[:1], ends, alive = q[:1, at], np.ones(len(at), np.int64), np.ones(len(at), np.bool_)
    step = np.zeros((len(at), arm.n))
    for k in range(len(q) - 1):
        to, move = following[k, at], way[k, at]
        for s in np.flatnonzero(alive & (to < 0)) if through else ():
            # the posture that goes on most smoothly
            gap = arms.wrapped(q[k + 1] - q[k, at[s]], arms.turning(arm))
            off = np.where(valid[k + 1], np.linalg.norm(gap - step[s], axis=1), np.inf)
            r = int(off.argmin()) if off.size else -1
            if r >= 0 and np.isfinite(off[r]) and np.abs(gap[r]).max() < _THROUGH:
                to[s], move[s] = r, gap[r]
        alive = alive & (to >= 0)
        if not alive.any():
            break
        at, step = np.where(alive, to, 0), np.where(alive[:, None], move, 0.0)
        U[k + 1, alive] = U[k, alive] + move[alive]
        ends[alive] = k + 2
    return U, ends


def _within(joints: JointSpace, U: Array, ends: Ints) -> tuple[Ints, Array]:
    """First pose not reached within the limits (S,), and whole turns (N, S, n) up to each pose."""
    if not joints.limits or not U.size:
        return ends, np.zeros(U.shape)
    low, high = np.fmin.accumulate(U, axis=0), np.fmax.accumulate(U, axis=0)
    _, fits, turns = joints.turned(low, high)
    first = np.where(fits.all(axis=0), len(U), (~fits).argmax(axis=0))
    return np.minimum(ends, first), turns


def _best(arm: RobotModel, U: Array, breaks: Ints, rows: Flags, cost: str) -> int:
    """The motion that goes farthest, of several the one of least cost; -1 without any."""
    if not len(breaks) or breaks.max() == 0:
        return -1
    last = int(breaks.max())
    chosen = np.flatnonzero(breaks == last)
    part = U[:last, chosen]
    if cost == "length":
        total = np.linalg.norm(np.diff(part, axis=0), axis=2).sum(axis=0)
    else:
        least = bound_of(arm, rows).least(part.reshape(-1, arm.n)).reshape(last, -1)
        total = (1.0 / np.maximum(least, 1e-12)).mean(axis=0)
    return int(chosen[total.argmin()])


# --- continuation of postures: Newton steps along the motion between two poses --------------------


_SHORTEST = 2.0**-10  # part of the motion between two poses
_CORRECTIONS = 6
_AGREES = 0.1  # of the step: prediction and posture
_SHRINKS = 0.3  # a correction beside the one before
_SAME = 1e-5  # rad or m, between the end of a continuation and a posture


@dataclass(frozen=True, slots=True, eq=False)
class Continuation:
    """Continuation of the postures of an arm for the components of a task, rows (6,)."""

    model: RobotModel
    rows: Flags

    def successors(
        self, poses: Array, following: Array, q: Array, valid: Flags, q_next: Array,
        valid_next: Flags,
    ) -> tuple[Ints, Array]:  # fmt: skip
        """Number of the posture that continues the path, -1 for none, and the motion to it.

        Shapes: poses, following (M, 4, 4), q (M, S, n), q_next (M, R, n) -> (M, S), (M, S, n).
        """
        turns = turning(self.model)
        out, way = np.full(valid.shape, -1), np.zeros(q.shape)
        step = self._error(following, poses)
        m, s = np.nonzero(valid)
        k, r = np.nonzero(valid_next)
        if not m.size or not k.size:
            return out, way
        ahead, sign = self._steps(q[m, s], step[m])
        back, sign_next = self._steps(q_next[k, r], -step[k])
        backward = np.full(q_next.shape, np.nan)
        signs = np.zeros(q_next.shape[:2])
        backward[k, r], signs[k, r] = back, sign_next
        # posture by posture: the prediction from either end must meet the other
        gap = wrapped(q_next[m] - q[m, s][:, None], turns)
        gap = np.where(valid_next[m][..., None], gap, np.inf)
        size = np.linalg.norm(ahead, axis=1)
        near = _AGREES * size + 1e-9
        with np.errstate(invalid="ignore"):
            miss = np.linalg.norm(gap - ahead[:, None], axis=2)
            miss = np.maximum(miss, np.linalg.norm(gap + backward[m], axis=2))
            good = (miss <= near[:, None]) & (signs[m] == sign[:, None]) & (size < 1.0)[:, None]
        single = good.sum(axis=1) == 1
        best = good.argmax(axis=1)
        out[m[single], s[single]] = best[single]
        way[m[single], s[single]] = gap[np.flatnonzero(single), best[single]]
        rest = np.flatnonzero(~single)
        if rest.size:
            at, row = m[rest], s[rest]
            end, arrived = self._followed(poses[at], following[at], q[at, row])
            gap = wrapped(q_next[at] - end[:, None], turns)
            gap = np.where(valid_next[at][..., None], np.abs(gap), np.inf).max(axis=2)
            best, near = gap.argmin(axis=1), gap.min(axis=1, initial=np.inf)
            arrived &= near < _SAME
            out[at[arrived], row[arrived]] = best[arrived]
            way[at[arrived], row[arrived]] = (end - q[at, row])[arrived]
        return out, way

    def _error(self, goal: Array, pose: Array) -> Array:
        """Rows of the twist (N, 6) from poses to goals, linear ones over the length."""
        e = np.empty((len(goal), 6))
        e[:, :3] = (goal[:, :3, 3] - pose[:, :3, 3]) / characteristic_length(self.model)
        e[:, 3:] = rotation_vectors_of(goal[:, :3, :3] @ np.swapaxes(pose[:, :3, :3], 1, 2))
        return e[:, self.rows]

    def _steps(self, q: Array, e: Array) -> tuple[Array, Array]:
        """Newton steps (N, n), infinite in singular positions, and sign of the determinant (N,)."""
        columns = joint_chain(self.model).columns
        weights = np.repeat((1.0 / characteristic_length(self.model), 1.0), 3)[self.rows]
        J = jacobian(self.model, q)[:, self.rows][..., columns] * weights[:, None]
        if J.shape[1] != J.shape[2]:  # more rows than joints: those of a plane in space
            J, e = np.swapaxes(J, 1, 2) @ J, np.einsum("nij,ni->nj", J, e)
        det = np.linalg.det(J)
        safe = np.abs(det) > 1e-13
        J = np.where(safe[:, None, None], J, np.eye(J.shape[1]))
        out = np.zeros(q.shape)
        out[:, columns] = np.where(safe[:, None], np.linalg.solve(J, e[..., None])[..., 0], np.inf)
        return out, np.sign(det) * safe

    def _followed(self, start: Array, end: Array, q: Array) -> tuple[Array, Flags]:
        """Continue postures (N, n) along straight motions; where they end, and whether there.

        A part of a motion is halved where the corrections do not shrink or the determinant changes.
        """
        from scipy.spatial.transform import Rotation

        q = q.copy()
        done, h = np.zeros(len(q)), np.full(len(q), 0.5)
        turn = rotation_vectors_of(np.swapaxes(start[:, :3, :3], 1, 2) @ end[:, :3, :3])
        active = np.arange(len(q))
        while active.size:
            t = np.minimum(done[active] + h[active], 1.0)
            goal = start[active].copy()
            goal[:, :3, 3] += t[:, None] * (end[active, :3, 3] - start[active, :3, 3])
            goal[:, :3, :3] = (
                goal[:, :3, :3] @ Rotation.from_rotvec(t[:, None] * turn[active]).as_matrix()
            )
            x, good = q[active].copy(), np.ones(len(active), np.bool_)
            last, sign = np.full(len(active), np.inf), None
            for _ in range(_CORRECTIONS):
                e = self._error(goal, dgm(self.model, x))
                step, side = self._steps(x, e)
                size = np.linalg.norm(step, axis=1)
                sign = side if sign is None else sign
                settled = size < 1e-10
                good &= (side == sign) & (sign != 0.0) & (settled | (size <= _SHRINKS * last))
                good &= size < 0.5
                x = np.where(good[:, None], x + np.where(good[:, None], step, 0.0), x)
                last = size
                if (settled | ~good).all():
                    break
            good &= last < 1e-8
            q[active[good]] = x[good]
            done[active[good]] = t[good]
            h[active] *= np.where(good, 2.0, 0.5)
            active = active[(done[active] < 1.0) & (h[active] >= _SHORTEST)]
        return q, done >= 1.0
