"""Constraint rows of closures, and closing of the loops by damped Newton iterations.

The rows of a closure are the position of its second frame in the first, and the rotation from the
first to the second (of the z axes alone where there are five rows). With z and o the axis and
origin of a joint that carries one of the two frames, p the origin of the second frame and R the
axes of the first, its column of the Jacobian is ``+-R^T [z x (p - o); z]``.

Normal equations have unit diagonals, their rows weights that make metres dimensionless.
"""

from __future__ import annotations

from math import atan2, pi, sqrt
from typing import NamedTuple

import numpy as np
from numba import types

from ..kernels import Chain
from ..kernels import _compile as nb
from ..kernels import _vectors as vec
from ..kernels._compile import Floats, Ints, compiled
from ..kernels._motion import carry_pose, link_pose
from ..kernels._vectors import Matrix, Vector
from ..kernels.mass import POSITIVE, solve_definite


class Cuts(NamedTuple):
    """Closures as kernels take them: the tree, the two frames of each closure, its joints.

    Shapes: parent (2 k,), rotation (2 k, 3, 3), position (2 k, 3); rows (k,); side (k n,), 1 or -1
    for joints that move the second or the first frame alone; units (n,); weight (c,).
    """

    chain: Chain
    parent: Ints
    rotation: Floats
    position: Floats
    rows: Ints
    side: Ints
    units: Floats
    weight: Floats


CUTS = types.NamedTuple(
    (nb.CHAIN, nb.INTS, nb.STACK, nb.MATRIX, nb.INTS, nb.INTS, nb.VECTOR, nb.VECTOR), Cuts
)
CLOSED, CANNOT_CLOSE, NOT_CONVERGED, SINGULAR_THERE = 0, 1, 2, 3
_CLOSED = 1e-13  # largest residual of closed loops, relative to the robot's size, or rad
_STATIONARY = 1e-6  # largest slope of the error at a minimum, relative to the error
_APART = 1e-20  # least squared error of loops that cannot close
_FLAT = 1e-10  # least squared sine between columns of passive joints
_STEPS, _HEAVIEST = 150, 1e8  # iterations; damping
_NEAR, _STRIDE = 0.01, 1.0  # squared error up to which actuated joints move on; rad a step


@compiled(inlined=True)
def frame_pose(cuts: Cuts, k: int, R: Floats, p: Floats) -> tuple[Matrix, Vector]:
    """Pose of frame k of the closures."""
    Rb = vec.matrix(R, cuts.parent[k])
    at = vec.add(vec.vector(p, cuts.parent[k]), vec.times(Rb, vec.vector(cuts.position, k)))
    return vec.product(Rb, vec.matrix(cuts.rotation, k)), at


@compiled(inlined=True)
def rotation_error(rows: int, Ra: Matrix, Rb: Matrix) -> Vector:
    """Rotation vector from a to b, or with five rows that between their z axes; axes of a."""
    z = vec.transpose_times(Ra, (Rb[2], Rb[5], Rb[8]))
    x, y, turn, cosine = -z[1], z[0], 0.0, z[2]
    if rows == 6:
        first = vec.transpose_times(Ra, (Rb[0], Rb[3], Rb[6]))
        second = vec.transpose_times(Ra, (Rb[1], Rb[4], Rb[7]))
        x, y, turn = 0.5 * (second[2] - z[1]), 0.5 * (z[0] - first[2]), 0.5 * (first[1] - second[0])
        cosine = 0.5 * (first[0] + second[1] + z[2] - 1.0)
    sine = sqrt(x * x + y * y + turn * turn)
    if sine < 1e-9:
        return (pi, 0.0, 0.0) if cosine < 0.0 else (x, y, turn)
    return vec.scale(atan2(sine, cosine) / sine, (x, y, turn))


@compiled(inlined=True)
def closure_rows(q: Floats, i: int, cuts: Cuts, R: Floats, p: Floats, e: Floats, J: Floats) -> None:
    """Residuals e (c,) and Jacobian J (c, n) of all closures in sample i; R, p are scratch."""
    n, at = J.shape[1], 0
    for f in range(cuts.chain.sigma.shape[0]):
        Rj, Pj = link_pose(cuts.chain, f, q, i)
        carry_pose(cuts.chain, f, Rj, Pj, R, p)
    for k in range(cuts.rows.shape[0]):
        rows = cuts.rows[k]
        Ra, pa = frame_pose(cuts, 2 * k, R, p)
        Rb, pb = frame_pose(cuts, 2 * k + 1, R, p)
        d = vec.transpose_times(Ra, vec.subtract(pb, pa))
        for x in range(3):
            e[at + x] = d[x]
        if rows > 3:
            d = rotation_error(rows, Ra, Rb)
            for x in range(3, rows):
                e[at + x] = d[x - 3]
        for f in range(cuts.chain.sigma.shape[0]):
            j = cuts.chain.joint[f]
            if j < 0:
                continue
            side = float(cuts.side[k * n + j])
            linear = angular = (0.0, 0.0, 0.0)
            if side != 0.0:
                axis = (R[f + 1, 0, 2], R[f + 1, 1, 2], R[f + 1, 2, 2])
                linear = axis
                if cuts.chain.sigma[f] == 0:
                    linear = vec.cross(axis, vec.subtract(pb, vec.vector(p, f + 1)))
                    angular = vec.scale(side, vec.transpose_times(Ra, axis))
                linear = vec.scale(side, vec.transpose_times(Ra, linear))
            for x in range(3):
                J[at + x, j] = linear[x]
            for x in range(3, rows):
                J[at + x, j] = angular[x - 3]
        at += rows


