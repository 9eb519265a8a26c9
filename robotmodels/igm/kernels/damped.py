"""Compiled: Levenberg-Marquardt on the pose error of a chain.

The error of a configuration has six components in given axes: the translation ``P_d - P`` and the
rotation vector ``phi = log(R_d R^T)``. A rotation of the tool by ``w dt`` turns ``R_d R^T`` into
``R_d R^T exp(-[w] dt)``, hence ``d phi = -Jr^-1(phi) w dt`` with the inverse right Jacobian of the
rotation group. It is regular below a whole turn, so the derivative is exact for every mask.

Steps are ``(J^T W^2 J + lambda D) dq = J^T W^2 e``. lambda is proportional to the squared error
(T. Sugihara, IEEE T-RO 27(5), 2011), to the error itself where that is large.
"""

from __future__ import annotations

from math import atan2, inf, sqrt, tan

import numpy as np
from numba import types
from numpy.typing import NDArray

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
from .._check import forward

ORDER = types.Array(types.int64, 2, "C")
START_DAMPING = 0.1  # of the first step, in units of the cost
EXACT = 1e-28  # cost below which only rounding is left


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
def pose_error(U: Floats, axes: Floats, T: Floats, E: Floats, phi: Floats, e: Floats) -> None:
    """Error e (6,) of the pose T towards U in the axes; ``phi`` is its rotation in base axes."""
    for i in range(3):
        for j in range(3):
            E[i, j] = U[i, 0] * T[j, 0] + U[i, 1] * T[j, 1] + U[i, 2] * T[j, 2]
    rotation_vector(E, phi)
    for c in range(3):
        e[c], e[3 + c] = 0.0, 0.0
        for i in range(3):
            e[c] += axes[i, c] * (U[i, 3] - T[i, 3])
            e[3 + c] += axes[i, c] * phi[i]


@compiled()
def error_jacobian(
    sigma: Ints, T: Floats, lines: Floats, axes: Floats, phi: Floats, J: Floats
) -> None:
    """Minus the derivative of the error, J (6, k); ``lines (k, 6)``: axes and origins of joints.

    ``Jr^-1(phi) w = w + phi x w / 2 + c phi x (phi x w)``, c = (1 - (t / 2) cot(t / 2)) / t^2.
    """
    tt = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2]
    if tt < 1e-4:
        c = 1.0 / 12.0 + tt / 720.0
    else:
        half = 0.5 * sqrt(tt)
        c = (1.0 - half / tan(half)) / tt
    for k in range(sigma.shape[0]):
        x, y, z = lines[k, 0], lines[k, 1], lines[k, 2]
        vx, vy, vz, wx, wy, wz = x, y, z, 0.0, 0.0, 0.0
        if sigma[k] == 0:
            px, py, pz = T[0, 3] - lines[k, 3], T[1, 3] - lines[k, 4], T[2, 3] - lines[k, 5]
            vx, vy, vz = y * pz - z * py, z * px - x * pz, x * py - y * px
            wx, wy, wz = phi[1] * z - phi[2] * y, phi[2] * x - phi[0] * z, phi[0] * y - phi[1] * x
            ux, uy, uz = (
                phi[1] * wz - phi[2] * wy,
                phi[2] * wx - phi[0] * wz,
                phi[0] * wy - phi[1] * wx,
            )
            wx, wy, wz = x + 0.5 * wx + c * ux, y + 0.5 * wy + c * uy, z + 0.5 * wz + c * uz
        for i in range(3):
            J[i, k] = axes[0, i] * vx + axes[1, i] * vy + axes[2, i] * vz
            J[3 + i, k] = axes[0, i] * wx + axes[1, i] * wy + axes[2, i] * wz


@compiled()
def cost_of(e: Floats, weight: Floats) -> float:
    """Squared weighted error."""
    total = 0.0
    for c in range(6):
        total += (weight[c] * e[c]) ** 2
    return total


@compiled()
def is_met(e: Floats, weight: Floats, tolerance: Floats) -> bool:
    """Whether translation and rotation, without components of weight 0, are within tolerance."""
    for part in range(2):
        total = 0.0
        for c in range(3 * part, 3 * part + 3):
            if weight[c] > 0.0:
                total += e[c] * e[c]
        if sqrt(total) > tolerance[part]:
            return False
    return True


