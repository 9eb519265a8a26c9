"""Compiled: from the eigenvalues of `_eigenproblem` back to postures.

An eigenvalue is joint 2. The null vector of the 12 x 12 matrix there holds the products of joints
3 and 4, the removed equations give joints 0 and 1, and joint 5 closes the loop.
"""

from __future__ import annotations

from math import atan2, cos, sin

import numpy as np
from numba import types
from numpy.typing import NDArray

from ...kernels._compile import (
    INT,
    INTS,
    NOTHING,
    OUT1,
    OUT2,
    OUT3,
    STACK,
    VECTOR,
    Floats,
    Ints,
    compiled,
)
from ._eigenproblem import ORDERS, widen
from ._linear import factor, smallest_vectors, to_unit
from ._lines import basis, move_line_back, put_transform, turn_line
from ._newton import COUNTS, distance, keep, newton, workspace

FLOAT = types.float64
COMPLEX = types.Array(types.complex128, 2, "C")
NEARLY_REAL = 2e-2  # imaginary part of an angle up to which its real part is tried [rad]
MERGED = 1e-3  # imaginary part up to which a pair counts as a double root that rounding split [rad]

Eliminated = tuple[Floats, Floats, Ints]  # the equations that `assemble` left: P, Q, order
Back = tuple[Floats, Floats, Floats, Floats, Floats]  # three bases, a right side, a solution


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
        to_unit(u)
        for j in range(3):
            w[j] = V[j] * u[0] + V[3 + j] * u[1] + V[6 + j] * u[2] + V[9 + j] * u[3]


@compiled()
def back_substitute(
    kinds: Ints,
    G: Floats,
    angles: Floats,
    line: Floats,
    E: Eliminated,
    work: Back,
) -> None:
    """Joints 0, 1 and 5 of the loop from joints 2, 3, 4 in ``angles (6,)``, in place."""
    P, Q, order = E
    b2, b3, b4, y, x = work
    basis(kinds[2], angles[2], b2)
    basis(kinds[3], angles[3], b3)
    basis(kinds[4], angles[4], b4)
    for i in range(8):
        y[i] = 0.0
        for a in range(3):
            for b in range(3):
                s = b2[a] * b3[b]
                k = 9 * a + 3 * b
                y[i] += s * (P[i, k] * b4[0] + P[i, k + 1] * b4[1] + P[i, k + 2] * b4[2])
    for i in range(7, -1, -1):
        for k in range(i + 1, 8):
            y[i] -= Q[i, k] * y[k]
        y[i] = y[i] / Q[i, i] if Q[i, i] != 0.0 else 0.0
    for i in range(8):
        x[order[i]] = y[i]
    # products in the order (0,1) (0,2) (1,0) (1,1) (1,2) (2,0) (2,1) (2,2) of joints 0 and 1
    angles[0] = x[2] if kinds[0] == 1 else atan2(x[5], x[2])
    angles[1] = x[0] if kinds[1] == 1 else atan2(x[1], x[0])
    # joint 5 closes the loop: the x axis of its frame seen after and before it
    line[0] = line[1] = line[2] = line[4] = line[5] = 0.0
    line[3] = 1.0
    move_line_back(G[5], line)
    for k in range(2):
        turn_line(kinds[k], -angles[k], line)
        move_line_back(G[k], line)
    for k in range(2, 5):
        turn_line(kinds[k], -angles[k], line)
        move_line_back(G[k], line)
    # M_5^-1 ... takes G_5^-1 x back to x: M_5 x is what the other five joints make of it
    angles[5] = atan2(line[4], line[3])


@compiled(
    NOTHING(
        INTS, STACK, STACK, VECTOR, INTS, INTS, FLOAT, STACK, INT, STACK, INT,
        COMPLEX, OUT3, OUT3, ORDERS, OUT1, OUT3, COUNTS, OUT2,
    )
)  # fmt: skip
def postures(
    sigma: Ints,
    D: Floats,
    goals: Floats,
    tolerance: Floats,
    kinds: Ints,
    joints: Ints,
    direction: float,
    links: Floats,
    closing: int,
    closings: Floats,
    swapped: int,
    eigenvalues: NDArray[np.complex128],
    P: Floats,
    Q: Floats,
    order: Ints,
    angle: Floats,
    found: Floats,
    count: Ints,
    report: Floats,
) -> None:
    """Follow eigenvalues back to postures, polish them on the exact chain and keep new ones.

    ``report (N, 2)`` receives the number of real eigenvalues, pairs that are nearly real
    included, and the largest way that polishing moved a posture of a real one [rad].
    """
    kind_nu = kinds[4] if swapped else kinds[3]
    kind_mu = kinds[3] if swapped else kinds[4]
    G = np.empty((6, 4, 4))
    for k in range(6):
        put_transform(links, k, G, k)
    A = np.empty((12, 12))
    E = np.empty((1, 9))
    pivots = np.empty(12, np.int64)
    u12, v12, u, w = np.empty(12), np.empty(12), np.empty(4), np.empty(3)
    line, angles, q, start = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    back = (np.empty(3), np.empty(3), np.empty(3), np.empty(8), np.empty(8))
    polish = workspace()
    for n in range(goals.shape[0]):
        put_transform(closings, n, G, closing)
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
            c, s = cos(angles[2]), sin(angles[2])
            for e in range(6):
                for k in range(9):
                    E[0, k] = P[n, 8 + e, k] + c * P[n, 8 + e, 9 + k] + s * P[n, 8 + e, 18 + k]
                for m in range(2):
                    widen(kind_nu, E, 0, 0, swapped, m, A, 2 * e + m, 0)
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
                mu = atan2(w[2], w[1]) if w[0] > 0.0 else atan2(-w[2], -w[1])
            angles[3] = mu if swapped else nu
            angles[4] = nu if swapped else mu
            back_substitute(kinds, G, angles, line, (P[n], Q[n], order[n]), back)
            finite = True
            for k in range(6):
                value = direction * angles[k]
                finite = finite and abs(value) < 1e6
                start[joints[k]] = value
            if not finite:
                continue
            for k in range(6):
                q[k] = start[k]
            if newton(sigma, D, goals[n], tolerance, q, polish):
                if t.imag == 0.0:
                    moved = max(moved, distance(sigma, start, q))
                count[n] = keep(sigma, q, found[n], count[n])
            elif t.imag == 0.0:
                moved = np.inf
        report[n, 0], report[n, 1] = real, moved


@compiled(NOTHING(INTS, STACK, STACK, VECTOR, STACK, INTS, OUT3, COUNTS))
def bring_home(
    sigma: Ints,
    D: Floats,
    goals: Floats,
    tolerance: Floats,
    starts: Floats,
    starting: Ints,
    found: Floats,
    count: Ints,
) -> None:
    """Start from the postures ``starts (N, 16, 6)`` of poses nearby; keep what meets the goals."""
    q = np.empty(6)
    work = workspace()
    for n in range(goals.shape[0]):
        for k in range(starting[n]):
            for i in range(6):
                q[i] = starts[n, k, i]
            if newton(sigma, D, goals[n], tolerance, q, work):
                count[n] = keep(sigma, q, found[n], count[n])
