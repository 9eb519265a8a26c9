"""Generalised Newton-Euler recursion of a chain of elastic bodies.

Seed book sections 7.2.2.12, 7.2.6 and 7.2.8 (F. Boyer and W. Khalil 1998), in the axes of the
links. A body has a frame at its root and the displacement ``Phi_k e_k + Gamma_kl e_k e_l / 2`` of
its points (sums over repeated indices); its tip section turns by the rotation vector ``Psi_k e_k``,
and all that follows is fixed to that section. With u the acceleration of the root less gravity,

    F   = M u + dw x MS + w x (w x MS) + 2 w x a_k e'_k + a_k e''_k + A_kl e'_k e'_l
    N   = MS x u + J dw + w x J w + J_k e'_k w + w x b_k e'_k + b_k e''_k + B_kl e'_k e'_l
    Q_k = a_k u + b_k dw + m_kl e''_l - w J_k w / 2 + w (B_kl - B_lk) e'_l + K_kl e_l + D_kl e'_l

where MS, J, J_k, a_k and b_k depend on e. `loads` finds the accelerations that are not given by
articulated elastic bodies: forward, velocities and the loads at zero accelerations; backward,
elimination of the modes and of the joint of each body; forward, the accelerations. Its cost is
O(f + sum m_j^3). Vectors of six are linear, then angular. Of a row of coordinates y (n + m) the
first n are those of the joints, the others the modes.

Shapes of `loads`: y, dy, given, out (N, n + m), outer (N, 18): wrench of the tool, twist and
acceleration of the base, free (n + 2,): of the joints, of all modes, of the base; if it is empty,
only poses are found -> base (N, 10): its load (acceleration if free), first moment of the arm, 1 if
a link is softened; poses (N, f + 1, 3, 4), the last of the tip section at the tool; the first
sample in which a free joint moves no inertia, or -1.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numba import types

from ..kernels._compile import (
    CHAIN,
    INT,
    INTS,
    MATRIX,
    OUT2,
    OUT4,
    VECTOR,
    Floats,
    Ints,
    compiled,
)
from ..kernels._inertia import inertia_of, inertia_times
from ..kernels._motion import coordinate, link_acceleration, link_pose, rotation_acceleration
from ..kernels._vectors import (
    Matrix,
    Vector,
    add,
    cross,
    dot,
    matrix,
    product,
    put_matrix,
    put_vector,
    scale,
    subtract,
    times,
    transpose_times,
    vector,
    whole_matrix,
    whole_vector,
)
from .robot import Arm

ONE: Matrix = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
ZERO: Vector = (0.0, 0.0, 0.0)


class Work(NamedTuple):
    """Arrays of the f + 1 bodies (row 0: base), and of the modes from ``now`` on."""

    W: Floats  # axes and root in the world
    x: Floats
    R: Floats  # tip section in the axes of the body: rotation, position
    P: Floats
    w: Floats  # motion of the body, then of its tip
    dw: Floats
    u: Floats
    X: Floats  # (6, 6) from motions of the antecedent's tip to the root, and to the own tip
    T: Floats
    H: Floats  # (6, 6) inertia of the body at its root, and of all that follows at its tip
    I: Floats  # noqa: E741
    h: Floats  # (6,) load of the body, of all that follows, then acceleration of the tip
    p: Floats
    joint: Floats  # column of the inertia, inertia and load of the joint
    body: Floats  # inertial parameters
    now: Floats  # J_k, a, b, Phi and velocity of the section, at e
    E: Floats  # mixed inertia (6), load
    G: Floats  # E divided by the inertia of the modes
    mass: Floats


ARM = types.NamedTuple(
    (CHAIN, MATRIX, INTS, MATRIX, MATRIX, MATRIX, VECTOR, VECTOR, VECTOR, INT), Arm
)


@compiled()
def part(a: Floats, i: int, c: int) -> Vector:
    """Three entries of row i from column c on."""
    return (a[i, c], a[i, c + 1], a[i, c + 2])


@compiled()
def axis(i: int) -> Vector:
    """Unit vector."""
    return (1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0)


@compiled()
def moments_times(a: Floats, i: int, c: int, w: Vector) -> Vector:
    """Symmetric matrix of the six entries of row i from column c on, times a vector."""
    J = (a[i, c], a[i, c + 1], a[i, c + 2], a[i, c + 3], a[i, c + 4], a[i, c + 5])
    return inertia_times(J, w)


@compiled()
def put_pose(poses: Floats, i: int, k: int, R: Matrix, P: Vector) -> None:
    """Write a pose into ``poses[i, k]``."""
    for x in range(3):
        poses[i, k, x, 3] = P[x]
        for y in range(3):
            poses[i, k, x, y] = R[3 * x + y]


@compiled()
def mapped(out: Floats, j: int, T: Floats, a: Floats, b: int) -> None:
    """Write matrix j of T times row b of a into row j."""
    for x in range(6):
        out[j, x] = 0.0
        for y in range(6):
            out[j, x] += T[j, x, y] * a[b, y]


@compiled()
def workspace(arm: Arm) -> Work:
    """Work arrays with the pose of the base in row 0."""
    f, m, most, z = arm.pi.shape[0] + 1, arm.first.shape[0], arm.second.shape[1] // 18, np.zeros
    pose, row, square = (f, 3, 3), (f, 3), (f, 6, 6)
    work = Work(
        *(z(pose), z(row), z(pose), z(row), z(row), z(row), z(row)),
        *(z(square), z(square), z(square), z(square), z((f, 6)), z((f, 6)), z((f, 8)), z((f, 10))),
        *(z((m, 18)), z((m, 7)), z((m, 7)), z((m, most))),
    )
    put_matrix(work.W, 0, whole_matrix(arm.chain.base_rotation))
    put_vector(work.x, 0, whole_vector(arm.chain.base_position))
    put_matrix(work.R, 0, ONE)
    return work


@compiled()
def body_at(arm: Arm, k: int, e: Floats, work: Work) -> None:
    """Write inertial parameters, tip and rows of now of deformed body k."""
    put_vector(work.P, k + 1, vector(arm.tip, k))
    for x in range(10):  # a copy by numba would take seconds to compile
        work.body[k, x] = arm.pi[k, x]
    for c in range(arm.start[k], arm.start[k + 1]):
        for x in range(15):
            value = arm.first[c, x]
            for n in range(arm.start[k + 1] - arm.start[k]):
                value += arm.second[c, 18 * n + x] * e[arm.start[k] + n]
            work.now[c, x] = value
        for x in range(9):
            work.body[k, x] += 0.5 * e[c] * (arm.first[c, x] + work.now[c, x])
        for x in range(3):
            work.P[k + 1, x] += 0.5 * e[c] * (arm.first[c, x + 12] + work.now[c, x + 12])


@compiled()
def turned(a: float, b: float, t: Vector, x: Vector) -> Vector:
    """x + a t x x + b t x (t x x)."""
    tx = cross(t, x)
    return add(x, add(scale(a, tx), scale(b, cross(t, tx))))


@compiled()
def section_at(arm: Arm, k: int, e: Floats, ev: Floats, work: Work) -> tuple[Vector, Vector]:
    """Angular velocity of the tip section in the body, and the rest of its acceleration.

    Writes the rotation, and the velocity of the section per unit of each mode into rows of now.
    """
    t, dt = ZERO, ZERO
    for c in range(arm.start[k], arm.start[k + 1]):
        t = add(t, scale(e[c], part(arm.first, c, 15)))
        dt = add(dt, scale(ev[c], part(arm.first, c, 15)))
    # series in s = t.t of sin|t|/|t|, a = (1 - cos|t|)/s, b = (|t| - sin|t|)/|t|^3 and da, db by s
    s, sine, a, b, da, db = dot(t, t), 0.0, 0.0, 0.0, 0.0, 0.0
    term, before = 1.0, 0.0  # (-s)^n / (2 n + 1)! and its derivative divided by n
    for n in range(20):
        if abs(term) + abs(before) < 1e-24:
            break
        even, odd = 1.0 / (2 * n + 2), 1.0 / ((2 * n + 2) * (2 * n + 3))
        sine += term
        a += term * even
        b += term * odd
        da += n * before * even
        db += n * before * odd
        before = -term * odd
        term = s * before
    for x in range(3):
        column = turned(sine, a, t, axis(x))
        for y in range(3):
            work.R[k + 1, y, x] = column[y]
    for c in range(arm.start[k], arm.start[k + 1]):
        rate = turned(a, b, t, part(arm.first, c, 15))
        work.now[c, 15], work.now[c, 16], work.now[c, 17] = rate
    ds, tdt = 2.0 * dot(t, dt), cross(t, dt)
    rest = add(scale(da * ds, tdt), scale(db * ds, cross(t, tdt)))
    return turned(a, b, t, dt), add(rest, scale(b, cross(dt, tdt)))


@compiled()
def transform(X: Floats, j: int, R: Matrix, P: Vector) -> None:
    """Write the matrix from motions of a frame to those of one with pose (R, P) in it."""
    for x in range(3):
        a, b = transpose_times(R, axis(x)), transpose_times(R, cross(axis(x), P))
        for y in range(3):
            X[j, y, x] = X[j, y + 3, x + 3] = a[y]
            X[j, y, x + 3], X[j, y + 3, x] = b[y], 0.0


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
def solve(a: Floats, s: int, m: int, x: Floats, columns: int) -> bool:
    """Solutions in place of columns of x, by Cholesky's factor in place of rows s to s + m of a.

    False if the matrix is not positive.
    """
    for i in range(m):
        for j in range(i + 1):
            y = a[s + i, j]
            for k in range(j):
                y -= a[s + i, k] * a[s + j, k]
            if i > j:
                a[s + i, j] = y / a[s + j, j]
            elif y > 0.0:
                a[s + i, i] = sqrt(y)
            else:
                return False
    for c in range(columns):
        for i in range(m):
            for k in range(i):
                x[s + i, c] -= a[s + i, k] * x[s + k, c]
            x[s + i, c] /= a[s + i, i]
        for i in range(m - 1, -1, -1):
            for k in range(i + 1, m):
                x[s + i, c] -= a[s + k, i] * x[s + k, c]
            x[s + i, c] /= a[s + i, i]
    return True


@compiled()
def load_body(
    arm: Arm, k: int, e: Floats, ev: Floats, spin: Vector, rest: Vector, work: Work
) -> bool:
    """Inertia and load of body k at zero accelerations of its coordinates, motion of its tip.

    False if it spins so fast that its elastic stiffness is not positive.
    """
    j, now, second, s = k + 1, work.now, arm.second, arm.start[k]
    w, dw, u, m = vector(work.w, j), vector(work.dw, j), vector(work.u, j), arm.start[j] - s
    J, MS, M = inertia_of(work.body, k)
    U = rotation_acceleration(w, dw)
    F = add(scale(M, u), times(U, MS))
    N = add(add(cross(MS, u), inertia_times(J, dw)), cross(w, inertia_times(J, w)))
    ut = add(u, times(U, vector(work.P, j)))
    for c in range(s, s + m):
        a, b, turn = part(now, c, 6), part(now, c, 9), moments_times(now, c, 0, w)
        force = dot(a, u) + dot(b, dw) - 0.5 * dot(w, turn)
        A, B = scale(2.0, cross(w, a)), add(turn, cross(w, b))
        G = scale(2.0, cross(w, part(now, c, 12)))
        for n in range(m):
            x, o, gyro = ev[s + n], 18 * n, part(second, c, 18 * n + 9)
            A = add(A, scale(x, part(second, c, o + 6)))
            B = add(B, scale(x, gyro))
            G = add(G, scale(x, part(second, c, o + 12)))
            force += x * dot(w, subtract(gyro, part(second, s + n, 18 * (c - s) + 9)))
            force += second[c, o + 16] * e[s + n] + second[c, o + 17] * x
            softer = 0.5 * dot(w, moments_times(second, c, o, w))
            work.mass[c, n] = second[c, o + 16] - softer
        F, N = add(F, scale(ev[c], A)), add(N, scale(ev[c], B))
        ut = add(ut, scale(ev[c], G))
        work.E[c, 6] = force
    h = work.h
    h[j, 0], h[j, 1], h[j, 2], h[j, 3], h[j, 4], h[j, 5] = F + N
    put_vector(work.u, j, ut)
    put_vector(work.w, j, add(w, spin))
    put_vector(work.dw, j, add(dw, add(cross(w, spin), rest)))
    for x in range(3):
        lever, column = cross(axis(x), MS), inertia_times(J, axis(x))
        for y in range(3):
            work.H[j, y, x] = M if x == y else 0.0
            work.H[j, y, x + 3] = work.H[j, x + 3, y] = lever[y]
            work.H[j, y + 3, x + 3] = column[y]
    transform(work.T, j, ONE, vector(work.P, j))
    return solve(work.mass, s, m, work.G, 0)


@compiled()
def eliminate(arm: Arm, k: int, free: Ints, given: Floats, work: Work) -> None:
    """Add inertia and load of body k and all that follows, less its coordinates, to its antecedent.

    The load includes the given accelerations of coordinates that are not free.
    """
    j, s, E, G, H, h = k + 1, arm.start[k], work.E, work.G, work.H, work.h
    m, n = arm.start[j] - s, arm.rotor.shape[0]
    for c in range(s, s + m):
        for x in range(3):
            E[c, x], E[c, x + 3] = work.now[c, x + 6], work.now[c, x + 9]
        for x in range(6):
            E[c, 6] += work.now[c, x + 12] * work.p[j, x]
            y = 0.0  # force of what follows by the mode
            for z in range(6):
                y += work.I[j, x, z] * work.now[c, z + 12]
            for z in range(6):
                E[c, z] += work.T[j, x, z] * y
            G[c, x] = y
    for c in range(s, s + m):
        for i in range(m):
            work.mass[c, i] = arm.second[c, 18 * i + 15]
            for x in range(6):
                work.mass[c, i] += G[c, x] * work.now[s + i, x + 12]
    add_back(H, h, j, work.I, work.p, j, work.T)
    for c in range(s, s + m):
        for x in range(7):
            G[c, x] = E[c, x] - (given[n + c] if x == 6 else 0.0)
    if free[n]:
        solve(work.mass, s, m, G, 7)
    for c in range(s, s + m):
        for x in range(6):
            h[j, x] += E[c, x] * (-G[c, 6] if free[n] else given[n + c])
            for y in range(6):
                H[j, x, y] -= E[c, x] * G[c, y] * free[n]
    column = arm.chain.joint[k]
    if column >= 0:
        z, U, a = 5 - 3 * arm.chain.sigma[k], work.joint, given[column]
        for x in range(6):
            U[j, x] = H[j, x, z]
        U[j, 6], U[j, 7] = H[j, z, z] + arm.rotor[column], h[j, z]
        if free[column]:
            a = (a - U[j, 7]) / U[j, 6]
        for x in range(6):
            h[j, x] += a * U[j, x]
            for y in range(6):
                H[j, x, y] -= U[j, x] * U[j, y] / U[j, 6] * free[column]
    add_back(work.I, work.p, arm.chain.antecedent[k], H, h, j, work.X)


@compiled()
def accelerate(arm: Arm, k: int, free: Ints, given: Floats, work: Work, out: Floats) -> bool:
    """Accelerations of the free coordinates of body k and of its tip, loads of the others.

    False if a free joint moves no inertia.
    """
    j, b, s, column = k + 1, arm.chain.antecedent[k], arm.start[k], arm.chain.joint[k]
    a, m, n, U = work.h, arm.start[k + 1] - arm.start[k], arm.rotor.shape[0], work.joint
    mapped(a, j, work.X, work.p, b)
    if column >= 0:
        y, load = given[column], U[j, 7]
        for x in range(6):
            load += U[j, x] * a[j, x]
        if free[column]:
            y = (y - load) / U[j, 6]
        out[column] = y if free[column] else load + U[j, 6] * y
        a[j, 5 - 3 * arm.chain.sigma[k]] += y
    mapped(work.p, j, work.T, a, j)
    for c in range(s, s + m):
        row = work.G if free[n] else work.E
        y = row[c, 6]
        for x in range(6):
            y += row[c, x] * a[j, x]
        for i in range(0 if free[n] else m):
            y += work.mass[c, i] * given[n + s + i]
        out[n + c] = -y if free[n] else y
        for x in range(6):
            work.p[j, x] += work.now[c, x + 12] * (-y if free[n] else given[n + c])
    return column < 0 or not free[column] or U[j, 6] > 0.0


@compiled(INT(ARM, MATRIX, MATRIX, MATRIX, MATRIX, INTS, OUT2, OUT2, OUT4))
def loads(
    arm: Arm, y: Floats, dy: Floats, given: Floats, outer: Floats, free: Ints, out: Floats,
    base: Floats, poses: Floats,
) -> int:  # fmt: skip
    """Accelerations of free coordinates under given loads, and loads of given accelerations."""
    f, n, t, work = arm.pi.shape[0], arm.rotor.shape[0], arm.end, workspace(arm)
    g = transpose_times(whole_matrix(arm.chain.base_rotation), whole_vector(arm.gravity))
    root, failed = np.zeros((6, 1)), -1
    for i in range(y.shape[0]):
        e, ev, value = y[i, n:], dy[i, n:], given[i]
        w, MS, base[i, 9] = part(outer, i, 9), ZERO, 0.0
        put_vector(work.w, 0, w)
        put_vector(work.dw, 0, part(outer, i, 15))
        put_vector(work.u, 0, subtract(add(cross(w, part(outer, i, 6)), part(outer, i, 12)), g))
        for k in range(f):
            j, b, column = k + 1, arm.chain.antecedent[k], arm.chain.joint[k]
            R, P = link_pose(arm.chain, k, y, i)
            R, P = product(matrix(work.R, b), R), times(matrix(work.R, b), P)
            W = product(matrix(work.W, b), R)
            x = add(vector(work.x, b), times(matrix(work.W, b), add(vector(work.P, b), P)))
            put_matrix(work.W, j, W)
            put_vector(work.x, j, x)
            put_pose(poses, i, k, W, x)
            body_at(arm, k, e, work)
            spin, rest = section_at(arm, k, e, ev, work)
            MS = add(MS, add(times(W, part(work.body, k, 6)), scale(work.body[k, 9], x)))
            if len(free):
                transform(work.X, j, R, P)
                wb, dwb, ub = vector(work.w, b), vector(work.dw, b), vector(work.u, b)
                U, rate = rotation_acceleration(wb, dwb), coordinate(dy, i, column)
                w, dw, u = link_acceleration(arm.chain.sigma[k], R, P, rate, 0.0, wb, dwb, U, ub)
                put_vector(work.w, j, w)
                put_vector(work.dw, j, dw)
                put_vector(work.u, j, u)
                if not load_body(arm, k, e, ev, spin, rest, work):
                    base[i, 9] = 1.0
        W, lever = matrix(work.W, t), times(matrix(work.R, t), whole_vector(arm.tool))
        end = add(vector(work.x, t), times(W, add(vector(work.P, t), lever)))
        put_pose(poses, i, f, product(W, matrix(work.R, t)), end)
        base[i, 6], base[i, 7], base[i, 8] = MS
        if not len(free):
            continue
        work.p[:], work.I[:] = 0.0, 0.0
        F, N = transpose_times(W, part(outer, i, 0)), transpose_times(W, part(outer, i, 3))
        N, p = add(N, cross(lever, F)), work.p
        p[t, 0], p[t, 1], p[t, 2], p[t, 3], p[t, 4], p[t, 5] = F + N
        for k in range(f - 1, -1, -1):
            eliminate(arm, k, free, value, work)
        if free[n + 1]:
            for z in range(6):
                root[z, 0] = -work.p[0, z]
            solve(work.I[0], 0, 6, root, 1)
        for z in range(6):
            base[i, z] = root[z, 0] if free[n + 1] else work.p[0, z]
            work.p[0, z] = root[z, 0]
        for k in range(f):
            if not accelerate(arm, k, free, value, work, out[i]) and failed < 0:
                failed = i
    return failed
