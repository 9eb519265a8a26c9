"""Parameters that a log determines poorly: large errors, correlated pairs, impossible signs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..estimation.correlation import correlated_pairs
from ..estimation.estimate import Estimate
from ..minimal_parameters import BaseParameters

CORRELATED = 0.9
"""Least absolute correlation of a listed pair of estimates."""
WEAK = 0.3
"""Relative standard error above which a parameter is poorly determined (seed book 1.6.2.1)."""


class NegativeParameter(NamedTuple):
    """Negative estimate of a sum of nonnegative terms, its meaning and advice."""

    name: str
    certain: bool
    """Whether the estimate is more than two standard errors below zero."""
    sentence: str


def negative_parameters(base: BaseParameters, estimate: Estimate) -> tuple[NegativeParameter, ...]:
    """Sums of moments of inertia, masses, rotor inertias and frictions that are negative."""
    from ..minimal_parameters.constraints import positive_drives

    # the fixed order of a frame's ten: XX XY XZ YY YZ ZZ MX MY MZ M
    bodies = [10 * j + k for j in range(base.model.f) for k in (0, 3, 5, 9)]
    positive = np.zeros(len(base.parameter_names), dtype=bool)
    positive[[*bodies, *positive_drives(base).tolist()]] = True
    rows = dict(zip(base.names, base.matrix, strict=True))
    negative = []
    for name, value, error in zip(
        estimate.names, estimate.values.tolist(), estimate.standard_errors.tolist(), strict=True
    ):
        terms = np.flatnonzero(rows[name])
        if value < 0.0 and positive[terms].all() and (rows[name][terms] > 0.0).all():
            certain = value < -2.0 * error
            why = "more than noise explains" if certain else "within its standard error"
            added = " + ".join(base.parameter_names[k] for k in terms[:4])
            added += " + ..." if len(terms) > 4 else ""
            sentence = (
                f"{name} = {value:.3g} is negative, but {added} cannot be; it is "
                f"{why}. A physically consistent fit avoids it."
            )
            negative.append(NegativeParameter(name, certain, sentence))
    return tuple(negative)


def correlated_estimates(estimate: Estimate) -> tuple[tuple[str, str, float], ...]:
    """Pairs of estimates with a correlation above `CORRELATED`, the strongest first."""
    return correlated_pairs(estimate.correlation, estimate.names, CORRELATED)


def weak_parameters(estimate: Estimate) -> tuple[str, ...]:
    """Parameters with a relative standard error above `WEAK`, the largest first."""
    relative = estimate.relative_errors
    order = np.argsort(-relative, kind="stable")
    return tuple(estimate.names[k] for k in order if relative[k] > WEAK)
