"""What the methods that simulate the controlled robot return."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..._arrays import Array, read_only
from ..methods.estimate import Estimate
from .loop import ClosedLoop


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedEstimate(Estimate):
    """Parameters of a method that simulates; their covariance holds for correlated residuals.

    Parameters
    ----------
    white : ndarray, shape (b,)
        Deviations that would hold if residuals were white.
    lags : int
        Equations over which the covariance takes correlation into account.
    condition : float
        Of the equations solved for the parameters, with columns of length one.
    strength : float
        Smallest correlation of a combination of regressor columns with the instruments, from 0 to
        1; 1 for methods without instruments. Below about 0.3 the instruments are weak.
    loop : ClosedLoop or None
        How the robot was simulated; None if its mass matrix was not definite to begin with.
    """

    white: Array = field(default_factory=lambda: np.zeros(0))
    lags: int = 0
    condition: float = np.nan
    strength: float = 1.0
    loop: ClosedLoop | None = None

    def __post_init__(self) -> None:
        for name in ("values", "covariance", "sigma", "white"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
