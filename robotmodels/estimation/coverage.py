"""Estimates beside the truth: errors in standard deviations, and intervals that hold it."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Rebuilt, as_exact, as_floats, read_only
from ..errors import InvalidValueError, ShapeError


@dataclass(frozen=True, slots=True, eq=False)
class Coverage(Rebuilt):
    """Errors of estimates whose truth is known. Read-only; prints as a line.

    Parameters
    ----------
    error : ndarray, shape (P,)
        Estimate less truth, in the units of each.
    standardised : ndarray, shape (P,)
        The same in standard deviations.
    level : float
        Probability of the intervals.
    held : float
        Share of the intervals that hold the truth; near ``level`` where deviations are right.
    """

    error: Array
    standardised: Array
    level: float
    held: float

    def __post_init__(self) -> None:
        for name in ("error", "standardised"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def rms(self) -> float:
        """Root mean square of the errors; of use where all have one unit, or for comparisons."""
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def rms_standardised(self) -> float:
        """Root mean square in standard deviations: near 1 where deviations are right."""
        return float(np.sqrt(np.mean(self.standardised**2)))

    def __str__(self) -> str:
        return (
            f"rms error {self.rms:.4g}, {self.rms_standardised:.2f} deviations; truth in "
            f"{100.0 * self.held:.0f} % of {len(self.error)} intervals of {100.0 * self.level:g} %"
        )


def coverage(
    values: ArrayLike, deviations: ArrayLike, truth: ArrayLike, level: float = 0.95
) -> Coverage:
    """Hold estimates and their standard deviations to a truth that is known.

    Intervals are those of the normal distribution.

    Parameters
    ----------
    values : array_like, shape (P,)
        Estimates, one or more.
    deviations : array_like, shape (P,)
        Their standard deviations, in the same units. Zero stands for an estimate that claims to
        be exact.
    truth : array_like, shape (P,)
        True values.
    level : float
        Probability of the intervals.

    Returns
    -------
    Coverage
        Errors, and how many of the intervals hold the truth.

    Raises
    ------
    ShapeError, InvalidValueError
        Not P finite numbers each, none at all; negative deviations; a level that is no
        probability.

    References
    ----------
    Seed book sections 1.4.4.3 and 1.6.2.1, on standard deviations of estimated parameters.

    Examples
    --------
    >>> print(coverage([1.1, 2.0, 2.7, 4.0], [0.1, 0.1, 0.1, 0.1], [1.0, 2.0, 3.0, 4.0]))
    rms error 0.1581, 1.58 deviations; truth in 75 % of 4 intervals of 95 %
    """
    found = as_floats(values, "values")
    if found.ndim != 1 or not len(found):
        raise ShapeError(f"values: expected shape (P,) with P from 1, got {found.shape}.")
    spread = as_exact(deviations, found.shape, "deviations")
    true = as_exact(truth, found.shape, "truth")
    if (spread < 0.0).any():
        raise InvalidValueError(
            f"deviations: expected numbers from 0, got {float(spread.min())!r}; a standard "
            "deviation is a root of the covariance's diagonal."
        )
    if not 0.0 < level < 1.0:
        raise InvalidValueError(f"level: expected a probability between 0 and 1, got {level!r}.")
    error = found - true
    far = np.where(error == 0.0, 0.0, np.copysign(np.inf, error))
    z = np.divide(error, spread, out=far, where=spread > 0.0)
    within = np.abs(z) <= NormalDist().inv_cdf(0.5 + 0.5 * level)
    return Coverage(error, z, float(level), float(within.mean()))
