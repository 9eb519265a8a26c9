"""Postures put together: see `postures`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .postures import MERGE, Postures, Rows, assembled

__all__ = ["MERGE", "assembled", "merged", "rows_of"]


def merged(sigma: NDArray[np.int64], found: Postures, within: float = MERGE) -> Postures:
    """Merge equal postures of each pose and pack the rows. Shapes: sigma (k,)."""
    return found.merge(sigma, within)


def rows_of(found: Postures, poses: Rows) -> Postures:
    """Postures of some of the poses."""
    return found.take(poses)
