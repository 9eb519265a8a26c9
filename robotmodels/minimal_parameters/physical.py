"""Physically consistent least squares in cvxpy; of equal fits, the nearest to a prior.

The variables of the solver are changes of the standard parameters relative to the prior, in units
in which their norm is the distance of the robot from the prior.
"""

from __future__ import annotations

import warnings
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from .._arrays import Array
from .._outcomes import Outcome
from ..errors import MissingExtraError
from ..inertia import InertialParameters
from .bodies import pseudo_inertias
from .constraints import (
    Constraint,
    coupled_constraints,
    drive_sizes,
    positive_drives,
    sign_constraints,
    stribeck_numbers,
)
from .result import BaseParameters

MARGIN = 1e-3
"""Default smallest eigenvalue of a pseudo-inertia, relative to the prior's."""
_SOLVER = {
    "tol_gap_abs": 1e-9,
    "tol_gap_rel": 1e-9,
    "tol_feas": 1e-9,
    "max_iter": 200,
    "accept_unknown": True,
}
_UNIQUE = 1e-8
"""Weight of the squared distance, in the solver's units, which makes least squares unique."""
_RATIO, _ROUNDS = 10.0, 4
"""Ratio of the solution to the assumed sizes above which the problem is rescaled."""
_ROOM = 1e-3
"""Additional margin of fits, relative."""
_KEPT, _SAME = 1e-9, 1e-13
"""Zero tolerances of base parameter deviations, relative: of a robot, of the prior."""
_MISSED = 5e-9
"""Rounding tolerance of a constraint violation, natural units times distance."""
_ACTIVE = 1e-5
"""Largest slack of an active constraint, natural units."""
_GAP = 1e-4
"""Least optimality gap of an inaccurate fit beyond the tolerance, relative to the squares."""


class PhysicalStatus(Outcome):
    """Outcome of the search for a physical robot."""

    EXACT = (
        0,
        "The robot has exactly these base parameters; its residuals are not increased.",
    )
    CONSTRAINED = 1, "No physical robot has these base parameters; this one is the best of all."
    WEIGHTED = 2, "The best compromise of residuals and distance from the prior, by its weight."
    INACCURATE = 3, "The solver stopped early: the robot is physical, but a better one may exist."
    INFEASIBLE = 4, "No physical robot satisfies the bounds; widen one, or use a smaller margin."
    FAILED = 5, "The solver did not converge; the parameters are not to be used."


@dataclass(frozen=True, slots=True, eq=False)
class Squares:
    """Sum of squares ``|fit @ x - target|^2 + least`` of standard parameters.

    ``same @ x = level`` where the sum is least. Shapes: fit, same (k, p), target, level (k,).
    """

    fit: Array
    target: Array
    same: Array
    level: Array
    least: float = 0.0

    def sum(self, x: Array) -> float:
        """The sum of squares of standard parameters."""
        return float(np.sum((self.fit @ x - self.target) ** 2)) + self.least

    def is_least(self, x: Array, part: float) -> bool:
        """Whether standard parameters have the least sum, up to a relative tolerance."""
        missed = np.abs(self.same @ x - self.level).max(initial=0.0)
        return bool(missed <= part * np.abs(self.level).max(initial=0.0))


class PhysicalFit(NamedTuple):
    """Standard parameters x (p,) of a physical robot near a prior, with their residuals.

    Squares of the residuals, the least without constraints, the optimality gap, active constraints.
    """

    x: Array
    status: PhysicalStatus
    distance: float
    squares: float
    least: float
    gap: float
    active: tuple[str, ...]
    stopped: str


class _Solution(NamedTuple):
    """Result of the solver: parameters (p,) or None, its status and iterations, the dual value."""

    x: Array | None
    status: str
    iterations: int
    dual: float


