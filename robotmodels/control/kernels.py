"""Compiled: the error of a pose with its derivatives, and joint accelerations that meet tasks.

The error e has the translation p_d - p and the rotation vector phi = log(R_d R^T), in world axes.
With E(phi) the left Jacobian of the rotation group, R_e = R_d R^T and w_e = w_d - R_e w:

    dphi = E^-1 w_e,    ddphi = E^-1 (dw_d - w_e x R_e w - R_e dw - dE dphi),

so that laws that are linear in e are exact for every rotation below a whole turn. A wrench f, m has
the power -(f . de + (E m) . dphi) on the tool if the desired pose is at rest.
"""

from __future__ import annotations

from math import cos, sin, sqrt, tan

import numpy as np

from ..igm.kernels.damped import rotation_vector
from ..kernels import Chain
from ..kernels import _compile as kinds
from ..kernels._compile import Floats, Ints, compiled
from ..kernels._vectors import Vector, add, cross, dot, scale, subtract
from ..kernels.poses import accelerations, jacobians, tip_poses
from ..kernels.svd import orthogonal_rows

# q, v, chain, path, rotation and position of the tool; pose, twist, acceleration and wrench
_STATE = kinds.MATRIX, kinds.MATRIX, kinds.CHAIN, kinds.INTS, kinds.MATRIX, kinds.VECTOR
_GOAL = kinds.MATRIX, kinds.VECTOR, kinds.VECTOR, kinds.VECTOR

SMALL = 1e-2  # squared angle below which series are used
NEAR = 1e-3  # singular values, relative to the longest row, below which motions are damped
RANK = 1e-9  # relative singular values of rows that depend


@compiled()
def coefficients(tt: float) -> tuple[float, float, float, float, float]:
    """Of E = I + a [phi] + b [phi]^2 and E^-1 = I - [phi] / 2 + c [phi]^2, tt = phi . phi.

    Also the derivatives of a and b by tt / 2.
    """
    if tt < SMALL:
        return (
            0.5 - tt / 24.0 + tt * tt / 720.0 - tt**3 / 40320.0,
            1.0 / 6.0 - tt / 120.0 + tt * tt / 5040.0 - tt**3 / 362880.0,
            1.0 / 12.0 + tt / 720.0 + tt * tt / 30240.0 + tt**3 / 1209600.0,
            -1.0 / 12.0 + tt / 180.0 - tt * tt / 6720.0 + tt**3 / 453600.0,
            -1.0 / 60.0 + tt / 1260.0 - tt * tt / 60480.0 + tt**3 / 4989600.0,
        )
    angle = sqrt(tt)
    s, k = sin(angle), 1.0 - cos(angle)
    return (
        k / tt,
        (angle - s) / (angle * tt),
        (1.0 - 0.5 * angle / tan(0.5 * angle)) / tt,
        (angle * s - 2.0 * k) / (tt * tt),
        (3.0 * s - angle * (1.0 - k) - 2.0 * angle) / (angle * tt * tt),
    )


@compiled()
def combined(phi: Vector, x: Vector, first: float, second: float) -> Vector:
    """``x + first phi x x + second phi x (phi x x)``: E, E^-1 and R_e applied to a vector."""
    y = cross(phi, x)
    return add(x, add(scale(first, y), scale(second, cross(phi, y))))


