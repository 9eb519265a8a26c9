"""Level curves of the determinant of three-joint arms in the plane of the last two joints.

Seen from the second joint, the axis and the origin of the first one are of degree one in its
cosine and sine, and all else depends on the third joint alone. The determinant is therefore
``A cos x2 + B sin x2 + C`` with functions A, B, C of x3 (``A x2 + C`` for a slide): every x3 has
two points of a level curve, which meet where ``A^2 + B^2 = (C - level)^2``. No curve is followed
step by step, so that none is left for another one where two come close.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from math import pi, tau
from typing import NamedTuple

import numpy as np

from .._arrays import Array
from ..model import RobotModel
from .arms import Flags, JointSpace, SectionArm, wrapped

STEP = 0.006  # between points, rad, or part of the range of a slide times tau
_GRID = 4096  # values of x3 at which turning points are looked for
_LEAST, _MOST = 400, 20000  # points of a curve
_ZERO = 1e-9  # beside the largest value
_BESIDE = 1e-11  # rad or m, of a common root


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A curve with its image: x (K, 2) joints, section (K, 2), whether closed or of a limit."""

    x: Array
    section: Array
    closed: bool
    of_limit: bool = False

    def part(self, start: int, stop: int) -> Line:
        """The points from one number to another, of a closed line beyond its end."""
        turn, rest = np.divmod(np.arange(start, stop + 1)[:, None], len(self.x) - 1)
        x, p = (a[rest[:, 0]] + turn * (a[-1] - a[0]) for a in (self.x, self.section))
        return Line(x, p, False, self.of_limit)


