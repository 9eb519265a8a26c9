"""Events along poses, and the Jacobians of the task that show them.

References
----------
Book section 4.3.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Value
from ..kinematics import jacobian
from ..model import RobotModel
from ..se3.orientation import rotation_vectors_of
from .follow import Followed

_JUMP = 0.1
"""A step that differs from what the Jacobian foresees by this much, and by half of itself, is no
continuation: rad or m."""

_FAR = 0.5 * np.pi
"""After a run without postures, a joint that is this far away did not go on, rad or m."""


class PathEventKind(Enum):
    """Kinds of events along a path; the value is a sentence."""

    OUT_OF_REACH = "The path leaves the reach of the robot."
    OUTSIDE_LIMITS = "The posture is outside the joint limits."
    SINGULAR = "The path meets a singular position."
    CHANGES_POSTURE = "The posture changes its branch."
    JUMP = "The posture cannot be continued: the joints would have to jump."
    TOO_FAST = "The joints would exceed their velocity limits."


@dataclass(frozen=True, slots=True, eq=False)
class PathEvent(Value):
    """An event on a run of poses.

    Parameters
    ----------
    kind : PathEventKind
        Its kind.
    first, last : int
        Numbers of the first and the last pose of the run.
    start, stop : float
        Their times, s, where the path has times; NaN otherwise. The edges of the reach on a
        `PoseTrajectory` are found between the samples.
    detail : str
        Which joint, by how much.
    """

    kind: PathEventKind
    first: int
    last: int
    start: float
    stop: float
    detail: str = ""

    def __str__(self) -> str:
        where = f"pose {self.first}" + (f" to {self.last}" if self.last > self.first else "")
        when = "" if np.isnan(self.start) else f" ({self.start:.4g} s to {self.stop:.4g} s)"
        return f"{where}{when}: {self.kind.value}" + (f" {self.detail}" if self.detail else "")


class Task:
    """Jacobians of the task along the path.

    Shapes: T (N, 4, 4); q (N, n); reached, conditioning, sign (N,); mask (6,); columns (k,).
    """

    def __init__(
        self,
        model: RobotModel,
        T: Array,
        q: Array,
        reached: NDArray[np.bool_],
        mask: ArrayLike | None,
        mask_axes: str,
        columns: NDArray[np.int64],
    ) -> None:
        self._requested = np.ones(6, np.bool_) if mask is None else np.asarray(mask, np.bool_)
        self._tool, self._poses = mask_axes == "tool", T
        J = jacobian(model, q[reached], reference="local" if self._tool else "world_aligned")
        self._length = np.linalg.norm(J[:, :3], axis=-2).max(initial=0.0) or 1.0
        J[:, :3] /= self._length
        J = J[:, self._requested][..., columns]
        self.square = J.shape[-1] == J.shape[-2]
        self.conditioning, self.sign = np.full(len(q), np.nan), np.zeros(len(q))
        self._inverse = np.full((*q.shape, J.shape[-2]), np.nan)
        self._inverse[reached] = 0.0
        inverse, self.conditioning[reached], self.sign[reached] = inverted(J)
        self._inverse[np.ix_(reached, columns)] = inverse

    def rates(self, twists: Array) -> Array:
        """Joint velocities (N, n) for twists (N, 6) in world axes; the least of many."""
        return (self._inverse @ self._rows(twists, self._poses)[..., None])[..., 0]

    def foreseen(self, steps: NDArray[np.intp]) -> Array:
        """Steps (S, n) that the Jacobians at both ends foresee, from some poses to the next."""
        T, after = self._poses[steps], self._poses[steps + 1]
        move = np.empty((steps.size, 6))
        move[:, :3] = after[:, :3, 3] - T[:, :3, 3]
        move[:, 3:] = rotation_vectors_of(after[:, :3, :3] @ np.swapaxes(T[:, :3, :3], -1, -2))
        mean = 0.5 * (self._inverse[steps + 1] + self._inverse[steps])
        return (mean @ self._rows(move, T)[..., None])[..., 0]

    def _rows(self, twists: Array, T: Array) -> Array:
        """The requested components, positions in units of the lever."""
        twists = np.array(twists)
        if self._tool:
            axes = np.swapaxes(T[:, :3, :3], -1, -2)
            twists[:, :3] = (axes @ twists[:, :3, None])[..., 0]
            twists[:, 3:] = (axes @ twists[:, 3:, None])[..., 0]
        twists[:, :3] /= self._length
        return twists[:, self._requested]


def inverted(J: Array) -> tuple[Any, Any, Any]:
    """(Pseudo-)inverses, conditioning and sign of the determinant of Jacobians (M, m, n)."""
    M, m, n = J.shape
    if m == n:
        with suppress(np.linalg.LinAlgError):
            inverse = np.linalg.inv(J)
            size = np.linalg.norm(J, axis=(1, 2)) * np.linalg.norm(inverse, axis=(1, 2))
            return inverse, np.nan_to_num(n / size), np.sign(np.linalg.det(J))
    # one of them is singular to the last digit, or they are not square
    s = np.linalg.svd(J, compute_uv=False)
    live = s[:, -1] > 1e-14 * s[:, 0]
    product = (s * s).sum(axis=-1) * (1.0 / np.where(live[:, None], s, 1.0) ** 2).sum(axis=-1)
    conditioning = np.where(live, min(m, n) / np.sqrt(np.maximum(product, 1e-300)), 0.0)
    sign = np.sign(np.linalg.det(J)) if m == n else np.zeros(M)
    return np.linalg.pinv(J, rcond=1e-14), conditioning, sign


def path_events(
    model: RobotModel,
    times: Array,
    q: Array,
    v: Array,
    rows: Followed,
    task: Task,
    singular_below: float,
    start: Array | None = None,
) -> list[PathEvent]:
    """Events along a path, in order. Shapes: times (N,); q, v (N, n); start (n,)."""
    reached = rows.reached
    events: list[PathEvent] = []

    def add(kind: PathEventKind, i: int, j: int, text: str) -> None:
        events.append(PathEvent(kind, i, j, times[i], times[j], text))

    with np.errstate(invalid="ignore", divide="ignore"):
        over = np.maximum(q - model.upper, model.lower - q)
        share = np.abs(v) / model.table.velocity
        outside, fast = over > 1e-9, share > 1.0 + 1e-9
    step, jump, gaps = _jumps(q, reached, task)
    adjacent = reached[1:] & reached[:-1]
    flips = adjacent & ~jump & (task.sign[1:] * task.sign[:-1] < 0.0)
    # a determinant that changes its sign between two samples passed a singular position
    low = reached & (task.conditioning < singular_below)
    low[:-1] |= flips
    low[1:] |= flips
    for i, j in _runs(~reached):
        k = (i + j) // 2
        add(PathEventKind.OUT_OF_REACH, i, j, f"Pose {k}: {rows.reason(k)}")
    for i, j in _runs(np.any(outside, axis=-1)):
        add(PathEventKind.OUTSIDE_LIMITS, i, j, _worst(over[i : j + 1], "is outside by {:.4g}."))
    for i, j in _runs(low):
        least = np.nanmin(task.conditioning[i : j + 1])
        add(PathEventKind.SINGULAR, i, j, f"The least conditioning of the samples is {least:.2g}.")
    for i, j in _runs(np.any(fast, axis=-1)):
        text = "needs {:.4g} times its greatest velocity."
        add(PathEventKind.TOO_FAST, i, j, _worst(share[i : j + 1], text))
    for i in np.flatnonzero(jump).tolist():
        add(PathEventKind.JUMP, i, i + 1, _worst(np.abs(step[i : i + 1]), "steps by {:.4g}."))
    if start is not None and reached.any():
        k = int(reached.argmax())
        away = np.abs(q[k : k + 1] - start)
        if away.max(initial=0.0) > (_FAR if k else _JUMP):
            add(PathEventKind.JUMP, k, k, _worst(away, "is {:.4g} away from q_start."))
    for i, j in gaps:
        between = f"{i + 1}" + (f" to {j - 1}" if j > i + 2 else "")
        text = f"steps by {{:.4g}}; in between, at pose {between}, the path is out of reach."
        add(PathEventKind.JUMP, i, j, _worst(np.abs(q[j : j + 1] - q[i]), text))
    changed = adjacent & ((rows.branch[1:] != rows.branch[:-1]) | flips)
    for i in np.flatnonzero(changed).tolist():
        before, after = str(rows.branch[i]), str(rows.branch[i + 1])
        # numbers are ranks among the postures of a pose, not names
        named = before != after and before[:1].isalpha() and after[:1].isalpha()
        if named or flips[i]:
            text = f"From {before} to {after}." if named else ""
            add(PathEventKind.CHANGES_POSTURE, i, i + 1, text)
    return sorted(events, key=lambda event: (event.first, event.last))


def _jumps(
    q: Array, reached: NDArray[np.bool_], task: Task
) -> tuple[Array, NDArray[np.bool_], list[tuple[int, int]]]:
    """Steps (N - 1, n), which of them are no continuation, and which poses about a gap."""
    step = np.diff(q, axis=0)
    adjacent = reached[1:] & reached[:-1]
    with np.errstate(invalid="ignore"):
        size = np.abs(step).max(axis=-1, initial=0.0)
    jump = adjacent & (size > _JUMP)
    wide = np.flatnonzero(jump)
    if wide.size:
        off = np.abs(step[wide] - task.foreseen(wide)).max(axis=-1, initial=0.0)
        jump[wide] = ~(off <= np.maximum(_JUMP, 0.5 * size[wide]))
    # after a gap the posture goes on where it can; any other one is a jump
    gaps = [
        (i, j)
        for i, j in pairwise(np.flatnonzero(reached).tolist())
        if j > i + 1 and np.abs(q[j] - q[i]).max(initial=0.0) > _FAR
    ]
    return step, jump, gaps


def _runs(where: Any) -> list[tuple[int, int]]:
    """First and last number of every run of true values."""
    edges = np.diff(np.concatenate(((False,), where, (False,))).astype(np.int8))
    first, last = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    return [(int(i), int(j)) for i, j in zip(first, last, strict=True)]


def _worst(values: Array, sentence: str) -> str:
    """The joint with the greatest value of a run, in a sentence."""
    peak = np.nanmax(values, axis=0)
    j = int(peak.argmax())
    return f"Joint {j + 1} {sentence.format(peak[j])}"