@compiled(kinds.NOTHING(*_STATE, *_GOAL, kinds.OUT3, kinds.OUT2))
def tool_errors(
    q: Floats,
    v: Floats,
    chain: Chain,
    path: Ints,
    tool_rotation: Floats,
    tool_position: Floats,
    desired: Floats,
    twist: Floats,
    acceleration: Floats,
    wrench: Floats,
    J: Floats,
    out: Floats,
) -> None:
    """Jacobians of the tool and of its error, ``J (2, 6, n)``, and six rows of ``out (.., 6)``.

    Error, rate, drift, wrench in its coordinates, twist, ``dJ/dt v``; the second derivative of
    the error is ``drift + J[1] a``. Shapes: q, v (1, n), desired (4, 4), the others (6,).
    """
    n = q.shape[1]
    pose, bias, E, turned = np.empty((1, 4, 4)), np.empty((1, 6)), np.empty((3, 3)), np.empty(3)
    tip_poses(q, chain, path, tool_rotation, tool_position, pose)
    jacobians(q, chain, path, tool_rotation, tool_position, 0, J[:1])
    accelerations(q, v, np.zeros((1, n)), chain, path, tool_rotation, tool_position, 0, bias)
    for i in range(6):
        out[4, i], out[5, i] = 0.0, bias[0, i]
        for column in range(n):
            out[4, i] += J[0, i, column] * v[0, column]
    for i in range(3):
        for j in range(3):
            E[i, j] = 0.0
            for k in range(3):
                E[i, j] += desired[i, k] * pose[0, j, k]
    rotation_vector(E, turned)
    phi = (turned[0], turned[1], turned[2])
    a, b, c, da, db = coefficients(dot(phi, phi))
    # R_e = I + (sin t / t) [phi] + ((1 - cos t) / t^2) [phi]^2, and sin t / t = 1 - b t^2
    first = 1.0 - b * dot(phi, phi)
    w_r = combined(phi, (out[4, 3], out[4, 4], out[4, 5]), first, a)
    w_e = subtract((twist[3], twist[4], twist[5]), w_r)
    rate = combined(phi, w_e, -0.5, c)
    y, along = cross(phi, rate), dot(phi, rate)
    change = add(
        add(scale(da * along, y), scale(b, cross(rate, y))), scale(db * along, cross(phi, y))
    )
    wanted = subtract((acceleration[3], acceleration[4], acceleration[5]), cross(w_e, w_r))
    turning = combined(phi, (bias[0, 3], bias[0, 4], bias[0, 5]), first, a)
    drift = combined(phi, subtract(subtract(wanted, change), turning), -0.5, c)
    moment = combined(phi, (wrench[3], wrench[4], wrench[5]), a, b)
    for i in range(3):
        out[0, i], out[0, 3 + i] = desired[i, 3] - pose[0, i, 3], phi[i]
        out[1, i], out[1, 3 + i] = twist[i] - out[4, i], rate[i]
        out[2, i], out[2, 3 + i] = acceleration[i] - bias[0, i], drift[i]
        out[3, i], out[3, 3 + i] = wrench[i], moment[i]
    for column in range(n):
        # E^-1 R_e is the inverse right Jacobian
        z = combined(phi, (J[0, 3, column], J[0, 4, column], J[0, 5, column]), 0.5, c)
        for i in range(3):
            J[1, i, column], J[1, 3 + i, column] = -J[0, i, column], -z[i]


@compiled()
def solve(
    J: Floats, wanted: Floats, order: Ints, L: Floats, free: Floats, least: float, a: Floats
) -> None:
    """Accelerations a in the metric of ``L L^T``, see `resolved`."""
    m, n = J.shape
    B, used, lengths, count = np.empty((m, n + 1)), np.zeros((m, n)), np.empty(m), 0
    for i in range(n):  # y = L^T a
        a[i] = 0.0
        for k in range(i, n):
            a[i] += L[k, i] * free[k]
    for level in range(2):
        p, longest = 0, 0.0
        for r in range(m):
            if order[r] != level:
                continue
            size, B[p, n] = 0.0, wanted[r]
            for i in range(n):  # the row in coordinates y, and what it misses
                B[p, i] = J[r, i]
                for k in range(i):
                    B[p, i] -= L[i, k] * B[p, k]
                B[p, i] /= L[i, i]
                B[p, n] -= B[p, i] * a[i]
                size += B[p, i] * B[p, i]
            longest = max(longest, sqrt(size))
            for s in range(count):
                along = 0.0
                for i in range(n):
                    along += B[p, i] * used[s, i]
                for i in range(n):
                    B[p, i] -= along * used[s, i]
            p += 1
        orthogonal_rows(B, p, n, n + 1, lengths)
        for r in range(p):
            if lengths[r] > 0.0:
                size = max(lengths[r], least * longest)
                for i in range(n):
                    used[count, i] = B[r, i] / size
                    a[i] += used[count, i] * B[r, n] / size
                count += 1
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            a[i] -= L[k, i] * a[k]
        a[i] /= L[i, i]


@compiled(kinds.INT(kinds.MATRIX, kinds.VECTOR, kinds.INTS, kinds.MATRIX, kinds.VECTOR, kinds.OUT1))
def resolved(J: Floats, wanted: Floats, order: Ints, M: Floats, free: Floats, a: Floats) -> int:
    """Joint accelerations a with ``J a = wanted``; motions of no effect are `free`.

    Directions of small singular values are damped. With M (n, n), not (0, 0), those least in its
    metric, where rows of order 1 do not disturb those of order 0. -1 if M is not definite.
    """
    m, n = J.shape
    L, met = np.eye(n), np.zeros(m)
    solve(J, wanted, np.zeros(m, np.int64), L, free, NEAR, a)
    if M.shape[0] == 0:
        return 0
    for r in range(m):
        for i in range(n):
            met[r] += J[r, i] * a[i]
    for j in range(n):
        for i in range(j, n):
            rest = M[i, j]
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            if i == j and not rest > 0.0:
                return -1
            L[i, j] = sqrt(rest) if i == j else rest / L[j, j]
    solve(J, met, order, L, free, RANK, a)
    return 0
