"""Compiled direct models: Newton's method for any legs of known length, the sextic of planar ones.

A mechanism with its actuators locked is a platform on m rods: rod i of length l_i joins the point
c_i of the base and b_i of the platform. ``columns`` are the components of the twist that the
platform has, as many as rods.
"""

from math import cos, pi, sin, sqrt

import numpy as np

from ..kernels._compile import (
    INTS,
    MATRIX,
    NOTHING,
    OUT2,
    OUT3,
    OUT4,
    STACK,
    Floats,
    Ints,
    compiled,
)
from ..kernels.continuation import factor, solve

CONVERGED, NOT_CONVERGED, LEFT_THE_MODE = 0, 1, 2
_ITERATIONS = 50
_LAST = 1e-8  # a Newton step this small, relative, is the last one
_PIECES = 400
_FINEST = 1e-5
_FAR = 0.02  # largest change of a rotation by polishing


@compiled()
def errors(T: Floats, c: Floats, b: Floats, columns: Ints, length: Floats, J: Floats) -> None:
    """Lengths of rods and their derivatives by the platform's twist.

    Shapes: T (4, 4), c, b (m, 3) -> length (m,), J (m, m).
    """
    for i in range(b.shape[0]):
        x = T[0, 0] * b[i, 0] + T[0, 1] * b[i, 1] + T[0, 2] * b[i, 2]
        y = T[1, 0] * b[i, 0] + T[1, 1] * b[i, 1] + T[1, 2] * b[i, 2]
        z = T[2, 0] * b[i, 0] + T[2, 1] * b[i, 1] + T[2, 2] * b[i, 2]
        u, v, w = T[0, 3] + x - c[i, 0], T[1, 3] + y - c[i, 1], T[2, 3] + z - c[i, 2]
        size = sqrt(u * u + v * v + w * w)
        length[i] = size
        if size > 0.0:
            u, v, w = u / size, v / size, w / size
        row = (u, v, w, y * w - z * v, z * u - x * w, x * v - y * u)
        for j in range(columns.size):
            J[i, j] = row[columns[j]]


@compiled()
def displace(T: Floats, columns: Ints, step: Floats) -> None:
    """Move a pose by a small screw about its origin, in place."""
    x, y, z = 0.0, 0.0, 0.0
    for j in range(columns.size):
        if columns[j] < 3:
            T[columns[j], 3] += step[j]
        elif columns[j] == 3:
            x = step[j]
        elif columns[j] == 4:
            y = step[j]
        else:
            z = step[j]
    angle = sqrt(x * x + y * y + z * z)
    if angle == 0.0:
        return
    s, h = sin(angle) / angle, 2.0 * (sin(0.5 * angle) / angle) ** 2
    for k in range(3):
        a, b, c = T[0, k], T[1, k], T[2, k]
        p, q, r = y * c - z * b, z * a - x * c, x * b - y * a
        T[0, k] = a + s * p + h * (y * r - z * q)
        T[1, k] = b + s * q + h * (z * p - x * r)
        T[2, k] = c + s * r + h * (x * q - y * p)


@compiled()
def determinant(J: Floats, pivots: Ints) -> float:
    """Determinant of a matrix, which is replaced by its factors."""
    factor(J, pivots)
    total = 1.0
    for k in range(J.shape[0]):
        total *= -J[k, k] if pivots[k] != k else J[k, k]
    return total


@compiled()
def newton(
    T: Floats,
    c: Floats,
    b: Floats,
    rods: Floats,
    columns: Ints,
    J: Floats,
    work: Floats,
    pivots: Ints,
) -> int:
    """Newton's method on the pose, in place: iterations, negative where it does not converge."""
    m = b.shape[0]
    size = 0.0
    for i in range(m):
        size = max(size, abs(rods[i]), abs(b[i, 0]), abs(b[i, 1]), abs(b[i, 2]))
    best = 1e300
    for iteration in range(1, _ITERATIONS + 1):
        errors(T, c, b, columns, work, J)
        factor(J, pivots)
        rest = 0.0
        for i in range(m):
            work[i] = rods[i] - work[i]
            rest = max(rest, abs(work[i]))
        solve(J, pivots, work, False)
        step = 0.0
        for j in range(m):
            part = abs(work[j]) / (size if columns[j] < 3 else 1.0)
            step = max(step, part)
        if not step < 1e300:
            return -iteration
        if step > 1.0:
            for j in range(m):
                work[j] /= step
        displace(T, columns, work)
        if step < _LAST:
            return iteration
        # a double solution: linear convergence, until rounding
        if rest < 1e-15 * size and rest >= best:
            return iteration
        best = min(best, rest)
    return -_ITERATIONS


