"""Compiled: real roots of the equations in one joint variable that closed forms come down to.

An equation in an angle is a row of coefficients over 1, cos, sin, cos of twice, sin of twice; one
in a length is a row over its powers.
"""

from __future__ import annotations

from math import atan, atan2, cos, hypot, pi, sin, sqrt

from ...kernels._compile import Floats, compiled

NONE, DOUBLE, TWO, ANY = 0, 1, 2, 3
CLOSE = 1e-8  # step of Newton's method beside the root after which no other is needed
ROUNDING = 1e-13  # value beside the terms of a polynomial that rounding leaves at a root


@compiled(counted=False)
def type_2(X: float, Y: float, Z: float, slack: float, zero: float) -> tuple[int, float, float]:
    """Roots of ``X sin + Y cos = Z``, type 2 of Paul's method.

    ``theta = atan2(X, Y) +- atan2(sqrt(X^2 + Y^2 - Z^2), Z)``. An overshoot up to ``slack`` of the
    amplitude is a double root; an amplitude below ``zero`` leaves the angle free, if Z agrees.
    """
    rho = hypot(X, Y)
    if rho <= zero:
        return (ANY if abs(Z) <= max(zero, slack) else NONE), 0.0, 0.0
    middle = atan2(X, Y)
    square = (rho - Z) * (rho + Z)
    if square <= 0.0:
        if abs(Z) - rho > slack:
            return NONE, 0.0, 0.0
        half = atan2(0.0, Z)
        return DOUBLE, middle + half, middle + half
    half = atan2(sqrt(square), Z)
    return TWO, middle + half, middle - half


@compiled(counted=False)
def quadratic_roots(a: float, b: float, c: float, roots: Floats) -> int:
    """Real roots of ``a r^2 + b r + c`` without cancellation; a double one within rounding."""
    room = b * b - 4.0 * a * c
    scale = b * b + abs(4.0 * a * c)
    if room < -1e-9 * scale:
        return 0
    if room <= 0.0:
        roots[0] = -0.5 * b / a
        return 1
    half = -0.5 * (b + (sqrt(room) if b >= 0.0 else -sqrt(room)))
    roots[0] = half / a
    roots[1] = c / half if half != 0.0 else 0.0
    return 2


@compiled(counted=False)
def value_at(c: Floats, x: float) -> tuple[float, float]:
    """Value and derivative at x of a polynomial with five coefficients."""
    xx = x * x
    value = (c[0] + c[1] * x) + xx * ((c[2] + c[3] * x) + c[4] * xx)
    return value, (c[1] + 2.0 * c[2] * x) + xx * (3.0 * c[3] + 4.0 * c[4] * x)


@compiled(counted=False)
def root_between(c: Floats, a: float, b: float, x: float, rises: bool) -> float:
    """Root between a and b, where it has opposite signs: Newton from x, and bisection."""
    for _ in range(100):
        if not a < x < b:
            x = 0.5 * (a + b)
        value, slope = value_at(c, x)
        if (value > 0.0) == rises:
            b = x
        else:
            a = x
        step = value / slope
        if abs(step) <= CLOSE * abs(x):
            return x - step  # as exact as rounding allows, since steps converge quadratically
        x -= step
    return x