class PhysicalProblem:
    """Physical robots near a prior; the variables are the standard parameters.

    Shapes: prior (p,), P0 (f, 4, 4), sizes (p - 10 f,): natural sizes of drive parameters.
    """

    def __init__(
        self,
        base: BaseParameters,
        prior: Array,
        P0: Array,
        margin: float = MARGIN,
        sizes: Array | None = None,
    ) -> None:
        f, p = base.model.f, len(prior)
        self.base, self.prior, self.margin = base, prior, margin
        basis = pseudo_inertias(InertialParameters(np.eye(10)))
        self.inverse = np.zeros((p, p))
        self.bodies = []
        for j in range(f):
            columns = slice(10 * j, 10 * j + 10)
            L = np.linalg.inv(np.linalg.cholesky(P0[j]))  # L P0 L^T = 1
            rows = np.zeros((16, p))
            rows[:, columns] = (L @ basis @ L.T).reshape(10, 16).T
            self.inverse[columns, columns] = np.linalg.cholesky(
                rows[:, columns].T @ rows[:, columns]
            ).T
            sentence = f"The pseudo-inertia of link {j + 1} is singular to the margin."
            floor = -margin * np.eye(4).ravel()
            self.bodies.append(Constraint("semidefinite", rows, floor, (sentence,)))
        drives = np.arange(10 * f, p)
        self.inverse[drives, drives] = 1.0 / (drive_sizes(base, prior) if sizes is None else sizes)
        self.scale: Array = np.asarray(np.linalg.inv(self.inverse), dtype=np.float64)
        self.unit = 1.0 / np.linalg.norm(self.inverse, axis=0)
        self.positive, self.stribeck = positive_drives(base), stribeck_numbers(base)
        self.coupled = dict(coupled_constraints(base, self.unit))
        self.bounds: tuple[Constraint, ...] = ()
        self.drives = (*sign_constraints(base, self.unit), *self.coupled.values())

    def distance(self, x: Array) -> float:
        """Distance of standard parameters from the prior."""
        return float(np.linalg.norm(self.inverse @ (x - self.prior)))

    def size(self, b: Array) -> float:
        """Ratio of base parameters to their natural sizes, at least 1. Shapes: b (b,)."""
        natural = np.linalg.norm(self.base.matrix * self.unit, axis=1)
        return max(1.0, float(np.abs(b / np.where(natural > 0, natural, 1.0)).max(initial=0.0)))

    def is_met(self, x: Array) -> bool:
        """Whether bodies are definite and other constraints satisfied up to rounding."""
        allowed = _MISSED * (1.0 + self.distance(x))
        others = (*self.drives, *self.bounds)
        definite = all(one.slack(x)[0] > -0.5 * self.margin for one in self.bodies)
        return definite and all((one.slack(x) >= -allowed).all() for one in others)

    def fit(self, squares: Squares, b: Array, weight: float, tolerance: float) -> PhysicalFit:
        """Physically consistent least squares; of equal fits, the nearest to the prior.

        With a weight of the squared distance, the least sum of both. Shapes: b (b,).
        """
        size = self.size(b)
        if weight == 0.0:
            nearest = self._nearest(squares, size)
            if nearest is not None:
                return self._result(nearest, squares, PhysicalStatus.EXACT)
        x, gap, solution = self._constrained(squares, size, weight, tolerance)
        if solution is not None and gap > _GAP + tolerance:  # second solution, scaled by the first
            again = self._constrained(squares, self._numbers(x), weight, tolerance)
            x, gap, solution = again if again[1] < gap else (x, gap, solution)
        if solution is None:
            solution = self._solve(1.0)
            infeasible = solution.status.endswith("PrimalInfeasible")
            status = PhysicalStatus.INFEASIBLE if infeasible else PhysicalStatus.FAILED
            return self._result(self.prior, squares, status, np.inf, solution)
        if not self.is_met(x):
            return self._result(self.prior, squares, PhysicalStatus.FAILED, np.inf, solution)
        if gap > _GAP + tolerance:
            return self._result(x, squares, PhysicalStatus.INACCURATE, gap, solution)
        status = PhysicalStatus.CONSTRAINED if weight == 0.0 else PhysicalStatus.WEIGHTED
        if squares.is_least(x, _KEPT):
            status = PhysicalStatus.EXACT
        return self._result(x, squares, status, gap)

    def _constrained(
        self, squares: Squares, size: float, weight: float, tolerance: float
    ) -> tuple[Array, float, _Solution | None]:
        """Parameters of the nearest of the best robots, their gap, and the solver's result."""
        x, found, total, size = self._least_squares(squares, size, weight)
        if found is None:
            return x, np.inf, None
        if weight == 0.0:
            radius = (squares.sum(x) * (1.0 + tolerance) - squares.least) ** 0.5 or 1.0
            within = squares.fit / radius, squares.target / radius
            nearer = self._solve(self._numbers(x), within=within).x
            if nearer is not None:  # an early end may leave the ball of equal fits
                nearer = self._settled(nearer)
                miss = within[0] @ nearer - within[1]
                if miss @ miss <= 1.0 + 1e-6 and self.is_met(nearer):
                    x = nearer
        x = self._settled(x)
        gap = self._gap(x, squares, found.dual, weight, total, size) if self.is_met(x) else np.inf
        return x, gap, found

    def _nearest(self, squares: Squares, size: float) -> Array | None:
        """The nearest robot with the least squares; None if no physical robot has them."""
        if squares.is_least(self.prior, _SAME) and self.is_met(self.prior):
            return self.prior
        solution = self._solve(size, equal=(squares.same, squares.level)).x
        if solution is None:
            return None
        x = self._settled(solution, squares.same, squares.level)
        return x if squares.is_least(x, _KEPT) and self.is_met(x) else None

    def _least_squares(
        self, squares: Squares, size: float, weight: float
    ) -> tuple[Array, _Solution | None, float, float]:
        """Parameters of least squares, the solver's result, and the sizes of squares and numbers.

        The problem is rescaled if the assumed sizes were wrong.
        """
        smallest = max(squares.least, 1e-8 * float(squares.target @ squares.target), 1e-300)
        x, found, total = self.prior, None, max(smallest, squares.sum(self.prior))
        used = total, size
        for _ in range(_ROUNDS):
            scaled = squares.fit / total**0.5, squares.target / total**0.5
            again = self._solve(size, scaled, weight=weight / total or _UNIQUE / size**2)
            if again.x is None or (found is not None and "Solved" not in again.status):
                break
            x, found, used = again.x, again, (total, size)
            total, size = max(smallest, squares.sum(x)), max(size, self._numbers(x))
            if max(total, used[0]) <= _RATIO * min(total, used[0]) and size <= _RATIO * used[1]:
                break
        return x, found, *used

    def _gap(
        self, x: Array, squares: Squares, dual: float, weight: float, total: float, size: float
    ) -> float:
        """Optimality gap relative to the objective, for robots within twice the distance.

        From the dual value of least squares that were divided by total, with numbers of this size.
        """
        if not np.isfinite(dual):
            return np.inf
        here, far = (squares.sum(x) - squares.least) / total, self.distance(x) ** 2
        if weight > 0.0:
            here += weight / total * far
        else:
            dual -= 4.0 * _UNIQUE * far / size**2
        return max(0.0, here - max(dual, 0.0)) / max(here + squares.least / total, 1e-300)

    def _solve(
        self,
        size: float,
        squares: tuple[Array, Array] | None = None,
        equal: tuple[Array, Array] | None = None,
        within: tuple[Array, Array] | None = None,
        weight: float = 1.0,
    ) -> _Solution:
        """Least ``|F x - t|^2 + weight * distance^2``, with ``E x = e`` or ``|F x - t| <= 1``."""
        cp = _cvxpy()
        change = cp.Variable(len(self.prior))
        terms = (cp, change, self.scale, self.prior, size)
        stated = [one.stated(*terms) for one in (*self.drives, *self.bounds)]
        # the second fit has a margin, so that its base parameters are feasible
        room = 0.0 if within is None else _ROOM * self.margin
        stated += [one.stated(*terms, room) for one in self.bodies]

        def residual(rows: Array, right: Array) -> Any:
            return (size * rows @ self.scale) @ change - (right - rows @ self.prior)

        objective = cp.sum_squares(change)
        if squares is not None:
            objective = cp.sum_squares(residual(*squares)) + weight * size**2 * objective
        if equal is not None:
            lengths = np.maximum(size * np.linalg.norm(equal[0] @ self.scale, axis=1), 1e-300)
            stated.append(residual(equal[0] / lengths[:, None], equal[1] / lengths) == 0)
        if within is not None:
            stated.append(cp.norm(residual(*within)) <= 1)
        problem = cp.Problem(cp.Minimize(objective), stated)
        data, chain, inverse = problem.get_problem_data(cp.CLARABEL, solver_opts=dict(_SOLVER))
        raw = chain.solve_via_data(problem, data, solver_opts=dict(_SOLVER))
        with warnings.catch_warnings(), suppress(cp.error.SolverError):
            warnings.simplefilter("ignore")  # inaccurate: the gap reports it
            problem.unpack_results(raw, chain, inverse)
        x = None if change.value is None else self.prior + size * self.scale @ change.value
        return _Solution(x, str(raw.status), raw.iterations, raw.obj_val_dual)

    def _numbers(self, x: Array) -> float:
        """Scale of a solution: root mean square change in the solver's units, at least 1."""
        return max(1.0, self.distance(x) / len(x) ** 0.5)

    def _settled(self, x: Array, E: Array | None = None, e: Array | None = None) -> Array:
        """Projection onto ``E x = e`` and bounds; drives and bodies onto their boundaries."""
        rows, right = ([], []) if E is None or e is None else ([E], [e])
        for cone in ("zero", "nonnegative"):
            for one in self.bounds:
                if one.cone == cone and (cone == "zero" or one.slack(x)[0] < 0.0):
                    rows.append(one.rows)
                    right.append(-one.offset)
            if rows:
                A, b = np.concatenate(rows), np.concatenate(right)
                x = x + self.unit * (np.linalg.pinv(A * self.unit) @ (b - A @ x))
        x = x.copy()
        x[self.positive] = np.maximum(x[self.positive], 0.0)
        static, coulomb = self.stribeck
        x[static] = np.maximum(x[static], x[coulomb])
        for joints, one in self.coupled.items():
            numbers = list(joints)
            x[numbers] += max(0.0, -float(one.slack(x)[0])) * self.unit[numbers]
        for one in self.bodies:
            if (
                one.slack(x)[0] < -0.5 * self.margin
            ):  # rounding of large numbers: nearest physical body
                P = (one.rows @ x).reshape(4, 4)
                values, vectors = np.linalg.eigh(P)
                P = (vectors * np.maximum(values, self.margin)) @ vectors.T - P
                x = x + np.linalg.lstsq(one.rows, P.ravel(), rcond=None)[0]
        return x

    def _result(
        self,
        x: Array,
        squares: Squares,
        status: PhysicalStatus,
        gap: float = 0.0,
        stopped: _Solution | None = None,
    ) -> PhysicalFit:
        active = [
            sentence
            for one in (*self.drives, *self.bodies, *self.bounds)
            if one.cone != "zero" and np.isfinite(gap)
            for slack, sentence in zip(one.slack(x), one.sentences, strict=True)
            if slack < _ACTIVE
        ]
        ending = ""
        if stopped is not None:
            ending = f"The solver stopped: {stopped.status} after {stopped.iterations} iterations."
        total = squares.least if status is PhysicalStatus.EXACT else squares.sum(x)
        return PhysicalFit(
            x, status, self.distance(x), total, squares.least, gap, tuple(active), ending
        )


