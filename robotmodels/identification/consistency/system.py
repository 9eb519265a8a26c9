"""The weighted system of an identification as squares of standard parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, Rebuilt, as_core, as_exact
from ...errors import InvalidValueError, ShapeError
from ...minimal_parameters import BaseParameters

_RANK = 1e-10
"""Singular value relative to the largest, of columns in natural units, that is no information: what
is seen with less is rounding, and left to the prior."""


@dataclass(frozen=True, slots=True, eq=False)
class TorqueSquares(Rebuilt):
    """``|R M x - y|^2 + rest = |F x - t|^2 + least`` for every x.

    Shapes: fit, same (k, p); target, level (k,); best (b,).
    """

    fit: Array
    target: Array
    same: Array
    level: Array
    best: Array
    least: float
    nothing: float

    def sum(self, x: Array) -> float:
        """Weighted sum of squared residuals of standard parameters."""
        return float(np.sum((self.fit @ x - self.target) ** 2)) + self.least


def torque_squares(
    base: BaseParameters, R: ArrayLike, y: ArrayLike, rest: float, unit: Array
) -> TorqueSquares:
    """Squares of the torques' residuals from the triangular factor of an identification.

    Shapes: R (r, b), y (r,), unit (p,).
    """
    factor, right = checked_factor(base, R, y, rest)
    scale = 1.0 / np.sqrt(((base.matrix * unit) ** 2).sum(axis=1))
    U, values, V = np.linalg.svd(factor / scale, full_matrices=False)
    k = int((values > _RANK * values[0]).sum())
    U, values, V = U[:, :k], values[:k], V[:k]
    target = U.T @ right
    seen = U.T @ factor
    # turned so that its rows are orthogonal with columns of one length: the solver likes it
    lengths = np.linalg.norm(seen, axis=0)
    turn = np.linalg.svd(seen / np.where(lengths > 0, lengths, 1.0))[0].T
    level = target / values
    same = (V * scale) @ base.matrix
    best = (V.T @ level) / scale
    left = float(np.sum((right - U @ target) ** 2))
    nothing = (1e-11**2) * (float(right @ right) + rest)
    return TorqueSquares(
        turn @ seen @ base.matrix, turn @ target, same, level, best, left + float(rest), nothing
    )


def checked_factor(
    base: BaseParameters, R: ArrayLike, y: ArrayLike, rest: float
) -> tuple[Array, Array]:
    """Check a weighted system of equations. Shapes: -> R (r, b), y (r,)."""
    factor = as_core(R, (len(base),), "R")
    if factor.ndim != 2:
        raise ShapeError(
            f"R: expected shape (r, {len(base)}), a column for each base parameter, got "
            f"{factor.shape}."
        )
    right = as_exact(y, (len(factor),), "y")
    if not (np.isfinite(rest) and rest >= 0.0):
        raise InvalidValueError(
            f"rest: expected a sum of squares, zero or more, got {rest}; "
            "give 0 for rounding below zero."
        )
    if not factor.any():
        raise InvalidValueError(
            "R: every entry is zero, so that no parameter is seen; check the log and its weights."
        )
    return factor, right
