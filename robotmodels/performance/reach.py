"""Cells that an arm with infinitely many postures reaches: samples, then Newton at the border."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..kinematics import dgm, jacobian
from ..model import RobotModel
from .arms import Free, joint_ranges
from .cells import Space, neighbours, samples

_SAMPLES = 400000
_CHUNK = 50000
_STEPS = 25
_ROUNDS = 60


def reached_cells(
    model: RobotModel,
    space: Space,
    points: Array,
    size: Array,
    shape: tuple[int, ...],
    limits: bool,
    is_free: Free | None,
) -> tuple[NDArray[np.bool_], Array]:
    """Which centres of cells are reached (N,), and a posture for each (N, n), NaN for others."""
    q_of = np.full((len(points), model.n), np.nan)
    low = points[0] - 0.5 * size
    q = samples(model, limits, _SAMPLES)
    for k in range(0, len(q), _CHUNK):
        part = q[k : k + _CHUNK]
        if is_free is not None:
            part = part[is_free(part)]
        cell = np.floor((space.of_world(dgm(model, part)[:, :3, 3]) - low) / size).astype(int)
        good = np.all((cell >= 0) & (cell < shape), axis=1)
        q_of[np.ravel_multi_index(tuple(cell[good].T), shape)] = part[good]
    hit = np.isfinite(q_of[:, 0])
    # a sample in a cell says nothing of its centre where the border passes
    inner = ~neighbours(~hit.reshape(shape)).ravel()
    reached, tried = inner.copy(), inner.copy()
    for _ in range(_ROUNDS):
        beside = neighbours((hit | reached).reshape(shape)).ravel() & ~tried
        rows = np.flatnonzero(beside)
        if not rows.size:
            break
        start = _starts(q_of, rows, shape)
        found, good = _moved_to(model, space, points[rows], start, limits)
        if is_free is not None and good.any():
            good[good] = is_free(found[good])
        tried[rows] = True
        reached[rows[good]] = True
        q_of[rows[good]] = found[good]
        hit[rows[~good]] = False
    q_of[~reached] = np.nan
    return reached, q_of


def _starts(q_of: Array, rows: NDArray[np.int64], shape: tuple[int, ...]) -> Array:
    """A posture of the cell or of a neighbour for each row."""
    start = q_of[rows].copy()
    at = np.array(np.unravel_index(rows, shape))
    for step in np.ndindex(*(3,) * len(shape)):
        lacking = np.isnan(start).any(axis=1)
        if not lacking.any():
            break
        to = np.clip(at + np.array(step)[:, None] - 1, 0, np.array(shape)[:, None] - 1)
        start[lacking] = q_of[np.ravel_multi_index(tuple(to), shape)][lacking]
    return np.nan_to_num(start)


def _moved_to(
    model: RobotModel, space: Space, goals: Array, q: Array, limits: bool
) -> tuple[Array, NDArray[np.bool_]]:
    """Postures (N, n) whose tool is at points of the space, by damped Newton steps."""
    ranges, circle = joint_ranges(model, limits)
    low = np.where(circle, -np.inf, ranges[:, 0])
    high = np.where(circle, np.inf, ranges[:, 1])
    reach = max(float(np.abs(goals).max(initial=0.0)), 1e-9)
    q = np.array(q)
    e = np.full(len(q), np.inf)
    for _ in range(_STEPS):
        p = dgm(model, q)[:, :3, 3]
        error = goals - space.of_world(p)
        e = np.linalg.norm(error, axis=1)
        if (e < 1e-9 * reach).all():
            break
        local = (p - space.frame[:3, 3]) @ space.frame[:3, :3]
        J = np.swapaxes(space.frame[:3, :3], 0, 1) @ jacobian(model, q)[:, :3]
        if space.kind == "half plane":
            u = local[:, [0, 2]] / np.maximum(np.hypot(local[:, 0], local[:, 2]), 1e-12)[:, None]
            radial = u[:, :1] * J[:, 0] + u[:, 1:] * J[:, 2]
            J = np.stack((radial, J[:, 1]), axis=1)
        else:
            J = J[:, : space.dimensions]
        # joints at a limit that would go on are left out
        gradient = np.einsum("nij,ni->nj", J, error)
        stuck = ((q <= low) & (gradient < 0.0)) | ((q >= high) & (gradient > 0.0))
        J = np.where(stuck[:, None], 0.0, J)
        G = J @ np.swapaxes(J, 1, 2)
        damping = 1e-9 * reach**2 + 1e-3 * e**2
        G = G + damping[:, None, None] * np.eye(G.shape[1])
        step = np.einsum("nij,ni->nj", J, np.linalg.solve(G, error[..., None])[..., 0])
        step *= np.minimum(1.0, 0.3 / np.maximum(np.abs(step).max(axis=1), 1e-12))[:, None]
        q = np.clip(q + step, low, high)
    return q, e < 1e-7 * reach