def nearest_body(F: Array, t: Array, radius: float = 0.1) -> Array | None:
    """Physical inertial parameters of one body with the least ``|F x - t|``; None without solution.

    Shapes: F (k, 10), t (k,) -> (10,).
    """
    cp = _cvxpy()
    unit = np.array([radius**2] * 6 + [radius] * 3 + [1.0])
    scaled = F * unit
    free = np.linalg.lstsq(scaled, t, rcond=1e-12)[0]
    mass = max(float(np.abs(free).max(initial=0.0)), 1e-6)
    W = np.diag([1.0 / radius] * 3 + [1.0])
    maps = (W @ pseudo_inertias(InertialParameters(np.diag(unit))) @ W).reshape(10, 16).T
    x = cp.Variable(10)
    size = mass * float(np.abs(scaled).max(initial=0.0)) or 1.0
    squares = cp.sum_squares(scaled @ x * (mass / size) - t / size) + 1e-12 * cp.sum_squares(x)
    body = cp.reshape(maps @ x, (4, 4), order="C") >> 1e-7 * np.eye(4)
    problem = cp.Problem(cp.Minimize(squares), [body])
    with warnings.catch_warnings(), suppress(cp.error.SolverError):
        warnings.simplefilter("ignore")
        problem.solve(solver=cp.CLARABEL, **_SOLVER)
    return None if x.value is None else mass * unit * x.value


def _cvxpy() -> Any:
    try:
        import clarabel  # noqa: F401
        import cvxpy
    except ImportError:
        raise MissingExtraError(
            "Physically consistent parameters need CVXPY and Clarabel, solvers for convex "
            "problems: pip install 'robotmodels[cones]'."
        ) from None
    return cvxpy
