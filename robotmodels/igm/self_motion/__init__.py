"""Names of `singular` for files that are not moved yet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..loop import JointChain
from ..postures import Postures
from ..singular import complete as settle_families
from ..singular import singular_postures

__all__ = [
    "Settled",
    "double_roots",
    "replaced",
    "settle_families",
    "singular_postures",
]

Settled = Postures


def double_roots(chain: JointChain, found: Postures) -> NDArray[np.bool_]:
    """Flags (N, S) of double roots."""
    return singular_postures(chain, found)[0]


def replaced(
    whole: Postures, moving: NDArray[np.bool_], rows: NDArray[np.int64], part: Postures
) -> Postures:
    """The postures with those of some poses replaced."""
    return whole.put(rows, part)
