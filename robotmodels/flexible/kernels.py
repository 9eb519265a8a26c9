"""Generalised Newton-Euler recursion of a chain of elastic bodies.

Book sections 7.2.2.12, 7.2.6 and 7.2.8 (F. Boyer and W. Khalil 1998), in the axes of the
links. A body has a frame at its root and the displacement ``Phi_k e_k + Gamma_kl e_k e_l / 2`` of
its points (sums over repeated indices); its tip section turns by the rotation vector ``Psi_k e_k``,
and all that follows is fixed to that section. With u the acceleration of the root less gravity,

    F   = M u + dw x MS + w x (w x MS) + 2 w x a_k e'_k + a_k e''_k + A_kl e'_k e'_l
    N   = MS x u + J dw + w x J w + J_k e'_k w + w x b_k e'_k + b_k e''_k + B_kl e'_k e'_l
    Q_k = a_k u + b_k dw + m_kl e''_l - w J_k w / 2 + w (B_kl - B_lk) e'_l + K_kl e_l + D_kl e'_l

where MS, J, J_k, a_k and b_k depend on e. `loads` finds the accelerations that are not given by
articulated elastic bodies: forward, velocities and the loads at zero accelerations; backward,
elimination of the modes and of the joint of each body; forward, the accelerations. Its cost is
O(f + sum m_j^3). Coordinates of a body are the motion of its root without that of its joint
(linear, angular), its joint, its modes. Rows y (n + m) are those of the motors, of the modes, and
of the deflections of flexible joints, whose springs load motor and link with opposite torques.

Shapes of `loads`: y, dy, given, out (N, n + m), outer (N, 18): wrench of the tool, twist and
acceleration of the base, free (n + 3,): of the links' joints, of all modes, of the base, of the
motors; if it is empty, only poses are found -> base (N, 10): its load (acceleration if free), first
moment of the arm, code of `SpinStatus`; poses (N, f + 1, 3, 4), the last of the tip section at the
tool; the first sample in which a free joint moves no inertia, or -1.
"""

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from ..kernels import _compile as kinds
from ..kernels._compile import INT, MATRIX, OUT2, OUT3, VECTOR, Floats, Ints, compiled
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
    scale,
    subtract,
    times,
    transpose_times,
    whole_matrix,
    whole_vector,
)
from .robot import Arm
from .work import ONE, Work, to_links, to_motors

ZERO: Vector = (0.0, 0.0, 0.0)
ROUNDING = 1e-14
ARM = types.NamedTuple(
    (
        kinds.CHAIN,
        MATRIX,
        kinds.INTS,
        MATRIX,
        MATRIX,
        MATRIX,
        MATRIX,
        kinds.INTS,
        VECTOR,
        VECTOR,
        INT,
    ),
    Arm,
)
WORK = types.NamedTuple(
    tuple(
        OUT3 if name in ("W", "R", "X", "T", "A", "I", "G", "K", "all") else OUT2
        for name in Work._fields
    ),
    Work,
)


@compiled(counted=False)
def part(a: Floats, i: int, c: int) -> Vector:
    """Three entries of row i from column c on."""
    return (a[i, c], a[i, c + 1], a[i, c + 2])


@compiled(counted=False)
def put_part(a: Floats, i: int, c: int, x: Vector) -> None:
    """Write three entries of row i from column c on."""
    a[i, c], a[i, c + 1], a[i, c + 2] = x


@compiled(counted=False)
def axis(i: int) -> Vector:
    """Unit vector."""
    return (1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0)


@compiled(counted=False)
def moments_times(a: Floats, i: int, c: int, w: Vector) -> Vector:
    """Symmetric matrix of the six entries of row i from column c on, times a vector."""
    J = (a[i, c], a[i, c + 1], a[i, c + 2], a[i, c + 3], a[i, c + 4], a[i, c + 5])
    return inertia_times(J, w)


@compiled(counted=False)
def put_pose(poses: Floats, i: int, k: int, R: Matrix, P: Vector) -> None:
    """Write a pose into ``poses[i, k]``."""
    for x in range(3):
        poses[i, k, x, 3] = P[x]
        for y in range(3):
            poses[i, k, x, y] = R[3 * x + y]


