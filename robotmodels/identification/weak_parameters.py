"""Parameters that a log determines poorly: large errors, correlated pairs, impossible signs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..estimation.correlation import correlated_pairs
from ..estimation.estimate import Estimate
from ..minimal_parameters import BaseParameters

CORRELATED = 0.9
"""Least absolute correlation of a listed pair of estimates."""
WEAK = 0.3
"""Relative standard error above which a parameter is poorly determined (seed book 1.6.2.1)."""


@dataclass(frozen=True, slots=True)
class NegativeParameter:
    """Negative estimate of a sum of nonnegative terms."""

    name: str
    value: float
    standard_error: float
    terms: tuple[str, ...]

    @property
    def certain(self) -> bool:
        """Whether the estimate is more than two standard errors below zero."""
        return self.value < -2.0 * self.standard_error

    @property
    def sentence(self) -> str:
        """Meaning and advice."""
        terms = " + ".join(self.terms[:4]) + (" + ..." if len(self.terms) > 4 else "")
        why = (
            "more than noise explains: the model may be incomplete, or the log has wrong signs or "
            "units"
            if self.certain
            else "within its standard error: the log does not determine it"
        )
        return (
            f"{self.name} = {self.value:.3g} is negative, but {terms} cannot be; it is {why}. A "
            "physically consistent fit avoids it."
        )


def negative_parameters(base: BaseParameters, estimate: Estimate) -> tuple[NegativeParameter, ...]:
    """Sums of moments of inertia, masses, rotor inertias and frictions that are negative."""
    from ..minimal_parameters.constraints import positive_drives

    names = base.parameter_names
    # the fixed order of a frame's ten: XX XY XZ YY YZ ZZ MX MY MZ M
    bodies = [10 * j + k for j in range(base.model.f) for k in (0, 3, 5, 9)]
    positive = np.zeros(len(names), dtype=bool)
    positive[[*bodies, *positive_drives(base).tolist()]] = True
    rows = dict(zip(base.names, base.matrix, strict=True))
    negative = []
    for name, value, error in zip(
        estimate.names, estimate.values.tolist(), estimate.standard_errors.tolist(), strict=True
    ):
        terms = np.flatnonzero(rows[name])
        if value < 0.0 and positive[terms].all() and (rows[name][terms] > 0.0).all():
            negative.append(NegativeParameter(name, value, error, tuple(names[k] for k in terms)))
    return tuple(negative)


def correlated_estimates(estimate: Estimate) -> tuple[tuple[str, str, float], ...]:
    """Pairs of estimates with a correlation above `CORRELATED`, the strongest first."""
    return correlated_pairs(estimate.correlation, estimate.names, CORRELATED)


def weak_parameters(estimate: Estimate) -> tuple[str, ...]:
    """Parameters with a relative standard error above `WEAK`, the largest first."""
    relative = estimate.relative_errors
    order = np.argsort(-relative, kind="stable")
    return tuple(estimate.names[k] for k in order if relative[k] > WEAK)
