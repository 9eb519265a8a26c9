"""Which posture of the next pose continues a posture: Newton steps along the motion between."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import Array
from ..igm.loop import joint_chain
from ..kinematics import dgm, jacobian
from ..kinematics.lengths import characteristic_length
from ..model import RobotModel
from ..se3.orientation import rotation_vectors_of
from .arms import Flags, Ints, turning, wrapped

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
