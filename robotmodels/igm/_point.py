"""Three joints that bring a point somewhere: ``M_a E_1 M_b E_2 M_c w = p``.

D. L. Pieper, "The kinematics of manipulators under computer control", 1968. The first joint is
eliminated by what it leaves alone (height and distance if it turns, two coordinates if it
slides); the second by its sine and cosine, which leaves an equation in the last one: of type 2
where the first two axes meet or are parallel, a quartic otherwise.
"""

from __future__ import annotations

from math import atan2, cos, hypot, sin

import numpy as np

from ..kernels._compile import Floats, Ints, compiled
from ._equations import (
    ANY,
    DOUBLE,
    NONE,
    polynomial_roots,
    quadratic_roots,
    trigonometric_roots,
    type_2,
)

_RANK = 1e-9


@compiled()
def _square(a: Floats, b: Floats, turning: bool, out: Floats) -> None:
    """Add the product of two functions of the last joint to ``out``.

    Over 1, cos, sin they give 1, cos, sin, cos 2, sin 2; over 1, r, r^2 the powers up to r^4.
    """
    if turning:
        cc, ss, cs = a[1] * b[1], a[2] * b[2], a[1] * b[2] + a[2] * b[1]
        out[0] += a[0] * b[0] + 0.5 * (cc + ss)
        out[1] += a[0] * b[1] + a[1] * b[0]
        out[2] += a[0] * b[2] + a[2] * b[0]
        out[3] += 0.5 * (cc - ss)
        out[4] += 0.5 * cs
    else:
        for i in range(3):
            for j in range(3):
                out[i + j] += a[i] * b[j]


@compiled()
def _value(a: Floats, turning: bool, x: float) -> float:
    """Value at x of a function of the last joint."""
    if turning:
        return a[0] + a[1] * cos(x) + a[2] * sin(x)
    return a[0] + x * (a[1] + x * a[2])


@compiled()
def _roots_of_product(g: Floats, turning: bool, roots: Floats, slack: float) -> int:
    if turning:
        return trigonometric_roots(g, roots, slack)
    return polynomial_roots(g, roots)


@compiled()
def roots_of_linear(a: Floats, turning: bool, roots: Floats, slack: float, zero: float) -> int:
    """Roots of a function of the last joint itself; -1 if every value is one."""
    if turning:
        kind, u, v = type_2(a[2], a[1], -a[0], slack, zero)
        if kind == NONE:
            return 0
        if kind == ANY:
            return -1
        roots[0], roots[1] = u, v
        return 1 if kind == DOUBLE else 2
    if abs(a[2]) > zero:
        return quadratic_roots(a[2], a[1], a[0], roots)
    if abs(a[1]) > zero:
        roots[0] = -a[0] / a[1]
        return 1
    return -1 if abs(a[0]) <= slack else 0


