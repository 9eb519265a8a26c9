"""Singular value decomposition of small matrices by one-sided Jacobi rotations.

The rows of a matrix are turned among each other, two at a time, until every two are orthogonal:
their lengths are then the singular values. Small singular values keep their digits where the rows
are graded (J. Demmel and K. Veselic, Jacobi's method is more accurate than QR, 1992), and a 6 x 6
matrix takes a third of the time of LAPACK's.
"""

from math import sqrt

from ._compile import Floats, compiled

__all__ = ["orthogonal_rows"]

_EPS = 2.220446049250313e-16
_SWEEPS = 60
"""Far more than are ever needed: six for matrices of Jacobians, some ten for difficult ones."""
_NONE = 1e-60
"""Squared length, beside the longest row, of rows beyond the number of dimensions."""


@compiled()
def squared_length(B: Floats, i: int, d: int) -> float:
    """Sum of the squares of the first d entries of row i."""
    total = 0.0
    for c in range(d):
        total += B[i, c] * B[i, c]
    return total


@compiled()
def sort_rows(B: Floats, p: int, w: int, lengths: Floats) -> None:
    """Bring the first p rows of B, w wide, into the descending order of their lengths."""
    for i in range(1, p):
        j = i
        while j > 0 and lengths[j - 1] < lengths[j]:
            lengths[j - 1], lengths[j] = lengths[j], lengths[j - 1]
            for c in range(w):
                B[j - 1, c], B[j, c] = B[j, c], B[j - 1, c]
            j -= 1


@compiled()
def orthogonal_rows(B: Floats, p: int, d: int, w: int, lengths: Floats) -> None:
    """Rotate the first p rows of B among each other until their first d entries are orthogonal.

    Shapes: B (>= p, >= w) -> lengths (>= p,), descending; of p > d rows the last ones are zero.
    """
    for _ in range(_SWEEPS):
        for i in range(p):
            lengths[i] = squared_length(B, i, d)
        # long rows first: fewer sweeps, and graded rows keep their digits
        sort_rows(B, p, w, lengths)
        # of more rows than dimensions the last ones shrink with every sweep
        floor = _NONE * lengths[0] if p > d else 0.0
        rotated = False
        for i in range(p - 1):
            for j in range(i + 1, p):
                a, b = lengths[i], lengths[j]
                inner = 0.0
                for c in range(d):
                    inner += B[i, c] * B[j, c]
                if abs(inner) <= _EPS * sqrt(a) * sqrt(b) or min(a, b) < floor:
                    continue
                rotated = True
                if abs(b - a) > 2e9 * abs(inner):
                    # the limit of the formula, without its overflow
                    tangent = inner / (b - a)
                else:
                    ratio = (b - a) / (2.0 * inner)
                    tangent = 1.0 / (abs(ratio) + sqrt(1.0 + ratio * ratio))
                    if ratio < 0.0:
                        tangent = -tangent
                cosine = 1.0 / sqrt(1.0 + tangent * tangent)
                sine = cosine * tangent
                for c in range(w):
                    x, y = B[i, c], B[j, c]
                    B[i, c] = cosine * x - sine * y
                    B[j, c] = sine * x + cosine * y
                # exact but for rounding until the next sweep, unless digits cancel
                least = 1e-3 * min(a, b)
                a, b = a - tangent * inner, b + tangent * inner
                lengths[i] = a if a > least else squared_length(B, i, d)
                lengths[j] = b if b > least else squared_length(B, j, d)
        if not rotated:
            break
    for i in range(p):
        lengths[i] = sqrt(lengths[i])
