"""Checks of inverse models that know nothing of how they work: residuals, paths, other searches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import robotmodels as rm
from benchmarks.igm_postures import sigma_of, uniform

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

CLOSE = 1e-6  # postures as near as this in every joint are the same [rad, m]
ON_PATH = 1e-12  # what may be missing of the pose on the way between two that are the same [m, rad]
DAMPING = (1e-5, 1e-5, 1e-7, 1e-7, 1e-9, 1e-9, 1e-11, 1e-11)
"""Of the steps that keep a pose: singular directions are used where the others do not suffice."""


def missing(model: rm.RobotModel, T: Array, q: Array) -> Array:
    """Translation and rotation from the pose of ``q (N, n)`` to ``T (N, 4, 4)``, shape (N, 6)."""
    P = rm.dgm(model, q)
    turn = Rotation.from_matrix(T[:, :3, :3] @ np.swapaxes(P[:, :3, :3], 1, 2))
    return np.hstack([T[:, :3, 3] - P[:, :3, 3], turn.as_rotvec()])


def residual(model: rm.RobotModel, T: Array, q: Array) -> Array:
    """The larger of the position error [m] and the rotation angle [rad], shape (N,)."""
    e = missing(model, T, q)
    return np.maximum(np.linalg.norm(e[:, :3], axis=1), np.linalg.norm(e[:, 3:], axis=1))


def difference(model: rm.RobotModel, a: Array, b: Array) -> Array:
    """``a - b``, angles by the shorter way round."""
    d = a - b
    return np.where(sigma_of(model) == 0, d - 2 * np.pi * np.round(d / (2 * np.pi)), d)


def gaps(model: rm.RobotModel, rows: Array, valid: Flags, q: Array) -> Array:
    """Largest difference in a joint between ``rows (N, S, n)`` and ``q (N, n)``; inf if invalid."""
    d = np.abs(difference(model, np.where(valid[..., None], rows, 0.0), q[:, None])).max(axis=-1)
    return np.where(valid, d, np.inf)


def joined(model: rm.RobotModel, T: Array, a: Array, b: Array, steps: int = 24) -> Flags:
    """Whether postures ``a`` and ``b (N, n)`` of one pose are joined by a path that keeps it.

    The straight way from one to the other is divided into steps, each corrected by damped Newton
    steps. Between isolated postures the corrections go back, and the last step has to jump.
    """
    length = np.linalg.norm(difference(model, b, a), axis=1)
    alive = np.ones(len(a), np.bool_)
    at = a.copy()
    for k in range(steps):
        rows = np.flatnonzero(alive)
        if rows.size == 0:
            break
        trial = at[rows] + difference(model, b[rows], at[rows]) / (steps - k)
        for damping in DAMPING:
            step, e = newton_step(model, T[rows], trial, damping)
            # what meets the pose stays: a step out of rounding errors would go far
            off = np.linalg.norm(e, axis=1) > 0.5 * ON_PATH
            if not off.any():
                break
            trial[off] += step[off]
        step = np.linalg.norm(difference(model, trial, at[rows]), axis=1)
        at[rows] = trial
        alive[rows] = residual(model, T[rows], trial) <= ON_PATH
        # from one isolated posture to another is one whole jump
        alive[rows] &= step <= length[rows] / 3.0
        if k == steps // 8:
            # held back
            left = np.linalg.norm(difference(model, b[rows], trial), axis=1)
            alive[rows] &= left < 0.98 * length[rows]
    return alive & (np.abs(difference(model, at, b)).max(axis=1, initial=0.0) < 1e-5)


def newton_step(model: rm.RobotModel, T: Array, q: Array, damping: float) -> tuple[Array, Array]:
    """Damped least-squares step towards the poses, and what was missing before it."""
    e = missing(model, T, q)
    left, scale, right = np.linalg.svd(rm.jacobian(model, q), full_matrices=False)
    along = (np.swapaxes(left, 1, 2) @ e[..., None])[..., 0]
    along *= scale / (scale**2 + damping**2)
    return (np.swapaxes(right, 1, 2) @ along[..., None])[..., 0], e


def given_back(model: rm.RobotModel, T: Array, q: Array, rows: Array, valid: Flags) -> Flags:
    """Whether ``q`` is among the rows, or a posture that its pose to 1e-12 cannot tell from it."""
    there = gaps(model, rows, valid, q).min(axis=1, initial=np.inf) < CLOSE
    pose, row = np.nonzero(valid & ~there[:, None])
    if pose.size:
        a, b = q[pose], rows[pose, row]
        found = joined(model, T[pose], a, b) | joined(model, T[pose], b, a)
        there[pose[found]] = True
    return there


def newton_search(
    model: rm.RobotModel, T: Array, starts: int, rng: np.random.Generator, steps: int = 30
) -> list[Array]:
    """Postures of each pose that damped Newton steps reach from random starts."""
    N = len(T)
    pose = np.repeat(np.arange(N), starts)
    q = uniform(model, N * starts, rng)
    done: list[tuple[NDArray[np.int64], Array]] = []
    for _ in range(steps):
        step, e = newton_step(model, T[pose], q, 1e-6)
        met = np.abs(e).max(axis=1) < 1e-11
        done.append((pose[met], q[met]))
        pose, q, step = pose[~met], q[~met], step[~met]
        if pose.size == 0:
            break
        q = q + step * np.minimum(1.0, 0.6 / np.maximum(np.abs(step).max(axis=1), 1e-12))[:, None]
    where, found = (np.concatenate(some) for some in zip(*done, strict=True))
    return [_distinct(model, found[where == i]) for i in range(N)]


def _distinct(model: rm.RobotModel, q: Array) -> Array:
    kept = np.empty((0, model.n))
    while len(q):
        one = q[:1]
        kept = np.vstack([kept, one])
        q = q[np.abs(difference(model, q, one)).max(axis=1) > 1e-5]
    return kept
