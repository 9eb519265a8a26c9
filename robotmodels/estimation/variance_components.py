"""Noise of several kinds of rows in one fit, such as positions and orientations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Rebuilt, read_only
from .._choices import chosen
from ..errors import InvalidValueError, ShapeError
from ._problem import Linearise, checked_problem
from .leverage import orthonormal_rows
from .losses import Loss, robust_scale
from .nonlinear import fit_nonlinear
from .nonlinear_fit import NonlinearFit
from .prior import Prior


@dataclass(frozen=True, slots=True, eq=False)
class VarianceComponents(Rebuilt):
    """Standard deviations of groups of rows, and the fit with them. Read-only.

    Parameters
    ----------
    group : ndarray of int, shape (G,)
        Numbers of the groups.
    factors : ndarray, shape (G,)
        Standard deviation of each group relative to the stated one; 1 where ``undetermined``.
    freedom : ndarray, shape (G,)
        Rows of each group less the parameters that they determine.
    undetermined : ndarray of int
        Groups that are fitted without anything left over: their noise cannot be told.
    converged : bool
        Whether the factors have come to rest.
    fit : NonlinearFit
        With the stated deviations multiplied by the factors.
    """

    group: NDArray[np.int64]
    factors: Array
    freedom: Array
    undetermined: NDArray[np.int64]
    converged: bool
    fit: NonlinearFit

    def __post_init__(self) -> None:
        for name in ("group", "undetermined"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.int64))
        for name in ("factors", "freedom"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


def variance_components(
    linearise: Linearise,
    x0: ArrayLike,
    *,
    group: ArrayLike,
    sigma: ArrayLike = 1.0,
    block: ArrayLike | None = None,
    loss: Loss | str = Loss.SQUARES,
    prior: Prior | None = None,
    tolerance: float = 1e-6,
    iterations: int = 50,
    progress: Callable[[float], None] | None = None,
) -> VarianceComponents:
    """Estimate the standard deviation of each group of rows along with the parameters.

    Each round divides the sum of squares of a group by its rows less the parameters that they
    determine; a robust loss takes the median of its lengths instead.

    Parameters
    ----------
    linearise, x0, sigma, block, loss, prior
        As for `fit_nonlinear`.
    group : array_like of int, shape (M,)
        Group of each row. With a robust loss the rows of a measurement that belong to one group
        make a length.
    tolerance : float
        Largest last relative change of a factor.
    iterations : int
        Largest number of rounds.
    progress : callable, optional
        Called with the fraction of rounds done.

    Returns
    -------
    VarianceComponents
        Factors and the fit with them.

    Raises
    ------
    ShapeError, InvalidValueError
        As for `fit_nonlinear`, or groups that are not whole numbers for each row.

    References
    ----------
    F. R. Helmert 1924; K.-R. Koch, "Parameter Estimation and Hypothesis Testing in Linear Models",
    2nd ed., 1999, section 3.6.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> A = rng.normal(size=(4000, 3))
    >>> kind = np.arange(4000) % 2
    >>> y = A @ [1.0, 2.0, 3.0] + rng.normal(size=4000) * np.where(kind, 5.0, 0.1)
    >>> found = variance_components(lambda x: (A @ x - y, A), np.zeros(3), group=kind)
    >>> found.factors.round(1)
    array([0.1, 5. ])
    """
    loss = chosen(Loss, loss, "loss")
    numbers = np.asarray(group)
    if numbers.ndim != 1 or numbers.dtype.kind not in "iu":
        raise InvalidValueError(
            f"group: expected a whole number for each row, got {numbers.dtype} {numbers.shape}."
        )
    stated = checked_problem(linearise, x0, sigma, block, prior)[0].sigma
    if len(numbers) != len(stated):
        raise ShapeError(
            f"group: expected one number for each of the {len(stated)} rows, got {len(numbers)}."
        )
    labels, place = np.unique(numbers, return_inverse=True)
    factors = np.ones(len(labels))
    x = x0
    done = 0
    while True:
        fit = fit_nonlinear(
            linearise, x, sigma=stated * factors[place], block=block, loss=loss, prior=prior
        )
        x = fit.x
        share = (orthonormal_rows(fit) ** 2).sum(axis=1)
        used = np.asarray(np.bincount(place, share, len(labels)), dtype=np.float64)
        left = np.bincount(place, minlength=len(labels)).astype(np.float64) - used
        found = _factors(fit, place, used, left, loss)
        free = (left > 1e-6) & (found > 0)
        found[~free] = 1 / factors[~free]
        quiet = bool((np.abs(found - 1) <= tolerance).all())
        if progress is not None:
            progress(1.0 if quiet else min(1.0, (done + 1) / iterations))
        if quiet or done >= iterations:
            return VarianceComponents(labels, factors, left, labels[~free], quiet, fit)
        factors = factors * found
        done += 1


def _factors(
    fit: NonlinearFit, place: NDArray[np.int64], used: Array, left: Array, loss: Loss
) -> Array:
    """Standard deviation of each group relative to that in the fit."""
    G = len(used)
    z = fit.whitened
    if loss is Loss.SQUARES:
        return np.sqrt(np.bincount(place, z * z, G) / np.maximum(left, 1e-12))
    found = np.zeros(G)
    for g in range(G):
        own = place == g
        _, where = np.unique(fit.block[own], return_inverse=True)
        rows = np.bincount(where)
        length = np.sqrt(np.bincount(where, z[own] ** 2))
        found[g] = robust_scale(length, rows, float(used[g]))
    return found
