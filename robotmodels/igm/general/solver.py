"""What the elimination knows of an arm, and how well it suits it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from .representation import Representation


@dataclass(frozen=True, slots=True, eq=False)
class GeneralSolver:
    """Prepared elimination of a six-joint arm with the results of its self-test.

    Shapes: sigma (6,), D (7, 4, 4).
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
