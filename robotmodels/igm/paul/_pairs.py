"""Solutions of pairs of equations in two unknowns: types 4 to 8 of Paul's catalogue.

Arguments and results are as in `_types`.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from ...kernels._compile import Floats, compiled
from ._types import (
    DOUBLE,
    FREE_1,
    FREE_2,
    SMALL,
    atan2,
    put_angle,
    put_free,
    put_length,
    quadratic,
    type_2,
)


@compiled()
def type_4(
    X1: float,
    Y1: float,
    X2: float,
    Y2: float,
    zero: float,
    small: float,
    reference: float,
    found: Floats,
    o: int,
    lane: int,
) -> tuple[int, int]:
    """``X1 r S = Y1, X2 r C = Y2``: ``r = +-sqrt((Y1 / X1)^2 + (Y2 / X2)^2)``, then the angle."""
    if min(abs(X1), abs(X2)) <= zero:
        return 0, SMALL
    A, B = Y1 / X1, Y2 / X2
    r = sqrt(A * A + B * B)
    if r <= zero:
        put_length(found, o, 0, 0, lane, 0.0)
        put_free(found, o, 0, 3, lane, reference)
        return 1, FREE_2
    value, C, S = atan2(A, B), B / r, A / r
    put_length(found, o, 0, 0, lane, r)
    put_angle(found, o, 0, 3, lane, value, C, S)
    put_length(found, o, 1, 0, lane, -r)
    put_angle(found, o, 1, 3, lane, value - pi if value > 0.0 else value + pi, -C, -S)
    return 2, SMALL if r <= small or min(abs(X1), abs(X2)) <= small else 0


@compiled()
def type_5(
    X1: float,
    Y1: float,
    Z1: float,
    X2: float,
    Y2: float,
    Z2: float,
    slack: float,
    zero: float,
    small: float,
    found: Floats,
    o: int,
    lane: int,
) -> tuple[int, int]:
    """``X1 S = Y1 + Z1 r, X2 C = Y2 + Z2 r``: a length, then an angle."""
    if min(abs(X1), abs(X2)) <= zero:
        return 0, SMALL
    u0, u1, v0, v1 = Y1 / X1, Z1 / X1, Y2 / X2, Z2 / X2
    a = u1 * u1 + v1 * v1
    if a <= zero:
        return 0, SMALL
    roots = np.empty(2)
    count, flags = quadratic(a, u0 * u1 + v0 * v1, u0 * u0 + v0 * v0 - 1.0, slack, roots)
    for i in range(count):
        S, C = u0 + u1 * roots[i], v0 + v1 * roots[i]
        rho = sqrt(S * S + C * C)
        put_length(found, o, i, 0, lane, roots[i])
        put_angle(found, o, i, 3, lane, atan2(S, C), C / rho, S / rho)
    return count, flags | (SMALL if min(abs(X1), abs(X2)) <= small else 0)


@compiled()
def two_angles(
    W1: float,
    W2: float,
    X: float,
    Y: float,
    Z1: float,
    Z2: float,
    sense: float,
    slack: float,
    zero: float,
    small: float,
    reference_i: float,
    reference_j: float,
    found: Floats,
    o: int,
    lane: int,
) -> tuple[int, int]:
    """``W1 Cj + W2 Sj = X Ci + Y Si + Z1, sense (W1 Sj - W2 Cj) = X Si - Y Ci + Z2``.

    Type 2 in i: ``B1 Si + B2 Ci = B3``, ``B1 = 2 (Z1 Y + Z2 X)``, ``B2 = 2 (Z1 X - Z2 Y)``,
    ``B3 = W1^2 + W2^2 - X^2 - Y^2 - Z1^2 - Z2^2``; then type 3 in j.
    """
    W = W1 * W1 + W2 * W2
    # half of B1, B2, B3
    B1, B2 = Z1 * Y + Z2 * X, Z1 * X - Z2 * Y
    B3 = 0.5 * (W - X * X - Y * Y - Z1 * Z1 - Z2 * Z2)
    limit = max(zero * sqrt(W), zero * zero)
    count, flags = type_2(B1, B2, B3, slack, limit, small * sqrt(W), reference_i, found, o, lane)
    for n in range(count):
        C, S = found[o + 6 * n + 1, lane], found[o + 6 * n + 2, lane]
        one = X * C + Y * S + Z1
        two = sense * (X * S - Y * C + Z2)
        Sj, Cj = W2 * one + W1 * two, W1 * one - W2 * two
        rho = sqrt(Sj * Sj + Cj * Cj)
        if rho <= zero * zero:
            put_free(found, o, n, 3, lane, reference_j)
            flags |= FREE_2
        else:
            put_angle(found, o, n, 3, lane, atan2(Sj, Cj), Cj / rho, Sj / rho)
    return count, flags


@compiled()
def type_8(
    X: float,
    Y: float,
    Z1: float,
    Z2: float,
    slack: float,
    zero: float,
    small: float,
    reference_i: float,
    reference_j: float,
    found: Floats,
    o: int,
    lane: int,
) -> tuple[int, int]:
    """``X Ci + Y C(i+j) = Z1, X Si + Y S(i+j) = Z2``: the angle i, then the sum.

    ``Cj = (Z1^2 + Z2^2 - X^2 - Y^2) / (2 X Y)``, ``Sj = +-sqrt(1 - Cj^2)``, and i is of type 3:
    ``(X + Y Cj) Ci - Y Sj Si = Z1``, ``Y Sj Ci + (X + Y Cj) Si = Z2``.
    """
    reach = Z1 * Z1 + Z2 * Z2
    product = 2.0 * X * Y
    top = reach - X * X - Y * Y
    # (X + Y)^2 - reach and reach - (X - Y)^2, times each other: (2 X Y Sj)^2
    size = abs(product)
    if size <= zero * zero:
        return 0, SMALL
    room = (size - top) * (size + top)
    flags = 0
    if room <= 1e-12 * size * size:
        if abs(top) - size > slack * size:
            return 0, SMALL if abs(top) - size < 1e-6 * size else 0
        flags = DOUBLE
    root = sqrt(room) if room > 0.0 else 0.0
    Cj = top / product if room > 0.0 else (1.0 if top * product > 0.0 else -1.0)
    Sj = root / size
    A = X + Y * Cj
    if sqrt(reach) <= zero:
        # the second end lies on the first axis: i is free
        put_free(found, o, 0, 0, lane, reference_i)
        C, S = found[o + 1, lane], found[o + 2, lane]
        put_angle(found, o, 0, 3, lane, atan2(S * Cj + C * Sj, C * Cj - S * Sj), C * Cj - S * Sj,
                  S * Cj + C * Sj)  # fmt: skip
        return 1, flags | FREE_1
    if sqrt(reach) <= small:
        flags |= SMALL
    count = 2 if root > 0.0 else 1
    for n in range(count):
        B = Y * Sj if n == 0 else -Y * Sj
        C, S = A * Z1 + B * Z2, A * Z2 - B * Z1
        rho = sqrt(C * C + S * S)
        C, S = C / rho, S / rho
        put_angle(found, o, n, 0, lane, atan2(S, C), C, S)
        sine = Sj if n == 0 else -Sj
        c, s = C * Cj - S * sine, S * Cj + C * sine
        put_angle(found, o, n, 3, lane, atan2(s, c), c, s)
    return count, flags
