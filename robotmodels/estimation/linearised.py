"""A nonlinear least-squares problem, checked, and linearised at a point: steps and covariance.

The problem ``min |J dx + r|`` is solved over columns scaled to length 1, by the singular values of
the triangular factor of ``[J r]``, so that the condition is not squared as by normal equations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_exact, as_floats
from ..errors import InvalidValueError, ShapeError
from .losses import Loss, Terms, expected_slope
from .prior import Prior

Linearise = Callable[[Array], tuple[Array, Array]]

SINGULAR = 1e-13
"""Rank tolerance: singular value relative to the largest."""
_LEAST_CURVATURE = 0.2
"""Least curvature of the loss relative to its weights, which bounds the steps."""


@dataclass(frozen=True, slots=True, eq=False)
class Point:
    """Residuals and Jacobian at x divided by sigma, and residual length of each measurement."""

    x: Array
    r: Array
    J: Array
    length: Array


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """The problem without its loss; rows in the caller's order.

    Shapes: sigma (M,); labels, rows (B,); block (M,), the place in ``labels`` of each row.
    """

    linearise: Linearise
    sigma: Array
    prior: Prior
    labels: NDArray[np.int64]
    block: NDArray[np.int64]
    rows: NDArray[np.int64]

    def at(self, x: Array) -> Point | None:
        """Rows at x; None where they are not finite."""
        return self.point(x, *self.linearise(x))

    def point(self, x: Array, residuals: ArrayLike, jacobian: ArrayLike) -> Point | None:
        """Linearisation from computed rows."""
        r, J = np.asarray(residuals, np.float64), np.asarray(jacobian, np.float64)
        M, P = len(self.sigma), len(x)
        if r.shape != (M,) or J.shape != (M, P):
            raise ShapeError(
                f"linearise: expected residuals {(M,)} and a Jacobian {(M, P)}, got {r.shape} and "
                f"{J.shape}."
            )
        r, J = r / self.sigma, J / self.sigma[:, None]
        # the sum is finite only if every term is
        with np.errstate(over="ignore", invalid="ignore"):
            if not np.isfinite(r @ r + J.sum()):
                return None
        return Point(x, r, J, np.sqrt(np.bincount(self.block, r * r, len(self.labels))))

    def total(self, terms: Terms, point: Point | None) -> float:
        """Objective; infinite where the rows are not finite."""
        if point is None:
            return np.inf
        known, _ = self.prior.rows(point.x)
        return float(terms(point.length)[0].sum() + known @ known)


def checked_problem(
    linearise: Linearise,
    x0: ArrayLike,
    sigma: ArrayLike,
    block: ArrayLike | None,
    prior: Prior | None,
) -> tuple[Problem, Point]:
    """The problem and its rows at the start, all inputs checked."""
    x = as_floats(x0, "x0").copy()
    if x.ndim != 1 or not len(x):
        raise ShapeError(f"x0: expected parameters of shape (P,), P at least 1, got {x.shape}.")
    r, J = (as_floats(part, name) for part, name in zip(linearise(x), ("r", "J"), strict=True))
    M = r.size
    sigmas = as_floats(sigma, "sigma")
    sigmas = as_exact(sigmas, (M,), "sigma") if sigmas.ndim else np.full(M, sigmas)
    if not (sigmas > 0).all():
        raise InvalidValueError(f"sigma: expected positive numbers, got {sigmas.min()}.")
    prior = Prior.none(len(x)) if prior is None else prior
    numbers = np.arange(M) if block is None else np.asarray(block)
    if len(prior.mean) != len(x) or numbers.shape != (M,) or numbers.dtype.kind not in "iu":
        raise ShapeError(
            f"expected a prior of {len(x)} parameters and a block of {M} whole numbers, got "
            f"{len(prior.mean)} and {numbers.dtype} of shape {numbers.shape}."
        )
    labels, place, rows = np.unique(numbers, return_inverse=True, return_counts=True)
    problem = Problem(linearise, sigmas, prior, labels, place, rows)
    point = problem.point(x, r, J)
    if point is None:
        raise InvalidValueError("linearise: residuals divided by sigma overflow at x0.")
    return problem, point


def inverse_factor(R: Array, threshold: float = SINGULAR) -> Array:
    """Factor F of the inverse F F^T of R^T R, in determined directions: R (M, P) -> (P, M)."""
    size = np.linalg.norm(R, axis=0)
    size[size == 0.0] = 1.0
    return np.asarray(np.linalg.pinv(R / size, rcond=threshold) / size[:, None])


@dataclass(frozen=True, slots=True, eq=False)
class Linear:
    """Weighted rows and prior at a point, in singular directions; a step is ``-(basis @ y)``."""

    columns: Array  # lengths (P,) of the columns; 1 for one without effect
    s: Array  # singular values (P,) of the scaled columns
    V: Array  # their right singular vectors, as rows (P, P)
    rank: int
    g: Array  # residuals (rank,) along the first left singular vectors
    basis: Array  # (P, rank): makes the weighted rows orthonormal
    freedom: float  # effective number of parameters: the rank, less the share of the prior
    curvature: Array | None  # of the loss along the basis, (rank, rank); None for squares

    def step(self, damping: float) -> tuple[Array, float, float]:
        """Step, predicted decrease of the sum, and length in scaled parameters."""
        if not self.rank:
            return np.zeros(len(self.s)), 0.0, 0.0
        s = self.s[: self.rank]
        if damping == 0.0 and self.curvature is not None:
            y = np.linalg.solve(self.curvature, self.g)
            gain = self.g @ y
        else:
            left = damping / ((s / s[0]) ** 2 + damping)  # Marquardt, relative to the largest
            y = self.g * (1 - left)
            gain = (self.g**2 * (1 - left**2)).sum()
        return -(self.basis @ y), float(gain), float(np.linalg.norm(y / s))


def linear_problem(
    problem: Problem, terms: Terms, point: Point, threshold: float, fixed: int | None = None
) -> Linear:
    """Singular directions of the weighted rows with the prior; ``fixed``: the rank, if given."""
    _, weight, slope = terms(point.length)
    known, information = problem.prior.rows(point.x)
    data = np.column_stack((point.J, point.r)) * np.sqrt(weight)[problem.block][:, None]
    prior = np.column_stack((np.diag(information), known))
    R = np.asarray(np.linalg.qr(np.vstack((data, prior)), mode="r"))
    columns = np.linalg.norm(R[:, :-1], axis=0)
    columns[columns == 0.0] = 1.0
    U, s, V = np.linalg.svd(R[:, :-1] / columns, full_matrices=False)
    rank = int((s > (threshold * s[0] if fixed is None else 0.0)).sum())
    rank = rank if fixed is None else min(rank, fixed)
    basis = (V[:rank] / s[:rank, None]).T / columns[:, None]
    freedom = rank - float(((information[:, None] * basis) ** 2).sum())
    bend = slope - weight
    curvature = _curvature(problem, point, bend, basis) if bend.any() else None
    return Linear(columns, s, V, rank, U[:, :rank].T @ R[:, -1], basis, freedom, curvature)


def _curvature(problem: Problem, point: Point, bend: Array, basis: Array) -> Array:
    """Second derivative of a robust loss along the basis. Shapes: bend (B,)."""
    length = np.where(point.length > 0, point.length, 1.0)
    order = np.argsort(problem.block, kind="stable")
    along = (point.J * (point.r / length[problem.block])[:, None])[order]
    along = np.add.reduceat(along, np.cumsum(problem.rows) - problem.rows) @ basis
    N = np.eye(basis.shape[1]) + along.T @ (bend[:, None] * along)
    values, vectors = np.linalg.eigh((N + N.T) / 2)
    return (vectors * np.maximum(values, _LEAST_CURVATURE)) @ vectors.T


def covariance(
    problem: Problem,
    loss: Loss,
    terms: Terms,
    point: Point,
    linear: Linear,
    threshold: float,
    sigma_known: bool,
) -> Array:
    """Covariance of the estimate, shape (P, P) (Huber, Ronchetti, section 7.6)."""
    _, weight, slope = terms(point.length)
    rows, M, basis = problem.rows, len(point.r), linear.basis
    left = M - linear.freedom
    square = float(((weight * point.length) ** 2).sum())  # of the influence
    noise = square / left if left > 0 else np.nan
    _, information = problem.prior.rows(point.x)
    if loss is not Loss.SQUARES:
        # outliers count too: rows are weighted by the expected slopes of the loss
        bend = slope + (rows - 1) * weight
        expected, mean = expected_slope(loss, rows), bend.sum() / M
        spread = float((rows * (bend / rows - mean) ** 2).sum()) / M
        noise *= (1 + linear.freedom / M * spread / mean**2) ** 2 if mean > 0 else np.nan
        count = np.sqrt(np.maximum(expected * mean * M / (expected * rows).sum(), 0.0))
        bent = np.linalg.qr(point.J * count[problem.block][:, None], mode="r")
        basis = inverse_factor(np.vstack((bent, np.diag(information))), threshold)
    elif sigma_known:
        noise = 1.0
    data, known = point.J @ basis, information[:, None] * basis
    whole = basis @ (noise * data.T @ data + known.T @ known) @ basis.T
    return (whole + whole.T) / 2
