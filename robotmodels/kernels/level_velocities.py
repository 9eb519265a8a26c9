"""Joint velocities for levels of tasks in strict order, with or without bounds, row by row.

Each level moves only in the freedom that those above leave, held as orthonormal rows F: its
Jacobian there is decomposed (`orthogonal_rows`), inverted by a method (`inverse_factors`), and the
right singular vectors it uses, weak ones included, leave the freedom. Lower levels thus cannot
move the tasks of higher ones, however either is damped.
"""

from math import sqrt

import numpy as np

from ._compile import INT, INTS, MATRIX, NOTHING, OUT2, STACK, VECTOR, Floats, Ints, compiled
from .bounded_velocity import cleared, complement, largest_part
from .inverse_factors import PSEUDO_INVERSE, inverse_factors
from .svd import orthogonal_rows

__all__ = ["level_velocities"]

_NOTHING = 1e-13
"""Singular value beside the longest row of the level's Jacobian that counts as zero: it moves the
task by rounding errors, and its direction is free for lower levels."""

_STUCK = 1e-12
"""Length of a joint's column of F, beside those of others, that counts as zero."""


@compiled()
def decomposed(W: Floats, m: int, f: int, B: Floats, lengths: Floats, U: Floats, V: Floats) -> None:
    """Singular value decomposition of ``W (m, f)``: singular vectors as rows of U and V.

    B is work. Rows of V whose singular value is zero are zero.
    """
    for i in range(m):
        for c in range(f):
            B[i, c] = W[i, c]
        for c in range(m):
            B[i, f + c] = 1.0 if i == c else 0.0
    orthogonal_rows(B, m, f, f + m, lengths)
    for i in range(m):
        for c in range(m):
            U[i, c] = B[i, f + c]
    for i in range(min(m, f)):
        for c in range(f):
            V[i, c] = B[i, c] / lengths[i] if lengths[i] > 0.0 else 0.0


@compiled()
def narrowed(F: Floats, V: Floats, f: int, G: Floats) -> None:
    """Turn the f rows of F to the basis V of their space; G is work."""
    n = F.shape[1]
    for i in range(f):
        for j in range(n):
            G[i, j] = 0.0
            for c in range(f):
                G[i, j] += V[i, c] * F[c, j]
    for i in range(f):
        for j in range(n):
            F[i, j] = G[i, j]


@compiled()
def freed(F: Floats, f: int, stuck: Ints, V: Floats, G: Floats) -> int:
    """Take out of the f rows of F what moves joints that are stuck; how many rows are left."""
    n = F.shape[1]
    r = 0
    for j in range(n):
        if stuck[j] == 0 or r == f:
            continue
        for c in range(f):
            V[r, c] = F[c, j]
        length = sqrt(cleared(V[r], V, r, f, G[0]))
        if length > _STUCK:
            for c in range(f):
                V[r, c] /= length
            r += 1
    if r == 0:
        return f
    complement(V, r, f)
    narrowed(F, V, f, G)
    for a in range(r, f):
        for j in range(n):
            F[a - r, j] = F[a, j]
    return f - r


