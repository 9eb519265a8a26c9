"""Least durations on a circle, where the acceleration towards the centre takes its part.

On a circle of radius r the position has the acceleration ``(L s'', (L s')^2 / r)`` along the path
and towards the centre, and the jerk ``(L s''' - (L s')^3 / r^2, 3 L^2 s' s'' / r)``. Slowed down
evenly, a motion divides them by powers of one factor, so that a law of one shape is as quick as the
factor allows. Of the shapes of a law the quickest is taken: the part of the time that its ramps
take and, with seven phases, the part of a ramp that bends.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .._arrays import Array
from .laws import Pieces, TimeLaw, law_of_duration, ramped
from .seven_phases import Ramp, phases

_MARGIN = 1.0 + 1e-13
"""Durations are this much above the least, so that rounding does not exceed a limit."""


class CircleLimits(NamedTuple):
    """Limits of a motion on a circle."""

    length: float
    radius: float
    turn: float
    velocity: tuple[float, float]
    acceleration: tuple[float, float]
    jerk: tuple[float, float]


def circle_law(law: TimeLaw, limits: CircleLimits) -> Pieces:
    """The quickest motion of a law along the whole arc."""
    low, high, precise = np.zeros(2), np.zeros(2), 1e-15
    if law in (TimeLaw.TRAPEZOIDAL, TimeLaw.SMOOTHED_TRAPEZOIDAL):
        low, high = np.array([1e-6, 0.0]), np.array([0.5, 0.0])
    elif law is TimeLaw.JERK_LIMITED:
        low, high, precise = np.array([1e-6, 1e-6]), np.array([0.5, 0.5]), 1e-9
    best = low
    for _ in range(60):
        if (high - low <= precise).all():
            break
        # finer and finer grids about the least duration
        axes = [
            np.linspace(*ends, 17 if ends[1] > ends[0] else 1)
            for ends in zip(low, high, strict=True)
        ]
        shapes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        best = shapes[_stretch(_of_shapes(law, shapes), limits, fine=False).argmin()]
        reach = (high - low) / 8.0
        low, high = np.maximum(low, best - reach), np.minimum(high, best + reach)
    pieces = _of_shapes(law, best[None])
    return Pieces(pieces.durations * (_stretch(pieces, limits) * _MARGIN), pieces.coefficients)


def _of_shapes(law: TimeLaw, shapes: Array) -> Pieces:
    """Motions of unit duration; the shape is the part of a ramp, and the part of it of a bend."""
    part, bend = shapes.T
    one = np.ones_like(part)
    if law in (TimeLaw.TRAPEZOIDAL, TimeLaw.SMOOTHED_TRAPEZOIDAL):
        return ramped(law, one, 1.0 / (1.0 - part), one, part, part)
    if law is TimeLaw.JERK_LIMITED:
        V = 1.0 / (1.0 - part)
        turn = part * bend
        ramp = Ramp(turn, part - 2.0 * turn, turn, 0.5 * V * part, part)
        return Pieces(*phases(one, V, ramp, 1.0 - 2.0 * part, ramp))
    return law_of_duration(law, one, one)


def _stretch(pieces: Pieces, limits: CircleLimits, fine: bool = True) -> Array:
    """Factors (R,) on the durations of motions with which they keep all limits, one in full."""
    L, r = limits.length, limits.radius
    # both halves of a motion are alike
    K = (pieces.durations.shape[-1] + 1) // 2
    half = Pieces(pieces.durations[:, :K], pieces.coefficients[:, :K])

    def greatest(value: Callable[[Array, Array, Array], Array]) -> Array:
        return np.sqrt(_peak(half, value, fine))

    speed = greatest(lambda v, a, j: v * v)
    push = greatest(lambda v, a, j: a * a)
    bend = greatest(lambda v, a, j: j * j)
    pull = greatest(lambda v, a, j: (L * a) ** 2 + (L * L * v * v / r) ** 2)
    need = np.maximum(L * speed / limits.velocity[0], limits.turn * speed / limits.velocity[1])
    need = np.maximum(need, np.sqrt(pull / limits.acceleration[0]))
    need = np.maximum(need, np.sqrt(limits.turn * push / limits.acceleration[1]))
    if np.isfinite(limits.jerk[0]):
        jolt = greatest(
            lambda v, a, j: (L * j - (L * v) ** 3 / r**2) ** 2 + (3.0 * L * L * v * a / r) ** 2
        )
        need = np.maximum(need, np.cbrt(jolt / limits.jerk[0]))
    return np.maximum(need, np.cbrt(limits.turn * bend / limits.jerk[1]))


def _peak(pieces: Pieces, value: Callable[[Array, Array, Array], Array], fine: bool) -> Array:
    """Greatest value (R,) over the motions of a function of the derivatives of s."""
    live = pieces.durations > 0.0
    h = np.where(live, pieces.durations, 1.0)[..., None]
    derived, c = [], pieces.coefficients
    for _ in range(3):
        c = c[..., 1:] * np.arange(1.0, c.shape[-1]) if c.shape[-1] > 1 else np.zeros_like(c)
        derived.append(c)
    low, high = np.zeros(h.shape), np.ones(h.shape)
    best = np.full(live.shape, -np.inf)
    # the values of parabolas are greatest at their ends; others are looked for on finer grids
    grids = (49, 17, 17, 17, 17, 17) if fine else (33, 17)
    for count in (2,) if pieces.coefficients.shape[-1] <= 3 else grids:
        x = low + (high - low) * np.linspace(0.0, 1.0, count)
        rates = []
        for order, d in enumerate(derived, start=1):
            y = d[..., -1:] + 0.0 * x
            for i in range(d.shape[-1] - 2, -1, -1):
                y = y * x + d[..., i : i + 1]
            rates.append(y / h**order)
        values = value(*rates)
        k = values.argmax(axis=-1)[..., None]
        best = np.maximum(best, np.take_along_axis(values, k, axis=-1)[..., 0])
        low, high = (
            np.take_along_axis(x, np.clip(k + side, 0, count - 1), axis=-1) for side in (-1, 1)
        )
    return np.where(live, best, -np.inf).max(axis=-1)
