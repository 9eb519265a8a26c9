"""Motions whose pieces are polynomials of time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from math import factorial, prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
    duration: Array
    """Durations of the motions, s, shape (...)."""

    @property
    def batch(self) -> tuple[int, ...]:
        """Leading axes: one motion each."""
        return ()

    @abstractmethod
    def derivatives(self, t: Array, orders: tuple[int, ...]) -> list[Array]:
        """Derivatives (..., N, n) of the orders at times (..., N) within the duration."""

    def extremes(self, order: int) -> tuple[Array, Array]:
        """Least and greatest value (..., n) of a derivative, here of samples."""
        (values,) = self.derivatives(np.linspace(0.0, float(self.duration), _SAMPLES), (order,))
        return values.min(axis=0), values.max(axis=0)

    def jumps(self, order: int) -> tuple[Any, Any]:
        """Whether a derivative jumps down, and up, inside the motion, (..., n); here smooth."""
        return np.zeros(self.n, np.bool_), np.zeros(self.n, np.bool_)


@dataclass(frozen=True, slots=True, eq=False)
class PiecewisePolynomial(Motion):
    """Polynomials of the normalised time of each piece.

    Shapes: breaks (..., c, K + 1), coefficients (..., K, d + 1, n), lengths (..., c, K).
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
    def batch(self) -> tuple[int, ...]:
        """Leading axes: one motion each."""
        return self.coefficients.shape[:-3]

    @property
    def duration(self) -> Array:
        """Durations of the motions, s, shape (...)."""
        return self.breaks[..., -1].max(axis=-1)

    def derivatives(self, t: Array, orders: tuple[int, ...]) -> list[Array]:
        """Derivatives at times inside the motion. Shapes: t (..., N) -> (..., N, n)."""
        from ..kernels.piecewise_polynomials import piecewise_derivatives

        M, N, parts = prod(self.batch), t.shape[-1], (self.breaks, self.lengths, self.coefficients)
        breaks, lengths, c = (x.reshape(M, *x.shape[len(self.batch) :]) for x in parts)
        out = np.empty((len(orders), M, N, self.n))
        times = np.ascontiguousarray(t).reshape(M, N)
        piecewise_derivatives(times, breaks, lengths, c, np.asarray(orders, np.int64), out)
        return [values.reshape(*t.shape, self.n) for values in out]

    def extremes(self, order: int) -> tuple[Array, Array]:
        """Least and greatest value of a derivative over the motion, exact on every piece."""
        live, step = self._steps
        low, high = _range_on_unit_interval(_in_time(self.coefficients, step, order))
        none = ~live.any(axis=-2)
        low = np.where(live, low, np.inf).min(axis=-2)
        high = np.where(live, high, -np.inf).max(axis=-2)
        if none.any():  # a motion without duration stays at its start
            still = self.coefficients[..., 0, 0, :] if order == 0 else 0.0
            low, high = np.where(none, still, low), np.where(none, still, high)
        if order > 0:
            down, up = self.jumps(order - 1)
            low, high = np.where(down, -np.inf, low), np.where(up, np.inf, high)
        return low, high

    @property
    def _steps(self) -> tuple[NDArray[np.bool_], Array]:
        """Whether pieces last, and their lengths or 1, each (..., K, c)."""
        h = np.swapaxes(self.lengths, -1, -2)
        return h > 0.0, np.where(h > 0.0, h, 1.0)

    def jumps(self, order: int) -> tuple[Any, Any]:
        """Whether a derivative jumps down, and up, between pieces beyond rounding, (..., n)."""
        live, step = self._steps
        c = _in_time(self.coefficients, step, order)
        first, last = c[..., 0, :], c.sum(axis=-2)
        live = np.broadcast_to(live, first.shape)
        scale = np.abs(np.where(live[..., None, :], c, 0.0)).sum(axis=-2).max(axis=-2)
        before, started = last[..., 0, :], live[..., 0, :]
        down, up = np.zeros(before.shape), np.zeros(before.shape)
        for k in range(1, c.shape[-3]):
            jump = np.where(live[..., k, :] & started, first[..., k, :] - before, 0.0)
            down, up = np.minimum(down, jump), np.maximum(up, jump)
            before = np.where(live[..., k, :], last[..., k, :], before)
            started = started | live[..., k, :]
        return down < -_ROUNDING * scale, up > _ROUNDING * scale


def _derived(c: Array) -> Array:
    """Coefficients of the derivative with respect to x; the powers are the last axis but one."""
    return c[..., 1:, :] * np.arange(1.0, c.shape[-2])[:, None]


def _in_time(c: Array, step: Array, order: int) -> Array:
    """Derivatives by time; divided one by one, as the power of a step may vanish."""
    for _ in range(order):
        c = _derived(c) / step[..., None, :] if c.shape[-2] > 1 else np.zeros_like(c)
    return c


