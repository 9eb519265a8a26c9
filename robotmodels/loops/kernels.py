"""Closures of cut loops: constraint rows, closing by Newton's method, reduced dynamics.

The rows of a closure are the position of its second frame in the first, and the rotation from the
first to the second (of the z axes alone for a revolute closure). With z and o the axis and origin
of a joint that carries one of the two frames, p the origin of the second frame and R the axes of
the first, its column of the Jacobian is ``+-R^T [z x (p - o); z]``.

Everything is made dimensionless by the robot's size. A QR factorisation of ``J^T`` with pivoting
gives the rank, the redundant rows and an orthonormal basis Z of the null space; with
``a = Z y - J^+ (dJ/dt v)`` the constraint forces do no work: ``Z^T (M a + h - tau) = 0``.
"""

from __future__ import annotations

from math import atan2, sqrt

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
from ..kernels._motion import carry_pose, coordinate, link_pose
from ..kernels._vectors import (
    Matrix,
    Vector,
    add,
    cross,
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
from ..kernels.mass import mass_matrices, solve_in_place
from ..kernels.torques import joint_torques
from .robot import Cuts

CUTS = types.NamedTuple((INTS, INTS, INTS, STACK, MATRIX, INTS, VECTOR, VECTOR), Cuts)
CLOSED, CANNOT_CLOSE, NOT_CONVERGED, SINGULAR_THERE = 0, 1, 2, 3
_CLOSED = 1e-13  # largest residual, relative to the robot's size (or rad)
_STATIONARY = 1e-9  # largest slope of the error, relative to the error
_FLAT = 1e-10  # least squared sine between the columns of the passive joints
_STEPS, _HEAVIEST = 60, 1e8  # of Newton; damping
RANK = 1e-8
"""Least pivot of an independent constraint row, relative to the largest."""


@compiled()
def tree_poses(q: Floats, i: int, chain: Chain, R: Floats, p: Floats) -> None:
    """World poses of sample i: R_0 in row 0, frame k in row k."""
    put_matrix(R, 0, whole_matrix(chain.base_rotation))
    put_vector(p, 0, whole_vector(chain.base_position))
    for k in range(chain.antecedent.shape[0]):
        Rj, Pj = link_pose(chain, k, q, i)
        carry_pose(chain, k, Rj, Pj, R, p)


@compiled()
def frame_of(cuts: Cuts, k: int, parent: int, R: Floats, p: Floats) -> tuple[Matrix, Vector]:
    """World pose of frame k of the closures."""
    Rb = matrix(R, parent)
    return product(Rb, matrix(cuts.rotation, k)), add(
        vector(p, parent), times(Rb, vector(cuts.position, k))
    )


@compiled()
def rotation_error(rows: int, E: Matrix) -> Vector:
    """Rotation vector of E, or for five rows that of its z axis."""
    if rows == 5:
        x, y, z = -E[5], E[2], 0.0
        cosine = E[8]
    else:
        x, y, z = 0.5 * (E[7] - E[5]), 0.5 * (E[2] - E[6]), 0.5 * (E[3] - E[1])
        cosine = 0.5 * (E[0] + E[4] + E[8] - 1.0)
    sine = sqrt(x * x + y * y + z * z)
    if sine < 1e-8:
        if cosine > 0.0:
            return x, y, z
        return np.pi, 0.0, 0.0
    grow = atan2(sine, cosine) / sine
    return grow * x, grow * y, grow * z


@compiled()
def closure_rows(chain: Chain, cuts: Cuts, R: Floats, p: Floats, e: Floats, J: Floats) -> None:
    """Residuals and Jacobian of all closures at given poses. Shapes: e (c,), J (c, n)."""
    n = J.shape[1]
    at = 0
    for k in range(cuts.rows.shape[0]):
        Ra, pa = frame_of(cuts, 2 * k, cuts.first[k], R, p)
        Rb, pb = frame_of(cuts, 2 * k + 1, cuts.second[k], R, p)
        rows = cuts.rows[k]
        d = transpose_times(Ra, subtract(pb, pa))
        for x in range(3):
            e[at + x] = d[x]
        if rows > 3:
            d = rotation_error(rows, relative(Ra, Rb))
            for x in range(3, rows):
                e[at + x] = d[x - 3]
        for m in range(chain.joint.shape[0]):
            j = chain.joint[m]
            if j < 0:
                continue
            side = float(cuts.side[k * n + j])
            if side == 0.0:
                for x in range(rows):
                    J[at + x, j] = 0.0
                continue
            z = scale(side, (R[m + 1, 0, 2], R[m + 1, 1, 2], R[m + 1, 2, 2]))
            linear, angular = z, (0.0, 0.0, 0.0)
            if chain.sigma[m] == 0:
                linear = cross(z, subtract(pb, vector(p, m + 1)))
                angular = transpose_times(Ra, z)
            linear = transpose_times(Ra, linear)
            for x in range(3):
                J[at + x, j] = linear[x]
            for x in range(3, rows):
                J[at + x, j] = angular[x - 3]
        at += rows


@compiled()
def relative(Ra: Matrix, Rb: Matrix) -> Matrix:
    """Rotation matrix of frame b in frame a."""
    x = transpose_times(Ra, (Rb[0], Rb[3], Rb[6]))
    y = transpose_times(Ra, (Rb[1], Rb[4], Rb[7]))
    z = transpose_times(Ra, (Rb[2], Rb[5], Rb[8]))
    return x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]


