"""Recursive least squares in time: convergence and drift of the estimate.

Parameters
----------
system : Equations
    Equations of a log, from `equations`.
factors : TriangularFactors
    Factors of the same equations, for the weights (WLS).

Returns
-------
Estimate
    At the end of the log; ``details`` is the history.

Raises
------
InvalidValueError
    A factor outside its range; fewer equations than parameters.

References
----------
Seed book section 1.6.4; G. Bierman, "Factorization Methods for Discrete Sequential Estimation",
1977, chapter V (square-root information form).

Examples
--------
>>> from robotmodels.datasets import example_log
>>> from robotmodels.identification import Recursive, fit
>>> arm, log = example_log()
>>> result = fit(arm, log, Recursive(forgetting=0.99), drive=("Fv",))
>>> result.estimate.details.values.shape[1] == len(result.names)
True
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, Rebuilt, as_floats, read_only
from ...errors import InvalidValueError
from ...estimation.estimate import Estimate
from ...estimation.factor import TriangularFactors, triangle
from ...estimation.linear import (
    check_count,
    first_weights,
    inverse_triangle,
    residual_std,
)
from ..equations import Equations
from .base import Method

_POINTS = 200
"""Number of points of the history."""
_DETERMINED = 1e-9
"""Least diagonal entry of the scaled factor for a determined parameter."""


@dataclass(frozen=True, slots=True, eq=False)
class RecursiveHistory(Rebuilt):
    """Estimates as the log proceeds; NaN while it does not determine them.

    Shapes: t (h,) s; values, standard_errors (h, b); memory: effective number of instants at the
    end.
    """

    t: Array
    values: Array
    standard_errors: Array
    memory: float

    def __post_init__(self) -> None:
        for name in ("t", "values", "standard_errors"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True, slots=True, eq=False)
class Recursive(Method):
    """Weighted least squares in the order of time, by updates of a triangular factor.

    ``forgetting``: weight of the squares of an instant relative to those of the next, above 0 and
    at most 1, so that the effective number of instants is about ``1 / (1 - forgetting)``.
    """

    forgetting: float = 1.0
    name: ClassVar[str] = "recursive"
    title: ClassVar[str] = "recursive least squares in time"

    def solve(self, system: Equations, factors: TriangularFactors) -> Estimate:
        """Estimate the parameters."""
        forgetting = float(as_floats(self.forgetting, "forgetting"))
        if not 0.0 < forgetting <= 1.0:
            raise InvalidValueError(
                f"forgetting: expected a number above 0 and at most 1, got {self.forgetting!r:.60}."
            )
        check_count(factors)
        state = _State(len(factors.names), forgetting, first_weights(factors))
        points: list[tuple[float, Array, Array]] = []
        stride = max(1, int((factors.counts + factors.left_out).max()) // _POINTS)
        since, last = 0, 0.0
        for block in system.blocks():
            k = 0
            while k < len(block):
                count = min(stride - since, len(block) - k)
                part = slice(k, k + count)
                state.add(block.W[part], block.y[part], block.use[part])
                k += count
                since += count
                last = float(block.t[k - 1])
                if since == stride:
                    points.append((last, *state.solution()))
                    since = 0
        if since:
            points.append((last, *state.solution()))
        values = points[-1][1]
        if np.isnan(values).any():
            raise InvalidValueError(
                f"forgetting: with {forgetting:g} about {state.memory:.3g} instants count at the "
                "end of the log, which do not determine the parameters; use a larger factor."
            )
        notes = (
            f"About {state.memory:.3g} instants of the log count, those at its end most; earlier "
            "ones are forgotten.",
        )
        t, *history = (np.array(x) for x in zip(*points, strict=True))
        return Estimate(
            factors.names,
            values,
            state.covariance(),
            residual_std(factors, values),
            iterations=len(points),
            notes=notes if forgetting < 1.0 else (),
            details=RecursiveHistory(t, history[0], history[1], state.memory),
        )


class _State:
    """Triangular factor of the equations so far, with exponential forgetting."""

    def __init__(self, b: int, forgetting: float, weights: Array) -> None:
        self.R = np.zeros((0, b + 1))
        self.forgetting, self.weights = forgetting, weights
        self.equations = self.memory = 0.0

    def add(self, W: Array, y: Array, use: NDArray[np.bool_]) -> None:
        """Add instants W (k, m, b), y and use (k, m)."""
        k, _, b = W.shape
        age = self.forgetting ** np.arange(k - 1, -1, -1.0)
        rows = np.concatenate((W, y[..., None]), axis=2) * self.weights[:, None]
        rows *= np.sqrt(age)[:, None, None]
        fade = self.forgetting**k
        whole = np.vstack((np.sqrt(fade) * self.R, rows[use]))
        # fewer rows than columns have no solution yet
        self.R = triangle(whole) if len(whole) >= b + 1 else whole
        self.equations = fade * self.equations + float(age @ use.sum(axis=1))
        self.memory = fade * self.memory + float(age.sum())

    def solution(self) -> tuple[Array, Array]:
        """Values and standard errors (b,); NaN where they are not determined."""
        b = self.R.shape[1] - 1
        none = np.full(b, np.nan)
        if len(self.R) < b + 1 or self.equations <= b:
            return none, none
        size = np.linalg.norm(self.R[:, :b], axis=0)
        if not size.all() or (np.abs(np.diag(self.R)[:b]) < _DETERMINED * size).any():
            return none, none
        inverse = inverse_triangle(self.R[:b, :b])
        errors = np.sqrt(self._variance()) * np.linalg.norm(inverse, axis=1)
        return inverse @ self.R[:b, b], errors

    def covariance(self) -> Array:
        """Covariance of the values (b, b)."""
        b = self.R.shape[1] - 1
        inverse = inverse_triangle(self.R[:b, :b])
        return self._variance() * inverse @ inverse.T

    def _variance(self) -> float:
        b = self.R.shape[1] - 1
        return float(self.R[b:, b] @ self.R[b:, b]) / (self.equations - b)