@compiled()
def point_postures(
    sigma: Ints,
    E1: Floats,
    E2: Floats,
    w: Floats,
    p: Floats,
    size: float,
    slack: float,
    reference: Floats,
    x: Floats,
    free: Ints,
) -> int:
    """All ``x (m, 3)`` with ``M_a E_1 M_b E_2 M_c w = p``. Returns how many.

    ``size``: length of the arm; ``slack``: relative overshoot of a double root; ``free[i]`` gets a
    bit (1, 2, 4) for each joint whose value was taken from ``reference``.
    """
    last, middle, first = sigma[2] == 0, sigma[1] == 0, sigma[0] == 0
    zero = 1e-11 * size
    # f = E_2 M_c w and its squared length, functions of the last joint
    f = np.zeros((3, 3))
    for i in range(3):
        if last:
            f[i, 0] = E2[i, 2] * w[2] + E2[i, 3]
            f[i, 1] = E2[i, 0] * w[0] + E2[i, 1] * w[1]
            f[i, 2] = E2[i, 1] * w[0] - E2[i, 0] * w[1]
        else:
            f[i, 0] = E2[i, 0] * w[0] + E2[i, 1] * w[1] + E2[i, 2] * w[2] + E2[i, 3]
            f[i, 1] = E2[i, 2]
    length = np.zeros(5)
    for i in range(3):
        _square(f[i], f[i], last, length)
    # two equations row.y + lam |y|^2 = k in y = M_b f, free of the first joint
    row = np.zeros((2, 3))
    k = np.zeros(2)
    lam = np.zeros(2)
    if first:
        for j in range(3):
            row[0, j] = E1[2, j]
            for i in range(3):
                row[1, j] += E1[i, j] * E1[i, 3] / size
        k[0] = p[2] - E1[2, 3]
        for i in range(3):
            k[1] += (p[i] * p[i] - E1[i, 3] * E1[i, 3]) / (2.0 * size)
        lam[1] = 1.0 / (2.0 * size)
    else:
        for i in range(2):
            for j in range(3):
                row[i, j] = E1[i, j]
            k[i] = p[i] - E1[i, 3]
    found = np.zeros((8, 2))  # values of the last and middle joints
    marks = np.zeros(8, dtype=np.int64)
    if middle:
        b = np.zeros((2, 3))
        for i in range(2):
            b[i, 0] = k[i]
            for m in range(3):
                b[i, m] -= row[i, 2] * f[2, m] + lam[i] * length[m]
        count = turning_pair(row, b, f, last, size, slack, zero, reference, found, marks)
    else:
        count = _middle_slides(row, k, lam, f, length, last, size, slack, zero, reference,
                               found, marks)  # fmt: skip
    for i in range(count):
        xc, xb = found[i]
        y0, y1, y2 = _value(f[0], last, xc), _value(f[1], last, xc), _value(f[2], last, xc)
        if middle:
            c, s = cos(xb), sin(xb)
            y0, y1 = c * y0 - s * y1, s * y0 + c * y1
        else:
            y2 += xb
        h0 = E1[0, 0] * y0 + E1[0, 1] * y1 + E1[0, 2] * y2 + E1[0, 3]
        h1 = E1[1, 0] * y0 + E1[1, 1] * y1 + E1[1, 2] * y2 + E1[1, 3]
        x[i, 1], x[i, 2] = xb, xc
        free[i] = marks[i]
        if not first:
            h2 = E1[2, 0] * y0 + E1[2, 1] * y1 + E1[2, 2] * y2 + E1[2, 3]
            x[i, 0] = p[2] - h2
        elif hypot(p[0], p[1]) <= zero:
            # the point is on the first axis: turning about it changes nothing. Asked of the goal:
            # two postures fall together there, and the joints found are good to half the digits
            x[i, 0] = reference[0]
            free[i] |= 1
        else:
            x[i, 0] = atan2(p[1], p[0]) - atan2(h1, h0)
    return count


@compiled()
def turning_pair(
    row: Floats,
    b: Floats,
    f: Floats,
    last: bool,
    size: float,
    slack: float,
    zero: float,
    reference: Floats,
    found: Floats,
    marks: Ints,
) -> int:
    """Two equations in two joints, ``row_i . Rot(x_b) (f_x, f_y) = b_i``: eliminate the turn x_b.

    ``b`` and ``f`` are functions of the other joint x_c. Writes pairs (x_c, x_b) to ``found``,
    bits 4 and 2 to ``marks`` where they are free; returns how many.
    """
    n0, n1 = hypot(row[0, 0], row[0, 1]), hypot(row[1, 0], row[1, 1])
    det = row[0, 0] * row[1, 1] - row[0, 1] * row[1, 0]
    roots = np.zeros(4)
    count = 0
    if abs(det) > _RANK * max(n0, n1):
        # |B b|^2 = f_x^2 + f_y^2 with B the inverse of the two rows: Pieper's quartic
        u, v = np.zeros(3), np.zeros(3)
        for m in range(3):
            u[m] = (row[1, 1] * b[0, m] - row[0, 1] * b[1, m]) / det
            v[m] = (row[0, 0] * b[1, m] - row[1, 0] * b[0, m]) / det
        g, minus = np.zeros(5), np.zeros(5)
        _square(u, u, last, g)
        _square(v, v, last, g)
        _square(f[0], f[0], last, minus)
        _square(f[1], f[1], last, minus)
        for m in range(5):
            g[m] -= minus[m]
        for i in range(_roots_of_product(g, last, roots, slack * size * size)):
            xc = roots[i]
            uu, vv = _value(u, last, xc), _value(v, last, xc)
            fx, fy = _value(f[0], last, xc), _value(f[1], last, xc)
            found[count, 0] = xc
            if hypot(fx, fy) <= zero:
                found[count, 1] = reference[1]
                marks[count] = 2
            else:
                found[count, 1] = atan2(vv, uu) - atan2(fy, fx)
            count += 1
        return count
    # the rows are parallel (axes that meet, or are parallel): one combination of the equations
    # is free of the second joint
    main = 0 if n0 >= n1 else 1
    other = 1 - main
    amplitude = max(n0, n1)
    if amplitude <= _RANK:
        return 0  # the first two axes coincide: the arm is redundant here
    ratio = (row[other, 0] * row[main, 0] + row[other, 1] * row[main, 1]) / amplitude**2
    a = np.zeros(3)
    for m in range(3):
        a[m] = b[other, m] - ratio * b[main, m]
    outer = roots_of_linear(a, last, roots, slack * size, zero)
    mark = 0
    if outer < 0:
        roots[0] = reference[2]
        outer, mark = 1, 4
    for i in range(outer):
        xc = roots[i]
        fx, fy = _value(f[0], last, xc), _value(f[1], last, xc)
        # row . (c f_x - s f_y, s f_x + c f_y) = b
        X = row[main, 1] * fx - row[main, 0] * fy
        Y = row[main, 0] * fx + row[main, 1] * fy
        kind, t0, t1 = type_2(X, Y, _value(b[main], last, xc), slack * size, zero)
        if kind == NONE:
            continue
        found[count, 0] = xc
        found[count, 1] = reference[1] if kind == ANY else t0
        marks[count] = mark | 2 if kind == ANY else mark
        count += 1
        if kind != ANY and kind != DOUBLE:
            found[count, 0], found[count, 1], marks[count] = xc, t1, mark
            count += 1
    return count


