"""What a motion is judged by: functions of the singular values of the stacked regressor."""

from __future__ import annotations

from enum import Enum

import numpy as np

from ..._arrays import Array

_LEAST = 1e-12
"""Least part of a column's length that a triangular factor has on its diagonal, for an inverse."""
_BLOCK = 2**18
"""Multiplications of a matrix product that one thread does: beyond it OpenBLAS divides the work
among threads, which wait for each other longer than it takes, and far longer on a busy machine."""


class ExcitationCriterion(Enum):
    """What an exciting trajectory makes small.

    Examples
    --------
    >>> ExcitationCriterion.LOG_DET.value
    'minus the logarithm of the determinant of the information matrix'
    """

    CONDITION = "condition number of the stacked base regressor"
    LOG_DET = "minus the logarithm of the determinant of the information matrix"


def _product(W: Array, M: Array) -> Array:
    """``W @ M``, shape (N, b), in blocks of rows that one thread multiplies."""
    N, b = W.shape
    size = max(1, _BLOCK // b**2)
    whole = N - N % size
    blocks = W[:whole].reshape(-1, size, b) @ M
    return np.concatenate((blocks.reshape(whole, M.shape[1]), W[whole:] @ M))


def triangular_factor(W: Array) -> Array:
    """Triangular factor (b, b) of rows (N, b), compiled: the same with any number of threads."""
    from ...kernels.triangles import fold_rows

    R = np.zeros((W.shape[1], W.shape[1]))
    fold_rows(np.ascontiguousarray(W), R)
    return R


def _inverted(W: Array) -> tuple[Array, Array]:
    """Triangular factor R of rows, and the inverse of ``R^T R``, shapes (b, b)."""
    R = triangular_factor(W)
    # with columns of one length the inverse keeps its digits where some are short
    lengths = np.linalg.norm(R, axis=0)
    lengths = np.maximum(lengths, _LEAST * lengths.max()) + np.finfo(float).tiny
    R /= lengths
    corner = np.diagonal(R)
    R[np.diag_indices_from(R)] = np.copysign(np.maximum(np.abs(corner), _LEAST), corner)
    inverse = np.linalg.inv(R) / lengths[:, None]
    return R * lengths, _product(inverse, inverse.T)


def _slope(S: Array, power: int) -> tuple[float, Array]:
    """``log(tr(S^m)) / m`` and its derivative ``S^(m - 1) / tr(S^m)``, m the power."""
    size = float(np.trace(S))
    square, left, raised = S / size, power - 1, np.eye(len(S))
    while left:
        if left % 2:
            raised = _product(raised, square)
        left //= 2
        if left:
            square = _product(square, square)
    total = float((raised * S).sum()) / size
    return np.log(size) + np.log(total) / power, raised / (total * size)


def smooth_condition(W: Array, power: float) -> tuple[float, Array]:
    """Smooth upper bound of the logarithm of a condition number, and its gradient.

    Shapes: W (N, b) -> gradient (N, b).
    """
    R, inverse = _inverted(W)
    half = round(power / 2.0)
    up, rise = _slope(_product(R.T, R), half)
    down, fall = _slope(inverse, half)
    return 0.5 * (up + down), _product(W, rise - _product(_product(inverse, fall), inverse))


def log_volume(W: Array) -> tuple[float, Array]:
    """Minus the mean logarithm of the singular values, and its gradient.

    Shapes: W (N, b) -> gradient (N, b).
    """
    R, inverse = _inverted(W)
    b = W.shape[1]
    return float(-np.log(np.abs(np.diagonal(R))).mean()), _product(W, inverse / -b)
