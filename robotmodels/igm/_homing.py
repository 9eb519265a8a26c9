"""Newton's method from many postures to the poses of an arm, branch by branch.

What `corrected_igm` does with the closed form of a nominal arm: every posture of a pose is brought
home to the calibrated arm on its own, with the exact derivative of the error of any mask (see
`numeric`). Square systems are solved by elimination, others and nearly singular ones by the
shortest step of a singular value decomposition.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import types
from numpy.typing import NDArray

from ..kernels import Chain
from ..kernels._compile import (
    CHAIN,
    INT,
    INTS,
    MATRIX,
    NOTHING,
    OUT2,
    OUT3,
    STACK,
    VECTOR,
    Floats,
    Ints,
    compiled,
)
from ..kernels._vectors import whole_matrix, whole_vector
from ..kernels.svd import orthogonal_rows
from ._pose_error import Arm, Goal, error_jacobian, forward, missing

__all__ = ["brought_home"]

FLAGS = types.Array(types.boolean, 2, "C", readonly=True)
JOINT_FLAGS = types.Array(types.boolean, 3, "C", readonly=True)

FLOOR = 5e-15  # error of a forward pass over an arm of metres
LONGEST = 0.5  # step of a joint [rad, or the length of the arm]
NEAR = 1e-7  # error below which a step is taken although it does not help at once
ROUNDED = 1e-14  # error below which one that does not help is rounding
PIVOT = 1e-7  # beside the largest, below which the elimination is left
DEPENDENT = 1e-10  # singular values beside the largest that count as zero

# error, Jacobian, its asked part with the error behind, rows, lengths, columns; axes and origins
Work = tuple[Floats, Floats, Floats, Floats, Floats, Ints, Floats, Floats]


@compiled()
def size_of(e: Floats, mask: Ints) -> float:
    """The larger of the missing translation [m] and rotation [rad] over what is asked."""
    linear = angular = 0.0
    for c in range(3):
        if mask[c]:
            linear += e[c] * e[c]
        if mask[3 + c]:
            angular += e[3 + c] * e[3 + c]
    return sqrt(max(linear, angular))


@compiled()
def look(q: Floats, goal: Goal, arm: Arm, mask: Ints, work: Work) -> float:
    """Error and Jacobian of a posture; the size of the error."""
    e, J, _, _, _, _, z, o = work
    R, p = forward(q, arm, z, o)
    phi = missing(R, p, goal, e)
    error_jacobian(p, phi, goal, arm, z, o, J)
    return size_of(e, mask)


@compiled()
def gathered(mask: Ints, held: NDArray[np.bool_], unit: Floats, length: float, work: Work) -> int:
    """The asked rows and free columns of the Jacobian, without units, the error behind them.

    Returns the number of free columns, whose places are in ``work``.
    """
    e, J, A, _, _, column, _, _ = work
    m = 0
    for i in range(held.shape[0]):
        if not held[i] and unit[i] > 0.0:
            column[m] = i
            m += 1
    r = 0
    for c in range(6):
        if mask[c]:
            s = 1.0 / length if c < 3 else 1.0
            for k in range(m):
                A[r, k] = s * J[c, column[k]] * unit[column[k]]
            A[r, m] = s * e[c]
            r += 1
    return m


@compiled()
def eliminated(A: Floats, n: int, x: Floats) -> bool:
    """Solve the square system ``A[:, :n] x = A[:, n]``, A is lost; False if nearly singular."""
    largest = 0.0
    for k in range(n):
        p = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[p, k]):
                p = i
        pivot = abs(A[p, k])
        largest = max(largest, pivot)
        if not pivot > PIVOT * largest:
            return False
        if p != k:
            for j in range(k, n + 1):
                A[p, j], A[k, j] = A[k, j], A[p, j]
        for i in range(k + 1, n):
            f = A[i, k] / A[k, k]
            for j in range(k + 1, n + 1):
                A[i, j] -= f * A[k, j]
    for k in range(n - 1, -1, -1):
        total = A[k, n]
        for j in range(k + 1, n):
            total -= A[k, j] * x[j]
        x[k] = total / A[k, k]
    return True


@compiled()
def least_of_square(A: Floats, n: int, B: Floats) -> float:
    """The least singular value or up to sqrt(n) times less: ``1 / |A^-1|``, Frobenius' norm."""
    for i in range(n):
        for j in range(n):
            B[i, j] = A[i, j]
            B[i, n + j] = 1.0 if i == j else 0.0
    for k in range(n):
        p = k
        for i in range(k + 1, n):
            if abs(B[i, k]) > abs(B[p, k]):
                p = i
        pivot = B[p, k]
        if not abs(pivot) > 1e-300:
            return 0.0
        for j in range(k, 2 * n):
            B[p, j], B[k, j] = B[k, j], B[p, j] / pivot
        for i in range(n):
            if i != k and B[i, k] != 0.0:
                f = B[i, k]
                for j in range(k, 2 * n):
                    B[i, j] -= f * B[k, j]
    total = 0.0
    for i in range(n):
        for j in range(n):
            total += B[i, n + j] * B[i, n + j]
    return 1.0 / sqrt(total)


