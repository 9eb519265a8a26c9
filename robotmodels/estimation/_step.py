"""One step of a nonlinear fit: triangular factor, singular values, damped and Newton steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import Array
from ._problem import Point, Problem, Weighing
from .losses import Loss

_LEAST_CURVATURE = 0.2
"""Of the loss against its weights: where outliers bend it the other way a step stays bounded."""


def triangle(rows: Array) -> Array:
    """Triangular factor of many rows, by pieces. Shapes: rows (M, p) -> (min(M, p), p)."""
    M, p = rows.shape
    piece = max(250, 4 * p)
    count = M // piece
    if count < 2:
        return np.asarray(np.linalg.qr(rows, mode="r"))
    whole = rows[: count * piece].reshape(count, piece, p)
    tops = np.asarray(np.linalg.qr(whole, mode="r")).reshape(-1, p)
    return triangle(np.vstack((tops, rows[count * piece :])))


@dataclass(frozen=True, slots=True, eq=False)
class Linear:
    """The linear problem at a point, in its singular directions.

    A step is ``dx = -(back @ y)`` with ``y`` in units of the residuals.
    """

    columns: Array
    """Lengths of the columns with the prior, shape (P,); 1 for a column without effect."""
    s: Array
    """All singular values of the scaled columns, shape (P,)."""
    V: Array
    """Right singular vectors as rows, shape (P, P), of the scaled columns."""
    rank: int
    g: Array
    """Residuals along the first ``rank`` left singular vectors."""
    back: Array
    """From those to parameters, shape (P, rank)."""
    curvature: Array | None
    """Second derivative of the loss along them, shape (rank, rank); None for squares."""

    def step(self, damping: float) -> tuple[Array, float, float]:
        """Step, predicted decrease, and length in units of scaled parameters."""
        s = self.s[: self.rank]
        if damping == 0.0:
            y = self.g
            gain = self.g @ self.g
            if self.curvature is not None:
                y = np.linalg.solve(self.curvature, self.g)
                gain = self.g @ y
        else:
            # Marquardt: the largest singular value is of order 1, and damping relative to it
            left = damping / (s * s / s[0] ** 2 + damping) if self.rank else s
            y = self.g * (1 - left)
            gain = float((self.g**2 * (1 - left**2)).sum())
        return -(self.back @ y), float(gain), float(np.linalg.norm(y / s)) if self.rank else 0.0


def linear_problem(
    problem: Problem, weighing: Weighing, point: Point, threshold: float, rank: int | None
) -> Linear:
    """Factorise the weighted rows and the prior."""
    P = problem.P
    M = len(point.r)
    _, weight, slope = weighing.terms(point.length)
    rows = np.empty((M, P + 1))
    if weighing.loss is Loss.SQUARES:
        rows[:, :P], rows[:, P] = point.J, point.r
    else:
        root = problem.per_row(np.sqrt(weight))
        np.multiply(point.J, root[:, None], out=rows[:, :P])
        np.multiply(point.r, root, out=rows[:, P])
    R = triangle(rows)
    known, information = problem.prior.rows(point.x)
    if information.any():
        R = triangle(np.vstack((R, np.column_stack((np.diag(information), known)))))
    columns = np.linalg.norm(R[:, :P], axis=0)
    columns[columns == 0.0] = 1.0
    U, s, V = np.linalg.svd(R[:, :P] / columns)
    s = np.concatenate((s, np.zeros(P - len(s))))
    found = int((s > threshold * s[0]).sum())
    rank = found if rank is None else min(rank, int((s > 0).sum()))
    g = U[:, :rank].T @ R[:, P]
    back = (V[:rank] / s[:rank, None]).T / columns[:, None]
    curvature = None
    if weighing.loss is not Loss.SQUARES and rank:
        curvature = _curvature(problem, point, weight, slope, back)
    return Linear(columns, s, V, rank, g, back, curvature)


def _curvature(problem: Problem, point: Point, weight: Array, slope: Array, back: Array) -> Array:
    """Second derivative of the loss where the weighted rows are orthonormal: 1 and what bends."""
    length = np.where(point.length > 0, point.length, 1.0)
    along = np.add.reduceat(point.J * (point.r / problem.per_row(length))[:, None], problem.starts)
    along = along @ back
    N = np.eye(back.shape[1]) + along.T @ ((slope - weight)[:, None] * along)
    values, vectors = np.linalg.eigh((N + N.T) / 2)
    return (vectors * np.maximum(values, _LEAST_CURVATURE)) @ vectors.T
