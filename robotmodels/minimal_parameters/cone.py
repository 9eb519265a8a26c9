"""Standard parameters of real bodies as a convex problem, solved on cones by Clarabel."""

from __future__ import annotations

from enum import Enum, auto
from typing import Any

import numpy as np

from .._arrays import Array
from ..errors import MissingExtraError
from ..inertia import InertialParameters
from .prior import pseudo_inertias
from .result import BaseParameters

_PLACES = tuple((i, k) for k in range(4) for i in range(k + 1))
"""Upper triangle of a 4x4 matrix, column by column, as the solver stacks it."""
_SLACK = 1.01
"""The first of two stages stays this much further inside, so that the second has room."""
_UNIQUE = 1e-9
"""Weight of the distance in the first stage, which makes its solution unique."""


class ConeOutcome(Enum):
    """What the solver says.

    Examples
    --------
    >>> ConeOutcome.SOLVED.name
    'SOLVED'
    """

    SOLVED = auto()
    INFEASIBLE = auto()
    FAILED = auto()


class ConeProblem:
    """Real bodies and drives near a prior; the variables are the standard parameters.

    Parameters
    ----------
    base : BaseParameters
        b of them.
    prior : ndarray, shape (p,)
        Standard parameters to be near to.
    P0 : ndarray, shape (f, 4, 4)
        Pseudo-inertias of the prior, positive definite.
    margin : float
        Smallest eigenvalue of the pseudo-inertias relative to these.

    Examples
    --------
    >>> ConeProblem.__name__
    'ConeProblem'
    """

    def __init__(self, base: BaseParameters, prior: Array, P0: Array, margin: float) -> None:
        f, n, p = base.model.f, base.model.n, len(prior)
        self.base, self.prior, self.margin, self.f = base, prior, margin, f
        # whitened pseudo-inertia of each link: the identity at the prior
        basis = pseudo_inertias(InertialParameters(np.eye(10)))
        self.maps = np.zeros((f, 16, 10))
        for j in range(f):
            L = np.linalg.inv(np.linalg.cholesky(P0[j]))
            self.maps[j] = np.stack([(L @ B @ L.T).ravel() for B in basis], axis=1)
        self.metric = np.zeros((p, p))
        for j in range(f):
            part = slice(10 * j, 10 * j + 10)
            self.metric[part, part] = self.maps[j].T @ self.maps[j]
        rest = range(10 * f, p)
        self.metric[rest, rest] = 1.0 / _sizes(prior[10 * f :], n) ** 2
        self.unit = 1.0 / np.sqrt(np.diag(self.metric))
        # rotor inertias and frictions; offsets, and what couples motors, may have either sign
        self.positive = np.arange(10 * f, 10 * f + (3 * n if base.drive else 0))

    def distance(self, x: Array) -> float:
        """Distance of standard parameters from the prior."""
        change = x - self.prior
        return float(np.sqrt(max(change @ self.metric @ change, 0.0)))

    def nearest_to_prior(self, b: Array) -> tuple[Array, ConeOutcome]:
        """Nearest parameters with given base parameters."""
        M = self.base.matrix
        x, outcome = self._solve(self.metric, -self.metric @ self.prior, M, b, self.margin)
        if outcome is ConeOutcome.SOLVED:
            # the solver's last digits, then signs that rounding has turned
            x = x + self.unit * (np.linalg.pinv(M * self.unit) @ (b - M @ x))
            x[self.positive] = np.maximum(x[self.positive], 0.0)
        return x, outcome

    def nearest_base(self, W: Array, b: Array) -> tuple[Array, ConeOutcome]:
        """Parameters with the least ``|W (M x - b)|``, and among those the nearest."""
        A = W @ self.base.matrix
        H = A.T @ A
        size = float(np.linalg.norm(H * self.unit * self.unit[:, None], 2)) or 1.0
        weight = _UNIQUE * size
        g = -A.T @ (W @ b) - weight * self.metric @ self.prior
        none = np.zeros((0, len(g)))
        x, outcome = self._solve(
            H + weight * self.metric, g, none, np.zeros(0), _SLACK * self.margin
        )
        if outcome is not ConeOutcome.SOLVED:
            return x, ConeOutcome.FAILED
        x[self.positive] = np.maximum(x[self.positive], 0.0)
        nearer, again = self.nearest_to_prior(self.base.matrix @ x)
        return (nearer, again) if again is ConeOutcome.SOLVED else (x, ConeOutcome.SOLVED)

    def _solve(
        self, H: Array, g: Array, E: Array, e: Array, margin: float
    ) -> tuple[Array, ConeOutcome]:
        clarabel = _clarabel()
        from scipy import sparse

        p, unit = len(g), self.unit
        rows, right, cones = [], [], []
        if len(e):
            scale = 1.0 / np.abs(E * unit).max(axis=1)
            rows.append(E * unit * scale[:, None])
            right.append(e * scale)
            cones.append(clarabel.ZeroConeT(len(e)))
        k = len(self.positive)
        if k:
            bound = np.zeros((k, p))
            bound[range(k), self.positive] = -1.0
            rows.append(bound)
            right.append(np.zeros(k))
            cones.append(clarabel.NonnegativeConeT(k))
        for j in range(self.f):
            part = slice(10 * j, 10 * j + 10)
            block, floor = np.zeros((10, p)), np.zeros(10)
            for row, (i, m) in enumerate(_PLACES):
                weight = 1.0 if i == m else np.sqrt(2.0)
                block[row, part] = -weight * self.maps[j][4 * i + m] * unit[part]
                floor[row] = -margin * (i == m)
            rows.append(block)
            right.append(floor)
            cones.append(clarabel.PSDTriangleConeT(4))
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
        settings.max_iter = 500
        scaled = H * unit * unit[:, None]
        size = max(float(np.abs(scaled).max()), 1e-300)
        solver = clarabel.DefaultSolver(
            sparse.csc_matrix(np.triu(scaled / size)), g * unit / size,
            sparse.csc_matrix(np.concatenate(rows)), np.concatenate(right), cones, settings,
        )  # fmt: skip
        solution = solver.solve()
        word = str(solution.status)
        outcome = ConeOutcome.FAILED
        if word in ("Solved", "AlmostSolved"):
            outcome = ConeOutcome.SOLVED
        elif word in ("PrimalInfeasible", "AlmostPrimalInfeasible"):
            outcome = ConeOutcome.INFEASIBLE
        return unit * np.array(solution.x), outcome


def _sizes(drives: Array, n: int) -> Array:
    """Natural size of each drive parameter: its own, compared with others of its kind."""
    sizes = np.abs(drives)
    kinds = np.minimum(np.arange(len(drives)) // max(n, 1), 4)
    for kind in range(5):
        own = kinds == kind
        if own.any():
            sizes[own] = np.maximum(sizes[own], 1e-2 * sizes[own].max())
    return np.where(sizes > 0, sizes, 1.0)


def _clarabel() -> Any:
    try:
        import clarabel
    except ImportError:
        raise MissingExtraError(
            "Physically consistent parameters need Clarabel, a solver for cones: "
            "pip install 'robotmodels[cones]'."
        ) from None
    return clarabel
