"""Periodic motions as linear combinations of basis functions of time.

A finite Fourier series (J. Swevers et al., Optimal robot excitation and identification, IEEE T-RA
13(5), 1997, eq. (12)) that may rest at its ends (K.-J. Park, Fourier-based optimal excitation
trajectories for the dynamic identification of robots, Robotica 24(5), 2006), or a closed quintic
spline through points at equal distances in time.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..._arrays import Array, Rebuilt, read_only
from ...errors import InvalidValueError
from ...trajectories import Trajectory, fourier, fourier_basis, quintic_spline

KINDS = {"fourier": "finite Fourier series", "spline": "quintic spline through points, closed"}


@dataclass(frozen=True, slots=True, eq=False)
class MotionBasis(Rebuilt):
    """Basis functions of periodic motions.

    ``order`` counts the harmonics of a series or the free points of a spline.
    """

    kind: str
    duration: float
    order: int
    rest: bool = True
    mixing: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        spline = self.kind == "spline"
        least = 3 if spline else 2 if self.rest else 1
        if self.order < least:
            name = "points" if spline else "harmonics"
            raise InvalidValueError(f"{name}: expected at least {least} here, got {self.order}.")
        if spline and not self.rest:
            raise InvalidValueError("rest: a spline begins and ends at rest; take rest=True.")
        object.__setattr__(self, "mixing", read_only(self._mixing()))

    def _mixing(self) -> Array:
        """Coefficients of the series, or points, of each function, (2 H + 1 or K + 1, P)."""
        from scipy.linalg import block_diag, null_space

        H = self.order
        if self.kind == "spline":
            return np.vstack((np.eye(H), np.eye(H)[:1]))
        if not self.rest:
            return np.eye(2 * H + 1)
        # at rest at the ends: sum a_k = 0 and sum k b_k = 0
        k = np.arange(1.0, H + 1.0)
        parts = np.ones((1, 1)), null_space(np.ones((1, H))), null_space(k[None])
        return np.asarray(block_diag(*parts), dtype=np.float64)

    @property
    def count(self) -> int:
        """Number of functions P."""
        return self.mixing.shape[1]

    def at(self, t: Array, order: int = 0) -> Array:
        """Derivatives of the functions at times. Shapes: t (N,) -> (N, P)."""
        if self.kind == "spline":
            (value,) = self.trajectory(np.eye(self.count)).motion.derivatives(t, (order,))
            return value
        return fourier_basis(t, self.order, self.duration, order) @ self.mixing

    def arguments(self, coefficients: Array) -> tuple[str, dict[str, Any]]:
        """Generator in `trajectories` and its arguments for coefficients (P, n)."""
        full, H = self.mixing @ coefficients, self.order
        if self.kind == "spline":
            times = np.linspace(0.0, self.duration, H + 1)
            return "quintic_spline", {"points": full, "times": times}
        a, b = full[1 : H + 1], full[H + 1 :]
        return "fourier", {"a": a, "b": b, "mean": full[0], "period": self.duration}

    def trajectory(self, coefficients: Array) -> Trajectory:
        """Motion of coefficients (P, n): rad or m (rad/s or m/s of the harmonics)."""
        name, arguments = self.arguments(coefficients)
        return {"fourier": fourier, "quintic_spline": quintic_spline}[name](**arguments)

    def constant(self, posture: Array) -> Array:
        """Coefficients of a motion that stays at a posture. Shapes: (n,) -> (P, n)."""
        still = np.zeros((self.count, posture.size))
        still[slice(None) if self.kind == "spline" else 0] = posture
        return still