@compiled()
def worst_error(
    T: Floats, c: Floats, b: Floats, rods: Floats, columns: Ints, work: Floats, J: Floats
) -> float:
    """Largest error of a rod's length."""
    errors(T, c, b, columns, work, J)
    worst = 0.0
    for i in range(rods.size):
        worst = max(worst, abs(work[i] - rods[i]))
    return worst


@compiled()
def copy_pose(A: Floats, B: Floats) -> None:
    """Write pose A into B."""
    for i in range(4):
        for j in range(4):
            B[i, j] = A[i, j]


@compiled(NOTHING(STACK, MATRIX, MATRIX, STACK, INTS, OUT3, OUT2))
def direct(
    c: Floats,
    b: Floats,
    rods: Floats,
    T0: Floats,
    columns: Ints,
    T: Floats,
    out: Floats,
) -> None:
    """Poses near T0 by Newton's method, else by continuation of the lengths.

    Shapes: c (N, m, 3), b (m, 3), rods (N, m), T0 (N, 4, 4) -> T (N, 4, 4), out (N, 4): code,
    iterations, residual, determinant.
    """
    m = b.shape[0]
    J, work, pivots = np.zeros((m, m)), np.zeros(m), np.zeros(m, np.int64)
    first, target = np.zeros(m), np.zeros(m)
    piece, last = np.zeros((4, 4)), np.zeros((4, 4))
    for s in range(c.shape[0]):
        X = T[s]
        copy_pose(T0[s], X)
        errors(X, c[s], b, columns, first, J)
        side = determinant(J, pivots)
        done = newton(X, c[s], b, rods[s], columns, J, work, pivots)
        total = abs(done)
        errors(X, c[s], b, columns, work, J)
        det = determinant(J, pivots)
        code = CONVERGED if done > 0 else NOT_CONVERGED
        if done > 0 and det * side < 0.0:
            code = LEFT_THE_MODE
        if code != CONVERGED:
            copy_pose(T0[s], piece)
            copy_pose(T0[s], last)
            now, h, pieces = 0.0, 0.125, 0
            while now < 1.0 and h > _FINEST and pieces < _PIECES:
                pieces += 1
                after = min(1.0, now + h)
                for i in range(m):
                    target[i] = first[i] + after * (rods[s, i] - first[i])
                done = newton(piece, c[s], b, target, columns, J, work, pivots)
                total += abs(done)
                errors(piece, c[s], b, columns, work, J)
                if 0 < done <= 6 and determinant(J, pivots) * side > 0.0:
                    now, h = after, 2.0 * h
                    copy_pose(piece, last)
                else:
                    h *= 0.25
                    copy_pose(last, piece)
            if now == 1.0:
                code = CONVERGED
                copy_pose(piece, X)
        worst = worst_error(X, c[s], b, rods[s], columns, work, J)
        out[s, 0], out[s, 1], out[s, 2], out[s, 3] = code, total, worst, determinant(J, pivots)


@compiled(NOTHING(STACK, MATRIX, MATRIX, INTS, OUT4, OUT2, OUT2))
def polish(
    c: Floats, b: Floats, rods: Floats, columns: Ints, T: Floats, residual: Floats, det: Floats
) -> None:
    """Newton's method on every candidate pose, NaN rows left out.

    Shapes: c (N, m, 3), b (m, 3), rods (N, m), T (N, S, 4, 4) overwritten -> residual, det (N, S).
    """
    m = b.shape[0]
    J, work, pivots = np.zeros((m, m)), np.zeros(m), np.zeros(m, np.int64)
    X = np.zeros((4, 4))
    for s in range(c.shape[0]):
        for k in range(T.shape[1]):
            if np.isnan(T[s, k, 0, 3]):
                continue
            copy_pose(T[s, k], X)
            before = worst_error(X, c[s], b, rods[s], columns, work, J)
            newton(X, c[s], b, rods[s], columns, J, work, pivots)
            after = worst_error(X, c[s], b, rods[s], columns, work, J)
            moved = 0.0
            for i in range(3):
                for j in range(3):
                    moved = max(moved, abs(X[i, j] - T[s, k, i, j]))
            # at a double solution the derivative is singular and a step may be anything
            if after <= before and moved < _FAR:
                copy_pose(X, T[s, k])
            residual[s, k] = worst_error(T[s, k], c[s], b, rods[s], columns, work, J)
            det[s, k] = determinant(J, pivots)


