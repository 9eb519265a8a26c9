"""Compiled: from the eigenvalues of `elimination` back to solutions, polished on the exact chain.

An eigenvalue is joint 2. The null vector of the 12 x 12 matrix there holds the products of joints
3 and 4, the removed equations give joints 0 and 1, and joint 5 closes the loop.
"""

from __future__ import annotations

from math import atan2, cos, pi, sin, sqrt

import numpy as np
from numba import types
from numpy.typing import NDArray

from ...kernels._compile import (
    INT,
    INTS,
    NOTHING,
    OUT2,
    OUT3,
    STACK,
    VECTOR,
    Floats,
    Ints,
    compiled,
)
from ...kernels.linear_systems import factor, solve
from .chain import forward, jacobian, pose_error, wrapped
from .elimination import LINKS, PARTS, Parts, at_angle, move_line, turn_line

FORM = types.Tuple((INTS, INTS, types.float64, INT))
COMPLEX = types.Array(types.complex128, 2, "C")
OUT = types.Tuple((OUT3, types.Array(types.int64, 1, "C"), OUT2))
NEARLY_REAL = 2e-2  # imaginary part of an angle up to which its real part is tried [rad]
MERGED = 1e-3  # imaginary part up to which a pair counts as a double root that rounding split [rad]
MERGE = 1e-6  # solutions closer than this in every joint are the same [rad, or arm lengths]


@compiled()
def normalised(x: Floats) -> float:
    """Scale x to length one, in place; its length."""
    largest, total = 0.0, 0.0
    for i in range(x.shape[0]):
        largest = max(largest, abs(x[i]))
    if largest == 0.0:
        return 0.0
    for i in range(x.shape[0]):
        x[i] /= largest
        total += x[i] * x[i]
    for i in range(x.shape[0]):
        x[i] /= sqrt(total)
    return sqrt(total) * largest


@compiled()
def smallest_vectors(A: Floats, pivots: Ints, u: Floats, v: Floats) -> float:
    """Singular vectors ``A v = s u`` of the smallest singular value s, from LU factors."""
    n = v.shape[0]
    s = 0.0
    for i in range(n):
        v[i] = 1.0 + 0.1 * i
    for _ in range(3):
        # A^T u = v
        for i in range(n):
            u[i] = v[i]
            for k in range(i):
                u[i] -= A[k, i] * u[k]
            u[i] /= A[i, i]
        for i in range(n - 1, -1, -1):
            for k in range(i + 1, n):
                u[i] -= A[k, i] * u[k]
        for k in range(n - 1, -1, -1):
            p = pivots[k]
            u[k], u[p] = u[p], u[k]
        normalised(u)
        for i in range(n):
            v[i] = u[i]
        solve(A, pivots, v)
        length = normalised(v)
        s = 1.0 / length if length > 0.0 else 0.0
    return s


@compiled()
def two_factors(V: Floats, u: Floats, w: Floats) -> None:
    """Leading factors of ``V (12,)`` seen as 4 x 3: V is about u w^T."""
    best, largest = 0, -1.0
    for i in range(4):
        size = V[3 * i] ** 2 + V[3 * i + 1] ** 2 + V[3 * i + 2] ** 2
        if size > largest:
            best, largest = i, size
    for j in range(3):
        w[j] = V[3 * best + j]
    for _ in range(3):
        for i in range(4):
            u[i] = V[3 * i] * w[0] + V[3 * i + 1] * w[1] + V[3 * i + 2] * w[2]
        normalised(u)
        for j in range(3):
            w[j] = V[j] * u[0] + V[3 + j] * u[1] + V[6 + j] * u[2] + V[9 + j] * u[3]


@compiled()
def basis(kind: int, value: float, b: Floats) -> None:
    """(1, cos, sin) or (1, r, r^2) of a joint into b (3,)."""
    b[0] = 1.0
    b[1] = value if kind == 1 else cos(value)
    b[2] = value * value if kind == 1 else sin(value)


