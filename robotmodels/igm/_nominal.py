"""Compiled: from the solutions of a structured arm to those of the arm that it stands for.

Lengths are in units of the arm. Newton's method takes most solutions over in three or four steps.
Where the structured arm is singular, its solutions may split, merge or vanish: there the curve of
configurations that meet the pose but for one direction is followed (`kernels.continuation`).
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import types
from numpy.typing import NDArray

from ..kernels import continuation as curves
from ..kernels._compile import INTS, MATRIX, NOTHING, OUT3, STACK, VECTOR, Floats, Ints, compiled
from ._check import forward, jacobian, missing, wrapped

Data = tuple[Ints, Floats, Floats, Floats, Floats]

MERGE = 1e-6  # solutions closer than this in every joint are one [rad, or lengths of the arm]
MET = 1e-11  # error of a solution
EXACT = 1e-8  # error of a solution of the structured arm, and not only its best approach
FLOOR = 3e-15  # error below which a step gains nothing
LONGEST = 0.5  # longest Newton step of a joint
STRIDE, SHORTEST = 0.1, 1e-3  # steps along a curve
FINE = 1e-9  # error of points of a curve
ROWS, MIDDLE = 512, 256  # points of a curve
POINTS = 4000  # points of curves remembered for a pose
NARROW = 10  # points that an infinite set of solutions within a tolerance has at least

COUNTS = types.Array(types.int64, 1, "C")
MARKS = types.Array(types.int64, 2, "C")
FLAGS = types.Array(types.boolean, 2, "C")
DOUBTS = types.Array(types.boolean, 1, "C")


@compiled()
def pose_residual(q: Floats, data: Data, F: Floats, J: Floats) -> None:
    """Pose error of a configuration, actual minus requested, and its derivative."""
    sigma, D, U, P, axes = data
    forward(sigma, D, q, P, axes)
    missing(U, P, F)
    for i in range(6):
        F[i] = -F[i]
    jacobian(sigma, P, axes, J)


correct, begin, trace, solutions = curves.curves_of(pose_residual)


@compiled()
def size(F: Floats) -> float:
    """The larger of the position error and the angle."""
    linear = F[0] * F[0] + F[1] * F[1] + F[2] * F[2]
    return sqrt(max(linear, F[3] * F[3] + F[4] * F[4] + F[5] * F[5]))


@compiled()
def newton(data: Data, q: Floats, best: Floats, work: curves.Work) -> float:
    """Newton's method from ``q (6,)``, in place; the error left, F and J are those of the end.

    An error may grow for some steps: along a nearly singular curve that bends, a step misses by
    more than it corrects, and the next one makes up for it.
    """
    F, J, _, pivots, _ = work
    least, worse = np.inf, 0
    for _ in range(20):
        pose_residual(q, data, F, J)
        error = size(F)
        worse += error > 0.7 * least
        if error < least:
            least = error
            for k in range(6):
                best[k] = q[k]
        if not FLOOR < error < np.inf or worse > 3:
            break
        curves.factor(J, pivots)
        curves.solve(J, pivots, F, False)
        longest = 0.0
        for k in range(6):
            longest = max(longest, abs(F[k]))
        if not longest < 1e100:
            break
        for k in range(6):
            q[k] -= F[k] * min(1.0, LONGEST / max(longest, LONGEST))
    for k in range(6):
        q[k] = wrapped(best[k]) if data[0][k] == 0 else best[k]
    return least


@compiled()
def flatness(data: Data, q: Floats, u: Floats, v: Floats, work: curves.Work) -> float:
    """Smallest singular value of the Jacobian, about."""
    pose_residual(q, data, work[0], work[1])
    curves.any_direction(u, v)
    curves.singular_vectors(u, v, work)
    return abs(curves.singular_vectors(u, v, work))


@compiled()
def distance(sigma: Ints, a: Floats, b: Floats) -> float:
    """Largest difference of two configurations over the joints."""
    largest = 0.0
    for k in range(6):
        d = a[k] - b[k]
        largest = max(largest, abs(wrapped(d)) if sigma[k] == 0 else abs(d))
    return largest


@compiled()
def is_near(sigma: Ints, q: Floats, points: Floats, count: int) -> bool:
    """Whether a configuration is next to one of the first points of curves."""
    near = False
    for m in range(count):
        near = near or distance(sigma, q, points[m]) < 0.7 * STRIDE
    return near


@compiled()
def keep(sigma: Ints, q: Floats, found: Floats, count: int) -> int:
    """Row of ``q (6,)`` in ``found (16, 6)``, written there if it is new; 16 if all are taken."""
    for k in range(count):
        if distance(sigma, q, found[k]) < MERGE:
            return k
    if count < found.shape[0]:
        for k in range(6):
            found[count, k] = q[k]
    return count


@compiled(
    NOTHING(INTS, STACK, STACK, STACK, OUT3, FLAGS, VECTOR, OUT3, COUNTS, COUNTS, FLAGS, DOUBTS)
)
def refined(
    sigma: Ints,
    near: Floats,
    D: Floats,
    goals: Floats,
    candidates: Floats,
    there: NDArray[np.bool_],
    limits: Floats,
    found: Floats,
    count: Ints,
    exact: Ints,
    arrived: NDArray[np.bool_],
    doubt: NDArray[np.bool_],
) -> None:
    """Newton's method from the solutions ``(N, C, 6)`` of arm ``near`` to arm ``D``, overwritten.

    Limits: error of ``near``, motion of a joint, smallest singular value. A pose is in ``doubt``
    where a solution vanishes, merges, moves far or is nearly singular; ``exact`` counts solutions.
    """
    work = curves.workspace(6)
    P, axes, q, best = np.zeros((3, 4)), np.zeros((6, 6)), np.zeros(6), np.zeros(6)
    u, v = np.zeros(6), np.zeros(6)
    reach, jump, small = limits
    for n in range(goals.shape[0]):
        data = (sigma, D, goals[n], P, axes)
        for c in range(candidates.shape[1]):
            if not there[n, c]:
                continue
            for k in range(6):
                q[k] = candidates[n, c, k]
            pose_residual(q, (sigma, near, goals[n], P, axes), work[0], work[1])
            error = size(work[0])
            if not error <= reach:
                there[n, c] = False
                continue
            exact[n] += error < EXACT
            if newton(data, q, best, work) > MET:
                doubt[n] = True
                continue
            arrived[n, c] = True
            row = keep(sigma, q, found[n], count[n])
            moved = distance(sigma, q, candidates[n, c])
            for k in range(6):
                candidates[n, c, k] = q[k]
            if (
                row < count[n]
                or moved > jump
                or error >= EXACT
                or flatness(data, q, u, v, work) < small
            ):
                doubt[n] = True
            count[n] = max(count[n], min(row + 1, found.shape[1]))


@compiled()
def representative(
    data: Data,
    curve: curves.Curve,
    first: int,
    last: int,
    reference: Floats,
    q: Floats,
    u: Floats,
    v: Floats,
    work: curves.Work,
) -> int:
    """Point of a curve where the first joint that moves is at its reference, or next to it, into q.

    Returns the joint.
    """
    points, _, lefts, _, _ = curve
    sigma, joint, nearest, least = data[0], 5, first, np.inf
    for k in range(5, -1, -1):
        for m in range(first, last + 1):
            if abs(points[m, k] - points[first, k]) > STRIDE:
                joint = k
    for m in range(first, last + 1):
        gap = reference[joint] - points[m, joint]
        gap = wrapped(gap) if sigma[joint] == 0 else gap
        if abs(gap) < abs(least):
            nearest, least = m, gap
    for k in range(6):
        q[k], u[k] = points[nearest, k], lefts[nearest, k]
        v[k] = 1.0 if k == joint else 0.0
    if abs(least) < STRIDE:
        target = q[joint] + least
        q[joint] = target
        correct(data, q, u, v, work, FINE)
        q[joint] = target  # rounding, as v has changed
    return joint


@compiled(NOTHING(INTS, STACK, STACK, STACK, FLAGS, MATRIX, VECTOR, OUT3, COUNTS, FLAGS, MARKS))
def continued(
    sigma: Ints,
    D: Floats,
    goals: Floats,
    starts: Floats,
    there: NDArray[np.bool_],
    references: Floats,
    limits: Floats,
    found: Floats,
    count: Ints,
    double: NDArray[np.bool_],
    free: Ints,
) -> None:
    """Solutions from ``starts (N, C, 6)`` and along the curves through nearly singular ones.

    Limits: smallest singular value, its value and error where a curve ends, tolerance. A curve that
    meets it all along is an infinite set: ``free (N, 16)`` is its joint at the reference, from 1.
    """
    work, curve = curves.workspace(6), curves.curve_of(ROWS, 6)
    P, axes, q, best = np.zeros((3, 4)), np.zeros((6, 6)), np.zeros(6), np.zeros(6)
    u, v, periods = np.zeros(6), np.zeros(6), np.zeros(6)
    known, roots, marks = np.zeros((POINTS, 6)), np.zeros((16, 6)), np.zeros(16, np.int64)
    small, widest, most, touch = limits
    bounds = (FINE, SHORTEST, STRIDE, most, widest)
    for k in range(6):
        periods[k] = 2.0 * np.pi if sigma[k] == 0 else 0.0
    C = starts.shape[1]
    for n in range(goals.shape[0]):
        data = (sigma, D, goals[n], P, axes)
        remembered, at = 0, 0
        while at < C + count[n]:
            at += 1
            arrived = at > C
            if not arrived and not there[n, at - 1]:
                continue
            for k in range(6):
                q[k] = found[n, at - 1 - C, k] if arrived else starts[n, at - 1, k]
            if not arrived and newton(data, q, best, work) <= MET:
                row = keep(sigma, q, found[n], count[n])
                count[n] = max(count[n], min(row + 1, found.shape[1]))
                continue  # its turn comes
            if arrived and flatness(data, q, u, v, work) > small:
                continue
            if not arrived:
                for k in range(6):
                    q[k] = starts[n, at - 1, k]
            if is_near(sigma, q, known, remembered):
                continue
            beside = begin(data, q, curve, MIDDLE, work, FINE)
            points, _, _, error, slopes = curve
            on_curve = beside <= FINE + 1e-3 * abs(error[MIDDLE])
            on_curve &= abs(error[MIDDLE]) <= most and abs(slopes[MIDDLE]) <= widest
            if not on_curve or is_near(sigma, points[MIDDLE], known, remembered):
                continue
            first, last, why = MIDDLE, MIDDLE, curves.STOPPED
            for side in (1, -1):
                if why != curves.CLOSED:
                    end, why = trace(data, periods, curve, MIDDLE, side, bounds, work)
                    first, last = min(first, end), max(last, end)
            largest = 0.0
            for m in range(first, last + 1):
                largest = max(largest, abs(error[m]))
                if remembered < POINTS:
                    for k in range(6):
                        known[remembered, k] = points[m, k]
                    remembered += 1
            if largest <= touch and last - first >= NARROW:
                kept = 0
                for j in range(count[n]):
                    on = False
                    for m in range(first, last + 1):
                        on = on or distance(sigma, found[n, j], points[m]) < STRIDE
                    if not on:
                        for k in range(6):
                            found[n, kept, k] = found[n, j, k]
                        free[n, kept], double[n, kept] = free[n, j], double[n, j]
                        kept += 1
                joint = representative(data, curve, first, last, references[n], q, u, v, work)
                row = keep(sigma, q, found[n], kept)
                count[n] = min(max(kept, row + 1), found.shape[1])
                for j in range(row, count[n]):
                    free[n, j], double[n, j] = joint + 1, False
                at = C
                continue
            number = solutions(data, curve, first, last, touch, roots, marks, work, FINE)
            for j in range(number):
                for k in range(6):
                    q[k] = wrapped(roots[j, k]) if sigma[k] == 0 else roots[j, k]
                if marks[j] == 0 and newton(data, q, best, work) > MET:
                    continue
                row = keep(sigma, q, found[n], count[n])
                count[n] = max(count[n], min(row + 1, found.shape[1]))
                if row < count[n] and marks[j] == 1:
                    double[n, row] = True