@compiled()
def tree_velocities(
    v: Floats, i: int, chain: Chain, R: Floats, p: Floats, w: Floats, u: Floats
) -> None:
    """Angular velocities and velocities of the origins of all frames, world axes, rows as poses."""
    for x in range(3):
        w[0, x] = u[0, x] = 0.0
    for k in range(chain.antecedent.shape[0]):
        b = chain.antecedent[k]
        wb = vector(w, b)
        rate = coordinate(v, i, chain.joint[k])
        motion = scale(rate, (R[k + 1, 0, 2], R[k + 1, 1, 2], R[k + 1, 2, 2]))
        carried = add(vector(u, b), cross(wb, subtract(vector(p, k + 1), vector(p, b))))
        if chain.sigma[k] == 0:
            put_vector(w, k + 1, add(wb, motion))
            put_vector(u, k + 1, carried)
        else:
            put_vector(w, k + 1, wb)
            put_vector(u, k + 1, add(carried, motion))


@compiled()
def closure_rates(
    chain: Chain, cuts: Cuts, R: Floats, p: Floats, w: Floats, u: Floats, dJ: Floats
) -> None:
    """Time derivative of the Jacobian of `closure_rows`. Shape: dJ (c, n)."""
    n = dJ.shape[1]
    at = 0
    for k in range(cuts.rows.shape[0]):
        a, b = cuts.first[k], cuts.second[k]
        Ra = product(matrix(R, a), matrix(cuts.rotation, 2 * k))
        arm = times(matrix(R, b), vector(cuts.position, 2 * k + 1))
        pb, ub = add(vector(p, b), arm), add(vector(u, b), cross(vector(w, b), arm))
        wa = vector(w, a)
        rows = cuts.rows[k]
        for m in range(chain.joint.shape[0]):
            j = chain.joint[m]
            if j < 0:
                continue
            side = float(cuts.side[k * n + j])
            z = scale(side, (R[m + 1, 0, 2], R[m + 1, 1, 2], R[m + 1, 2, 2]))
            dz = cross(vector(w, m + 1), z)
            linear, change = z, dz
            if chain.sigma[m] == 0:
                lever = subtract(pb, vector(p, m + 1))
                linear = cross(z, lever)
                change = add(cross(dz, lever), cross(z, subtract(ub, vector(u, m + 1))))
            change = transpose_times(Ra, subtract(change, cross(wa, linear)))
            turned = transpose_times(Ra, subtract(dz, cross(wa, z)))
            for x in range(3):
                dJ[at + x, j] = change[x]
            for x in range(3, rows):
                dJ[at + x, j] = turned[x - 3] if chain.sigma[m] == 0 else 0.0
        at += rows


