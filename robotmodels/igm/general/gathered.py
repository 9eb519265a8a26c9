"""Postures of several poses while they are gathered."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

ROOM = 48  # rows while solving: an infinite family takes any number, and must leave some


class Gathered:
    """Postures of N poses as they are gathered: q (N, 48, 6), count (N,), double (N, 48)."""

    def __init__(self, N: int) -> None:
        self.q = np.zeros((N, ROOM, 6))
        self.count = np.zeros(N, np.int64)
        self.double = np.zeros((N, ROOM), np.bool_)

    @property
    def there(self) -> NDArray[np.bool_]:
        """Rows in use, shape (N, 48)."""
        return np.arange(ROOM) < self.count[:, None]

    def rows(self, chosen: NDArray[np.int64]) -> Gathered:
        """A copy of some poses."""
        part = Gathered(0)
        part.q, part.count = self.q[chosen], self.count[chosen]
        part.double = self.double[chosen]
        return part

    def put(self, chosen: NDArray[np.int64], part: Gathered) -> None:
        """Write poses back."""
        self.q[chosen], self.count[chosen] = part.q, part.count
        self.double[chosen] = part.double
