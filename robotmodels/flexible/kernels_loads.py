"""Generalised Newton-Euler recursion of loads and accelerations, see `kernels`.

Seed book section 7.2.8: forward, velocities and the loads at zero accelerations; backward,
elimination of the modes and of the joint of each body; forward, the accelerations.
"""

from math import sqrt

import numpy as np

from ..kernels._compile import INT, INTS, MATRIX, OUT2, Floats, Ints, compiled
from ..kernels._inertia import inertia_times
from ..kernels._motion import coordinate, link_acceleration, rotation_acceleration
from ..kernels._vectors import (
    add,
    cross,
    dot,
    matrix,
    put_vector,
    scale,
    subtract,
    times,
    transpose_times,
    vector,
    whole_matrix,
    whole_vector,
)
from .kernels import (
    ARM,
    ONE,
    ZERO,
    Arm,
    Work,
    axis,
    body_at,
    moments_times,
    pair,
    part,
    place,
    section_at,
    transform,
    twist_of,
    workspace,
)


@compiled()
def add_back(I: Floats, p: Floats, b: int, J: Floats, h: Floats, j: int, X: Floats) -> None:  # noqa: E741
    """Add inertia and load in row j, behind a transform, to row b."""
    for c in range(6):
        for r in range(6):
            p[b, c] += X[j, r, c] * h[j, r]
            y = 0.0
            for x in range(6):
                y += J[j, r, x] * X[j, x, c]
            for x in range(6):
                I[b, x, c] += X[j, r, x] * y


@compiled()
def factor(a: Floats, s: int, m: int) -> bool:
    """Cholesky factor of the matrix in rows s to s + m, in place; False if not positive."""
    for i in range(m):
        for j in range(i + 1):
            x = a[s + i, j]
            for k in range(j):
                x -= a[s + i, k] * a[s + j, k]
            if i > j:
                a[s + i, j] = x / a[s + j, j]
            elif x > 0.0:
                a[s + i, i] = sqrt(x)
            else:
                return False
    return True


@compiled()
def solve(a: Floats, s: int, m: int, x: Floats, c: int) -> None:
    """Solution in place of column c of x, with the factor in rows s to s + m of a."""
    for i in range(m):
        for k in range(i):
            x[s + i, c] -= a[s + i, k] * x[s + k, c]
        x[s + i, c] /= a[s + i, i]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            x[s + i, c] -= a[s + k, i] * x[s + k, c]
        x[s + i, c] /= a[s + i, i]


@compiled()
def load_body(arm: Arm, k: int, e: Floats, ev: Floats, i: int, work: Work) -> bool:
    """Inertia and load of body k at zero accelerations of its coordinates, motion of its tip.

    False if it spins so fast that its elastic stiffness is not positive.
    """
    j, now, second, s = k + 1, work.now, arm.second, arm.start[k]
    w, dw, u, m = vector(work.w, j), vector(work.dw, j), vector(work.u, j), arm.start[j] - s
    M, MS, J = body_at(arm, k, e, i, work)
    U = rotation_acceleration(w, dw)
    F = add(scale(M, u), times(U, MS))
    N = add(add(cross(MS, u), inertia_times(J, dw)), cross(w, inertia_times(J, w)))
    tip = vector(work.P, j)
    spin, rest, _ = section_at(arm, k, e, ev, i, work)
    ut = add(u, times(U, tip))
    for c in range(s, s + m):
        a, b, turn = part(now, c, 0), part(now, c, 9), moments_times(now, c, w)
        force = dot(a, u) + dot(b, dw) - 0.5 * dot(w, turn)
        A, B, G = scale(2.0, cross(w, a)), add(turn, cross(w, b)), cross(w, part(now, c, 12))
        G = scale(2.0, G)
        for n in range(m):
            x, other = ev[i, s + n], pair(second, s + n, c - s, 9)
            A = add(A, scale(x, pair(second, c, n, 0)))
            B = add(B, scale(x, pair(second, c, n, 9)))
            G = add(G, scale(x, pair(second, c, n, 12)))
            force += x * dot(w, subtract(pair(second, c, n, 9), other))
            force += second[c, n, 16] * e[i, s + n] + second[c, n, 17] * x
            softer = 0.5 * dot(w, moments_times(second[c], n, w))
            work.mass[c, n] = second[c, n, 16] - softer
        F, N = add(F, scale(ev[i, c], A)), add(N, scale(ev[i, c], B))
        ut = add(ut, scale(ev[i, c], G))
        work.E[c, 6] = force
    twist_of(F, N, work.h, j)
    put_vector(work.u, j, ut)
    put_vector(work.w, j, add(w, spin))
    put_vector(work.dw, j, add(dw, add(cross(w, spin), rest)))
    for x in range(3):
        unit = axis(x)
        lever, column = cross(unit, MS), inertia_times(J, unit)
        for y in range(3):
            work.H[j, y, x] = M * unit[y]
            work.H[j, y, x + 3] = work.H[j, x + 3, y] = lever[y]
            work.H[j, y + 3, x + 3] = column[y]
    transform(work.T, j, ONE, tip)
    return factor(work.mass, s, m)


