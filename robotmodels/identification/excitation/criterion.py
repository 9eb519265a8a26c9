"""What a motion is judged by: functions of the singular values of the stacked regressor."""

from __future__ import annotations

from enum import Enum

import numpy as np

from ..._arrays import Array

_LEAST = 1e-12


class ExcitationCriterion(Enum):
    """What an exciting trajectory makes small.

    Examples
    --------
    >>> ExcitationCriterion.LOG_DET.value
    'minus the logarithm of the determinant of the information matrix'
    """

    CONDITION = "condition number of the stacked base regressor"
    LOG_DET = "minus the logarithm of the determinant of the information matrix"


def singular_values(W: Array) -> tuple[Array, Array]:
    """Singular values and right singular vectors of a tall matrix.

    Parameters
    ----------
    W : ndarray, shape (N, b)
        N >= b.

    Returns
    -------
    s : ndarray, shape (b,)
        Descending.
    Vt : ndarray, shape (b, b)
        The vectors as rows.

    Examples
    --------
    >>> singular_values(np.diag([3.0, 2.0]))[0]
    array([3., 2.])
    """
    _, s, Vt = np.linalg.svd(np.linalg.qr(W, mode="r"))
    return s, Vt


def smooth_condition(W: Array, power: float) -> tuple[float, Array]:
    """Smooth upper bound of the logarithm of a condition number, and its gradient.

    The largest singular value is replaced by the p-norm of all, and the smallest by that of their
    inverses. The bound is at most ``log(b) / p * 2`` above the logarithm, and unlike it has a
    gradient where singular values meet, as the smallest do at an optimum.

    Parameters
    ----------
    W : ndarray, shape (N, b)
        N >= b.
    power : float
        p, at least 1.

    Returns
    -------
    value : float
        ``log |s|_p + log |1 / s|_p``.
    gradient : ndarray, shape (N, b)
        With respect to W.

    Examples
    --------
    >>> value, gradient = smooth_condition(np.diag([4.0, 1.0]), 50.0)
    >>> round(float(np.exp(value)), 6), gradient.diagonal()
    (4.0, array([ 0.25, -1.  ]))
    """
    s, Vt = singular_values(W)
    s = np.maximum(s, _LEAST * s[0])
    up, down = (s / s[0]) ** power, (s[-1] / s) ** power
    value = np.log(s[0] / s[-1]) + (np.log(up.sum()) + np.log(down.sum())) / power
    slope = (up / up.sum() - down / down.sum()) / s
    return float(value), W @ ((Vt.T * (slope / s)) @ Vt)


def log_volume(W: Array) -> tuple[float, Array]:
    """Minus the mean logarithm of the singular values, and its gradient.

    It is ``-log det(W^T W) / (2 b)``.

    Parameters
    ----------
    W : ndarray, shape (N, b)
        N >= b.

    Returns
    -------
    value : float
        Smaller is better.
    gradient : ndarray, shape (N, b)
        With respect to W.

    Examples
    --------
    >>> value, gradient = log_volume(np.diag([np.e, np.e]))
    >>> value, bool(np.allclose(gradient, -0.5 / np.e * np.eye(2)))
    (-1.0, True)
    """
    s, Vt = singular_values(W)
    s = np.maximum(s, _LEAST * s[0])
    return float(-np.log(s).mean()), W @ ((Vt.T * (-1.0 / (s.size * s**2))) @ Vt)
