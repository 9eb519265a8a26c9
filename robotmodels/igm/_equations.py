"""Equations in one joint variable: the types that the closed-form models come down to.

An equation in an angle is a row of coefficients over 1, cos, sin (, cos of twice, sin of twice);
one in a length is a row over its powers.
"""

from __future__ import annotations

from math import atan2, cos, hypot, sin, sqrt

import numpy as np

from ..kernels._compile import Floats, compiled

NONE, DOUBLE, TWO, ANY = 0, 1, 2, 3


@compiled()
def type_2(X: float, Y: float, Z: float, slack: float, zero: float) -> tuple[int, float, float]:
    """Roots of ``X sin + Y cos = Z``, type 2 of Paul's method.

    ``theta = atan2(X, Y) +- atan2(sqrt(X^2 + Y^2 - Z^2), Z)``. An overshoot up to ``slack`` of the
    amplitude is a double root; an amplitude below ``zero`` leaves the angle free, if Z agrees.
    """
    rho = hypot(X, Y)
    if rho <= zero:
        if abs(Z) <= max(zero, slack):
            return ANY, 0.0, 0.0
        return NONE, 0.0, 0.0
    middle = atan2(X, Y)
    room = (rho - Z) * (rho + Z)
    if room <= 0.0:
        if abs(Z) - rho > slack:
            return NONE, 0.0, 0.0
        half = atan2(0.0, Z)
        return DOUBLE, middle + half, middle + half
    half = atan2(sqrt(room), Z)
    return TWO, middle + half, middle - half


@compiled()
def trigonometric_value(g: Floats, theta: float) -> tuple[float, float]:
    """``g0 + g1 cos + g2 sin + g3 cos 2 + g4 sin 2`` and its derivative."""
    c, s = cos(theta), sin(theta)
    c2, s2 = c * c - s * s, 2.0 * c * s
    value = g[0] + g[1] * c + g[2] * s + g[3] * c2 + g[4] * s2
    slope = -g[1] * s + g[2] * c - 2.0 * g[3] * s2 + 2.0 * g[4] * c2
    return value, slope


@compiled()
def trigonometric_roots(g: Floats, roots: Floats, slack: float) -> int:
    """Real roots of a trigonometric polynomial of degree two: Pieper's quartic. Returns how many.

    The quartic is taken in ``exp(i theta)``, whose real angles are its roots on the unit circle,
    so that no angle is at infinity as it is for the half-angle tangent.
    """
    size = 0.0
    for i in range(5):
        size = max(size, abs(g[i]))
    if size == 0.0:
        return 0
    if hypot(g[3], g[4]) < 1e-13 * size:
        kind, a, b = type_2(g[2], g[1], -g[0], slack, 1e-14 * size)
        if kind in (NONE, ANY):
            return 0
        roots[0], roots[1] = a, b
        return 2 if kind == TWO else 1
    companion = np.zeros((4, 4), dtype=np.complex128)
    lead = 0.5 * (g[3] - 1j * g[4])
    companion[0, 0] = -0.5 * (g[1] - 1j * g[2]) / lead
    companion[0, 1] = -g[0] / lead
    companion[0, 2] = -0.5 * (g[1] + 1j * g[2]) / lead
    companion[0, 3] = -0.5 * (g[3] + 1j * g[4]) / lead
    for i in range(3):
        companion[i + 1, i] = 1.0
    count = 0
    for z in np.linalg.eigvals(companion):
        # roots come in pairs z, 1 / conj(z); a double root is a pair that rounding pulled apart
        if abs(abs(z) - 1.0) > 1e-4:
            continue
        theta = atan2(z.imag, z.real)
        for _ in range(4):
            value, slope = trigonometric_value(g, theta)
            if abs(slope) < 1e-9 * size:
                break
            step = value / slope
            if abs(step) > 1e-3:
                break
            theta -= step
        if abs(trigonometric_value(g, theta)[0]) <= max(1e-9 * size, slack):
            roots[count] = theta
            count += 1
    return count


@compiled()
def polynomial_roots(g: Floats, roots: Floats) -> int:
    """Real roots of ``g0 + g1 r + g2 r^2 + g3 r^3 + g4 r^4``. Returns how many."""
    size = 0.0
    for i in range(5):
        size = max(size, abs(g[i]))
    degree = 4
    while degree > 0 and abs(g[degree]) <= 1e-13 * size:
        degree -= 1
    if degree == 0:
        return 0
    if degree == 1:
        roots[0] = -g[0] / g[1]
        return 1
    if degree == 2:
        return quadratic_roots(g[2], g[1], g[0], roots)
    companion = np.zeros((degree, degree), dtype=np.complex128)
    for i in range(degree):
        companion[0, i] = -g[degree - 1 - i] / g[degree]
    for i in range(degree - 1):
        companion[i + 1, i] = 1.0
    count = 0
    for z in np.linalg.eigvals(companion):
        if abs(z.imag) <= 1e-5 * (1.0 + abs(z.real)):
            roots[count] = z.real
            count += 1
    return count


@compiled()
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
