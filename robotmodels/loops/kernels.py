"""Constraint rows of closures, and closing of the loops by damped Newton iterations.

The rows of a closure are the position of its second frame in the first, and the rotation from the
first to the second (of the z axes alone where there are five rows). With z and o the axis and
origin of a joint that carries one of the two frames, p the origin of the second frame and R the
axes of the first, its column of the Jacobian is ``+-R^T [z x (p - o); z]``.

The chain has the moving joints alone, with identity as its base. Inside the iterations, rows and
columns are made dimensionless by the size of the robot.
"""

from __future__ import annotations

from math import atan2, pi, sqrt

import numpy as np
from numba import types

from ..kernels import Chain
from ..kernels._compile import (
    CHAIN,
    INT,
    INTS,
    MATRIX,
    NOTHING,
    OUT1,
    OUT2,
    OUT3,
    STACK,
    VECTOR,
    Floats,
    Ints,
    compiled,
)
from ..kernels._motion import carry_pose, link_pose
from ..kernels._vectors import (
    Matrix,
    Vector,
    add,
    cross,
    matrix,
    product,
    scale,
    subtract,
    times,
    transpose_times,
    vector,
)
from .robot import Cuts

CUTS = types.NamedTuple((CHAIN, INTS, INTS, INTS, STACK, MATRIX, INTS, VECTOR, VECTOR), Cuts)
CLOSED, CANNOT_CLOSE, NOT_CONVERGED, SINGULAR_THERE = 0, 1, 2, 3
_CLOSED = 1e-13  # largest residual of closed loops, relative to the robot's size, or rad
_STATIONARY = 1e-6  # largest slope of the error at a minimum, relative to the error
_APART = 1e-20  # least squared error of loops that cannot close
_FLAT = 1e-10  # least squared sine between columns of passive joints
_STEPS, _HEAVIEST = 150, 1e8  # iterations; damping
_NEAR, _STRIDE = 0.01, 1.0  # squared error up to which actuated joints move on; rad a step


@compiled(inlined=True)
def joint_poses(q: Floats, i: int, chain: Chain, R: Floats, p: Floats) -> None:
    """Poses of all joint frames of sample i, in rows from 1; row 0 is the base."""
    for j in range(q.shape[1]):
        Rj, Pj = link_pose(chain, j, q, i)
        carry_pose(chain, j, Rj, Pj, R, p)


@compiled(inlined=True)
def frame_pose(cuts: Cuts, k: int, parent: int, R: Floats, p: Floats) -> tuple[Matrix, Vector]:
    """Pose of frame k of the closures."""
    Rb = matrix(R, parent)
    at = add(vector(p, parent), times(Rb, vector(cuts.position, k)))
    return product(Rb, matrix(cuts.rotation, k)), at


@compiled(inlined=True)
def rotation_error(rows: int, Ra: Matrix, Rb: Matrix) -> Vector:
    """Rotation vector from a to b, or with five rows that between their z axes; axes of a."""
    z = transpose_times(Ra, (Rb[2], Rb[5], Rb[8]))
    x, y, turn, cosine = -z[1], z[0], 0.0, z[2]
    if rows == 6:
        first = transpose_times(Ra, (Rb[0], Rb[3], Rb[6]))
        second = transpose_times(Ra, (Rb[1], Rb[4], Rb[7]))
        x, y, turn = 0.5 * (second[2] - z[1]), 0.5 * (z[0] - first[2]), 0.5 * (first[1] - second[0])
        cosine = 0.5 * (first[0] + second[1] + z[2] - 1.0)
    sine = sqrt(x * x + y * y + turn * turn)
    if sine < 1e-9:
        return (pi, 0.0, 0.0) if cosine < 0.0 else (x, y, turn)
    return scale(atan2(sine, cosine) / sine, (x, y, turn))


