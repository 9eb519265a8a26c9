"""The 24 ways to write the loop of six joints for the elimination.

Which of the joints plays which part is free: any joint may be the one that drops out, its two
neighbours to one side the pair that is eliminated linearly, and of the other three an outer one
gives the eigenvalues. The ways are equal in theory and far from it in rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ... import se3
from ..._arrays import Array, read_only


@dataclass(frozen=True, slots=True, eq=False)
class Representation:
    """One of the 24 ways to write the loop of six joints for the elimination.

    Shapes: joints, kinds (6,); links (6, 4, 4).
    """

    joints: NDArray[np.int64]
    kinds: NDArray[np.int64]
    direction: int
    links: Array
    closing: int
    swapped: bool


def all_representations(sigma: NDArray[np.int64], D: Array) -> list[Representation]:
    """The 24 ways to write the loop, without those that put a prismatic joint where none may be."""
    found = []
    inverse = se3.inverse(D)
    for direction in (1, -1):
        for start in range(6):
            joints = (start + direction * np.arange(6)) % 6
            kinds = sigma[joints]
            # the eigenvalue is an angle, and only a revolute joint leaves a line in place
            if kinds[2] == 1 or kinds[5] == 1:
                continue
            # the link after a joint; where the loop closes it is replaced pose by pose
            links = np.array([D[j + 1] if direction == 1 else inverse[j] for j in joints])
            closing = int(np.flatnonzero(joints == (5 if direction == 1 else 0))[0])
            found += [
                Representation(
                    joints=read_only(joints, np.int64),
                    kinds=read_only(kinds, np.int64),
                    direction=direction,
                    links=read_only(links),
                    closing=closing,
                    swapped=swapped,
                )
                for swapped in (False, True)
            ]
    return found


def closing_links(D: Array, direction: int, goals: Array) -> Array:
    """The links that close the loop through the poses, shape (N, 4, 4)."""
    if direction == 1:
        return np.ascontiguousarray(D[6] @ se3.inverse(goals) @ D[0])
    return np.ascontiguousarray(se3.inverse(D[0]) @ goals @ se3.inverse(D[6]))
