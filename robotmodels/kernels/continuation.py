"""Continuation of curves by predictor and corrector, for equations that callers bring.

A compiled function ``residual(x, data, F, J)`` writes ``F (n,)`` and ``J = dF/dx (n, n)`` at
``x (n,)``; with fewer equations than unknowns the last rows are zeros. The curve consists of the
points where the equations hold but for the direction that J hardly reaches: ``F = missing u`` with
the left singular vector u of the smallest singular value of J, and v along the curve. A change of
sign of ``missing`` is a solution of all equations; zero all along is a continuum of solutions.

Each step solves the bordered system ``[J u; v^T 0]``, which is regular where J has one singular
value that is small or zero (W. Govaerts, Numerical Methods for Bifurcations of Dynamical
Equilibria, 2000): the correction square to v, and the new u and v. ``slope = u^T J v`` is the
derivative of ``missing`` along the curve, so that a change of its sign is an extremum.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from ._compile import Floats, Ints, compiled

NO_ROOM, STOPPED, OUTSIDE, CLOSED = 0, 1, 2, 3  # why a curve ends
CORRECTIONS = 5  # at most for one point
TURN = 0.95  # least cosine between directions of neighbouring points
BESIDE = 0.3  # longest correction beside the step
GROWTH = 1.5  # of the step after a good one
BRACKETING = 40  # evaluations for one zero
ROUNDING = 1e-15  # of ``missing``

# F, J, bordered matrix, pivots, right side
Work = tuple[Floats, Floats, Floats, Ints, Floats]
# points, directions v, left vectors u, each (R, n); missing and slope (R,)
Curve = tuple[Floats, Floats, Floats, Floats, Floats]
# accuracy beside u; shortest and longest step; largest |missing| and |slope|
Limits = tuple[float, float, float, float, float]


@compiled()
def curve_of(rows: int, n: int) -> Curve:
    """Room for the points of a curve."""
    return (
        np.zeros((rows, n)),
        np.zeros((rows, n)),
        np.zeros((rows, n)),
        np.zeros(rows),
        np.zeros(rows),
    )


@compiled()
def workspace(n: int) -> Work:
    """Arrays that a correction writes to."""
    return (
        np.zeros(n),
        np.zeros((n, n)),
        np.zeros((n + 1, n + 1)),
        np.zeros(n + 1, np.int64),
        np.zeros(n + 1),
    )


@compiled()
def factor(A: Floats, pivots: Ints) -> None:
    """LU factors of a square matrix with row exchanges, in place."""
    n = A.shape[0]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        pivots[k] = best
        if best != k:
            for j in range(n):
                A[k, j], A[best, j] = A[best, j], A[k, j]
        if abs(A[k, k]) < 1e-300:
            A[k, k] = 1e-300  # a singular matrix still serves inverse iteration
        for i in range(k + 1, n):
            A[i, k] /= A[k, k]
            for j in range(k + 1, n):
                A[i, j] -= A[i, k] * A[k, j]


@compiled()
def solve(A: Floats, pivots: Ints, x: Floats, transposed: bool) -> None:
    """Solve ``A y = x`` or ``A^T y = x`` from the factors, x overwritten by y."""
    n = x.size
    if not transposed:
        for k in range(n):
            p = pivots[k]
            x[k], x[p] = x[p], x[k]
    for i in range(n):
        for k in range(i):
            x[i] -= (A[k, i] if transposed else A[i, k]) * x[k]
        if transposed:
            x[i] /= A[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= (A[k, i] if transposed else A[i, k]) * x[k]
        if not transposed:
            x[i] /= A[i, i]
    if transposed:
        for k in range(n - 1, -1, -1):
            p = pivots[k]
            x[k], x[p] = x[p], x[k]


@compiled()
def dot(a: Floats, b: Floats) -> float:
    """Inner product over the entries of the shorter first vector."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@compiled()
def null_vector(x: Floats, transposed: bool, work: Work) -> float:
    """Left or right null vector of J into x by one inverse iteration; its signed singular value."""
    _, _, B, pivots, y = work
    n = x.size
    for i in range(n):
        y[i] = 0.0
    y[n] = 1.0
    solve(B, pivots, y, transposed)
    length = 0.0
    for i in range(n):
        length = max(length, abs(y[i]))
    if not 0.0 < length < 1e300:
        return 0.0  # a second singular value is zero: the vector stays
    total = 0.0
    for i in range(n):
        x[i] = y[i] / length
        total += x[i] * x[i]
    for i in range(n):
        x[i] /= sqrt(total)
    return -y[n] / (length * sqrt(total))


