"""Total least squares on triangular factors: noise in the columns as well.

Source: S. Van Huffel and J. Vandewalle, "The Total Least Squares Problem", SIAM 1991, sections 3.4
and 3.5; W. Fuller, "Measurement Error Models", Wiley 1987, section 2.3 (covariance).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Frozen, as_floats
from .._outcomes import Outcome
from ..errors import InvalidValueError
from .estimate import Estimate
from .factor import TriangularFactors, triangle
from .linear import check_count, first_weights, residual_std, weighted

_SOLVABLE = 1e-8
"""Least component of the right side in the last singular vector; below it there is no solution."""
_EQUAL = 0.999  # largest ratio of the two smallest singular values for a determined solution


class TotalStatus(Outcome):
    """Outcome of total least squares."""

    UNIQUE = 0, "One combination of the columns explains the right side with the least noise."
    ILL_POSED = 1, "Several combinations explain it equally well; the parameters are one of them."
    NO_SOLUTION = 2, "There is no solution; the parameters are those of weighted least squares."


@dataclass(frozen=True, slots=True, eq=False)
class TotalDetails(Frozen):
    """Assumed noise of the columns and the right side (b + 1,), its estimated scale, outcome."""

    noise: Array
    scale: float
    solution: TotalStatus


def total(
    factors: TriangularFactors, noise: ArrayLike = 0.001, exact: ArrayLike | None = None
) -> Estimate:
    """Total least squares: noise in the columns as well as in the right side.

    ``noise``: relative to the root mean square of the columns not ``exact`` (b,), or standard
    deviations of columns and right side (b + 1,).
    """
    check_count(factors)
    start = weighted(factors)
    b, rows = len(start.values), factors.rows
    weights = first_weights(factors)
    R, y, rest = factors.stacked(weights)
    fixed = np.zeros(b, dtype=bool) if exact is None else np.asarray(exact, dtype=bool)
    levels, notes = _noise_levels(factors, (R, y, rest), noise, weights, start.values, fixed)
    whole = np.vstack((np.column_stack((R, y)), np.r_[np.zeros(b), np.sqrt(rest)]))
    first, noisy = np.flatnonzero(levels[:b] == 0.0), np.flatnonzero(levels[:b] > 0.0)
    T = triangle(whole[:, np.r_[first, noisy, b]])
    e = len(first)
    _, s, Vt = np.linalg.svd(T[e:, e:] / levels[np.append(noisy, b)])
    scale, direction = float(s[-1]) / np.sqrt(rows - b), Vt[-1]
    if abs(direction[-1]) < _SOLVABLE:
        values, covariance, sigma = start.values, start.covariance, start.sigma
        status = TotalStatus.NO_SOLUTION
    else:
        values = np.empty(b)
        values[noisy] = -direction[:-1] / direction[-1] * levels[b] / levels[noisy]
        # exact columns: solved from their separate equations
        right = T[:e, -1] - T[:e, e:-1] @ values[noisy]
        values[first] = np.linalg.solve(T[:e, :e], right) if e else 0.0
        covariance = _total_covariance(R, rows, values, levels * scale)
        sigma = residual_std(factors, values)
        ill_posed = len(s) > 1 and s[-1] > _EQUAL * s[-2]
        status = TotalStatus.ILL_POSED if ill_posed else TotalStatus.UNIQUE
    if status is not TotalStatus.UNIQUE:
        notes = (*notes, status.sentence)
    details = TotalDetails(levels, scale, status)
    return Estimate(
        factors.names, values, covariance, sigma, start.status, notes=notes, details=details
    )


def _noise_levels(
    factors: TriangularFactors,
    system: tuple[Array, Array, float],
    noise: ArrayLike,
    weights: Array,
    values: Array,
    exact: NDArray[np.bool_],
) -> tuple[Array, tuple[str, ...]]:
    """Standard deviations of the noise of columns and right side, in weighted equations."""
    given, b = as_floats(noise, "noise"), len(values)
    R, y, rest = system
    wrong = (given < 0.0).any() or (given.ndim and not given[-1] > 0.0)
    if given.shape not in ((), (b + 1,)) or wrong:
        raise InvalidValueError(
            f"noise: expected one relative number, or the standard deviations of {b} columns (from "
            f"0) and of the right side (above 0), shape ({b + 1},), got {noise!r:.80}."
        )
    if given.ndim:
        # mean of the group weights, by their share of the equations
        return given * np.sqrt(float((factors.counts * weights**2).sum()) / factors.rows), ()
    levels = np.append(given * np.linalg.norm(R, axis=0) / np.sqrt(factors.rows), 1.0)
    levels[:-1][exact] = 0.0
    explained = float(((levels[:-1] * values) ** 2).sum())
    if explained < 0.99:
        levels[-1] = np.sqrt(1.0 - explained)
        return levels, ()
    levels[-1] = float(given) * np.sqrt((float(y @ y) + rest) / factors.rows)
    note = (
        f"noise: {float(given):g} in every column would be more than all residuals; the right side "
        "was given the same relative noise."
    )
    return levels, (note,)


def _total_covariance(R: Array, rows: int, values: Array, noise: Array) -> Array:
    """Covariance for small white noise in columns and right side."""
    b = len(values)
    size = np.linalg.norm(R, axis=0) / np.sqrt(rows)
    column, x, Q = noise[:b] / size, values * size, R / size
    M = Q.T @ Q / rows - np.diag(column**2)
    residual = float(noise[b] ** 2 + (column * x) @ (column * x))
    cross = -(column**2) * x
    middle = residual * (M + np.diag(column**2)) - np.outer(cross, cross)
    if np.linalg.eigvalsh(M)[0] <= 0.0:  # noise as large as a column: no information
        return np.full((b, b), np.inf)
    inverse = np.linalg.inv(M)
    return inverse @ middle @ inverse / rows / np.outer(size, size)
