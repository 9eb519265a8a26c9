"""What a singular configuration looks like: which axes are aligned, parallel, in one plane."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ..poses import dgm, link_poses
from ..singularity_kind import SingularityKind
from .motion import SelfMotion, SelfMotionKind
from .structure import ArmStructure, sines
from .task import SingularTask

_WRIST_CENTRE = "other: not all motions of the wrist centre are free"
_SHOULDER = "shoulder: its turns do not give the wrist centre all motions"
_WRIST = "wrist: not all turns about the wrist centre are free"


def kinds_in_words(
    task: SingularTask,
    q: Array,
    structure: ArmStructure,
    motions: tuple[SelfMotion, ...],
    wrenches: Array,
    redundancy: int,
    zero: float,
) -> tuple[tuple[SingularityKind | None, str], ...]:
    """Names of what makes a configuration singular, each with a sentence.

    Shapes: q (n,), wrenches (p, 6).
    """
    scene = _Scene(task, q, structure, zero)
    if redundancy:
        found: list[tuple[SingularityKind | None, str]] = [*scene.by_wrenches(wrenches)]
        aligned = [m for m in motions if len(m.joints) == 2 and m.kind is SelfMotionKind.FINITE]
        found += [
            (None, f"the axes of joints {_and(m.joints)} are aligned")
            for m in aligned
            if scene.are_collinear(m.joints)
        ]
    else:
        found = [*scene.by_shape()] or [scene.by_motion(m) for m in motions]
    return tuple(dict.fromkeys(found))


class _Scene:
    """Axes of the joints at one configuration, in the world."""

    def __init__(self, task: SingularTask, q: Array, structure: ArmStructure, zero: float) -> None:
        links = link_poses(task.model, q)
        rows = links[structure.joints - 1]
        self.task, self.structure, self.zero = task, structure, zero
        self.tool: Array = dgm(task.model, q, task.frame)[:3, 3]
        self.joints = [int(j) for j in structure.joints]
        self.z, self.o = rows[:, :3, 2], rows[:, :3, 3]
        self.centre = _placed(links, structure.joints, -2, structure.centre)
        self.last_two = _placed(links, structure.joints, -2, structure.last_two)
        self.shoulder = _placed(links, structure.joints, 1, structure.shoulder)

    def by_shape(self) -> list[tuple[SingularityKind, str]]:
        """Names of an arm whose axes 2 and 3 are parallel and that has a wrist centre."""
        k, point = len(self.joints), self.centre
        if k != 6 or point is None or not self.task.is_whole:
            return []
        if not (self.structure.revolute.all() and self.structure.parallel[1, 2]):
            return []
        found = []
        slack, L = 10.0 * self.zero, self.structure.size
        across = np.cross(self.z[0], self.z[2])
        if abs(across @ (point - self.o[0])) < slack * L:
            found.append(self._arm(True))
        upper, fore = self.o[2] - self.o[1], point - self.o[2]
        if abs(np.cross(upper, fore) @ self.z[1]) < slack * L * L:
            found.append(self._arm(False))
        if np.linalg.norm(np.cross(self.z[3], self.z[5])) < slack:
            text = f"the axes of joints {self.joints[3]} and {self.joints[5]} are aligned"
            found.append((SingularityKind.WRIST, f"wrist: {text}"))
        return found

    def by_motion(self, motion: SelfMotion) -> tuple[SingularityKind, str]:
        """Name from the joints whose screws depend on each other."""
        at = [self.joints.index(j) for j in motion.joints]
        names = f"joints {_and(motion.joints)}" if len(at) > 1 else f"joint {motion.joints[0]}"
        turning = bool(self.structure.revolute[at].all())
        first, wrist = 0 in at, min(at) >= len(self.joints) - 3
        if len(at) == 1 and turning:
            kind = SingularityKind.SHOULDER if first else SingularityKind.OTHER
            return (
                kind,
                f"{kind.name.lower()}: the point is on the axis of joint {motion.joints[0]}",
            )
        if turning and len(at) == 2 and self.are_collinear(motion.joints):
            kind = SingularityKind.WRIST if wrist and len(self.joints) > 3 else (
                SingularityKind.SHOULDER if first else SingularityKind.OTHER)  # fmt: skip
            return kind, f"{kind.name.lower()}: the axes of {names} are aligned"
        if turning and self._are_parallel(at):
            return self._parallel_axes(at, names)
        if self.structure.centre is not None and self.task.is_whole and len(self.joints) >= 4:
            if wrist:
                return SingularityKind.WRIST, f"wrist: the axes of {names} lie in one plane"
            return self._arm(first)
        if first and self.task.is_whole and turning and self.last_two is not None:
            return self._arm(True)
        if turning and not self.task.mask[3:].any():
            return self._arm_of_point(at, first)
        return SingularityKind.OTHER, f"other: the motions of {names} depend on each other"

    def by_wrenches(self, wrenches: Array) -> list[tuple[SingularityKind, str]]:
        """Names from what is carried without torque, for robots with more joints than needed."""
        nothing = SingularityKind.OTHER, "other: the motions of the joints depend on each other"
        if self.centre is None or not self.task.is_whole:
            return [nothing]
        L = self.structure.size
        force, moment = wrenches[:, :3] * L, wrenches[:, 3:]
        about = moment + np.cross(self.tool - self.centre, wrenches[:, :3])
        basis = np.linalg.qr(np.hstack([force, about]).T)[0].T
        U, sigma, _ = np.linalg.svd(basis[:, 3:])
        turning = int((sigma > 10.0 * self.zero).sum())
        found = []
        through = U[:, turning:].T @ basis[:, :3]  # forces through the wrist centre
        if len(through):
            along = None if self.shoulder is None else self.centre - self.shoulder
            if along is None:
                found.append((SingularityKind.OTHER, _WRIST_CENTRE))
            else:
                along = along / np.linalg.norm(along)
                held = np.linalg.norm(through @ along) > 1.0 - 10.0 * self.zero
                if held:
                    found.append(self._arm(False))
                if len(through) > held:
                    found.append((SingularityKind.SHOULDER, _SHOULDER))
        if turning:
            found.append((SingularityKind.WRIST, _WRIST))
        return found

    def are_collinear(self, numbers: Sequence[int]) -> bool:
        """Whether two axes are one line."""
        a, b = (self.joints.index(j) for j in numbers)
        if not self.structure.revolute[[a, b]].all():
            return False
        between = self.o[b] - self.o[a]
        off = np.linalg.norm(np.cross(self.z[a], between))
        return self._are_parallel([a, b]) and bool(off < 10.0 * self.zero * self.structure.size)

    def _are_parallel(self, at: list[int]) -> bool:
        return bool(sines(self.z[at]).max() < 10.0 * self.zero)

    def _parallel_axes(self, at: list[int], names: str) -> tuple[SingularityKind, str]:
        if len(at) == 2 and not self.task.mask[3:].any():
            return self._arm_of_point(at, 0 in at)
        if len(at) == 3:
            bend = self._bend([*at])
            return SingularityKind.ELBOW, f"elbow: the axes of {names} lie in one plane, {bend}"
        always = self.structure.parallel[np.ix_(at, at)]
        new = [i for k, i in enumerate(at) if always[k].sum() == 1]
        if new and new[-1] >= len(self.joints) - 3:
            return SingularityKind.WRIST, f"wrist: the axes of {names} are parallel"
        return SingularityKind.OTHER, f"other: the axes of {names} are parallel"

    def _arm(self, shoulder: bool) -> tuple[SingularityKind, str]:
        point = self.centre if self.centre is not None else self.last_two
        assert point is not None  # asked for only where the last axes meet
        called = "wrist centre" if self.centre is not None else "meeting point of the last two axes"
        elbow = max(len(self.joints) - 4, 1)
        if shoulder:
            off = np.linalg.norm(np.cross(self.z[0], point - self.o[0]))
            if off < 10.0 * self.zero * self.structure.size:
                return SingularityKind.SHOULDER, f"shoulder: the {called} is on axis 1"
            if not self.structure.revolute[elbow]:
                return SingularityKind.OTHER, _WRIST_CENTRE
            text = f"the line through the {called} along axis {self.joints[elbow]} meets axis 1"
            return SingularityKind.SHOULDER, f"shoulder: {text}"
        if not self.structure.revolute[elbow]:
            return SingularityKind.OTHER, _WRIST_CENTRE
        axes = f"axes {self.joints[elbow - 1]} and {self.joints[elbow]}"
        if not self.structure.parallel[elbow - 1, elbow]:
            # a ball-and-socket shoulder: axis 2 turns with the arm about its line
            return SingularityKind.ELBOW, (
                f"elbow: shoulder, elbow axis {self.joints[elbow]} and {called} are in line"
            )
        bend = self._bend([elbow - 1, elbow], point)
        return SingularityKind.ELBOW, f"elbow: {axes} and the {called} lie in one plane, {bend}"

    def _arm_of_point(self, at: list[int], first: bool) -> tuple[SingularityKind, str]:
        names = _and([self.joints[i] for i in at])
        if self._are_parallel(at) and len(at) == 2:
            bend = self._bend(at, self.tool)
            return SingularityKind.ELBOW, (
                f"elbow: axes {names} and the point lie in one plane, {bend}"
            )
        off = np.linalg.norm(np.cross(self.z[at[0]], self.tool - self.o[at[0]]))
        if first and off < 10.0 * self.zero * self.structure.size:
            return SingularityKind.SHOULDER, "shoulder: the point is on axis 1"
        return SingularityKind.OTHER, f"other: axes {names} move the point in dependent directions"

    def _bend(self, at: list[int], point: Array | None = None) -> str:
        """Stretched or folded, seen along parallel axes."""
        chain = [self.o[i] for i in at] + ([] if point is None else [point])
        z = self.z[at[0]]
        a, b = (v - z * (z @ v) for v in (chain[1] - chain[0], chain[2] - chain[1]))
        return "stretched out" if a @ b > 0.0 else "folded"


def _placed(
    links: Array, joints: NDArray[np.int64], holder: int, local: Array | None
) -> Array | None:
    if local is None:
        return None
    frame = links[int(joints[holder]) - 1]
    return frame[:3, :3] @ local + frame[:3, 3]


def _and(numbers: Sequence[int]) -> str:
    words = [str(j) for j in numbers]
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
