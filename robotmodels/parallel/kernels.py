"""Compiled direct models: Newton's method for any legs of known length, the sextic of planar ones.

A mechanism with its actuators locked is a platform on m rods: rod i of length l_i joins the point
c_i of the base and b_i of the platform. ``columns`` are the components of the twist that the
platform has, as many as rods.
"""

from cmath import phase
from math import cos, pi, sin, sqrt

import numpy as np

from ..kernels import _compile
from ..kernels._compile import INTS, MATRIX, NOTHING, OUT2, OUT3, OUT4, STACK, Floats, Ints
from ..kernels.linear_systems import factor, solve

compiled = _compile.compiled

CONVERGED, NOT_CONVERGED, LEFT_THE_MODE = 0, 1, 2
_ITERATIONS = 50
_LAST = 1e-8  # a Newton step this small, relative, is the last one
_FAR = 0.02  # largest change of a rotation by polishing
_REAL = 1e-6  # distance of a root of the sextic from the unit circle

Room = tuple[Floats, Floats, Ints]


@compiled()
def put(out: Floats, T: Floats) -> None:
    """Copy a pose; array assignments take seconds to compile."""
    for i in range(4):
        for j in range(4):
            out[i, j] = T[i, j]


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
def newton(T: Floats, c: Floats, b: Floats, rods: Floats, columns: Ints, room: Room) -> int:
    """Newton's method on the pose, in place: iterations, negative where it does not converge."""
    J, work, pivots = room
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
        solve(J, pivots, work)
        step = 0.0
        for j in range(m):
            step = max(step, abs(work[j]) / (size if columns[j] < 3 else 1.0))
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
def measured(
    T: Floats, c: Floats, b: Floats, rods: Floats, columns: Ints, room: Room
) -> tuple[float, float]:
    """Largest error of a rod's length, and the determinant of the lines; lengths into the room."""
    J, work, pivots = room
    errors(T, c, b, columns, work, J)
    worst = 0.0
    for i in range(rods.size):
        worst = max(worst, abs(work[i] - rods[i]))
    return worst, determinant(J, pivots)


@compiled()
def room_for(m: int) -> Room:
    """Arrays that Newton's method writes to: J (m, m), lengths (m,), pivots (m,)."""
    return np.zeros((m, m)), np.zeros(m), np.zeros(m, np.int64)


@compiled(NOTHING(STACK, MATRIX, MATRIX, STACK, INTS, OUT3, OUT2))
def direct(
    c: Floats, b: Floats, rods: Floats, T0: Floats, columns: Ints, T: Floats, out: Floats
) -> None:
    """Poses near T0 by Newton's method.

    Shapes: c (N, m, 3), b (m, 3), rods (N, m), T0 (N, 4, 4) -> T (N, 4, 4), out (N, 4): code,
    iterations, residual, determinant.
    """
    room = room_for(b.shape[0])
    for s in range(c.shape[0]):
        put(T[s], T0[s])
        _, side = measured(T[s], c[s], b, rods[s], columns, room)
        done = newton(T[s], c[s], b, rods[s], columns, room)
        worst, det = measured(T[s], c[s], b, rods[s], columns, room)
        code = CONVERGED if done > 0 else NOT_CONVERGED
        if done > 0 and det * side < 0.0:
            code = LEFT_THE_MODE
        out[s, 0], out[s, 1], out[s, 2], out[s, 3] = code, abs(done), worst, det


