"""Compiled: which of many postures are singular, members of families, or settled ones.

Units as in `_correction`.
"""

from __future__ import annotations

from math import cos

import numpy as np
from numba import types
from numpy.typing import NDArray

from ...kernels._compile import INTS, STACK, Floats, Ints, compiled
from .._check import forward, jacobian
from ._correction import MET, bend, corrected, decomposed, way_between
from ._directions import PROBE, SINGULAR, directions, first_flat

MERGED = 2e-6  # double roots are postures closer than this; rounding parts them by half of it
_FLAGS = types.Array(types.boolean, 2, "C", readonly=True)
_FLAGS_OUT = types.Array(types.boolean, 2, "C")
_NUMBERS = types.Array(types.int64, 2, "C", readonly=True)
_NUMBERS_OUT = types.Array(types.int64, 2, "C")


@compiled()
def is_settled(
    sigma: Ints,
    D: Floats,
    U: Floats,
    q: Floats,
    free: int,
    W: Floats,
    s: Floats,
    V: Floats,
) -> int:
    """Which joints move along a family whose free joints are the first that do, as bits; else 0.

    Families with a fold beside them are not judged here.
    """
    k = sigma.size
    f = decomposed(sigma, D, q, 0, W, s, V)
    first = first_flat(s, f)
    null, freed = f - first, 0
    for m in range(k):
        freed += (free >> m) & 1
    if null == 0 or freed != null:
        return 0
    B, done, chosen, moving = np.empty((k, null)), 0, 0, 0
    y, ahead = np.empty(k), np.empty(k)
    for m in range(k):
        ahead[m] = q[m]
        for c in range(null):
            ahead[m] += PROBE * cos(1.0 + 2.3 * c) * V[m, first + c]
            if abs(V[m, first + c]) > 1e-6:
                moving |= 1 << m
        y[m] = ahead[m]
    # where a joint turns round it seems to be at rest: a member aside is asked which is the first
    if corrected(sigma, D, U, y, 0, null) > MET or way_between(y, ahead) > 0.2 * PROBE:
        return 0
    decomposed(sigma, D, y, 0, W, s, V)
    for m in range(k):
        for c in range(null):
            B[m, c] = V[m, first + c]
            if abs(B[m, c]) > 1e-6:
                moving |= 1 << m
    for m in range(k):
        pivot = done
        for c in range(done, null):
            if abs(B[m, c]) > abs(B[m, pivot]):
                pivot = c
        if done == null or abs(B[m, pivot]) < 1e-6:
            continue
        chosen |= 1 << m
        for r in range(k):
            B[r, done], B[r, pivot] = B[r, pivot], B[r, done]
        for c in range(done + 1, null):
            share = B[m, c] / B[m, done]
            for r in range(k):
                B[r, c] -= share * B[r, done]
        done += 1
    return moving if chosen == free and s[first] < SINGULAR else 0


@compiled(types.void(STACK, INTS, STACK, STACK, _NUMBERS, _FLAGS, _NUMBERS_OUT))
def settled_already(
    poses: Floats,
    sigma: Ints,
    D: Floats,
    q: Floats,
    free: Ints,
    family: NDArray[np.bool_],
    moving: Ints,
) -> None:
    """Joints that move (bits, ``(N, S)``) at postures ``q (N, S, k)`` of settled families, or 0."""
    k = sigma.size
    W, s, V = np.empty((6, k)), np.empty(k), np.empty((k, k))
    for n in range(q.shape[0]):
        for r in range(q.shape[1]):
            moving[n, r] = 0
            if family[n, r]:
                moving[n, r] = is_settled(sigma, D, poses[n], q[n, r], free[n, r], W, s, V)


@compiled()
def well_placed(J: Floats) -> bool:
    """Whether ``J (6, 6)``, overwritten, is far from singular, from the pivots of elimination."""
    for c in range(6):
        best = c
        for r in range(c + 1, 6):
            if abs(J[r, c]) > abs(J[best, c]):
                best = r
        if not abs(J[best, c]) > 1e-4:
            return False
        if best != c:
            for m in range(c, 6):
                J[c, m], J[best, m] = J[best, m], J[c, m]
        for r in range(c + 1, 6):
            share = J[r, c] / J[c, c]
            for m in range(c + 1, 6):
                J[r, m] -= share * J[c, m]
    return True


@compiled(types.void(INTS, STACK, STACK, _FLAGS, _FLAGS_OUT, _FLAGS_OUT))
def singular_postures(
    sigma: Ints,
    D: Floats,
    q: Floats,
    there: NDArray[np.bool_],
    double: NDArray[np.bool_],
    member: NDArray[np.bool_],
) -> None:
    """Postures ``q (N, S, k)`` whose Jacobian is singular: alone there, or one of a family."""
    k = sigma.size
    P, axes, J = np.empty((3, 4)), np.empty((k, 6)), np.empty((6, k))
    rows = np.empty((24, k))
    W, s, V = np.empty((6, k)), np.empty(k), np.empty((k, k))
    for n in range(q.shape[0]):
        for r in range(q.shape[1]):
            double[n, r] = member[n, r] = False
            if not there[n, r]:
                continue
            forward(sigma, D, q[n, r], P, axes)
            jacobian(sigma, P, axes, J)
            if k == 6 and well_placed(J):
                continue
            count, null = directions(sigma, D, P, q[n, r], 0, rows)
            double[n, r], member[n, r] = null > 0 and count == 0, count > 0
            if null == 1 and count == 0 and k == 6:
                # the other root is twice as far as the singularity, if there is one near
                decomposed(sigma, D, q[n, r], 0, W, s, V)
                if s[5] > 1e-12:
                    slope = abs(bend(sigma, D, q[n, r], W, s, V, 5))
                    double[n, r] = 2.0 * s[5] < MERGED * slope
