"""Curves of singular positions of three-joint arms in the plane of the last two joints."""

from __future__ import annotations

from math import tau
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..model import RobotModel
from .arms import SectionArm, joint_ranges

STEP = 0.006  # rad, or part of the range of a slide times tau
_GRID = 192  # seeds are looked for on a grid with so many lines for each joint
_ROWS = 20000  # points of one curve at most
_MOST_CURVES = 400


class Curve(NamedTuple):
    """A curve of the last two joints (K, 2), and whether its last point is its first."""

    x: Array
    closed: bool


class Ranges(NamedTuple):
    """Ranges (2, 2) of the last two joints, which are whole circles, and bounds that cut (2, 2)."""

    low: Array
    high: Array
    circle: NDArray[np.bool_]
    bounds: Array


def last_two_ranges(model: RobotModel, arm: SectionArm, limits: bool) -> Ranges:
    """Where the last two joints move; bounds are infinite on a whole circle."""
    ranges, circle = joint_ranges(model, limits, arm.columns[1:])
    ranges, circle = ranges[arm.columns[1:]], circle[arm.columns[1:]]
    turning = arm.periods > 0.0
    low = np.where(turning, -np.pi, ranges[:, 0])
    high = np.where(turning, np.pi, ranges[:, 1])
    bounds = np.where(circle[:, None], (-np.inf, np.inf), ranges)
    return Ranges(low, high, turning, bounds)


def level_curves(
    arm: SectionArm, ranges: Ranges, level: float = 0.0, step: float = STEP
) -> list[Curve]:
    """All curves on which the determinant has a value, each followed once, inside the bounds.

    Seeds are changes of sign on the lines of a grid; a curve takes those away that it crosses.
    """
    from .kernels import level_curve

    step = step * float(np.min((ranges.high - ranges.low) / tau))
    lines = [
        np.linspace(a, b, _GRID + 1) + 1e-4 * (b - a) / _GRID
        for a, b in zip(ranges.low, ranges.high, strict=True)
    ]
    grid = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
    signs = (arm.values(grid.reshape(-1, 2))[:, 6] > level).reshape(grid.shape[:2])
    # edges along the first joint (index 0) and along the second, by their lower ends
    edges = [
        (signs[:-1] != signs[1:])[:, :_GRID],
        (signs[:, :-1] != signs[:, 1:])[:_GRID],
    ]
    origin = np.array([line[0] for line in lines])
    cell = (ranges.high - ranges.low) / _GRID
    found: list[Curve] = []
    rows, shut = np.empty((_ROWS, 2)), np.zeros(1)
    for _ in range(_MOST_CURVES):
        axis = 0 if edges[0].any() else 1
        if not edges[axis].any():
            break
        i, j = np.unravel_index(np.argmax(edges[axis]), edges[axis].shape)
        edges[axis][i, j] = False
        seed = origin + cell * (i + 0.5 * (axis == 0), j + 0.5 * (axis == 1))
        count = level_curve(
            arm.kinds, arm.local, level, arm.size**3, seed, arm.periods, step, rows, shut
        )
        if count < 2:
            continue
        x = rows[:count].copy()
        if _take_away(edges, (x - origin) / cell) or count > 20:
            found += _inside(x, shut[0] == 1.0, ranges)
    return found


def _take_away(edges: list[Array], x: Array) -> bool:
    """Remove the edges that a curve crosses, in units of cells; whether there was one."""
    any_edge = False
    for axis in (0, 1):
        other = 1 - axis
        k = np.floor(x[:, other]).astype(int)
        at = np.flatnonzero(k[1:] != k[:-1])
        line = np.maximum(k[at], k[at + 1])
        a, b = x[at], x[at + 1]
        share = (line - a[:, other]) / (b[:, other] - a[:, other])
        cross = np.floor(a[:, axis] + share * (b[:, axis] - a[:, axis])).astype(int)
        places = (cross % _GRID, line % _GRID)
        where = places if axis == 0 else places[::-1]
        any_edge |= bool(edges[axis][where].any())
        edges[axis][where] = False
    return any_edge


def _inside(x: Array, closed: bool, ranges: Ranges) -> list[Curve]:
    """Parts of a curve within the bounds; angles are turned into them as a whole."""
    low, high = ranges.bounds.T
    if not np.isfinite(low).any():
        return [Curve(x, closed)]
    parts = []
    finite = np.isfinite(low) & ranges.circle
    shifts = [np.zeros(2)]
    for k in np.flatnonzero(finite):
        # copies of the curve by whole turns that reach into the bounds
        first = int(np.floor((low[k] - x[:, k].max()) / tau))
        last = int(np.ceil((high[k] - x[:, k].min()) / tau))
        shifts = [s + tau * m * np.eye(2)[k] for s in shifts for m in range(first, last + 1)]
    seen: list[Array] = []
    for shift in shifts:
        y = x + shift
        good = np.all((y >= low) & (y <= high), axis=1)
        ends = np.flatnonzero(np.diff(np.concatenate(([False], good, [False])).astype(int)))
        for a, b in ends.reshape(-1, 2):
            if b - a > 1 and not any(np.abs(s - y[(a + b) // 2]).max(axis=1).min() < 1e-9
                                     for s in seen):  # fmt: skip
                piece = y[max(a - 1, 0) : b + 1].copy()  # up to the bound itself
                _cut(piece, low, high)
                seen.append(piece)
                parts.append(Curve(piece, closed and b - a == len(x)))
    return parts


def _cut(x: Array, low: Array, high: Array) -> None:
    """Move the ends of a piece, one point beyond the bounds, onto them."""
    for end, inner in ((0, 1), (-1, -2)):
        step = x[end] - x[inner]
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(step > 0.0, (high - x[inner]) / step, (low - x[inner]) / step)
        share = float(np.nanmin(np.where(step == 0.0, 1.0, room)))
        x[end] = x[inner] + min(max(share, 0.0), 1.0) * step


def limit_curves(ranges: Ranges) -> list[Curve]:
    """The lines on which one of the two joints is at a bound, the other moving."""
    low, high = ranges.bounds.T
    found = []
    for k in range(2):
        other = 1 - k
        a = low[other] if np.isfinite(low[other]) else ranges.low[other]
        b = high[other] if np.isfinite(high[other]) else ranges.high[other]
        for bound in (low[k], high[k]):
            if np.isfinite(bound):
                x = np.empty((int((b - a) / (ranges.high - ranges.low)[other] * 1200) + 3, 2))
                x[:, k], x[:, other] = bound, np.linspace(a, b, len(x))
                found.append(Curve(x, not np.isfinite(low[other])))
    return found