@compiled()
def eliminate(
    arm: Arm, k: int, joint_free: int, free: int, given: Floats, ge: Floats, i: int, work: Work
) -> None:
    """Add inertia and load of body k and all that follows, less its coordinates, to its antecedent.

    The load includes the given accelerations of coordinates that are not free.
    """
    j, s, E, G, H, h = k + 1, arm.start[k], work.E, work.G, work.H, work.h
    m = arm.start[j] - s
    for c in range(s, s + m):
        for x in range(3):
            E[c, x], E[c, x + 3] = work.now[c, x], work.now[c, x + 9]
        for x in range(6):
            E[c, 6] += work.now[c, x + 12] * work.p[j, x]
            y = 0.0  # force of what follows by the mode
            for z in range(6):
                y += work.I[j, x, z] * work.now[c, z + 12]
            for z in range(6):
                E[c, z] += work.T[j, x, z] * y
            G[c, x] = y
    for c in range(s, s + m):
        for n in range(m):
            work.mass[c, n] = arm.second[c, n, 15]
            for x in range(6):
                work.mass[c, n] += G[c, x] * work.now[s + n, x + 12]
    add_back(H, h, j, work.I, work.p, j, work.T)
    if free:
        factor(work.mass, s, m)
    for x in range(7):
        for c in range(s, s + m):
            G[c, x] = E[c, x] - (ge[i, c] if x == 6 else 0.0)
        if free:
            solve(work.mass, s, m, G, x)
    for c in range(s, s + m):
        for x in range(6):
            h[j, x] += E[c, x] * (-G[c, 6] if free else ge[i, c])
            for y in range(6):
                H[j, x, y] -= E[c, x] * G[c, y] * free
    column = arm.chain.joint[k]
    if column >= 0:
        z, U, a = 5 - 3 * arm.chain.sigma[k], work.joint, given[i, column]
        for x in range(6):
            U[j, x] = H[j, x, z]
        U[j, 6], U[j, 7] = H[j, z, z] + arm.rotor[column], h[j, z]
        if joint_free:
            a = (a - U[j, 7]) / U[j, 6]
        for x in range(6):
            h[j, x] += a * U[j, x]
            for y in range(6):
                H[j, x, y] -= U[j, x] * U[j, y] / U[j, 6] * joint_free
    add_back(work.I, work.p, arm.chain.antecedent[k], H, h, j, work.X)


@compiled()
def accelerate(
    arm: Arm, k: int, joint_free: int, free: int, given: Floats, ge: Floats, i: int, work: Work,
    out: Floats, out_e: Floats,
) -> None:  # fmt: skip
    """Accelerations of the free coordinates of body k and of its tip, loads of the others."""
    j, b, s, column = k + 1, arm.chain.antecedent[k], arm.start[k], arm.chain.joint[k]
    a, m = work.h, arm.start[k + 1] - arm.start[k]
    for x in range(6):
        a[j, x] = 0.0
        for y in range(6):
            a[j, x] += work.X[j, x, y] * work.p[b, y]
    if column >= 0:
        U, y = work.joint, given[i, column]
        load = U[j, 7]
        for x in range(6):
            load += U[j, x] * a[j, x]
        if joint_free:
            y = (y - load) / U[j, 6]
        out[i, column] = y if joint_free else load + U[j, 6] * y
        a[j, 5 - 3 * arm.chain.sigma[k]] += y
    for x in range(6):
        work.p[j, x] = 0.0
        for y in range(6):
            work.p[j, x] += work.T[j, x, y] * a[j, y]
    for c in range(s, s + m):
        row = work.G if free else work.E
        y = row[c, 6]
        for x in range(6):
            y += row[c, x] * a[j, x]
        for n in range(0 if free else m):
            y += work.mass[c, n] * ge[i, s + n]
        out_e[i, c] = -y if free else y
        for x in range(6):
            work.p[j, x] += work.now[c, x + 12] * (-y if free else ge[i, c])