@compiled(NOTHING(STACK, MATRIX, MATRIX, INTS, OUT4, OUT2, OUT2))
def polish(
    c: Floats, b: Floats, rods: Floats, columns: Ints, T: Floats, residual: Floats, det: Floats
) -> None:
    """Newton's method on every candidate pose, NaN rows left out.

    Shapes: c (N, m, 3), b (m, 3), rods (N, m), T (N, S, 4, 4) overwritten -> residual, det (N, S).
    """
    room = room_for(b.shape[0])
    X = np.zeros((4, 4))
    for s in range(c.shape[0]):
        for k in range(T.shape[1]):
            if np.isnan(T[s, k, 0, 3]):
                continue
            put(X, T[s, k])
            before, side = measured(X, c[s], b, rods[s], columns, room)
            newton(X, c[s], b, rods[s], columns, room)
            after, here = measured(X, c[s], b, rods[s], columns, room)
            moved = 0.0
            for i in range(3):
                for j in range(3):
                    moved = max(moved, abs(X[i, j] - T[s, k, i, j]))
            residual[s, k], det[s, k] = before, side
            # at a double solution the derivative is singular and a step may be anything
            if after <= before and moved < _FAR:
                residual[s, k], det[s, k] = after, here
                put(T[s, k], X)


@compiled()
def loop_of(c: Floats, b: Floats, rods: Floats, z: complex) -> tuple:
    """Vectors w_2, w_3 and numbers k_2, k_3 of the equations p . w = k, in isotropic coordinates.

    With z = exp(i phi): w = b z - a, its conjugate with 1/z, p . w = (p w* + p* w)/2 = k; last the
    determinant D of the two equations.
    """
    b2 = complex(b[1, 0] - b[0, 0], b[1, 1] - b[0, 1])
    b3 = complex(b[2, 0] - b[0, 0], b[2, 1] - b[0, 1])
    a2 = complex(c[1, 0] - c[0, 0], c[1, 1] - c[0, 1])
    a3 = complex(c[2, 0] - c[0, 0], c[2, 1] - c[0, 1])
    u2, u3 = b2 * z - a2, b3 * z - a3
    v2, v3 = b2.conjugate() / z - a2.conjugate(), b3.conjugate() / z - a3.conjugate()
    k2 = 0.5 * (rods[1] * rods[1] - rods[0] * rods[0] - u2 * v2)
    k3 = 0.5 * (rods[2] * rods[2] - rods[0] * rods[0] - u3 * v3)
    return u2, u3, v2, v3, k2, k3, (v2 * u3 - v3 * u2) * 0.5j


@compiled()
def closure(c: Floats, b: Floats, rods: Floats, f: Floats) -> float:
    """Coefficients (7,) of z^-3 to z^3 of the closure equation of three planar legs; the largest.

    They are found from its values at seven orientations z.
    """
    f[:] = 0j
    for j in range(7):
        angle = 2.0 * pi * j / 7.0
        u2, u3, v2, v3, k2, k3, D = loop_of(c, b, rods, complex(cos(angle), sin(angle)))
        F = k2 * k2 * u3 * v3 + k3 * k3 * u2 * v2 - k2 * k3 * (u2 * v3 + u3 * v2)
        F -= rods[0] * rods[0] * D * D
        for k in range(7):
            f[k] += F * complex(cos((k - 3) * angle), -sin((k - 3) * angle)) / 7.0
    largest = 0.0
    for k in range(7):
        largest = max(largest, abs(f[k]))
    return largest


@compiled()
def roots_of(f: Floats, z: Floats, largest: float) -> int:
    """Roots of the closure equation by Aberth's method, by ascending angle, and their number.

    Shapes: f (7,), its terms' largest value, z (6,). Real ones are brought onto the unit circle.
    """
    low = 0
    while low < 3 and abs(f[low]) < 1e-15 * largest:
        low += 1
    degree = 6 - 2 * low
    for k in range(degree):
        angle = 2.0 * pi * (k + 0.3) / degree
        z[k] = complex(cos(angle), sin(angle)) * (0.7 + 0.11 * k)
    for _ in range(60):
        most = 0.0
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
            most = max(most, abs(p / d) / (1e-3 + abs(z[k])))
        if most < 1e-11:  # the error after a step is of its third power
            break
    for k in range(degree):
        root = z[k]
        if abs(abs(root) - 1.0) <= _REAL:
            root /= abs(root)
        place = k
        while place > 0 and phase(z[place - 1]) > phase(root):
            z[place] = z[place - 1]
            place -= 1
        z[place] = root
    return degree


