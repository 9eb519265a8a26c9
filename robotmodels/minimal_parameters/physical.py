"""Physically consistent least squares in cvxpy; of equal fits, the nearest to a prior.

The variables of the solver are changes of the standard parameters relative to the prior, in units
in which their norm is the distance of the robot from the prior.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from .._arrays import Array, read_only
from .._outcomes import Outcome
from ..errors import MissingExtraError
from ..inertia.consistency import pseudo_inertia
from ..regressors.columns import LINKS
from .constraints import Constraint, drive_constraints, numbers_by_kind, positive_drives
from .result import BaseParameters

MARGIN = 1e-3
"""Default smallest eigenvalue of a pseudo-inertia, relative to the prior's."""
_SOLVER = {"max_iter": 200, "accept_unknown": True}
_SOLVER |= dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), 1e-9)
_UNIQUE = 1e-8
"""Weight of the squared distance, in the solver's units, which makes least squares unique."""
_ROUNDS = 4
"""Solutions of least squares, each with the sizes of the one before, until the gap is small."""
_STRICT = 2e-3
"""Additional margin of the nearest robot, part of the allowance: robust feasibility."""
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

    EXACT = 0, "The robot has exactly these base parameters; its residuals are not increased."
    CONSTRAINED = 1, "No physical robot has these base parameters; this has the least residuals."
    WEIGHTED = 2, "The robot minimises the residuals plus the weighted distance from the prior."
    INACCURATE = 3, "The solver stopped early: the robot is physical, but a better one may exist."
    INFEASIBLE = 4, "No physical robot satisfies the bounds; widen one, or use a smaller margin."
    FAILED = 5, "The solver did not converge; the parameters are not to be used."


@dataclass(frozen=True, slots=True, eq=False)
class Squares:
    """Sum of squares ``|weights @ (same @ x - level)|^2 + least``; levels are of this size.

    Shapes: weights (r, k), same (k, p), level (k,).
    """

    weights: Array
    same: Array
    level: Array
    size: float
    least: float = 0.0

    def about(self, x: Array, scale: Array) -> Squares:
        """The same of ``z``, for the parameters ``x + scale @ z``."""
        return replace(self, same=self.same @ scale, level=self.level - self.same @ x)

    def rows(self, size: float) -> tuple[Array, Array]:
        """Weighted rows (r, p) and right side (r,), both divided by a size."""
        return self.weights @ self.same / size, self.weights @ self.level / size

    def sum(self, x: Array) -> float:
        """The sum of squares of standard parameters."""
        return float(np.sum((self.weights @ (self.same @ x - self.level)) ** 2)) + self.least

    def is_least(self, x: Array, part: float) -> bool:
        """Whether standard parameters have the least sum, up to a relative tolerance."""
        return bool(np.abs(self.same @ x - self.level).max(initial=0.0) <= part * self.size)


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
    """Result of the solver: changes (p,) or None, its status and iterations.

    Lower bound of the objective, and the weight of the squared distance in it.
    """

    z: Array | None
    status: str
    iterations: int
    dual: float
    weight: float


