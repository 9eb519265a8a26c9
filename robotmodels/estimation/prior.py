"""Gaussian prior of parameters: maximum a posteriori by added rows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Rebuilt, as_floats, as_number, as_reals, read_only
from ..errors import InvalidValueError, ShapeError


@dataclass(frozen=True, slots=True, eq=False)
class Prior(Rebuilt):
    """Gaussian prior of parameters. Read-only.

    Adds the rows ``sqrt(strength) (x - mean) / sigma`` to the fit, in units of the stated standard
    deviations of the measurements. No loss acts on them.

    Parameters
    ----------
    mean, sigma : array_like, shape (P,)
        Expected values and standard deviations, in the units of the parameters; infinite for no
        information.
    strength : float
        Factor on the information: 1 uses sigma unchanged, 0 ignores it.

    Examples
    --------
    >>> prior = Prior([0.0, 0.0], [0.1, np.inf], strength=4.0)
    >>> prior.rows(np.array([0.2, 5.0]))
    (array([4., 0.]), array([20.,  0.]))
    """

    mean: Array
    sigma: Array
    strength: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "mean", read_only(as_floats(self.mean, "mean")))
        object.__setattr__(self, "sigma", read_only(as_reals(self.sigma, "sigma")))
        strength = as_number(self.strength, "strength", least=0.0)
        object.__setattr__(self, "strength", strength)
        if self.mean.ndim != 1 or self.sigma.shape != self.mean.shape:
            raise ShapeError(
                f"Prior: expected mean and sigma of one shape (P,), got {self.mean.shape} and "
                f"{self.sigma.shape}."
            )
        if not (self.sigma > 0).all():
            raise InvalidValueError(
                "Prior: expected positive standard deviations (infinite for none), got "
                f"{self.sigma.min()}; leave a parameter that is known exactly out of the fit."
            )

    @classmethod
    def none(cls, parameters: int) -> Prior:
        """Prior without information on P parameters."""
        return cls(np.zeros(parameters), np.full(parameters, np.inf))

    def with_strength(self, strength: float) -> Prior:
        """The same with another factor on the information."""
        return replace(self, strength=strength)

    def rows(self, x: ArrayLike) -> tuple[Array, Array]:
        """Values of the added rows at x (P,), and the diagonal of their Jacobian (P,)."""
        slope = np.sqrt(self.strength) / self.sigma
        return (np.asarray(x, dtype=np.float64) - self.mean) * slope, slope