@compiled()
def _middle_slides(
    row: Floats,
    k: Floats,
    lam: Floats,
    f: Floats,
    length: Floats,
    last: bool,
    size: float,
    slack: float,
    zero: float,
    reference: Floats,
    found: Floats,
    marks: Ints,
) -> int:
    """Eliminate a sliding second joint: row.(f + x z) + lam |f + x z|^2 = k."""
    roots, lengths = np.zeros(4), np.zeros(4)
    count = 0
    rest = np.zeros((2, 3))  # k - row.f - lam |f|^2
    for i in range(2):
        rest[i, 0] = k[i]
        for m in range(3):
            rest[i, m] -= lam[i] * length[m]
            for j in range(3):
                rest[i, m] -= row[i, j] * f[j, m]
    quadratic = lam[1] != 0.0
    main = 0 if quadratic or abs(row[0, 2]) >= abs(row[1, 2]) else 1
    other = 1 - main
    if abs(row[main, 2]) > _RANK:
        slide = np.zeros(3)
        for m in range(3):
            slide[m] = rest[main, m] / row[main, 2]
        g = np.zeros(5)
        if quadratic:
            linear = np.zeros(3)
            for m in range(3):
                linear[m] = 2.0 * lam[other] * f[2, m]
            linear[0] += row[other, 2]
            _square(linear, slide, last, g)
            scaled = np.zeros(3)
            for m in range(3):
                scaled[m] = lam[other] * slide[m]
            _square(scaled, slide, last, g)
            for m in range(3):
                g[m] -= rest[other, m]
            outer = _roots_of_product(g, last, roots, slack * size)
        else:
            a = np.zeros(3)
            for m in range(3):
                a[m] = rest[other, m] - row[other, 2] * slide[m]
            outer = roots_of_linear(a, last, roots, slack * size, zero)
        mark = 0
        if outer < 0:
            roots[0] = reference[2]
            outer, mark = 1, 4
        for i in range(outer):
            found[count, 0] = roots[i]
            found[count, 1] = _value(slide, last, roots[i])
            marks[count] = mark
            count += 1
        return count
    # the first equation is free of the slide: it gives the last joint, the second the slide
    outer = roots_of_linear(rest[main], last, roots, slack * size, zero)
    mark = 0
    if outer < 0:
        roots[0] = reference[2]
        outer, mark = 1, 4
    for i in range(outer):
        xc = roots[i]
        if quadratic:
            linear = row[other, 2] + 2.0 * lam[other] * _value(f[2], last, xc)
            inner = quadratic_roots(lam[other], linear, -_value(rest[other], last, xc), lengths)
        else:
            return 0  # both joints slide along the same line: redundant
        for j in range(inner):
            found[count, 0], found[count, 1], marks[count] = xc, lengths[j], mark
            count += 1
    return count