@compiled(counted=False)
def body_at(arm: Arm, k: int, e: Floats, work: Work) -> None:
    """Write inertial parameters, tip and rows of now of deformed body k."""
    put_part(work.V, k + 1, 3, part(arm.tip, k, 0))
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
            work.V[k + 1, 3 + x] += 0.5 * e[c] * (arm.first[c, x + 12] + work.now[c, x + 12])


@compiled(counted=False)
def turned(a: float, b: float, t: Vector, x: Vector) -> Vector:
    """x + a t x x + b t x (t x x)."""
    tx = cross(t, x)
    return add(x, add(scale(a, tx), scale(b, cross(t, tx))))


@compiled(counted=False)
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


@compiled(counted=False)
def transform(X: Floats, j: int, R: Matrix, P: Vector) -> None:
    """Write the matrix from motions of a frame to those of one with pose (R, P) in it."""
    for x in range(3):
        a, b = transpose_times(R, axis(x)), transpose_times(R, cross(axis(x), P))
        for y in range(3):
            X[j, y, x] = X[j, y + 3, x + 3] = a[y]
            X[j, y, x + 3], X[j, y + 3, x] = b[y], 0.0


@compiled(counted=False)
def add_back(A: Floats, b: int, B: Floats, j: int, T: Floats, m: int, BT: Floats) -> None:
    """Add inertia and load in row j of B, behind a transform (6, m), to row b of A.

    Loads are the last columns.
    """
    load, own = A.shape[2] - 1, B.shape[2] - 1
    for r in range(6):
        for c in range(m):
            y = 0.0
            for x in range(6):
                y += B[j, r, x] * T[j, x, c]
            BT[r, c] = y
    for r in range(6):
        for c in range(m):
            t = T[j, r, c]
            if t != 0.0:  # most are zero
                A[b, c, load] += t * B[j, r, own]
                for x in range(m):
                    A[b, c, x] += t * BT[r, x]


@compiled(counted=False)
def eliminate(A: Floats, j: int, low: int, high: int, G: Floats) -> bool:
    """Remove coordinates from the last on, by their loads if free, else by their accelerations.

    False if the inertia of one that is free is not positive.
    """
    positive, load = True, A.shape[2] - 1
    for c in range(high - 1, low - 1, -1):
        a, own, is_free = G[j, 1, c], A[j, c, c], G[j, 2, c] != 0.0
        if is_free:
            a, positive = (a - A[j, c, load]) / own, positive and own > 0.0
        for r in range(c):
            A[j, r, load] += a * A[j, c, r]
            if is_free:
                for x in range(c):
                    A[j, r, x] -= A[j, c, r] / own * A[j, c, x]
    return positive


@compiled(counted=False)
def resolve(A: Floats, j: int, low: int, high: int, G: Floats) -> None:
    """Accelerations and loads of coordinates that were eliminated, from those before them."""
    load = A.shape[2] - 1
    for c in range(low, high):
        for x in range(c):
            A[j, c, load] += A[j, c, x] * G[j, 0, x]
        a = G[j, 1, c]
        G[j, 0, c] = (a - A[j, c, load]) / A[j, c, c] if G[j, 2, c] != 0.0 else a
        A[j, c, load] += A[j, c, c] * G[j, 0, c]


