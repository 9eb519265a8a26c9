"""Convex problems with quadratic objectives on cones, and how to check what the solver says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import Any

import numpy as np

from .._arrays import Array
from ..errors import MissingExtraError

_ROOT = float(np.sqrt(2.0))
_ITERATIONS = 500
"""Of the interior-point solver at most; a budget that does not depend on the machine."""


class ConeOutcome(Enum):
    """Outcome of the conic solver."""

    SOLVED = auto()
    INFEASIBLE = auto()
    FAILED = auto()


class Cone(Enum):
    """Type of cone of a constraint's slack."""

    ZERO = auto()
    NONNEGATIVE = auto()
    SECOND_ORDER = auto()
    """The first entry is at least the length of the others."""
    SEMIDEFINITE = auto()
    """The upper triangle, column by column; off the diagonal times the root of 2."""


@dataclass(frozen=True, slots=True, eq=False)
class Constraint:
    """``right - rows @ x`` lies in a cone. Shapes: rows (k, p), right (k,)."""

    cone: Cone
    rows: Array
    right: Array
    sentences: tuple[str, ...]

    def slack(self, x: Array) -> Array:
        """Room that is left, one for each sentence; negative where x is outside."""
        s = self.right - self.rows @ x
        if self.cone is Cone.ZERO:
            return -np.abs(s)
        if self.cone is Cone.NONNEGATIVE:
            return s
        if self.cone is Cone.SECOND_ORDER:
            return np.array([float(s[0] - np.linalg.norm(s[1:]))])
        return np.asarray(np.linalg.eigvalsh(matrix_of(s))[:1], dtype=np.float64)

    def weight(self, z: Array) -> Array:
        """Size of multipliers, one for each sentence."""
        if self.cone in (Cone.ZERO, Cone.NONNEGATIVE):
            return np.abs(z)
        return np.array([float(np.linalg.norm(z))])

    def share(self, x: Array, z: Array) -> Array:
        """Contributions to the duality gap, one for each sentence; 0 at the optimum."""
        parts = z * (self.right - self.rows @ x)
        return parts if self.cone in (Cone.ZERO, Cone.NONNEGATIVE) else parts.sum(keepdims=True)

    def dual(self, z: Array) -> Array:
        """The nearest multipliers that the cone allows."""
        if self.cone is Cone.ZERO:
            return z
        if self.cone is Cone.NONNEGATIVE:
            return np.maximum(z, 0.0)
        if self.cone is Cone.SEMIDEFINITE:
            values, vectors = np.linalg.eigh(matrix_of(z))
            return triangle_of((vectors * np.maximum(values, 0.0)) @ vectors.T)
        length = float(np.linalg.norm(z[1:]))
        if length <= z[0]:
            return z
        half = 0.5 * max(z[0] + length, 0.0)
        return np.concatenate(([half], half * z[1:] / length))


@dataclass(frozen=True, slots=True, eq=False)
class ConeSolution:
    """Result of a conic solver. Shapes: x (p,), multipliers (k,)."""

    x: Array
    multipliers: tuple[Array, ...]
    outcome: ConeOutcome
    ended: str = ""


def matrix_of(stacked: Array) -> Array:
    """Symmetric matrix from its stacked upper triangle, off-diagonal entries scaled by sqrt(2).

    Shapes: stacked (k (k + 1) / 2,) -> (k, k).
    """
    k = round((np.sqrt(8.0 * len(stacked) + 1.0) - 1.0) / 2.0)
    columns, rows = np.tril_indices(k)
    S = np.zeros((k, k))
    S[rows, columns] = np.where(rows == columns, stacked, stacked / _ROOT)
    S[columns, rows] = S[rows, columns]
    return S


def triangle_of(S: Array) -> Array:
    """Stacked upper triangle of symmetric matrices, the inverse of `matrix_of`.

    Shapes: S (..., k, k) -> (..., k (k + 1) / 2).
    """
    columns, rows = np.tril_indices(S.shape[-1])
    return S[..., rows, columns] * np.where(rows == columns, 1.0, _ROOT)


