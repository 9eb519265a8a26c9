"""What the elimination knows of an arm, and how well it suits it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from .representation import Representation


@dataclass(frozen=True, slots=True, eq=False)
class GeneralSolver:
    """What `general_postures` needs to know of an arm, and how well the method suits it.

    Parameters
    ----------
    sigma : ndarray of int, shape (6,)
        0 revolute, 1 prismatic.
    D : ndarray, shape (7, 4, 4)
        Constants of the chain, lengths in ``unit``.
    unit : float
        Length by which lengths are divided [m].
    representations : tuple of Representation
        The first is used for every pose, the others in turn where doubts are left.
    conditioning : float
        How far rounding had moved the roots of the first representation before they were
        polished, 90 of 100 in the self-test [rad]. 1e-11 or so for a general arm.
    tested : int
        Poses of the self-test.
    doubts : int
        How many of them the first representation did not settle alone. Few for a general arm;
        most for one with a spherical wrist or three parallel axes.
    misses : int
        How many did not give back the posture they came from.
    odd : int
        How many had an odd number of postures, which a missing one explains.
    """

    sigma: NDArray[np.int64]
    D: Array
    unit: float
    representations: tuple[Representation, ...]
    conditioning: float
    tested: int
    doubts: int
    misses: int
    odd: int

    @property
    def reliable(self) -> bool:
        """Whether the self-test found every posture, and most at the first attempt."""
        return self.misses == 0 and 4 * self.doubts <= self.tested and self.conditioning < 1e-6
