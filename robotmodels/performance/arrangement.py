"""The section of a three-joint arm cut along its curves: numbers of postures, areas, boundary.

The curves are polylines with many points. Vertical lines through all points cut the section into
strips, in each of which the polylines, sorted by height, bound trapezoids; the postures of the
middle of a trapezoid are those of all of it.
"""

from __future__ import annotations

from itertools import pairwise
from math import pi
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..model import RobotModel
from .arms import Ints, JointSpace, SectionArm, per_model, section_arm
from .level_curves import Line, section_lines

_CHUNK = 65536


class Cut(NamedTuple):
    """Trapezoids: area (m,), middle (m, 2), strip (m,), sides (m, 4) in y; ends of strips (k + 1,).

    Sides are the lower left and right end, then the upper ones. Crossings (k, 2, 2): line, place.
    """

    area: Array
    middle: Array
    strip: Ints
    sides: Array
    ends: Array
    crossings: Array


def cut(lines: tuple[Line, ...]) -> Cut:
    """Trapezoids between the lines, and where lines cross."""
    if not lines:
        x, two, four = np.zeros(0), np.zeros((0, 2)), np.zeros((0, 4))
        return Cut(x, two, np.zeros(0, np.int64), four, x, four.reshape(0, 2, 2))
    first = np.concatenate([line.section[:-1] for line in lines])
    last = np.concatenate([line.section[1:] for line in lines])
    sizes = [len(line.x) - 1 for line in lines]
    place = np.column_stack(
        (np.repeat(range(len(lines)), sizes), np.concatenate([*map(np.arange, sizes)]))
    )
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


@per_model
def lines_of(model: RobotModel, limits: bool) -> tuple[tuple[Line, ...], bool]:
    """Singular curves and lines of the limits of an arm with a section; whether curves touch."""
    arm = section_arm(model)
    assert arm is not None
    lines, touch = section_lines(model, arm, limits)
    return tuple(lines), touch


@per_model
def counted_cut(model: RobotModel, limits: bool) -> tuple[Cut, Ints]:
    """The section cut along its curves, and the postures of each trapezoid."""
    arm, found = section_arm(model), cut(lines_of(model, limits)[0])
    assert arm is not None
    counts = np.zeros(len(found.area), np.int64)
    kept = found.area > 1e-12 * arm.size**2
    counts[kept] = count_postures(JointSpace(model, limits), arm, found.middle[kept])
    return found, counts


def count_postures(space: JointSpace, arm: SectionArm, points: Array) -> Ints:
    """Number of postures of points (N, 2) of the section within the limits; 0 beyond the axis."""
    counts = np.empty(len(points), np.int64)
    for k in range(0, len(points), _CHUNK):
        q, valid, _ = arm.postures(arm.world(points[k : k + _CHUNK]))
        if space.limits:
            valid = valid & space.within(arm.model_postures(space.model, q))[1]
        counts[k : k + _CHUNK] = valid.sum(axis=1)
    return np.where(arm.radial & (points[:, 0] < 0.0), 0, counts)


def measures(model: RobotModel, limits: bool) -> tuple[Array, Array]:
    """Area and swept volume by the number of postures (5,), by the boundary method."""
    arm, (found, counts) = section_arm(model), counted_cut(model, limits)
    assert arm is not None
    areas = np.asarray(np.bincount(counts, found.area, 5), float)
    sweep = 2.0 * pi * found.middle[:, 0] if arm.radial else np.full(len(counts), np.nan)
    volumes = np.asarray(np.bincount(counts, found.area * sweep, 5), float)
    areas[0] = volumes[0] = 0.0
    return areas, volumes


def pieces(model: RobotModel, limits: bool) -> list[tuple[Line, Line, int, int]]:
    """Parts of lines between their crossings: line, part, postures on the left and on the right."""
    arm, lines = section_arm(model), lines_of(model, limits)[0]
    assert arm is not None
    crossings = counted_cut(model, limits)[0].crossings.reshape(-1, 2)
    parts, normals, middles = [], [], []
    for k, line in enumerate(lines):
        last = len(line.x) - 1
        places = np.floor(crossings[crossings[:, 0] == k, 1]).astype(int)
        # a closed line from its first crossing once around
        stops = np.unique(places % last if line.closed and places.size else [0, *places, last])
        if line.closed and places.size:
            stops = np.append(stops, stops[0] + last)
        for ends in pairwise(stops.tolist()):
            part = line.part(*ends)
            m = (len(part.x) - 1) // 2
            along = part.section[m + 1] - part.section[m]
            normals.append(np.array([-along[1], along[0]]) / max(float(np.hypot(*along)), 1e-300))
            middles.append(0.5 * (part.section[m] + part.section[m + 1]))
            parts.append((line, part))
    shift, middle = 1e-5 * arm.size * np.reshape(normals, (-1, 2)), np.reshape(middles, (-1, 2))
    left, right = (
        count_postures(JointSpace(model, limits), arm, middle + sign * shift).tolist()
        for sign in (1.0, -1.0)
    )
    return [(*part, a, b) for part, a, b in zip(parts, left, right, strict=True)]


def boundary(model: RobotModel, limits: bool) -> list[Array]:
    """Closed polylines around what is reached, which lies on their left."""
    arm, (found, counts) = section_arm(model), counted_cut(model, limits)
    assert arm is not None
    parts, sides, ends = np.flatnonzero(counts > 0), found.sides, found.ends
    # trapezoids that lie on each other are one: what is left are their lower and upper ends
    apart = (found.strip[parts[1:]] != found.strip[parts[:-1]]) | (
        np.abs(sides[parts[1:], :2] - sides[parts[:-1], 2:]).max(axis=1) > 1e-9 * arm.size
    )
    first = parts[np.append(True, apart)] if parts.size else parts
    last = parts[np.append(apart, True)] if parts.size else parts
    # lower ends run to the right, upper ends to the left: columns are start and end of each
    x = np.concatenate((found.strip[first] + [[0], [1]], found.strip[last] + [[1], [0]]), axis=1)
    y = np.concatenate((sides[first, :2].T, sides[last, :1:-1].T), axis=1)
    points = np.stack((ends[x], y), axis=-1)
    # at each end of a strip the next start in height belongs to an end
    return closed_loops(*points, *np.stack((y, x), axis=-1))


def closed_loops(start: Array, end: Array, first: NDArray[Any], last: NDArray[Any]) -> list[Array]:
    """Closed polylines of edges (E, 2), each followed by the one whose first key is its last."""
    follows = np.empty(len(start), np.int64)
    follows[np.lexsort(last.T)] = np.lexsort(first.T)
    loops, open_ones = [], np.ones(len(start), np.bool_)
    for k in range(len(start)):
        loop = []
        while open_ones[k]:
            open_ones[k] = False
            loop += [start[k], end[k]]
            k = int(follows[k])
        if loop:
            loops.append(np.array([*loop, loop[0]]))
    return loops
