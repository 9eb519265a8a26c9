"""Physically consistent least squares in cvxpy; of equal fits, the nearest to a prior.

The variables of the solver are changes of the standard parameters relative to the prior, in units
in which their norm is the distance of the robot from the prior.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from .._arrays import Array
from .._outcomes import Outcome
from ..errors import MissingExtraError
from ..inertia import InertialParameters
from ..regressors.columns import LINKS
from .bodies import pseudo_inertias
from .constraints import Constraint, drive_constraints, numbers_by_kind, positive_drives
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
"""Additional margin of the nearest robot, relative, so that its base parameters are feasible."""
_KEPT, _SAME = 1e-9, 1e-13
"""Zero tolerances of base parameter deviations, relative: of a robot, of the prior."""
_ROUNDING = 5e-9
"""Rounding tolerance of a constraint violation, natural units times distance."""
_ACTIVE = 1e-5
"""Largest slack of an active constraint, natural units."""
_GAP = 1e-4
"""Largest optimality gap of a converged fit beyond the tolerance, relative to the squares."""
_SMALL = 1e-2
"""Least drive parameter of the prior, relative to others and to the data, that sets a scale."""


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
        error = np.abs(self.same @ x - self.level).max(initial=0.0)
        return bool(error <= part * np.abs(self.level).max(initial=0.0))


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
    """Result of the solver: parameters (p,) or None, its status and iterations.

    Lower bound of the objective, and the weight of the squared distance in it.
    """

    x: Array | None
    status: str
    iterations: int
    dual: float
    weight: float


class PhysicalProblem:
    """Physical robots near a prior; the variables are the standard parameters.

    Shapes: prior (p,), P0 (f, 4, 4), b (b,): base parameters that give a scale.
    """

    def __init__(
        self, base: BaseParameters, prior: Array, P0: Array, b: Array, margin: float = MARGIN
    ) -> None:
        f, p = base.model.f, len(prior)
        self.prior, self.margin = prior, margin
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
        self.inverse[drives, drives] = 1.0 / drive_sizes(base, prior, b)
        self.scale: Array = np.asarray(np.linalg.inv(self.inverse), dtype=np.float64)
        self.unit = 1.0 / np.linalg.norm(self.inverse, axis=0)
        self.natural = np.linalg.norm(base.matrix * self.unit, axis=1)
        self.positive, kinds = positive_drives(base), numbers_by_kind(base)
        self.stribeck = (kinds["Fs"], kinds["Fc"]) if "Fs" in kinds else None
        self.others = tuple(drive_constraints(base, self.unit))

    def add(self, bounds: Iterable[Constraint]) -> None:
        """Add bounds on masses and centres."""
        self.others += tuple(bounds)

    def distance(self, x: Array) -> float:
        """Distance of standard parameters from the prior."""
        return float(np.linalg.norm(self.inverse @ (x - self.prior)))

    def is_met(self, x: Array) -> bool:
        """Whether bodies are definite and other constraints satisfied up to rounding."""
        allowed = _ROUNDING * (1.0 + self.distance(x))
        definite = all(one.slack(x)[0] > -0.5 * self.margin for one in self.bodies)
        return definite and all((one.slack(x) >= -allowed).all() for one in self.others)

    def fit(self, squares: Squares, b: Array, weight: float, tolerance: float) -> PhysicalFit:
        """Physically consistent least squares; of equal fits, the nearest to the prior.

        With a weight of the squared distance, the least sum of both. Shapes: b (b,).
        """
        size = max(
            1.0, float(np.abs(b / np.where(self.natural > 0, self.natural, 1.0)).max(initial=0))
        )
        x = self._nearest_exact(squares, size) if weight == 0.0 else None
        if x is not None:
            return self._result(x, squares, PhysicalStatus.EXACT)
        x, gap, found = self._least_squares(squares, size, weight)
        if found is None:
            found = self._solve(1.0)
            infeasible = found.status.endswith("PrimalInfeasible")
            status = PhysicalStatus.INFEASIBLE if infeasible else PhysicalStatus.FAILED
            return self._result(self.prior, squares, status, np.inf, found)
        if weight == 0.0:
            radius = (squares.sum(x) * (1.0 + tolerance) - squares.least) ** 0.5 or 1.0
            ball = squares.fit / radius, squares.target / radius
            nearer = self._solve(self._numbers(x), within=ball).x
            nearer = x if nearer is None else self._settled(nearer)
            # an early end may leave the ball of equal fits
            if np.sum((ball[0] @ nearer - ball[1]) ** 2) <= 1.0 + 1e-6 and self.is_met(nearer):
                x, gap = nearer, self._gap(nearer, squares, found, weight)
        if not self.is_met(x):
            return self._result(self.prior, squares, PhysicalStatus.FAILED, np.inf, found)
        if gap > _GAP + tolerance:
            return self._result(x, squares, PhysicalStatus.INACCURATE, gap, found)
        status = PhysicalStatus.CONSTRAINED if weight == 0.0 else PhysicalStatus.WEIGHTED
        if squares.is_least(x, _KEPT):
            status = PhysicalStatus.EXACT
        return self._result(x, squares, status, gap)

    def _nearest_exact(self, squares: Squares, size: float) -> Array | None:
        """The nearest robot with the least squares; None if no physical robot has them."""
        if squares.is_least(self.prior, _SAME) and self.is_met(self.prior):
            return self.prior
        x = self._solve(size, equal=(squares.same, squares.level)).x
        if x is None:
            return None
        x = self._settled(x, squares.same, squares.level)
        return x if squares.is_least(x, _KEPT) and self.is_met(x) else None

    def _least_squares(
        self, squares: Squares, size: float, weight: float
    ) -> tuple[Array, float, _Solution | None]:
        """Parameters of least squares, their gap and the solver's result.

        The problem is rescaled until the assumed sizes of squares and changes were right.
        """
        smallest = max(squares.least, 1e-8 * float(squares.target @ squares.target), 1e-300)
        best, least, found = self.prior, np.inf, None
        total = max(smallest, squares.sum(self.prior))
        for _ in range(_ROUNDS):
            again = self._solve(size, squares, total, weight or _UNIQUE * total / size**2)
            if again.x is None:
                break
            x = self._settled(again.x)
            gap = self._gap(x, squares, again, weight)
            if gap <= least:
                best, least, found = x, gap, again
            used = total, size
            total, size = max(smallest, squares.sum(x)), max(size, self._numbers(x))
            fits = max(total, used[0]) <= _RATIO * min(total, used[0])
            if fits and size <= _RATIO * used[1] and gap <= 10.0 * _GAP:
                break
        return best, least, found

    def _gap(self, x: Array, squares: Squares, found: _Solution, weight: float) -> float:
        """Optimality gap relative to the objective, for robots within twice the distance."""
        if not (np.isfinite(found.dual) and self.is_met(x)):
            return np.inf
        far = self.distance(x) ** 2
        here = squares.sum(x) - squares.least + weight * far
        bound = found.dual - (4.0 * found.weight * far if weight == 0.0 else 0.0)
        return max(0.0, here - max(bound, 0.0)) / max(here + squares.least, 1e-300)

    def _solve(
        self,
        size: float,
        squares: Squares | None = None,
        total: float = 1.0,
        weight: float = 1.0,
        equal: tuple[Array, Array] | None = None,
        within: tuple[Array, Array] | None = None,
    ) -> _Solution:
        """Least ``|F x - t|^2 + weight * distance^2``, with ``E x = e`` or ``|B x - b| <= 1``."""
        cp = _cvxpy()
        change = cp.Variable(len(self.prior))
        terms = (cp, change, self.scale, self.prior, size)
        room = 0.0 if within is None else _ROOM * self.margin
        stated = [one.stated(*terms) for one in self.others]
        stated += [one.stated(*terms, room) for one in self.bodies]

        def residual(rows: Array, right: Array) -> Any:
            return (size * rows @ self.scale) @ change - (right - rows @ self.prior)

        objective = cp.sum_squares(change) * (weight / total * size**2 if squares else 1.0)
        if squares is not None:
            root = total**0.5
            objective += cp.sum_squares(residual(squares.fit / root, squares.target / root))
        if equal is not None:
            lengths = np.maximum(size * np.linalg.norm(equal[0] @ self.scale, axis=1), 1e-300)
            stated.append(residual(equal[0] / lengths[:, None], equal[1] / lengths) == 0)
        if within is not None:
            stated.append(cp.norm(residual(*within)) <= 1)
        raw = _solved(cp.Problem(cp.Minimize(objective), stated))
        x = None if change.value is None else self.prior + size * self.scale @ change.value
        return _Solution(x, str(raw.status), raw.iterations, raw.obj_val_dual * total, weight)

    def _numbers(self, x: Array) -> float:
        """Scale of a solution: root mean square change in the solver's units, at least 1."""
        return max(1.0, self.distance(x) / len(x) ** 0.5)

    def _settled(self, x: Array, E: Array | None = None, e: Array | None = None) -> Array:
        """Projection onto ``E x = e`` and violated constraints, matrices inside their cones."""
        linear = [one for one in self.others if one.cone in ("zero", "nonnegative")]
        violated = [(one, one.slack(x) <= 0.0) for one in linear]
        rows = [one.rows[bad] for one, bad in violated] + ([] if E is None else [E])
        right = [-one.offset[bad] for one, bad in violated] + ([] if e is None else [e])
        if rows:
            A, b = np.concatenate(rows), np.concatenate(right)
            x = x + self.unit * (np.linalg.pinv(A * self.unit) @ (b - A @ x))
        x = x.copy()
        x[self.positive] = np.maximum(x[self.positive], 0.0)
        if self.stribeck is not None:
            static, coulomb = self.stribeck
            x[static] = np.maximum(x[static], x[coulomb])
        for one in self.others:
            x = one.inside(x) if one.cone == "semidefinite" else x
        for one in self.bodies:
            x = one.inside(x, -0.5 * self.margin)
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
            for one in (*self.others, *self.bodies)
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


