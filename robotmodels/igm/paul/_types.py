"""Solutions of the equations of Paul's catalogue, one lane (pose) at a time.

Each solver takes the coefficients ``g`` of its equation, the tolerances ``eps`` and the references
of its two unknowns. It writes up to four solutions into a column of ``found``, six rows for each:
value, cosine and sine of the first unknown, then of the second; angles by cosine and sine up to a
factor, lengths by their value. It returns the number of solutions and a bit field (`layout`). An
undetermined unknown takes its reference.

``eps``: overshoot, beside the amplitude, that still counts as a double root; amplitude below which
an angle is undetermined; amplitude below which digits are lost.
"""

from __future__ import annotations

from math import cos, pi, sin, sqrt

import numpy as np

from ...kernels._compile import Floats, compiled
from ..kernels.equations import polynomial_roots, trigonometric_roots
from . import layout

Tolerances = tuple[float, float, float]
Pair = tuple[float, float]
Result = tuple[int, int]

_TAN_EIGHTH = 0.41421356237309503  # tan(pi / 8)


@compiled()
def atan2(y: float, x: float) -> float:
    """The angle of (x, y), to two units in the last place, without branches (vector code).

    Three foldings leave a tangent below 22.5 degrees; then an odd polynomial, a Chebyshev fit of
    ``(atan(u) / u - 1) / u^2``.
    """
    a, b = abs(x), abs(y)
    low = b if b < a else a
    high = a if b < a else b
    fold = low > _TAN_EIGHTH * high
    top = low - high if fold else low
    bottom = low + high if fold else high
    u = top / (bottom if bottom > 0.0 else 1.0)
    w = u * u
    w2 = w * w
    w4 = w2 * w2
    p0 = -0.3333333333333333 + w * 0.1999999999999552
    p1 = -0.14285714284666542 + w * 0.11111111015256292
    p2 = -0.09090904578121085 + w * 0.07692183190760651
    p3 = -0.0666451144646022 + w * 0.05858148904795124
    p4 = -0.050854496960392584 + w * 0.039231657085083686
    p = (p0 + w2 * p1) + w4 * ((p2 + w2 * p3) + w4 * (p4 - w2 * 0.019176885636589053))
    angle = u + u * w * p
    angle = angle + 0.25 * pi if fold else angle
    angle = 0.5 * pi - angle if b > a else angle
    angle = pi - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle


@compiled()
def put(found: Floats, row: int, lane: int, value: float, C: float, S: float) -> None:
    """Write one unknown of one solution."""
    found[row, lane], found[row + 1, lane], found[row + 2, lane] = value, C, S


@compiled()
def put_free(found: Floats, row: int, lane: int, value: float) -> None:
    """Write an angle that takes its reference."""
    put(found, row, lane, value, cos(value), sin(value))


@compiled()
def angles(
    code: int, g: Floats, eps: Tolerances, wanted: Pair, found: Floats, o: int, lane: int
) -> Result:
    """``X S = g0, X C = g1`` with ``X > 0``, or with X of any sign: the opposite angle as well."""
    rho = sqrt(g[0] * g[0] + g[1] * g[1])
    if rho <= eps[1]:
        put_free(found, o, lane, wanted[0])
        return 1, layout.FREE_1
    put(found, o, lane, 0.0, g[1], g[0])
    put(found, o + 6, lane, 0.0, -g[1], -g[0])
    return 1 + code, layout.SMALL if rho <= eps[2] else 0


@compiled()
def one_equation(
    g: Floats, eps: Tolerances, wanted: Pair, found: Floats, o: int, lane: int
) -> Result:
    """``X S + Y C = Z``, example 1.3 of the book with its misprint corrected.

    ``S = (X Z + e Y sqrt(X^2 + Y^2 - Z^2)) / (X^2 + Y^2)`` and
    ``C = (Y Z - e X sqrt(X^2 + Y^2 - Z^2)) / (X^2 + Y^2)`` with e = +-1.
    """
    X, Y, Z = g[0], g[1], g[2]
    slack, zero, small = eps
    square = X * X + Y * Y
    rho = sqrt(square)
    if rho <= zero:
        if abs(Z) > max(zero, slack):
            return 0, layout.SMALL
        put_free(found, o, lane, wanted[0])
        return 1, layout.FREE_1
    count, flags = 2, layout.SMALL if rho <= small else 0
    room = (rho - Z) * (rho + Z)
    if room <= 1e-12 * square:
        # the two solutions coincide, or are missed by rounding
        if abs(Z) - rho > slack * rho:
            return 0, flags | (layout.SMALL if abs(Z) - rho < 1e-6 * rho else 0)
        flags |= layout.DOUBLE
        if room <= 0.0:
            count, room = 1, 0.0
    root, scale = sqrt(room), 1.0 / square
    put(found, o, lane, 0.0, (Y * Z - X * root) * scale, (X * Z + Y * root) * scale)
    put(found, o + 6, lane, 0.0, (Y * Z + X * root) * scale, (X * Z - Y * root) * scale)
    return count, flags