@compiled(NOTHING(STACK, MATRIX, MATRIX, MATRIX, INTS, OUT4, OUT2, OUT2, OUT2))
def planar(
    c: Floats,
    b: Floats,
    rods: Floats,
    home: Floats,
    columns: Ints,
    T: Floats,
    residual: Floats,
    det: Floats,
    out: Floats,
) -> None:
    """All poses of a platform on three planar legs, packed, by ascending angle, NaN after.

    Shapes: c (N, 3, 3), b (3, 3), rods (N, 3), home (4, 4) -> T (N, 6, 4, 4), residual, det (N, 6),
    out (N, 2): 1 for a continuum, number of complex solutions.
    """
    f, z, X = np.zeros(7, np.complex128), np.zeros(6, np.complex128), np.zeros((4, 4))
    room = room_for(3)
    T[:] = residual[:] = det[:] = np.nan
    out[:] = 0.0
    for s in range(c.shape[0]):
        size = 0.0
        for i in range(3):
            size = max(size, rods[s, i], abs(b[i, 0] - b[0, 0]), abs(b[i, 1] - b[0, 1]))
            size = max(size, abs(c[s, i, 0] - c[s, 0, 0]), abs(c[s, i, 1] - c[s, 0, 1]))
        largest = closure(c[s], b, rods[s], f)
        # the orientation at which the triangles of base and platform are equal and parallel
        on = complex(c[s, 1, 0] - c[s, 0, 0], c[s, 1, 1] - c[s, 0, 1])
        on *= complex(b[1, 0] - b[0, 0], b[0, 1] - b[1, 1])
        on = on / abs(on) if on != 0j else 1.0 + 0j
        u2, u3, _, _, k2, k3, _ = loop_of(c[s], b, rods[s], on)
        equal = abs(u2) + abs(u3) < 1e-9 * size and abs(k2) + abs(k3) < 1e-9 * size * size
        if equal or largest <= 1e-14 * size**6:
            out[s, 0] = 1.0
            continue
        count = 0
        for k in range(roots_of(f, z, max(100.0 * largest, size**6))):
            u2, u3, _, _, k2, k3, D = loop_of(c[s], b, rods[s], z[k])
            flat = abs(D) < 1e-7 * size * size
            twin = False
            for j in range(k):
                twin = twin or abs(z[j] - z[k]) < 2e-6 * abs(z[k])
            if abs(abs(z[k]) - 1.0) > _REAL:
                if not flat and not twin:
                    out[s, 1] += 1.0
                continue
            u, h, tries = u2, k2.real, 1
            if abs(u3) > abs(u2):
                u, h = u3, k3.real
            if twin or (flat and abs(u) < 1e-7 * size):
                continue
            shift = 0j
            if flat:
                tries = 2
                h, u = h / abs(u), u / abs(u)
                p = h * u
                shift = 1j * u * sqrt(max(0.0, rods[s, 0] ** 2 - h * h))
            else:
                p = 1j * (k2 * u3 - k3 * u2) / D
            for side in range(tries):
                put(X, home)
                x, y = z[k].real, z[k].imag
                X[0, 0], X[0, 1], X[1, 0], X[1, 1] = x, -y, y, x
                at = p + (1.0 - 2.0 * side) * shift
                X[0, 3] = c[s, 0, 0] + at.real - x * b[0, 0] + y * b[0, 1]
                X[1, 3] = c[s, 0, 1] + at.imag - y * b[0, 0] - x * b[0, 1]
                X[2, 3] = c[s, 0, 2] - b[0, 2]
                newton(X, c[s], b, rods[s], columns, room)
                worst, here = measured(X, c[s], b, rods[s], columns, room)
                if worst <= 1e-11 * size and count < 6:
                    X[2, 3] = home[2, 3]
                    put(T[s, count], X)
                    residual[s, count], det[s, count] = worst, here
                    count += 1
                    out[s, 1] += 1.0