class _Arc(NamedTuple):
    """Values of x3 with points of a curve; at which ends its two branches meet, or which one."""

    low: float
    high: float
    meets: tuple[bool, bool]
    branch: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class LevelSet:
    """Level set of the determinant of an arm: ends (2, 2) of the ranges, whole circles (2,).

    ``roots`` are the values of x3 at which it has the level for all x2; A, B, C are without them.
    """

    arm: SectionArm
    ends: Array
    circle: Flags
    level: float = 0.0
    roots: tuple[float, ...] = ()

    @property
    def unit(self) -> Array:
        """Unit of each joint: a radian, or a part of the range of a slide."""
        return np.where(self.arm.turns, 1.0, np.ptp(self.ends, axis=1) / tau)

    def curves(self, step: float = STEP) -> tuple[list[Line], bool]:
        """All curves on which the determinant has the level; whether two of them touch."""
        a, b = self.ends[1]
        at = (np.arange(_GRID) + 0.37) / _GRID if self.circle[1] else np.linspace(0.0, 1.0, _GRID)
        x3, rest, found = a + (b - a) * at, self, []
        for _ in range(3):  # multiple roots
            fresh = rest._common_roots(x3)
            rest = replace(rest, roots=rest.roots + fresh)
        for root in set(rest.roots):
            low, high = self.ends[0]
            x2 = np.linspace(low, high, _LEAST + int((high - low) / self.unit[0] / step))
            found.append(np.column_stack((x2, np.full(len(x2), root))))
        arcs, touch = rest._arcs(x3)
        for arc in arcs:
            found += self._inside(rest._spread(arc, step))
        return [self.line(x) for x in found], touch

    def line(self, x: Array, of_limit: bool = False) -> Line:
        """A curve with its image."""
        closed = bool(np.abs(wrapped(x[-1] - x[0], self.arm.turns)).max() < 1e-6)
        return Line(x, _image(self.arm, x, closed), closed, of_limit)

    def _coefficients(self, x3: Array) -> Array:
        """A, B and C - level (3, N), without their common roots, in units of the arm."""
        turns, unit = self.arm.turns, self.arm.size**3
        for root in self.roots:  # beside a root, where there is 0 / 0
            x3 = np.where(np.abs(wrapped(x3 - root, turns[1:])) < _BESIDE, x3 + 1e-6, x3)
        x2 = np.array((0.0, 0.5 * pi, pi) if turns[0] else (0.0, 1.0))
        x = np.stack(np.broadcast_arrays(x2[:, None], x3), axis=-1)
        f = (self.arm.values(x.reshape(-1, 2))[:, 6].reshape(len(x2), -1) - self.level) / unit
        if turns[0]:
            C = 0.5 * (f[0] + f[2])
            V = np.stack((0.5 * (f[0] - f[2]), f[1] - C, C))
        else:
            V = np.stack((f[1] - f[0], np.zeros(len(x3)), f[0]))
        for root in self.roots:
            V = V / (np.sin(0.5 * (x3 - root)) if turns[1] else x3 - root)
        return V

    def _common_roots(self, x3: Array) -> tuple[float, ...]:
        """Zeros of A, B and C: Gauss-Newton steps from the least values on a grid."""
        size = np.linalg.norm(self._coefficients(x3), axis=0)
        least = (size <= np.roll(size, 1)) & (size <= np.roll(size, -1)) & (size < 0.1 * size.max())
        x, h, V = x3[least], 1e-6, np.zeros((3, int(least.sum())))
        for _ in range(30 if x.size else 0):
            V, up, down = (self._coefficients(y) for y in (x, x + h, x - h))
            slope = (up - down) / (2.0 * h)
            step = (V * slope).sum(axis=0) / np.maximum((slope * slope).sum(axis=0), 1e-300)
            x = x - np.clip(step, -0.01, 0.01)
        good = np.linalg.norm(V, axis=0) < _ZERO * size.max()
        good &= self.circle[1] | ((x >= self.ends[1, 0]) & (x <= self.ends[1, 1]))
        x = np.sort(wrapped(x[good], self.circle[1:]))
        return tuple(x[np.append(True, np.diff(x) > 1e-6)[: len(x)]].tolist())

    def _condition(self, x3: Array) -> Array:
        """Positive (N,) where there are points of a curve."""
        A, B, C = self._coefficients(x3)
        if self.arm.turns[0]:
            return np.asarray(A**2 + B**2 - C**2)
        low, high = self.ends[0]
        return np.asarray(-(A * low + C) * (A * high + C))

    def _arcs(self, x3: Array) -> tuple[list[_Arc], bool]:
        """Ranges of x3 with points of a curve; whether two curves touch."""
        meets, circle = bool(self.arm.turns[0]), bool(self.circle[1])
        x3 = np.append(x3, x3[0] + tau) if circle else x3
        D = self._condition(x3)
        there = D > 0.0
        if np.abs(D).max() < 1e-24:
            return [], False  # singular everywhere
        bend = D[2:] - 2.0 * D[1:-1] + D[:-2]
        vertex = D[1:-1] - (D[2:] - D[:-2]) ** 2 / (8.0 * np.where(bend == 0.0, 1.0, bend))
        inner = np.abs(D[2:] - D[:-2]) <= 2.0 * np.abs(bend)
        touch = meets and bool((inner & (np.abs(vertex) < _ZERO * np.abs(D).max())).any())
        at = np.flatnonzero(there[1:] != there[:-1])
        low, high = x3[at], x3[at + 1]
        for _ in range(60 if at.size else 0):
            middle = 0.5 * (low + high)
            same = (self._condition(middle) > 0.0) == there[at]
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        if circle and at.size:
            ends, inside, turn = (
                np.append(low, low[0] + tau),
                there[at + 1],
                [meets] * (at.size + 1),
            )
        else:
            ends, inside = np.concatenate((x3[:1], low, x3[-1:])), there[np.append(0, at + 1)]
            turn = [False, *[meets] * at.size, False]
        return [
            _Arc(float(ends[k]), float(ends[k + 1]), (turn[k], turn[k + 1]), branch)
            for k in np.flatnonzero(inside).tolist()
            for branch in ((1.0, -1.0) if meets and not any(turn[k : k + 2]) else (1.0,))
        ], touch

    def _points(self, arc: _Arc, t: Array) -> Array:
        """Points (N, 2) of a curve at parameters from -1 to 1."""
        a, b = arc.low, arc.high
        if all(arc.meets):
            x3 = 0.5 * (a + b) - 0.5 * (b - a) * np.cos(pi * t)
        elif any(arc.meets):
            x3 = a + (b - a) * t * t if arc.meets[0] else b - (b - a) * t * t
        else:
            x3 = a + 0.5 * (b - a) * (1.0 + t)
        A, B, C = self._coefficients(x3)
        if not self.arm.turns[0]:
            return np.column_stack((-C / np.where(A == 0.0, 1e-300, A), x3))
        ratio = -C / np.maximum(np.hypot(A, B), 1e-300)
        side = np.where(t < 0.0, -1.0, 1.0) if any(arc.meets) else arc.branch
        x2 = np.arctan2(B, A) + side * np.arccos(np.clip(ratio, -1.0, 1.0))
        return np.column_stack((np.unwrap(x2), x3))

    def _spread(self, arc: _Arc, step: float) -> Array:
        """Points (K, 2) of a curve at nearly equal distances."""
        points = partial(self._points, arc)
        t, unit = np.linspace(-1.0, 1.0, _GRID // 2 + 1), self.unit
        for _ in range(2):
            x = points(t) / unit
            s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(x, axis=0), axis=1) + 1e-12))
            count = int(np.clip(s[-1] / step, _LEAST, _MOST))
            t = np.interp(np.linspace(0.0, s[-1], count), s, t)
        return points(t)

    def _inside(self, x: Array) -> list[Array]:
        """Parts of a curve within the range of x2, turned into it as a whole."""
        low, high = self.ends[0]
        if self.circle[0]:
            return [x]
        first, last = (low - x[:, 0].max()) / tau, (high - x[:, 0].min()) / tau
        turns = np.arange(np.ceil(first), np.floor(last) + 1) if self.arm.turns[0] else (0.0,)
        parts = []
        for shift in turns:
            y = x + tau * shift * np.eye(2)[0]
            good = (y[:, 0] >= low) & (y[:, 0] <= high)
            ends = np.flatnonzero(np.diff(np.pad(good, 1).astype(int)))
            for a, b in ends.reshape(-1, 2):
                if b - a > 1:
                    piece = y[max(a - 1, 0) : b + 1].copy()
                    for end, inner in ((0, 1), (-1, -2)):  # one beyond the bound is moved onto it
                        bound = float(np.clip(piece[end, 0], low, high))
                        move = piece[end] - piece[inner]
                        if bound != piece[end, 0]:
                            piece[end] = piece[inner] + move * (bound - piece[inner, 0]) / move[0]
                    parts.append(piece)
        return parts


