"""Tracking of a moving target: estimation of the motion that the camera does not cause.

The rate of s by the target is ``(s_k - s_{k-1}) / step - L [v; w]``.

Parameters
----------
kalman, process, noise : bool, float, float
    Whether a Kalman filter with constant slope filters the differences; standard deviations: of
    the change of the slope in one second, 1/s^2 per root second, and of a component of s.
s, rate, slope : ndarray, shape (k,)
    Last measurement, its rate by the target per s, and the slope of the rate per s^2.
covariance : ndarray, shape (2, 2)
    Of rate and slope, the same for every component.

References
----------
Seed book section 6.3.4; P. Corke and M. Good, "Dynamic effects in visual closed-loop systems",
IEEE Trans. Robotics and Automation 12(5), 1996.

Examples
--------
>>> tracker = TargetMotion()
>>> found = tracker.start([0.0])
>>> for k in range(1, 200):
...     found = tracker.update(found, [0.02 * k * 0.3], [0.0], 0.02)
>>> found.rate.round(6)
array([0.3])
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_floats, as_number
from ..errors import InvalidValueError
from .results import Value, Values


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TargetEstimate(Values):
    """Estimate of the motion of a target."""

    s: Array
    rate: Array
    slope: Array
    covariance: Array


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TargetMotion(Value):
    """Estimation of the rate of a measurement by a moving target."""

    kalman: bool = True
    process: float = 1.0
    noise: float = 1e-4

    def start(self, s: ArrayLike) -> TargetEstimate:
        """Estimate before any motion was seen, of a measurement s (k,)."""
        s = as_floats(s, "s")
        return TargetEstimate(s, 0.0 * s, 0.0 * s, np.eye(2))

    def update(
        self, last: TargetEstimate, s: ArrayLike, own: ArrayLike, step: float
    ) -> TargetEstimate:
        """Estimate with the next measurement s (k,); ``own`` (k,) is the rate by the camera."""
        if not isinstance(last, TargetEstimate):
            raise InvalidValueError(
                f"last: expected the estimate of start or update, got {type(last).__name__}."
            )
        s, own = (as_exact(x, last.s.shape, name) for x, name in ((s, "s"), (own, "own")))
        h = as_number(step, "step", above=0.0)
        seen = (s - last.s) / h - own
        if not self.kalman:
            return TargetEstimate(s, seen, 0.0 * s, last.covariance)
        F = np.array(((1.0, h), (0.0, 1.0)))
        Q = self.process**2 * np.array(((h**3 / 3.0, h**2 / 2.0), (h**2 / 2.0, h)))
        P = F @ last.covariance @ F.T + Q
        K = P[:, 0] / (P[0, 0] + 2.0 * (self.noise / h) ** 2)
        rate = last.rate + h * last.slope
        missing = seen - rate
        kept = np.eye(2) - np.outer(K, (1.0, 0.0))
        return TargetEstimate(s, rate + K[0] * missing, last.slope + K[1] * missing, kept @ P)
