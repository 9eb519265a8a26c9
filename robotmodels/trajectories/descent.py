"""Sequential linear programming: a local improvement of profiles under limits of torque."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .._arrays import Array
from ..dynamics.inverse import rigid_torques
from ..obstacles.clearance import link_distances
from .candidates import Candidates, Evaluated
from .limits import ranges_of
from .path_limits import PathLimits

_FIRST = 0.1  # of the longest way of a joint: first bound of a step
_LEAST = 1e-5
_ENOUGH = 5e-4  # relative improvement; three smaller ones in a row end it
_FAR = 1.2  # of a limit
_NEAR = 0.2  # m: obstacles farther away than this do not count
_STEP = 1e-6  # rad or m, of a derivative


def descended(
    task: Candidates, free: Array, iterations: int, evaluated: Callable[[Candidates, Array], Any]
) -> tuple[Array, Evaluated]:
    """Nodes of a profile after steps that lower its cost, each the solution of a linear program.

    ``evaluated`` returns what became of a candidate, or None when the search is over.
    """
    from scipy.optimize import linprog

    now = task.evaluated(free)
    size = float(np.ptp(task.stations, axis=0).max())
    radius, program, slow = _FIRST * size, None, 0
    for _ in range(iterations):
        if radius < _LEAST * size or not np.isfinite(now.cost):
            break
        if program is None:
            program = _program(task, free, now)
        gain, rows, room = program
        bounds = [(-radius, radius)] * free.size
        bounds += [(-0.5 * now.duration, now.duration), (0.0, np.inf)]
        found = linprog(gain, rows, room, bounds=bounds, method="highs")
        trial = None if found.x is None else free + found.x[:-2].reshape(free.shape)
        then = now if trial is None else evaluated(task, trial)
        if then is None:
            break
        better, hoped = now.penalized - then.penalized, -float(found.fun or 0.0)
        if trial is None or not better > 0.0:
            radius *= 0.3
            continue
        radius *= 2.0 if better > 0.7 * hoped else 1.0 if better > 0.25 * hoped else 0.5
        free, now, program = trial, then, None
        slow = slow + 1 if better < _ENOUGH * now.penalized else 0
        if slow == 3:
            break
    return free, now


def _program(task: Candidates, free: Array, now: Evaluated) -> tuple[Array, Array, Array]:
    """Objective (k n + 2,), rows and bounds of steps of the nodes, the duration and a slack."""
    limits, T = task.limits, now.duration
    B = task.basis[:, :, task.free]
    q, v, a = task.sampled(free)
    v, a = v / T, a / T**2
    G, n = q.shape
    k = free.size
    rows, room = [], []

    def add(by_q: Array, by_T: Array | float, value: Array, most: Array, slack: float) -> None:
        """Rows of ``value + step <= most``. Shapes: by_q (..., k), value and most (...)."""
        wanted = most - value < _FAR * np.abs(most) + slack  # others do not bind within a step
        block = np.zeros((*value.shape, k + 2))
        block[..., :k], block[..., k], block[..., k + 1] = by_q, by_T, -slack
        rows.append(block[wanted])
        room.append(np.maximum((most - value)[wanted], -1e3 if slack else 0.0))

    by_joint = np.einsum("pgk,ij->pgikj", B, np.eye(n)).reshape(3, G, n, k)
    tau, by = _torques(limits, q, v, a, B / np.array([1.0, T, T**2])[:, None, None])
    most = limits.torque
    unit = np.where(np.isfinite(most) & (most > 0.0), most, 1.0)
    by_T = by[..., -1] / T / unit
    by = by[..., :-1] / unit[:, None]
    bounds = limits.limits
    for side in (1.0, -1.0):
        add(side * by, side * by_T, side * tau / unit, np.broadcast_to(most / unit, tau.shape), 0.0)
        pairs = zip((q, v, a), ranges_of(bounds)[:3], strict=True)
        for order, (value, (_, low, high)) in enumerate(pairs):
            end = np.broadcast_to(high if side > 0.0 else -low, q.shape)
            part, by_time = side * by_joint[order] / T**order, -order * side * value / T
            if order:
                add(part, by_time, side * value, end, 0.0)
            else:
                add(part, 0.0, side * value, end - task.margin, 1.0)
    if task.bodies and limits.model is not None:
        distance, slope = link_distances(limits.model, q, task.bodies)
        near = np.where(distance < task.clearance + _NEAR, -task.clearance - task.margin, np.inf)
        add(-np.einsum("gpj,gk->gpkj", slope, B[0]).reshape(*distance.shape, k), 0.0,
            -distance, near, 1.0)  # fmt: skip
    gain = np.zeros(k + 2)
    gain[k], gain[k + 1] = task.cost.time, 20.0 * now.cost
    if task.cost.torque:
        use = np.where(np.isfinite(most), tau / unit, 0.0)
        gain[:k] += task.cost.torque * T * 2.0 * np.einsum("gi,gik->k", use, by) / G
        gain[k] += task.cost.torque * ((use * use).sum() + 2.0 * T * (use * by_T).sum()) / G
    return gain, np.concatenate(rows), np.concatenate(room)


def _torques(limits: PathLimits, q: Array, v: Array, a: Array, B: Array) -> tuple[Array, Array]:
    """Torques (G, n), and their derivatives (G, n, k n + 1) by the nodes and T d/dT."""
    G, n = q.shape
    k = B.shape[2]
    if limits.model is None:
        return np.zeros((G, n)), np.zeros((G, n, k * n + 1))
    E, blocks = np.eye(n), []
    # quadratic in v and linear in a: differences over steps of 1 are exact
    for part, h in enumerate((_STEP, 1.0, 1.0)):
        for j in range(n):
            for side in (h, -h):
                moved = [q, v, a]
                moved[part] = moved[part] + side * E[j]
                blocks.append(moved)
    stacked = (np.concatenate(x) for x in zip(*blocks, strict=True))
    pairs = rigid_torques(limits.model, *stacked).reshape(3, n, 2, G, n)
    by = (pairs[:, :, 0] - pairs[:, :, 1]) / np.array([2.0 * _STEP, 2.0, 2.0])[:, None, None, None]
    by = np.moveaxis(by, 1, -1).copy()  # (3, G, n, n): torque i by joint j
    if (drives := limits.model.drive_matrices) is not None:
        by[1] += drives.viscous
        by[2] += drives.rotor
    slopes = np.einsum("pgij,pgk->gikj", by, B).reshape(G, n, k * n)
    scaled = -np.einsum("gij,gj->gi", by[1], v) - 2.0 * np.einsum("gij,gj->gi", by[2], a)
    return limits.torques(q, v, a), np.concatenate((slopes, scaled[..., None]), axis=-1)
