"""Arms that no closed form serves: Newton's method from many starts, for want of better."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import Array
from .check import checked
from .loop import JointChain
from .motion import random_postures
from .postures import assembled
from .solver import Found, Tolerances, postures

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
    chain, parts = solver.chain, []
    for n in range(len(U)):
        starts = np.concatenate([references[n : n + 1], solver.starts])[None]
        there = np.ones(starts.shape[:2], np.bool_)
        parts.append(
            checked(
                chain, U[n : n + 1], starts, there, tolerances, double=np.zeros_like(there),
                most=MOST, rough=np.inf, singular=True,
            )
        )  # fmt: skip
    return assembled(len(U), chain.k, ((np.array([n]), part) for n, part in enumerate(parts)))
