"""Interface of the methods of identification."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Literal, Self

import numpy as np

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
    by_parameter: ClassVar[tuple[str, ...]] = ()  # options that may be arrays in this order

    @abstractmethod
    def solve(self, system: Equations, factors: TriangularFactors) -> Estimate:
        """Estimate the parameters of equations, given with their triangular factors."""

    def options(self) -> dict[str, Any]:
        """Options that differ from their defaults."""
        given = ((field.name, getattr(self, field.name), field.default) for field in fields(self))
        return {name: value for name, value, default in given if not np.array_equal(value, default)}  # type: ignore[reportArgumentType]

    def without(self, dropped: Sequence[int]) -> Self:
        """The method for the other parameters; ``dropped`` are numbers from 0."""
        arrays = ((name, getattr(self, name)) for name in self.by_parameter)
        return replace(self, **{name: np.delete(x, dropped) for name, x in arrays if np.ndim(x)})


def check_solved(estimate: Estimate) -> None:
    """Raise for an estimate without parameters, whose simulation diverged."""
    if estimate.status is EstimateStatus.UNSTABLE:
        raise InvalidValueError(f"result: {estimate.status.sentence}")