@compiled(NOTHING(MATRIX, MATRIX, CHAIN, CUTS, OUT2, OUT3, OUT3))
def closure_jacobians(
    q: Floats, v: Floats, chain: Chain, cuts: Cuts, e: Floats, J: Floats, dJ: Floats
) -> None:
    """Residuals (N, c), their Jacobians and the rates of these (N, c, n) along v (N, n)."""
    f = chain.antecedent.shape[0]
    R, p = np.empty((f + 1, 3, 3)), np.empty((f + 1, 3))
    w, u = np.empty((f + 1, 3)), np.empty((f + 1, 3))
    for i in range(q.shape[0]):
        tree_poses(q, i, chain, R, p)
        closure_rows(chain, cuts, R, p, e[i], J[i])
        tree_velocities(v, i, chain, R, p, w, u)
        closure_rates(chain, cuts, R, p, w, u, dJ[i])


# --- closing -------------------------------------------------------------------------------------


@compiled()
def dimensionless(cuts: Cuts, e: Floats, J: Floats) -> None:
    """Divide position rows by the robot's size, and multiply columns by the joints' units."""
    length = cuts.length[0]
    at = 0
    for k in range(cuts.rows.shape[0]):
        for x in range(cuts.rows[k]):
            size = length if x < 3 else 1.0
            e[at] /= size
            for j in range(J.shape[1]):
                J[at, j] *= cuts.units[j] / size
            at += 1


@compiled()
def squared_norm(e: Floats) -> float:
    """Sum of squares."""
    total = 0.0
    for k in range(e.shape[0]):
        total += e[k] * e[k]
    return total


@compiled()
def normal_equations(J: Floats, e: Floats, passive: Ints, N: Floats, g: Floats, D: Floats) -> float:
    """Normal matrix of the passive columns, scaled to unit diagonal, and gradient; its largest."""
    steepest = 0.0
    for a in range(passive.shape[0]):
        total = 0.0
        slope = 0.0
        for row in range(e.shape[0]):
            total += J[row, passive[a]] * J[row, passive[a]]
            slope += J[row, passive[a]] * e[row]
        D[a] = sqrt(total) if total > 0.0 else 1.0
        g[a] = slope / D[a]
        N[a, a] = total / (D[a] * D[a])
        steepest = max(steepest, abs(g[a]))
        for b in range(a):
            total = 0.0
            for row in range(e.shape[0]):
                total += J[row, passive[a]] * J[row, passive[b]]
            N[a, b] = N[b, a] = total / (D[a] * D[b])
    return steepest


@compiled()
def damped_step(N: Floats, g: Floats, damping: float, L: Floats, x: Floats) -> float:
    """Solve ``(N + damping 1) x = -g`` by Cholesky; the least pivot, without x where it is zero."""
    m = g.shape[0]
    least = 1.0
    for a in range(m):
        for b in range(a + 1):
            total = N[a, b] + (damping if a == b else 0.0)
            for k in range(b):
                total -= L[a, k] * L[b, k]
            if a == b:
                least = min(least, total)
                if not total > 1e-15:
                    return 0.0
                L[a, a] = sqrt(total)
            else:
                L[a, b] = total / L[b, b]
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


