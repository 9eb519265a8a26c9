"""Compiled: Levenberg-Marquardt on constraints of a chain: components of a pose, linear relations.

The error of a configuration has six components in given axes: the translation ``P_d - P`` and the
rotation vector ``phi = log(R_d R^T)``. A rotation of the tool by ``w dt`` turns ``R_d R^T`` into
``R_d R^T exp(-[w] dt)``, hence ``d phi = -Jr^-1(phi) w dt`` with the inverse right Jacobian of the
rotation group. It is regular below a whole turn, so the derivative is exact for every mask. The
errors ``b - A q`` of relations stand behind them.

Steps are ``(J^T W^2 J + lambda D) dq = J^T W^2 e``, lambda proportional to the size of the error:
convergence stays fast, and flat directions of J are left alone (J. Fan and Y. Yuan, Computing 74,
2005).
"""

from __future__ import annotations

from math import atan2, floor, inf, sqrt, tan
from typing import NamedTuple

import numpy as np
from numba import types

from ...kernels._compile import (
    INT,
    INTS,
    MATRIX,
    NOTHING,
    OUT2,
    OUT3,
    STACK,
    VECTOR,
    Floats,
    Ints,
    compiled,
)
from .chain import forward

START_DAMPING = 0.1  # of the first step, in units of the cost
EXACT = 1e-30  # cost below which only rounding is left


class Problem(NamedTuple):
    """Constraints on the joints of a chain, and how they are searched."""

    sigma: Ints  # (k,)
    D: Floats  # (k + 1, 4, 4)
    weight: Floats  # (6 + m,): of the components of the pose, 0 where free, and of the relations
    A: Floats  # (m, k): relations A q = b
    b: Floats  # (m,)
    period: Floats  # (m,): 0 for relations without one
    tolerance: Floats  # (2,): position and orientation
    bounds: Floats  # (2, k)
    unit: Floats  # (k,)
    held: Ints  # (k,): 1 for joints that keep their value


PROBLEM = types.NamedTuple(
    (INTS, STACK, VECTOR, MATRIX, VECTOR, VECTOR, VECTOR, MATRIX, VECTOR, INTS), Problem
)