@compiled()
def damped_step(
    J: Floats, e: Floats, weight: Floats, held: Ints, damping: Floats, H: Floats, x: Floats
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
                for c in range(6):
                    total += weight[c] * weight[c] * J[c, i] * J[c, j]
            for m in range(j):
                total -= H[i, m] * H[j, m]
            if i > j:
                H[i, j] = total / H[j, j]
            elif total > 0.0:
                H[i, i] = sqrt(total)
            else:
                return False
        x[i] = 0.0
        if held[i] == 0:
            for c in range(6):
                x[i] += weight[c] * weight[c] * J[c, i] * e[c]
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
    sigma: Ints,
    D: Floats,
    U: Floats,
    axes: Floats,
    weight: Floats,
    tolerance: Floats,
    bounds: Floats,
    unit: Floats,
    iterations: int,
    patience: float,
    q: Floats,
    e: Floats,
    J: Floats,
) -> None:
    """Levenberg-Marquardt from q (k,), in place; its error e (6,) and derivative J (6, k).

    Ends when a step no longer reduces the error, or when more than ``patience`` of the cost is
    left after five steps.
    """
    k = q.shape[0]
    T, lines, E, phi = np.empty((3, 4)), np.empty((k, 6)), np.empty((3, 3)), np.empty(3)
    H, step, trial, damping = np.empty((k, k)), np.empty(k), np.empty(k), np.empty(k)
    after, held = np.empty(6), np.zeros(k, np.int64)
    forward(sigma, D, q, T, lines)
    pose_error(U, axes, T, E, phi, e)
    error_jacobian(sigma, T, lines, axes, phi, J)
    cost, factor = cost_of(e, weight), START_DAMPING
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
            total = 0.0
            for c in range(6):
                total += weight[c] * weight[c] * J[c, i] * e[c]
            leaves = (q[i] <= bounds[0, i] and total <= 0.0) or (
                q[i] >= bounds[1, i] and total >= 0.0
            )
            held[i] = 1 if leaves else 0
        new = inf
        for _ in range(8):
            for i in range(k):
                damping[i] = (factor * min(cost, sqrt(cost)) + 1e-14) * unit[i] * unit[i]
            if damped_step(J, e, weight, held, damping, H, step):
                for i in range(k):
                    trial[i] = min(max(q[i] + step[i], bounds[0, i]), bounds[1, i])
                forward(sigma, D, trial, T, lines)
                pose_error(U, axes, T, E, phi, after)
                new = cost_of(after, weight)
                if new < cost:
                    break
            factor *= 8.0
        if not new < cost:
            break
        for i in range(k):
            q[i] = trial[i]
        for c in range(6):
            e[c] = after[c]
        error_jacobian(sigma, T, lines, axes, phi, J)
        factor = max(factor / 3.0, 1e-3)
        pays = new < 0.1 * cost
        cost = new
        if not pays and is_met(e, weight, tolerance):
            break


@compiled(
    NOTHING(
        INTS,
        STACK,
        STACK,
        STACK,
        VECTOR,
        VECTOR,
        MATRIX,
        VECTOR,
        MATRIX,
        MATRIX,
        ORDER,
        INT,
        types.float64,
        OUT2,
        OUT2,
        OUT3,
    )
)
def damped_searches(
    sigma: Ints,
    D: Floats,
    poses: Floats,
    axes: Floats,
    weight: Floats,
    tolerance: Floats,
    bounds: Floats,
    unit: Floats,
    first: Floats,
    starts: Floats,
    order: NDArray[np.int64],
    iterations: int,
    patience: float,
    q: Floats,
    error: Floats,
    J: Floats,
) -> None:
    """Best configuration of each pose, from its starts in order until one meets it.

    Shapes: poses (N, 4, 4), axes (N, 3, 3), first (N, k), starts (S, k), order (N, R) of rows of
    starts, -1 for ``first`` -> q (N, k), error (N, 6), J (N, 6, k).
    """
    k = sigma.shape[0]
    x, e, Jx = np.empty(k), np.empty(6), np.empty((6, k))
    for n in range(poses.shape[0]):
        least = inf
        for r in range(order.shape[1]):
            s = order[n, r]
            for i in range(k):
                value = first[n, i] if s < 0 else starts[s, i]
                x[i] = min(max(value, bounds[0, i]), bounds[1, i])
            descend(
                sigma,
                D,
                poses[n],
                axes[n],
                weight,
                tolerance,
                bounds,
                unit,
                iterations,
                patience,
                x,
                e,
                Jx,
            )
            cost, met = cost_of(e, weight), is_met(e, weight, tolerance)
            if met or cost < least or r == 0:
                least = cost
                for c in range(6):
                    error[n, c] = e[c]
                    for i in range(k):
                        J[n, c, i] = Jx[c, i]
                for i in range(k):
                    q[n, i] = x[i]
            if met:
                break