@compiled(NOTHING(CHAIN, CUTS, INTS, OUT2, OUT1, OUT1))
def closed_postures(
    chain: Chain, cuts: Cuts, passive: Ints, q: Floats, residual: Floats, status: Floats
) -> None:
    """Close the loops by damped Newton steps of the passive joints, from the posture in each row.

    Shapes: passive (m,), q (N, n) -> q, residual (N,), status (N,).
    """
    f, n, m = chain.antecedent.shape[0], q.shape[1], passive.shape[0]
    c = 0
    for k in range(cuts.rows.shape[0]):
        c += cuts.rows[k]
    R, p = np.empty((f + 1, 3, 3)), np.empty((f + 1, 3))
    e, J = np.empty(c), np.empty((c, n))
    N, L = np.empty((m, m)), np.empty((m, m))
    g, D, x = np.empty(m), np.empty(m), np.empty(m)
    start = np.empty(m)
    for i in range(q.shape[0]):
        tree_poses(q, i, chain, R, p)
        closure_rows(chain, cuts, R, p, e, J)
        dimensionless(cuts, e, J)
        cost = squared_norm(e)
        damping = 0.0
        status[i] = NOT_CONVERGED
        for _ in range(_STEPS):
            steepest = normal_equations(J, e, passive, N, g, D)
            least = damped_step(N, g, 0.0, L, x)
            if cost <= _CLOSED * _CLOSED:
                status[i] = CLOSED if least > _FLAT else SINGULAR_THERE
                break
            if steepest <= _STATIONARY * sqrt(cost):
                status[i] = CANNOT_CLOSE
                break
            for a in range(m):
                start[a] = q[i, passive[a]]
            while True:
                if damping > 0.0 or not least > _FLAT:
                    damping = max(damping, 1e-6)
                    damped_step(N, g, damping, L, x)
                for a in range(m):
                    q[i, passive[a]] = start[a] + x[a] / D[a] * cuts.units[passive[a]]
                tree_poses(q, i, chain, R, p)
                closure_rows(chain, cuts, R, p, e, J)
                dimensionless(cuts, e, J)
                again = squared_norm(e)
                if again < cost:
                    damping = damping * 0.1 if damping > 1e-6 else 0.0
                    break
                damping = max(damping * 10.0, 1e-4)
                if damping > _HEAVIEST:
                    break
            if not again < cost:
                # no step decreases the error: rounding, or a minimum
                for a in range(m):
                    q[i, passive[a]] = start[a]
                status[i] = CANNOT_CLOSE
                break
            cost = again
        tree_poses(q, i, chain, R, p)
        closure_rows(chain, cuts, R, p, e, J)
        residual[i] = largest(e)


@compiled()
def largest(e: Floats) -> float:
    """Largest absolute value."""
    most = 0.0
    for k in range(e.shape[0]):
        most = max(most, abs(e[k]))
    return most


# --- null space of the constraints ---------------------------------------------------------------


@compiled()
def factorise(J: Floats, most: int, A: Floats, order: Ints, beta: Floats, diagonal: Floats) -> int:
    """Factorise ``J^T = Q R`` with pivoting; the rank, at most ``most``.

    Reflectors are left in A (n, c) with ``beta``, R above its diagonal; ``order`` has the rows.
    """
    c, n = J.shape
    for k in range(c):
        order[k] = k
        for j in range(n):
            A[j, k] = J[k, j]
    rank = 0
    while rank < min(c, n, most):
        pivot, longest = rank, 0.0
        for k in range(rank, c):
            total = 0.0
            for j in range(rank, n):
                total += A[j, k] * A[j, k]
            if total > longest * (1.0 + 1e-6):  # of equal rows the first one
                pivot, longest = k, total
        if rank == 0:
            diagonal[0] = sqrt(longest)
        if not sqrt(longest) > RANK * abs(diagonal[0]):
            break
        order[rank], order[pivot] = order[pivot], order[rank]
        for j in range(n):
            A[j, rank], A[j, pivot] = A[j, pivot], A[j, rank]
        head = A[rank, rank]
        alpha = -sqrt(longest) if head > 0.0 else sqrt(longest)
        diagonal[rank] = alpha
        beta[rank] = 1.0 / (alpha * (alpha - head))
        A[rank, rank] = head - alpha
        for k in range(rank + 1, c):
            reflect(A, rank, beta, A, k)
        rank += 1
    return rank