@compiled()
def rotation_vector(E: Floats, phi: Floats) -> None:
    """Logarithm of a rotation, its angle in [0, pi], through its quaternion b.

    The largest component of b comes from the diagonal and the others from it, so that no digit is
    lost at 0 or at pi (S. W. Shepperd, J. Guidance and Control 1(3), 1978).
    """
    trace = E[0, 0] + E[1, 1] + E[2, 2]
    i = 0
    for m in range(1, 3):
        if E[m, m] > E[i, i]:
            i = m
    j, k = (i + 1) % 3, (i + 2) % 3
    if trace >= E[i, i]:
        w = 1.0 + trace
        phi[i], phi[j], phi[k] = E[k, j] - E[j, k], E[i, k] - E[k, i], E[j, i] - E[i, j]
    else:
        w = E[k, j] - E[j, k]
        phi[i], phi[j], phi[k] = 1.0 + 2.0 * E[i, i] - trace, E[i, j] + E[j, i], E[i, k] + E[k, i]
    s = sqrt(phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
    # of the quaternions b and -b the one with w >= 0
    scale = 0.0
    if s > 0.0:
        scale = 2.0 * atan2(s, w) / s if w >= 0.0 else -2.0 * atan2(s, -w) / s
    for m in range(3):
        phi[m] *= scale


@compiled()
def errors(
    p: Problem, U: Floats, axes: Floats, q: Floats, T: Floats, lines: Floats, W: Floats, e: Floats
) -> None:
    """Errors e (6 + m,) of a configuration; its pose T, the axes of its joints, phi in W (4, 3)."""
    forward(p.sigma, p.D, q, T, lines)
    for i in range(3):
        for j in range(3):
            W[i, j] = U[i, 0] * T[j, 0] + U[i, 1] * T[j, 1] + U[i, 2] * T[j, 2]
    rotation_vector(W, W[3])
    for c in range(3):
        e[c], e[3 + c] = 0.0, 0.0
        for i in range(3):
            e[c] += axes[i, c] * (U[i, 3] - T[i, 3])
            e[3 + c] += axes[i, c] * W[3, i]
    for r in range(p.b.size):
        off = p.b[r]
        for i in range(q.size):
            off -= p.A[r, i] * q[i]
        e[6 + r] = off
        if p.period[r] > 0.0:
            e[6 + r] -= p.period[r] * floor(off / p.period[r] + 0.5)


@compiled()
def error_jacobian(
    p: Problem, T: Floats, lines: Floats, axes: Floats, phi: Floats, J: Floats
) -> None:
    """Minus the derivative of the errors, J (6 + m, k).

    ``Jr^-1(phi) w = w + phi x w / 2 + c phi x (phi x w)``, c = (1 - (t / 2) cot(t / 2)) / t^2.
    """
    tt = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2]
    if tt < 1e-4:
        c = 1.0 / 12.0 + tt / 720.0
    else:
        half = 0.5 * sqrt(tt)
        c = (1.0 - half / tan(half)) / tt
    for k in range(p.sigma.shape[0]):
        x, y, z = lines[k, 0], lines[k, 1], lines[k, 2]
        vx, vy, vz, wx, wy, wz = x, y, z, 0.0, 0.0, 0.0
        if p.sigma[k] == 0:
            px, py, pz = T[0, 3] - lines[k, 3], T[1, 3] - lines[k, 4], T[2, 3] - lines[k, 5]
            vx, vy, vz = y * pz - z * py, z * px - x * pz, x * py - y * px
            wx, wy, wz = phi[1] * z - phi[2] * y, phi[2] * x - phi[0] * z, phi[0] * y - phi[1] * x
            ux, uy = phi[1] * wz - phi[2] * wy, phi[2] * wx - phi[0] * wz
            uz = phi[0] * wy - phi[1] * wx
            wx, wy, wz = x + 0.5 * wx + c * ux, y + 0.5 * wy + c * uy, z + 0.5 * wz + c * uz
        for i in range(3):
            J[i, k] = axes[0, i] * vx + axes[1, i] * vy + axes[2, i] * vz
            J[3 + i, k] = axes[0, i] * wx + axes[1, i] * wy + axes[2, i] * wz
        for r in range(p.b.size):
            J[6 + r, k] = p.A[r, k]


@compiled()
def cost_of(p: Problem, e: Floats) -> float:
    """Squared weighted error."""
    total = 0.0
    for c in range(e.size):
        total += (p.weight[c] * e[c]) ** 2
    return total


@compiled()
def is_met(p: Problem, e: Floats) -> bool:
    """Whether translation and rotation, without components of weight 0, are within tolerance."""
    for part in range(2):
        total = 0.0
        for c in range(3 * part, 3 * part + 3):
            if p.weight[c] > 0.0:
                total += e[c] * e[c]
        if sqrt(total) > p.tolerance[part]:
            return False
    return True


@compiled()
def slope_of(p: Problem, J: Floats, e: Floats, i: int) -> float:
    """Half of the rate at which the cost falls with joint i."""
    total = 0.0
    for c in range(e.size):
        total += p.weight[c] * p.weight[c] * J[c, i] * e[c]
    return total


@compiled()
def damped_step(
    p: Problem, J: Floats, e: Floats, held: Ints, damping: Floats, H: Floats, x: Floats
) -> bool:
    """Solve ``(J^T W^2 J + diag(damping)) x = J^T W^2 e`` by Cholesky's method; False if singular.

    Joints that are ``held`` do not move.
    """
    k = x.shape[0]
    for i in range(k):
        for j in range(i + 1):
            total = damping[i] if i == j else 0.0
            if held[i] + held[j] > 0:
                total = 1.0 if i == j else 0.0
            else:
                for c in range(e.size):
                    total += p.weight[c] * p.weight[c] * J[c, i] * J[c, j]
            for m in range(j):
                total -= H[i, m] * H[j, m]
            if i > j:
                H[i, j] = total / H[j, j]
            elif total > 0.0:
                H[i, i] = sqrt(total)
            else:
                return False
        x[i] = slope_of(p, J, e, i) if held[i] == 0 else 0.0
        for m in range(i):
            x[i] -= H[i, m] * x[m]
        x[i] /= H[i, i]
    for i in range(k - 1, -1, -1):
        for m in range(i + 1, k):
            x[i] -= H[m, i] * x[m]
        x[i] /= H[i, i]
    return True


