"""Which of the postures of every pose belong together, and the Jacobians on the way."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array
from ..geometry import REVOLUTE
from ..igm import IGMSolutions
from ..igm.solutions import posture_distance
from ..kinematics import jacobian
from ..model import RobotModel
from .rotations import rotation_vector

_NEAR = 0.05
"""A posture with the same number that is as near as this goes on from the last, rad or m."""


class Followed(NamedTuple):
    """One posture of every pose.

    Attributes
    ----------
    q : ndarray, shape (N, n)
        Postures, rad or m; NaN where there is none.
    reached : ndarray of bool, shape (N,)
        Where there is one.
    status : ndarray of int8, shape (N,)
        Codes of `IGMStatus`.
    branch : ndarray of str, shape (N,)
        Labels.
    reason : callable
        What became of a pose, by its number, in a sentence.
    """

    q: Array
    reached: NDArray[np.bool_]
    status: NDArray[np.int8]
    branch: NDArray[np.str_]
    reason: Callable[[int], str]


def follow(
    model: RobotModel,
    T: Array,
    found: IGMSolutions,
    start: Array | None,
    solve: Callable[[int, Array], IGMSolutions],
) -> Followed:
    """Take the posture of every pose that goes on from the one before.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    T : ndarray, shape (N, 4, 4)
        Poses.
    found : IGMSolutions
        All postures of all poses.
    start : ndarray, shape (n,), or None
        Where the robot comes from.
    solve : callable
        Postures of one pose, by its number, with a reference: for poses that leave joints free,
        which go on from the posture before.

    Returns
    -------
    Followed
        One posture of each pose that has any.
    """
    N, n = len(T), model.n
    q, branch = np.full((N, n), np.nan), np.zeros(N, found.branch.dtype)
    status = np.array(found.status)
    index = np.flatnonzero(found.valid.any(axis=-1)) if N else np.zeros(0, np.int64)
    reached = np.zeros(N, np.bool_)
    reached[index] = True
    if index.size == 0:
        return Followed(q, reached, status, branch, found.reason)
    revolute = model.table.sigma[model.table.joint_rows] == REVOLUTE
    postures, valid = found.q[index], found.valid[index]
    following = _following(postures, valid, revolute)
    if start is not None:
        distance = posture_distance(postures[0], start, revolute)
        s = int(np.where(valid[0], distance, np.inf).argmin())
    else:
        s = _best_start(postures, valid, found.within_limits[index], following, revolute)
    # postures with free joints depend on the reference: they are solved again from the one before
    loose: NDArray[np.bool_] = np.any(found.free_joints[index], axis=-1)
    after, again = following.tolist(), False
    picks = [s] * len(index)
    settled: dict[int, tuple[Array, str]] = {}
    before = start
    for k in range(len(index)):
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
                one = solve(int(index[k]), reference)
                distance = posture_distance(one.q, reference, revolute)
                best = int(np.where(one.valid, distance, np.inf).argmin())
                settled[k] = one.q[best], str(one.branch[best])
            before = settled[k][0] if k in settled else postures[k, s]
            settled.setdefault(k, (before, str(found.branch[index[k], s])))
    q[index] = postures[np.arange(len(index)), picks]
    branch[index] = found.branch[index, picks]
    for k, (posture, label) in settled.items():
        q[index[k]], branch[index[k]] = posture, label
    return Followed(q, reached, status, branch, found.reason)


def follow_singly(
    model: RobotModel,
    N: int,
    start: Array | None,
    solve: Callable[[int, Array | None], IGMSolutions],
) -> Followed:
    """Solve pose by pose, each from the posture before: for arms with a choice of postures.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    N : int
        Number of poses.
    start : ndarray, shape (n,), or None
        Where the robot comes from.
    solve : callable
        Postures of one pose, by its number, with a reference or None.

    Returns
    -------
    Followed
        One posture of each pose that has any.
    """
    q, reached = np.full((N, model.n), np.nan), np.zeros(N, np.bool_)
    status, labels, reasons = np.zeros(N, np.int8), [""] * N, [""] * N
    before = start
    for k in range(N):
        one = solve(k, before)
        status[k], reasons[k] = one.status, one.reason()
        if not one.valid.any():
            continue
        s = 0
        if before is not None:
            revolute = model.table.sigma[model.table.joint_rows] == REVOLUTE
            distance = posture_distance(one.q, before, revolute)
            s = int(np.where(one.valid, distance, np.inf).argmin())
        before = q[k] = one.q[s]
        reached[k], labels[k] = True, str(one.branch[s])
    return Followed(q, reached, status, np.array(labels, dtype=np.str_), reasons.__getitem__)


def continuous(
    model: RobotModel, q: Array, reached: NDArray[np.bool_], start: Array | None
) -> Array:
    """The same postures, with whole turns such that the angles go on without a break.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q : ndarray, shape (N, n)
        Postures, rad or m.
    reached : ndarray of bool, shape (N,)
        Which rows hold one.
    start : ndarray, shape (n,), or None
        The first posture is brought near to it; without it the path is brought inside the joint
        limits where whole turns can do that.

    Returns
    -------
    ndarray, shape (N, n)
        Angles may leave (-pi, pi].
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


