"""Outliers of a calibration under squares, by fits without them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..estimation import Loss
from ..estimation.outlying import outlying
from .contradiction import Contradiction
from .folds import fixtures_by_name
from .prior import ParameterPrior, refitted
from .problem import problem_of, stacked
from .solve import Solution

_REFITS = 2
"""Largest number of fits without the outliers."""


def judged(
    solution: Solution,
    contradicted: list[Contradiction],
    given: ParameterPrior | None,
    truncation: float | None,
) -> Solution:
    """The fit with its outliers; known distances are none unless they are contradicted."""
    # Contacts leave the scale open, so that they shrink to nothing in a fit without the distance
    # that alone gives it. An outlier bends the noise, the widths of the prior and the weights of a
    # fit, so that all are judged again by a fit without those listed.
    problem, fit = solution.problem, solution.fit
    if fit.loss is not Loss.SQUARES:
        return solution
    blocks = [m.blocks for m in problem.measurements]
    trusted = np.repeat([not m.views for m in problem.measurements], blocks)
    wrong = np.array([b for c in contradicted for b in c.blocks], dtype=np.int64)
    outliers = wrong if len(wrong) else fit.outliers
    if trusted.any() and not len(wrong):
        rows = fit.orthonormal_rows
        outliers = outlying(rows, fit.whitened, fit.block, fit.freedom, trusted)
    for _ in range(_REFITS):
        found = _without(solution, outliers, given, truncation) if len(outliers) else None
        if found is None:
            break
        before = outliers
        outliers = outlying(*found[:2], fit.block, found[2], trusted, before)
        outliers = np.concatenate([wrong, outliers[~np.isin(outliers, wrong)]])
        if set(outliers) == set(before):
            break
    return replace(solution, fit=replace(fit, outliers=outliers))


def _without(
    solution: Solution,
    outliers: NDArray[np.int64],
    given: ParameterPrior | None,
    truncation: float | None,
) -> tuple[Array, Array, float] | None:
    """Orthonormal rows and residuals of all blocks by a fit without some, and its freedom.

    None where too little is left.
    """
    problem = solution.problem
    parts = np.split(np.arange(problem.blocks), np.cumsum([m.blocks for m in problem.measurements]))
    kept = [np.flatnonzero(~np.isin(part, outliers)) for part in parts]
    numbers = [k for k, _ in enumerate(problem.measurements) if len(kept[k])]
    rest = problem_of(
        problem.parameters, [problem.measurements[k].subset(kept[k]) for k in numbers]
    )
    if len(rest.fixtures) < problem.F or rest.rows <= problem.P + problem.F:
        return None
    values, scales = fixtures_by_name(solution), list(solution.scales)
    start = np.array([*solution.deviation, *(values[f.name] for f in rest.fixtures)])
    found = refitted(given, rest, solution, start, tuple(scales[k] for k in numbers), truncation)
    for k, scale in zip(numbers, found.scales, strict=True):
        scales[k] = scale
    values = fixtures_by_name(found)
    x = np.array([*found.deviation, *(values[f.name] for f in problem.fixtures)])
    residual, jacobian = stacked(problem, x, tuple(scales))
    place = {f.name: k for k, f in enumerate(problem.fixtures)}
    order = [*range(problem.P), *(problem.P + place[f.name] for f in rest.fixtures)]
    return jacobian[:, order] @ found.fit.basis, residual, found.fit.freedom