@compiled()
def descend(
    p: Problem, U: Floats, axes: Floats, iterations: int, patience: float, q: Floats, e: Floats,
    J: Floats,
) -> None:  # fmt: skip
    """Levenberg-Marquardt from q (k,), in place; its errors e and their derivative J.

    Ends when a step no longer reduces the error, or when more than ``patience`` of the cost is
    left after five steps.
    """
    k = q.shape[0]
    T, lines, W, after = np.empty((3, 4)), np.empty((k, 6)), np.empty((4, 3)), np.empty(e.size)
    H, step, trial, damping = np.empty((k, k)), np.empty(k), np.empty(k), np.empty(k)
    held = np.empty(k, np.int64)
    errors(p, U, axes, q, T, lines, W, e)
    error_jacobian(p, T, lines, axes, W[3], J)
    cost, factor = cost_of(p, e), START_DAMPING
    due, before = 0, inf
    for count in range(iterations):
        if cost < EXACT:
            break
        if count == due:
            if cost > patience * before:
                break
            due, before = count + 5, cost
        # a joint at a bound that would leave it stays
        for i in range(k):
            slope = slope_of(p, J, e, i)
            leaves = (q[i] <= p.bounds[0, i] and slope <= 0.0) or (
                q[i] >= p.bounds[1, i] and slope >= 0.0
            )
            held[i] = 1 if leaves or p.held[i] == 1 else 0
        new = inf
        for _ in range(8):
            for i in range(k):
                damping[i] = (factor * sqrt(cost) + 1e-14) * p.unit[i] * p.unit[i]
            if damped_step(p, J, e, held, damping, H, step):
                for i in range(k):
                    trial[i] = min(max(q[i] + step[i], p.bounds[0, i]), p.bounds[1, i])
                errors(p, U, axes, trial, T, lines, W, after)
                new = cost_of(p, after)
                if new < cost:
                    break
            factor *= 8.0
        if not new < cost:
            break
        for i in range(k):
            q[i] = trial[i]
        for c in range(e.size):
            e[c] = after[c]
        error_jacobian(p, T, lines, axes, W[3], J)
        factor = max(factor / 3.0, 1e-3)
        pays = new < 0.25 * cost
        cost = new
        if not pays and is_met(p, e):
            break


@compiled(NOTHING(PROBLEM, STACK, STACK, STACK, INT, types.float64, OUT2, OUT2, OUT3))
def damped_searches(
    p: Problem,
    poses: Floats,
    axes: Floats,
    starts: Floats,
    iterations: int,
    patience: float,
    q: Floats,
    error: Floats,
    J: Floats,
) -> None:
    """Best configuration of each pose, from its starts in order until one meets it.

    Shapes: poses (N, 4, 4), axes (N, 3, 3), starts (N, R, k) -> q (N, k), error (N, 6 + m),
    J (N, 6 + m, k).
    """
    k, rows = starts.shape[2], error.shape[1]
    x, e, Jx = np.empty(k), np.empty(rows), np.empty((rows, k))
    for n in range(poses.shape[0]):
        least = inf
        for r in range(starts.shape[1]):
            for i in range(k):
                x[i] = min(max(starts[n, r, i], p.bounds[0, i]), p.bounds[1, i])
            descend(p, poses[n], axes[n], iterations, patience, x, e, Jx)
            cost, met = cost_of(p, e), is_met(p, e)
            if met or cost < least or r == 0:
                least = cost
                for c in range(rows):
                    error[n, c] = e[c]
                    for i in range(k):
                        J[n, c, i] = Jx[c, i]
                for i in range(k):
                    q[n, i] = x[i]
            if met:
                break