@compiled(inlined=True)
def closure_rows(cuts: Cuts, R: Floats, p: Floats, e: Floats, J: Floats) -> None:
    """Residuals and Jacobian of all closures at given poses. Shapes: e (c,), J (c, n)."""
    n = J.shape[1]
    at = 0
    for k in range(cuts.rows.shape[0]):
        rows = cuts.rows[k]
        Ra, pa = frame_pose(cuts, 2 * k, cuts.first[k], R, p)
        Rb, pb = frame_pose(cuts, 2 * k + 1, cuts.second[k], R, p)
        d = transpose_times(Ra, subtract(pb, pa))
        for x in range(3):
            e[at + x] = d[x]
        if rows > 3:
            d = rotation_error(rows, Ra, Rb)
            for x in range(3, rows):
                e[at + x] = d[x - 3]
        for j in range(n):
            side = float(cuts.side[k * n + j])
            linear = angular = (0.0, 0.0, 0.0)
            if side != 0.0:
                axis = (R[j + 1, 0, 2], R[j + 1, 1, 2], R[j + 1, 2, 2])
                linear = axis
                if cuts.chain.sigma[j] == 0:
                    linear = cross(axis, subtract(pb, vector(p, j + 1)))
                    angular = scale(side, transpose_times(Ra, axis))
                linear = scale(side, transpose_times(Ra, linear))
            for x in range(3):
                J[at + x, j] = linear[x]
            for x in range(3, rows):
                J[at + x, j] = angular[x - 3]
        at += rows


@compiled(NOTHING(MATRIX, CUTS, OUT2, OUT3))
def closure_jacobians(q: Floats, cuts: Cuts, e: Floats, J: Floats) -> None:
    """Residuals e (N, c) of the closures and their Jacobians J (N, c, n) at q (N, n)."""
    R, p = base_poses(q.shape[1])
    for i in range(q.shape[0]):
        joint_poses(q, i, cuts.chain, R, p)
        closure_rows(cuts, R, p, e[i], J[i])


@compiled()
def base_poses(n: int) -> tuple[Floats, Floats]:
    """Poses of the base in row 0, and space for n joints."""
    R, p = np.zeros((n + 1, 3, 3)), np.zeros((n + 1, 3))
    for x in range(3):
        R[0, x, x] = 1.0
    return R, p


@compiled(inlined=True)
def normal_equations(
    weight: Floats, passive: Ints, e: Floats, J: Floats, N: Floats, g: Floats, D: Floats
) -> float:
    """Normal matrix N of the passive joints in units D of unit diagonal, and slopes g; the largest.

    Shapes: passive (m,), e (c,), J (c, n) -> N (m, m), g, D (m,).
    """
    steepest = 0.0
    for a in range(passive.shape[0]):
        for b in range(a, -1, -1):
            total, slope = 0.0, 0.0
            for k in range(e.shape[0]):
                entry = weight[k] * J[k, passive[a]]
                total += entry * J[k, passive[b]]
                slope += entry * e[k]
            if a == b:
                D[a] = sqrt(total) if total > 0.0 else 1.0
                g[a] = slope / D[a]
                steepest = max(steepest, abs(g[a]))
            N[a, b] = total / (D[a] * D[b])
    return steepest


@compiled()
def damped_step(N: Floats, g: Floats, damping: float, L: Floats, x: Floats) -> float:
    """Solve ``(N + damping 1) x = -g`` by Cholesky; its least pivot, 0 without a solution."""
    m = g.shape[0]
    least = 1.0
    for a in range(m):
        for b in range(a + 1):
            total = N[a, b] + (damping if a == b else 0.0)
            for k in range(b):
                total -= L[a, k] * L[b, k]
            if a > b:
                L[a, b] = total / L[b, b]
                continue
            least = min(least, total)
            if not total > 1e-15:
                return 0.0
            L[a, a] = sqrt(total)
    for a in range(m):
        total = -g[a]
        for k in range(a):
            total -= L[a, k] * x[k]
        x[a] = total / L[a, a]
    for a in range(m - 1, -1, -1):
        total = x[a]
        for k in range(a + 1, m):
            total -= L[k, a] * x[k]
        x[a] = total / L[a, a]
    return least