@compiled()
def back_substitute(
    kinds: Ints, G: Floats, P: Floats, Q: Floats, order: Ints, angles: Floats
) -> None:
    """Joints 0, 1 and 5 of the loop from joints 2, 3, 4 in ``angles (6,)``, in place."""
    b, y, x, line = np.empty((3, 3)), np.empty(8), np.empty(8), np.empty(6)
    for j in range(3):
        basis(kinds[2 + j], angles[2 + j], b[j])
    for i in range(7, -1, -1):
        y[i] = 0.0
        for k in range(27):
            y[i] += P[i, k] * b[0, k // 9] * b[1, k // 3 % 3] * b[2, k % 3]
        for k in range(i + 1, 8):
            y[i] -= Q[i, k] * y[k]
        y[i] = y[i] / Q[i, i] if Q[i, i] != 0.0 else 0.0
        x[order[i]] = y[i]
    # products in the order (0,1) (0,2) (1,0) (1,1) (1,2) (2,0) (2,1) (2,2) of joints 0 and 1
    angles[0] = x[2] if kinds[0] == 1 else atan2(x[5], x[2])
    angles[1] = x[0] if kinds[1] == 1 else atan2(x[1], x[0])
    # M_5 turns the x axis of its frame to what the other five joints make of it
    for i in range(6):
        line[i] = 1.0 if i == 3 else 0.0
    move_line(G[5], True, line)
    for k in range(5):
        turn_line(kinds[k], -angles[k], line)
        move_line(G[k], True, line)
    angles[5] = atan2(line[4], line[3])


@compiled()
def newton(sigma: Ints, D: Floats, U: Floats, tolerance: Floats, q: Floats) -> bool:
    """Newton's method from q (6,), in place, until rounding stops it; whether the pose is met.

    At double roots convergence is linear: steps go on while the error keeps falling.
    """
    T, lines, J = np.empty((3, 4)), np.empty((6, 6)), np.empty((6, 6))
    e, best, pivots = np.empty(6), np.empty(6), np.empty(6, np.int64)
    least, met, worse = np.inf, False, 0
    for count in range(40):
        forward(sigma, D, q, T, lines)
        position, angle = pose_error(U, T, e)
        error = max(position, angle)
        if error > 0.7 * least:
            worse += 1
        if error < least:
            least, met = error, position <= tolerance[0] and angle <= tolerance[1]
            for k in range(6):
                best[k] = q[k]
        if error < 1e-16 or worse >= (2 if met else 4) or (count >= 15 and least > 1e-5):
            break
        jacobian(sigma, T, lines, J)
        factor(J, pivots)
        solve(J, pivots, e)
        largest = 0.0
        for k in range(6):
            largest = max(largest, abs(e[k]))
        if not largest < 1e100:
            break
        for k in range(6):
            q[k] += min(1.0, 0.7 / largest) * e[k]
    for k in range(6):
        q[k] = best[k] if sigma[k] == 1 else wrapped(best[k])
    return met


@compiled()
def distance(sigma: Ints, a: Floats, b: Floats) -> float:
    """Largest difference of two configurations over the joints."""
    largest = 0.0
    for k in range(6):
        d = a[k] - b[k]
        largest = max(largest, abs(wrapped(d) if sigma[k] == 0 else d))
    return largest


@compiled()
def keep(sigma: Ints, q: Floats, found: Floats, count: int) -> int:
    """Add q (6,) to ``found (S, 6)`` unless it is there; the new number."""
    for k in range(count):
        if distance(sigma, q, found[k]) <= MERGE:
            return count
    if count < found.shape[0]:
        for k in range(6):
            found[count, k] = q[k]
        count += 1
    return count


@compiled(NOTHING(INTS, STACK, STACK, VECTOR, FORM, LINKS, COMPLEX, PARTS, OUT))
def solutions_of_eigenvalues(
    sigma: Ints,
    D: Floats,
    poses: Floats,
    tolerance: Floats,
    form: tuple[Ints, Ints, float, int],
    links: Floats,
    eigenvalues: NDArray[np.complex128],
    parts: Parts,
    out: tuple[Floats, Ints, Floats],
) -> None:
    """Follow eigenvalues back to configurations, polish them and keep those not found before.

    ``form``: kinds, joints, direction, swapped; ``out``: solutions, counts and report (N, 2).
    """
    # the report receives the number of real eigenvalues, nearly real pairs included, and the
    # largest distance by which polishing moved the solution of a real one [rad]
    (kinds, joints, direction, swapped), (found, count, report) = form, out
    P, Q, order, angle, _ = parts
    kind_nu = kinds[4] if swapped else kinds[3]
    kind_mu = kinds[3] if swapped else kinds[4]
    A, pivots = np.empty((12, 12)), np.empty(12, np.int64)
    u12, v12, u, w = np.empty(12), np.empty(12), np.empty(4), np.empty(3)
    angles, q, start = np.empty(6), np.empty(6), np.empty(6)
    for n in range(poses.shape[0]):
        real, moved = 0.0, 0.0
        for r in range(16):
            t = eigenvalues[n, r]
            imaginary = 2.0 * abs(t.imag) / (1.0 + t.real * t.real + t.imag * t.imag)
            # of a conjugate pair one is tried
            if t.imag < 0.0 or not imaginary <= NEARLY_REAL:
                continue
            if imaginary <= MERGED:
                real += 1.0 if t.imag == 0.0 else 2.0
            angles[2] = angle[n] + 2.0 * atan2(t.real, 1.0)
            at_angle(P[n], kind_nu, swapped, angles[2], A)
            factor(A, pivots)
            smallest_vectors(A, pivots, u12, v12)
            two_factors(v12, u, w)
            if kind_nu == 1:
                nu = u[1] / u[0] if abs(u[0]) > abs(u[3]) else u[3] / u[2]
            else:
                nu = 2.0 * atan2(u[1], u[0])
            if kind_mu == 1:
                mu = w[1] / w[0] if abs(w[0]) > abs(w[2]) else w[2] / w[1]
            else:
                mu = atan2(w[2], w[1]) + (0.0 if w[0] > 0.0 else pi)
            angles[3] = mu if swapped else nu
            angles[4] = nu if swapped else mu
            back_substitute(kinds, links[n], P[n], Q[n], order[n], angles)
            finite = True
            for k in range(6):
                finite = finite and abs(angles[k]) < 1e6
                start[joints[k]] = direction * angles[k]
                q[joints[k]] = direction * angles[k]
            if not finite:
                continue
            if newton(sigma, D, poses[n], tolerance, q):
                if t.imag == 0.0:
                    moved = max(moved, distance(sigma, start, q))
                count[n] = keep(sigma, q, found[n], count[n])
            elif t.imag == 0.0:
                moved = np.inf
        report[n, 0], report[n, 1] = real, moved
