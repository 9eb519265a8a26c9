"""Solutions of the equations of Paul's catalogue.

Every function writes up to four solutions to a column of ``found``, six rows for each: value,
cosine and sine of the first unknown (a length has its value and 1, 0), then of the second. It
returns how many and a bit field: 1 double root or overshoot, 2 first unknown free, 4 second unknown
free, 8 small amplitude. What is free takes its reference. ``slack`` is the overshoot beside the
amplitude that still counts as a double root; ``small`` the amplitude beside which rounding of the
coefficients shows.
"""

from __future__ import annotations

from math import cos, pi, sin, sqrt

import numpy as np

from ...kernels._compile import Floats, compiled
from ..kernels.equations import polynomial_roots, trigonometric_roots

DOUBLE, FREE_1, FREE_2, SMALL = 1, 2, 4, 8

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
def put_angle(
    found: Floats, o: int, i: int, at: int, lane: int, value: float, C: float, S: float
) -> None:
    """Solution i of an angle."""
    row = o + 6 * i + at
    found[row, lane], found[row + 1, lane], found[row + 2, lane] = value, C, S


@compiled()
def put_free(found: Floats, o: int, i: int, at: int, lane: int, value: float) -> None:
    """An angle that takes its reference."""
    put_angle(found, o, i, at, lane, value, cos(value), sin(value))


@compiled()
def put_length(found: Floats, o: int, i: int, at: int, lane: int, value: float) -> None:
    """Solution i of a length."""
    put_angle(found, o, i, at, lane, value, 1.0, 0.0)


@compiled()
def type_1(
    X: float,
    Y: float,
    zero: float,
    small: float,
    reference: float,
    found: Floats,
    o: int,
    lane: int,
) -> tuple[int, int]:
    """``X r = Y``."""
    if abs(X) <= zero:
        put_length(found, o, 0, 0, lane, reference)
        return 1, FREE_1
    put_length(found, o, 0, 0, lane, Y / X)
    return 1, SMALL if abs(X) <= small else 0


@compiled()
def type_2_zero(
    X: float,
    Y: float,
    zero: float,
    small: float,
    reference: float,
    found: Floats,
    o: int,
    lane: int,
) -> tuple[int, int]:
    """``X S + Y C = 0``: ``theta = atan2(-Y, X)`` and ``theta + pi``."""
    rho = sqrt(X * X + Y * Y)
    if rho <= zero:
        put_free(found, o, 0, 0, lane, reference)
        return 1, FREE_1
    value, C, S = atan2(-Y, X), X / rho, -Y / rho
    put_angle(found, o, 0, 0, lane, value, C, S)
    put_angle(found, o, 1, 0, lane, value - pi if value > 0.0 else value + pi, -C, -S)
    return 2, SMALL if rho <= small else 0


@compiled()
def type_2(
    X: float,
    Y: float,
    Z: float,
    slack: float,
    zero: float,
    small: float,
    reference: float,
    found: Floats,
    o: int,
    lane: int,
) -> tuple[int, int]:
    """``X S + Y C = Z``, example 1.3 of the book with its misprint corrected.

    ``S = (X Z + e Y sqrt(X^2 + Y^2 - Z^2)) / (X^2 + Y^2)`` and
    ``C = (Y Z - e X sqrt(X^2 + Y^2 - Z^2)) / (X^2 + Y^2)`` with e = +-1.
    """
    square = X * X + Y * Y
    rho = sqrt(square)
    if rho <= zero:
        if abs(Z) > max(zero, slack):
            return 0, SMALL
        put_free(found, o, 0, 0, lane, reference)
        return 1, FREE_1
    flags = SMALL if rho <= small else 0
    room = (rho - Z) * (rho + Z)
    if room <= 1e-12 * square:
        # the two solutions fall together, or miss each other by rounding
        if abs(Z) - rho > slack * rho:
            return 0, flags | (SMALL if abs(Z) - rho < 1e-6 * rho else 0)
        if room <= 0.0:
            sign = 1.0 if Z >= 0.0 else -1.0
            C, S = sign * Y / rho, sign * X / rho
            put_angle(found, o, 0, 0, lane, atan2(S, C), C, S)
            return 1, flags | DOUBLE
        flags |= DOUBLE
    root = sqrt(room)
    scale = 1.0 / square
    S, C = (X * Z + Y * root) * scale, (Y * Z - X * root) * scale
    put_angle(found, o, 0, 0, lane, atan2(S, C), C, S)
    S, C = (X * Z - Y * root) * scale, (Y * Z + X * root) * scale
    put_angle(found, o, 1, 0, lane, atan2(S, C), C, S)
    return 2, flags


@compiled()
def type_3_direct(
    A: float,
    B: float,
    zero: float,
    small: float,
    reference: float,
    found: Floats,
    o: int,
    lane: int,
) -> tuple[int, int]:
    """``X1 S = A, X1 C = B`` with ``X1 > 0``."""
    rho = sqrt(A * A + B * B)
    if rho <= zero:
        put_free(found, o, 0, 0, lane, reference)
        return 1, FREE_1
    scale = 1.0 / rho
    put_angle(found, o, 0, 0, lane, atan2(A, B), B * scale, A * scale)
    return 1, SMALL if rho <= small else 0