@compiled(inlined=True)
def move_along(
    q: Floats, i: int, target: Floats, actuated: Ints, cuts: Cuts, e: Floats, J: Floats
) -> bool:
    """Move the actuated joints of sample i towards the target; add what this opens to e (c,)."""
    furthest = 0.0
    for a in range(actuated.shape[0]):
        unit = 1.0 if cuts.chain.sigma[actuated[a]] == 0 else cuts.length[0]
        furthest = max(furthest, abs(target[i, a] - q[i, actuated[a]]) / unit)
    share = min(1.0, _STRIDE / furthest) if furthest > 0.0 else 1.0
    for a in range(actuated.shape[0]):
        j = actuated[a]
        by = share * (target[i, a] - q[i, j])
        q[i, j] = target[i, a] if share == 1.0 else q[i, j] + by
        for k in range(e.shape[0]):
            e[k] += J[k, j] * by
    return share < 1.0


@compiled(NOTHING(MATRIX, CUTS, INTS, INTS, INT, OUT2, OUT1, OUT1))
def closed_postures(
    target: Floats,
    cuts: Cuts,
    actuated: Ints,
    passive: Ints,
    follow: int,
    q: Floats,
    residual: Floats,
    code: Floats,
) -> None:
    """Close the loops by the passive joints, from the posture in each row; residuals and codes.

    Shapes: target (N, n_a), q (N, n) -> q, residual, code (N,). ``follow``: 0 with the actuated
    joints at the target from the start, 1 moving from the row to there, 2 without a second start.
    """
    m, c = passive.shape[0], cuts.weight.shape[0]
    R, p = base_poses(q.shape[1])
    e, J = np.empty(c), np.empty((c, q.shape[1]))
    N, L = np.empty((m, m)), np.empty((m, m))
    g, D, x, start, guess = np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(m)
    for i in range(q.shape[0]):
        for a in range(m):
            guess[a] = q[i, passive[a]]
        moving = follow > 0
        jump = not moving
        before, damping, least, halfway = np.inf, 0.0, 0.0, np.inf
        code[i] = NOT_CONVERGED
        for step in range(_STEPS):
            if jump:  # start at the target
                for a in range(actuated.shape[0]):
                    q[i, actuated[a]] = target[i, a]
                for a in range(m):
                    q[i, passive[a]] = guess[a]
                jump, moving, before, damping = False, False, np.inf, 0.0
            joint_poses(q, i, cuts.chain, R, p)
            closure_rows(cuts, R, p, e, J)
            cost = 0.0
            for k in range(c):
                cost += cuts.weight[k] * e[k] * e[k]
            if step == _STEPS // 2:
                halfway = cost
            if step == _STEPS - 1 and cost > 0.5 * halfway and not moving:
                code[i] = CANNOT_CLOSE  # the error hardly decreases
            if cost < before:
                residual[i] = 0.0
                for k in range(c):
                    residual[i] = max(residual[i], abs(e[k]))
                moved = moving and cost < _NEAR
                if moved:
                    moving = move_along(q, i, target, actuated, cuts, e, J)
                steepest = normal_equations(cuts.weight, passive, e, J, N, g, D)
                damping *= 0.1 if cost < 0.3 * before else 0.6
                damping = damping if damping > 1e-6 else 0.0
                least = damped_step(N, g, damping, L, x)
                if cost <= _CLOSED * _CLOSED and not moved:
                    code[i] = CLOSED if least > _FLAT else SINGULAR_THERE
                    for a in range(m):  # the last digits
                        q[i, passive[a]] += x[a] / D[a] if least > _FLAT else 0.0
                    break
                stuck = steepest <= _STATIONARY * sqrt(cost) and cost > _APART and not moved
                for a in range(m):
                    start[a] = q[i, passive[a]]
                before = np.inf if moved else cost
            else:
                stuck = damping > _HEAVIEST
                damping = max(damping * 4.0, 1e-3)
                least = 0.0
            if stuck and (follow == 2 or not moving):
                code[i] = CANNOT_CLOSE
                break
            jump = stuck
            if not least > _FLAT:
                damping = max(damping, 1e-6)
                damped_step(N, g, damping, L, x)
            for a in range(m):
                q[i, passive[a]] = start[a] + x[a] / D[a]
        if code[i] == CANNOT_CLOSE or code[i] == NOT_CONVERGED:  # back to the least error
            for a in range(m):
                q[i, passive[a]] = start[a]
