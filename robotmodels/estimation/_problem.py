"""Rows of a nonlinear fit, checked once: whitened, ordered by measurement, with the prior."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_exact, as_floats
from ..errors import InvalidValueError, ShapeError
from .losses import Loss, loss_terms, tuning
from .prior import Prior

Linearise = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True, slots=True, eq=False)
class Point:
    """Residuals at x, divided by their stated deviations, measurement after measurement."""

    x: Array
    r: Array
    J: Array
    length: Array
    """Of the residuals of each measurement."""


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """What is minimised, without the loss and its scale."""

    linearise: Linearise
    P: int
    sigma: Array
    prior: Prior
    labels: NDArray[np.int64]
    """Numbers of the measurements, as the caller gave them, shape (B,)."""
    block: NDArray[np.int64]
    """Place in ``labels`` of the measurement of each row, shape (M,), in the caller's order."""
    order: NDArray[np.int64] | None
    """Rows measurement after measurement; None if they come so."""
    starts: NDArray[np.int64]
    rows: NDArray[np.int64]
    """Rows of each measurement, shape (B,)."""

    def at(self, x: Array) -> Point | None:
        """Rows at x; None where they are not finite."""
        r, J = self.linearise(x)
        r = np.asarray(r, dtype=np.float64)
        J = np.asarray(J, dtype=np.float64)
        if r.shape != self.sigma.shape or J.shape != (len(self.sigma), self.P):
            raise ShapeError(
                f"linearise: expected residuals {self.sigma.shape} and a Jacobian "
                f"{(len(self.sigma), self.P)}, got {r.shape} and {J.shape}."
            )
        weight = 1 / self.sigma
        r = r * weight
        J = J * weight[:, None]
        # a sum is finite only if every term is (one that overflows is of no use either)
        with np.errstate(over="ignore", invalid="ignore"):
            finite = np.isfinite(r @ r) and np.isfinite(J.sum())
        if not finite:
            return None
        if self.order is not None:
            r, J = r[self.order], J[self.order]
        square = np.add.reduceat(r * r, self.starts) if len(r) else r
        return Point(x, r, J, np.sqrt(square))

    def per_row(self, values: Array) -> Array:
        """Values of measurements (B,) repeated for their rows, measurement after measurement."""
        return np.repeat(values, self.rows)

    def in_order_of_caller(self, rows: Array) -> Array:
        """Undo the ordering by measurement."""
        if self.order is None:
            return rows
        back = np.empty_like(rows)
        back[self.order] = rows
        return back


@dataclass(frozen=True, slots=True, eq=False)
class Weighing:
    """A loss, its constants and the scale on which it acts."""

    loss: Loss
    constant: Array
    scale: float

    @classmethod
    def of(cls, loss: Loss, rows: NDArray[np.int64], scale: float) -> Weighing:
        """Constants for measurements of these numbers of rows."""
        return cls(loss, tuning(loss, rows), scale)

    def terms(self, length: Array) -> tuple[Array, Array, Array]:
        """Loss, weight and slope of each measurement."""
        if self.loss is Loss.SQUARES:
            return loss_terms(self.loss, length, self.constant)
        rho, weight, slope = loss_terms(self.loss, length / self.scale, self.constant)
        return self.scale**2 * rho, weight, slope

    def total(self, problem: Problem, point: Point) -> float:
        """What is minimised."""
        known, _ = problem.prior.rows(point.x)
        return float(self.terms(point.length)[0].sum() + known @ known)


def checked_problem(
    linearise: Linearise,
    x0: ArrayLike,
    sigma: ArrayLike,
    block: ArrayLike | None,
    prior: Prior | None,
) -> tuple[Problem, Point]:
    """Check everything at the border, with the rows at the start."""
    x = as_floats(x0, "x0")
    if x.ndim != 1 or not len(x):
        raise ShapeError(f"x0: expected parameters of shape (P,), P at least 1, got {x.shape}.")
    if not callable(linearise):
        raise InvalidValueError(f"linearise: expected a function of x, got {linearise!r:.60}.")
    r, J = (as_floats(part, name) for part, name in zip(linearise(x), ("r", "J"), strict=True))
    if r.ndim != 1 or J.shape != (len(r), len(x)):
        raise ShapeError(
            f"linearise: expected residuals (M,) and a Jacobian (M, {len(x)}), got {r.shape} and "
            f"{J.shape}."
        )
    deviation = as_floats(sigma, "sigma")
    if deviation.ndim:
        deviation = as_exact(deviation, r.shape, "sigma")
    if not (deviation > 0).all():
        raise InvalidValueError(
            "sigma: expected positive standard deviations, got "
            f"{deviation.min()}; remove a row that is not to count."
        )
    if prior is None:
        prior = Prior.none(len(x))
    elif len(prior.mean) != len(x):
        raise ShapeError(f"prior: expected one of {len(x)} parameters, got {len(prior.mean)}.")
    labels, place = _measurements(block, len(r))
    rows = np.bincount(place, minlength=len(labels))
    order = None if (np.diff(place) >= 0).all() else np.argsort(place, kind="stable")
    starts = np.concatenate(([0], np.cumsum(rows)[:-1])).astype(np.int64)
    problem = Problem(
        linearise, len(x), np.broadcast_to(deviation, r.shape), prior, labels, place, order,
        starts, rows,
    )  # fmt: skip
    point = problem.at(x.copy())
    if point is None:
        raise InvalidValueError("linearise: residuals divided by sigma overflow at x0.")
    return problem, point


def _measurements(block: ArrayLike | None, M: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    if block is None:
        return np.arange(M), np.arange(M)
    numbers = np.asarray(block)
    if numbers.shape != (M,):
        raise ShapeError(
            f"block: expected the measurement of each row ({M},), got {numbers.shape}."
        )
    if numbers.dtype.kind not in "iu":
        raise InvalidValueError(f"block: expected whole numbers, got {numbers.dtype}.")
    labels, place = np.unique(numbers.astype(np.int64), return_inverse=True)
    return labels, place
