"""How much single measurements say: leverage, and what the estimate would do without them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Rebuilt, read_only
from ._step import triangle
from .nonlinear_fit import NonlinearFit

_SINGULAR = 1e-13
"""Relative singular value below which a direction is not determined."""


@dataclass(frozen=True, slots=True, eq=False)
class Leverage(Rebuilt):
    """Leverage and influence of measurements. Read-only.

    Parameters
    ----------
    block : ndarray of int, shape (B,)
        Numbers of the measurements.
    leverage : ndarray, shape (B,)
        Parameters that each determines; their sum is `NonlinearFit.freedom`.
    influence : ndarray, shape (B,)
        Cook's distance: square of the change of the estimate without the measurement, relative to
        its covariance and the number of parameters; infinite where something is determined by this
        measurement alone.
    """

    block: NDArray[np.int64]
    leverage: Array
    influence: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "block", read_only(self.block, np.int64))
        object.__setattr__(self, "leverage", read_only(self.leverage))
        object.__setattr__(self, "influence", read_only(self.influence))

    @property
    def most_influential(self) -> NDArray[np.int64]:
        """Numbers of all measurements, those with the most influence first."""
        return self.block[np.argsort(-self.influence, kind="stable")]


def orthonormal_rows(fit: NonlinearFit) -> Array:
    """Orthonormal basis of the weighted rows in the determined directions. Shapes: -> (M, rank)."""
    return fit.jacobian * (np.sqrt(fit.weights) / fit.sigma)[:, None] @ basis_of_rows(fit)


def basis_of_rows(fit: NonlinearFit) -> Array:
    """Factor that makes the weighted rows orthonormal. Shapes: -> (P, rank)."""
    A = fit.jacobian * (np.sqrt(fit.weights) / fit.sigma)[:, None]
    _, information = fit.prior.rows(fit.x)
    R = np.vstack((triangle(A), np.diag(information)))
    columns = np.linalg.norm(R, axis=0)
    columns[columns == 0] = 1.0
    _, s, V = np.linalg.svd(R / columns, full_matrices=False)
    s, V = s[: fit.rank], V[: fit.rank]
    return (V / s[:, None]).T / columns[:, None]


def inverse_factor(R: Array) -> Array:
    """Factor F of the inverse F F^T of R^T R, in determined directions: R (M, P) -> (P, M)."""
    size = np.linalg.norm(R, axis=0)
    size[size == 0.0] = 1.0
    return np.asarray(np.linalg.pinv(R / size, rcond=_SINGULAR) / size[:, None])


def leverage(fit: NonlinearFit) -> Leverage:
    """Leverage and influence of each measurement.

    Parameters
    ----------
    fit : NonlinearFit
        A fit; weights of a robust loss are taken as they are.

    Returns
    -------
    Leverage
        Of each measurement.

    References
    ----------
    R. D. Cook, S. Weisberg, "Residuals and Influence in Regression", 1982, section 3.

    Examples
    --------
    >>> from robotmodels.estimation import fit_nonlinear
    >>> t = np.array([0.0, 0.1, 0.2, 0.3, 5.0])
    >>> A = np.column_stack((np.ones(5), t))
    >>> fit = fit_nonlinear(lambda x: (A @ x - [0.0, 0.2, 0.1, 0.3, 9.0], A), [0.0, 0.0])
    >>> found = leverage(fit)
    >>> int(found.most_influential[0]), round(float(found.leverage.sum()), 9)
    (4, 2.0)
    """
    T = orthonormal_rows(fit)
    r = fit.whitened * np.sqrt(fit.weights)
    labels, place = np.unique(fit.block, return_inverse=True)
    sizes = np.bincount(place, minlength=len(labels))
    order = np.argsort(place, kind="stable")
    starts = np.concatenate(([0], np.cumsum(sizes)[:-1]))
    shares = np.zeros(len(labels))
    influence = np.zeros(len(labels))
    noise = 1.0 if fit.sigma_known else max(fit.scale**2, np.finfo(float).tiny)
    for k in np.unique(sizes):
        which = np.flatnonzero(sizes == k)
        rows = order[starts[which][:, None] + np.arange(k)]
        part = T[rows]
        hat = part @ part.transpose(0, 2, 1)
        shares[which] = np.trace(hat, axis1=1, axis2=2)
        values, vectors = np.linalg.eigh(hat)
        left = 1 - values
        alone = left <= 1e-10
        turned = (vectors.transpose(0, 2, 1) @ r[rows][..., None])[..., 0]
        change = np.where(alone, 0.0, turned / np.where(alone, 1.0, left))
        moved = (change**2 * np.maximum(values, 0.0)).sum(axis=1) / noise / max(fit.rank, 1)
        influence[which] = np.where(alone.any(axis=1), np.inf, moved)
    return Leverage(labels, shares, influence)
