"""Constraints on the joints: requested components of a pose, and linear relations of joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, reduce
from math import gcd
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, read_only
from .loop import JointChain
from .motion import lever

if TYPE_CHECKING:
    from .kernels.damped import Problem

PATH = (1e-10, 1e-10)
"""Errors of configurations on a self-motion [m, rad]."""


@dataclass(frozen=True, slots=True)
class Components:
    """Requested components ``x y z rx ry rz`` of the displacement to the desired pose."""

    requested: tuple[bool, ...] = (True,) * 6
    in_tool_axes: bool = False

    @property
    def freed_translations(self) -> tuple[int, ...]:
        """Axes along which the position is not requested."""
        return tuple(i for i in range(3) if not self.requested[i])

    @property
    def freed_rotations(self) -> tuple[int, ...]:
        """Axes about which the rotation is not requested."""
        return tuple(i for i in range(3) if not self.requested[3 + i])


WHOLE = Components()


def mask_axes(chain: JointChain, U: Array, components: Components) -> Array:
    """The axes of the mask in R_0, columns of a rotation, shape (N, 3, 3)."""
    if components.in_tool_axes:
        return U[:, :3, :3]
    return np.broadcast_to(chain.base[:3, :3].T, (len(U), 3, 3))


@dataclass(frozen=True, slots=True, eq=False)
class Constraints:
    """Requested components of a pose and relations ``A q = b``. Shapes: A (m, k), b (m,).

    ``length`` is the unit of lengths in which errors are compared [m].
    """

    chain: JointChain
    components: Components
    A: Array
    b: Array
    length: float

    @property
    def weight(self) -> Array:
        """Weights (6 + m,) of the errors: of requested components, else 0; of the relations."""
        pose = np.where(self.components.requested, [1.0 / self.length] * 3 + [1.0] * 3, 0.0)
        return np.concatenate([pose, np.ones(len(self.b))])

    def descents(
        self,
        U: Array,
        starts: Array,
        steps: int,
        patience: float,
        held: Sequence[int] = (),
        weight: Array | None = None,
        bounds: Array | None = None,
        tolerances: tuple[float, float] = PATH,
    ) -> tuple[Array, Array, Array]:
        """Configurations by Levenberg-Marquardt, their errors and minus the derivative of these.

        Shapes: U (N, 4, 4), starts (N, R, k), which are tried until one meets the constraints;
        bounds (2, k) -> (N, k), (N, 6 + m), (N, 6 + m, k).
        """
        from .kernels.damped import damped_searches

        N, _, k = starts.shape
        rows = 6 + len(self.b)
        problem = _problem(self)._replace(tolerance=read_only(tolerances))
        if len(held):
            problem = problem._replace(held=read_only(np.isin(np.arange(k), held), np.int64))
        if weight is not None:
            problem = problem._replace(weight=read_only(weight))
        if bounds is not None:
            problem = problem._replace(bounds=read_only(bounds))
        q, e, J = np.empty((N, k)), np.empty((N, rows)), np.empty((N, rows, k))
        axes = np.ascontiguousarray(mask_axes(self.chain, U, self.components))
        goals, starts = np.ascontiguousarray(U), np.ascontiguousarray(starts)
        damped_searches(problem, goals, axes, starts, steps, patience, q, e, J)
        return q, e, J

    def jacobians(self, U: Array, q: Array) -> Array:
        """Minus the derivative of the requested errors, lengths in units of the arm, (N, r, k)."""
        J, weight = self.descents(U, q[:, None], 0, 1.0)[2], self.weight
        return (weight[:, None] * J)[:, weight > 0.0]

    def sizes(self, e: Array) -> tuple[Array, Array]:
        """Position [m] and angle [rad] that are missing, of errors (N, 6 + m), each (N,)."""
        x, y, z, a, b, c = (e[:, :6] * self.components.requested).T
        return np.hypot(np.hypot(x, y), z), np.hypot(np.hypot(a, b), c)

    def met(
        self, U: Array, q: Array, tolerances: tuple[float, float]
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Residuals [m or rad] and whether configurations meet the constraints, each (N,)."""
        e = self.descents(U, q[:, None], 0, 1.0)[1]
        away, turned = self.sizes(e)
        related = np.abs(e[:, 6:]).max(axis=1, initial=0.0) <= 1e-9
        residual = np.maximum(away, turned)
        return residual, (away <= tolerances[0]) & (turned <= tolerances[1]) & related


def constraints(chain: JointChain, components: Components = WHOLE) -> Constraints:
    """Constraints of a pose without relations."""
    return Constraints(chain, components, np.zeros((0, chain.k)), np.zeros(0), lever(chain))


@lru_cache(maxsize=64)
def _problem(wanted: Constraints) -> Problem:
    """The constraints as the kernel takes them."""
    from .kernels.damped import Problem

    chain, period = wanted.chain, np.zeros(len(wanted.b))
    # a relation with whole coefficients of angles holds modulo a turn
    for i, row in enumerate(wanted.A[:, chain.sigma == 0]):
        used = row[row != 0.0]
        if used.size and np.array_equal(used, np.round(used)) and np.abs(used).max() < 1e6:
            period[i] = 2.0 * np.pi * reduce(gcd, (int(abs(a)) for a in used))
    anywhere = np.repeat([[-np.inf], [np.inf]], chain.k, axis=1)
    unit = np.where(chain.sigma == 0, 1.0, 1.0 / wanted.length)
    numbers = [wanted.weight, wanted.A, wanted.b, period, PATH, anywhere, unit]
    held = read_only(np.zeros(chain.k), np.int64)
    sigma = read_only(chain.sigma, np.int64)
    D, *others = map(read_only, [chain.D, *numbers])
    return Problem(sigma, D, *others, held)  # type: ignore[call-arg]


def in_half_open_turn(sigma: NDArray[np.int64], q: Array) -> Array:
    """Configurations with angles in (-pi, pi]."""
    return np.where(sigma == 0, np.pi - (np.pi - q) % (2.0 * np.pi), q)
