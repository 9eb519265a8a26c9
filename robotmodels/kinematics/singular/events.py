"""What happens in an arm where it is singular: axes aligned, points on axes or in planes.

One list of events names singular positions for the formulas, which look at configurations that
make a factor vanish, and for the numbers, which look around one configuration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...geometry import PRISMATIC, REVOLUTE
from ...model import RobotModel
from ..poses import dgm, link_poses
from ..singularity_kind import SingularityKind

_TOLERANCE = 1e-7
"""Square roots at double zeros leave half of the digits."""


@dataclass(frozen=True, slots=True)
class _Scene:
    """Axes and points in several configurations."""

    z: Array  # (samples, joints, 3)
    o: Array  # (samples, joints, 3)
    W: Array | None  # (samples, 3)
    size: float


Residual = Callable[[_Scene], Array | None]
"""What is zero where an event happens, (samples, ...), without units; None where undefined."""


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happens where a factor vanishes and not elsewhere."""

    kind: SingularityKind | None  # None: the joints decide
    sentence: str
    residual: Residual

    def happens(self, scene: _Scene) -> bool:
        """Whether it does so in all configurations of a scene."""
        found = self.residual(scene)
        return found is not None and _none(found, 1.0)


class ArmGeometry:
    """The joints that move a frame, and the point of interest."""

    def __init__(
        self, model: RobotModel, frame: str | int | None, numbers: list[int], position_only: bool
    ) -> None:
        self.model, self.frame, self.numbers = model, frame, numbers
        self.turns = [model.table.sigma[k - 1] == REVOLUTE for k in numbers]
        self.q = random_postures(model, 6, seed=7)
        self.whole_arm = len(numbers) >= 6
        self.size: float | None = None
        self.point, self.meeting = self._point(position_only)
        self.usual = self._scene(self.q)
        places = range(len(numbers))
        self.parallel = {
            (a, b)
            for a, b in combinations(places, 2)
            if self.turns[a] and self.turns[b] and _none(np.cross(*_pair(self.usual.z, a, b)), 1.0)
        }
        self.events = [e for e in self._candidates() if not e.happens(self.usual)]

    def _point(self, position_only: bool) -> tuple[str, tuple[int, int] | None]:
        """Name of the point that matters, and the axes that meet there (None: the tool point)."""
        tool = "the tool point" if self.frame is None else f"the origin of frame {self.frame!r}"
        if position_only or not self.whole_arm:
            return tool, None
        scene = self._scene(self.q, with_point=False)
        k = len(self.numbers)
        a, b, c = k - 3, k - 2, k - 1
        if not all(self.turns[a:]):
            return tool, None
        if _common(scene, b, c) is not None:
            W = _common(scene, b, c)
            if W is not None and _none(np.cross(W - scene.o[:, a], scene.z[:, a]), scene.size):
                return "the wrist centre", (b, c)
            return f"the point where axes {self.numbers[b]} and {self.numbers[c]} meet", (b, c)
        return tool, None

    def _scene(self, q: Array, with_point: bool = True) -> _Scene:
        poses = link_poses(self.model, q)
        rows = [k - 1 for k in self.numbers]
        poses = poses[:, rows]
        z, o = poses[..., :3, 2], poses[..., :3, 3]
        tool = dgm(self.model, q, self.frame)[:, :3, 3]
        # of the arm, not of these configurations: residuals of several are compared
        size = max(1e-3, float(np.abs(o - tool[:, None]).max())) if self.size is None else self.size
        self.size = size
        scene = _Scene(z, o, None, size)
        if not with_point:
            return scene
        W = tool if self.meeting is None else _common(scene, *self.meeting)
        return _Scene(z, o, W, size)

    def event(self, q: Array) -> Event | None:
        """What all configurations of q (samples, n) have in common and others have not."""
        scene = self._scene(q)
        return next((event for event in self.events if event.happens(scene)), None)

    def residuals(self, event: Event, q: Array) -> Array:
        """How far configurations (samples, n) are from an event, (samples, r), without units."""
        found = event.residual(self._scene(q))
        if found is None:  # the point is nowhere: axes that meet there have become parallel
            return np.full((len(q), 1), np.inf)
        return found.reshape(len(q), -1)

    def _candidates(self) -> list[Event]:
        places, names = range(len(self.numbers)), self.numbers
        turning = [k for k in places if self.turns[k]]
        out: list[Event] = []

        def add(residual: Residual, kind: SingularityKind | None, sentence: str) -> None:
            out.append(Event(kind, sentence, residual))

        stretched = "the arm is stretched or folded"
        # links of one length fold so that axes are aligned too: that is still the elbow
        for a, b in sorted(self.parallel):
            add(
                _in_plane(a, b), SingularityKind.ELBOW,
                f"{self.point} is in the plane of axes {names[a]} and {names[b]}: {stretched}",
            )  # fmt: skip
        for a, b, c in combinations(turning, 3):
            if {(a, b), (a, c)} <= self.parallel:
                add(
                    _coplanar(a, b, c), SingularityKind.ELBOW,
                    f"the parallel axes {names[a]}, {names[b]} and {names[c]} are in one plane: "
                    f"{stretched}",
                )  # fmt: skip
        for a, b in sorted(combinations(turning, 2), key=lambda pair: pair[1] - pair[0]):
            kind = self._kind_of_pair(a, b)
            words = f": {stretched}" if kind is SingularityKind.ELBOW else ""
            add(_aligned(a, b), kind, f"axes {names[a]} and {names[b]} are aligned{words}")
        for k in turning:
            first = k == 0 and self.whole_arm
            kind = SingularityKind.SHOULDER if first else SingularityKind.OTHER
            add(_on_axis(k), kind, f"{self.point} is on axis {names[k]}")
        if len(turning) > 1 and turning[:2] == [0, 1]:
            add(
                _beside_first, SingularityKind.SHOULDER,
                f"{self.point} is in the plane through axis {names[0]} that is parallel to axis "
                f"{names[1]}",
            )  # fmt: skip
        for a, b in sorted(combinations(places, 2), key=lambda pair: pair[1] - pair[0]):
            wrist = a >= len(names) - 3 and self.whole_arm and self.turns[a] and self.turns[b]
            kind = SingularityKind.WRIST if wrist else SingularityKind.OTHER
            add(_same_direction(a, b), kind, f"axes {names[a]} and {names[b]} are parallel")
        for a, b, c in combinations(places, 3):
            if not (self.turns[a] and self.turns[b] and self.turns[c]):
                add(
                    _same_plane(a, b, c), SingularityKind.OTHER,
                    f"axes {names[a]}, {names[b]} and {names[c]} are parallel to one plane",
                )  # fmt: skip
        for a in places[:-2]:
            add(
                _perpendicular(a, a + 2), None,
                f"axes {names[a]} and {names[a + 2]} are perpendicular",
            )  # fmt: skip
        return out

    def _kind_of_pair(self, a: int, b: int) -> SingularityKind:
        if not self.whole_arm:
            return SingularityKind.OTHER
        if a >= len(self.numbers) - 3:
            return SingularityKind.WRIST
        return SingularityKind.SHOULDER if b <= 2 else SingularityKind.ELBOW

    def kind_of_joints(self, numbers: tuple[int, ...]) -> SingularityKind:
        """By the joints alone, for a factor without an event."""
        if not self.whole_arm:
            return SingularityKind.OTHER
        places = [self.numbers.index(k) for k in numbers]
        if min(places) >= len(self.numbers) - 3:
            return SingularityKind.WRIST
        if max(places) <= 2:
            return SingularityKind.SHOULDER
        return SingularityKind.OTHER