class Task:
    """The Jacobians of what is asked of the tool, along the path.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    T : ndarray, shape (N, 4, 4)
        Poses, m.
    q : ndarray, shape (N, n)
        Postures; NaN where there is none.
    reached : ndarray of bool, shape (N,)
        Which rows hold a posture.
    mask : array_like, shape (6,), or None
        Components that are asked for.
    mask_axes : str
        ``"world"`` or ``"tool"``.

    Attributes
    ----------
    conditioning : ndarray, shape (N,)
        Inverse of the condition number in the Frobenius norm, 1 at best; NaN without a posture.
    sign : ndarray, shape (N,)
        Of the determinant where the Jacobian is square, else 0.
    square : bool
        Whether the posture follows from the task.
    """

    __slots__ = (
        "_asked",
        "_inverse",
        "_length",
        "_poses",
        "_tool",
        "conditioning",
        "sign",
        "square",
    )

    def __init__(
        self,
        model: RobotModel,
        T: Array,
        q: Array,
        reached: NDArray[np.bool_],
        mask: ArrayLike | None,
        mask_axes: str,
    ) -> None:
        N, n = q.shape
        self._asked = np.ones(6, np.bool_) if mask is None else np.asarray(mask, np.bool_)
        self._tool, self._poses = mask_axes == "tool", T
        J = jacobian(model, q[reached], reference="local" if self._tool else "world_aligned")
        lever = np.linalg.norm(J[:, :3], axis=-2).max(initial=0.0)
        self._length = float(lever) if lever > 0.0 else 1.0
        J[:, :3] /= self._length
        J = J[:, self._asked]
        self.square = J.shape[-1] == J.shape[-2]
        self.conditioning, self.sign = np.full(N, np.nan), np.zeros(N)
        self._inverse = np.full((N, n, J.shape[-2]), np.nan)
        inverse, conditioning, sign = _inverted(J)
        self._inverse[reached], self.conditioning[reached] = inverse, conditioning
        self.sign[reached] = sign

    def rates(self, twists: Array) -> Array:
        """Joint velocities (N, n) for twists (N, 6) in world axes; the least of many."""
        return (self._inverse @ self._rows(twists, self._poses)[..., None])[..., 0]

    def foreseen(self) -> Array:
        """Steps (N - 1, n) from pose to pose that the Jacobians at both ends foresee."""
        T = self._poses
        step = np.empty((max(len(T) - 1, 0), 6))
        step[:, :3] = np.diff(T[:, :3, 3], axis=0)
        step[:, 3:] = rotation_vector(T[1:, :3, :3] @ np.swapaxes(T[:-1, :3, :3], -1, -2))
        mean = 0.5 * (self._inverse[1:] + self._inverse[:-1])
        return (mean @ self._rows(step, T[:-1])[..., None])[..., 0]

    def _rows(self, twists: Array, T: Array) -> Array:
        """The components asked for, positions in units of the lever."""
        twists = np.array(twists)
        if self._tool:
            axes = np.swapaxes(T[:, :3, :3], -1, -2)
            twists[:, :3] = (axes @ twists[:, :3, None])[..., 0]
            twists[:, 3:] = (axes @ twists[:, 3:, None])[..., 0]
        twists[:, :3] /= self._length
        return twists[:, self._asked]


def _inverted(J: Array) -> tuple[Any, Any, Any]:
    """(Pseudo-)inverses, conditioning and sign of the determinant of Jacobians (M, m, n)."""
    m, n = J.shape[-2:]
    r = min(m, n)
    size = np.sqrt(np.einsum("kij,kij->k", J, J))
    if m == n:
        try:
            inverse = np.linalg.inv(J)
        except np.linalg.LinAlgError:
            inverse = None  # one of them is singular to the last digit
        if inverse is not None:
            other = np.sqrt(np.einsum("kij,kij->k", inverse, inverse))
            with np.errstate(over="ignore", invalid="ignore"):
                conditioning = r / (size * other)
            return inverse, np.nan_to_num(conditioning), np.sign(np.linalg.det(J))
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    live = s > 1e-14 * s[:, :1]
    with np.errstate(divide="ignore"):
        other = np.sqrt((1.0 / (s * s)).sum(axis=-1))
        factor = np.where(live, 1.0 / np.where(live, s, 1.0), 0.0)
    inverse = np.swapaxes(Vt, -1, -2) @ (factor[..., None] * np.swapaxes(U, -1, -2))
    with np.errstate(invalid="ignore"):
        conditioning = np.where(size > 0.0, r / (size * other), 0.0)
    sign = np.sign(np.linalg.det(J)) if m == n else np.zeros(len(J))
    return inverse, conditioning, sign


def _following(postures: Array, valid: NDArray[np.bool_], revolute: NDArray[np.bool_]) -> NDArray:
    """For every posture the one of the next pose that goes on from it, shape (M - 1, S).

    Postures come in the order of their branches, so that it is usually the one with the same
    number. Where that is not near, all are compared, angles by their chords: a product of matrices.
    """
    M, S = valid.shape
    following = np.tile(np.arange(S), (max(M - 1, 0), 1))
    turn = 2.0 * np.pi
    with np.errstate(invalid="ignore"):
        way = np.abs(postures[1:] - postures[:-1])
        way = np.where(revolute, np.minimum(way, np.abs(turn - way)), way).max(axis=-1, initial=0.0)
        far = np.flatnonzero(~((way < _NEAR) | ~valid[:-1]).all(axis=-1))
    if far.size == 0:
        return following
    q = np.where(valid[..., None], postures, 0.0)
    angle, stroke = q[..., revolute], q[..., ~revolute]
    c, s = np.cos(angle), np.sin(angle)
    half = 0.5 * (stroke * stroke).sum(axis=-1, keepdims=True)
    here = np.concatenate((c, s, stroke, np.ones_like(half)), axis=-1)[far]
    there = np.concatenate((c, s, stroke, -half), axis=-1)[far + 1]
    alike = here @ np.ascontiguousarray(np.swapaxes(there, -1, -2))
    following[far] = np.where(valid[far + 1][:, None, :], alike, -np.inf).argmax(axis=-1)
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
