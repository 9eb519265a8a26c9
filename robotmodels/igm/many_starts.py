"""Arms that no closed form serves: Newton's method from many starts, for want of better."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import Array
from .loop import JointChain
from .motion import random_postures
from .solver import Found, Tolerances, nothing_found, postures
from .thorough import MET

STARTS = 300
"""Random postures from which every pose is sought."""
MOST = 32


@dataclass(frozen=True, slots=True, eq=False)
class ManyStarts:
    """Six-joint arm solved by Newton's method from many starts. Shapes: starts (STARTS, 6)."""

    chain: JointChain
    starts: Array

    @property
    def method(self) -> str:
        """The family, in words."""
        return f"Newton's method from {len(self.starts)} starts: postures may be missing"


def prepare_many_starts(chain: JointChain) -> ManyStarts | None:
    """Draw the starts for an arm of six joints, None for another."""
    if chain.k != 6:
        return None
    return ManyStarts(chain, random_postures(chain, STARTS, np.random.default_rng(0)))


@postures.register
def _(solver: ManyStarts, U: Array, references: Array, tolerances: Tolerances) -> Found:
    from ._thorough import home_postures

    chain, N = solver.chain, len(U)
    found = nothing_found(N, MOST, chain.k)
    accepted = np.array([MET, min(tolerances)])
    sigma, every = np.ascontiguousarray(chain.sigma), np.ones((1, STARTS + 1), np.bool_)
    for n in range(N):
        starts = np.concatenate([references[n : n + 1], solver.starts])[None]
        row = slice(n, n + 1)
        home_postures(
            np.ascontiguousarray(U[row]), sigma, chain.D, starts, every, accepted,
            found.q[row], found.valid[row], found.residual[row],
        )  # fmt: skip
    return found
