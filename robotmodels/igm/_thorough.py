"""Candidates beside singular positions brought home: Newton's step, and others where it fails.

At a fold or beside an infinite family the Jacobian has singular values next to zero. Newton's step
along their directions may be far too long or all that is needed; steps that leave out the
directions below one threshold after the other are all tried, and the best one is taken.
"""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from ..kernels._compile import INTS, STACK, VECTOR, Floats, Ints, compiled
from ._check import MERGE, forward, jacobian, missing, wrapped

HOME = 2e-15  # error at which nothing is left to improve [m, rad]
BETWEEN = 1e-14  # error between two postures up to which they cannot be told apart [m, rad]
NEWTON, STEPS = 6, 30
CUTS = (1e-14, 1e-11, 1e-8, 1e-6, 1e-4, 1e-2)  # beside the largest singular value

_FLAGS = types.Array(types.boolean, 2, "C")
_FLAGS_IN = types.Array(types.boolean, 2, "C", readonly=True)
_OUT3, _OUT2 = types.Array(types.float64, 3, "C"), types.Array(types.float64, 2, "C")


@compiled()
def eliminated(J: Floats, e: Floats, step: Floats) -> bool:
    """``J step = e`` by elimination with column pivots; False if J is singular to rounding."""
    k = e.size
    for c in range(k):
        best = c
        for r in range(c + 1, k):
            if abs(J[r, c]) > abs(J[best, c]):
                best = r
        if abs(J[best, c]) < 1e-12:
            return False
        if best != c:
            for m in range(c, k):
                J[c, m], J[best, m] = J[best, m], J[c, m]
            e[c], e[best] = e[best], e[c]
        for r in range(c + 1, k):
            share = J[r, c] / J[c, c]
            for m in range(c, k):
                J[r, m] -= share * J[c, m]
            e[r] -= share * e[c]
    for c in range(k - 1, -1, -1):
        total = e[c]
        for m in range(c + 1, k):
            total -= J[c, m] * step[m]
        step[c] = total / J[c, c]
    return True


@compiled()
def brought_home(U: Floats, sigma: Ints, D: Floats, q: Floats) -> float:
    """Improve ``q`` in place as far as it goes; its error [m, rad]."""
    k = sigma.size
    P, axes, J, e = np.zeros((3, 4)), np.zeros((k, 6)), np.zeros((6, k)), np.zeros(6)
    trial, best, step = np.zeros(k), np.zeros(k), np.zeros(k)
    J_work, e_work = np.zeros((6, k)), np.zeros(6)
    forward(sigma, D, q, P, axes)
    way, angle = missing(U, P, e)
    error = max(way, angle)
    newton = 0
    for _ in range(STEPS):
        if error <= HOME:
            break
        jacobian(sigma, P, axes, J)
        least = error
        if newton < NEWTON and k == 6:
            newton += 1
            J_work[:] = J
            e_work[:] = e
            if eliminated(J_work, e_work, step):
                for m in range(k):
                    trial[m] = q[m] + step[m]
                forward(sigma, D, trial, P, axes)
                way, angle = missing(U, P, e_work)
                if max(way, angle) < 0.5 * error:
                    least = max(way, angle)
                    best[:] = trial
        if not least < error:
            left, values, right = np.linalg.svd(J, False)
            for cut in CUTS:
                step[:] = 0.0
                for i in range(values.size):
                    if values[i] > cut * values[0]:
                        part = 0.0
                        for r in range(6):
                            part += left[r, i] * e[r]
                        part /= values[i]
                        for m in range(k):
                            step[m] += part * right[i, m]
                longest = np.max(np.abs(step))
                if longest > 1.0:
                    continue
                for m in range(k):
                    trial[m] = q[m] + step[m]
                forward(sigma, D, trial, P, axes)
                way, angle = missing(U, P, e_work)
                if max(way, angle) < least:
                    least = max(way, angle)
                    best[:] = trial
        if not least < 0.9 * error:
            if least < error:
                q[:] = best
                error = least
            break
        q[:] = best
        error = least
        forward(sigma, D, q, P, axes)
        missing(U, P, e)
    return error


@compiled()
def alike(
    U: Floats,
    sigma: Ints,
    D: Floats,
    a: Floats,
    b: Floats,
    good: float,
    P: Floats,
    axes: Floats,
    e: Floats,
) -> bool:
    """Whether two postures are one, or what lies between them is as ``good`` as they are."""
    k = sigma.size
    turn, between = np.zeros(k), np.zeros(k)
    gap = 0.0
    for m in range(k):
        turn[m] = wrapped(b[m] - a[m]) if sigma[m] == 0 else b[m] - a[m]
        gap = max(gap, abs(turn[m]))
    if gap < MERGE:
        return True
    for part in (0.5, 0.3):
        for m in range(k):
            between[m] = a[m] + part * turn[m]
        forward(sigma, D, between, P, axes)
        way, angle = missing(U, P, e)
        if max(way, angle) > good:
            return False
    return True


@compiled(
    types.void(STACK, INTS, STACK, STACK, _FLAGS_IN, VECTOR, _OUT3, _FLAGS, _OUT2)
)  # fmt: skip
def home_postures(
    poses: Floats,
    sigma: Ints,
    D: Floats,
    candidates: Floats,
    there: NDArray[np.bool_],
    accepted: Floats,
    q: Floats,
    valid: NDArray[np.bool_],
    residual: Floats,
) -> None:
    """Candidates ``(N, C, k)`` to distinct postures ``q (N, S, k)``, packed.

    ``accepted``: error up to which a posture counts, and error up to which it counts if there is
    none that meets the first.
    """
    k, S = sigma.size, q.shape[1]
    x = np.zeros(k)
    P, axes, e = np.zeros((3, 4)), np.zeros((k, 6)), np.zeros(6)
    for n in range(poses.shape[0]):
        count = 0
        for i in range(candidates.shape[1]):
            if not there[n, i]:
                continue
            for m in range(k):
                x[m] = candidates[n, i, m]
            error = brought_home(poses[n], sigma, D, x)
            if not error <= accepted[1]:
                continue
            for m in range(k):
                if sigma[m] == 0:
                    x[m] = wrapped(x[m])
            known = -1
            for j in range(count):
                good = max(BETWEEN, 3.0 * max(error, residual[n, j]))
                if alike(poses[n], sigma, D, q[n, j], x, min(good, 2e-12), P, axes, e):
                    known = j
                    break
            if known >= 0:
                if error < residual[n, known]:
                    residual[n, known] = error
                    q[n, known] = x
                continue
            if count == S:
                continue
            q[n, count], residual[n, count], valid[n, count] = x, error, True
            count += 1
        # postures that only come near do not stand beside those that are met
        least = np.inf
        for j in range(count):
            least = min(least, residual[n, j])
        if least <= accepted[0]:
            kept = 0
            for j in range(count):
                if residual[n, j] <= accepted[0]:
                    if kept != j:
                        q[n, kept], residual[n, kept] = q[n, j], residual[n, j]
                    kept += 1
            for j in range(kept, count):
                q[n, j], residual[n, j], valid[n, j] = np.nan, np.nan, False
