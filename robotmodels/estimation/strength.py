"""Strength of a prior by cross-validation: how well data kept aside are predicted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Rebuilt, as_floats, read_only
from .._choices import chosen
from ..errors import InvalidValueError, ShapeError
from ._problem import Linearise, Weighing, checked_problem
from .losses import Loss
from .nonlinear import fit_nonlinear
from .prior import Prior


@dataclass(frozen=True, slots=True, eq=False)
class StrengthSelection(Rebuilt):
    """Strengths that were tried and how well each predicts. Read-only.

    Parameters
    ----------
    strengths : ndarray, shape (n,)
        Tried, from the weakest.
    errors : ndarray, shape (n, folds)
        Mean loss of the rows kept aside, in squares of their stated deviations: 1 is noise alone.
    """

    strengths: Array
    errors: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "strengths", read_only(self.strengths))
        object.__setattr__(self, "errors", read_only(self.errors))

    @property
    def mean(self) -> Array:
        """Mean over the folds, shape (n,)."""
        return self.errors.mean(axis=1)

    @property
    def strength(self) -> float:
        """The one that predicts best."""
        return float(self.strengths[int(np.argmin(self.mean))])

    @property
    def cautious(self) -> float:
        """The strongest within one standard error of the best, folds compared pair by pair."""
        best = int(np.argmin(self.mean))
        worse = self.errors - self.errors[best]
        error = worse.std(axis=1, ddof=1) / np.sqrt(self.errors.shape[1])
        return float(self.strengths[np.flatnonzero(worse.mean(axis=1) <= error)[-1]])

    @property
    def at_end(self) -> bool:
        """Whether the best is the first or last that was tried, so that more should be."""
        return int(np.argmin(self.mean)) in (0, len(self.strengths) - 1)


def select_strength(
    linearise: Linearise,
    x0: ArrayLike,
    prior: Prior,
    folds: ArrayLike,
    *,
    strengths: ArrayLike | None = None,
    sigma: ArrayLike = 1.0,
    block: ArrayLike | None = None,
    loss: Loss | str = Loss.SQUARES,
    sigma_known: bool = False,
    progress: Callable[[float], None] | None = None,
) -> StrengthSelection:
    """Try strengths of a prior on data kept aside.

    Parameters
    ----------
    linearise, x0, sigma, block, loss, sigma_known
        As for `fit_nonlinear`.
    prior : Prior
        Its strength is replaced.
    folds : array_like of bool, shape (k, M)
        Rows kept aside, as `k_folds` gives them; whole measurements.
    strengths : array_like, shape (n,), optional
        To try; default 1e-6 to 1e6, two a decade.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    StrengthSelection
        All errors, and the choice.

    Raises
    ------
    ShapeError, InvalidValueError
        Folds that are no masks of the rows, keep nothing or all aside, or cut measurements.

    References
    ----------
    T. Hastie, R. Tibshirani, J. Friedman, "The Elements of Statistical Learning", 2nd ed., 2009,
    section 7.10.

    Examples
    --------
    >>> from robotmodels.estimation.folds import k_folds
    >>> rng = np.random.default_rng(0)
    >>> A = rng.normal(size=(30, 20))
    >>> y = A @ (0.1 * rng.normal(size=20)) + rng.normal(size=30)
    >>> prior = Prior(np.zeros(20), np.full(20, 0.1))
    >>> chosen = select_strength(
    ...     lambda x: (A @ x - y, A), np.zeros(20), prior, k_folds(range(30), 5, rng=0)
    ... )
    >>> bool(0.01 < chosen.strength < 100.0)
    True
    """
    loss = chosen(Loss, loss, "loss")
    problem, _ = checked_problem(linearise, x0, sigma, block, prior)
    masks = _masks(folds, problem.labels[problem.block])
    grid = (
        np.logspace(-6, 6, 25) if strengths is None else np.sort(as_floats(strengths, "strengths"))
    )
    if grid.ndim != 1 or not len(grid) or grid[0] < 0:
        raise InvalidValueError(f"strengths: expected numbers from 0, got {strengths!r:.60}.")
    options = {"loss": loss, "sigma_known": sigma_known}
    whole = fit_nonlinear(linearise, x0, sigma=sigma, block=block, prior=prior, **options)
    # one scale for all: an outlier kept aside is to count no more than one that is fitted
    weighing = Weighing.of(loss, problem.rows, 1.0 if sigma_known else max(whole.scale, 1e-300))
    errors = np.empty((len(grid), len(masks)))
    for fold, aside in enumerate(masks):
        x = whole.x
        used = np.flatnonzero(~aside)

        def rest(x: Array, used: NDArray[np.int64] = used) -> tuple[Array, Array]:
            r, J = linearise(x)
            return np.asarray(r)[used], np.asarray(J)[used]

        held = np.unique(problem.block[aside])
        for n in range(len(grid) - 1, -1, -1):  # from the strongest, where the start is near
            fit = fit_nonlinear(
                rest, x, sigma=problem.sigma[used], block=problem.block[used],
                prior=prior.with_strength(float(grid[n])), tolerance=1e-8, **options,
            )  # fmt: skip
            x = fit.x
            point = problem.at(x)
            errors[n, fold] = (
                np.inf
                if point is None
                else weighing.terms(point.length)[0][held].sum() / aside.sum()
            )
            if progress is not None:
                progress((fold * len(grid) + len(grid) - n) / errors.size)
    return StrengthSelection(grid, errors)


def _masks(folds: ArrayLike, block: NDArray[np.int64]) -> NDArray[np.bool_]:
    masks = np.asarray(folds)
    if masks.dtype != np.bool_ or masks.ndim != 2 or masks.shape[1] != len(block):
        raise ShapeError(
            f"folds: expected masks of shape (k, {len(block)}), as k_folds gives them, got "
            f"{masks.dtype} {masks.shape}."
        )
    if len(masks) < 2 or not masks.any(axis=1).all() or masks.all(axis=1).any():
        raise InvalidValueError(
            "folds: expected two or more, each with some rows kept aside and some not."
        )
    for mask in masks:
        if np.intersect1d(block[mask], block[~mask]).size:
            raise InvalidValueError(
                "folds: a measurement is partly kept aside; split measurements as a whole, for "
                "example k_folds(block, k, rng)."
            )
    return masks