@compiled(counted=False)
def load_body(
    arm: Arm, k: int, e: Floats, ev: Floats, spin: Vector, rest: Vector, work: Work
) -> bool:
    """Inertia and load of body k at zero accelerations of its coordinates, motion of its tip.

    False if it spins so fast that its elastic stiffness is not positive.
    """
    j, now, second, s, A, T = k + 1, work.now, arm.second, arm.start[k], work.A[k + 1], work.T
    load = A.shape[1] - 1
    w, dw, u, m = part(work.V, j, 6), part(work.V, j, 9), part(work.V, j, 12), arm.start[j] - s
    J, MS, M = inertia_of(work.body, k)
    U = rotation_acceleration(w, dw)
    F = add(scale(M, u), times(U, MS))
    N = add(add(cross(MS, u), inertia_times(J, dw)), cross(w, inertia_times(J, w)))
    ut = add(u, times(U, part(work.V, j, 3)))
    for i in range(m):
        c = s + i
        a, b, turn = part(now, c, 6), part(now, c, 9), moments_times(now, c, 0, w)
        force = dot(a, u) + dot(b, dw) - 0.5 * dot(w, turn)
        Ac, Bc = scale(2.0, cross(w, a)), add(turn, cross(w, b))
        G = scale(2.0, cross(w, part(now, c, 12)))
        for n in range(m):
            x, o, gyro = ev[s + n], 18 * n, part(second, c, 18 * n + 9)
            Ac = add(Ac, scale(x, part(second, c, o + 6)))
            Bc = add(Bc, scale(x, gyro))
            G = add(G, scale(x, part(second, c, o + 12)))
            force += x * dot(w, subtract(gyro, part(second, s + n, 18 * i + 9)))
            force += second[c, o + 16] * e[s + n] + second[c, o + 17] * x
            A[7 + i, 7 + n] = second[c, o + 15]
            softer = 0.5 * dot(w, moments_times(second, c, o, w))
            work.K[0, i, n] = second[c, o + 16] - softer
        F, N = add(F, scale(ev[c], Ac)), add(N, scale(ev[c], Bc))
        ut = add(ut, scale(ev[c], G))
        A[7 + i, load] = force
        for x in range(6):
            A[x, 7 + i] = A[7 + i, x] = now[c, 6 + x]
            T[j, x, 7 + i] = now[c, 12 + x]
    for x in range(3):
        A[x, load], A[x + 3, load] = F[x], N[x]
    put_part(work.V, j, 12, ut)
    put_part(work.V, j, 6, add(w, spin))
    put_part(work.V, j, 9, add(dw, add(cross(w, spin), rest)))
    transform(T, j, ONE, part(work.V, j, 3))
    for x in range(3):
        lever, column = cross(axis(x), MS), inertia_times(J, axis(x))
        for y in range(3):
            A[y, x] = M if x == y else 0.0
            A[y, x + 3] = A[x + 3, y] = lever[y]
            A[y + 3, x + 3] = column[y]
    column = arm.chain.joint[k]
    if column >= 0:  # the joint moves the root along or about z
        z, rotor = 5 - 3 * arm.chain.sigma[k], arm.drive[column, 0]
        if arm.deflection[column] >= 0:  # behind the spring
            rotor = 0.0
        for x in range(7 + m):
            A[6, x] = A[x, 6] = A[z, x]
        for x in range(6):
            T[j, x, 6] = T[j, x, z]
        A[6, 6], A[6, load] = A[z, z] + rotor, A[z, load]
    return eliminate(work.K, 0, 0, m, work.all)


LOADS = INT(ARM, MATRIX, MATRIX, MATRIX, MATRIX, kinds.INTS, WORK, OUT2, OUT2, kinds.OUT4)