@compiled()
def shortest(r: int, m: int, x: Floats, work: Work) -> float:
    """Least-squares step of least length for what `gathered` left; the least singular value.

    The least of min(r, m).
    """
    _, _, A, B, lengths, _, _, _ = work
    for k in range(m):
        x[k] = 0.0
    if r <= m:
        for i in range(r):
            for k in range(m + 1):
                B[i, k] = A[i, k]
        orthogonal_rows(B, r, m, m + 1, lengths)
        for i in range(r):
            if lengths[i] > DEPENDENT * lengths[0]:
                f = B[i, m] / (lengths[i] * lengths[i])
                for k in range(m):
                    x[k] += f * B[i, k]
        return lengths[r - 1]
    for k in range(m):
        for i in range(r):
            B[k, i] = A[i, k]
        for i in range(m):
            B[k, r + i] = 1.0 if i == k else 0.0
    orthogonal_rows(B, m, r, r + m, lengths)
    for k in range(m):
        if lengths[k] > DEPENDENT * lengths[0]:
            f = 0.0
            for i in range(r):
                f += B[k, i] * A[i, m]
            f /= lengths[k] * lengths[k]
            for i in range(m):
                x[i] += f * B[k, r + i]
    return lengths[m - 1]


@compiled()
def homed(
    q: Floats,
    held: NDArray[np.bool_],
    goal: Goal,
    arm: Arm,
    mask: Ints,
    asked: int,
    unit: Floats,
    length: float,
    steps: int,
    x: Floats,
    trial: Floats,
    best: Floats,
    work: Work,
) -> float:
    """Newton's method from ``q (n,)``, in place; the error left.

    A step that does not help is halved. Near the end it is taken all the same: along a valley that
    bends, a step misses by more than it corrects, and the next one makes up for it.
    """
    n = q.shape[0]
    column = work[5]
    trial[:] = q
    best[:] = q
    error = least = np.inf
    scale, m = 1.0, 0
    taken = worse = halved = 0
    # one look for the start, for steps and for halved ones: what is inlined twice compiles twice
    for count in range(4 * steps + 1):
        then = look(trial, goal, arm, mask, work)
        if count > 0 and not then < error:
            if error >= NEAR:
                if halved == 3:
                    break
                halved += 1
                scale *= 0.5
                for i in range(n):
                    trial[i] = q[i]
                for k in range(m):
                    trial[column[k]] += scale * x[k] * unit[column[k]]
                continue
            worse += 1
            if error < ROUNDED or worse > 3:
                break
        error = then
        for i in range(n):
            q[i] = trial[i]
        if error < least:
            least = error
            for i in range(n):
                best[i] = q[i]
        if taken == steps or not FLOOR < error < np.inf:
            break
        taken += 1
        halved = 0
        m = gathered(mask, held, unit, length, work)
        if m == 0:
            break
        if m != asked or not eliminated(work[2], m, x):
            gathered(mask, held, unit, length, work)
            shortest(asked, m, x, work)
        largest = 0.0
        for k in range(m):
            largest = max(largest, abs(x[k]))
        if not largest < 1e100:
            break
        scale = min(1.0, LONGEST / max(largest, LONGEST))
        for k in range(m):
            trial[column[k]] += scale * x[k] * unit[column[k]]
    for i in range(n):
        q[i] = best[i]
    return least


@compiled(
    NOTHING(
        STACK, STACK, OUT3, FLAGS, JOINT_FLAGS, CHAIN, INTS, MATRIX, VECTOR, INTS, VECTOR,
        types.float64, INT, OUT2, OUT2,
    )
)  # fmt: skip
def brought_home(
    targets: Floats,
    axes: Floats,
    q: Floats,
    there: NDArray[np.bool_],
    held: NDArray[np.bool_],
    chain: Chain,
    path: Ints,
    tool_rotation: Floats,
    tool_position: Floats,
    mask: Ints,
    unit: Floats,
    length: float,
    steps: int,
    residual: Floats,
    least: Floats,
) -> None:
    """Newton refinement of postures to given poses.

    Shapes: targets (N, 4, 4); axes (N, 3, 3); q, held (N, C, n); there (N, C); mask (6,); unit (n,)
    -> residual, least (N, C).
    """
    n = q.shape[2]
    rows = path.shape[0]
    wide = max(n, 6) + 1
    z, o = np.empty((rows, 3)), np.empty((rows, 3))
    e, J = np.zeros(6), np.zeros((6, n))
    A, B = np.zeros((6, wide)), np.zeros((wide, 2 * wide))
    lengths, column = np.zeros(wide), np.zeros(n, np.int64)
    x, trial, best = np.zeros(wide), np.zeros(n), np.zeros(n)
    free = np.zeros(n, np.bool_)
    work = (e, J, A, B, lengths, column, z, o)
    arm = (
        chain.sigma, chain.joint, chain.rotation, chain.position, whole_matrix(chain.base_rotation),
        whole_vector(chain.base_position), path, whole_matrix(tool_rotation),
        whole_vector(tool_position),
    )  # fmt: skip
    asked = 0
    for c in range(6):
        asked += mask[c]
    for s in range(targets.shape[0]):
        target = targets[s]
        R = (
            target[0, 0], target[0, 1], target[0, 2], target[1, 0], target[1, 1], target[1, 2],
            target[2, 0], target[2, 1], target[2, 2],
        )  # fmt: skip
        goal = (R, (target[0, 3], target[1, 3], target[2, 3]), whole_matrix(axes[s]))
        for c in range(q.shape[1]):
            residual[s, c] = np.inf
            least[s, c] = 0.0
            if not there[s, c]:
                continue
            residual[s, c] = homed(
                q[s, c], held[s, c], goal, arm, mask, asked, unit, length, steps, x, trial, best,
                work,
            )  # fmt: skip
            if steps == 0:
                continue
            # at the last look, a step of rounding away from where it arrived
            m = gathered(mask, free, unit, length, work)
            if m == asked:
                least[s, c] = least_of_square(A, m, B)
            elif m > 0:
                least[s, c] = shortest(asked, m, x, work)
