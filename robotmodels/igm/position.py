"""Three joints that bring the tool to a position: Pieper's quartic alone.

Any order of revolute and prismatic joints. Redundant arms (parallel axes in a plane, axes that
coincide) are left to the solvers with virtual joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import Array
from .loop import JointChain
from .motion import jacobians, random_postures
from .postures import Postures, no_postures
from .solver import Tolerances, postures

POSITION = (True, True, True, False, False, False)
MOST = 4  # solutions of one position
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
    from .kernels.pieper import position_solutions, scratch

    chain = solver.chain
    found = no_postures(len(U), MOST, 3)
    position_solutions(
        chain.sigma,
        chain.D,
        np.ascontiguousarray(U[:, :3, 3]),
        np.ascontiguousarray(references),
        solver.size,
        max(1e-12, tolerances.position / solver.size),
        tolerances.position,
        scratch(),
        found.q,
        found.valid,
        found.residual,
        found.double,
        found.free,
    )
    found.family[...] = found.free.any(axis=-1)
    return found
