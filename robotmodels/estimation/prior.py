"""Gaussian prior of parameters: maximum a posteriori by added rows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Rebuilt, as_floats, as_reals, read_only
from ..errors import InvalidValueError, ShapeError


@dataclass(frozen=True, slots=True, eq=False)
class Prior(Rebuilt):
    """What is known of the parameters before the measurements. Read-only.

    Adds the rows ``sqrt(strength) (x - mean) / deviation`` to the fit, in units of the stated
    standard deviations of the measurements. No loss acts on them.

    Parameters
    ----------
    mean : array_like, shape (P,)
        Expected values, in the units of the parameters.
    deviation : array_like, shape (P,)
        Standard deviations, positive; infinite where nothing is known.
    strength : float
        Factor on the information: 1 takes the deviations as they stand, 0 ignores them.

    Raises
    ------
    ShapeError, InvalidValueError
        Lengths that differ, NaN, deviations that are not positive, a negative strength.

    Examples
    --------
    >>> prior = Prior([0.0, 0.0], [0.1, np.inf], strength=4.0)
    >>> prior.rows(np.array([0.2, 5.0]))
    (array([4., 0.]), array([20.,  0.]))
    """

    mean: Array
    deviation: Array
    strength: float = 1.0

    def __post_init__(self) -> None:
        mean = read_only(as_floats(self.mean, "mean"))
        deviation = read_only(as_reals(self.deviation, "deviation"))
        if mean.ndim != 1 or deviation.shape != mean.shape:
            raise ShapeError(
                f"Prior: expected mean and deviation of one shape (P,), got {mean.shape} and "
                f"{deviation.shape}."
            )
        if not (deviation > 0).all():
            raise InvalidValueError(
                "Prior: expected positive standard deviations (infinite for none), got "
                f"{deviation[~(deviation > 0)][0]}; leave a parameter that is known exactly out of "
                "the fit."
            )
        strength = float(self.strength)
        if not (np.isfinite(strength) and strength >= 0):
            raise InvalidValueError(f"Prior: expected a strength from 0, got {self.strength!r}.")
        object.__setattr__(self, "mean", mean)
        object.__setattr__(self, "deviation", deviation)
        object.__setattr__(self, "strength", strength)

    @classmethod
    def none(cls, parameters: int) -> Prior:
        """The prior that knows nothing of so many parameters."""
        return cls(np.zeros(parameters), np.full(parameters, np.inf))

    def with_strength(self, strength: float) -> Prior:
        """The same with another factor on the information."""
        return replace(self, strength=strength)

    def rows(self, x: ArrayLike) -> tuple[Array, Array]:
        """Values of the added rows at x, and the diagonal of their Jacobian.

        Parameters
        ----------
        x : array_like, shape (P,)
            Parameters.

        Returns
        -------
        value, slope : ndarray, shape (P,)
            Zero where nothing is known.
        """
        slope = np.sqrt(self.strength) / self.deviation
        return (np.asarray(x, dtype=np.float64) - self.mean) * slope, slope
