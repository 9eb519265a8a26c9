"""Motions by functions: of time, or of the parameter of a path that a law of time moves along."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import factorial
from typing import Any, Protocol

import numpy as np

from .._arrays import Array, Value
from ..errors import InvalidValueError, ShapeError
from .piecewise import PiecewisePolynomial

_STENCIL = 7
_SPACING = 5e-3  # of the duration: balances truncation and rounding of two derivatives
_SAMPLES = 4001
_JUMP = 1e-6  # of the largest value: smaller jumps are put down to rounding
_INSIDE = np.linspace(0.0, 1.0 - 1e-7, 6)  # of a piece of a law: where extremes are sought


class Motion(Protocol):
    """Functions of time for n joints, of which a `Trajectory` is made."""

    @property
    def n(self) -> int:
        """Number of joints."""
        ...

    @property
    def batch(self) -> tuple[int, ...]:
        """Leading axes: one motion each."""
        ...

    @property
    def duration(self) -> Array:
        """Durations, s, shape (...)."""
        ...

    def derivatives(self, t: Array, orders: tuple[int, ...]) -> list[Array]:
        """Derivatives (..., N, n) of the orders at times (..., N) within the duration."""
        ...

    def extremes(self, order: int) -> tuple[Array, Array]:
        """Least and greatest value (..., n) of a derivative over the motion."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class FunctionMotion(Value):
    """Position and the derivatives that are known, as functions t (N,) -> (N, n) or (N,)."""

    functions: tuple[Callable[[Array], Any], ...]
    end: float
    n: int

    @property
    def batch(self) -> tuple[int, ...]:
        """One motion."""
        return ()

    @property
    def duration(self) -> Array:
        """Seconds."""
        return np.asarray(self.end)

    def derivatives(self, t: Array, orders: tuple[int, ...]) -> list[Array]:
        """Derivatives at times (N,); those not given by differences of the last one given."""
        last = len(self.functions) - 1
        return [
            self._value(order, t) if order <= last else self._difference(t, last, order - last)
            for order in orders
        ]

    def extremes(self, order: int) -> tuple[Array, Array]:
        """Least and greatest value at samples."""
        (values,) = self.derivatives(np.linspace(0.0, self.end, _SAMPLES), (order,))
        return values.min(axis=0), values.max(axis=0)

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
        h, half = _SPACING * self.end, _STENCIL // 2
        steps = np.arange(-half, half + 1.0)
        middle = np.clip(t, half * h, self.end - half * h)
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
class TimedMotion(Value):
    """A path and a law of time: the path's parameter s as piecewise polynomial of time."""

    path: Motion
    law: PiecewisePolynomial

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.path.n

    @property
    def batch(self) -> tuple[int, ...]:
        """One motion."""
        return ()

    @property
    def duration(self) -> Array:
        """Seconds."""
        return self.law.duration

    def derivatives(self, t: Array, orders: tuple[int, ...]) -> list[Array]:
        """Derivatives at times (N,), by the chain rule."""
        s = [row[:, 0] for row in self.law.derivatives(t, tuple(range(max(orders) + 1)))]
        return self._chained(s, orders)

    def extremes(self, order: int) -> tuple[Array, Array]:
        """Least and greatest value at samples of each piece; infinite where the one below jumps."""
        live = self.law.lengths[0] > 0.0
        begin, lengths = self.law.breaks[0, :-1][live], self.law.lengths[0, live]
        t = (begin[:, None] + lengths[:, None] * _INSIDE).reshape(-1)
        *below, values = self.derivatives(t, (order - 1, order) if order else (0,))
        low, high = values.min(axis=0), values.max(axis=0)
        for x in below:
            ends = x.reshape(lengths.size, _INSIDE.size, self.n)[:, [0, -1]]
            jump = np.append(ends[1:, 0] - ends[:-1, 1], np.zeros((1, self.n)), axis=0)
            size = _JUMP * np.abs(x).max()
            low = np.where(jump.min(axis=0) < -size, -np.inf, low)
            high = np.where(jump.max(axis=0) > size, np.inf, high)
        return low, high

    def _chained(self, s: list[Array], orders: tuple[int, ...]) -> list[Array]:
        """Derivatives by time from those of s (k + 1 rows (N,)) and of the path."""
        end = float(self.path.duration)
        q = self.path.derivatives(np.clip(s[0], 0.0, end), tuple(range(max(orders) + 1)))
        r = [rate[:, None] for rate in s]
        found = {0: lambda: q[0], 1: lambda: q[1] * r[1]}
        found[2] = lambda: q[2] * r[1] ** 2 + q[1] * r[2]
        found[3] = lambda: q[3] * r[1] ** 3 + 3.0 * q[2] * r[1] * r[2] + q[1] * r[3]
        return [found[order]() for order in orders]