@compiled(LOADS)
def loads(
    arm: Arm, y: Floats, dy: Floats, given: Floats, outer: Floats, free: Ints, work: Work,
    out: Floats, base: Floats, poses: Floats,
) -> int:  # fmt: skip
    """Accelerations of free coordinates under given loads, and loads of given accelerations."""
    f, n, t, first = arm.pi.shape[0], arm.deflection.shape[0], arm.end, -1
    g = transpose_times(whole_matrix(arm.chain.base_rotation), whole_vector(arm.gravity))
    A, G, I, e, ev = work.A, work.G, work.I, work.Q[0, n:], work.Q[1, n:]  # noqa: E741
    load = A.shape[2] - 1
    for i in range(y.shape[0]):
        to_links(arm, y, dy, given, i, free, work)
        w, MS, base[i, 9] = part(outer, i, 9), ZERO, 0.0
        put_part(work.V, 0, 6, w)
        put_part(work.V, 0, 9, part(outer, i, 15))
        put_part(work.V, 0, 12, subtract(add(cross(w, part(outer, i, 6)), part(outer, i, 12)), g))
        for k in range(f):
            j, b, column = k + 1, arm.chain.antecedent[k], arm.chain.joint[k]
            R, P = link_pose(arm.chain, k, work.Q, 0)
            R, P = product(matrix(work.R, b), R), times(matrix(work.R, b), P)
            W = product(matrix(work.W, b), R)
            x = add(part(work.V, b, 0), times(matrix(work.W, b), add(part(work.V, b, 3), P)))
            put_matrix(work.W, j, W)
            put_part(work.V, j, 0, x)
            put_pose(poses, i, k, W, x)
            body_at(arm, k, e, work)
            spin, rest = section_at(arm, k, e, ev, work)
            MS = add(MS, add(times(W, part(work.body, k, 6)), scale(work.body[k, 9], x)))
            if len(free):
                transform(work.X, j, R, P)
                wb, dwb, ub = part(work.V, b, 6), part(work.V, b, 9), part(work.V, b, 12)
                U, rate = rotation_acceleration(wb, dwb), coordinate(work.Q, 1, column)
                w, dw, u = link_acceleration(arm.chain.sigma[k], R, P, rate, 0.0, wb, dwb, U, ub)
                put_part(work.V, j, 6, w)
                put_part(work.V, j, 9, dw)
                put_part(work.V, j, 12, u)
                G[j, 1, 6] = coordinate(work.Q, 2, column)
                for c in range(arm.start[k], arm.start[j]):
                    G[j, 1, 7 + c - arm.start[k]] = work.Q[2, n + c]
                if not load_body(arm, k, e, ev, spin, rest, work):
                    base[i, 9] = 1.0
        W, lever = matrix(work.W, t), times(matrix(work.R, t), whole_vector(arm.tool))
        end = add(part(work.V, t, 0), times(W, add(part(work.V, t, 3), lever)))
        put_pose(poses, i, f, product(W, matrix(work.R, t)), end)
        base[i, 6], base[i, 7], base[i, 8] = MS
        if not len(free):
            continue
        for j in range(f + 1):
            for x in range(6):
                for z in range(7):
                    I[j, x, z] = 0.0
        F, N = transpose_times(W, part(outer, i, 0)), transpose_times(W, part(outer, i, 3))
        N = add(N, cross(lever, F))
        for x in range(3):
            I[t, x, 6], I[t, x + 3, 6] = F[x], N[x]
        for j in range(f, 0, -1):
            s = 7 + arm.start[j] - arm.start[j - 1]
            add_back(A, j, I, j, work.T, s, work.BT)
            own, positive = A[j, 6, 6], eliminate(A, j, 6, s, G)
            if G[j, 2, 6] != 0.0 and not abs(A[j, 6, 6]) > ROUNDING * own:
                first = i if first < 0 else first
            elif not positive:
                base[i, 9] = 2.0
            add_back(I, arm.chain.antecedent[j - 1], A, j, work.X, 6, work.BT)
        if not eliminate(I, 0, 0, 6, G):
            base[i, 9] = 2.0
        resolve(I, 0, 0, 6, G)
        for x in range(6):  # from here on the last columns are motions of the tips
            base[i, x] = G[0, 0, x] if free[n + 1] else I[0, x, 6]
            I[0, x, 6] = G[0, 0, x]
        for j in range(1, f + 1):
            s, column, b = arm.start[j - 1], arm.chain.joint[j - 1], arm.chain.antecedent[j - 1]
            high = 7 + arm.start[j] - s
            for x in range(6):
                G[j, 0, x] = 0.0
                for z in range(6):
                    G[j, 0, x] += work.X[j, x, z] * I[b, z, 6]
            resolve(A, j, 6, high, G)
            for x in range(6):
                I[j, x, 6] = 0.0
                for z in range(high):
                    I[j, x, 6] += work.T[j, x, z] * G[j, 0, z]
            if column >= 0:
                out[i, column] = G[j, 0, 6] if free[column] else A[j, 6, load]
            for c in range(7, high):
                out[i, n + s + c - 7] = G[j, 0, c] if free[n] else A[j, c, load]
        to_motors(arm, y, dy, given, i, free, out)
    return first


def address() -> int:
    """Where the compiled recursion is."""
    if not hasattr(loads, "overloads"):  # compilation is switched off
        return 0
    loads.compile(None)
    made = loads.overloads[LOADS.args]
    return made.library.get_pointer_to_function(made.fndesc.llvm_func_name)


@intrinsic
def at_address(typing: Any, place: Any, given: Any) -> Any:
    """`loads` at an address, its arguments in a tuple."""

    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        pairs = zip(cgutils.unpack_tuple(builder, values[1]), given.types, LOADS.args, strict=True)
        arguments = [context.cast(builder, *pair) for pair in pairs]
        kind, call = context.call_conv.get_function_type(INT, LOADS.args), context.call_conv
        pointer = builder.inttoptr(values[0], kind.as_pointer())
        return call.call_function(builder, pointer, INT, LOADS.args, arguments)[1]

    return INT(types.int64, given), code


recursion = at_address if hasattr(loads, "overloads") else lambda place, given: loads(*given)
