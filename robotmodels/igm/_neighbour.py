"""From the postures of a structured neighbour to those of the arm itself, branch by branch.

Lengths are in units of the arm. A regular branch arrives by Newton's method in three or four
steps; one that does not is followed while the neighbour is changed into the arm (homotopy), and
what the pose has beside near singular postures is searched along valleys (`_neighbour_valley`).
"""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from ..kernels._compile import INTS, NOTHING, OUT2, OUT3, STACK, Floats, Ints, compiled
from ._check import forward, jacobian, missing, wrapped
from ._neighbour_linear import anywhere, factor, smallest_singular, solve

Work = tuple[Floats, Floats, Floats, Ints, Floats, Floats, Floats, Floats]

MERGE = 1e-6  # postures closer than this in every joint are one [rad, or lengths of the arm]
MET = 1e-11  # error of a posture that has arrived
EXACT = 1e-8  # error of a posture of the neighbour, and not only its best approach
FLOOR = 3e-15  # error below which a step gains nothing
LONGEST = 0.5  # longest step of a joint

PATH = types.Array(types.float64, 4, "C", readonly=True)
FLAGS_IN = types.Array(types.boolean, 2, "C", readonly=True)
FLAGS = types.Array(types.boolean, 2, "C")
COUNTS = types.Array(types.int64, 1, "C")
MARKS = types.Array(types.int64, 2, "C")
DOUBTS = types.Array(types.boolean, 1, "C")


@compiled()
def workspace() -> Work:
    """Arrays that `newton` and the functions built on it write to."""
    return (
        np.zeros((3, 4)), np.zeros((6, 6)), np.zeros((6, 6)), np.zeros(6, np.int64),
        np.zeros(6), np.zeros(6), np.zeros(6), np.zeros(6),
    )  # fmt: skip


@compiled()
def error_at(sigma: Ints, D: Floats, U: Floats, q: Floats, work: Work) -> float:
    """The larger of the position and the angle missing; their vector stays in ``work``."""
    forward(sigma, D, q, work[0], work[1])
    way, angle = missing(U, work[0], work[4])
    return max(way, angle)


@compiled()
def factored_jacobian(sigma: Ints, work: Work) -> None:
    """LU factors of the Jacobian where the arm was last put."""
    P, axes, J, pivots, _, _, _, _ = work
    jacobian(sigma, P, axes, J)
    factor(J, pivots)


@compiled()
def newton(sigma: Ints, D: Floats, U: Floats, q: Floats, steps: int, work: Work) -> float:
    """Newton's method from ``q (6,)``, in place; the error left.

    A step that does not help is halved. Near the end it is taken all the same: along a valley that
    bends, a step misses by more than it corrects, and the next one makes up for it.
    """
    e, trial, way, best = work[4], work[5], work[6], work[7]
    error = error_at(sigma, D, U, q, work)
    least = error
    for k in range(6):
        best[k] = q[k]
    worse = 0
    for _ in range(steps):
        if not FLOOR < error < np.inf:
            break
        factored_jacobian(sigma, work)
        solve(work[2], work[3], e)
        largest = 0.0
        for k in range(6):
            largest = max(largest, abs(e[k]))
        if not largest < 1e100:
            break
        scale = min(1.0, LONGEST / largest)
        for k in range(6):
            way[k] = e[k]
        then = np.inf
        for _ in range(4):
            for k in range(6):
                trial[k] = q[k] + scale * way[k]
            then = error_at(sigma, D, U, trial, work)
            if then < error or error < 1e-7:
                break
            scale *= 0.5
        if not then < error:
            worse += 1
            # rounding, or no convergence
            if error >= 1e-7 or error < 1e-14 or worse > 3:
                break
        error = then
        for k in range(6):
            q[k] = trial[k]
        if error < least:
            least = error
            for k in range(6):
                best[k] = q[k]
    for k in range(6):
        q[k] = best[k]
    return least


@compiled()
def distance(sigma: Ints, a: Floats, b: Floats) -> float:
    """Largest difference of two postures over the joints."""
    largest = 0.0
    for k in range(6):
        d = a[k] - b[k]
        largest = max(largest, abs(wrapped(d)) if sigma[k] == 0 else abs(d))
    return largest


@compiled()
def keep(sigma: Ints, q: Floats, found: Floats, count: int) -> int:
    """Add ``q (6,)`` to ``found (16, 6)`` unless it is there; the new number."""
    for k in range(count):
        if distance(sigma, q, found[k]) < MERGE:
            return count
    if count < found.shape[0]:
        for k in range(6):
            found[count, k] = wrapped(q[k]) if sigma[k] == 0 else q[k]
        count += 1
    return count