@compiled()
def two_equations(
    g: Floats, eps: Tolerances, wanted: Pair, found: Floats, o: int, lane: int
) -> Result:
    """``X1 S + Y1 C = Z1, X2 S + Y2 C = Z2``."""
    X1, Y1, Z1, X2, Y2, Z2 = g[0], g[1], g[2], g[3], g[4], g[5]
    _, zero, small = eps
    det = X1 * Y2 - X2 * Y1
    one, two = X1 * X1 + Y1 * Y1, X2 * X2 + Y2 * Y2
    size = sqrt(one * two)
    if size > zero * zero and abs(det) <= 1e-12 * size:
        # dependent equations: the stronger one alone
        if two > one:
            g[0], g[1], g[2] = X2, Y2, Z2
        count, flags = one_equation(g, (1e-9, zero, small), wanted, found, o, lane)
        return min(count, 1), flags | layout.SMALL
    sign = 1.0 if det > 0.0 else -1.0
    S, C = sign * (Z1 * Y2 - Z2 * Y1), sign * (X1 * Z2 - X2 * Z1)
    rho = sqrt(S * S + C * C)
    if size <= zero * zero or rho <= zero * zero:
        put_free(found, o, lane, wanted[0])
        return 1, layout.FREE_1
    put(found, o, lane, 0.0, C, S)
    return 1, layout.SMALL if abs(det) <= 1e-6 * size or rho <= small * small else 0


@compiled()
def two_angles(
    g: Floats, eps: Tolerances, wanted: Pair, found: Floats, o: int, lane: int
) -> Result:
    """``W1 Cj + W2 Sj = X Ci + Y Si + Z1, sense (W1 Sj - W2 Cj) = X Si - Y Ci + Z2``.

    One equation in i: ``B1 Si + B2 Ci = B3``, ``B1 = 2 (Z1 Y + Z2 X)``, ``B2 = 2 (Z1 X - Z2 Y)``,
    ``B3 = W1^2 + W2^2 - X^2 - Y^2 - Z1^2 - Z2^2``; then both equations give j.
    """
    W1, W2, X, Y, Z1, Z2, sense = g[0], g[1], g[2], g[3], g[4], g[5], g[6]
    slack, zero, small = eps
    square = W1 * W1 + W2 * W2
    W = sqrt(square)
    # half of B1, B2, B3
    g[0], g[1] = Z1 * Y + Z2 * X, Z1 * X - Z2 * Y
    g[2] = 0.5 * (square - X * X - Y * Y - Z1 * Z1 - Z2 * Z2)
    limits = (slack, max(zero * W, zero * zero), small * W)
    count, flags = one_equation(g, limits, wanted, found, o, lane)
    for row in range(o, o + 6 * count, 6):
        C, S = found[row + 1, lane], found[row + 2, lane]
        one = X * C + Y * S + Z1
        two = sense * (X * S - Y * C + Z2)
        Sj, Cj = W2 * one + W1 * two, W1 * one - W2 * two
        if sqrt(Sj * Sj + Cj * Cj) <= zero * zero:
            put_free(found, row + 3, lane, wanted[1])
            flags |= layout.FREE_2
        else:
            put(found, row + 3, lane, 0.0, Cj, Sj)
    return count, flags


@compiled()
def length(g: Floats, eps: Tolerances, wanted: Pair, found: Floats, o: int, lane: int) -> Result:
    """``g0 r = g1``."""
    size = abs(g[0])
    if size <= eps[1]:
        put(found, o, lane, wanted[0], 1.0, 0.0)
        return 1, layout.FREE_1
    put(found, o, lane, g[1] / g[0], 1.0, 0.0)
    return 1, layout.SMALL if size <= eps[2] else 0


@compiled()
def solve(
    code: int, g: Floats, eps: Tolerances, wanted: Pair, found: Floats, o: int, lane: int
) -> Result:
    """Solutions of one step: the common equations."""
    if code <= layout.OPPOSITE_ANGLES:
        return angles(code, g, eps, wanted, found, o, lane)
    if code == layout.ONE_EQUATION:
        return one_equation(g, eps, wanted, found, o, lane)
    if code == layout.TWO_EQUATIONS:
        return two_equations(g, eps, wanted, found, o, lane)
    if code == layout.TWO_ANGLES:
        return two_angles(g, eps, wanted, found, o, lane)
    return length(g, eps, wanted, found, o, lane)


