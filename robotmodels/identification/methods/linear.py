"""Ordinary, weighted, iteratively re-weighted, ridge, total and robust least squares.

Each is an object with its options; `fit` accepts it, or its name, as ``method``.

Parameters
----------
essential : bool, float or str
    Drop insignificant parameters: True, a ratio of relative standard errors, or a rule.

References
----------
Book section 1.6.2.1; M. Gautier and P. Poignet, Control Engineering Practice 9, 2001
(weighted); A. Janot, M. Gautier, A. Jubien and P.-O. Vandanjon, IEEE T-CST 22(5), 2014
(re-weighted); G. Golub, M. Heath and G. Wahba, Technometrics 21(2), 1979 (ridge); M. Gautier, P.-O.
Vandanjon and C. Presse, IEEE CDC 1994 (total).

Examples
--------
>>> from robotmodels.datasets import example_log
>>> from robotmodels.identification import Wls, choose_processing, equations, reduce_equations
>>> from robotmodels.minimal_parameters import base_parameters
>>> arm, log = example_log()
>>> base = base_parameters(arm, drive=("Fv",))
>>> system = equations(base, log, choose_processing(log))
>>> estimate = Wls().solve(system, reduce_equations(system))
>>> round(float(estimate.values[estimate.names.index("Fv2")]), 3)
2.0
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, Frozen
from ..._choices import chosen
from ...errors import InvalidValueError
from ...estimation.estimate import Estimate, EstimateStatus
from ...estimation.factor import TriangularFactors, triangle
from ...estimation.linear import (
    check_count,
    first_weights,
    inverse_std,
    inverse_triangle,
    ordinary,
    reweighted,
    ridge,
    solved,
    value_sizes,
    weighted,
)
from ...estimation.losses import Loss, loss_terms, tuning
from ...estimation.total import total
from ...model import RobotModel
from ..equations import Equations, segments
from .base import Covariance, Method

_FOLDS = 5
_EXACT = ("Fc", "offset")
"""Prefixes of columns without noise outside the dead bands (signs and ones)."""


@dataclass(frozen=True, slots=True, eq=False)
class Ols(Method):
    """Ordinary least squares: all equations have the same weight."""

    name: ClassVar[str] = "ols"
    title: ClassVar[str] = "ordinary least squares"
    covariance: ClassVar[Covariance] = "correlated"

    def solve(self, system: Equations, factors: TriangularFactors) -> Estimate:
        """Estimate the parameters."""
        return ordinary(factors)


@dataclass(frozen=True, slots=True, eq=False)
class Wls(Method):
    """Weighted least squares: weights from the residual standard deviation of each joint.

    ``shrinkage``: shrink parameters towards zero by a weak prior whose scale is estimated from the
    log (empirical Bayes). By default (None) where standard errors exceed 15 % of plausible sizes or
    there are fewer than 20 equations for each parameter; a note reports it.
    """

    shrinkage: bool | None = None
    name: ClassVar[str] = "wls"
    title: ClassVar[str] = "weighted least squares"
    covariance: ClassVar[Covariance] = "correlated"

    def __post_init__(self) -> None:
        if self.shrinkage not in (None, True, False):
            raise InvalidValueError(
                f"shrinkage: expected True, False or None, got {self.shrinkage!r:.60}."
            )

    def solve(self, system: Equations, factors: TriangularFactors) -> Estimate:
        """Estimate the parameters."""
        return weighted(factors)


@dataclass(frozen=True, slots=True, eq=False)
class Irls(Wls):
    """Weighted least squares, iterated until the weights agree with the residuals."""

    name: ClassVar[str] = "irls"
    title: ClassVar[str] = "iteratively re-weighted least squares"

    def solve(self, system: Equations, factors: TriangularFactors) -> Estimate:
        """Estimate the parameters."""
        return reweighted(factors)


@dataclass(frozen=True, slots=True, eq=False)
class Ridge(Method):
    """Weighted least squares with a Gaussian prior.

    ``prior``: a robot or values (b,), default 0. ``prior_errors``: their standard errors (b,);
    without them every parameter is shrunk in proportion to its effect. ``strength``: factor on the
    squares of the prior; default 1 where errors are given, else by cross-validation over segments
    of the log.
    """

    prior: RobotModel | ArrayLike | None = None
    prior_errors: ArrayLike | None = None
    strength: float | None = None
    name: ClassVar[str] = "ridge"
    title: ClassVar[str] = "least squares with a prior (ridge)"
    by_parameter: ClassVar[tuple[str, ...]] = ("prior", "prior_errors")

    def solve(self, system: Equations, factors: TriangularFactors) -> Estimate:
        """Estimate the parameters."""
        prior = self.prior
        if isinstance(prior, RobotModel):
            values = dict(zip(system.base.names, system.base.values(prior).tolist(), strict=True))
            prior = [values[name] for name in system.names]
        chosen = self.strength is None and self.prior_errors is None
        folds = segments(system, _FOLDS) if chosen else ()
        return ridge(factors, prior, self.prior_errors, self.strength, folds)


@dataclass(frozen=True, slots=True, eq=False)
class Total(Method):
    """Total least squares: noise in the regressor as well as in the torques.

    ``noise``: standard deviation of every column's noise relative to its root mean square, those of
    dry friction and offsets being exact; or those of each column and, last, of the torque (b + 1,)
    in SI units, 0 for exact ones.
    """

    noise: ArrayLike = 0.001
    name: ClassVar[str] = "tls"
    title: ClassVar[str] = "total least squares"
    by_parameter: ClassVar[tuple[str, ...]] = ("noise",)

    def solve(self, system: Equations, factors: TriangularFactors) -> Estimate:
        """Estimate the parameters."""
        return total(factors, self.noise, [name.startswith(_EXACT) for name in factors.names])


def used_weights(method: Method, factors: TriangularFactors) -> Array:
    """Weights of the groups (m,) in the last step of a method; of WLS for nonlinear ones."""
    if isinstance(method, Ols):
        return np.ones(len(factors.factors))
    if isinstance(method, Irls):
        return inverse_std(factors, reweighted(factors).sigma)
    return first_weights(factors)


_MOST = 100
_STILL, _STEADY = 1e-4, 1e-3
"""Convergence tolerances: change of a parameter in standard errors, relative change of a scale."""
_SCALES = 20  # largest number of passes that change the residual scales: medians may alternate
_ROUNDING = 1e-12  # rounding tolerance: change of a parameter relative to its torque size
_FAR = 4.0
"""Least residual of an outlier, in standard deviations (probability 6e-5 for normal noise)."""
_LISTED = 1000
_NORMAL_MEDIAN = 0.6744897501960817  # median length of standard normal residuals
_ONE = np.ones(1, dtype=np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Outliers(Frozen):
    """Outlying equations (residuals above four standard deviations): counts by group, the largest.

    Shapes: counts (m,); t (k,) s, group (k,), size (k,) in standard deviations, by time.
    """

    counts: NDArray[np.int64]
    t: Array
    group: NDArray[np.int64]
    size: Array


@dataclass(frozen=True, slots=True, eq=False)
class Robust(Method):
    """Robust least squares; weighted least squares is the start.

    ``sigma`` of the estimate are residual standard deviations from medians, the covariance takes
    variances that differ between equations into account, ``details`` has the outliers.

    Parameters
    ----------
    loss : Loss or str
        "huber", "cauchy" or "tukey" (or "squares").

    References
    ----------
    P. J. Huber and E. M. Ronchetti, "Robust Statistics", 2nd ed., 2009, sections 7.6 to 7.8;
    V. Yohai, Annals of Statistics 15(2), 1987 (fixed scale for redescending losses).
    """

    loss: Loss | str = Loss.HUBER
    name: ClassVar[str] = "robust"
    title: ClassVar[str] = "robust least squares"

    def __post_init__(self) -> None:
        chosen(Loss, self.loss, "loss")

    def solve(self, system: Equations, factors: TriangularFactors) -> Estimate:
        """Estimate the parameters by iteratively re-weighted least squares over the equations."""
        loss = chosen(Loss, self.loss, "loss")
        check_count(factors)
        state = _Iteration(system, factors)
        first = Loss.SQUARES if loss is Loss.SQUARES else Loss.HUBER
        status = state.run(first, fixed=False)
        if loss is not first:
            # redescending losses start at Huber's solution, with its scales
            status = state.run(loss, fixed=True)
        return state.estimate(loss, status)


class _Iteration:
    """State of the iteration: values and residual scales of the groups."""

    def __init__(self, system: Equations, factors: TriangularFactors) -> None:
        self.system = system if system.cache is not None else system.cached()
        self.factors, self.values, self.count = factors, weighted(factors).values, 0
        self.sigma = self.scales(self.residuals())

    def residuals(self) -> list[Array]:
        """Residuals of every block, NaN where an equation is not used."""
        blocks = self.system.blocks()
        return [np.where(b.use, b.y - b.W @ self.values, np.nan) for b in blocks]

    def scales(self, residuals: list[Array]) -> Array:
        """Standard deviations of the groups (m,) from medians, at least rounding."""
        sizes = np.abs(np.concatenate(residuals)).T
        medians = [np.median(e[~np.isnan(e)]) if (e >= 0.0).any() else 0.0 for e in sizes]
        freedom = np.sqrt(1.0 - len(self.values) / self.factors.rows)
        return 1.0 / inverse_std(self.factors, np.array(medians) / (_NORMAL_MEDIAN * freedom))

    def run(self, loss: Loss, fixed: bool) -> EstimateStatus:
        """Iterate until the values converge, with fixed or updated residual scales."""
        least = 1.0 / inverse_std(self.factors, np.zeros(len(self.sigma))).max()
        rounding = _ROUNDING * value_sizes(self.factors)
        for count in range(1, _MOST + 1):
            self.count += 1
            residuals = self.residuals()
            R, y = self._weighted_triangle(loss, residuals)
            inverse = inverse_triangle(R)
            moved = inverse @ y - self.values
            self.values = self.values + moved
            still = np.abs(moved) <= _STILL * np.linalg.norm(inverse, axis=1) + rounding
            last = self.sigma
            if not fixed and count <= _SCALES:
                self.sigma = self.scales(residuals)
            steady = np.abs(self.sigma - last) <= _STEADY * last + 10.0 * least
            if still.all() and steady.all():
                return EstimateStatus.SOLVED
        return EstimateStatus.NOT_CONVERGED

    def _weighted_triangle(self, loss: Loss, residuals: list[Array]) -> tuple[Array, Array]:
        b, c = len(self.values), tuning(loss, _ONE)
        R = np.zeros((0, b + 1))
        for block, e in zip(self.system.blocks(), residuals, strict=True):
            weights = np.sqrt(loss_terms(loss, np.abs(e) / self.sigma, c)[1]) / self.sigma
            rows = np.column_stack((block.W[block.use], block.y[block.use]))
            R = triangle(np.vstack((R, rows * weights[block.use][:, None])))
        return R[:b, :b], R[:b, b]

    def estimate(self, loss: Loss, status: EstimateStatus) -> Estimate:
        """The estimate with its covariance and outliers."""
        factors, c, b = self.factors, tuning(loss, _ONE), len(self.values)
        weights = 1.0 / self.sigma
        slopes, scores = np.zeros(len(weights)), np.zeros((b, b))
        far = []
        for block in self.system.blocks():
            u = np.where(block.use, (block.y - block.W @ self.values) * weights, 0.0)
            _, w, slope = loss_terms(loss, np.abs(u), c)
            slopes += np.where(block.use, slope, 0.0).sum(axis=0)
            rows = ((w * u * weights)[..., None] * block.W).reshape(-1, b)
            scores += rows.T @ rows
            i, j = np.nonzero(np.abs(u) > _FAR)
            far.append(np.column_stack((block.t[i], j, u[i, j])))
        t, group, size = np.concatenate(far).T
        counts = np.bincount(group.astype(np.int64), minlength=len(weights))
        share = np.maximum(factors.counts, 1)
        _, inverse, _ = solved(factors, np.sqrt(np.maximum(slopes / share, 1e-3)) * weights)
        covariance = factors.rows / (factors.rows - b) * inverse @ scores @ inverse
        at = np.sort(np.argsort(-np.abs(size), kind="stable")[:_LISTED])
        outliers = Outliers(counts, t[at], group[at].astype(np.int64), size[at])
        notes: tuple[str, ...] = ()
        if counts.any():
            percent = " ".join(f"{100 * x:.2g}" for x in counts / share)
            notes = (
                f"{int(counts.sum())} equations are more than {_FAR:g} standard deviations"
                f" away (per cent by joint: {percent}); result.estimate.details lists them.",
            )
        return Estimate(
            factors.names, self.values, covariance, self.sigma, status, self.count, notes, outliers
        )