@compiled(
    NOTHING(
        INTS, STACK, STACK, STACK, OUT3, FLAGS, types.float64, types.float64,
        types.float64, OUT3, COUNTS, FLAGS, COUNTS, FLAGS, OUT2, DOUBTS,
    )
)  # fmt: skip
def arrivals(
    sigma: Ints,
    near: Floats,
    D: Floats,
    goals: Floats,
    candidates: Floats,
    there: NDArray[np.bool_],
    reach: float,
    small: float,
    jump: float,
    found: Floats,
    count: Ints,
    arrived: NDArray[np.bool_],
    exact: Ints,
    doubtful: NDArray[np.bool_],
    moved: Floats,
    doubt: NDArray[np.bool_],
) -> None:
    """Newton's method from every candidate ``(N, C, 6)`` of the neighbour ``near`` to arm ``D``.

    ``exact (N,)`` counts candidates that are postures of the neighbour; candidates are overwritten.
    ``doubtful (N, C)``: not converged, ``moved`` more than ``jump``, merged, or nearly singular.
    """
    work = workspace()
    q, u, v = np.zeros(6), np.zeros(6), np.zeros(6)
    for n in range(goals.shape[0]):
        for c in range(candidates.shape[1]):
            if not there[n, c]:
                continue
            for k in range(6):
                q[k] = candidates[n, c, k]
            error = error_at(sigma, near, goals[n], q, work)
            if not error <= reach:
                there[n, c] = False
                continue
            start_is_exact = error < EXACT
            if start_is_exact:
                exact[n] += 1
            if not newton(sigma, D, goals[n], q, 10, work) <= MET:
                doubtful[n, c] = doubt[n] = True
                continue
            arrived[n, c] = True
            before = count[n]
            count[n] = keep(sigma, q, found[n], count[n])
            moved[n, c] = distance(sigma, q, candidates[n, c])
            for k in range(6):
                candidates[n, c, k] = q[k]
            if count[n] == before or moved[n, c] > jump or not start_is_exact:
                doubtful[n, c] = doubt[n] = True
                continue
            factored_jacobian(sigma, work)
            anywhere(u)
            if smallest_singular(work[2], work[3], u, v, 2) < small:
                doubtful[n, c] = doubt[n] = True


@compiled()
def follow(sigma: Ints, path: Floats, U: Floats, q: Floats, last: Floats, work: Work) -> int:
    """Follow a posture of ``path[0]`` to the last arm of ``path (m, 7, 4, 4)``, in place.

    Returns the place on the path that was reached; ``last`` is overwritten.
    """
    end = path.shape[0] - 1
    if not error_at(sigma, path[0], U, q, work) < EXACT:
        return 0
    at, step = 0, 4
    trial, slope = np.zeros(6), np.zeros(6)
    for k in range(6):
        last[k] = q[k]
    while at < end:
        onto = min(at + step, end)
        for k in range(6):
            trial[k] = q[k] + (onto - at) * slope[k]
        met = newton(sigma, path[onto], U, trial, 8, work) <= 1e-9
        if met and distance(sigma, trial, q) < 0.15 * (1.0 + 0.5 * step):
            for k in range(6):
                slope[k] = (trial[k] - q[k]) / (onto - at)
                q[k] = trial[k]
            at = onto
            step = min(2 * step, 8)
        elif step == 1:
            break
        else:
            step //= 2
    return at


@compiled(NOTHING(INTS, PATH, STACK, OUT3, FLAGS_IN, FLAGS, OUT3, COUNTS))
def followed(
    sigma: Ints,
    path: Floats,
    goals: Floats,
    candidates: Floats,
    there: NDArray[np.bool_],
    arrived: NDArray[np.bool_],
    found: Floats,
    count: Ints,
) -> None:
    """Follow the candidates that have not arrived; they are overwritten by how far each came."""
    work = workspace()
    last = np.zeros(6)
    D = path[path.shape[0] - 1]
    for n in range(goals.shape[0]):
        for c in range(candidates.shape[1]):
            if not there[n, c] or arrived[n, c]:
                continue
            q = candidates[n, c]
            at = follow(sigma, path, goals[n], q, last, work)
            if at == path.shape[0] - 1 and newton(sigma, D, goals[n], q, 10, work) <= MET:
                arrived[n, c] = True
                count[n] = keep(sigma, q, found[n], count[n])


@compiled(NOTHING(INTS, STACK, STACK, STACK, FLAGS, FLAGS, OUT3, COUNTS))
def tried(
    sigma: Ints,
    D: Floats,
    goals: Floats,
    starts: Floats,
    there: NDArray[np.bool_],
    arrived: NDArray[np.bool_],
    found: Floats,
    count: Ints,
) -> None:
    """Newton's method from starts ``(N, C, 6)``; what meets the pose is kept."""
    work = workspace()
    q = np.zeros(6)
    for n in range(goals.shape[0]):
        for c in range(starts.shape[1]):
            if not there[n, c]:
                continue
            for k in range(6):
                q[k] = starts[n, c, k]
            if newton(sigma, D, goals[n], q, 15, work) <= MET:
                arrived[n, c] = True
                count[n] = keep(sigma, q, found[n], count[n])
