"""Search: random motions within the limits, improved in stages, and their quality."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from typing import Any

import numpy as np

from ..._arrays import Array
from ...dynamics.inverse import motion_torques
from ...model import RobotModel
from ...trajectories import Trajectory
from .objective import ExcitationProblem, MotionRegressor, triangular_factor
from .result import ExcitationLimits, ExcitationQuality, ExcitationStatus

STAGES = ((2.0, 30.0), (6.0, 300.0), (20.0, 3e3), (60.0, 1e4))
"""Power of the singular values in the smooth condition number, and weight of the penalties."""
BUDGET = 3e10
"""Multiplications of a search: about ten seconds of a processor of 2020."""
STARTS, RANDOM, ITERATIONS = 8, 100, 200
"""Largest default numbers of starts, random motions, and iterations of a stage."""
_FEWEST = 250  # least number of evaluations of a start
_WINDOW, _DECREASE = 25, 0.01  # convergence: decrease below 1 % over 25 iterations
_DENSE = 8  # samples for the limits, times those of the search
_POSTURES = 400, 300
"""Numbers of random postures, from which a feasible mean is chosen: all, far from the middle."""
_FACTORS = (1.0, 0.9998, 0.9995, 0.999, 0.998, 0.995, 0.99, 0.98, 0.95, 0.9, 0.8, 0.65, 0.5, 0.35)
_FACTORS += (0.2, 0.1, 0.05)
"""Factors that reduce a motion about its mean."""


def shared_budget(problem: ExcitationProblem) -> tuple[int, int, int]:
    """Default starts, evaluations of each, and random motions within the budget."""
    evaluations = max(1, int(BUDGET / problem.work))
    starts = min(STARTS, max(1, evaluations // _FEWEST))
    # random motions use a finer grid, and at most a quarter of the budget
    drawn = min(RANDOM, max(STARTS, evaluations // 24))
    return starts, evaluations // starts, drawn


def improved(
    problem: ExcitationProblem,
    X: Array,
    iterations: int,
    evaluations: float,
    stage_done: Callable[[int], None],
) -> tuple[Array, Array, Array, ExcitationStatus]:
    """Minimise the criterion from one start, stage by stage, by BFGS.

    Shapes: X (P, n) -> coefficients (P, n), history (K,), iterations of the stages (S,).
    """
    from scipy.optimize import minimize

    x, used, allowed, cut = (X / problem.units).ravel(), 0, 0.0, False
    stages: list[list[float]] = []

    def value(x: Array, power: float, penalty: float) -> tuple[float, Array]:
        nonlocal used
        used += 1
        return problem.value(x, power, penalty)

    def callback(intermediate_result: Any) -> None:  # name required by SciPy
        history = stages[-1]
        history.append(float(intermediate_result.fun))
        converged = len(history) > _WINDOW and history[-1 - _WINDOW] - history[-1] < _DECREASE
        if converged or used >= allowed:
            raise StopIteration

    options: dict[str, Any] = {"maxiter": iterations, "gtol": 1e-4}
    for k, stage in enumerate(STAGES):
        allowed = used + (evaluations - used) // (len(STAGES) - k)
        stages.append([])
        solution = minimize(value, x, stage, "BFGS", jac=True, callback=callback, options=options)
        x, cut = solution.x, used >= allowed or solution.status == 1  # 1: the last iteration
        stage_done(k + 1)
    best = problem.coefficients(x)
    feasible = within_limits(problem, best)
    status = ExcitationStatus.LIMIT_OF_ITERATIONS if cut else ExcitationStatus.CONVERGED
    if feasible is None:
        status, feasible = ExcitationStatus.INFEASIBLE, best
    return feasible, np.concatenate(stages), np.array([*map(len, stages)]), status


def random_motion(problem: ExcitationProblem, rng: np.random.Generator) -> Array:
    """Random motion (P, n), each joint scaled to its limits."""
    middle = _middle(problem, rng)
    X = problem.units * rng.standard_normal(problem.units.shape)
    X -= problem.basis.constant(_means(problem, X))
    reach = np.full(problem.model.n, np.inf)
    for order, B in enumerate(problem.functions):
        (low, high, _), y, offset = problem.bounds[order], B @ X, 0.0 if order else middle
        with np.errstate(divide="ignore"):
            most = np.where(y.max(axis=0) > 0.0, (high - offset) / y.max(axis=0), np.inf)
            least = np.where(y.min(axis=0) < 0.0, (low - offset) / y.min(axis=0), np.inf)
        reach = np.minimum(reach, np.minimum(most, least))
    X = X * reach + problem.basis.constant(middle)
    shrunk = within_limits(problem, X)
    return X if shrunk is None else shrunk


def within_limits(problem: ExcitationProblem, X: Array) -> Array | None:
    """Motion (P, n) scaled about its mean to keep the limits, by bisection of the factors."""
    still = problem.basis.constant(_means(problem, X))

    def kept(factor: float) -> bool:
        trajectory = problem.basis.trajectory(still + factor * (X - still))
        return limits_kept(problem, trajectory).kept

    k = 0 if kept(_FACTORS[0]) else bisect_left(_FACTORS, True, 1, key=kept)
    return still + _FACTORS[k] * (X - still) if k < len(_FACTORS) else None


def limits_kept(problem: ExcitationProblem, trajectory: Trajectory) -> ExcitationLimits:
    """Extremes of a motion, and all limits of a problem.

    Between samples a torque, which is smooth but for dry friction, may exceed them by an eighth of
    its second difference, and a distance, which has kinks, by a half.
    """
    model = problem.model
    times = np.linspace(0.0, problem.basis.duration, _DENSE * len(problem.t) + 1)
    q, v, a = trajectory.motion.derivatives(times, (0, 1, 2))
    torque = np.abs(motion_torques(model, q, v, a))
    peaks = (torque + _between(torque, 0.125)).max(axis=0)
    if (beside := _beside_jumps(model, times, v)).size:
        qb, vb, ab = trajectory.motion.derivatives(beside, (0, 1, 2))
        peaks = np.maximum(peaks, np.abs(motion_torques(model, qb, vb, ab)).max(axis=0))
    clearance = np.inf
    if problem.distances is not None:
        distance, _ = problem.distances(q)
        clearance = float((distance - _between(distance, 0.5)).min())
    report = trajectory.check(problem.limits)
    return ExcitationLimits(report, problem.torque_limits, peaks, clearance)


def quality(problem: ExcitationProblem, trajectory: Trajectory, times: Array) -> ExcitationQuality:
    """Quality of a motion at times (N,)."""
    q, v, a = trajectory.motion.derivatives(times, (0, 1, 2))
    base, b = problem.base, len(problem.base)
    W = MotionRegressor(problem.model, base.names, base.drive).matrix(q, v, a)
    plain = triangular_factor(W.reshape(-1, b))
    alike = (problem.weight == 1.0).all()
    weighted = plain if alike else triangular_factor((W * problem.weight).reshape(-1, b))
    lengths = np.linalg.norm(plain, axis=0)
    scaled = plain / np.where(lengths > 0.0, lengths, 1.0)
    conditions = [float(np.linalg.cond(R)) for R in (plain, scaled, weighted)]
    with np.errstate(divide="ignore"):
        s = np.linalg.svd(weighted, compute_uv=False) / np.sqrt(len(times))
        return ExcitationQuality(*conditions, log_det=float(2.0 * np.log(s).sum()))


def _between(y: Array, part: float) -> Array:
    """A part of the second differences of samples (N, m)."""
    return np.pad(part * np.abs(np.diff(y, 2, axis=0)), ((1, 1), (0, 0)), "edge")


def _beside_jumps(model: RobotModel, times: Array, v: Array) -> Array:
    """Times just before and after a joint or a coupled motor reverses."""
    turning = v
    if model.transmission is not None:
        rows = model.transmission.weights[[m - 1 for m in model.transmission.coupled_motors]]
        turning = np.hstack((v, v @ rows.T))
    before, which = np.nonzero(turning[:-1] * turning[1:] < 0.0)
    first, second = turning[before, which], turning[before + 1, which]
    step = times[1] - times[0]
    at = times[before] + step * first / (first - second)  # zero of the linear interpolation
    return np.clip(np.concatenate((at - 0.02 * step, at + 0.02 * step)), times[0], times[-1])


def _means(problem: ExcitationProblem, X: Array) -> Array:
    """Mean posture of a motion."""
    return (problem.functions[0] @ X).mean(axis=0)


def _middle(problem: ExcitationProblem, rng: np.random.Generator) -> Array:
    """Feasible posture, if there is one, that is drawn near the middle of the ranges first."""
    low, high, half = problem.bounds[0]
    near, far = (rng.uniform(-1.0, 1.0, (count, half.size)) for count in _POSTURES)
    drawn = 0.5 * (low + high) + half * np.concatenate((0.3 * near[: -len(far)], 0.95 * far))
    excess = np.zeros(len(drawn))
    if problem.values.any():
        still = np.zeros(drawn.shape)
        torque = np.abs(motion_torques(problem.model, drawn, still, still, drive=False))
        excess += np.maximum(torque / problem.torque_limits - 0.8, 0.0).sum(axis=1)
    if problem.distances is not None:
        excess += np.maximum(0.02 - problem.distances(drawn)[0], 0.0).sum(axis=1)
    return drawn[int(excess.argmin())]