@compiled()
def reflect(A: Floats, r: int, beta: Floats, X: Floats, column: int) -> None:
    """Apply reflector r to a column of X (n, ...)."""
    total = 0.0
    for j in range(r, A.shape[0]):
        total += A[j, r] * X[j, column]
    total *= beta[r]
    for j in range(r, A.shape[0]):
        X[j, column] -= total * A[j, r]


@compiled()
def null_basis(A: Floats, beta: Floats, rank: int, Z: Floats) -> None:
    """Orthonormal basis of the null space of J, in the first n - rank columns of Z (n, n)."""
    n = A.shape[0]
    for column in range(n - rank):
        for j in range(n):
            Z[j, column] = 1.0 if j == rank + column else 0.0
        for r in range(rank - 1, -1, -1):
            reflect(A, r, beta, Z, column)


@compiled()
def particular(
    A: Floats, beta: Floats, diagonal: Floats, order: Ints, rank: int, b: Floats, x: Floats
) -> None:
    """Shortest x with ``J x = b`` in the independent rows. Shapes: b (c,), x (n, 1)."""
    for k in range(A.shape[0]):
        x[k, 0] = 0.0
    for k in range(rank):
        total = b[order[k]]
        for r in range(k):
            total -= A[r, k] * x[r, 0]
        x[k, 0] = total / diagonal[k]
    for r in range(rank - 1, -1, -1):
        reflect(A, r, beta, x, 0)


@compiled()
def multipliers(
    A: Floats, beta: Floats, diagonal: Floats, order: Ints, rank: int, x: Floats, b: Floats
) -> None:
    """Forces b (c,) with ``J^T b = x`` (n, 1), none in the redundant rows; x is overwritten."""
    for k in range(b.shape[0]):
        b[k] = 0.0
    for r in range(rank):
        reflect(A, r, beta, x, 0)
    for k in range(rank - 1, -1, -1):
        total = x[k, 0]
        for r in range(k + 1, rank):
            total -= A[k, r] * b[order[r]]
        b[order[k]] = total / diagonal[k]


@compiled(NOTHING(MATRIX, MATRIX, CHAIN, CUTS, OUT3, OUT3, OUT2))
def motion_bases(
    q: Floats, v: Floats, chain: Chain, cuts: Cuts, Z: Floats, B: Floats, redundant: Floats
) -> None:
    """Bases Z of the null space of J, vectors B with ``J B = -dJ/dt Z``, and redundant rows (1).

    Shapes: q, v (N, n) -> Z, B (N, n, n), of which as many columns as the mobility; (N, c).
    """
    f, n, c = chain.antecedent.shape[0], q.shape[1], redundant.shape[1]
    R, p = np.empty((f + 1, 3, 3)), np.empty((f + 1, 3))
    w, u = np.empty((f + 1, 3)), np.empty((f + 1, 3))
    e, J, dJ, A = np.empty(c), np.empty((c, n)), np.empty((c, n)), np.empty((n, c))
    order, beta, diagonal = np.empty(c, np.int64), np.empty(c + 1), np.empty(c + 1)
    x = np.empty((n, 1))
    for i in range(q.shape[0]):
        tree_poses(q, i, chain, R, p)
        closure_rows(chain, cuts, R, p, e, J)
        tree_velocities(v, i, chain, R, p, w, u)
        closure_rates(chain, cuts, R, p, w, u, dJ)
        dimensionless(cuts, e, J)
        dimensionless(cuts, e, dJ)
        rank = factorise(J, c, A, order, beta, diagonal)
        for k in range(c):
            redundant[i, order[k]] = 1.0 if k >= rank else 0.0
        null_basis(A, beta, rank, Z[i])
        for column in range(n - rank):
            for k in range(c):
                e[k] = 0.0
                for j in range(n):
                    e[k] -= dJ[k, j] * Z[i, j, column]
            particular(A, beta, diagonal, order, rank, e, x)
            for j in range(n):
                B[i, j, column] = x[j, 0] * cuts.units[j]
            for j in range(n):
                Z[i, j, column] *= cuts.units[j]


