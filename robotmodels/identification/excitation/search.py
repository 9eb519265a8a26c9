"""Search: random motions within the limits, improved in stages, and their quality."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..._arrays import Array
from ...dynamics import idm
from ...model import RobotModel
from ...trajectories import Trajectory
from .limits import box_distances
from .objective import ExcitationProblem, MotionRegressor, triangular_factor
from .result import ExcitationLimits, ExcitationQuality, ExcitationStatus

# stages: power of the singular values in the smooth condition number, weight of the penalties
STAGES = ((2.0, 30.0), (6.0, 300.0), (20.0, 3e3), (60.0, 1e4))
BUDGET = 3e10  # multiplications of a search: about ten seconds of a processor of 2020
STARTS, RANDOM, ITERATIONS = 8, 100, 200  # largest defaults
_FEWEST = 250  # least number of evaluations of a start
_WINDOW, _LITTLE = 25, 0.01  # convergence: decrease below 1 % over 25 iterations
_DENSE = 8  # samples for the limits, times those of the search
_POSTURES = 400, 300  # numbers of drawn postures near the middle of the ranges and far from it
_FACTORS = (1.0, 0.9998, 0.9995, 0.999, 0.998, 0.995, 0.99, 0.98, 0.95, 0.9, 0.8, 0.65, 0.5, 0.35)
_FACTORS += (0.2, 0.1, 0.05)


def shared_budget(problem: ExcitationProblem) -> tuple[int, int, int]:
    """Default starts, evaluations of each, and random motions within the budget."""
    evaluations = max(1, int(BUDGET / problem.work))
    starts = min(STARTS, max(1, evaluations // _FEWEST))
    # random motions use a finer grid, and at most a quarter of the budget
    drawn = min(RANDOM, max(STARTS, evaluations // 24))
    return starts, evaluations // starts, drawn


def gain_of_twice(values: Array) -> float:
    """Expected decrease of the minimum for twice as many normal values."""
    from scipy.special import ndtri

    if (k := len(values)) < 2:
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
    """Minimise the criterion from one start, stage by stage.

    Shapes: X (P, n) -> coefficients (P, n), history (K,), iterations of the stages (S,).
    """
    x = (X / problem.units).ravel()
    history: list[float] = []
    counts, used, cut = [], 0, False
    for k, stage in enumerate(STAGES):
        most = np.inf if evaluations is None else (evaluations - used) // (len(STAGES) - k)
        x, values, made, cut = _stage(problem, x, stage, iterations, most)
        history, used = [*history, *values], used + made
        counts.append(len(values))
        stage_done(k + 1)
    best = problem.coefficients(x)
    feasible = within_limits(problem, best)
    if feasible is None:
        status, feasible = ExcitationStatus.INFEASIBLE, best
    else:
        status = ExcitationStatus.LIMIT_OF_ITERATIONS if cut else ExcitationStatus.CONVERGED
    return feasible, np.array(history), np.array(counts), status


def _stage(
    problem: ExcitationProblem, x: Array, stage: tuple[float, float], iterations: int, most: float
) -> tuple[Array, list[float], int, bool]:
    """BFGS until convergence or the limit: solution, values, evaluations, whether at the limit."""
    from scipy.optimize import minimize

    history: list[float] = []
    evaluations, cut = 0, False

    def value(x: Array) -> tuple[float, Array]:
        nonlocal evaluations
        evaluations += 1
        return problem.value(x, *stage)

    def callback(intermediate_result: Any) -> None:  # name required by SciPy
        nonlocal cut
        history.append(float(intermediate_result.fun))
        if len(history) > _WINDOW and history[-1 - _WINDOW] - history[-1] < _LITTLE:
            raise StopIteration
        if evaluations >= most:
            cut = True
            raise StopIteration

    options = {"maxiter": iterations, "gtol": 1e-4}
    solution = minimize(value, x, jac=True, method="BFGS", callback=callback, options=options)
    return solution.x, history, evaluations, cut or solution.status == 1  # 1: the last iteration


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

    def scaled(k: int) -> Array:
        return still + _FACTORS[k] * (X - still)

    # the factor at `broken` breaks limits, that at `good` is the largest known to keep them
    broken, good, k = -1, len(_FACTORS), 0
    while good - broken > 1:
        if limits_kept(problem, problem.basis.trajectory(scaled(k))).kept:
            good = k
        else:
            broken = k
        k = (broken + good) // 2
    return None if good == len(_FACTORS) else scaled(good)


def limits_kept(problem: ExcitationProblem, trajectory: Trajectory) -> ExcitationLimits:
    """Extremes of a motion, and all limits of a problem.

    Between samples a torque, which is smooth but for dry friction, may exceed them by an eighth of
    its second difference, and a clearance, which has kinks, by a half.
    """
    model = problem.model
    times = np.linspace(0.0, problem.basis.duration, _DENSE * len(problem.t) + 1)
    q, v, a = trajectory.motion.derivatives(times, (0, 1, 2))
    torque = np.abs(idm(model, q, v, a))
    peaks = (torque + _between(torque, 0.125)).max(axis=0)
    if (beside := _beside_jumps(model, times, v)).size:
        qb, vb, ab = trajectory.motion.derivatives(beside, (0, 1, 2))
        peaks = np.maximum(peaks, np.abs(idm(model, qb, vb, ab)).max(axis=0))
    distances = [box_distances(model, box, q)[0] for box in problem.boxes]
    clearance = [(free - _between(free, 0.5)).min() for free in distances]
    report = trajectory.check(problem.limits)
    return ExcitationLimits(report, problem.torque_limits, peaks, np.array(clearance))


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
    bend = np.zeros(y.shape)
    bend[1:-1] = part * np.abs(np.diff(y, 2, axis=0))
    bend[0], bend[-1] = bend[1], bend[-2]
    return bend


def _beside_jumps(model: RobotModel, times: Array, v: Array) -> Array:
    """Times just before and after a joint or a coupled motor reverses."""
    turning = v
    if model.transmission is not None:
        rows = model.transmission.weights[[m - 1 for m in model.transmission.coupled_motors]]
        turning = np.hstack((v, v @ rows.T))
    before, which = np.nonzero(turning[:-1] * turning[1:] < 0.0)
    one, two = turning[before, which], turning[before + 1, which]
    step = times[1] - times[0]
    at = times[before] + step * one / (one - two)
    # linear interpolation of the zero, and times on both sides of it
    near = 0.02 * step
    return np.clip(np.concatenate((at - near, at + near)), times[0], times[-1])


def _means(problem: ExcitationProblem, X: Array) -> Array:
    """Mean posture of a motion."""
    return (problem.functions[0] @ X).mean(axis=0)


def _middle(problem: ExcitationProblem, rng: np.random.Generator) -> Array:
    """Feasible posture near the middle of the ranges, if there is one."""
    low, high, half = problem.bounds[0]
    near, far = (rng.uniform(-1.0, 1.0, (count, half.size)) for count in _POSTURES)
    drawn = 0.5 * (low + high) + np.concatenate((0.3 * half * near[: -len(far)], 0.95 * half * far))
    excess = np.zeros(len(drawn))
    if problem.values.any():
        still = np.zeros(drawn.shape)
        torque = np.abs(idm(problem.model, drawn, still, still, drive=False))
        excess += np.maximum(torque / problem.torque_limits - 0.8, 0.0).sum(axis=1)
    for box in problem.boxes:
        distance, _ = box_distances(problem.model, box, drawn)
        excess += np.maximum(0.02 - distance, 0.0).sum(axis=1)
    return drawn[int(excess.argmin())]