@compiled(
    INT(ARM, *[MATRIX] * 8, INTS, INT, INT, OUT2, OUT2, OUT2)
)  # fmt: skip
def loads(
    arm: Arm, q: Floats, e: Floats, v: Floats, ev: Floats, given: Floats, ge: Floats,
    wrench: Floats, twist: Floats, joint_free: Ints, free: int, base_free: int,
    out: Floats, out_e: Floats, base: Floats,
) -> int:  # fmt: skip
    """Accelerations of free coordinates under given loads, and loads of given accelerations.

    Shapes: q, v, given, out (N, n); e, ev, ge, out_e (N, m); wrench, twist of the base (N, 6) ->
    base (N, 10): its load (acceleration if free), first moment of the arm, 1 if a link is softened.
    """
    f, work = arm.pi.shape[0], workspace(arm)
    g = transpose_times(whole_matrix(arm.chain.base_rotation), whole_vector(arm.gravity))
    solver, root, failed = np.zeros((6, 6)), np.zeros((6, 1)), -1
    for i in range(q.shape[0]):
        w, MS, base[i, 9] = part(twist, i, 3), ZERO, 0.0
        put_vector(work.w, 0, w)
        put_vector(work.dw, 0, ZERO)
        put_vector(work.u, 0, subtract(cross(w, part(twist, i, 0)), g))
        for k in range(f):
            j, b, c = k + 1, arm.chain.antecedent[k], arm.chain.joint[k]
            R, P = place(arm, k, q, i, work)
            transform(work.X, j, R, P)
            wb, dwb, ub = vector(work.w, b), vector(work.dw, b), vector(work.u, b)
            U, rate = rotation_acceleration(wb, dwb), coordinate(v, i, c)
            w, dw, u = link_acceleration(arm.chain.sigma[k], R, P, rate, 0.0, wb, dwb, U, ub)
            put_vector(work.w, j, w)
            put_vector(work.dw, j, dw)
            put_vector(work.u, j, u)
            if not load_body(arm, k, e, ev, i, work):
                base[i, 9] = 1.0
            lever = (work.H[j, 5, 1], work.H[j, 3, 2], work.H[j, 4, 0])  # first moment
            MS = add(MS, times(matrix(work.W, j), lever))
            MS = add(MS, scale(work.H[j, 0, 0], vector(work.x, j)))
        for j in range(f + 1):
            for x in range(6):
                work.p[j, x] = 0.0
                for y in range(6):
                    work.I[j, x, y] = 0.0
        W, lever = matrix(work.W, arm.end), times(matrix(work.R, arm.end), whole_vector(arm.tool))
        F, N = transpose_times(W, part(wrench, i, 0)), transpose_times(W, part(wrench, i, 3))
        twist_of(F, add(N, cross(lever, F)), work.p, arm.end)
        for k in range(f - 1, -1, -1):
            moves = joint_free[max(arm.chain.joint[k], 0)]
            eliminate(arm, k, moves, free, given, ge, i, work)
        if base_free:
            for x in range(6):
                root[x, 0] = -work.p[0, x]
                for y in range(6):
                    solver[x, y] = work.I[0, x, y]
            factor(solver, 0, 6)
            solve(solver, 0, 6, root, 0)
        for x in range(6):
            base[i, x] = root[x, 0] if base_free else work.p[0, x]
            work.p[0, x] = root[x, 0]
            base[i, 6 + x % 3] = MS[x % 3]
        for k in range(f):
            moves, j = joint_free[max(arm.chain.joint[k], 0)], k + 1
            accelerate(arm, k, moves, free, given, ge, i, work, out, out_e)
            if failed < 0 and arm.chain.joint[k] >= 0 and moves and not work.joint[j, 6] > 0.0:
                failed = i
    return failed
