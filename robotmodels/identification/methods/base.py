"""Interface of the methods of identification."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Literal

from ...errors import InvalidValueError
from ...estimation.estimate import Estimate, EstimateStatus
from ...estimation.factor import TriangularFactors
from ..equations import Equations

Covariance = Literal["correlated", "scaled", "given"]
"""Standard errors: computed for correlated residuals, scaled by the ratio of WLS, or given."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Method(ABC):
    """Base of the methods; ``essential`` drops insignificant parameters.

    True is the default ratio of relative standard errors (30); or another ratio, or a rule:
    "ratio", "f_test", "aic".
    """

    essential: bool | float | str = False
    name: ClassVar[str] = ""
    title: ClassVar[str] = ""
    covariance: ClassVar[Covariance] = "scaled"

    @abstractmethod
    def solve(self, system: Equations, factors: TriangularFactors) -> Estimate:
        """Estimate the parameters of equations, given with their triangular factors."""

    def options(self) -> dict[str, Any]:
        """Options that differ from their defaults."""
        given = ((field.name, getattr(self, field.name), field.default) for field in fields(self))
        return {name: value for name, value, default in given if value is not default}


def check_solved(estimate: Estimate) -> None:
    """Raise for an estimate without parameters, whose simulation diverged."""
    if estimate.status is EstimateStatus.UNSTABLE:
        raise InvalidValueError(f"result: {estimate.status.sentence}")
