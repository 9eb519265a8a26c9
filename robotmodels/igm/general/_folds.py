"""Compiled: postures near singular ones, where two merge (a fold) or an infinite family passes."""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from ...kernels._compile import (
    INTS,
    NOTHING,
    OUT3,
    STACK,
    VECTOR,
    Floats,
    Ints,
    compiled,
)
from ._linear import factor, smallest_vectors
from ._newton import COUNTS, MERGE, Work, distance, jacobian_of, keep, newton, pose_of, workspace

FLAGS = types.Array(types.boolean, 2, "C")
SMALL = 0.1  # smallest singular value of the Jacobian above which a posture is at no fold
SINGULAR = 1e-7  # and below which it is singular but for rounding
FLAT = 1e-6  # curvature along the null direction below which a posture is not at a fold
CLOSE = 0.3  # partners predicted farther away than this are left to the eigenvalues [rad]


@compiled()
def fold_at(
    sigma: Ints,
    D: Floats,
    root: Floats,
    q: Floats,
    u: Floats,
    v: Floats,
    work: Work,
) -> tuple[float, float]:
    """Smallest singular value of the Jacobian at a posture, and the curvature along its v.

    The curvature is ``h = u . d(J v) / ds`` on the line root + s v; ``u, v`` receive the vectors.
    """
    T, z, o, J, pivots, _, _ = work
    pose_of(sigma, D, root, T, z, o)
    jacobian_of(sigma, T, z, o, J)
    factor(J, pivots)
    small = smallest_vectors(J, pivots, u, v)
    h = 0.0
    if small > SMALL:
        return small, h
    for side in range(2):
        step = 1e-4 if side == 0 else -1e-4
        for i in range(6):
            q[i] = root[i] + step * v[i]
        pose_of(sigma, D, q, T, z, o)
        jacobian_of(sigma, T, z, o, J)
        for i in range(6):
            for j in range(6):
                h += u[i] * J[i, j] * v[j] / (2.0 * step)
    return small, h


@compiled(NOTHING(INTS, STACK, STACK, VECTOR, OUT3, COUNTS, FLAGS))
def partners(
    sigma: Ints,
    D: Floats,
    goals: Floats,
    tolerance: Floats,
    found: Floats,
    count: Ints,
    double: NDArray[np.bool_],
) -> None:
    """Find the other root of pairs that nearly merged, and flag those that did.

    Along the null direction v the error is ``s sigma + s^2 h / 2``, sigma the smallest singular
    value (left vector u), h = u . d(J v)/ds, so the partner is at ``s = -2 sigma / h``.
    """
    u, v, q, start = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    work = workspace()
    for n in range(goals.shape[0]):
        k = 0
        while k < count[n]:
            root = found[n, k]
            small, h = fold_at(sigma, D, root, q, u, v, work)
            double[n, k] = False
            k += 1
            # without curvature there is no fold: an infinite family, or a root of higher order
            if small > SMALL or abs(h) < FLAT or abs(h) * CLOSE < 2.0 * small:
                continue
            s = -2.0 * small / h
            for i in range(6):
                start[i] = root[i] + s * v[i]
            apart = distance(sigma, root, start)
            if apart <= MERGE:
                double[n, k - 1] = True
                continue
            # where all between the two meets the pose as well, one may be all there is to find
            merged = small * small < 2.0 * abs(h) * tolerance.min()
            reach = (1.5 if merged else 0.3) * apart
            known = False
            for j in range(count[n]):
                if j != k - 1 and distance(sigma, found[n, j], start) < reach:
                    known = True
            if known:
                continue
            for trial in range(2):
                for i in range(6):
                    q[i] = root[i] + s * (1.0 + 0.3 * trial) * v[i]
                before = count[n]
                if newton(sigma, D, goals[n], tolerance, q, work):
                    count[n] = keep(sigma, q, found[n], count[n])
                if count[n] > before:
                    break
            else:
                double[n, k - 1] = merged


@compiled(NOTHING(INTS, STACK, STACK, INTS, FLAGS))
def flat_singularities(
    sigma: Ints,
    D: Floats,
    found: Floats,
    count: Ints,
    flat: NDArray[np.bool_],
) -> None:
    """Flag postures at which the Jacobian is singular and stays so along its null direction."""
    u, v, q, root = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    work = workspace()
    for n in range(found.shape[0]):
        for k in range(count[n]):
            for i in range(6):
                root[i] = found[n, k, i]
            small, h = fold_at(sigma, D, root, q, u, v, work)
            flat[n, k] = small < SINGULAR and abs(h) < FLAT
