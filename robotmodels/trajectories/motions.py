"""Motions whose pieces are polynomials of time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import factorial, prod
from typing import Any, Protocol

import numpy as np

from .._arrays import Array, Value, read_only
from ..errors import InvalidValueError, ShapeError

_ROUNDING = 1e-9  # jumps smaller than this beside the largest value are put down to rounding
_STENCIL = 7
_SPACING = 5e-3  # of the duration: balances truncation and rounding of two derivatives
_SAMPLES = 4001
_JUMP = 1e-6  # of the largest value: smaller jumps are put down to rounding
_INSIDE = np.linspace(0.0, 1.0 - 1e-7, 6)  # of a piece of a law: where extremes are sought


@dataclass(frozen=True, slots=True, eq=False)
class PiecewisePolynomial(Value):
    """Polynomials of the normalised time of each piece.

    Shapes: breaks (..., c, K + 1), coefficients (..., K, d + 1, n), lengths (..., c, K).
    """

    breaks: Array
    coefficients: Array
    lengths: Array = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        breaks, coefficients = read_only(self.breaks), read_only(self.coefficients)
        lengths = read_only(np.diff(breaks) if self.lengths is None else self.lengths)
        *batch, K, _, n = coefficients.shape
        c = breaks.shape[-2] if breaks.ndim > 1 else 0
        wanted = ((*batch, c, K + 1), (*batch, c, K))
        if c not in (1, n) or (breaks.shape, lengths.shape) != wanted or K == 0:
            raise ShapeError(
                f"breaks, lengths: expected shapes {(*batch, 1, K + 1)} and {(*batch, 1, K)} for "
                f"coefficients {coefficients.shape}, got {breaks.shape} and {lengths.shape}."
            )
        for name, value in (
            ("breaks", breaks),
            ("coefficients", coefficients),
            ("lengths", lengths),
        ):
            object.__setattr__(self, name, value)

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

        *_, K, powers, n = self.coefficients.shape
        M, c = prod(self.batch), self.breaks.shape[-2]
        out = np.empty((len(orders), M, t.shape[-1], n))
        piecewise_derivatives(
            np.ascontiguousarray(t).reshape(M, t.shape[-1]),
            self.breaks.reshape(M, c, K + 1),
            self.lengths.reshape(M, c, K),
            self.coefficients.reshape(M, K, powers, n),
            np.asarray(orders, np.int64),
            out,
        )
        return [values.reshape(*t.shape, n) for values in out]

    def extremes(self, order: int) -> tuple[Array, Array]:
        """Least and greatest value of a derivative over the motion, exact on every piece."""
        h = np.swapaxes(self.lengths, -1, -2)  # (..., K, c)
        live = h > 0.0
        step = np.where(live, h, 1.0)
        c = _in_time(_derived(self.coefficients, order), step, order)
        low, high = _range_on_unit_interval(c)
        none = ~live.any(axis=-2)
        low = np.where(live, low, np.inf).min(axis=-2)
        high = np.where(live, high, -np.inf).max(axis=-2)
        if none.any():  # a motion without duration stays at its start
            still = self.coefficients[..., 0, 0, :] if order == 0 else 0.0
            low, high = np.where(none, still, low), np.where(none, still, high)
        if order > 0:
            down, up = self._jumps(order - 1, live, step)
            low, high = np.where(down, -np.inf, low), np.where(up, np.inf, high)
        return low, high

    def _jumps(self, order: int, live: Any, step: Array) -> tuple[Any, Any]:
        """Whether a derivative jumps down, and up, between pieces beyond rounding, (..., n)."""
        c = _in_time(_derived(self.coefficients, order), step, order)
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


def _derived(c: Array, order: int) -> Array:
    """Coefficients of a derivative with respect to x; the powers are the last axis but one."""
    for _ in range(order):
        if c.shape[-2] == 1:
            return np.zeros_like(c)
        c = c[..., 1:, :] * np.arange(1.0, c.shape[-2])[:, None]
    return c


def _in_time(c: Array, step: Array, order: int) -> Array:
    """Derivatives by x as derivatives by time; one by one, as the power of a step may vanish."""
    for _ in range(order):
        c = c / step[..., None, :]
    return c


def _range_on_unit_interval(c: Array) -> tuple[Array, Array]:
    """Least and greatest value on [0, 1] of polynomials (..., d + 1, n), shapes (..., n)."""
    ends = np.stack((c[..., 0, :], c.sum(axis=-2)))
    low, high = ends.min(axis=0), ends.max(axis=0)
    if c.shape[-2] < 3:
        return low, high
    x = _real_roots(np.moveaxis(_derived(c, 1), -2, -1))  # (..., n, d - 1)
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