@compiled(counted=False)
def real_roots(c: Floats, degree: int, slack: float, roots: Floats, work: Floats) -> int:
    """Real roots of ``c[0] + ... + c[degree] x^degree``; double roots once. Returns their number.

    An extremum that misses zero by ``slack (1 + x^2)^(degree / 2)`` at most is a double root.
    Shapes: roots (4,), and work (3, 6), which holds derivatives and the ends of intervals.
    """
    bound, size = 0.0, 0.0
    for i in range(degree):
        bound = max(bound, abs(c[i] / c[degree]))
    bound += 1.0
    ends, d, count = work[0], work[1], 0
    if degree > 2:
        # the quadratic derivative, but for the factor degree - 2
        count = quadratic_roots(
            0.5 * degree * (degree - 1) * c[degree],
            (degree - 1) * c[degree - 1],
            c[degree - 2],
            roots,
        )
        if count == 2 and roots[0] > roots[1]:
            roots[0], roots[1] = roots[1], roots[0]
    # the derivative of degree 3, then the polynomial itself
    for n in range(3 if degree > 2 else 1, degree + 1):
        for i in range(5):
            d[i] = c[i + degree - n] * (i + 1 if n < degree else 1) if i <= n else 0.0
        for i in range(count):
            ends[1 + i] = roots[i]
        ends[0], ends[count + 1] = -bound, bound
        last, count = count + 1, 0
        before = value_at(d, ends[0])[0]
        for i in range(1, last + 1):
            x = ends[i]
            value = value_at(d, x)[0]
            if n == degree and i < last:
                size = 0.0
                for m in range(n, -1, -1):
                    size = size * abs(x) + abs(d[m])
                following = value_at(d, ends[i + 1])[0]
                touches = abs(value) <= max(
                    slack * (1.0 + x * x) ** (0.5 * degree), ROUNDING * size
                )
                # an extremum towards zero, from either side, or the middle of a triple root
                if abs(value) <= ROUNDING * size or (
                    touches and value * before > 0.0 and abs(value) < abs(following)
                ):
                    roots[count] = x
                    count += 1
                    before = following
                    continue
            if (value > 0.0) != (before > 0.0):
                # between extrema by the chord, beyond them by the parabola that touches there
                a, start = ends[i - 1], ends[i - 1] + (x - ends[i - 1]) * before / (before - value)
                if last > 1 and (i == 1 or i == last):
                    at, height = (x, value) if i == 1 else (a, before)
                    bend = 2.0 * d[2] + at * (6.0 * d[3] + 12.0 * d[4] * at)
                    start = at + (1.0 if i == last else -1.0) * sqrt(-2.0 * height / bend)
                roots[count] = root_between(d, a, x, start, value > 0.0)
                count += 1
            before = value
    return count


@compiled(counted=False)
def polynomial_roots(g: Floats, roots: Floats, work: Floats) -> int:
    """Real roots of ``g0 + g1 r + g2 r^2 + g3 r^3 + g4 r^4``. Returns how many."""
    size = 0.0
    for i in range(5):
        size = max(size, abs(g[i]))
    degree = 4
    while degree > 0 and abs(g[degree]) <= 1e-13 * size:
        degree -= 1
    if degree == 2:
        return quadratic_roots(g[2], g[1], g[0], roots)
    return real_roots(g, degree, 1e-9 * size, roots, work)


@compiled(counted=False)
def trigonometric_roots(g: Floats, roots: Floats, work: Floats, slack: float) -> int:
    """Real roots of a trigonometric polynomial of degree two: Pieper's quartic. Returns how many.

    The quartic is in the tangent of half the angle, measured from a direction opposite to which
    the polynomial is large, so that no root is at infinity.
    """
    size, largest, turn = 0.0, -1.0, 0.0
    for i in range(5):
        size = max(size, abs(g[i]))
    if size == 0.0:
        return 0
    c, s, half = 1.0, 0.0, sqrt(0.5)
    for k in range(8):
        value = g[0] + g[1] * c + g[2] * s + g[3] * (c * c - s * s) + g[4] * 2.0 * s * c
        if abs(value) > largest:
            largest, turn = abs(value), 0.25 * pi * k - pi
        c, s = half * (c - s), half * (c + s)
    c, s, c2, s2 = cos(turn), sin(turn), cos(2.0 * turn), sin(2.0 * turn)
    h1, h2 = g[1] * c + g[2] * s, g[2] * c - g[1] * s
    h3, h4 = g[3] * c2 + g[4] * s2, g[4] * c2 - g[3] * s2
    q = work[2]
    q[0], q[1], q[2] = g[0] + h1 + h3, 2.0 * h2 + 4.0 * h4, 2.0 * g[0] - 6.0 * h3
    q[3], q[4] = 2.0 * h2 - 4.0 * h4, g[0] - h1 + h3
    count = real_roots(q, 4, max(slack, 1e-9 * size), roots, work)
    for i in range(count):
        roots[i] = turn + 2.0 * atan(roots[i])
    return count
