"""A chain with its frames slid towards each other, in units of the arm."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from .._arrays import Array, read_only
from .loop import JointChain


@lru_cache(maxsize=256)
def shortened(chain: JointChain) -> tuple[Array, float]:
    """Constants with each frame slid along its axis towards its neighbours, in units of the arm.

    Shapes: -> D (k + 1, 4, 4).
    """
    D, k = np.array(chain.D), chain.k
    for forward in (True, False):
        for i in range(1, k) if forward else range(k - 1, 0, -1):
            # joint frame i + 1 slides when going out, joint frame i when coming back
            near, far = (i, i + 1) if forward else (i, i - 1)
            z = D[near][:3, 2] if forward else np.array([0.0, 0.0, 1.0])
            slide = float(z @ D[near][:3, 3])
            if forward:
                D[near][:3, 3] -= slide * z
                D[far][2, 3] += slide
            else:
                D[near][2, 3] -= slide
                D[far][:3, 3] += slide * D[far][:3, 2]
    unit = float(np.sum(np.linalg.norm(D[1:k, :3, 3], axis=1))) / 2.0
    if unit < 1e-9:
        unit = 1.0
    D[:, :3, 3] /= unit
    return read_only(D), unit
