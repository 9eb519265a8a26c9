"""Standard parameters of real bodies as a convex problem, solved on cones by Clarabel."""

from __future__ import annotations

import numpy as np

from .._arrays import Array
from ..estimation.conic import Cone, ConeOutcome, ConeSolution, Constraint, solve_cones, triangle_of
from ..inertia import InertialParameters
from .coupled_drives import coupled_blocks, drive_sizes, dry_rows
from .prior import pseudo_inertias
from .real_drives import drive_constraints, positive_drives
from .result import BaseParameters

_SLACK = 1.01
"""The first of two stages stays this much further inside, so that the second has room."""
_UNIQUE = 1e-9
"""Weight of the distance in the first stage, which makes its solution unique."""
_EVEN = 1e-12
"""Negative eigenvalue of coupled drives, relative to the largest, that is rounding."""


class ConeProblem:
    """Real bodies and drives near a prior; the variables are the standard parameters.

    Shapes: prior (p,), P0 (f, 4, 4), sizes (p - 10 f,).
    """

    def __init__(
        self, base: BaseParameters, prior: Array, P0: Array, margin: float,
        sizes: Array | None = None,
    ) -> None:  # fmt: skip
        f, p = base.model.f, len(prior)
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
        sizes = drive_sizes(base, prior) if sizes is None else sizes
        self.metric[rest, rest] = 1.0 / sizes**2
        self.unit = 1.0 / np.sqrt(np.diag(self.metric))
        self.positive = positive_drives(base)
        self.blocks = coupled_blocks(base)
        self.dry = dry_rows(base)
        self.drives = drive_constraints(base, self.unit)

    def distance(self, x: Array) -> float:
        """Distance of standard parameters from the prior."""
        change = x - self.prior
        return float(np.sqrt(max(change @ self.metric @ change, 0.0)))

    def bodies(self, margin: float) -> tuple[Constraint, ...]:
        """What the pseudo-inertia of each link must meet."""
        p, found = len(self.prior), []
        floor = -margin * triangle_of(np.eye(4))
        for j, maps in enumerate(self.maps):
            rows = np.zeros((10, p))
            rows[:, 10 * j : 10 * j + 10] = -triangle_of(maps.T.reshape(10, 4, 4)).T
            said = f"The pseudo-inertia of link {j + 1} is singular to the margin."
            found.append(Constraint(Cone.SEMIDEFINITE, rows, floor, (said,)))
        return tuple(found)

    def nearest_to_prior(self, b: Array) -> tuple[Array, ConeOutcome]:
        """Nearest parameters with given base parameters."""
        M = self.base.matrix
        found = self.nearest(M, b, size=self.size(b))
        return found.x, found.outcome

    def nearest(
        self, E: Array, e: Array, bounds: tuple[Constraint, ...] = (), size: float = 1.0
    ) -> ConeSolution:
        """Nearest parameters with ``E x = e``."""
        scale = 1.0 / np.maximum(np.abs(E * self.unit).max(axis=1, initial=0.0), 1e-300)
        kept = Constraint(Cone.ZERO, E * scale[:, None], e * scale, ("",) * len(e))
        found = solve_cones(
            self.metric, -self.metric @ self.prior,
            (kept, *self.drives, *self.bodies(self.margin), *bounds), self.unit, size,
        )  # fmt: skip
        if found.outcome is not ConeOutcome.SOLVED:
            return found
        # the solver's last digits, then signs that rounding has turned
        x = found.x + self.unit * (np.linalg.pinv(E * self.unit) @ (e - E @ found.x))
        return ConeSolution(self.with_signs(x), found.multipliers, found.outcome)

    def is_met(self, x: Array) -> bool:
        """Whether standard parameters are those of real bodies and drives already."""
        if (self.drives[0].slack(x) < 0.0).any():
            return False
        if any(block.least(x) < -_EVEN * block.largest(x) for block in self.blocks):
            return False
        whitened = [
            (maps @ x[10 * j : 10 * j + 10]).reshape(4, 4) for j, maps in enumerate(self.maps)
        ]
        return all(np.linalg.eigvalsh(P)[0] >= self.margin for P in whitened)

    def with_signs(self, x: Array) -> Array:
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
        found = solve_cones(
            H + weight * self.metric, g, (*self.drives, *self.bodies(_SLACK * self.margin)),
            self.unit, self.size(b),
        )  # fmt: skip
        if found.outcome is not ConeOutcome.SOLVED:
            return found.x, ConeOutcome.FAILED
        x = self.with_signs(found.x)
        nearer, again = self.nearest_to_prior(self.base.matrix @ x)
        return (nearer, again) if again is ConeOutcome.SOLVED else (x, ConeOutcome.SOLVED)

    def size(self, b: Array) -> float:
        """How much greater than those of the prior base parameters are; the solver's unit."""
        M = self.base.matrix
        natural = np.sqrt(((M * self.unit) ** 2).sum(axis=1))
        return max(1.0, float(np.abs(b / np.where(natural > 0, natural, 1.0)).max(initial=0.0)))
