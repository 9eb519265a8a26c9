"""Linear least squares on triangular factors: ordinary, weighted and ridge.

Book section 1.6.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Frozen, as_exact, as_number
from ..errors import InvalidValueError
from .estimate import Estimate, EstimateStatus
from .factor import TriangularFactors, merged_all

_ITERATIONS = 100
LEAST_FREEDOM = 5.0
"""Residual degrees of freedom of a group below which the pooled variance is used."""
_STILL = 1e-8  # convergence tolerance: change of the parameters in standard errors
_ROUNDING = 1e-8  # least standard deviation of residuals, relative to the right side
_PER_DECADE = 8  # candidate prior strengths per decade


def ordinary(factors: TriangularFactors) -> Estimate:
    """Ordinary least squares: all equations have the same weight."""
    return weighted(factors, 0)


def weighted(factors: TriangularFactors, iterations: int = 1) -> Estimate:
    """Weighted least squares with one variance for each group (variance components).

    One iteration takes the weights from ordinary least squares; more, until they agree with the
    residuals, give the maximum of the likelihood for white normal noise.
    """
    check_count(factors)
    values, inverse, rest = solved(factors)
    leverage = group_leverage(factors, None, inverse)
    status = EstimateStatus.SOLVED if iterations <= 1 else EstimateStatus.NOT_CONVERGED
    done = 0
    while done < iterations:
        done += 1
        before = values
        weights = inverse_std(factors, residual_std(factors, values, leverage))
        values, inverse, rest = solved(factors, weights)
        leverage = group_leverage(factors, weights, inverse)
        moved = np.abs(values - before)
        if (moved <= _STILL * np.sqrt(np.diag(inverse)) + 1e-15 * np.abs(values)).all():
            status = EstimateStatus.SOLVED
            break
    sigma = residual_std(factors, values, leverage)
    covariance = rest / (factors.rows - len(values)) * inverse
    notes = tuple(
        f"Group {j + 1} of the equations (joint) has {factors.counts[j]} equations for "
        f"{leverage[j]:.1f} parameters: the pooled variance is used. A longer "
        "log, or a smaller decimation or dead band, gives it more."
        for j in np.flatnonzero(_too_few(factors, leverage))
    )
    return Estimate(factors.names, values, covariance, sigma, status, max(done, 1), notes)


def reweighted(factors: TriangularFactors) -> Estimate:
    """Weighted least squares iterated until the weights agree with the residuals."""
    return weighted(factors, _ITERATIONS)


def solved(factors: TriangularFactors, weights: Array | None = None) -> tuple[Array, Array, float]:
    """Least-squares values (b,), inverse information (b, b) and residual sum of squares."""
    R, y, rest = factors.stacked(weights)
    inverse = inverse_triangle(R)
    return inverse @ y, inverse @ inverse.T, rest


def inverse_triangle(R: Array) -> Array:
    """Inverse of a triangular matrix (b, b) whose columns have different units."""
    from scipy.linalg import solve_triangular

    size = np.linalg.norm(R, axis=0)
    size[size == 0.0] = 1.0
    return solve_triangular(R / size, np.eye(len(R))) / size[:, None]


def group_leverage(factors: TriangularFactors, weights: Array | None, inverse: Array) -> Array:
    """Sum of the leverages of each group (m,); their total is the number of parameters."""
    w = np.ones(len(factors.factors)) if weights is None else weights
    parts = (R[:, :-1] * weight for R, weight in zip(factors.factors, w, strict=True))
    return np.array([float(((R @ inverse) * R).sum()) for R in parts])


def residual_std(factors: TriangularFactors, values: Array, leverage: Array | None = None) -> Array:
    """Standard deviation of the residuals of each group (m,); default leverage: equal per row."""
    sums, counts = factors.sums(values), factors.counts
    if leverage is None:
        freedom = counts * (1.0 - len(values) / factors.rows)
        return np.sqrt(sums / np.maximum(freedom, 1e-300))
    few = _too_few(factors, leverage)
    pooled = float(sums.sum()) / max(factors.rows - len(values), 1)
    separate = sums / np.where(few, np.maximum(counts, 1), np.maximum(counts - leverage, 1e-300))
    return np.sqrt(np.where(counts > 0, np.where(few, np.maximum(pooled, separate), separate), 0.0))


def _too_few(factors: TriangularFactors, leverage: Array) -> NDArray[np.bool_]:
    return (factors.counts > 0) & (factors.counts - leverage < LEAST_FREEDOM)


def inverse_std(factors: TriangularFactors, sigma: Array) -> Array:
    """Weights 1 / sigma of the groups (m,); exact groups get a finite weight by rounding."""
    sizes = np.array([np.linalg.norm(R[:, -1]) for R in factors.factors])
    if not sizes.any():
        return np.ones(len(sizes))
    sizes /= np.sqrt(np.maximum(factors.counts, 1))
    return 1.0 / np.maximum(sigma, max(1e-12 * float(sizes.max()), 1e-300))


def first_weights(factors: TriangularFactors) -> Array:
    """Weights of the groups (m,) from ordinary least squares, as `weighted` uses them."""
    return inverse_std(factors, ordinary(factors).sigma)


def residual_noise(factors: TriangularFactors) -> Array:
    """Standard deviation of the residuals of each group (m,), solved alone; 1 for a zero side."""
    noise = np.ones(len(factors.factors))
    for m, R in enumerate(factors.factors):
        A, y = R[:, :-1], R[:, -1]
        length, size = np.linalg.norm(A, axis=0), float(np.linalg.norm(y))
        count = max(int(factors.counts[m]), 1)
        if size > 0.0:
            U, s, _ = np.linalg.svd(A / np.where(length > 0.0, length, 1.0), full_matrices=False)
            U = U[:, s > 1e-12 * s.max(initial=0.0)]
            rest = float(np.linalg.norm(y - U @ (U.T @ y)))
            rest /= np.sqrt(max(count - U.shape[1], 1))
            noise[m] = max(rest, _ROUNDING * size / np.sqrt(count))
    return noise


def value_sizes(factors: TriangularFactors) -> Array:
    """Parameter values (b,) whose separate right sides have the size of the measured one."""
    whole = np.vstack(factors.factors)
    length = np.linalg.norm(whole[:, :-1], axis=0)
    size = max(float(np.linalg.norm(whole[:, -1])), 1e-300)
    return size / np.where(length > 0.0, length, 1.0)


def check_count(factors: TriangularFactors) -> None:
    """Raise for fewer equations than parameters."""
    b = len(factors.names)
    if factors.rows <= b:
        raise InvalidValueError(
            f"log: {factors.rows} equations are too few for {b} parameters; give a longer log, a "
            "smaller decimation or dead band (processing=), or fewer parameters."
        )


@dataclass(frozen=True, slots=True, eq=False)
class RidgeDetails(Frozen):
    """Prior of a ridge estimate: values (b,), their errors (b,), strength, degrees of freedom."""

    prior: Array
    prior_errors: Array
    strength: float
    degrees: float


def ridge(
    factors: TriangularFactors,
    prior: ArrayLike | None = None,
    errors: ArrayLike | None = None,
    strength: float | None = None,
    folds: Sequence[TriangularFactors] = (),
) -> Estimate:
    """Weighted least squares with a Gaussian prior: values (b,) and their standard errors (b,).

    Without errors it acts in proportion to each column, and its strength (a factor on the squares)
    is chosen by cross-validation over folds, which are parts of the data.
    """
    start, weights = weighted(factors), first_weights(factors)
    b = len(start.values)
    x0 = np.zeros(b) if prior is None else as_exact(prior, (b,), "prior")
    R, y, _ = factors.stacked(weights)
    if errors is None:
        d = np.sqrt(factors.rows) / np.linalg.norm(R, axis=0)
    else:
        d = as_exact(errors, (b,), "prior_errors")
        if not (d > 0.0).all():
            raise InvalidValueError(f"prior_errors: expected positive numbers, got {d.min():g}.")
    if strength is not None:
        factor = as_number(strength, "strength", least=0.0)
    else:
        factor = 1.0 if errors is not None else _strength(folds, x0, d, weights, R)
    U, s, Vt = np.linalg.svd(R * d)
    values = x0 + d * (Vt.T @ (s / (s**2 + factor) * (U.T @ (y - R @ x0))))
    half = (d[:, None] * Vt.T) / np.sqrt(s**2 + factor)
    degrees = float((s**2 / (s**2 + factor)).sum())
    with np.errstate(divide="ignore", invalid="ignore"):
        far = np.nan_to_num(np.abs(values - start.values) / start.standard_errors, posinf=np.inf)
    k = int(np.argmax(far))
    note = (
        f"The data determine {degrees:.1f} of {b} parameters and the prior the rest (strength "
        f"{factor:.3g}); {factors.names[k]} differs most from weighted least squares, by "
        f"{far[k]:.2g} of its standard errors there. All are biased toward the prior."
    )
    return Estimate(
        factors.names,
        values,
        half @ half.T,
        residual_std(factors, values),
        start.status,
        notes=(note,),
        details=RidgeDetails(x0, d, factor, degrees),
    )


def _strength(
    folds: Sequence[TriangularFactors], x0: Array, d: Array, weights: Array, R: Array
) -> float:
    """Strength with the least cross-validation error: zero, or from negligible to dominant."""
    if len(folds) < 2:
        raise InvalidValueError(f"folds: expected two or more, got {len(folds)}; or give strength.")
    s = np.linalg.svd(R * d, compute_uv=False)
    low, high = np.log10(1e-4 * max(s[-1], 1e-12 * s[0]) ** 2), np.log10(1e2 * s[0] ** 2)
    strengths = np.append(0.0, np.logspace(low, high, int(_PER_DECADE * (high - low)) + 2))
    errors = np.zeros(len(strengths))
    for k, test_set in enumerate(folds):
        A, y, _ = merged_all(fold for i, fold in enumerate(folds) if i != k).stacked(weights)
        U, s, Vt = np.linalg.svd(A * d)
        total = s**2 + strengths[:, None]
        gains = np.divide(s * np.ones_like(total), total, out=np.zeros_like(total), where=total > 0)
        tried = x0 + d * ((gains * (U.T @ (y - A @ x0))) @ Vt)
        squares = np.array([test_set.sums(values) @ weights**2 for values in tried])
        errors += squares / max(test_set.rows, 1)
    return float(strengths[int(np.argmin(errors))])
