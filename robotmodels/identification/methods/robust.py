"""Robust (M-estimation) least squares: outlying equations are down-weighted.

Parameters
----------
system : Equations
    Equations of a log, from `equations`.
factors : TriangularFactors
    Factors of the same equations; weighted least squares is the start.

Returns
-------
Estimate
    ``sigma`` are residual standard deviations from medians; the covariance takes variances
    that differ between equations into account; ``details`` has the outliers by joint and time.

Raises
------
InvalidValueError
    Another loss; fewer equations than parameters.

References
----------
P. J. Huber and E. M. Ronchetti, "Robust Statistics", 2nd ed., 2009, sections 7.6 to 7.8; V. Yohai,
Annals of Statistics 15(2), 1987 (fixed scale for redescending losses).

Examples
--------
>>> from robotmodels.datasets import example_log
>>> from robotmodels.identification import Robust, fit
>>> from robotmodels.logs import Log
>>> arm, log = example_log()
>>> tau = log.tau.copy()
>>> tau[::50] += 50.0  # one sample in fifty is wrong
>>> spoilt = Log(log.dt, log.q, tau)
>>> result = fit(arm, spoilt, Robust("tukey"), drive=("Fv",), processing={"decimation": 1})
>>> round(result.value("Fv1"), 2)
2.0
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, Rebuilt, read_only
from ..._choices import chosen
from ...estimation.estimate import Estimate, EstimateStatus
from ...estimation.factor import TriangularFactors, merged_tree, triangle
from ...estimation.linear import (
    check_count,
    inverse_std,
    inverse_triangle,
    solved,
    weighted,
)
from ...estimation.losses import Loss, loss_terms, tuning
from ..equations import Equations
from .base import Method

_MOST = 100
_STILL = 1e-4
"""Convergence tolerance: change of the parameters in standard errors."""
_SCALES = 20
"""Largest number of passes that change the residual scales: medians may alternate."""
_STEADY = 1e-3
"""Convergence tolerance: relative change of the residual scales."""
_ROUNDING = 1e-12
"""Rounding tolerance: change of predicted torques relative to the measured ones."""
_FAR = 4.0
"""Least residual of an outlier, in standard deviations (probability 6e-5 for normal noise)."""
_LISTED = 1000
_NORMAL_MEDIAN = 0.6744897501960817
"""Median length of standard normal residuals."""
_ONE = np.ones(1, dtype=np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Outliers(Rebuilt):
    """Outlying equations (residuals above four standard deviations): counts by group, the largest.

    Shapes: counts (m,); t (k,) s, group (k,), size (k,) in standard deviations, in the order of
    time.
    """

    counts: NDArray[np.int64]
    t: Array
    group: NDArray[np.int64]
    size: Array

    def __post_init__(self) -> None:
        for name, kind in (
            ("counts", np.int64),
            ("t", float),
            ("group", np.int64),
            ("size", float),
        ):
            object.__setattr__(self, name, read_only(getattr(self, name), kind))


@dataclass(frozen=True, slots=True, eq=False)
class Robust(Method):
    """Robust least squares by ``loss``: "huber", "cauchy" or "tukey" (or "squares")."""

    loss: Loss | str = Loss.HUBER
    name: ClassVar[str] = "robust"
    title: ClassVar[str] = "robust least squares"

    def __post_init__(self) -> None:
        chosen(Loss, self.loss, "loss")

    def solve(self, system: Equations, factors: TriangularFactors) -> Estimate:
        """Estimate the parameters by iteratively re-weighted least squares over the equations."""
        loss = chosen(Loss, self.loss, "loss")
        check_count(factors)
        state = _Iteration(system, factors, weighted(factors).values)
        first = Loss.SQUARES if loss is Loss.SQUARES else Loss.HUBER
        status = state.run(first, fixed=False)
        if loss is not first:
            # redescending losses start at Huber's solution, with its scales
            status = state.run(loss, fixed=True)
        return state.estimate(loss, status)


class _Iteration:
    """State of the iteration: values and residual scales of the groups."""

    def __init__(self, system: Equations, factors: TriangularFactors, values: Array) -> None:
        self.system = system if system.cache is not None else system.cached()
        self.factors, self.values, self.count = factors, values, 0
        self.sigma = self.deviations(self.residuals())

    def residuals(self) -> list[tuple[Array, NDArray[np.bool_]]]:
        """Residuals and mask of every block."""
        return [(b.y - b.W @ self.values, b.use) for b in self.system.blocks()]

    def deviations(self, residuals: list[tuple[Array, NDArray[np.bool_]]]) -> Array:
        """Standard deviations of the groups (m,) from medians, at least rounding."""
        freedom = np.sqrt(1.0 - len(self.factors.names) / self.factors.rows)
        e, use = (np.concatenate(parts) for parts in zip(*residuals, strict=True))
        medians = [
            np.median(np.abs(e[taken, j])) if taken.any() else 0.0 for j, taken in enumerate(use.T)
        ]
        sigma = np.array(medians) / (_NORMAL_MEDIAN * freedom)
        return 1.0 / inverse_std(self.factors, sigma)

    def run(self, loss: Loss, fixed: bool) -> EstimateStatus:
        """Iterate until the values converge, with fixed or updated residual scales."""
        least = 1.0 / inverse_std(self.factors, np.zeros(len(self.sigma))).max()
        for count in range(1, _MOST + 1):
            self.count += 1
            residuals = self.residuals()
            R, y = self._weighted_triangle(loss, residuals)
            inverse = inverse_triangle(R)
            moved = inverse @ y - self.values
            self.values = self.values + moved
            errors = np.linalg.norm(inverse, axis=1)
            still = (np.abs(moved) <= _STILL * errors).all() or self._is_rounding(moved)
            if not fixed and count <= _SCALES:
                last, self.sigma = self.sigma, self.deviations(residuals)
                change = np.abs(self.sigma - last)
                still = still and bool((change <= _STEADY * last + 10.0 * least).all())
            if still:
                return EstimateStatus.SOLVED
        return EstimateStatus.NOT_CONVERGED

    def _weighted_triangle(
        self, loss: Loss, residuals: list[tuple[Array, NDArray[np.bool_]]]
    ) -> tuple[Array, Array]:
        c = tuning(loss, _ONE)

        def factors() -> Iterator[Array]:
            for block, (e, use) in zip(self.system.blocks(), residuals, strict=True):
                weights = np.sqrt(loss_terms(loss, np.abs(e) / self.sigma, c)[1]) / self.sigma
                rows = np.column_stack((block.W[use], block.y[use]))
                yield triangle(rows * weights[use][:, None])

        whole = merged_tree(factors(), lambda a, b: triangle(np.vstack((a, b))))
        assert whole is not None  # a log has pieces
        b = len(self.values)
        return whole[:b, :b], whole[:b, b]

    def _is_rounding(self, moved: Array) -> bool:
        changes = [np.linalg.norm(R[:, :-1] @ moved) for R in self.factors.factors]
        sizes = [np.linalg.norm(R[:, -1]) for R in self.factors.factors]
        return float(max(changes)) <= _ROUNDING * float(max(sizes))

    def estimate(self, loss: Loss, status: EstimateStatus) -> Estimate:
        """The estimate with its covariance and outliers."""
        factors, c, b = self.factors, tuning(loss, _ONE), len(self.values)
        weights = 1.0 / self.sigma
        slopes, scores, counts = np.zeros(len(weights)), np.zeros((b, b)), 0
        far = np.zeros((0, 3))
        for block in self.system.blocks():
            u = np.where(block.use, (block.y - block.W @ self.values) * weights, 0.0)
            _, w, slope = loss_terms(loss, np.abs(u), c)
            slopes += np.where(block.use, slope, 0.0).sum(axis=0)
            rows = ((w * u * weights)[..., None] * block.W).reshape(-1, b)
            scores += rows.T @ rows
            distant = np.abs(u) > _FAR
            counts = counts + distant.sum(axis=0)
            i, j = np.nonzero(distant)
            listed = np.column_stack((block.t[i], j.astype(np.float64), u[i, j]))
            far = np.vstack((far, listed))
            far = far[np.argsort(-np.abs(far[:, 2]), kind="stable")[:_LISTED]]
        far = far[np.lexsort((far[:, 1], far[:, 0]))]
        share = np.maximum(factors.counts, 1)
        _, inverse, _ = solved(factors, np.sqrt(np.maximum(slopes / share, 1e-3)) * weights)
        covariance = factors.rows / (factors.rows - b) * inverse @ scores @ inverse
        group = far[:, 1].astype(np.int64)
        outliers = Outliers(np.asarray(counts), far[:, 0], group, far[:, 2])
        notes: tuple[str, ...] = ()
        if outliers.counts.any():
            percent = " ".join(f"{100 * x:.2g}" for x in outliers.counts / share)
            notes = (
                f"{int(outliers.counts.sum())} equations are more than {_FAR:g} standard deviations"
                f" away (per cent by joint: {percent}); result.estimate.details lists them.",
            )
        return Estimate(
            factors.names, self.values, covariance, self.sigma, status, self.count, notes, outliers
        )
