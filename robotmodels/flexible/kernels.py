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
    link_pose,
    link_velocity,
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
