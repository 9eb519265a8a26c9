"""Three joints that bring the tool to a position: Pieper's quartic alone.

Any order of revolute and prismatic joints. Redundant arms (parallel axes in a plane, axes that
coincide) are left to the solvers with virtual joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .loop import JointChain
from .motion import jacobians, random_postures
from .postures import Postures
from .solver import Tolerances, postures

POSITION = (True, True, True, False, False, False)
MOST = 4  # solutions of one position
DOUBLE = 8  # mark of a double root
INDEPENDENT = 1e-6  # singular values of a Jacobian beside the largest that count as zero


@dataclass(frozen=True, slots=True, eq=False)
class PositionArm:
    """Three joints for a position; ``size`` is the length of the arm [m]."""

    chain: JointChain
    size: float

    @property
    def method(self) -> str:
        """The solver in words."""
        return "three joints for a position: quartic (Pieper)"


def prepare_position(chain: JointChain) -> PositionArm | None:
    """The solver of three joints that move the tool in all directions, None for other chains."""
    if chain.k != 3:
        return None
    size = float(np.linalg.norm(chain.D[1:, :3, 3], axis=1).sum()) or 1.0
    J = jacobians(chain, random_postures(chain, 8, np.random.default_rng(0)))[:, :3]
    s = np.linalg.svd(J / np.where(chain.sigma == 0, size, 1.0), compute_uv=False)
    return PositionArm(chain, size) if (s[:, 2] > INDEPENDENT * s[:, 0]).any() else None


@postures.register
def _(solver: PositionArm, U: Array, references: Array, tolerances: Tolerances) -> Postures:
    chain, size = solver.chain, solver.size
    q, residual, marks = solved_positions(
        chain.sigma, chain.D, U[:, :3, 3], references, size,
        max(1e-12, tolerances.position / size), tolerances.position,
    )  # fmt: skip
    free = (marks[..., None] >> np.arange(3)) & 1 == 1
    valid = marks >= 0
    free &= valid[..., None]
    return Postures(q, valid, residual, valid & (marks >= DOUBLE), free, free.any(axis=-1))


def solved_positions(
    kinds: NDArray[np.int64],
    D: Array,
    points: Array,
    references: Array,
    *limits: float,
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Configurations of points ``(N, 3)`` of R_0; see `kernels.pieper.position_solutions`."""
    from .kernels import pieper

    N = len(points)
    out = np.full((N, MOST, 3), np.nan), np.full((N, MOST), np.nan), np.full((N, MOST), -1)
    rows = np.ascontiguousarray(points), np.ascontiguousarray(references)
    pieper.position_solutions(kinds, D, *rows, np.array(limits), pieper.scratch(), out)
    return out
