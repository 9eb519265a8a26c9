"""Generalised Newton-Euler recursions of a chain of elastic bodies: one for motions, one for loads.

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
O(f + sum m_j^3). Vectors of six are linear, then angular.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numba import types

from ..kernels import Chain
from ..kernels._compile import (
    CHAIN,
    INT,
    INTS,
    MATRIX,
    NOTHING,
    OUT2,
    OUT4,
    STACK,
    VECTOR,
    Floats,
    Ints,
    compiled,
)
from ..kernels._inertia import Moments, inertia_times
from ..kernels._motion import (
    coordinate,
    link_acceleration,
    link_pose,
    link_velocity,
    rotation_acceleration,
)
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

ONE: Matrix = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
ZERO: Vector = (0.0, 0.0, 0.0)


class Arm(NamedTuple):
    """An elastic chain in arrays; body k has the modes ``start[k]`` to ``start[k + 1]``.

    Shapes: pi (f, 10), start (f + 1,), tip (f, 3), first (m, 18) with the columns a, J_k, b, Phi
    and Psi of the tip, second (m, most, 18): A, J_kl, B, Gamma of the tip, m_kl, K_kl, D_kl.
    """

    chain: Chain  # positions from the undeformed tips of the antecedents
    pi: Floats
    start: Ints
    tip: Floats
    first: Floats
    second: Floats
    rotor: Floats
    tool: Floats  # (3,), from the undeformed tip of row `end`
    gravity: Floats
    end: int


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
    now: Floats  # a, J_k, b, Phi and velocity of the section, at e
    E: Floats  # mixed inertia (6), load
    G: Floats  # E divided by the inertia of the modes
    mass: Floats


ARM = types.NamedTuple(
    (CHAIN, MATRIX, INTS, MATRIX, MATRIX, STACK, VECTOR, VECTOR, VECTOR, INT), Arm
)


@compiled()
def part(a: Floats, i: int, c: int) -> Vector:
    """Three entries of row i from column c on."""
    return (a[i, c], a[i, c + 1], a[i, c + 2])


@compiled()
def pair(a: Floats, i: int, k: int, c: int) -> Vector:
    """Three entries of row (i, k) from column c on."""
    return (a[i, k, c], a[i, k, c + 1], a[i, k, c + 2])


@compiled()
def axis(i: int) -> Vector:
    """Unit vector."""
    return (1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0)


@compiled()
def twist_of(a: Vector, b: Vector, out: Floats, i: int) -> None:
    """Write two vectors into row i."""
    for x in range(3):
        out[i, x], out[i, x + 3] = a[x], b[x]


@compiled()
def workspace(arm: Arm) -> Work:
    """Work arrays with the pose of the base in row 0."""
    f, m, most = arm.pi.shape[0] + 1, arm.first.shape[0], arm.second.shape[1]
    pose, row, square = (f, 3, 3), (f, 3), (f, 6, 6)
    z = np.zeros
    work = Work(
        *(z(pose), z(row), z(pose), z(row), z(row), z(row), z(row)),
        *(z(square), z(square), z(square), z(square), z((f, 6)), z((f, 6)), z((f, 8))),
        *(z((m, 18)), z((m, 7)), z((m, 7)), z((m, most))),
    )
    put_matrix(work.W, 0, whole_matrix(arm.chain.base_rotation))
    put_vector(work.x, 0, whole_vector(arm.chain.base_position))
    put_matrix(work.R, 0, ONE)
    return work


@compiled()
def body_at(arm: Arm, k: int, e: Floats, i: int, work: Work) -> tuple[float, Vector, Moments]:
    """Mass, first and second moments of deformed body k; writes its tip and rows of now."""
    s, end, now = arm.start[k], arm.start[k + 1], work.now
    own = work.H[k + 1]  # its first row holds the changes until the inertia is written
    for x in range(15):
        own[x // 6, x % 6] = 0.0
    for c in range(s, end):
        for x in range(15):
            value = arm.first[c, x]
            for n in range(end - s):
                value += arm.second[c, n, x] * e[i, s + n]
            now[c, x] = value
            own[x // 6, x % 6] += 0.5 * e[i, c] * (arm.first[c, x] + value)
    tip = add(vector(arm.tip, k), (own[2, 0], own[2, 1], own[2, 2]))
    put_vector(work.P, k + 1, tip)
    MS = add(part(arm.pi, k, 6), (own[0, 0], own[0, 1], own[0, 2]))
    J = (
        arm.pi[k, 0] + own[0, 3],
        arm.pi[k, 1] + own[0, 4],
        arm.pi[k, 2] + own[0, 5],
        arm.pi[k, 3] + own[1, 0],
        arm.pi[k, 4] + own[1, 1],
        arm.pi[k, 5] + own[1, 2],
    )
    return arm.pi[k, 9], MS, J


@compiled()
def moments_times(a: Floats, i: int, w: Vector) -> Vector:
    """Change of the second moments with a mode, in columns 3 to 9 of row i, times a vector."""
    return inertia_times((a[i, 3], a[i, 4], a[i, 5], a[i, 6], a[i, 7], a[i, 8]), w)


@compiled()
def turned(a: float, b: float, t: Vector, x: Vector) -> Vector:
    """x + a t x x + b t x (t x x)."""
    tx = cross(t, x)
    return add(x, add(scale(a, tx), scale(b, cross(t, tx))))


@compiled()
def section_at(
    arm: Arm, k: int, e: Floats, ev: Floats, i: int, work: Work
) -> tuple[Vector, Vector, Vector]:
    """Angular velocity of the tip section in the body, rest of its acceleration, velocity.

    Writes the rotation, and the velocity of the section per unit of each mode into rows of now.
    """
    t, dt, speed = ZERO, ZERO, ZERO
    for c in range(arm.start[k], arm.start[k + 1]):
        t = add(t, scale(e[i, c], part(arm.first, c, 15)))
        dt = add(dt, scale(ev[i, c], part(arm.first, c, 15)))
        speed = add(speed, scale(ev[i, c], part(work.now, c, 12)))
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
    return turned(a, b, t, dt), add(rest, scale(b, cross(dt, tdt))), speed


@compiled()
def transform(X: Floats, j: int, R: Matrix, P: Vector) -> None:
    """Write the matrix from motions of a frame to those of one with pose (R, P) in it."""
    for x in range(3):
        a, b = transpose_times(R, axis(x)), transpose_times(R, cross(axis(x), P))
        for y in range(3):
            X[j, y, x] = X[j, y + 3, x + 3] = a[y]
            X[j, y, x + 3], X[j, y + 3, x] = b[y], 0.0


@compiled()
def place(arm: Arm, k: int, q: Floats, i: int, work: Work) -> tuple[Matrix, Vector]:
    """Pose of body k in the axes of its antecedent, from its tip; writes its pose in the world."""
    b = arm.chain.antecedent[k]
    R, P = link_pose(arm.chain, k, q, i)
    R, P = product(matrix(work.R, b), R), times(matrix(work.R, b), P)
    W = matrix(work.W, b)
    put_matrix(work.W, k + 1, product(W, R))
    put_vector(work.x, k + 1, add(vector(work.x, b), times(W, add(vector(work.P, b), P))))
    return R, P


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


@compiled(NOTHING(ARM, MATRIX, MATRIX, MATRIX, MATRIX, MATRIX, OUT4, OUT2))
def motions(
    arm: Arm,
    q: Floats,
    e: Floats,
    v: Floats,
    ev: Floats,
    twist: Floats,
    poses: Floats,
    out: Floats,
) -> None:
    """Poses, energies, momenta, and the velocity of the tool, in world axes.

    Shapes: twist of the base (N, 6) -> poses (N, f + 1, 3, 4), the last of the tip section at the
    tool; out (N, 15): energies (kinetic, gravity, elastic), momenta (6), twist of the tool (6).
    """
    f, t, work = arm.pi.shape[0], arm.end, workspace(arm)
    for i in range(q.shape[0]):
        put_vector(work.u, 0, part(twist, i, 0))
        put_vector(work.w, 0, part(twist, i, 3))
        for x in range(15):
            out[i, x] = 0.0
        for k in range(f):
            j, s, b = k + 1, arm.start[k], arm.chain.antecedent[k]
            R, P = place(arm, k, q, i, work)
            rate = coordinate(v, i, arm.chain.joint[k])
            w, u = link_velocity(
                arm.chain.sigma[k], R, P, rate, vector(work.w, b), vector(work.u, b)
            )
            M, MS, J = body_at(arm, k, e, i, work)
            spin, _, speed = section_at(arm, k, e, ev, i, work)
            put_vector(work.w, j, add(w, spin))
            put_vector(work.u, j, add(add(u, cross(w, vector(work.P, j))), speed))
            p, h = add(scale(M, u), cross(w, MS)), add(cross(MS, u), inertia_times(J, w))
            out[i, 0] += 0.5 * (dot(p, u) + dot(h, w))
            for c in range(s, arm.start[j]):
                a, b3, x = part(work.now, c, 0), part(work.now, c, 9), ev[i, c]
                out[i, 0] += x * (dot(a, u) + dot(b3, w))
                p, h = add(p, scale(x, a)), add(h, scale(x, b3))
                for n in range(arm.start[j] - s):
                    out[i, 0] += 0.5 * arm.second[c, n, 15] * x * ev[i, s + n]
                    out[i, 2] += 0.5 * arm.second[c, n, 16] * e[i, c] * e[i, s + n]
            W, root = matrix(work.W, j), vector(work.x, j)
            p, h = times(W, p), add(times(W, h), cross(root, times(W, p)))
            out[i, 1] -= dot(whole_vector(arm.gravity), add(scale(M, root), times(W, MS)))
            for x in range(3):
                out[i, 3 + x] += p[x]
                out[i, 6 + x] += h[x]
                poses[i, k, x, 3] = root[x]
                for y in range(3):
                    poses[i, k, x, y] = work.W[j, x, y]
        W, w, lever = (
            matrix(work.W, t),
            vector(work.w, t),
            times(matrix(work.R, t), whole_vector(arm.tool)),
        )
        root = add(vector(work.x, t), times(W, add(vector(work.P, t), lever)))
        twist_of(times(W, add(vector(work.u, t), cross(w, lever))), times(W, w), work.p, 0)
        W = product(W, matrix(work.R, t))
        for x in range(3):
            out[i, 9 + x], out[i, 12 + x] = work.p[0, x], work.p[0, x + 3]
            poses[i, f, x, 3] = root[x]
            for y in range(3):
                poses[i, f, x, y] = W[3 * x + y]