def drive_sizes(base: BaseParameters, prior: Array, b: Array) -> Array:
    """Natural sizes of drive parameters: the prior's of their kind, else those of the data.

    Shapes: prior (p,), b (b,) -> (p - 10 f,).
    """
    sizes, kinds = np.abs(prior), numbers_by_kind(base)
    for kind, numbers in kinds.items():
        if kind != LINKS and kind not in ("Iam", "Fvm", "Fcm"):
            numbers = np.concatenate((numbers, kinds.get(f"{kind}m", numbers[:0])))
            kept = np.isin(base.kept, numbers)
            if kept.any():
                values = np.abs(b[kept])
            else:  # regrouped into other parameters
                rows, columns = np.nonzero(base.matrix[:, numbers])
                values = np.abs(b[rows] / base.matrix[rows, numbers[columns]])
            data = float(np.median(values)) if values.size else 0.0
            if sizes[numbers].max(initial=0.0) < _SMALL * data:
                sizes[numbers] = data
            sizes[numbers] = np.maximum(sizes[numbers], _SMALL * sizes[numbers].max(initial=0.0))
    return np.where(sizes > 0.0, sizes, 1.0)[10 * base.model.f :]


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
    _solved(
        cp.Problem(
            cp.Minimize(squares), [cp.reshape(maps @ x, (4, 4), order="C") >> 1e-7 * np.eye(4)]
        )
    )
    return None if x.value is None else mass * unit * x.value


def _solved(problem: Any) -> Any:
    """Solve a problem with Clarabel; its own result."""
    cp = _cvxpy()
    data, chain, inverse = problem.get_problem_data(cp.CLARABEL, solver_opts=dict(_SOLVER))
    raw = chain.solve_via_data(problem, data, solver_opts=dict(_SOLVER))
    with warnings.catch_warnings(), suppress(cp.error.SolverError):
        warnings.simplefilter("ignore")  # inaccurate: the gap reports it
        problem.unpack_results(raw, chain, inverse)
    return raw


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