@compiled(nb.NOTHING(nb.MATRIX, CUTS, nb.OUT2, nb.OUT3))
def closure_jacobians(q: Floats, cuts: Cuts, e: Floats, J: Floats) -> None:
    """Residuals e (N, c) of the closures and their Jacobians J (N, c, n) at q (N, n)."""
    R, p = base_poses(cuts.chain.sigma.shape[0])
    for i in range(q.shape[0]):
        closure_rows(q, i, cuts, R, p, e[i], J[i])


@compiled()
def base_poses(n: int) -> tuple[Floats, Floats]:
    """Pose of the base in row 0, and space for n frames."""
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
            N[a, b] = N[b, a] = total / (D[a] * D[b])
    return steepest


@compiled(inlined=True)
def damped_step(
    N: Floats, g: Floats, damping: float, L: Floats, x: Floats, diagonal: Floats
) -> float:
    """Solve ``(N + damping 1) x = -g`` by Cholesky; its least pivot, 0 without a solution."""
    least = 1.0
    for a in range(g.shape[0]):
        x[0, a] = -g[a]
        for b in range(g.shape[0]):
            L[0, a, b] = N[a, b]
        L[0, a, a] += damping
    if solve_definite(L[0], x[0], diagonal) != POSITIVE:
        return 0.0
    for a in range(g.shape[0]):
        least = min(least, L[0, a, a] * L[0, a, a])
    return least


@compiled(inlined=True)
def move_along(
    q: Floats, i: int, target: Floats, actuated: Ints, cuts: Cuts, e: Floats, J: Floats
) -> bool:
    """Move the actuated joints of sample i towards the target; add what this opens to e (c,)."""
    furthest = 0.0
    for a in range(actuated.shape[0]):
        by = abs(target[i, a] - q[i, actuated[a]]) / cuts.units[actuated[a]]
        furthest = max(furthest, by)
    share = min(1.0, _STRIDE / furthest) if furthest > 0.0 else 1.0
    for a in range(actuated.shape[0]):
        j = actuated[a]
        by = share * (target[i, a] - q[i, j])
        q[i, j] = target[i, a] if share == 1.0 else q[i, j] + by
        for k in range(e.shape[0]):
            e[k] += J[k, j] * by
    return share < 1.0


@compiled(nb.NOTHING(nb.MATRIX, CUTS, nb.INTS, nb.INTS, nb.INT, nb.OUT2, nb.OUT1, nb.OUT1))
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

    Shapes: target (N, n_a), q (N, n) -> q, residual, code (N,). With ``follow`` the actuated joints
    move from the row to the target, else they are there from the start.
    """
    m, c = passive.shape[0], cuts.weight.shape[0]
    R, p = base_poses(cuts.chain.sigma.shape[0])
    e, J = np.empty(c), np.empty((c, q.shape[1]))
    N, L, x = np.empty((m, m)), np.empty((1, m, m)), np.empty((1, m))
    g, D, start, diagonal = np.empty(m), np.empty(m), np.empty(m), np.empty(m)
    for i in range(q.shape[0]):
        moving, before, damping, halfway = follow > 0, np.inf, 0.0, np.inf
        code[i] = NOT_CONVERGED
        for a in range(0 if moving else actuated.shape[0]):
            q[i, actuated[a]] = target[i, a]
        for step in range(_STEPS):
            closure_rows(q, i, cuts, R, p, e, J)
            cost, largest = 0.0, 0.0
            for k in range(c):
                cost += cuts.weight[k] * e[k] * e[k]
                largest = max(largest, abs(e[k]))
            if step == _STEPS // 2:
                halfway = cost
            if step == _STEPS - 1 and cost > 0.5 * halfway and not moving:
                code[i] = CANNOT_CLOSE  # the error hardly decreases
            if cost < before:
                residual[i] = largest
                moved = moving and cost < _NEAR
                if moved:
                    moving = move_along(q, i, target, actuated, cuts, e, J)
                steepest = normal_equations(cuts.weight, passive, e, J, N, g, D)
                for a in range(m):
                    start[a] = q[i, passive[a]]
                if cost <= _CLOSED * _CLOSED and not moved:
                    flat = damped_step(N, g, 0.0, L, x, diagonal) <= _FLAT
                    code[i] = SINGULAR_THERE if flat else CLOSED
                    for a in range(m):  # the last digits
                        q[i, passive[a]] += 0.0 if flat else x[0, a] / D[a]
                    break
                stuck = steepest <= _STATIONARY * sqrt(cost) and cost > _APART and not moved
                damping *= 0.1 if cost < 0.3 * before else 0.6
                damping = damping if damping > 1e-6 else 0.0
                before = np.inf if moved else cost
            else:
                stuck = damping > _HEAVIEST
                damping = max(damping * 4.0, 1e-3)
            if stuck:
                code[i] = CANNOT_CLOSE
                break
            if damped_step(N, g, damping, L, x, diagonal) <= _FLAT:
                damping = max(damping, 1e-6)
                damped_step(N, g, damping, L, x, diagonal)
            for a in range(m):
                q[i, passive[a]] = start[a] + x[0, a] / D[a]
        if code[i] == CANNOT_CLOSE or code[i] == NOT_CONVERGED:  # back to the least error
            for a in range(m):
                q[i, passive[a]] = start[a]
