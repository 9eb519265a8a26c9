"""Geometric conditions of singular positions: axes aligned, points on axes or in planes.

One list of events names singular positions for the formulas, which look at configurations that
make a factor vanish, and for the numbers, which look around one configuration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from enum import Enum
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from ..._arrays import Array
from ...geometry import PRISMATIC, REVOLUTE
from ...model import RobotModel
from ..poses import dgm, link_poses

_TOLERANCE = 1e-7
"""Square roots at double zeros leave half of the digits."""
_STRETCHED = "the arm is stretched or folded"


class SingularityKind(Enum):
    """Part of an arm in which a singular position arises.

    The geometry on the zeros of the factor decides: SHOULDER where the wrist centre comes to the
    first axis (or into the plane through it that is parallel to the second axis), or two of the
    first three axes are aligned; ELBOW where the arm is stretched or folded (neighbouring parallel
    axes and the wrist centre, or three parallel axes, come into one plane, or two axes in the
    middle are aligned); WRIST where two of the last three axes are aligned or parallel. Where
    none of these holds, a factor in the variables of the last three (first three) of six or
    more joints alone is WRIST (SHOULDER), any other is OTHER.
    """

    SHOULDER = "shoulder"
    ELBOW = "elbow"
    WRIST = "wrist"
    OTHER = "other"


class _Scene(NamedTuple):
    """Axes and points in several configurations, lengths over the size of the arm.

    Shapes: z, o (joints, samples, 3), W (samples, 3), NaN where it is not defined.
    """

    z: Array
    o: Array
    W: Array


class Event(NamedTuple):
    """A geometric condition that holds where a factor vanishes and not elsewhere.

    ``residual(scene, *places)``, (samples, ...), is zero where it holds; a kind of None is that of
    the joints.
    """

    kind: SingularityKind | None
    sentence: str
    residual: Callable[..., Array]
    places: tuple[int, ...]

    def happens(self, scene: _Scene) -> bool:
        """Whether it holds in all configurations of a scene."""
        return _is_zero(self.residual(scene, *self.places))


class ArmGeometry:
    """The joints that move a frame, and the point of interest."""

    def __init__(
        self, model: RobotModel, frame: str | int | None, numbers: list[int], position_only: bool
    ) -> None:
        self.model, self.frame, self.numbers = model, frame, numbers
        self.turns = [bool(model.table.sigma[k - 1] == REVOLUTE) for k in numbers]
        self.whole_arm = len(numbers) >= 6
        self.size, self.meeting = 1.0, None
        usual = self._scene(q := random_postures(model, 6, seed=7))
        # of the arm, not of some configurations: residuals of several are compared
        self.size = max(1e-3, float(np.abs(usual.o - usual.W).max(initial=0.0)))
        usual = self._scene(q)
        self.point = "the tool point" if frame is None else f"the origin of frame {frame!r}"
        a, b, c = (len(numbers) - k for k in (3, 2, 1))
        if self.whole_arm and not position_only and all(self.turns[a:]):
            W = _common(usual, b, c)
            if not np.isnan(W).any():
                self.point = f"the point where axes {numbers[b]} and {numbers[c]} meet"
                if _is_zero(np.cross(W - usual.o[a], usual.z[a])):
                    self.point = "the wrist centre"
                self.meeting, usual = (b, c), usual._replace(W=W)
        self.turning = [k for k, turns in enumerate(self.turns) if turns]
        pairs = combinations(self.turning, 2)
        self.parallel = [pair for pair in pairs if _is_zero(_same_direction(usual, *pair))]
        self.events = [e for e in self._candidates() if not e.happens(usual)]

    def _scene(self, q: Array) -> _Scene:
        poses = link_poses(self.model, q)[:, [k - 1 for k in self.numbers]].swapaxes(0, 1)
        tool = dgm(self.model, q, self.frame)[:, :3, 3]
        scene = _Scene(poses[..., :3, 2], poses[..., :3, 3] / self.size, tool / self.size)
        return scene if self.meeting is None else scene._replace(W=_common(scene, *self.meeting))

    def event(self, q: Array) -> Event | None:
        """Condition that holds in all configurations of q (samples, n) and not in others."""
        scene = self._scene(q)
        return next((event for event in self.events if event.happens(scene)), None)

    def residuals(self, event: Event, q: Array) -> Array:
        """Residuals (samples, r) of an event in configurations (samples, n), without units."""
        found = event.residual(self._scene(q), *event.places).reshape(len(q), -1)
        return np.where(np.isnan(found), np.inf, found)

    def _candidates(self) -> Iterator[Event]:
        places, names = range(len(self.numbers)), self.numbers
        shoulder, elbow, wrist, other = SingularityKind
        # links of one length fold so that axes are aligned too: that is still the elbow
        for a, b in self.parallel:
            text = f"{self.point} is in the plane of axes {names[a]} and {names[b]}: {_STRETCHED}"
            yield Event(elbow, text, _in_plane, (a, b))
        for a, b, c in combinations(self.turning, 3):
            if {(a, b), (a, c)} <= {*self.parallel}:
                text = f"the parallel axes {names[a]}, {names[b]} and {names[c]} are in one plane"
                yield Event(elbow, f"{text}: {_STRETCHED}", _in_plane, (a, b, c))
        for a, b in _nearest_first(self.turning):
            kind = self._kind_of_pair(a, b)
            words = f": {_STRETCHED}" if kind is elbow else ""
            text = f"axes {names[a]} and {names[b]} are aligned{words}"
            yield Event(kind, text, _aligned, (a, b))
        for k in self.turning:
            kind = shoulder if k == 0 and self.whole_arm else other
            yield Event(kind, f"{self.point} is on axis {names[k]}", _on_axis, (k,))
        if self.turning[:2] == [0, 1]:
            plane = f"the plane through axis {names[0]} that is parallel to axis {names[1]}"
            yield Event(shoulder, f"{self.point} is in {plane}", _beside, (0, 1))
        for a, b in _nearest_first(places):
            both = a >= len(names) - 3 and self.whole_arm and self.turns[a] and self.turns[b]
            text = f"axes {names[a]} and {names[b]} are parallel"
            yield Event(wrist if both else other, text, _same_direction, (a, b))
        for a, b, c in combinations(places, 3):
            if not (self.turns[a] and self.turns[b] and self.turns[c]):
                text = f"axes {names[a]}, {names[b]} and {names[c]} are parallel to one plane"
                yield Event(other, text, _same_plane, (a, b, c))
        for a in places[:-2]:
            text = f"axes {names[a]} and {names[a + 2]} are perpendicular"
            yield Event(None, text, _perpendicular, (a, a + 2))

    def _kind_of_pair(self, a: int, b: int) -> SingularityKind:
        if not self.whole_arm:
            return SingularityKind.OTHER
        if a >= len(self.numbers) - 3:
            return SingularityKind.WRIST
        return SingularityKind.SHOULDER if b <= 2 else SingularityKind.ELBOW

    def kind_of_joints(self, numbers: tuple[int, ...]) -> SingularityKind:
        """Kind by the joints alone, for a factor without an event."""
        kind = SingularityKind.OTHER
        if self.whole_arm:
            places = [self.numbers.index(k) for k in numbers]
            kind = self._kind_of_pair(min(places), max(places))
        return SingularityKind.OTHER if kind is SingularityKind.ELBOW else kind


def random_postures(model: RobotModel, count: int, seed: int) -> Array:
    """Configurations without a special place: angles anywhere, strokes of a few decimetres."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-np.pi, np.pi, size=(count, model.n))
    prismatic = model.table.sigma[model.table.joint_rows] == PRISMATIC
    return np.where(prismatic, rng.uniform(0.2, 0.9, size=q.shape), q)