class PhysicalProblem:
    """Physical robots near a prior; the variables z have the distance from the prior as their norm.

    Shapes: prior (p,), P0 (f, 4, 4), b (b,): base parameters that give a scale.
    """

    def __init__(
        self, base: BaseParameters, prior: Array, P0: Array, b: Array, margin: float = MARGIN
    ) -> None:
        f, p = base.model.f, len(prior)
        self.base, self.prior = base, prior
        basis = pseudo_inertia(np.eye(10))
        inverse = np.zeros((p, p))
        bodies = []
        for j in range(f):
            columns = slice(10 * j, 10 * j + 10)
            L = np.linalg.inv(np.linalg.cholesky(P0[j]))  # L P0 L^T = 1
            rows = np.zeros((16, p))
            rows[:, columns] = (L @ basis @ L.T).reshape(10, 16).T
            squares = rows[:, columns].T @ rows[:, columns]
            inverse[columns, columns] = np.linalg.cholesky(squares).T
            sentence = f"The pseudo-inertia of link {j + 1} is singular to the margin."
            floor = -margin * np.eye(4).ravel()
            bodies.append(Constraint("semidefinite", rows, floor, (sentence,), 0.5 * margin))
        drives = np.arange(10 * f, p)
        inverse[drives, drives] = 1.0 / drive_sizes(base, prior, b)
        self.scale: Array = np.asarray(np.linalg.inv(inverse), dtype=np.float64)
        self.unit = 1.0 / np.linalg.norm(inverse, axis=0)
        self.natural = np.linalg.norm(base.matrix * self.unit, axis=1)
        self.constraints: list[Constraint] = []
        self.add((*drive_constraints(base, self.unit), *bodies))

    def add(self, constraints: Iterable[Constraint]) -> None:
        """Add constraints on the standard parameters."""
        self.constraints += [one.about(self.prior, self.scale) for one in constraints]

    def is_met(self, z: Array) -> bool:
        """Whether bodies are definite and other constraints satisfied up to rounding."""
        rounding = _ROUNDING * (1.0 + float(np.linalg.norm(z)))
        return all((one.slack(z) >= -(one.allowance or rounding)).all() for one in self.constraints)

    def fit(self, squares: Squares, b: Array, weight: float, tolerance: float) -> PhysicalFit:
        """Physically consistent least squares; of equal fits, the nearest to the prior.

        With a weight of the squared distance, the least sum of both. Shapes: b (b,).
        """
        squares = squares.about(self.prior, self.scale)
        size = max(1.0, float(np.abs(b / self.natural).max(initial=0.0)))
        prior = np.zeros_like(self.prior)
        if not self.is_met(prior):
            found = self._solve(1.0)
            if found.status.endswith("PrimalInfeasible"):
                return self._result(prior, squares, PhysicalStatus.INFEASIBLE, np.inf, found)
        elif weight == 0.0 and squares.is_least(prior, _SAME):
            return self._result(prior, squares, PhysicalStatus.EXACT)
        if weight == 0.0 and (z := self._nearest_exact(squares, size)) is not None:
            return self._result(z, squares, PhysicalStatus.EXACT)
        z, gap, found = self._least_squares(squares, size, weight)
        if found is not None and weight == 0.0:
            radius = (squares.sum(z) * (1.0 + tolerance) - squares.least) ** 0.5 or 1.0
            ball = squares.rows(radius)
            nearer = self._solve(_rms(z), within=ball).z
            nearer = z if nearer is None else self._settled(nearer)
            # an early end may leave the ball of equal fits
            if np.sum((ball[0] @ nearer - ball[1]) ** 2) <= 1.0 + 1e-6 and self.is_met(nearer):
                z, gap = nearer, self._gap(nearer, squares, found, weight)
        if found is None or not self.is_met(z):
            return self._result(prior, squares, PhysicalStatus.FAILED, np.inf, found)
        if gap > _GAP + tolerance:
            return self._result(z, squares, PhysicalStatus.INACCURATE, gap, found)
        status = PhysicalStatus.CONSTRAINED if weight == 0.0 else PhysicalStatus.WEIGHTED
        if squares.is_least(z, _KEPT):
            status = PhysicalStatus.EXACT
        return self._result(z, squares, status, gap)

    def _nearest_exact(self, squares: Squares, size: float) -> Array | None:
        """The nearest robot with the least squares; None if no physical robot has them."""
        if (z := self._solve(size, equal=(squares.same, squares.level)).z) is None:
            return None
        z = self._settled(z, squares.same, squares.level)
        return z if squares.is_least(z, _KEPT) and self.is_met(z) else None

    def _least_squares(
        self, squares: Squares, size: float, weight: float
    ) -> tuple[Array, float, _Solution | None]:
        """Changes of least squares, their gap and the solver's result.

        The problem is rescaled until the assumed sizes of squares and changes were right.
        """
        z, gap, found = np.zeros_like(self.prior), np.inf, None
        smallest = max(squares.least, 1e-8 * squares.sum(z), 1e-300)
        for _ in range(_ROUNDS):
            total = max(smallest, squares.sum(z))
            again = self._solve(size, squares, total, weight or _UNIQUE * total / size**2)
            if again.z is None:
                break
            found, z = again, self._settled(again.z)
            gap, size = self._gap(z, squares, found, weight), max(size, _rms(z))
            if gap <= _GAP:
                break
        return z, gap, found

    def _gap(self, z: Array, squares: Squares, found: _Solution, weight: float) -> float:
        """Optimality gap relative to the objective, for robots within twice the distance."""
        if not (np.isfinite(found.dual) and self.is_met(z)):
            return np.inf
        here = squares.sum(z) - squares.least + weight * float(z @ z)
        bound = found.dual - (4.0 * found.weight * float(z @ z) if weight == 0.0 else 0.0)
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
        """Least ``|F z - t|^2 + weight * |z|^2``, with ``E z = e`` or ``|B z - b| <= 1``."""
        cp = _cvxpy()
        u = cp.Variable(len(self.prior))  # z / size
        strict = _STRICT if within is not None else 0.0
        stated = [one.stated(cp, u, size, strict) for one in self.constraints]
        objective = cp.sum_squares(u) * (weight / total * size**2 if squares else 1.0)
        if squares is not None:
            rows, right = squares.rows(total**0.5)
            objective += cp.sum_squares((size * rows) @ u - right)
        if equal is not None:
            E, e = equal
            lengths = np.maximum(size * np.linalg.norm(E, axis=1), 1e-300)
            stated.append((size * E / lengths[:, None]) @ u == e / lengths)
        if within is not None:
            stated.append(cp.norm((size * within[0]) @ u - within[1]) <= 1)
        raw = _solved(cp.Problem(cp.Minimize(objective), stated))
        z = None if u.value is None else size * u.value
        return _Solution(z, str(raw.status), raw.iterations, raw.obj_val_dual * total, weight)

    def _settled(self, z: Array, E: Array | None = None, e: Array | None = None) -> Array:
        """Projection onto ``E z = e`` and violated constraints, matrices inside their cones."""
        linear = [one for one in self.constraints if one.cone != "semidefinite"]
        violated = [(one, one.slack(z) <= 0.0) for one in linear]
        rows = [one.rows[bad] for one, bad in violated] + ([] if E is None else [E])
        right = [-one.offset[bad] for one, bad in violated] + ([] if e is None else [e])
        if rows:
            A, b = np.concatenate(rows), np.concatenate(right)
            z = z + np.linalg.pinv(A) @ (b - A @ z)
        for one in self.constraints:
            z = one.inside(z) if one.cone == "semidefinite" else z
        return z

    def _result(
        self,
        z: Array,
        squares: Squares,
        status: PhysicalStatus,
        gap: float = 0.0,
        stopped: _Solution | None = None,
    ) -> PhysicalFit:
        x = self.prior + self.scale @ z
        positive, kinds = positive_drives(self.base), numbers_by_kind(self.base)
        x[positive] = np.maximum(x[positive], 0.0)
        if "Fs" in kinds:
            x[kinds["Fs"]] = np.maximum(x[kinds["Fs"]], x[kinds["Fc"]])
        active = [
            sentence
            for one in self.constraints
            if one.cone != "zero" and np.isfinite(gap)
            for slack, sentence in zip(one.slack(z), one.sentences, strict=True)
            if slack < _ACTIVE
        ]
        ending = ""
        if stopped is not None:
            ending = f"The solver stopped: {stopped.status} after {stopped.iterations} iterations."
        total = squares.least if status is PhysicalStatus.EXACT else squares.sum(z)
        distance = float(np.linalg.norm(z))
        return PhysicalFit(
            read_only(x), status, distance, total, squares.least, gap, tuple(active), ending
        )


def _rms(z: Array) -> float:
    """Scale of a solution: root mean square change, at least 1."""
    return max(1.0, float(np.sqrt(np.mean(z * z))))


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
    maps = (W @ pseudo_inertia(np.diag(unit)) @ W).reshape(10, 16).T
    x = cp.Variable(10)
    size = mass * float(np.abs(scaled).max(initial=0.0)) or 1.0
    squares = cp.sum_squares(scaled @ x * (mass / size) - t / size) + 1e-12 * cp.sum_squares(x)
    body = cp.reshape(maps @ x, (4, 4), order="C") >> 1e-7 * np.eye(4)
    _solved(cp.Problem(cp.Minimize(squares), [body]))
    return None if x.value is None else mass * unit * x.value


def _solved(problem: Any) -> Any:
    """Solve a problem with Clarabel; the result of Clarabel."""
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
