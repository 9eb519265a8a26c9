"""Strength of a prior by cross-validation.

Source: T. Hastie, R. Tibshirani, J. Friedman, "The Elements of Statistical Learning", 2nd ed.,
2009, section 7.10.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Rebuilt, read_only
from ..errors import InvalidValueError
from .linearised import Linearise
from .losses import Loss, terms_of
from .nonlinear import fit_nonlinear
from .prior import Prior


@dataclass(frozen=True, slots=True, eq=False)
class StrengthSelection(Rebuilt):
    """Strengths (n,), ascending, and mean loss of held-out rows (n, folds): 1 for noise alone."""

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
        """Strength with the least mean loss."""
        return float(self.strengths[int(np.argmin(self.mean))])


def select_strength(
    linearise: Linearise,
    x0: Array,
    prior: Prior,
    folds: NDArray[np.bool_],
    strengths: Sequence[float] | Array,
    block: NDArray[np.int64],
    loss: Loss = Loss.SQUARES,
) -> StrengthSelection:
    """Cross-validation of ascending prior strengths.

    Shapes: x0 (P,); folds (k, M), as of `k_folds`; block (M,); the others as for `fit_nonlinear`.
    """
    if any(np.intersect1d(block[held], block[~held]).size for held in folds):
        raise InvalidValueError(
            "folds: a measurement is in both parts; split whole measurements, for example "
            "k_folds(block, k, rng)."
        )
    whole = fit_nonlinear(linearise, x0, block=block, prior=prior, loss=loss)
    errors = np.empty((len(strengths), len(folds)))
    for fold, held in enumerate(folds):
        x, used, some = whole.x, _rows(linearise, ~held), _rows(linearise, held)
        _, place, rows = np.unique(block[held], return_inverse=True, return_counts=True)
        # one scale for all: held-out outliers have the weight of fitted ones
        terms = terms_of(loss, rows, max(whole.scale, 1e-300))
        for n in reversed(range(len(strengths))):  # from the strongest, where the start is near
            stronger = prior.with_strength(float(strengths[n]))
            x = fit_nonlinear(
                used, x, block=block[~held], prior=stronger, loss=loss, tolerance=1e-8
            ).x
            length = np.sqrt(np.bincount(place, some(x)[0] ** 2))
            errors[n, fold] = terms(length)[0].sum() / len(place)
    return StrengthSelection(np.asarray(strengths), errors)


def _rows(linearise: Linearise, mask: NDArray[np.bool_]) -> Linearise:
    """Some rows of a problem."""

    def some(x: Array) -> tuple[Array, Array]:
        r, J = linearise(x)
        return r[mask], J[mask]

    return some