@compiled()
def singular_vectors(u: Floats, v: Floats, work: Work) -> float:
    """Improve the vectors of the smallest singular value of J; the value with their sign."""
    _, J, B, pivots, _ = work
    n = u.size
    for i in range(n):
        for j in range(n):
            B[i, j] = J[i, j]
        B[i, n], B[n, i] = u[i], v[i]
    B[n, n] = 0.0
    factor(B, pivots)
    slope = null_vector(v, False, work)
    null_vector(u, True, work)
    return slope


@compiled()
def any_direction(u: Floats, v: Floats) -> None:
    """Vectors from which `singular_vectors` starts: unsymmetric, so square to no axis."""
    for i in range(u.size):
        u[i] = v[i] = (1.0 + 0.3 * i) * (1 if i % 2 == 0 else -1)


class Curves(NamedTuple):
    """Functions that follow the curves of one residual."""

    correct: Any
    begin: Any
    trace: Any
    solutions: Any


def curves_of(residual: Any) -> Curves:
    """Compiled functions for the curves of a compiled residual; see the head of the file."""

    @compiled(cached=False)
    def correct(
        data: Any, x: Floats, u: Floats, v: Floats, work: Work, fine: float
    ) -> tuple[float, float, float]:
        """Move x square to v onto the curve; u and v become those of the new point.

        Returns ``missing``, the error beside u, and ``slope``.
        """
        F, J, B, pivots, y = work
        n = x.size
        for step in range(CORRECTIONS + 1):
            residual(x, data, F, J)
            slope = singular_vectors(u, v, work)
            missing, total = dot(u, F), 0.0
            for i in range(n):
                total += (F[i] - missing * u[i]) ** 2
            beside = sqrt(total)
            if step == CORRECTIONS or beside <= max(fine, 1e-3 * abs(missing)) or not beside < 1.0:
                break
            longest = 0.0
            for i in range(n):
                y[i] = -F[i]
            y[n] = 0.0
            solve(B, pivots, y, False)
            for i in range(n):
                longest = max(longest, abs(y[i]))
            if not longest < 1e3:
                return missing, np.inf, slope
            for i in range(n):
                x[i] += y[i] * min(1.0, 0.5 / max(longest, 0.5))
        return missing, beside, slope

    @compiled(cached=False)
    def begin(data: Any, start: Floats, curve: Curve, row: int, work: Work, fine: float) -> float:
        """Put the point of the curve next to ``start`` into a row; its error beside u."""
        points, directions, lefts, missing, slopes = curve
        x, u, v = points[row], lefts[row], directions[row]
        for i in range(x.size):
            x[i] = start[i]
        any_direction(u, v)
        residual(x, data, work[0], work[1])
        for _ in range(3):
            singular_vectors(u, v, work)
        missing[row], beside, slopes[row] = correct(data, x, u, v, work, fine)
        return beside

    @compiled(cached=False)
    def trace(
        data: Any,
        periods: Floats,
        curve: Curve,
        row: int,
        side: int,
        limits: Limits,
        work: Work,
    ) -> tuple[int, int]:
        """Continue a curve from a row upwards (side 1, along v) or downwards; last row and why.

        ``periods (n,)`` are 0 for unknowns without one. The point that leaves the limits is kept.
        A closed curve ends with its first point, whole periods added.
        """
        points, directions, lefts, missing, slopes = curve
        fine, shortest, longest, most, widest = limits
        rows, n = points.shape
        x, u, v = np.zeros(n), np.zeros(n), np.zeros(n)
        at, h, slope = row, longest, 0.0
        while 0 <= at + side < rows:
            before = directions[at]
            for i in range(n):
                x[i] = points[at, i] + side * h * before[i]
                u[i], v[i] = lefts[at, i], before[i]
            short, beside, slope = correct(data, x, u, v, work, fine)
            off = 0.0
            for i in range(n):
                off += (x[i] - points[at, i] - side * h * before[i]) ** 2
            same = dot(v, before)
            good = beside <= max(fine, 1e-3 * abs(short)) and off < (BESIDE * h) ** 2
            if not (good and same > TURN and dot(u, lefts[at]) > 0.7):
                h *= 0.5
                if h < shortest:
                    return at, STOPPED
                continue
            # whether the first point lies between the last one and this one
            onward, total = 0.0, 0.0
            for i in range(n):
                d = points[row, i] - points[at, i]
                if periods[i] > 0.0:
                    d -= periods[i] * np.round(d / periods[i])
                onward += side * d * before[i]
                total += d * d
            closed = abs(at - row) > 1 and dot(directions[row], before) > 0.7
            closed &= 0.0 < onward <= 1.01 * h and total < (1.0 + BESIDE**2) * onward**2
            at += side
            if closed:
                short = missing[row] if dot(u, lefts[row]) > 0.0 else -missing[row]
            for i in range(n):
                if closed:
                    d = x[i] - points[row, i]
                    x[i] = points[row, i]
                    x[i] += periods[i] * np.round(d / periods[i]) if periods[i] > 0.0 else 0.0
                points[at, i], directions[at, i], lefts[at, i] = x[i], v[i], u[i]
            missing[at], slopes[at] = short, slope
            if closed:
                return at, CLOSED
            if abs(short) > most or abs(slope) > widest:
                return at, OUTSIDE
            if same > 0.5 * (1.0 + TURN):
                h = min(GROWTH * h, longest)
        return at, NO_ROOM

    @compiled(cached=False)
    def zero_between(
        data: Any,
        curve: Curve,
        low: Floats,
        high: Floats,
        row: int,
        ends: tuple[float, float],
        of_slope: bool,
        x: Floats,
        work: Work,
        fine: float,
    ) -> float:
        """Zero of ``missing`` or ``slope`` between two points of a curve into x; ``missing`` there.

        ``ends`` are the values at the points; by false position (Illinois), signs as in ``row``.
        """
        n = x.size
        u, v = np.zeros(n), np.zeros(n)
        (a, b), (f, g), short = (0.0, 1.0), ends, 0.0
        for _ in range(BRACKETING):
            share = a + (b - a) * f / (f - g) if f != g else 0.5 * (a + b)
            for i in range(n):
                x[i] = low[i] + share * (high[i] - low[i])
                u[i], v[i] = curve[2][row, i], curve[1][row, i]
            short, _, slope = correct(data, x, u, v, work, fine)
            value = slope if of_slope else short
            if abs(value) < 1e-16 or b - a < 1e-14:
                break
            if (value > 0.0) == (f > 0.0):
                a, f, g = share, value, 0.5 * g
            else:
                b, g, f = share, value, 0.5 * f
        return short

    @compiled(cached=False)
    def solutions(
        data: Any,
        curve: Curve,
        first: int,
        last: int,
        touch: float,
        found: Floats,
        double: Ints,
        work: Work,
        fine: float,
    ) -> int:
        """Solutions on rows first to last of a curve into ``found (K, n)``; their number.

        An extremum of ``missing`` that comes within ``touch`` of zero without a change of sign is a
        double solution (1 in ``double``).
        """
        points, _, _, missing, slopes = curve
        n, count = points.shape[1], 0
        turn = np.zeros(n)
        for m in range(first, last):
            a, b, middle = missing[m], missing[m + 1], missing[m + 1]
            turns = a * b > 0.0 and slopes[m] * slopes[m + 1] < 0.0 and slopes[m] * a < 0.0
            if turns:
                ends = slopes[m], slopes[m + 1]
                middle = zero_between(
                    data, curve, points[m], points[m + 1], m, ends, True, turn, work, fine
                )
            is_double = turns and abs(middle) <= (touch if a * middle > 0.0 else ROUNDING)
            for part in range(2 if turns else 1):
                low, high = (
                    points[m] if part == 0 else turn,
                    turn if part < turns else points[m + 1],
                )
                f, g = a if part == 0 else middle, middle if part == 0 else b
                if count == found.shape[0] or not (is_double or (f > 0.0) != (g > 0.0)):
                    continue
                double[count] = is_double
                for i in range(n):
                    found[count, i] = turn[i]
                count += 1
                if is_double:
                    break
                zero_between(data, curve, low, high, m, (f, g), False, found[count - 1], work, fine)
        return count

    return Curves(correct, begin, trace, solutions)
