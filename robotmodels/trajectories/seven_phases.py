"""The quickest motion from rest to rest under limits of velocity, acceleration and jerk.

A ramp from rest bends up with the greatest jerk, may go on with the greatest acceleration, and
bends down with the least jerk to the velocity of the cruise. The ramp back to rest is such a ramp
run backwards, in which the two jerks have the same places.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._arrays import Array


class Ramp(NamedTuple):
    """From rest to a velocity; arrays of shape (R,)."""

    rise: Array
    level: Array
    fall: Array
    distance: Array
    slope: Array

    @property
    def time(self) -> Array:
        """Seconds of the whole ramp."""
        return self.rise + self.level + self.fall


def ramp(V: Array, A: Array, up: Array, down: Array) -> Ramp:
    """The quickest ramp from rest to a velocity. Shapes: V, A, up, down (R,)."""
    bends = up + down  # time of both bends for each unit of acceleration
    with np.errstate(divide="ignore", invalid="ignore"):
        # the acceleration of a ramp that is never level
        short = np.where(V > 0.0, np.sqrt(2.0 * V / bends), 0.0)
        a = np.minimum(A, short)
        level = np.where(short > A, np.maximum(V / A - 0.5 * A * bends, 0.0), 0.0)
    rise, fall = a * up, a * down
    # what the middle of the acceleration lacks of the whole time, times the velocity
    distance = a * (
        rise * (rise / 6.0 + 0.5 * level + 0.5 * fall)
        + level * (0.5 * level + fall)
        + fall * fall / 3.0
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.where(level > 0.0, 0.5 * rise + level + fall, 1.5 * distance / V)
    return Ramp(rise, level, fall, distance, np.where(V > 0.0, slope, 0.0))


def seven_phases(L: Array, V: Array, A: Array, B: Array, J: Array, K: Array) -> tuple[Array, Array]:
    """Phases of the quickest motion.

    Shapes: L, V, A, B, J, K (R,) -> durations (R, 7), coefficients (R, 7, 4).
    """
    up, down = 1.0 / J, 1.0 / K
    V = _cruise(L, V, A, B, up, down)
    first, last = ramp(V, A, up, down), ramp(V, B, up, down)
    ramps = first.distance + last.distance
    with np.errstate(divide="ignore", invalid="ignore"):
        cruise = np.where(L > 0.0, (L - ramps) / V, 0.0)
        none = cruise <= 1e-14 * (first.time + last.time)
        # without a cruise the ramps alone cover the distance, to the last digit
        V = np.where(none & (ramps > 0.0), V * (L / ramps), V)
    return phases(L, V, first, np.where(none, 0.0, cruise), last)


def phases(L: Array, V: Array, first: Ramp, cruise: Array, last: Ramp) -> tuple[Array, Array]:
    """Durations and coefficients of the phases of two ramps and the cruise between them.

    Shapes: L, V, cruise (R,) -> durations (R, 7), coefficients (R, 7, 4).
    """
    h, c = np.zeros((L.size, 7)), np.zeros((L.size, 7, 4))
    h[:, :3] = np.stack((first.rise, first.level, first.fall), axis=-1)
    h[:, 3] = cruise
    h[:, 4:] = np.stack((last.fall, last.level, last.rise), axis=-1)
    c[:, :3], end = _on_ramp(first, V)
    c[:, 3, 0], c[:, 3, 1] = end, V * cruise
    back, _ = _on_ramp(last, V)
    for k in range(3):  # L - p(1 - x)
        p0, p1, p2, p3 = np.moveaxis(back[:, k], -1, 0)
        run = (L - (p0 + p1 + p2 + p3), p1 + 2.0 * p2 + 3.0 * p3, -(p2 + 3.0 * p3), p3)
        c[:, 6 - k] = np.stack(run, axis=-1)
    return h, c


def _on_ramp(r: Ramp, V: Array) -> tuple[Array, Array]:
    """Coefficients (R, 3, 4) of the phases of a ramp that reaches V, and the distance."""
    bends = 0.5 * (r.rise + r.fall) + r.level
    a = V / np.where(bends > 0.0, bends, 1.0)
    v1 = 0.5 * a * r.rise
    v2 = V - 0.5 * a * r.fall
    p1 = a * r.rise**2 / 6.0
    p2 = p1 + 0.5 * (v1 + v2) * r.level
    c = np.zeros((V.size, 3, 4))
    c[:, 0, 3] = p1
    c[:, 1, 0], c[:, 1, 1], c[:, 1, 2] = p1, v1 * r.level, 0.5 * a * r.level**2
    c[:, 2, 0], c[:, 2, 1] = p2, v2 * r.fall
    c[:, 2, 2], c[:, 2, 3] = 0.5 * a * r.fall**2, -a * r.fall**2 / 6.0
    return c, c[:, 2].sum(axis=-1)


def _cruise(L: Array, V: Array, A: Array, B: Array, up: Array, down: Array) -> Array:
    """Greatest useful velocity.

    The quickest motion cruises as fast as it may, as long as its ramps fit into the distance.
    """
    moves = L > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        # ramps limited by acceleration alone, and by jerk alone: each bounds V from above
        full = np.sqrt(2.0 * L / (1.0 / A + 1.0 / B))
        of_one = ramp(np.where(moves, 1.0, 0.0), np.full_like(L, np.inf), up, down).distance
        full = np.minimum(full, np.cbrt(0.5 * L / of_one) ** 2)
    full = np.where(moves, full, 0.0)
    # the distance of the ramps is convex in V: Newton's method comes down to its root and stays
    for _ in range(60):
        first, last = ramp(full, A, up, down), ramp(full, B, up, down)
        slope = np.where(moves, first.slope + last.slope, 1.0)
        step = np.where(moves, (first.distance + last.distance - L) / slope, 0.0)
        full = full - step
        if (np.abs(step) <= 1e-10 * full).all():
            break  # the next step would be nothing: they square
    return np.where(moves, np.minimum(V, full), 0.0)
