"""Estimated parameters with their covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._arrays import Array, Frozen
from .._outcomes import Outcome
from ..errors import InvalidValueError, nearest_names


class EstimateStatus(Outcome):
    """Outcome of an estimation."""

    SOLVED = 0, "The parameters minimise the weighted squares of the residuals."
    NOT_CONVERGED = 1, "The iterations ended before the parameters converged; use them with care."
    UNSTABLE = (
        2,
        "The simulated robot diverged, so that there are no parameters. Give the robot's own "
        "controller= and references, or start= near the true parameters, or use method 'wls'.",
    )
    POOR_PREDICTION = 3, "Torques are predicted poorly: find the cause before using the parameters."


class NamedValues(Frozen):
    """Base of results with names, values, covariance and status."""

    __slots__ = ()
    names: tuple[str, ...]
    values: Array
    covariance: Array
    status: Outcome

    @property
    def standard_errors(self) -> Array:
        """Standard errors of the values, shape (b,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def relative_errors(self) -> Array:
        """Standard errors relative to the values, shape (b,); infinite for a value of 0."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.standard_errors / np.abs(self.values)
            return np.where(self.values != 0.0, ratio, np.inf)

    @property
    def correlation(self) -> Array:
        """Correlation of the estimates, shape (b, b); NaN where a standard error is 0."""
        s = self.standard_errors
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.covariance / np.outer(s, s)

    def value(self, name: str) -> float:
        """Value of one parameter, SI units, by its name such as ``"ZZ1"`` or ``"ZZ1R"``."""
        return float(self.values[self._number(name)])

    def standard_error(self, name: str) -> float:
        """Standard error of one parameter, SI units."""
        return float(self.standard_errors[self._number(name)])

    def reason(self) -> str:
        """The status as a sentence."""
        return self.status.sentence

    def _number(self, name: str) -> int:
        for text in (name, name.removesuffix("R")):  # R marks regrouped parameters in print
            if text in self.names:
                return self.names.index(text)
        near = ", ".join(nearest_names(name, self.names)) or "none"
        raise InvalidValueError(
            f"name: {name!r} was not identified; near it: {near}. `names` lists the identified "
            "parameters, `details` those that were dropped or not identifiable."
        )


@dataclass(frozen=True, slots=True, eq=False)
class Estimate(NamedValues):
    """Parameters with standard errors. Read-only.

    Parameters
    ----------
    names, values, covariance : tuple of str, ndarrays of shapes (b,) and (b, b)
        The parameters, SI units; NaN where a simulation diverged.
    sigma : ndarray, shape (m,)
        Standard deviation of the residuals of each group of equations.
    status, iterations, notes, details
        Outcome; iterations of the method, 1 for direct ones; remarks; further results of the
        method, None for most.
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    sigma: Array
    status: EstimateStatus = EstimateStatus.SOLVED
    iterations: int = 1
    notes: tuple[str, ...] = ()
    details: Any = None


def correlated_pairs(
    correlation: Array, names: Sequence[str], least: float
) -> tuple[tuple[str, str, float], ...]:
    """Pairs of estimates whose correlation is above a bound, the strongest first.

    Shapes: correlation (p, p).
    """
    first, second = np.nonzero(np.triu(np.abs(np.nan_to_num(correlation)) > least, k=1))
    pairs = [
        (names[i], names[j], float(correlation[i, j]))
        for i, j in zip(first.tolist(), second.tolist(), strict=True)
    ]
    return tuple(sorted(pairs, key=lambda pair: -abs(pair[2])))