@compiled(
    NOTHING(
        STACK, MATRIX, MATRIX, VECTOR, INTS, MATRIX, MATRIX, MATRIX, INT, VECTOR, VECTOR,
        OUT2, OUT2, OUT2, OUT2,
    )
)  # fmt: skip
def level_velocities(
    J: Floats,
    rate: Floats,
    drift: Floats,
    row_weights: Floats,
    starts: Ints,
    secondary: Floats,
    lower: Floats,
    upper: Floats,
    bounded: int,
    joint_roots: Floats,
    method: Floats,
    v: Floats,
    scale: Floats,
    mixed: Floats,
    error: Floats,
) -> None:
    """Velocities of N rows: levels stacked, level l has the rows starts[l] to starts[l + 1].

    Shapes: J (N, M, n); rate, drift (N, M); row_weights (M,); starts (L + 1,); secondary, lower,
    upper (N, n); method (4,) -> v (N, n); scale, mixed (N, L); error (N, M).
    """
    N, M, n = J.shape
    L = starts.shape[0] - 1
    most = 1
    for level in range(L):
        most = max(most, starts[level + 1] - starts[level])
    wide = max(most, n)
    B = np.empty((wide, wide + wide))
    W, U, V = np.empty((wide, wide)), np.empty((wide, wide)), np.empty((wide, wide))
    A = np.empty((wide, n))
    F, G = np.empty((n, n)), np.empty((n, n))
    sigma, inner, factors, rest = np.empty(wide), np.empty(wide), np.empty(wide), np.empty(wide)
    x, w, wish, zero = np.empty(n), np.empty(n), np.empty(n), np.zeros(n)
    bounds, found, before = np.empty((2, n)), np.empty(n), np.empty(n)
    spare, basis, marks = np.empty((5, n)), np.empty((2, n, n)), np.zeros((3, n), np.int64)
    at, stuck, parts = marks[0], marks[1], spare[3]
    kind, threshold, largest, speed = int(method[0]), method[1], method[2], method[3]
    for i in range(N):
        # weighted joints are u = root * v, so that least norms are plain
        for j in range(n):
            wish[j] = secondary[i, j] * joint_roots[j]
            x[j] = 0.0
            at[j] = 0
            if bounded:
                bounds[0, j] = lower[i, j] * joint_roots[j]
                bounds[1, j] = upper[i, j] * joint_roots[j]
            for c in range(n):
                F[j, c] = 1.0 if j == c else 0.0
        f = n
        for level in range(L):
            first, m = starts[level], starts[level + 1] - starts[level]
            longest = 0.0
            for a in range(m):
                total = 0.0
                for j in range(n):
                    A[a, j] = row_weights[first + a] * J[i, first + a, j] / joint_roots[j]
                    total += A[a, j] * A[a, j]
                longest = max(longest, total)
                rest[a] = -row_weights[first + a] * drift[i, first + a]
                for j in range(n):
                    rest[a] -= A[a, j] * x[j]
                for c in range(f):
                    W[a, c] = 0.0
                    for j in range(n):
                        W[a, c] += A[a, j] * F[c, j]
            longest = sqrt(longest)
            decomposed(W, m, f, B, sigma, U, V)
            k = min(m, f)
            rank = 0
            while rank < k and sigma[rank] > _NOTHING * longest:
                rank += 1
            for a in range(rank):
                inner[a] = 0.0
                for b in range(m):
                    asked = rest[b] + row_weights[first + b] * rate[i, first + b]
                    inner[a] += U[a, b] * asked
            # relative to the level's own Jacobian, not to what is left of it
            none = max(_NOTHING, threshold if kind == PSEUDO_INVERSE else 0.0) * longest
            inverse_factors(kind, threshold, largest, speed, sigma, inner, rank, none, factors)
            complement(V, rank, f)
            narrowed(F, V, f, G)
            # v = x + s w + (rows of F from the rank on)^T y
            for j in range(n):
                before[j] = x[j]
                w[j] = 0.0
            for a in range(rank):
                asked, fixed = 0.0, 0.0
                for b in range(m):
                    asked += U[a, b] * row_weights[first + b] * rate[i, first + b]
                    fixed += U[a, b] * rest[b]
                for j in range(n):
                    x[j] += factors[a] * fixed * F[a, j]
                    w[j] += factors[a] * asked * F[a, j]
            for a in range(rank, f):
                for j in range(n):
                    G[a - rank, j] = F[a, j]
            s, mixed[i, level] = 1.0, 0.0
            if bounded:
                s = largest_part(x, w, G, f - rank, wish, bounds, found, marks, spare, basis)
            if s < 0.0:
                # No part of the rate alone fits: from the least motion without the level, which
                # fits, as far as possible towards all that the level asks.
                mixed[i, level] = 1.0
                largest_part(before, zero, F, f, zero, bounds, found, marks, spare, basis)
                for j in range(n):
                    w[j] += x[j]
                    x[j] = found[j]
                cleared(x, G, f - rank, n, parts)
                for j in range(n):
                    w[j] -= x[j]
                s = largest_part(x, w, G, f - rank, wish, bounds, found, marks, spare, basis)
                if s < 0.0:  # the start fits but for rounding
                    s = 0.0
                    for j in range(n):
                        w[j] = 0.0
                    largest_part(x, w, G, f - rank, wish, bounds, found, marks, spare, basis)
            scale[i, level] = s
            f -= rank
            for a in range(f):
                for j in range(n):
                    F[a, j] = G[a, j]
            if s == 1.0:
                for j in range(n):
                    x[j] += w[j]
            else:
                f = freed(F, f, stuck, V, G)
                for j in range(n):
                    x[j] = found[j]
                cleared(x, F, f, n, parts)
        if not bounded:
            for j in range(n):
                found[j] = wish[j]
            cleared(found, F, f, n, parts)
            for j in range(n):
                v[i, j] = (x[j] + wish[j] - found[j]) / joint_roots[j]
        else:
            if L == 0:
                largest_part(x, zero, F, f, wish, bounds, found, marks, spare, basis)
            for j in range(n):
                value = min(max(found[j] / joint_roots[j], lower[i, j]), upper[i, j])
                if at[j] != 0:
                    value = upper[i, j] if at[j] > 0 else lower[i, j]
                v[i, j] = value
        for a in range(M):
            total = rate[i, a] - drift[i, a]
            for j in range(n):
                total -= J[i, a, j] * v[i, j]
            error[i, a] = total