@compiled()
def type_3(
    X1: float,
    Y1: float,
    Z1: float,
    X2: float,
    Y2: float,
    Z2: float,
    zero: float,
    small: float,
    reference: float,
    found: Floats,
    o: int,
    lane: int,
) -> tuple[int, int]:
    """``X1 S + Y1 C = Z1, X2 S + Y2 C = Z2``."""
    det = X1 * Y2 - X2 * Y1
    size = sqrt((X1 * X1 + Y1 * Y1) * (X2 * X2 + Y2 * Y2))
    if size <= zero * zero:
        put_free(found, o, 0, 0, lane, reference)
        return 1, FREE_1
    if abs(det) <= 1e-12 * size:
        # they say the same twice: the stronger one alone
        if X1 * X1 + Y1 * Y1 >= X2 * X2 + Y2 * Y2:
            count, flags = type_2(X1, Y1, Z1, 1e-9, zero, small, reference, found, o, lane)
        else:
            count, flags = type_2(X2, Y2, Z2, 1e-9, zero, small, reference, found, o, lane)
        return min(count, 1), flags | SMALL
    sign = 1.0 if det > 0.0 else -1.0
    S, C = sign * (Z1 * Y2 - Z2 * Y1), sign * (X1 * Z2 - X2 * Z1)
    rho = sqrt(S * S + C * C)
    if rho <= zero * zero:
        put_free(found, o, 0, 0, lane, reference)
        return 1, FREE_1
    put_angle(found, o, 0, 0, lane, atan2(S, C), C / rho, S / rho)
    return 1, SMALL if abs(det) <= 1e-6 * size or rho <= small * small else 0


@compiled()
def quadratic(a: float, h: float, c: float, slack: float, roots: Floats) -> tuple[int, int]:
    """``a r^2 + 2 h r + c = 0``: solutions and flags."""
    room, size = h * h - a * c, h * h + abs(a * c)
    if room < -slack * size:
        return 0, SMALL if room > -1e-6 * size else 0
    if room <= 0.0:
        roots[0] = -h / a
        return 1, DOUBLE
    whole = -(h + (sqrt(room) if h >= 0.0 else -sqrt(room)))
    roots[0], roots[1] = whole / a, c / whole if whole != 0.0 else 0.0
    return 2, DOUBLE if room <= 1e-12 * size else 0


@compiled()
def quartic(
    a0: float,
    a1: float,
    a2: float,
    a3: float,
    a4: float,
    slack: float,
    reference: float,
    found: Floats,
    o: int,
    lane: int,
) -> tuple[int, int]:
    """``a0 + a1 C + a2 S + a3 cos(2 theta) + a4 sin(2 theta) = 0``."""
    g, roots = np.empty(5), np.empty(4)
    g[0], g[1], g[2], g[3], g[4] = a0, a1, a2, a3, a4
    size = max(max(abs(a0), abs(a1)), max(abs(a2), max(abs(a3), abs(a4))))
    if size == 0.0:
        put_free(found, o, 0, 0, lane, reference)
        return 1, FREE_1
    count, flags = trigonometric_roots(g, roots, slack * size), 0
    for i in range(count):
        put_free(found, o, i, 0, lane, roots[i])
        for m in range(i):
            gap = abs(roots[i] - roots[m])
            if min(gap, abs(gap - 2.0 * pi)) < 1e-3:
                flags |= DOUBLE
    if count % 2 == 1:
        flags |= DOUBLE
    return count, flags


@compiled()
def polynomial(
    a0: float,
    a1: float,
    a2: float,
    a3: float,
    a4: float,
    slack: float,
    reference: float,
    found: Floats,
    o: int,
    lane: int,
) -> tuple[int, int]:
    """``a0 + a1 r + a2 r^2 + a3 r^3 + a4 r^4 = 0``."""
    roots = np.empty(4)
    if a3 == 0.0 and a4 == 0.0 and a2 != 0.0:
        count, flags = quadratic(a2, 0.5 * a1, a0, slack, roots)
        for i in range(count):
            put_length(found, o, i, 0, lane, roots[i])
        return count, flags
    g = np.empty(5)
    g[0], g[1], g[2], g[3], g[4] = a0, a1, a2, a3, a4
    if a0 == a1 == a2 == a3 == a4 == 0.0:
        put_length(found, o, 0, 0, lane, reference)
        return 1, FREE_1
    count, flags = polynomial_roots(g, roots), 0
    for i in range(count):
        put_length(found, o, i, 0, lane, roots[i])
        for m in range(i):
            if abs(roots[i] - roots[m]) < 1e-3 * (1.0 + abs(roots[i])):
                flags |= DOUBLE
    return count, flags
