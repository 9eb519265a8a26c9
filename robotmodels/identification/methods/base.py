"""Interface of the methods of identification, and the choice of essential parameters.

Source: W. Khalil and E. Dombre, "Modeling, Identification and Control of Robots", 2002, section
12.5; C. Presse and M. Gautier, IEEE ICRA 1992.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Literal, Self

import numpy as np

from ..._arrays import Array, as_number
from ...errors import InvalidValueError
from ...estimation.estimate import Estimate, EstimateStatus
from ...estimation.factor import TriangularFactors, triangle
from ...estimation.linear import inverse_std, inverse_triangle
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


RULES = ("ratio", "f_test", "aic")
_RATIO = 30.0  # default ratio of the largest to the smallest relative standard error
_GROWTH = 0.1  # largest relative increase of the residuals
_LEVEL = 0.05  # significance level of the F test


def essential(
    factors: TriangularFactors, estimate: Estimate, choice: bool | float | str = True
) -> tuple[tuple[str, ...], tuple[str, ...], str]:
    """Drop parameters one by one, the largest relative standard error (white residuals) first.

    ``choice``: True, a ratio, or one of `RULES`. Names that are kept and dropped, rule as text.
    """
    rule, ratio = _rule(choice)
    R, y, rest = factors.stacked(inverse_std(factors, estimate.sigma))
    freedom = factors.rows - len(y)
    kept, order, squares = list(range(len(y))), [], []
    while True:
        relative, at, left = _relative_errors(R[:, kept], y, rest, factors.rows)
        squares.append(left)
        met = rule == "ratio" and relative[at] <= ratio * relative.min()
        grown = rule != "aic" and left > _bound(rule, rest, len(order), freedom)
        if len(kept) == 1 or met or grown:
            break
        order.append(kept.pop(at))
    last = len(order)
    if rule == "aic":
        logarithm = np.log(np.maximum(squares, 1e-300) / max(rest, 1e-300))
        last = int(np.argmin(factors.rows * logarithm - 2.0 * np.arange(last + 1)))
    elif last and squares[-1] > _bound(rule, rest, last, freedom):
        last -= 1  # undo the last drop
    dropped = order[:last]
    names = tuple(name for k, name in enumerate(factors.names) if k not in dropped)
    text = rule if isinstance(choice, bool | str) else f"{rule} {ratio:g}"
    return names, tuple(factors.names[k] for k in dropped), text


def _rule(choice: bool | float | str) -> tuple[str, float]:
    if isinstance(choice, str):
        if choice.lower() not in RULES:
            raise InvalidValueError(
                f"essential: expected True, a ratio or one of {', '.join(RULES)}, got {choice!r}."
            )
        return choice.lower(), _RATIO
    return "ratio", _RATIO if choice is True else as_number(choice, "essential", least=1.0)


def _relative_errors(R: Array, y: Array, rest: float, rows: int) -> tuple[Array, int, float]:
    """Relative standard errors (b,), the index of the largest, and the sum of squares."""
    b = R.shape[1]
    T = triangle(np.column_stack((R, y)))
    inverse = inverse_triangle(T[:b, :b])
    squares = rest + float(T[b:, b] @ T[b:, b])
    errors = np.linalg.norm(inverse, axis=1) * np.sqrt(max(squares, 1e-300) / (rows - b))
    relative = errors / np.maximum(np.abs(inverse @ T[:b, b]), 1e-300)
    return relative, int(np.argmax(relative)), squares


def _bound(rule: str, rest: float, dropped: int, freedom: int) -> float:
    """Largest admissible sum of squares after this number of drops."""
    if not dropped:
        return np.inf
    if rule == "ratio":
        return rest * (1.0 + _GROWTH) ** 2
    from scipy.stats import f

    return rest * (1.0 + dropped / freedom * float(f.ppf(1.0 - _LEVEL, dropped, freedom)))