def _nearest_first(places: Any) -> list[tuple[int, int]]:
    return sorted(combinations(places, 2), key=lambda pair: pair[1] - pair[0])


def _is_zero(x: Array) -> bool:
    """Whether all is zero; NaN is not."""
    return bool(np.abs(x).max() <= _TOLERANCE)


def _dot(u: Array, v: Array) -> Array:
    return np.einsum("si,si->s", u, v)


def _common(s: _Scene, a: int, b: int) -> Array:
    """The point where two axes meet in every configuration; else NaN."""
    normal, between = np.cross(s.z[a], s.z[b]), s.o[b] - s.o[a]
    square = _dot(normal, normal)
    if square.min() < 1e-12 or not _is_zero(_dot(between, normal)):
        return np.full(s.W.shape, np.nan)
    way = _dot(np.cross(between, s.z[b]), normal) / square
    return s.o[a] + way[:, None] * s.z[a]


def _aligned(s: _Scene, a: int, b: int) -> Array:
    off = np.cross(s.o[b] - s.o[a], s.z[a])
    return np.concatenate([np.cross(s.z[a], s.z[b]), off], axis=1)


def _on_axis(s: _Scene, k: int) -> Array:
    return np.cross(s.W - s.o[k], s.z[k])


def _in_plane(s: _Scene, a: int, b: int, c: int | None = None) -> Array:
    point = s.W if c is None else s.o[c]
    return _dot(np.cross(s.z[a], s.o[b] - s.o[a]), point - s.o[a])


def _beside(s: _Scene, a: int, b: int) -> Array:
    return _dot(np.cross(s.z[a], s.z[b]), s.W - s.o[a])


def _same_direction(s: _Scene, a: int, b: int) -> Array:
    return np.cross(s.z[a], s.z[b])


def _same_plane(s: _Scene, a: int, b: int, c: int) -> Array:
    return _dot(np.cross(s.z[a], s.z[b]), s.z[c])


def _perpendicular(s: _Scene, a: int, b: int) -> Array:
    return _dot(s.z[a], s.z[b])
