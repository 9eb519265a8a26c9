"""Standard parameters of real bodies as a convex problem, solved on cones by Clarabel."""

from __future__ import annotations

from enum import Enum, auto
from typing import Any

import numpy as np

from .._arrays import Array
from ..drive import DriveKind, drive_kinds
from ..errors import MissingExtraError
from ..inertia import InertialParameters
from .coupled_drives import coupled_blocks, drive_sizes, dry_rows
from .prior import pseudo_inertias
from .result import BaseParameters

_PLACES = tuple((i, k) for k in range(4) for i in range(k + 1))
"""Upper triangle of a 4x4 matrix, column by column, as the solver stacks it."""
_SLACK = 1.01
"""The first of two stages stays this much further inside, so that the second has room."""
_UNIQUE = 1e-9
"""Weight of the distance in the first stage, which makes its solution unique."""
_EVEN = 1e-12
"""Negative eigenvalue of coupled drives, relative to the largest, that is rounding."""


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
        self.metric[rest, rest] = 1.0 / drive_sizes(base, prior) ** 2
        self.unit = 1.0 / np.sqrt(np.diag(self.metric))
        # rotor inertias and frictions; offsets, and what couples motors, may have either sign
        kinds = drive_kinds(base.drive)
        own = [k for k, kind in enumerate(kinds) if kind is not DriveKind.OFFSET]
        starts = [np.arange(10 * f + n * k, 10 * f + n * k + n) for k in own]
        self.positive = np.concatenate((*starts, np.zeros(0))).astype(np.int64)
        self.blocks = coupled_blocks(base)
        self.dry = dry_rows(base)

    def distance(self, x: Array) -> float:
        """Distance of standard parameters from the prior."""
        change = x - self.prior
        return float(np.sqrt(max(change @ self.metric @ change, 0.0)))

    def nearest_to_prior(self, b: Array) -> tuple[Array, ConeOutcome]:
        """Nearest parameters with given base parameters."""
        M = self.base.matrix
        x, outcome = self._solve(
            self.metric, -self.metric @ self.prior, M, b, self.margin, self._size(b)
        )
        if outcome is ConeOutcome.SOLVED:
            # the solver's last digits, then signs that rounding has turned
            x = x + self.unit * (np.linalg.pinv(M * self.unit) @ (b - M @ x))
            x = self._with_signs(x)
        return x, outcome

    def is_met(self, x: Array) -> bool:
        """Whether standard parameters are those of real bodies and drives already."""
        if (x[self.positive] < 0.0).any() or (self.dry @ x < 0.0).any():
            return False
        if any(block.least(x) < -_EVEN * block.largest(x) for block in self.blocks):
            return False
        whitened = [
            (maps @ x[10 * j : 10 * j + 10]).reshape(4, 4) for j, maps in enumerate(self.maps)
        ]
        return all(np.linalg.eigvalsh(P)[0] >= self.margin for P in whitened)

    def _with_signs(self, x: Array) -> Array:
        """Signs that rounding has turned are turned back."""
        x = x.copy()
        x[self.positive] = np.maximum(x[self.positive], 0.0)
        for block in self.blocks:
            x[block.diagonal] += max(0.0, -block.least(x))
        return x

    def nearest_base(self, W: Array, b: Array) -> tuple[Array, ConeOutcome]:
        """Parameters with the least ``|W (M x - b)|``, and among those the nearest."""
        A = W @ self.base.matrix
        H = A.T @ A
        weight = _UNIQUE * (float(np.linalg.norm(H * self.unit * self.unit[:, None], 2)) or 1.0)
        g = -A.T @ (W @ b) - weight * self.metric @ self.prior
        none = np.zeros((0, len(g)))
        x, outcome = self._solve(
            H + weight * self.metric, g, none, np.zeros(0), _SLACK * self.margin, self._size(b)
        )
        if outcome is not ConeOutcome.SOLVED:
            return x, ConeOutcome.FAILED
        x = self._with_signs(x)
        nearer, again = self.nearest_to_prior(self.base.matrix @ x)
        return (nearer, again) if again is ConeOutcome.SOLVED else (x, ConeOutcome.SOLVED)

    def _solve(
        self, H: Array, g: Array, E: Array, e: Array, margin: float, size: float
    ) -> tuple[Array, ConeOutcome]:
        """Least of ``x H x / 2 + g x``; the solver's numbers are x over units and ``size``."""
        clarabel = _clarabel()
        from scipy import sparse

        p, unit = len(g), self.unit
        rows, right, cones = [], [], []
        if len(e):
            scale = 1.0 / np.abs(E * unit).max(axis=1)
            rows.append(E * unit * scale[:, None])
            right.append(e * scale / size)
            cones.append(clarabel.ZeroConeT(len(e)))
        bound = np.zeros((len(self.positive), p))
        bound[range(len(self.positive)), self.positive] = -1.0
        bound = np.vstack((bound, -self.dry * unit * self.dry_scale()[:, None]))
        if k := len(bound):
            rows.append(bound)
            right.append(np.zeros(k))
            cones.append(clarabel.NonnegativeConeT(k))
        for j in range(self.f):
            part = slice(10 * j, 10 * j + 10)
            block, floor = np.zeros((10, p)), np.zeros(10)
            for row, (i, m) in enumerate(_PLACES):
                weight = 1.0 if i == m else np.sqrt(2.0)
                block[row, part] = -weight * self.maps[j][4 * i + m] * unit[part]
                floor[row] = -margin / size * (i == m)
            rows.append(block)
            right.append(floor)
            cones.append(clarabel.PSDTriangleConeT(4))
        for joined in self.blocks:
            rows.append(-joined.triangle(unit) * unit)
            right.append(np.zeros(len(rows[-1])))
            cones.append(clarabel.PSDTriangleConeT(len(joined.diagonal)))
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
        settings.max_iter = 500
        scaled = H * unit * unit[:, None]
        largest = max(float(np.abs(scaled).max()), 1e-300)
        solver = clarabel.DefaultSolver(
            sparse.csc_matrix(np.triu(scaled / largest)), g * unit / (largest * size),
            sparse.csc_matrix(np.concatenate(rows)), np.concatenate(right), cones, settings,
        )  # fmt: skip
        solution = solver.solve()
        word = str(solution.status)
        outcome = ConeOutcome.FAILED
        if word in ("Solved", "AlmostSolved"):
            outcome = ConeOutcome.SOLVED
        elif word in ("PrimalInfeasible", "AlmostPrimalInfeasible"):
            outcome = ConeOutcome.INFEASIBLE
        return size * unit * np.array(solution.x), outcome

    def dry_scale(self) -> Array:
        """What makes the rows of dry friction of order one."""
        return 1.0 / np.maximum(np.abs(self.dry * self.unit).max(axis=1, initial=0.0), 1e-300)

    def _size(self, b: Array) -> float:
        """How much greater than those of the prior base parameters are; the solver's unit."""
        M = self.base.matrix
        natural = np.sqrt(((M * self.unit) ** 2).sum(axis=1))
        return max(1.0, float(np.abs(b / np.where(natural > 0, natural, 1.0)).max(initial=0.0)))


def _clarabel() -> Any:
    try:
        import clarabel
    except ImportError:
        raise MissingExtraError(
            "Physically consistent parameters need Clarabel, a solver for cones: "
            "pip install 'robotmodels[cones]'."
        ) from None
    return clarabel