@compiled()
def loop_of(c: Floats, b: Floats, rods: Floats, z: complex, inverse: complex) -> tuple:
    """Vectors w_2, w_3 and numbers k_2, k_3 of the equations p . w = k, in isotropic coordinates.

    With z = exp(i phi): w = b z - a, its conjugate with 1/z, p . w = (p w* + p* w)/2 = k.
    """
    b2 = complex(b[1, 0] - b[0, 0], b[1, 1] - b[0, 1])
    b3 = complex(b[2, 0] - b[0, 0], b[2, 1] - b[0, 1])
    a2 = complex(c[1, 0] - c[0, 0], c[1, 1] - c[0, 1])
    a3 = complex(c[2, 0] - c[0, 0], c[2, 1] - c[0, 1])
    u2, u3 = b2 * z - a2, b3 * z - a3
    v2, v3 = b2.conjugate() * inverse - a2.conjugate(), b3.conjugate() * inverse - a3.conjugate()
    k2 = 0.5 * (rods[1] * rods[1] - rods[0] * rods[0] - u2 * v2)
    k3 = 0.5 * (rods[2] * rods[2] - rods[0] * rods[0] - u3 * v3)
    return u2, u3, v2, v3, k2, k3


@compiled()
def closure(c: Floats, b: Floats, rods: Floats, z: complex) -> tuple[complex, complex]:
    """Closure equation of three planar legs at z = exp(i phi), and the determinant D for p."""
    u2, u3, v2, v3, k2, k3 = loop_of(c, b, rods, z, 1.0 / z)
    D = (v2 * u3 - v3 * u2) * 0.5j
    F = (
        k2 * k2 * u3 * v3
        + k3 * k3 * u2 * v2
        - k2 * k3 * (u2 * v3 + u3 * v2)
        - rods[0] * rods[0] * D * D
    )
    return F, D


@compiled()
def roots_of(f: Floats, low: int, degree: int, z: Floats) -> None:
    """Roots of a polynomial by Aberth's method. Shapes: f (7,) from f[low], z (6,)."""
    for k in range(degree):
        angle = 2.0 * pi * (k + 0.3) / degree
        z[k] = complex(cos(angle), sin(angle)) * (0.7 + 0.11 * k)
    for _ in range(200):
        largest = 0.0
        for k in range(degree):
            p, d = f[low + degree], 0j
            for j in range(degree - 1, -1, -1):
                d = d * z[k] + p
                p = p * z[k] + f[low + j]
            if p == 0j:
                continue
            for j in range(degree):
                if j != k:
                    d -= p / (z[k] - z[j])
            if d == 0j:
                d = 1e-300 + 0j
            z[k] -= p / d
            largest = max(largest, abs(p / d) / (1e-3 + abs(z[k])))
        if largest < 1e-15:
            break


@compiled()
def candidate(T: Floats, p: complex, z: complex, c: Floats, b: Floats) -> None:
    """Pose with the rotation z that puts the first anchor at c_1 + p."""
    size = abs(z)
    x, y = z.real / size, z.imag / size
    for i in range(4):
        for j in range(4):
            T[i, j] = 1.0 if i == j else 0.0
    T[0, 0], T[0, 1], T[1, 0], T[1, 1] = x, -y, y, x
    T[0, 3] = c[0, 0] + p.real - x * b[0, 0] + y * b[0, 1]
    T[1, 3] = c[0, 1] + p.imag - y * b[0, 0] - x * b[0, 1]


