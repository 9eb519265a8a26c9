"""Postures along valleys, where the Jacobian of the arm is nearly singular.

Where a structured arm has an infinite family of postures (an aligned wrist, a wrist centre on
the shoulder's axis), its neighbour has a few isolated ones along what is left of the family, far
from each other; where it has a fold (a stretched elbow), two that are close. Both lie on a
curve of postures at which the other five joints do for the pose what they can while one is kept: a
valley of the error. The curve is walked, driven by the joint that moves most, and a posture is
where what is missing changes sign.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import types
from numpy.typing import NDArray

from ..kernels._compile import INTS, MATRIX, NOTHING, OUT3, STACK, VECTOR, Floats, Ints, compiled
from ._neighbour import (
    COUNTS,
    FLAGS,
    FLAGS_IN,
    MARKS,
    distance,
    error_at,
    factored_jacobian,
    workspace,
)
from ._neighbour_linear import anywhere, smallest_singular
from ._valley_postures import family_members, is_double, posture_between, postures_near_zero
from ._valley_walk import STRIDE, STRIDES, walk

MOST_MOVED = 0.05  # of a start, that is taken into account [rad]
WIDE = 0.4  # distance of the Jacobian from singular at which any valley ends
POINTS = 4000  # points of valleys remembered for a pose
NARROW = 10  # points that the infinite family of a tolerance has at least


@compiled(
    NOTHING(
        INTS, STACK, STACK, STACK, FLAGS_IN, MATRIX, MATRIX, VECTOR,
        types.float64, types.float64, types.float64, types.float64, types.float64,
        OUT3, COUNTS, FLAGS, MARKS,
    )
)  # fmt: skip
def valleys(
    sigma: Ints,
    D: Floats,
    goals: Floats,
    starts: Floats,
    there: NDArray[np.bool_],
    moved: Floats,
    references: Floats,
    tolerances: Floats,
    deviation: float,
    small: float,
    valley: float,
    far: float,
    spread: float,
    found: Floats,
    count: Ints,
    double: NDArray[np.bool_],
    free: Ints,
) -> None:
    """Continuation along nearly singular curves from ``starts (N, C, 6)`` and singular postures.

    A curve ends at a smallest singular value of ``valley`` or an error of ``far`` deviations. One
    within ``tolerances`` all along is a family: ``free (N, 16)`` is its joint at the reference.
    """
    work = workspace()
    rows = 2 * STRIDES + 8
    curve = (
        np.zeros((rows, 6)), np.zeros(rows), np.zeros((rows, 6)), np.zeros(rows, np.int64)
    )  # fmt: skip
    points, missing, us, drivers = curve
    known = np.zeros((POINTS, 6))
    u, v, q = np.zeros(6), np.zeros(6), np.zeros(6)
    # an error of this length is within both tolerances
    touch = 0.5 * min(tolerances[0], tolerances[1])
    for n in range(goals.shape[0]):
        remembered = 0
        C = starts.shape[1]
        k = 0
        while k < C + count[n]:
            if k < C:
                at = k
                k += 1
                if not there[n, at]:
                    continue
                alike = False
                for m in range(C):
                    if m < at and there[n, m]:
                        alike = alike or distance(sigma, starts[n, m], starts[n, at]) < spread
                    if m >= at or alike:
                        break
                if alike:
                    continue
                scale = max(deviation, min(moved[n, at], MOST_MOVED))
                for i in range(6):
                    q[i] = starts[n, at, i]
            else:
                scale = deviation
                for i in range(6):
                    q[i] = found[n, k - C, i]
                k += 1
                error_at(sigma, D, goals[n], q, work)
                factored_jacobian(sigma, work)
                anywhere(u)
                if smallest_singular(work[2], work[3], u, v, 3) > small:
                    continue
            passed = False
            for m in range(remembered):
                if distance(sigma, q, known[m]) < 0.7 * STRIDE:
                    passed = True
                    break
            if passed:
                continue
            narrow = min(max(valley * sqrt(scale), 1e-3), WIDE)
            end = max(far * scale, 2.0 * touch)
            first, last = walk(sigma, D, goals[n], q, narrow, end, curve, work)
            if last == first:
                continue
            for m in range(first, last):
                if remembered < POINTS:
                    known[remembered] = points[m]
                    remembered += 1
            most = 0.0
            for m in range(first, last):
                most = max(most, abs(missing[m]))
            if last - first >= NARROW and most <= touch:
                count[n] = family_members(
                    sigma, D, goals[n], curve, first, last, references[n], touch,
                    found[n], free[n], count[n], work,
                )  # fmt: skip
                continue
            for m in range(first, last - 1):
                if missing[m] * missing[m + 1] <= 0.0:
                    count[n] = posture_between(
                        sigma, D, goals[n], points[m], missing[m], points[m + 1], missing[m + 1],
                        us[m], drivers[m + 1], found[n], count[n], work,
                    )  # fmt: skip
                elif (
                    m > first
                    and missing[m] * missing[m - 1] > 0.0
                    and drivers[m - 1] == drivers[m] == drivers[m + 1]
                    and abs(missing[m]) <= min(abs(missing[m - 1]), abs(missing[m + 1]))
                ):
                    count[n] = postures_near_zero(
                        sigma, D, goals[n], curve, m, touch, found[n], count[n], work
                    )
        for k in range(count[n]):
            double[n, k] = free[n, k] == 0 and is_double(sigma, D, goals[n], found[n, k], work)
