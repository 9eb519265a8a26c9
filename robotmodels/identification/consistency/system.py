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

    Parameters
    ----------
    fit : ndarray, shape (k, p)
        F; k is the rank of R.
    target : ndarray, shape (k,)
        t.
    same : ndarray, shape (k, p)
        Rows of order one with the same row space: the least is reached where ``same @ x = level``.
    level : ndarray, shape (k,)
        What they are there.
    best : ndarray, shape (b,)
        Least-squares base parameters, the shortest in natural units where R does not determine all.
    least : float
        Sum of squares that no parameters take away.
    nothing : float
        Sum of squares that is rounding.
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

    Parameters
    ----------
    base : BaseParameters
        b of p standard parameters.
    R : array_like, shape (r, b)
        Factor of the weighted regressor, or the regressor itself.
    y : array_like, shape (r,)
        Its right side.
    rest : float
        Squares that are not in them.
    unit : ndarray, shape (p,)
        Natural sizes of the standard parameters.

    Returns
    -------
    TorqueSquares
        Scaled by columns, so that units do not matter.

    Raises
    ------
    ShapeError, InvalidValueError
        Wrong shapes, NaN, no information at all, or a negative rest.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> base = base_parameters(load("planar_2r"), drive=False)
    >>> torque_squares(base, np.eye(4), np.ones(4), 2.0, np.ones(20)).least
    2.0
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
    """A weighted system that says something, as arrays.

    Parameters
    ----------
    base, R, y, rest
        As for `torque_squares`.

    Returns
    -------
    R : ndarray, shape (r, b)
        Factor.
    y : ndarray, shape (r,)
        Right side.

    Raises
    ------
    ShapeError, InvalidValueError
        Wrong shapes, NaN, no information at all, or a negative rest.
    """
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