@compiled(NOTHING(STACK, MATRIX, MATRIX, INTS, OUT4, OUT2, OUT2, OUT2))
def planar(
    c: Floats,
    b: Floats,
    rods: Floats,
    columns: Ints,
    T: Floats,
    residual: Floats,
    det: Floats,
    out: Floats,
) -> None:
    """All poses of a platform on three planar legs, packed, by ascending phi.

    Shapes: c (N, 3, 3), b (3, 3), rods (N, 3) -> T (N, 6, 4, 4), residual, det (N, 6), out (N, 3):
    count, complex count, 1 for a continuum.
    """
    f, z, phi = np.zeros(7, np.complex128), np.zeros(6, np.complex128), np.zeros(6)
    J, work, pivots = np.zeros((3, 3)), np.zeros(3), np.zeros(3, np.int64)
    X = np.zeros((4, 4))
    for s in range(c.shape[0]):
        size = 0.0
        for i in range(3):
            size = max(size, rods[s, i], abs(b[i, 0] - b[0, 0]), abs(b[i, 1] - b[0, 1]))
            size = max(size, abs(c[s, i, 0] - c[s, 0, 0]), abs(c[s, i, 1] - c[s, 0, 1]))
        for k in range(7):
            f[k] = 0j
        for j in range(7):
            angle = 2.0 * pi * j / 7.0
            value, _ = closure(c[s], b, rods[s], complex(cos(angle), sin(angle)))
            for k in range(7):
                f[k] += value * complex(cos((k - 3) * angle), -sin((k - 3) * angle)) / 7.0
        largest = 0.0
        for k in range(7):
            largest = max(largest, abs(f[k]))
        out[s, 0], out[s, 1], out[s, 2] = 0.0, 0.0, 0.0
        # the orientation at which the triangles of base and platform are equal and parallel
        on = complex(c[s, 1, 0] - c[s, 0, 0], c[s, 1, 1] - c[s, 0, 1])
        on *= complex(b[1, 0] - b[0, 0], b[0, 1] - b[1, 1])
        on /= max(abs(on), 1e-300)
        u2, u3, _, _, k2, k3 = loop_of(c[s], b, rods[s], on, on.conjugate())
        equal = abs(u2) + abs(u3) < 1e-9 * size and abs(k2) + abs(k3) < 1e-9 * size * size
        if equal or largest <= 1e-14 * size**6:
            out[s, 2] = 1.0
            continue
        low = 0
        while low < 3 and abs(f[low]) < 1e-13 * largest:
            low += 1
        degree = 6 - 2 * low
        roots_of(f, low, degree, z)
        count = 0
        for k in range(degree):
            _, D = closure(c[s], b, rods[s], z[k])
            flat = abs(D) < 1e-7 * size * size
            off = abs(abs(z[k]) - 1.0)
            twin = False
            for j in range(k):
                twin = twin or abs(z[j] - z[k]) < 2e-6 * abs(z[k])
            if off > 1e-6:
                if not flat and not twin:
                    out[s, 1] += 1.0
                continue
            on = z[k] / abs(z[k])
            for j in range(k):
                twin = twin or (abs(z[j]) < 1.0 + 1e-6 and abs(z[j] / abs(z[j]) - on) < 2e-6)
            if twin:
                continue
            u2, u3, _, _, k2, k3 = loop_of(c[s], b, rods[s], on, 1.0 / on)
            tries = 1
            p = 1j * (k2 * u3 - k3 * u2)
            shift = 0j
            if not flat:
                p = p / D
            else:
                u, h = u2, k2.real
                if abs(u3) > abs(u2):
                    u, h = u3, k3.real
                if abs(u) < 1e-7 * size:
                    continue
                h /= abs(u)
                u /= abs(u)
                p = h * u
                shift = 1j * u * sqrt(max(0.0, rods[s, 0] ** 2 - h * h))
                tries = 2
            for side in range(tries):
                candidate(X, p + (1.0 - 2.0 * side) * shift, on, c[s], b)
                newton(X, c[s], b, rods[s], columns, J, work, pivots)
                worst = worst_error(X, c[s], b, rods[s], columns, work, J)
                if not worst <= 1e-11 * size or count == 6:
                    continue
                angle = np.arctan2(X[1, 0], X[0, 0])
                place = count
                while place > 0 and phi[place - 1] > angle:
                    phi[place] = phi[place - 1]
                    copy_pose(T[s, place - 1], T[s, place])
                    residual[s, place], det[s, place] = residual[s, place - 1], det[s, place - 1]
                    place -= 1
                phi[place] = angle
                copy_pose(X, T[s, place])
                residual[s, place], det[s, place] = worst, determinant(J, pivots)
                count += 1
                out[s, 1] += 1.0
        out[s, 0] = count
