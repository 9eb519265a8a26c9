"""Motions that are sums of given functions of time, times coefficients of each joint."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np

from ..._arrays import Array
from ...errors import InvalidValueError
from ...trajectories import Trajectory, fourier, fourier_basis, quintic_spline


class MotionKind(Enum):
    """Which functions an exciting trajectory is made of.

    Examples
    --------
    >>> MotionKind.SPLINE.value
    'quintic spline through points, closed'
    """

    FOURIER = "finite Fourier series"
    SPLINE = "quintic spline through points, closed"


@dataclass(frozen=True, eq=False)
class MotionBasis:
    """Functions of time whose sums are motions that end where they begin.

    Parameters
    ----------
    kind : MotionKind
        Fourier series or splines.
    duration : float
        Of one period, s.
    order : int
        Harmonics of a series, or free points of a spline.
    rest : bool
        Whether velocity and acceleration vanish at the ends: of a series by two linear equations
        for its coefficients, ``sum a_k = 0`` and ``sum k b_k = 0``; of a spline always.

    Raises
    ------
    InvalidValueError
        Fewer than two harmonics (one, if the ends move) or three points; a spline whose ends move.

    References
    ----------
    J. Swevers et al., Optimal robot excitation and identification, IEEE T-RA 13(5), 1997, eq. (12);
    K.-J. Park, Fourier-based optimal excitation trajectories for the dynamic identification of
    robots, Robotica 24(5), 2006.

    Examples
    --------
    >>> basis = MotionBasis(MotionKind.FOURIER, 10.0, 5)
    >>> basis.count, bool(abs(basis.at(np.zeros(1), 2)).max() < 1e-14)
    (9, True)
    """

    kind: MotionKind
    duration: float
    order: int
    rest: bool = True

    def __post_init__(self) -> None:
        least = 3 if self.kind is MotionKind.SPLINE else 2 if self.rest else 1
        if self.order < least:
            what = "points" if self.kind is MotionKind.SPLINE else "harmonics"
            raise InvalidValueError(f"{what}: expected at least {least} here, got {self.order}.")
        if self.kind is MotionKind.SPLINE and not self.rest:
            raise InvalidValueError("rest: a spline begins and ends at rest; take rest=True.")

    @property
    def count(self) -> int:
        """Number of functions P."""
        return self.mixing.shape[1]

    @cached_property
    def mixing(self) -> Array:
        """Coefficients of the series, or points, of each function, shape (2 H + 1 or K + 1, P)."""
        if self.kind is MotionKind.SPLINE:
            return np.vstack((np.eye(self.order), np.eye(self.order)[:1]))
        from scipy.linalg import block_diag, null_space

        H = self.order
        if not self.rest:
            return np.eye(2 * H + 1)
        k = np.arange(1.0, H + 1.0)
        parts = np.ones((1, 1)), null_space(np.ones((1, H))), null_space(k[None])
        return np.asarray(block_diag(*parts), dtype=np.float64)

    @cached_property
    def _splines(self) -> Trajectory:
        return quintic_spline(self.mixing, np.linspace(0.0, self.duration, self.order + 1))

    def at(self, t: Array, order: int = 0) -> Array:
        """The functions at times.

        Parameters
        ----------
        t : ndarray, shape (N,)
            Within the duration, s.
        order : int
            Derivative, 0 to 3.

        Returns
        -------
        ndarray, shape (N, P)
            A column for each function.
        """
        if self.kind is MotionKind.SPLINE:
            (value,) = self._splines.motion.derivatives(t, (order,))
            return value
        return fourier_basis(t, self.order, self.duration, order) @ self.mixing

    def trajectory(self, coefficients: Array) -> Trajectory:
        """The motion of coefficients.

        Parameters
        ----------
        coefficients : ndarray, shape (P, n)
            Of each function and joint, rad or m (rad/s or m/s of the harmonics).

        Returns
        -------
        Trajectory
            Of n joints; a series is periodic.
        """
        full = self.mixing @ coefficients
        if self.kind is MotionKind.SPLINE:
            return quintic_spline(full, np.linspace(0.0, self.duration, self.order + 1))
        H = self.order
        return fourier(full[1 : H + 1], full[H + 1 :], full[0], self.duration)

    def centred(self, middle: Array) -> Array:
        """Coefficients of standing still.

        Parameters
        ----------
        middle : ndarray, shape (n,)
            Where, rad or m.

        Returns
        -------
        ndarray, shape (P, n)
            Coefficients.
        """
        still = np.zeros((self.count, middle.size))
        if self.kind is MotionKind.SPLINE:
            still[:] = middle
        else:
            still[0] = middle
        return still
