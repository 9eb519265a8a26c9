"""Ordinary, weighted, iteratively re-weighted, ridge and total least squares.

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
from numpy.typing import ArrayLike

from ..._arrays import Array
from ...errors import InvalidValueError
from ...estimation.estimate import Estimate
from ...estimation.factor import TriangularFactors
from ...estimation.linear import (
    first_weights,
    inverse_std,
    ordinary,
    reweighted,
    ridge,
    weighted,
)
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
