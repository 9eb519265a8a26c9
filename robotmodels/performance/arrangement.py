"""The section of a three-joint arm cut along its curves: numbers of postures, areas, boundary.

The curves are polylines with many points. Vertical lines through all points cut the section into
strips, in each of which the polylines, sorted by height, bound trapezoids; the postures of the
middle of a trapezoid are those of all of it.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..model import RobotModel
from .arms import SectionArm, section_arm, turned_inside
from .level_curves import Curve, last_two_ranges, level_curves, limit_curves

_CHUNK = 65536


class Line(NamedTuple):
    """A curve with its image: x (K, 2) joints, section (K, 2), whether closed or of a limit."""

    x: Array
    section: Array
    closed: bool
    of_limit: bool


class Cut(NamedTuple):
    """Trapezoids: area (m,), middle (m, 2), strip (m,), sides (m, 4) in y; ends of strips (k + 1,).

    Sides are the lower left and right end, then the upper ones. Crossings (k, 2, 2): line, place.
    """

    area: Array
    middle: Array
    strip: NDArray[np.int64]
    sides: Array
    ends: Array
    crossings: Array


class Piece(NamedTuple):
    """Part of a line between crossings, the postures on its left and right."""

    line: int
    x: Array
    section: Array
    left: int
    right: int


def section_lines(model: RobotModel, arm: SectionArm, limits: bool) -> list[Line]:
    """Singular curves, and the lines of the limits, with their images."""
    ranges = last_two_ranges(model, arm, limits)
    curves = [(curve, False) for curve in level_curves(arm, ranges)]
    curves += [(curve, True) for curve in limit_curves(ranges)]
    return [Line(c.x, _image(arm, c), c.closed, flag) for c, flag in curves]


def _image(arm: SectionArm, curve: Curve) -> Array:
    """Image of a curve, its points moved so that the polyline bounds the area of the curve.

    A chord lies inside a bend; the second difference over twelve makes up for the area.
    """
    values = arm.values(curve.x)
    p = values[:, :2].copy()
    bend = np.zeros_like(p)
    bend[1:-1] = p[2:] - 2.0 * p[1:-1] + p[:-2]
    if curve.closed:
        bend[0] = bend[-1] = p[1] - 2.0 * p[0] + p[-2]
    sharp = np.linalg.norm(bend, axis=1) > 4e-4 * arm.size  # reflected by the axis
    p -= np.where(sharp[:, None], 0.0, bend / 12.0)
    if arm.radial:
        p[:, 0] = np.maximum(p[:, 0], 0.0)
    return p


def cut(lines: list[Line]) -> Cut:
    """Trapezoids between the lines, and where lines cross."""
    if not lines:
        none = np.zeros(0)
        return Cut(none, np.zeros((0, 2)), np.zeros(0, int), np.zeros((0, 4)), none,
                   np.zeros((0, 2, 2)))  # fmt: skip
    first = np.concatenate([line.section[:-1] for line in lines])
    last = np.concatenate([line.section[1:] for line in lines])
    place = np.concatenate(
        [np.column_stack((np.full(len(line.x) - 1, k), np.arange(len(line.x) - 1)))
         for k, line in enumerate(lines)]
    )  # fmt: skip
    ahead = (first[:, 0] <= last[:, 0])[:, None]
    a, b = np.where(ahead, first, last), np.where(ahead, last, first)
    xs = np.unique(np.concatenate((a[:, 0], b[:, 0])))
    low, high = np.searchsorted(xs, a[:, 0]), np.searchsorted(xs, b[:, 0])
    count = high - low
    edge = np.repeat(np.arange(len(a)), count)
    strip = np.arange(edge.size) - np.repeat(np.cumsum(count) - count, count) + low[edge]
    slope = (b[edge, 1] - a[edge, 1]) / (b[edge, 0] - a[edge, 0])
    left = a[edge, 1] + slope * (xs[strip] - a[edge, 0])
    right = a[edge, 1] + slope * (xs[strip + 1] - a[edge, 0])
    order = np.lexsort((left + right, strip))
    edge, strip, left, right = edge[order], strip[order], left[order], right[order]
    same = strip[1:] == strip[:-1]
    gap_left, gap_right = (np.diff(side)[same] for side in (left, right))
    x = 0.5 * (xs[strip] + xs[strip + 1])
    height = 0.5 * (left + right)
    middle = np.column_stack((x[1:], 0.5 * (height[1:] + height[:-1])))[same]
    area = (0.5 * (gap_left + gap_right)) * (xs[strip + 1] - xs[strip])[1:][same]
    cross = gap_left * gap_right < 0.0
    pairs = np.column_stack((edge[:-1], edge[1:]))[same][cross]
    share = (gap_left / np.where(cross, gap_left - gap_right, 1.0))[cross]
    at = xs[strip[1:][same][cross]] + share * np.diff(xs)[strip[1:][same][cross]]
    places = place[pairs].astype(float)
    for k in range(2):
        along = last[pairs[:, k], 0] - first[pairs[:, k], 0]
        places[:, k, 1] += (at - first[pairs[:, k], 0]) / along
    sides = np.column_stack((left[:-1], right[:-1], left[1:], right[1:]))[same]
    return Cut(area, middle, strip[1:][same], sides, xs, places)


def count_postures(
    model: RobotModel, arm: SectionArm, positions: Array, limits: bool
) -> NDArray[np.int64]:
    """Number of postures of world positions (N, 3) within the limits."""
    counts = np.empty(len(positions), np.int64)
    for k in range(0, len(positions), _CHUNK):
        q, valid = arm.postures(positions[k : k + _CHUNK])
        if limits:
            valid = valid & turned_inside(model, arm.model_postures(model, q), True)[1]
        counts[k : k + _CHUNK] = valid.sum(axis=1)
    return counts


@lru_cache(maxsize=32)
def measures(model: RobotModel, limits: bool) -> tuple[Array, Array]:
    """Area and swept volume by the number of postures (most + 1,), by the boundary method."""
    arm = section_arm(model)
    assert arm is not None
    lines = section_lines(model, arm, limits)
    area, middle, *_ = cut(lines)
    kept = area > 1e-12 * arm.size**2
    area, middle = area[kept], middle[kept]
    counts = count_postures(model, arm, arm.world(middle), limits)
    areas = np.asarray(np.bincount(counts, area, 5), float)
    sweep = 2.0 * pi * middle[:, 0] if arm.radial else np.full(len(middle), np.nan)
    volumes = np.asarray(np.bincount(counts, area * sweep, 5), float)
    areas[0] = volumes[0] = 0.0
    return areas, volumes


@lru_cache(maxsize=32)
def pieces(model: RobotModel, limits: bool) -> tuple[tuple[Piece, ...], tuple[Line, ...]]:
    """The lines broken at their crossings, with the numbers of postures beside each piece."""
    arm = section_arm(model)
    assert arm is not None
    lines = section_lines(model, arm, limits)
    crossings = cut(lines).crossings.reshape(-1, 2)
    found = []
    for k, line in enumerate(lines):
        places = np.unique(crossings[crossings[:, 0] == k, 1])
        last = len(line.x) - 1
        if line.closed and places.size:
            # from the first crossing once around
            stops = np.append(places, places[0] + last)
        else:
            stops = np.unique(np.concatenate(([0.0], places, [last])))
        for start, stop in pairwise(stops):
            if stop - start > 1e-6:
                found.append((k, *_part(line, start, stop, last)))
    if not found:
        return (), tuple(lines)
    middles, normals = [], []
    for _, _, section in found:
        m = (len(section) - 1) // 2
        along = section[m + 1] - section[m]
        normals.append(np.array([-along[1], along[0]]) / max(float(np.hypot(*along)), 1e-300))
        middles.append(0.5 * (section[m] + section[m + 1]))
    shift = 1e-5 * arm.size * np.array(normals)
    sides = []
    for sign in (1.0, -1.0):
        at = np.array(middles) + sign * shift
        side = count_postures(model, arm, arm.world(at), limits)
        sides.append(np.where(arm.radial & (at[:, 0] < 0.0), 0, side))
    whole = zip(found, *sides, strict=True)
    return tuple(Piece(k, x, s, int(a), int(b)) for (k, x, s), a, b in whole), tuple(lines)


def _part(line: Line, start: float, stop: float, last: int) -> tuple[Array, Array]:
    """Joints and section of a line between two places along it."""
    inner = np.arange(np.floor(start) + 1.0, np.ceil(stop))
    places = np.concatenate(([start], inner, [stop]))
    places = places[np.append(True, np.diff(places) > 1e-9)]
    turns, rest = np.divmod(places, last) if line.closed else (0.0 * places, places)
    shift = line.x[last] - line.x[0] if line.closed else np.zeros(2)
    low = np.minimum(rest.astype(int), last - 1)
    share = (rest - low)[:, None]
    x = line.x[low] + share * (line.x[low + 1] - line.x[low]) + turns[:, None] * shift
    section = line.section[low] + share * (line.section[low + 1] - line.section[low])
    return x, section


@lru_cache(maxsize=32)
def boundary(model: RobotModel, limits: bool) -> tuple[Array, ...]:
    """Closed polylines around what is reached, which lies on their left."""
    arm = section_arm(model)
    assert arm is not None
    area, middle, strip, sides, ends, _ = cut(section_lines(model, arm, limits))
    kept = np.flatnonzero(area > 1e-12 * arm.size**2)
    reached = count_postures(model, arm, arm.world(middle[kept]), limits) > 0
    parts = kept[reached]
    # trapezoids that lie on each other are one: what is left are their lower and upper ends
    apart = (strip[parts[1:]] != strip[parts[:-1]]) | (
        np.abs(sides[parts[1:], :2] - sides[parts[:-1], 2:]).max(axis=1) > 1e-9 * arm.size
    )
    first = parts[np.append(True, apart)] if parts.size else parts
    last = parts[np.append(apart, True)] if parts.size else parts
    # lower ends run to the right, upper ends to the left: columns are start and end of each
    x = np.concatenate((strip[first] + [[0], [1]], strip[last] + [[1], [0]]), axis=1)
    y = np.concatenate((sides[first, :2].T, sides[last, :1:-1].T), axis=1)
    # at each end of a strip the next start in height belongs to an end
    order = [np.lexsort((y[k], x[k])) for k in (0, 1)]
    follows = np.empty(len(x[0]), np.int64)
    follows[order[1]] = order[0]
    points = np.stack((ends[x], y), axis=-1)
    loops, open_ones = [], np.ones(len(follows), np.bool_)
    for start in range(len(follows)):
        loop, k = [], start
        while open_ones[k]:
            open_ones[k] = False
            loop += [points[0, k], points[1, k]]
            k = int(follows[k])
        if loop:
            loops.append(np.array([*loop, loop[0]]))
    return tuple(loops)
