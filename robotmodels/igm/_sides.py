"""Signs of the geometric products whose zeros are the singular positions of an arm."""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from ..kernels._compile import INT, INTS, STACK, Floats, Ints, compiled
from ._check import forward

_CODES = types.Array(types.int16, 2, "C")
_CODES_IN = types.Array(types.int16, 2, "C", readonly=True)
_FLAGS = types.Array(types.boolean, 2, "C", readonly=True)


@compiled()
def triple(a: Floats, b: Floats, c: Floats) -> float:
    """``a . (b x c)``."""
    return (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )


@compiled()
def nearest_on(first: Floats, second: Floats, point: Floats) -> None:
    """The point of the first line that is nearest to the second; its origin if parallel."""
    a, b = first[:3], second[:3]
    n = np.empty(3)
    n[0], n[1], n[2] = (
        a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0],
    )  # fmt: skip
    size = n[0] * n[0] + n[1] * n[1] + n[2] * n[2]
    way = 0.0
    if size > 1e-12:
        way = triple(second[3:] - first[3:], b, n) / size
    for i in range(3):
        point[i] = first[3 + i] + way * a[i]


@compiled()
def velocity(axis: Floats, turning: bool, point: Floats, v: Floats) -> None:
    """Velocity of a point that an axis moves."""
    if turning:
        x, y, z = point[0] - axis[3], point[1] - axis[4], point[2] - axis[5]
        v[0], v[1] = axis[1] * z - axis[2] * y, axis[2] * x - axis[0] * z
        v[2] = axis[0] * y - axis[1] * x
    else:
        v[0], v[1], v[2] = axis[0], axis[1], axis[2]


@compiled(types.void(INTS, STACK, INTS, INT, STACK, _FLAGS, _CODES))
def sides(
    sigma: Ints,
    D: Floats,
    order: Ints,
    parallel: int,
    q: Floats,
    valid: NDArray[np.bool_],
    code: NDArray[np.int16],
) -> None:
    """Number of the label of each posture: 4 for shoulder-, 2 for elbow-, 1 for wrist-."""
    P, axes, W = np.zeros((3, 4)), np.zeros((6, 6)), np.zeros(3)
    u, v, w = np.zeros(3), np.zeros(3), np.zeros(3)
    a, b, c, d, e, f = order[0], order[1], order[2], order[3], order[4], order[5]
    for p in range(q.shape[0]):
        for i in range(q.shape[1]):
            code[p, i] = -1
            if not valid[p, i]:
                continue
            forward(sigma, D, q[p, i], P, axes)
            if parallel:
                # a | b c d parallel | e | f
                nearest_on(axes[f], axes[e], W)
                velocity(axes[a], True, W, u)
                shoulder = u[0] * axes[b, 0] + u[1] * axes[b, 1] + u[2] * axes[b, 2]
                wrist = triple(axes[e, :3], axes[b, :3], axes[f, :3])
                elbow = triple(axes[b, :3], axes[c, 3:] - axes[b, 3:], axes[d, 3:] - axes[c, 3:])
            else:
                nearest_on(axes[d], axes[e], W)
                wrist = triple(axes[d, :3], axes[e, :3], axes[f, :3])
                velocity(axes[a], sigma[a] == 0, W, u)
                velocity(axes[b], sigma[b] == 0, W, v)
                velocity(axes[c], sigma[c] == 0, W, w)
                shoulder, elbow = 1.0, triple(u, v, w)
                if sigma[a] == 0 and sigma[b] == 0:
                    shoulder = u[0] * axes[b, 0] + u[1] * axes[b, 1] + u[2] * axes[b, 2]
                    elbow = elbow if shoulder >= 0.0 else -elbow
            code[p, i] = (
                4 * int(shoulder < 0.0) + 2 * int(elbow < 0.0) + int(wrist < 0.0)
            )  # fmt: skip


@compiled(types.void(STACK, STACK, _FLAGS, _CODES))
def arm_sides(D: Floats, q: Floats, valid: NDArray[np.bool_], code: NDArray[np.int16]) -> None:
    """The same for seven joints with a spherical shoulder (1 to 3) and wrist (5 to 7)."""
    sigma = np.zeros(7, np.int64)
    P, axes = np.zeros((3, 4)), np.zeros((7, 6))
    S, W = np.zeros(3), np.zeros(3)
    for p in range(q.shape[0]):
        for i in range(q.shape[1]):
            code[p, i] = -1
            if not valid[p, i]:
                continue
            forward(sigma, D, q[p, i], P, axes)
            nearest_on(axes[1], axes[2], S)
            nearest_on(axes[5], axes[4], W)
            shoulder = triple(axes[0, :3], axes[1, :3], axes[2, :3])
            elbow = triple(axes[3, :3], axes[3, 3:] - S, W - axes[3, 3:])
            wrist = triple(axes[4, :3], axes[5, :3], axes[6, :3])
            code[p, i] = 4 * int(shoulder < 0.0) + 2 * int(elbow < 0.0) + int(wrist < 0.0)


@compiled(types.void(STACK, _FLAGS, _CODES_IN, _CODES))
def ranks(
    q: Floats, valid: NDArray[np.bool_], code: NDArray[np.int16], rank: NDArray[np.int16]
) -> None:
    """How many postures of the same pose and code come before one, in ascending joint values."""
    N, S, k = q.shape
    for p in range(N):
        for i in range(S):
            if not valid[p, i]:
                continue
            for j in range(S):
                if j == i or not valid[p, j] or code[p, j] != code[p, i]:
                    continue
                for m in range(k):
                    if abs(q[p, i, m] - q[p, j, m]) > 1e-9:
                        rank[p, i] += int(q[p, j, m] < q[p, i, m])
                        break
