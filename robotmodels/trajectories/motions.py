"""Motions whose pieces are polynomials of time, or functions of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from math import factorial
from typing import Any

import numpy as np

from .._arrays import Array, Value, read_only
from ..errors import InvalidValueError, ShapeError

_ROUNDING = 1e-9  # jumps smaller than this beside the largest value are put down to rounding
_STENCIL = 7
_SPACING = 5e-3  # of the duration: balances truncation and rounding of two derivatives
_SAMPLES = 4001
_JUMP = 1e-6  # of the largest value: smaller jumps are put down to rounding
_INSIDE = np.linspace(0.0, 1.0 - 1e-7, 6)  # of a piece of a law: where extremes are sought


class Motion(Value, ABC):
    """Functions of time for n joints, of which a `Trajectory` is made."""

    __slots__ = ()
    n: int
    """Number of joints."""
    duration: float
    """Seconds."""

    @abstractmethod
    def derivatives(self, t: Array, orders: tuple[int, ...]) -> list[Array]:
        """Derivatives (N, n) of the orders at times (N,) within the duration."""

    def extremes(self, order: int) -> tuple[Array, Array]:
        """Least and greatest value (n,) of a derivative; infinite where the one below jumps."""
        low, high = self._ends(order)
        if order:
            down, up = self.jumps(order - 1)
            low, high = np.where(down, -np.inf, low), np.where(up, np.inf, high)
        return low, high

    def _ends(self, order: int) -> tuple[Array, Array]:
        """Least and greatest value (n,) of a derivative between jumps, here of samples."""
        (values,) = self.derivatives(self._samples, (order,))
        return values.min(axis=0), values.max(axis=0)

    @property
    def _samples(self) -> Array:
        """Times (N,) at which extremes are sought."""
        return np.linspace(0.0, self.duration, _SAMPLES)

    def jumps(self, order: int) -> tuple[Any, Any]:
        """Whether a derivative jumps down, and up, inside the motion, (n,); here smooth."""
        return np.zeros(self.n, np.bool_), np.zeros(self.n, np.bool_)


@dataclass(frozen=True, slots=True, eq=False)
class PiecewisePolynomial(Motion):
    """Polynomials of the normalised time of each piece; joints share one clock or have their own.

    Shapes: breaks (1 or n, K + 1), coefficients (K, d + 1, n), lengths (1 or n, K).
    """

    breaks: Array
    coefficients: Array
    lengths: Array = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        lengths = np.diff(self.breaks) if self.lengths is None else self.lengths
        values = (self.breaks, self.coefficients, lengths)
        for name, value in zip(("breaks", "coefficients", "lengths"), values, strict=True):
            object.__setattr__(self, name, read_only(value))

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.coefficients.shape[-1]

    @property
    def duration(self) -> float:
        """Seconds."""
        return float(self.breaks[:, -1].max())

    def derivatives(self, t: Array, orders: tuple[int, ...]) -> list[Array]:
        """Derivatives (N, n) at times (N,) inside the motion."""
        from ..kernels.piecewise_polynomials import piecewise_derivatives

        out = np.empty((len(orders), 1, t.size, self.n))
        rows = (
            np.ascontiguousarray(x)[None] for x in (t, self.breaks, self.lengths, self.coefficients)
        )
        piecewise_derivatives(*rows, np.asarray(orders, np.int64), out)
        return list(out[:, 0])

    def _ends(self, order: int) -> tuple[Array, Array]:
        """Least and greatest value of a derivative over the motion, exact on every piece."""
        live = self.lengths.T > 0.0
        low, high = ranges_of_pieces(self.coefficients, self.lengths.T, order)
        low = np.where(live, low, np.inf).min(axis=0)
        high = np.where(live, high, -np.inf).max(axis=0)
        # a motion without duration stays at its start
        still = self.coefficients[0, 0] if order == 0 else 0.0
        low, high = (np.where(live.any(axis=0), x, still) for x in (low, high))
        return low, high

    def jumps(self, order: int) -> tuple[Any, Any]:
        """Whether a derivative jumps down, and up, between pieces beyond rounding, (n,)."""
        c = _in_time(self.coefficients, self.lengths.T, order)
        live = np.broadcast_to(self.lengths.T > 0.0, c[:, 0].shape)
        jumps = np.zeros((2, self.n))
        for j, (on, of) in enumerate(zip(live.T, np.moveaxis(c, -1, 0), strict=True)):
            jump = of[on][1:, 0] - of[on][:-1].sum(axis=1)
            size = _ROUNDING * np.abs(of[on]).sum(axis=1).max(initial=0.0)
            jumps[:, j] = jump.min(initial=0.0) < -size, jump.max(initial=0.0) > size
        return jumps[0] > 0.0, jumps[1] > 0.0


def _in_time(c: Array, h: Array, order: int) -> Array:
    """Coefficients (K, d + 1, n) of derivatives by time, pieces of lengths (K, 1 or n)."""
    step = np.where(h > 0.0, h, 1.0)[:, None]
    for _ in range(order):  # divided one by one, as the power of a step may vanish
        if c.shape[1] == 1:
            return np.zeros_like(c)
        c = c[:, 1:] * np.arange(1.0, c.shape[1])[:, None] / step
    return c


def ranges_of_pieces(c: Array, h: Array, order: int) -> tuple[Array, Array]:
    """Least and greatest value (K, n) of a derivative on each piece, of lengths h (K, 1 or n)."""
    from scipy.interpolate import PPoly

    c = np.where(h[:, None] > 0.0, _in_time(c, h, order), 0.0)
    ends = np.stack((c[:, 0], c.sum(axis=1)))
    low, high = ends.min(axis=0), ends.max(axis=0)
    if c.shape[1] < 3:
        return low, high
    for j in range(c.shape[2]):  # one by one: SciPy drops a root that the joint before has too
        # pieces side by side, each over its own normalised time
        curve = PPoly(c[:, ::-1, j].T, np.arange(len(c) + 1.0))
        x = curve.derivative().roots(discontinuity=False, extrapolate=False)
        x = x[np.isfinite(x)]
        piece, y = np.floor(x).astype(int).clip(max=len(c) - 1), curve(x)
        np.minimum.at(low[:, j], piece, y)
        np.maximum.at(high[:, j], piece, y)
    return low, high


@dataclass(frozen=True, slots=True, eq=False)
class FunctionMotion(Motion):
    """Position and the derivatives that are known, as functions t (N,) -> (N, n) or (N,)."""

    functions: tuple[Callable[[Array], Any], ...]
    duration: float
    n: int

    def derivatives(self, t: Array, orders: tuple[int, ...]) -> list[Array]:
        """Derivatives at times (N,); those not given by differences of the last one given."""
        last = len(self.functions) - 1
        return [
            self._value(order, t) if order <= last else self._difference(t, last, order - last)
            for order in orders
        ]

    def _value(self, order: int, t: Array) -> Array:
        name = ("q", "v", "a", "jerk")[order]
        given = np.asarray(self.functions[order](t), dtype=np.float64)
        if given.shape not in ((t.size, self.n), (t.size,) if self.n == 1 else ()):
            raise ShapeError(
                f"{name}: expected an array ({t.size}, {self.n}) for {t.size} times, got shape "
                f"{given.shape}."
            )
        if not np.isfinite(given).all():
            at = t[~np.isfinite(given.reshape(t.size, self.n)).all(axis=1)][0]
            raise InvalidValueError(f"{name}: expected finite values, got NaN at {at:g} s.")
        return given.reshape(t.size, self.n)

    def _difference(self, t: Array, order: int, k: int) -> Array:
        """Derivative k of the polynomial through seven values around each time."""
        h, half = _SPACING * self.duration, _STENCIL // 2
        steps = np.arange(-half, half + 1.0)
        middle = np.clip(t, half * h, self.duration - half * h)
        x = (t - middle) / h
        values = self._value(order, (middle[:, None] + h * steps).reshape(-1))
        values = values.reshape(t.size, _STENCIL, self.n)
        powers = np.arange(k, _STENCIL)
        rates = np.array([factorial(p) / factorial(p - k) for p in powers])
        weights = (x[:, None] ** (powers - k) * rates) @ np.linalg.inv(
            steps[:, None] ** np.arange(_STENCIL)
        )[k:]
        return np.einsum("ij,ijn->in", weights, values) / h**k


@dataclass(frozen=True, slots=True, eq=False)
class TimedMotion(Motion):
    """A path and a law of time: the path's parameter s as piecewise polynomial of time."""

    path: Motion
    law: PiecewisePolynomial

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.path.n

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.law.duration

    def derivatives(self, t: Array, orders: tuple[int, ...]) -> list[Array]:
        """Derivatives at times (N,), by the chain rule."""
        every = tuple(range(max(orders) + 1))
        s, *r = self.law.derivatives(t, every)
        q = self.path.derivatives(np.clip(s[:, 0], 0.0, self.path.duration), every)
        found = {0: lambda: q[0], 1: lambda: q[1] * r[0]}
        found[2] = lambda: q[2] * r[0] ** 2 + q[1] * r[1]
        found[3] = lambda: q[3] * r[0] ** 3 + 3.0 * q[2] * r[0] * r[1] + q[1] * r[2]
        return [found[order]() for order in orders]

    def jumps(self, order: int) -> tuple[Any, Any]:
        """Whether a derivative jumps down, and up, between the pieces of the law."""
        (x,) = self.derivatives(self._samples, (order,))
        ends = x.reshape(-1, _INSIDE.size, self.n)[:, [0, -1]]
        jump = np.append(ends[1:, 0] - ends[:-1, 1], np.zeros((1, self.n)), axis=0)
        size = _JUMP * np.abs(x).max()
        return jump.min(axis=0) < -size, jump.max(axis=0) > size

    @property
    def _samples(self) -> Array:
        """Times inside the pieces of the law, six each."""
        live = self.law.lengths[0] > 0.0
        begin, lengths = self.law.breaks[0, :-1][live], self.law.lengths[0, live]
        return (begin[:, None] + lengths[:, None] * _INSIDE).reshape(-1)
