"""Recursive least squares in time: convergence and drift of the estimate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..._arrays import Array, Frozen, as_number
from ...errors import InvalidValueError
from ...estimation.estimate import Estimate
from ...estimation.factor import TriangularFactors, triangle
from ...estimation.linear import check_count, first_weights, inverse_triangle, residual_std
from ..equations import Equations
from .base import Method

_POINTS = 200  # number of points of the history
_DETERMINED = 1e-9  # least diagonal entry of the scaled factor for a determined parameter


@dataclass(frozen=True, slots=True, eq=False)
class RecursiveHistory(Frozen):
    """Estimates as the log proceeds (NaN while not determined), effective number of instants.

    Shapes: t (h,) s; values, standard_errors (h, b).
    """

    t: Array
    values: Array
    standard_errors: Array
    memory: float

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True, slots=True, eq=False)
class Recursive(Method):
    """Weighted least squares in the order of time, by updates of a triangular factor.

    The estimate is that at the end of the log; ``details`` is the history.

    Parameters
    ----------
    forgetting : float
        Weight of the squares of an instant relative to those of the next, above 0 and at most 1;
        the effective number of instants is about ``1 / (1 - forgetting)``.

    References
    ----------
    Book section 1.6.4; G. Bierman, "Factorization Methods for Discrete Sequential Estimation",
    1977, chapter V (square-root information form).
    """

    forgetting: float = 1.0
    name: ClassVar[str] = "recursive"
    title: ClassVar[str] = "recursive least squares in time"

    def solve(self, system: Equations, factors: TriangularFactors) -> Estimate:
        """Estimate the parameters."""
        forgetting = as_number(self.forgetting, "forgetting", above=0.0)
        if forgetting > 1.0:
            raise InvalidValueError(f"forgetting: expected at most 1, got {forgetting:g}.")
        check_count(factors)
        b, weights = len(factors.names), first_weights(factors)
        stride = max(1, int((factors.counts + factors.left_out).max()) // _POINTS)
        R, equations, memory, count, t = np.zeros((0, b + 1)), 0.0, 0.0, 0, 0.0
        points: list[tuple[float, Array, Array]] = []
        for block in system.blocks():
            if not len(block):  # a recording hardly longer than its edges
                continue
            cuts = np.arange(stride - count % stride, len(block), stride)
            for part in np.split(np.arange(len(block)), cuts):
                age = forgetting ** np.arange(len(part) - 1, -1, -1.0)
                fade, use = forgetting ** len(part), block.use[part]
                new = np.concatenate((block.W[part], block.y[part, :, None]), axis=2)
                new *= weights[:, None] * np.sqrt(age)[:, None, None]
                R = np.vstack((np.sqrt(fade) * R, new[use]))
                R = triangle(R) if len(R) > b else R  # fewer rows have no solution yet
                equations = fade * equations + float(age @ use.sum(axis=1))
                memory = fade * memory + float(age.sum())
                count, t = count + len(part), float(block.t[part[-1]])
                if count % stride == 0:
                    points.append((t, *_solution(R, equations)))
        if count % stride:
            points.append((t, *_solution(R, equations)))
        values, covariance = points[-1][1:]
        if np.isnan(values).any():
            raise InvalidValueError(
                f"forgetting: with {forgetting:g} about {memory:.3g} instants count at the "
                "end of the log, which do not determine the parameters; use a larger factor."
            )
        notes = (
            f"About {memory:.3g} instants of the log count, those at its end most; earlier "
            "ones are forgotten.",
        )
        times, history, covariances = (np.array(x) for x in zip(*points, strict=True))
        errors = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
        return Estimate(
            factors.names,
            values,
            covariance,
            residual_std(factors, values),
            iterations=len(points),
            notes=notes if forgetting < 1.0 else (),
            details=RecursiveHistory(times, history, errors, memory),
        )


def _solution(R: Array, equations: float) -> tuple[Array, Array]:
    """Values (b,) and covariance (b, b) of the equations so far; NaN if not determined."""
    b = R.shape[1] - 1
    size = np.linalg.norm(R[:, :b], axis=0)
    if len(R) <= b or equations <= b or (np.abs(np.diag(R)[:b]) <= _DETERMINED * size).any():
        return np.full(b, np.nan), np.full((b, b), np.nan)
    inverse = inverse_triangle(R[:b, :b])
    return inverse @ R[:b, b], float(R[b, b] ** 2) / (equations - b) * inverse @ inverse.T
