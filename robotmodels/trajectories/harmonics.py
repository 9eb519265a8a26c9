"""Periodic motions as finite Fourier series, which excite robots for identification."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_count, as_floats, as_number, read_only
from ..errors import ShapeError
from .motions import Motion
from .trajectory import Trajectory

# what multiplies the cosines and the sines in q, v, a and jerk, apart from powers of k w
_TURNED: tuple[Callable[[Array, Array], tuple[Array, Array]], ...] = (
    lambda a, b: (-b, a),
    lambda a, b: (a, b),
    lambda a, b: (b, -a),
    lambda a, b: (-a, -b),
)
_GRID, _NEWTON = 16, 4  # points for each harmonic from which extremes are sought, and steps


@dataclass(frozen=True, slots=True, eq=False)
class FourierSeries(Motion):
    """Finite Fourier series of n joints, with period ``2 pi / w``.

    ``q = mean + sum_k (a_k sin(k w t) - b_k cos(k w t)) / (k w)``: ``a`` and ``b`` are the
    amplitudes of the velocity.

    Parameters
    ----------
    a, b, mean : array_like, shape (H, n), (H, n), (n,)
        Amplitudes of the velocity, rad/s or m/s, and middle of the motion, rad or m.
    period, periods : float
        Seconds, and how many of them the motion lasts.
    """

    period: float
    a: Array
    b: Array
    mean: Array
    periods: float = 1.0

    def __post_init__(self) -> None:
        a, b, mean = (as_floats(v, k) for v, k in ((self.a, "a"), (self.b, "b"),
                                                   (self.mean, "mean")))  # fmt: skip
        if a.ndim != 2 or a.shape != b.shape or mean.shape != a.shape[1:]:
            raise ShapeError(
                "a, b, mean: expected shapes (H, n), (H, n) and (n,), got "
                f"{a.shape}, {b.shape} and {mean.shape}."
            )
        for name in ("period", "periods"):
            object.__setattr__(self, name, as_number(getattr(self, name), name, above=0.0))
        for name, value in (("a", a), ("b", b), ("mean", mean)):
            object.__setattr__(self, name, read_only(value))

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.mean.size

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.period * self.periods

    def derivatives(self, t: Array, orders: tuple[int, ...]) -> list[Array]:
        """Derivatives (N, n) of the orders at times t (N,), s."""
        H = len(self.a)
        c, s = _waves(t, self.period, H)
        k = (2.0 * np.pi / self.period * np.arange(1, H + 1))[:, None]
        out = []
        for order in orders:
            of_c, of_s = (part * k ** (order - 1) for part in _TURNED[order % 4](self.a, self.b))
            value = c @ of_c
            value += s @ of_s
            if order == 0:
                value += self.mean
            out.append(value)
        return out

    def extremes(self, order: int) -> tuple[Array, Array]:
        """Least and greatest value (n,) of a derivative over a period: Newton steps from a grid."""
        start = np.linspace(0.0, self.period, _GRID * len(self.a) + 1)
        low, high = np.empty(self.n), np.empty(self.n)
        for j in range(self.n):
            t = start.copy()
            for _ in range(_NEWTON):
                first, second = (x[:, j] for x in self.derivatives(t, (order + 1, order + 2)))
                step = np.divide(first, second, out=np.zeros(t.size), where=np.abs(second) > 0.0)
                t -= np.clip(step, -start[1], start[1])
            (values,) = self.derivatives(np.concatenate((start, t)), (order,))
            low[j], high[j] = values[:, j].min(), values[:, j].max()
        return low, high


def fourier(
    a: ArrayLike, b: ArrayLike, mean: ArrayLike = 0.0, period: float = 10.0, periods: float = 1.0
) -> Trajectory:
    """Periodic motion, a finite Fourier series with analytic derivatives, defined at every time.

    Parameters
    ----------
    a, b, mean, period, periods
        As for `FourierSeries`; a and b (H,) for a scalar motion.

    References
    ----------
    Book section 1.6.2.3. J. Swevers, C. Ganseman, D. Tukel, J. De Schutter, H. Van Brussel,
    Optimal robot excitation and identification, IEEE T-RA 13(5), 1997.

    Examples
    --------
    >>> swing = fourier(a=[[1.0, 0.0]], b=[[0.0, 2.0]], mean=[0.0, 0.5], period=2 * np.pi)
    >>> swing.v(0.0), swing.q(np.pi / 2).round(12)
    (array([1., 0.]), array([1. , 0.5]))
    """
    a, b = as_floats(a, "a"), as_floats(b, "b")
    scalar = a.ndim == 1
    if scalar:
        a, b = a[:, None], b[:, None] if b.ndim == 1 else b
    mean = as_floats(mean, "mean")
    if mean.ndim == 0:
        mean = np.full(a.shape[-1:], float(mean))
    return Trajectory(FourierSeries(period, a, b, mean, periods), scalar, repeats=True)


def fourier_basis(t: ArrayLike, harmonics: int, period: float, order: int = 0) -> Array:
    """Basis of Fourier motions: the derivative of an order as a matrix of its own parameters.

    Parameters
    ----------
    t, harmonics, period : array_like, shape (N,), int, float
        Times, s, number H of harmonics, and period, s.
    order : int
        Derivative: 0 position, 1 velocity, and so on.

    Returns
    -------
    ndarray, shape (N, 2 H + 1)
        ``basis @ [mean, a_1 .. a_H, b_1 .. b_H]`` is the derivative.

    Examples
    --------
    >>> fourier_basis([0.0], harmonics=2, period=1.0, order=1)
    array([[0., 1., 1., 0., 0.]])
    """
    t = as_floats(t, "t")
    if t.ndim != 1:
        raise ShapeError(f"t: expected shape (N,), got {t.shape}.")
    H, order = as_count(harmonics, "harmonics", 1), as_count(order, "order", 0)
    one = np.eye(2 * H + 1)  # a series for each parameter
    series = FourierSeries(period, one[1 : H + 1], one[H + 1 :], one[0])
    return series.derivatives(t, (order,))[0]


def _waves(t: Array, period: float, H: int) -> tuple[Array, Array]:
    """Cosines and sines (N, H) of the harmonics; the time is brought into one period first."""
    angle = 2.0 * np.pi * np.remainder(t / period, 1.0)
    c, s = np.empty((H, t.size)), np.empty((H, t.size))
    c[:1], s[:1] = c1, s1 = np.cos(angle), np.sin(angle)
    for k in range(1, H):
        c[k] = c[k - 1] * c1 - s[k - 1] * s1
        s[k] = s[k - 1] * c1 + c[k - 1] * s1
    return c.T, s.T