def solve_cones(
    H: Array, g: Array, constraints: Sequence[Constraint], unit: Array, size: float = 1.0,
    fit: tuple[Array, Array] | None = None, squares: float = 1.0,
) -> ConeSolution:  # fmt: skip
    """Minimise ``x H x / 2 + g x + |F x - t|^2 / 2`` within conic constraints.

    Shapes: H (p, p); g, unit (p,).
    """
    clarabel = _clarabel()
    from scipy import sparse

    p = len(g)
    whole = unit * size
    if fit is None:
        turn, start, P, linear = np.diag(whole), np.zeros(p), H * whole * whole[:, None], g * whole
    else:
        turn, steep, target = _even_coordinates(*fit, whole)
        start = turn @ np.where(steep == 1.0, target, 0.0)
        P = turn.T @ H @ turn + np.diag(squares * steep**2)
        miss = np.where(steep == 1.0, 0.0, -target)
        linear = turn.T @ (g + H @ start) + squares * steep * miss
    of_cone = {
        Cone.ZERO: clarabel.ZeroConeT,
        Cone.NONNEGATIVE: clarabel.NonnegativeConeT,
        Cone.SECOND_ORDER: clarabel.SecondOrderConeT,
    }
    used = [one for one in constraints if len(one.right)]
    rows = [one.rows @ turn / size for one in used]
    right = [(one.right - one.rows @ start) / size for one in used]
    cones = [
        clarabel.PSDTriangleConeT(len(matrix_of(one.right)))
        if one.cone is Cone.SEMIDEFINITE
        else of_cone[one.cone](len(one.right))
        for one in used
    ]
    largest = max(float(np.abs(P).max(initial=0.0)), 1e-300)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
    settings.max_iter = _ITERATIONS
    solution = clarabel.DefaultSolver(
        sparse.csc_matrix(np.triu(P) / largest), linear / largest,
        sparse.csc_matrix(np.concatenate(rows)), np.concatenate(right), cones, settings,
    ).solve()  # fmt: skip
    x = start + turn @ np.array(solution.x)
    z = np.array(solution.z) * (largest / size)
    ends = np.cumsum([len(one.right) for one in used])
    parts = iter(np.split(z, ends)[: len(used)] if used else [])
    multipliers = tuple(next(parts) if len(one.right) else np.zeros(0) for one in constraints)
    ended = f"{solution.status} after {solution.iterations} of {_ITERATIONS} iterations"
    return ConeSolution(x, multipliers, _outcome(str(solution.status)), ended)


def lower_bound(
    value: float, gradient: Array, x: Array, constraints: Sequence[Constraint],
    multipliers: Sequence[Array], root: Array,
) -> float:  # fmt: skip
    """Lower bound of a convex objective within constraints, from dual multipliers.

    Shapes: gradient, x (p,); root (k, p).
    """
    left, paid = gradient.copy(), 0.0
    for one, z in zip(constraints, multipliers, strict=True):
        allowed = one.dual(z)
        left += one.rows.T @ allowed
        paid += float(allowed @ (one.right - one.rows @ x))
    unit = 1.0 / np.linalg.norm(root, axis=0)
    triangle = np.asarray(np.linalg.qr(root * unit, mode="r"), dtype=np.float64)
    return value - paid - 0.5 * float(np.sum(np.linalg.solve(triangle.T, left * unit) ** 2))


def _even_coordinates(F: Array, t: Array, unit: Array) -> tuple[Array, Array, Array]:
    """Map (p, p) of coordinates z to x, with ``|F x - t| = |steep z - target|`` but for a constant.

    ``steep`` (p,) is 1 where a coordinate in natural units would be steeper, else less.
    """
    p = len(unit)
    if len(t) > p:
        whole = np.asarray(np.linalg.qr(np.column_stack((F, t)), mode="r"), dtype=np.float64)
        F, t = whole[:, :p], whole[:, p]  # the last row is what no x takes away
    U, values, V = np.linalg.svd(F * unit)
    s, target = np.zeros(p), np.zeros(p)
    s[: len(values)], target[: len(values)] = values, (U.T @ t)[: len(values)]
    return unit[:, None] * V.T / np.maximum(s, 1.0), np.minimum(s, 1.0), target


def _outcome(word: str) -> ConeOutcome:
    if word in ("Solved", "AlmostSolved"):
        return ConeOutcome.SOLVED
    if word in ("PrimalInfeasible", "AlmostPrimalInfeasible"):
        return ConeOutcome.INFEASIBLE
    return ConeOutcome.FAILED


def _clarabel() -> Any:
    try:
        import clarabel
    except ImportError:
        raise MissingExtraError(
            "Physically consistent parameters need Clarabel, a solver for cones: "
            "pip install 'robotmodels[cones]'."
        ) from None
    return clarabel
