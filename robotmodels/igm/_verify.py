"""Candidates of a closed form: checked on the chain itself, refined, wrapped and merged."""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from ..kernels._compile import INTS, OUT3, STACK, Floats, Ints, compiled
from ..kernels.svd import orthogonal_rows
from .kernels.chain import forward, jacobian, wrapped

EXACT = 5e-13  # error above which a candidate is improved [m, rad]
STEPS = 3
MERGE = 1e-6  # postures closer than this in every joint are one [rad, m]
DEPENDENT = 1e-10  # singular values of the Jacobian beside the largest that count as zero

_COUNTS = types.Array(types.int64, 1, "C")
_MARKS = types.Array(types.int64, 2, "C")
_FLAGS = types.Array(types.boolean, 2, "C")
_JOINT_FLAGS = types.Array(types.boolean, 3, "C")


@compiled()
def chain_error(U: Floats, sigma: Ints, D: Floats, q: Floats, P: Floats, axes: Floats) -> float:
    """Largest element of ``U - P`` with ``P = D_0 M_1 D_1 ... D_6``; z and origin of each axis."""
    forward(sigma, D, q, P, axes)
    worst = 0.0
    for i in range(3):
        for j in range(4):
            worst = max(worst, abs(U[i, j] - P[i, j]))
    return worst


@compiled()
def newton_step(U: Floats, sigma: Ints, P: Floats, axes: Floats, step: Floats) -> None:
    """Shortest step in the joints that closes the error to first order."""
    J, e, rows, s = np.zeros((6, 6)), np.zeros(6), np.zeros((6, 12)), np.zeros(6)
    jacobian(sigma, P, axes, J)
    for i in range(3):
        e[i] = U[i, 3] - P[i, 3]
    for j in range(3):
        # half the sum of x cross x_d over the axes: the rotation missing, to first order
        e[3] += 0.5 * (P[1, j] * U[2, j] - P[2, j] * U[1, j])
        e[4] += 0.5 * (P[2, j] * U[0, j] - P[0, j] * U[2, j])
        e[5] += 0.5 * (P[0, j] * U[1, j] - P[1, j] * U[0, j])
    for m in range(6):
        step[m], rows[m, 6 + m] = 0.0, 1.0
        for i in range(6):
            rows[m, i] = J[i, m]
    orthogonal_rows(rows, 6, 6, 12, s)
    for i in range(6):
        if not s[i] > DEPENDENT * s[0]:
            break
        part = 0.0
        for j in range(6):
            part += rows[i, j] * e[j]
        for m in range(6):
            step[m] += part / (s[i] * s[i]) * rows[i, 6 + m]


@compiled(
    types.void(
        STACK,
        INTS,
        STACK,
        INTS,
        types.float64,
        types.float64,
        STACK,
        _MARKS,
        _COUNTS,
        OUT3,
        _FLAGS,
        _JOINT_FLAGS,
    )
)
def verified_postures(
    poses: Floats,
    sigma: Ints,
    D: Floats,
    order: Ints,
    sense: float,
    accepted: float,
    found: Floats,
    marks: Ints,
    counts: Ints,
    q: Floats,
    valid: NDArray[np.bool_],
    free: NDArray[np.bool_],
) -> None:
    """Candidates ``found (N, 8, 6)`` of the loop to postures ``q (N, 8, 6)`` of the chain."""
    x, trial = np.zeros(6), np.zeros(6)
    P, axes = np.zeros((3, 4)), np.zeros((6, 6))
    for n in range(poses.shape[0]):
        count = 0
        for i in range(counts[n]):
            for m in range(6):
                x[order[m]] = sense * found[n, i, m]
            error = chain_error(poses[n], sigma, D, x, P, axes)
            for _ in range(STEPS):
                # a candidate that is far off is a false one, not a rough one
                if not EXACT < error < 1e-2:
                    break
                newton_step(poses[n], sigma, P, axes, trial)
                for m in range(6):
                    trial[m] += x[m]
                improved = chain_error(poses[n], sigma, D, trial, P, axes)
                if not improved < error:
                    break
                error = improved
                for m in range(6):
                    x[m] = trial[m]
            if not error <= accepted:
                continue
            for m in range(6):
                if sigma[m] == 0:
                    x[m] = wrapped(x[m])
            known = False
            for k in range(count):
                gap = 0.0
                for m in range(6):
                    way = x[m] - q[n, k, m]
                    gap = max(gap, abs(wrapped(way) if sigma[m] == 0 else way))
                known = known or gap < MERGE
            if known:
                continue
            for m in range(6):
                q[n, count, m] = x[m]
                free[n, count, order[m]] = (marks[n, i] >> m) & 1 == 1
            valid[n, count] = True
            count += 1