@compiled()
def length_times_angle(
    g: Floats, eps: Tolerances, wanted: Pair, found: Floats, o: int, lane: int
) -> Result:
    """``X1 r S = Y1, X2 r C = Y2``: ``r = +-sqrt((Y1 / X1)^2 + (Y2 / X2)^2)``, then the angle."""
    least = min(abs(g[0]), abs(g[2]))
    if least <= eps[1]:
        return 0, layout.SMALL
    A, B = g[1] / g[0], g[3] / g[2]
    r = sqrt(A * A + B * B)
    put(found, o, lane, r, 1.0, 0.0)
    put(found, o + 6, lane, -r, 1.0, 0.0)
    if r <= eps[1]:
        put_free(found, o + 3, lane, wanted[1])
        return 1, layout.FREE_2
    put(found, o + 3, lane, 0.0, B, A)
    put(found, o + 9, lane, 0.0, -B, -A)
    return 2, layout.SMALL if r <= eps[2] or least <= eps[2] else 0


@compiled()
def quadratic(a: float, h: float, c: float, slack: float, roots: Floats) -> Result:
    """``a r^2 + 2 h r + c = 0``."""
    room, size = h * h - a * c, h * h + abs(a * c)
    if room < -slack * size:
        return 0, layout.SMALL if room > -1e-6 * size else 0
    if room <= 0.0:
        roots[0] = -h / a
        return 1, layout.DOUBLE
    whole = -(h + (sqrt(room) if h >= 0.0 else -sqrt(room)))
    roots[0], roots[1] = whole / a, c / whole if whole != 0.0 else 0.0
    return 2, layout.DOUBLE if room <= 1e-12 * size else 0


@compiled()
def length_and_angle(
    g: Floats, eps: Tolerances, wanted: Pair, found: Floats, o: int, lane: int
) -> Result:
    """``X1 S = Y1 + Z1 r, X2 C = Y2 + Z2 r``: a length, then an angle."""
    least = min(abs(g[0]), abs(g[3]))
    if least <= eps[1]:
        return 0, layout.SMALL
    u0, u1, v0, v1 = g[1] / g[0], g[2] / g[0], g[4] / g[3], g[5] / g[3]
    a = u1 * u1 + v1 * v1
    if a <= eps[1]:
        return 0, layout.SMALL
    roots = np.empty(2)
    count, flags = quadratic(a, u0 * u1 + v0 * v1, u0 * u0 + v0 * v0 - 1.0, eps[0], roots)
    for i in range(count):
        r = roots[i]
        put(found, o + 6 * i, lane, r, 1.0, 0.0)
        put(found, o + 6 * i + 3, lane, 0.0, v0 + v1 * r, u0 + u1 * r)
    return count, flags | (layout.SMALL if least <= eps[2] else 0)


@compiled()
def polynomial(
    code: int, g: Floats, eps: Tolerances, wanted: Pair, found: Floats, o: int, lane: int
) -> Result:
    """``g0 + g1 r + ... + g4 r^4 = 0``, or ``g0 + g1 C + g2 S + g3 cos(2 x) + g4 sin(2 x) = 0``."""
    roots, work, size, count, flags = np.empty(4), np.empty((3, 6)), 0.0, 0, 0
    for i in range(5):
        size = max(size, abs(g[i]))
    if size == 0.0:
        put_free(found, o, lane, wanted[0])
        return 1, layout.FREE_1
    if code == layout.QUARTIC:
        count = trigonometric_roots(g, roots, work, eps[0] * size)
        flags = layout.DOUBLE * (count % 2)
    elif g[3] == 0.0 and g[4] == 0.0 and g[2] != 0.0:
        count, flags = quadratic(g[2], 0.5 * g[1], g[0], eps[0], roots)
    else:
        count = polynomial_roots(g, roots, work)
    for i in range(count):
        put_free(found, o + 6 * i, lane, roots[i])
        for m in range(i):
            gap = abs(roots[i] - roots[m])
            if code == layout.QUARTIC:
                gap = min(gap, abs(gap - 2.0 * pi))
            else:
                gap /= 1.0 + abs(roots[i])
            if gap < 1e-3:
                flags |= layout.DOUBLE
    return count, flags


@compiled()
def solve_rare(
    code: int, g: Floats, eps: Tolerances, wanted: Pair, found: Floats, o: int, lane: int
) -> Result:
    """Solutions of one step: the equations that few arms need."""
    if code == layout.LENGTH_TIMES_ANGLE:
        return length_times_angle(g, eps, wanted, found, o, lane)
    if code == layout.LENGTH_AND_ANGLE:
        return length_and_angle(g, eps, wanted, found, o, lane)
    return polynomial(code, g, eps, wanted, found, o, lane)
