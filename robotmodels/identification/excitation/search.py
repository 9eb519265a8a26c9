"""The search from one start: smooth problems one after the other, each nearer to the real one."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._arrays import Array
from .problem import ExcitationProblem, Stage
from .result import ExcitationStatus
from .starts import within_limits

STAGES = (Stage(2.0, 30.0), Stage(6.0, 300.0), Stage(20.0, 3e3), Stage(60.0, 1e4))
"""From a sum over all singular values towards the largest and the smallest one."""

BUDGET = 3e10
"""Multiplications of a search by default: about ten seconds of a processor of 2020."""
STARTS, RANDOM, ITERATIONS = 8, 100, 200
"""Starts, random motions and iterations of a stage, at most, by default."""
_FEWEST = 250  # evaluations that a start is worth making for


if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

_WINDOW, _LITTLE = 25, 0.01  # iterations, and what the criterion falls by in them at an end


def shared_budget(problem: ExcitationProblem) -> tuple[int, int, int]:
    """Starts, evaluations of each, and random motions that the default budget has for a problem.

    The cost of an evaluation is a count of multiplications, so that the same search is made on
    every machine and however busy it is.
    """
    evaluations = max(1, int(BUDGET / problem.work))
    starts = min(STARTS, max(1, evaluations // _FEWEST))
    # a random motion is judged on a finer grid; they take a quarter of the budget at most
    drawn = min(RANDOM, max(STARTS, evaluations // 24))
    return starts, evaluations // starts, drawn


def gain_of_twice(values: Array) -> float:
    """How much lower the least of twice as many values is expected to be.

    By the mean of the least of k normal values, of which these have the spread.
    """
    from scipy.special import ndtri

    k = len(values)
    if k < 2:
        return 0.0
    least, least_of_twice = ndtri((np.array([k, 2 * k]) - 0.375) / (np.array([k, 2 * k]) + 0.25))
    return float(np.std(values, ddof=1) * (least_of_twice - least))


def improved(
    problem: ExcitationProblem,
    X: Array,
    iterations: int,
    evaluations: int | None,
    stage_done: Callable[[int], None],
) -> tuple[Array, Array, Array, ExcitationStatus]:
    """Minimise the criterion from one start.

    Shapes: X (P, n) -> coefficients (P, n), history (K,), stages (S,).
    """
    from scipy.optimize import minimize

    x = (X / problem.units).ravel()
    history: list[float] = []
    counts, used, ended = [], 0, False
    for k, stage in enumerate(STAGES):
        most = np.inf
        if evaluations is not None:
            most = (evaluations - used) // (len(STAGES) - k)
        follow = _StageCallback(history, most)
        found = minimize(
            follow.counted(problem.value), x, args=(stage,), jac=True, method="BFGS",
            callback=follow, options={"maxiter": iterations, "gtol": 1e-4},
        )  # fmt: skip
        x, used = found.x, used + follow.evaluations
        ended = follow.ended or int(found.status) == 1  # SciPy's number for the last iteration
        counts.append(int(found.nit))
        stage_done(k + 1)
    best = problem.coefficients(x)
    feasible = within_limits(problem, best)
    if feasible is None:
        status, feasible = ExcitationStatus.INFEASIBLE, best
    elif ended:
        status = ExcitationStatus.LIMIT_OF_ITERATIONS
    else:
        status = ExcitationStatus.CONVERGED
    return feasible, np.array(history), np.array(counts), status


class _StageCallback:
    """SciPy callback: ends a stage when progress is below 1 % or the evaluations are used up."""

    def __init__(self, history: list[float], most: float) -> None:
        self.history, self.first, self.most = history, len(history), most
        self.evaluations, self.ended = 0, False

    def counted(self, value: Callable[..., tuple[float, Array]]) -> Callable[..., Any]:
        """The function that is made small, which counts its evaluations."""

        def counting(x: Array, stage: Stage) -> tuple[float, Array]:
            self.evaluations += 1
            return value(x, stage)

        return counting

    def __call__(self, intermediate_result: OptimizeResult) -> None:
        history = self.history
        history.append(float(intermediate_result.fun))
        long = len(history) - self.first > _WINDOW
        if long and history[-1 - _WINDOW] - history[-1] < _LITTLE:
            raise StopIteration
        if self.evaluations >= self.most:
            self.ended = True
            raise StopIteration