def level_set(model: RobotModel, arm: SectionArm, limits: bool, level: float = 0.0) -> LevelSet:
    """Level set of the determinant."""
    ranges, circle = JointSpace(model, limits).ranges(arm.columns[1:])
    return LevelSet(arm, ranges[arm.columns[1:]], circle[arm.columns[1:]], level)


def section_lines(model: RobotModel, arm: SectionArm, limits: bool) -> tuple[list[Line], bool]:
    """Singular curves and the lines of the limits with their images; whether two curves touch."""
    two = level_set(model, arm, limits)
    lines, touch = two.curves()
    for k in np.flatnonzero(~two.circle):
        low, high = two.ends[1 - k]
        for bound in two.ends[k]:
            x = np.empty((int((high - low) / two.unit[1 - k] * 190) + 3, 2))
            x[:, k], x[:, 1 - k] = bound, np.linspace(low, high, len(x))
            lines.append(two.line(x, True))
    return lines, touch


def _image(arm: SectionArm, x: Array, closed: bool) -> Array:
    """Image of a curve, its points moved so that the polyline bounds the area of the curve.

    A chord lies inside a bend; the second difference over twelve makes up for the area.
    """
    p = arm.values(x)[:, :2].copy()
    bend = np.zeros_like(p)
    bend[1:-1] = p[2:] - 2.0 * p[1:-1] + p[:-2]
    if closed:
        bend[0] = bend[-1] = p[1] - 2.0 * p[0] + p[-2]
    sharp = np.linalg.norm(bend, axis=1) > 4e-4 * arm.size  # reflected by the axis
    p -= np.where(sharp[:, None], 0.0, bend / 12.0)
    if arm.radial:
        p[:, 0] = np.maximum(p[:, 0], 0.0)
    return p
