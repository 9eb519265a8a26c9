"""Phases of constant jerk: states at their ends, and durations that meet a goal to rounding."""

import numpy as np

from ._compile import MATRIX, NOTHING, OUT2, OUT3, Floats, compiled
from .bounded_velocity import cleared

__all__ = ["polished_phases"]

_STEPS = 4
_CLOSE = 1e-14
_GONE = 1e-10  # of a row, when those before it are taken out: it depends on them


@compiled()
def _run(h: Floats, jerk: Floats, start: Floats, x: Floats) -> None:
    """Position, velocity and acceleration (K + 1, 3) at the ends of the phases."""
    p, v, a = start[0], start[1], start[2]
    x[0, 0], x[0, 1], x[0, 2] = p, v, a
    for k in range(h.shape[0]):
        t, j = h[k], jerk[k]
        p += t * (v + t * (0.5 * a + t * j / 6.0))
        v += t * (a + 0.5 * t * j)
        a += t * j
        x[k + 1, 0], x[k + 1, 1], x[k + 1, 2] = p, v, a


@compiled()
def _error(goal: Floats, x: Floats, scale: float) -> tuple[float, float, float, float]:
    K = x.shape[0] - 1
    e0, e1, e2 = (goal[0] - x[K, 0]) / scale, goal[1] - x[K, 1], goal[2] - x[K, 2]
    return e0, e1, e2, max(abs(e0), abs(e1), abs(e2))


@compiled()
def _least_step(rows: Floats, wanted: Floats, count: int, step: Floats) -> None:
    """The shortest step that meets the equations, those before others; overwrites the rows."""
    n = rows.shape[1]
    parts = np.empty(rows.shape[0])
    for j in range(n):
        step[j] = 0.0
    for i in range(count):
        before = 0.0
        for j in range(n):
            before += rows[i, j] * rows[i, j]
        size = cleared(rows[i], rows, i, n, parts)
        left = wanted[i]
        for r in range(i):
            left -= parts[r] * wanted[r]
        if size <= _GONE * _GONE * before or size == 0.0:
            wanted[i] = 0.0
            for j in range(n):
                rows[i, j] = 0.0
            continue
        size = np.sqrt(size)
        wanted[i] = left / size
        for j in range(n):
            rows[i, j] /= size
            step[j] += wanted[i] * rows[i, j]


@compiled(NOTHING(MATRIX, MATRIX, MATRIX, MATRIX, OUT2, OUT3))
def polished_phases(
    h: Floats, jerk: Floats, start: Floats, goal: Floats, out: Floats, coefficients: Floats
) -> None:
    """Durations that meet the goals, by Newton steps that change them least, each in its own size.

    Shapes: h, jerk (M, K); start, goal (M, 3) -> out (M, K), coefficients (M, K, 4).
    """
    M, K = h.shape
    x, trial_x = np.empty((K + 1, 3)), np.empty((K + 1, 3))
    trial, step, held = np.empty(K), np.empty(K), np.empty(K)
    rows, wanted = np.empty((4 + K, K)), np.empty(4 + K)
    for m in range(M):
        best = out[m]
        total = 0.0
        for k in range(K):
            best[k] = h[m, k]
            total += h[m, k]
        scale = 1.0 + abs(goal[m, 0])
        _run(best, jerk[m], start[m], x)
        for k in range(K):
            held[k] = x[k, 2]
        e0, e1, e2, worst = _error(goal[m], x, scale)
        for _ in range(_STEPS):
            if worst <= _CLOSE:
                break
            now = 0.0
            for k in range(K):
                now += best[k]
            left = now
            for k in range(K):
                left -= best[k]
                j = jerk[m, k]
                v, a = x[k + 1, 1], x[k + 1, 2]
                rows[0, k] = (v + left * (a + 0.5 * left * j)) / scale
                rows[1, k] = a + left * j
                rows[2, k] = j
                rows[3, k] = 1.0
            wanted[0], wanted[1], wanted[2], wanted[3] = e0, e1, e2, total - now
            count = 4
            for i in range(K):
                if h[m, i] > 0.0 and jerk[m, i] == 0.0:
                    for k in range(K):
                        rows[count, k] = jerk[m, k] if k < i else 0.0
                    wanted[count] = held[i] - x[i, 2]
                    count += 1
            for i in range(count):
                for k in range(K):
                    rows[i, k] *= h[m, k]
            _least_step(rows, wanted, count, step)
            for k in range(K):
                trial[k] = max(best[k] + h[m, k] * step[k], 0.0)
            _run(trial, jerk[m], start[m], trial_x)
            t0, t1, t2, now_worst = _error(goal[m], trial_x, scale)
            if now_worst >= worst:
                break
            e0, e1, e2, worst = t0, t1, t2, now_worst
            for k in range(K):
                best[k] = trial[k]
            for k in range(K + 1):
                for i in range(3):
                    x[k, i] = trial_x[k, i]
        for k in range(K):
            t = best[k]
            coefficients[m, k, 0] = x[k, 0]
            coefficients[m, k, 1] = x[k, 1] * t
            coefficients[m, k, 2] = 0.5 * x[k, 2] * t * t
            coefficients[m, k, 3] = jerk[m, k] * t * t * t / 6.0
