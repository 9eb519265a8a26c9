"""Compiled: a line in space, its fourteen functions, and their coefficients in the joints.

The loop. With the closing link ``G_5 = ... U^-1 ...`` the six joints and links close:
``M_0 G_0 M_1 G_1 M_2 G_2 M_3 G_3 M_4 G_4 M_5 G_5 = I``. Joint 5, revolute, moves neither the z axis
of its frame nor its origin, so that the line (p, l) = (origin, axis) can be reached two ways:

    M_2 G_2 M_3 G_3 M_4 G_4 (p, l) = G_1^-1 M_1^-1 G_0^-1 M_0^-1 G_5^-1 (p, l)

Fourteen functions of it (Raghavan and Roth 1993, eq. 3 to 8) are

    p (0-2), l (3-5), p x l (6-8), (p.p) l - 2 (p.l) p (9-11), p.p (12), p.l (13),

each linear in (1, cos, sin) of every revolute joint and in (1, r, r^2) of every prismatic one.
Their coefficients are found by sampling each joint at three values: left, 14 x 27 in joints
2, 3, 4; right, 14 x 9 in joints 0, 1.
"""

from __future__ import annotations

from math import cos, pi, sin, sqrt

from ...kernels._compile import (
    Floats,
    Ints,
    compiled,
)


@compiled()
def put_transform(A: Floats, i: int, B: Floats, k: int) -> None:
    """Copy ``A[i] (4, 4)`` to ``B[k]``."""
    for r in range(4):
        for c in range(4):
            B[k, r, c] = A[i, r, c]


@compiled()
def move_line(G: Floats, x: Floats) -> None:
    """Apply the transform ``G (4, 4)`` to the line x = (p, l), in place."""
    for k in range(2):
        a, b, c = x[3 * k], x[3 * k + 1], x[3 * k + 2]
        for i in range(3):
            x[3 * k + i] = G[i, 0] * a + G[i, 1] * b + G[i, 2] * c
    for i in range(3):
        x[i] += G[i, 3]


@compiled()
def move_line_back(G: Floats, x: Floats) -> None:
    """Apply the inverse of the transform ``G (4, 4)`` to the line x = (p, l), in place."""
    for i in range(3):
        x[i] -= G[i, 3]
    for k in range(2):
        a, b, c = x[3 * k], x[3 * k + 1], x[3 * k + 2]
        for i in range(3):
            x[3 * k + i] = G[0, i] * a + G[1, i] * b + G[2, i] * c


@compiled()
def turn_line(kind: int, value: float, x: Floats) -> None:
    """Move the line x = (p, l) by a joint of the kind (0 revolute, 1 prismatic), in place."""
    if kind == 1:
        x[2] += value
        return
    c, s = cos(value), sin(value)
    for k in range(2):
        a, b = x[3 * k], x[3 * k + 1]
        x[3 * k] = c * a - s * b
        x[3 * k + 1] = s * a + c * b


@compiled()
def fourteen(x: Floats, f: Floats) -> None:
    """The fourteen functions of the line x = (p, l)."""
    px, py, pz, lx, ly, lz = x[0], x[1], x[2], x[3], x[4], x[5]
    pp = px * px + py * py + pz * pz
    pl = px * lx + py * ly + pz * lz
    f[0], f[1], f[2] = px, py, pz
    f[3], f[4], f[5] = lx, ly, lz
    f[6], f[7], f[8] = py * lz - pz * ly, pz * lx - px * lz, px * ly - py * lx
    f[9], f[10], f[11] = pp * lx - 2 * pl * px, pp * ly - 2 * pl * py, pp * lz - 2 * pl * pz
    f[12], f[13] = pp, pl


@compiled()
def sample(kind: int, k: int) -> float:
    """Value k = 0, 1, 2 at which a joint is sampled."""
    if kind == 1:
        return k - 1.0
    return 2.0 * pi / 3.0 * k


@compiled()
def to_coefficients(kind: int, a: float, b: float, c: float) -> tuple[float, float, float]:
    """Coefficients of (1, cos, sin) or (1, r, r^2) from the three samples."""
    if kind == 1:
        return b, 0.5 * (c - a), 0.5 * (a + c) - b
    return (a + b + c) / 3.0, (2.0 * a - b - c) / 3.0, (b - c) / sqrt(3.0)


@compiled()
def basis(kind: int, value: float, b: Floats) -> None:
    """(1, cos, sin) or (1, r, r^2) of a joint into b (3,)."""
    b[0] = 1.0
    if kind == 1:
        b[1], b[2] = value, value * value
    else:
        b[1], b[2] = cos(value), sin(value)


@compiled()
def two_joints(kind_a: int, kind_b: int, F: Floats) -> None:
    """Samples ``F (14, 9)`` of two joints to coefficients, in place."""
    for i in range(14):
        for m in range(3):
            F[i, 3 * m], F[i, 3 * m + 1], F[i, 3 * m + 2] = to_coefficients(
                kind_b, F[i, 3 * m], F[i, 3 * m + 1], F[i, 3 * m + 2]
            )
        for m in range(3):
            F[i, m], F[i, 3 + m], F[i, 6 + m] = to_coefficients(
                kind_a, F[i, m], F[i, 3 + m], F[i, 6 + m]
            )


@compiled()
def left_side(kind: Ints, G: Floats, F: Floats, x: Floats, f: Floats) -> None:
    """Coefficients ``F (14, 9)`` in joints 3 and 4 of the functions of G_2 M_3 G_3 M_4 G_4."""
    for b in range(3):
        for c in range(3):
            x[0] = x[1] = x[2] = x[3] = x[4] = 0.0
            x[5] = 1.0
            move_line(G[4], x)
            turn_line(kind[4], sample(kind[4], c), x)
            move_line(G[3], x)
            turn_line(kind[3], sample(kind[3], b), x)
            move_line(G[2], x)
            fourteen(x, f)
            for i in range(14):
                F[i, 3 * b + c] = f[i]
    two_joints(kind[3], kind[4], F)


@compiled()
def right_side(kind: Ints, G: Floats, F: Floats, x: Floats, f: Floats) -> None:
    """Coefficients ``F (14, 9)`` in joints 0 and 1 of the other way to the line."""
    for d in range(3):
        for e in range(3):
            x[0] = x[1] = x[2] = x[3] = x[4] = 0.0
            x[5] = 1.0
            move_line_back(G[5], x)
            turn_line(kind[0], -sample(kind[0], d), x)
            move_line_back(G[0], x)
            turn_line(kind[1], -sample(kind[1], e), x)
            move_line_back(G[1], x)
            fourteen(x, f)
            for i in range(14):
                F[i, 3 * d + e] = f[i]
    two_joints(kind[0], kind[1], F)