@compiled(INT(MATRIX, MATRIX, MATRIX, CHAIN, MATRIX, VECTOR, MATRIX, CUTS, INT, OUT2, OUT2))
def loop_accelerations(
    q: Floats,
    v: Floats,
    tau: Floats,
    chain: Chain,
    pi: Floats,
    gravity: Floats,
    rotor: Floats,
    cuts: Cuts,
    most: int,
    out: Floats,
    forces: Floats,
) -> int:
    """Accelerations and constraint forces; the first sample without unique accelerations, or -1.

    Shapes: q, v, tau (N, n), rotor (n, n) -> out (N, n), forces (N, c). ``most`` bounds the rank.
    """
    samples, n = q.shape
    f, c = chain.antecedent.shape[0], forces.shape[1]
    R, p = np.empty((f + 1, 3, 3)), np.empty((f + 1, 3))
    w, u = np.empty((f + 1, 3)), np.empty((f + 1, 3))
    e, J, dJ, A = np.empty(c), np.empty((c, n)), np.empty((c, n)), np.empty((n, c))
    order, beta, diagonal = np.empty(c, np.int64), np.empty(c + 1), np.empty(c + 1)
    Z, x, MZ = np.empty((n, n)), np.empty((n, 1)), np.empty(n)
    h, M, still = np.empty((1, n)), np.empty((1, n, n)), np.zeros((1, n))
    S, y, sizes, scratch = np.empty((1, n, n)), np.empty((1, n)), np.empty(n), np.empty(n)
    failed = -1
    for i in range(samples):
        joint_torques(q[i : i + 1], v[i : i + 1], still, chain, pi, gravity, h)
        mass_matrices(q[i : i + 1], chain, pi, M)
        tree_poses(q, i, chain, R, p)
        closure_rows(chain, cuts, R, p, e, J)
        tree_velocities(v, i, chain, R, p, w, u)
        closure_rates(chain, cuts, R, p, w, u, dJ)
        for k in range(c):
            e[k] = 0.0
            for j in range(n):
                e[k] -= dJ[k, j] * v[i, j]
        dimensionless(cuts, e, J)
        rank = factorise(J, most, A, order, beta, diagonal)
        particular(A, beta, diagonal, order, rank, e, x)
        null_basis(A, beta, rank, Z)
        m = n - rank
        if S.shape[1] != m:
            S, y, sizes, scratch = np.empty((1, m, m)), np.empty((1, m)), np.empty(m), np.empty(m)
        # everything in dimensionless coordinates, q = units x
        for j in range(n):
            h[0, j] = (tau[i, j] - h[0, j]) * cuts.units[j]
            for k in range(n):
                M[0, j, k] = (M[0, j, k] + rotor[j, k]) * cuts.units[j] * cuts.units[k]
        for a in range(m):
            y[0, a] = 0.0
            for j in range(n):
                MZ[j] = 0.0
                for k in range(n):
                    MZ[j] += M[0, j, k] * Z[k, a]
                y[0, a] += Z[j, a] * h[0, j] - MZ[j] * x[j, 0]
            for b in range(m):
                S[0, a, b] = 0.0
                for j in range(n):
                    S[0, a, b] += MZ[j] * Z[j, b]
        bad = m > 0 and solve_in_place(S, y, 0, sizes, scratch) == 2
        if bad and failed < 0:
            failed = i
        for j in range(n):
            for a in range(m):
                x[j, 0] += Z[j, a] * y[0, a]
            out[i, j] = np.nan if bad else x[j, 0] * cuts.units[j]
        for j in range(n):
            MZ[j] = -h[0, j]
            for k in range(n):
                MZ[j] += M[0, j, k] * x[k, 0]
        for j in range(n):
            x[j, 0] = MZ[j]
        multipliers(A, beta, diagonal, order, rank, x, e)
        at = 0
        for k in range(cuts.rows.shape[0]):
            for row in range(cuts.rows[k]):
                size = cuts.length[0] if row < 3 else 1.0
                forces[i, at] = np.nan if bad else e[at] / size
                at += 1
    return failed
