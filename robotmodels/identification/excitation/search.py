"""The search from one start: smooth problems one after the other, each nearer to the real one."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..._arrays import Array
from .problem import ExcitationProblem, Stage
from .result import ExcitationStatus
from .starts import within_limits

STAGES = (Stage(2.0, 30.0), Stage(6.0, 300.0), Stage(20.0, 3e3), Stage(60.0, 1e4))
"""From a sum over all singular values towards the largest and the smallest one."""


if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

_WINDOW, _LITTLE = 25, 0.01  # iterations, and what the criterion falls by in them at an end


def improved(
    problem: ExcitationProblem,
    X: Array,
    iterations: int,
    stage_done: Callable[[int], None],
) -> tuple[Array, Array, Array, ExcitationStatus]:
    """Coefficients with a smaller criterion, from one start.

    Quasi-Newton steps (SciPy's BFGS) on the criterion with squares of what lies beyond the limits
    less a margin; at last the motion is shrunk, if that is needed to keep them.

    Parameters
    ----------
    problem : ExcitationProblem
        What is to be made small.
    X : ndarray, shape (P, n)
        Coefficients of the start.
    iterations : int
        Most of each stage.
    stage_done : callable
        Of the number of stages that are done.

    Returns
    -------
    coefficients : ndarray, shape (P, n)
        Of the end.
    history : ndarray, shape (K,)
        Smooth criterion at the iterations.
    stages : ndarray, shape (S,)
        Iterations of each stage.
    status : ExcitationStatus
        How it ended.
    """
    from scipy.optimize import minimize

    x = (X / problem.units).ravel()
    history: list[float] = []
    counts, last = [], 0
    for k, stage in enumerate(STAGES):
        found = minimize(
            problem.value, x, args=(stage,), jac=True, method="BFGS", callback=_follow(history),
            options={"maxiter": iterations, "gtol": 1e-4},
        )  # fmt: skip
        x, last = found.x, int(found.status)
        counts.append(int(found.nit))
        stage_done(k + 1)
    best = problem.coefficients(x)
    feasible = within_limits(problem, best)
    if feasible is None:
        status, feasible = ExcitationStatus.INFEASIBLE, best
    elif last == 1:  # SciPy's number for the limit of iterations
        status = ExcitationStatus.LIMIT_OF_ITERATIONS
    else:
        status = ExcitationStatus.CONVERGED
    return feasible, np.array(history), np.array(counts), status


def _follow(history: list[float]) -> Callable[[OptimizeResult], None]:
    """What SciPy calls after each iteration of a stage; the stage ends where it gains little."""
    first = len(history)

    def kept(intermediate_result: OptimizeResult) -> None:
        history.append(float(intermediate_result.fun))
        long = len(history) - first > _WINDOW
        if long and history[-1 - _WINDOW] - history[-1] < _LITTLE:
            raise StopIteration

    return kept