def random_postures(model: RobotModel, count: int, seed: int) -> Array:
    """Configurations without a special place: angles anywhere, strokes of a few decimetres."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-np.pi, np.pi, size=(count, model.n))
    prismatic: NDArray[np.bool_] = model.table.sigma[model.table.joint_rows] == PRISMATIC
    return np.where(prismatic, rng.uniform(0.2, 0.9, size=q.shape), q)


def _pair(x: Array, a: int, b: int) -> tuple[Array, Array]:
    return x[:, a], x[:, b]


def _none(x: Array, size: float) -> bool:
    return bool(np.abs(x).max() <= _TOLERANCE * size)


def _common(s: _Scene, a: int, b: int) -> Array | None:
    """The point where two axes meet in every configuration."""
    za, zb = _pair(s.z, a, b)
    normal = np.cross(za, zb)
    square = np.einsum("si,si->s", normal, normal)
    between = s.o[:, b] - s.o[:, a]
    if square.min() < 1e-12 or not _none(np.einsum("si,si->s", between, normal), s.size):
        return None
    way = np.einsum("si,si->s", np.cross(between, zb), normal) / square
    return s.o[:, a] + way[:, None] * za


def _aligned(a: int, b: int) -> Residual:
    def residual(s: _Scene) -> Array:
        za, zb = _pair(s.z, a, b)
        off = np.cross(s.o[:, b] - s.o[:, a], za) / s.size
        return np.concatenate([np.cross(za, zb), off], axis=1)

    return residual


def _on_axis(k: int) -> Residual:
    def residual(s: _Scene) -> Array | None:
        return None if s.W is None else np.cross(s.W - s.o[:, k], s.z[:, k]) / s.size

    return residual


def _in_plane(a: int, b: int) -> Residual:
    def residual(s: _Scene) -> Array | None:
        if s.W is None:
            return None
        normal = np.cross(s.z[:, a], s.o[:, b] - s.o[:, a])
        return np.einsum("si,si->s", normal, s.W - s.o[:, a]) / s.size**2

    return residual


def _coplanar(a: int, b: int, c: int) -> Residual:
    def residual(s: _Scene) -> Array:
        normal = np.cross(s.z[:, a], s.o[:, b] - s.o[:, a])
        return np.einsum("si,si->s", normal, s.o[:, c] - s.o[:, a]) / s.size**2

    return residual


def _beside_first(s: _Scene) -> Array | None:
    if s.W is None:
        return None
    normal = np.cross(s.z[:, 0], s.z[:, 1])
    return np.einsum("si,si->s", normal, s.W - s.o[:, 0]) / s.size


def _same_direction(a: int, b: int) -> Residual:
    return lambda s: np.cross(s.z[:, a], s.z[:, b])


def _same_plane(a: int, b: int, c: int) -> Residual:
    return lambda s: np.linalg.det(s.z[:, [a, b, c]])


def _perpendicular(a: int, b: int) -> Residual:
    return lambda s: np.einsum("si,si->s", s.z[:, a], s.z[:, b])
