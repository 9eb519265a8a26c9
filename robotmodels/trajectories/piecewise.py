"""Motions whose pieces are polynomials of time."""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

from .._arrays import Array, Value, read_only
from ..errors import ShapeError

_ROUNDING = 1e-9  # jumps smaller than this beside the largest value are put down to rounding


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