def _range_on_unit_interval(c: Array) -> tuple[Array, Array]:
    """Least and greatest value on [0, 1] of polynomials (..., d + 1, n), shapes (..., n)."""
    ends = np.stack((c[..., 0, :], c.sum(axis=-2)))
    low, high = ends.min(axis=0), ends.max(axis=0)
    if c.shape[-2] < 3:
        return low, high
    x = _real_roots(np.moveaxis(_derived(c), -2, -1))  # (..., n, d - 1)
    y = np.zeros(x.shape)
    for part in np.moveaxis(c, -2, 0)[::-1, ..., None]:
        y = y * x + part
    return np.minimum(low, y.min(axis=-1)), np.maximum(high, y.max(axis=-1))


def _real_roots(c: Array) -> Array:
    """Real parts of all roots (..., d) of polynomials (..., d + 1), clipped to [0, 1].

    Points that are no roots do no harm where the caller takes an extreme over them.
    """
    d = c.shape[-1] - 1
    size = np.abs(c).max(axis=-1, keepdims=True)
    c = c / np.where(size > 0.0, size, 1.0)
    if d == 1:
        slope = np.where(c[..., 1:] == 0.0, 1.0, c[..., 1:])
        return np.clip(-c[..., :1] / slope, 0.0, 1.0)
    if d == 2:
        half = -0.5 * c[..., 1]
        root = np.sqrt(np.maximum(half * half - c[..., 2] * c[..., 0], 0.0))
        far = half + np.copysign(root, half)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            x: Any = np.stack((far / c[..., 2], c[..., 0] / far), axis=-1)
        return np.clip(np.nan_to_num(x, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0)
    # a leading coefficient that is nothing beside the others moves only roots far outside
    lead = np.where(np.abs(c[..., -1]) < 1e-14, 1e-14, c[..., -1])
    companion = np.zeros((*c.shape[:-1], d, d))
    companion[..., range(1, d), range(d - 1)] = 1.0
    companion[..., -1] = -c[..., :-1] / lead[..., None]
    x = np.linalg.eigvals(companion).real
    for _ in range(2):  # a companion matrix with a small lead loses digits
        p = c[..., -1, None] * x + c[..., -2, None]
        dp = np.broadcast_to(c[..., -1, None], x.shape)
        for i in range(d - 2, -1, -1):
            dp = dp * x + p
            p = p * x + c[..., i, None]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            step = p / dp
        x = np.where(np.abs(step) < 1e-3, x - step, x)
    return np.clip(x, 0.0, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class FunctionMotion(Motion):
    """Position and the derivatives that are known, as functions t (N,) -> (N, n) or (N,)."""

    functions: tuple[Callable[[Array], Any], ...]
    end: float
    n: int

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
class TimedMotion(Motion):
    """A path and a law of time: the path's parameter s as piecewise polynomial of time."""

    path: Motion
    law: PiecewisePolynomial

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.path.n

    @property
    def duration(self) -> Array:
        """Seconds."""
        return self.law.duration

    def derivatives(self, t: Array, orders: tuple[int, ...]) -> list[Array]:
        """Derivatives at times (N,), by the chain rule."""
        every = tuple(range(max(orders) + 1))
        s, *r = self.law.derivatives(t, every)
        q = self.path.derivatives(np.clip(s[:, 0], 0.0, float(self.path.duration)), every)
        found = {0: lambda: q[0], 1: lambda: q[1] * r[0]}
        found[2] = lambda: q[2] * r[0] ** 2 + q[1] * r[1]
        found[3] = lambda: q[3] * r[0] ** 3 + 3.0 * q[2] * r[0] * r[1] + q[1] * r[2]
        return [found[order]() for order in orders]

    def extremes(self, order: int) -> tuple[Array, Array]:
        """Least and greatest value at samples of each piece; infinite where the one below jumps."""
        (values,) = self.derivatives(self._inside.reshape(-1), (order,))
        low, high = values.min(axis=0), values.max(axis=0)
        if order:
            down, up = self.jumps(order - 1)
            low, high = np.where(down, -np.inf, low), np.where(up, np.inf, high)
        return low, high

    def jumps(self, order: int) -> tuple[Any, Any]:
        """Whether a derivative jumps down, and up, between the pieces of the law."""
        (x,) = self.derivatives(self._inside.reshape(-1), (order,))
        ends = x.reshape(-1, _INSIDE.size, self.n)[:, [0, -1]]
        jump = np.append(ends[1:, 0] - ends[:-1, 1], np.zeros((1, self.n)), axis=0)
        size = _JUMP * np.abs(x).max()
        return jump.min(axis=0) < -size, jump.max(axis=0) > size

    @property
    def _inside(self) -> Array:
        """Times inside the pieces of the law, (K, 6)."""
        live = self.law.lengths[0] > 0.0
        begin, lengths = self.law.breaks[0, :-1][live], self.law.lengths[0, live]
        return begin[:, None] + lengths[:, None] * _INSIDE
