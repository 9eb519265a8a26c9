"""Frames of a robot on a tape: rotations one axis at a time, with zeros where the table has them.

A vector changes frames by planar rotations, and the place of a frame is split into a shift before
its rotations and a part ``r`` along its own axis: both leave out products with zeros. Cosines and
sines of constant angles are exact where the table prints a fraction of pi.

References
----------
W. Khalil and J.-F. Kleinfinger, "Minimum operations and minimum parameters of the dynamic models of
tree structure robots", IEEE Journal of Robotics and Automation 3(6), 1987; seed book section 1.2.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import atan2, cos, hypot, sin, sqrt

import numpy as np

from .._arrays import Array
from ..geometry import PRISMATIC, REVOLUTE, constant_factors
from ..model import RobotModel
from ..symbolic.angles import exact_turns
from .tape import Number, Scalar, Vector, cross, function, minus, plus, times

Turn = tuple[int, Number, Number]
"""Axis (0 x, 1 y, 2 z), cosine and sine of a rotation about it."""
Rows = tuple[Vector, Vector, Vector]
Pose = tuple[Rows, Vector]
Constant = Callable[[str, int], Number]
"""Value of a geometric parameter: column and number of the row."""

_SINES = {0: 0.0, 2: 0.5, 3: sqrt(0.5), 4: sqrt(0.75), 6: 1.0}  # of multiples of 15 degrees
_ROUNDING = 1e-15


@dataclass(frozen=True, slots=True)
class Link:
    """Frame in its parent: first the shift, then the turns, then ``r`` along its own z axis."""

    number: int
    parent: int  # number of a frame, 0 for R_0
    joint: int  # column of q, -1 if it does not move
    slides: bool
    shift: Vector  # in the axes of the parent
    turns: tuple[Turn, ...]
    r: Number

    def inward(self, a: Vector) -> Vector:
        """Vector of the parent's axes in those of the link."""
        for axis, c, s in self.turns:
            a = _turned(a, axis, c, -s)
        return a

    def outward(self, a: Vector) -> Vector:
        """Vector of the link's axes in those of the parent."""
        for axis, c, s in reversed(self.turns):
            a = _turned(a, axis, c, s)
        return a


@dataclass(frozen=True, slots=True)
class Frames:
    """The links in the order of the table, and for each frame a link with a constant pose in it."""

    links: tuple[Link, ...]
    carriers: tuple[tuple[int, Array], ...]  # of frames 0 to f: number of a link, pose (4, 4)
    base: Pose

    def poses(self) -> dict[int, Pose]:
        """World poses of the links by their numbers."""
        poses = {0: self.base}
        for link in self.links:
            R, p = poses[link.parent]
            turned = tuple(link.inward(row) for row in R)
            along = tuple(row[2] * link.r for row in turned)
            poses[link.number] = turned, plus(plus(p, times(R, link.shift)), along)  # type: ignore[assignment, arg-type]
        return poses

    def path(self, number: int) -> list[Link]:
        """The links from the base to a link."""
        of = {link.number: link for link in self.links}
        path = []
        while number > 0:
            path.append(of[number])
            number = of[number].parent
        return path[::-1]


def frames_of(
    model: RobotModel, q: Sequence[Number], constant: Constant | None = None, heavy: bool = False
) -> Frames:
    """The frames of a robot at joint variables on a tape.

    Without ``constant`` geometric parameters are numbers, and frames that do not move are merged
    into those that carry them; ``heavy`` keeps them as links, whose masses differ.
    """
    table, joint = model.table, model.chain.joint
    carriers = [(j, np.eye(4)) for j in range(table.f + 1)]
    links, K = [], constant_factors(table)
    for k in range(table.f):
        a = int(table.antecedent[k])
        parent, place = carriers[a]
        if constant is not None:
            links.append(_by_columns(model, k, q, constant))
            continue
        if joint[k] < 0:
            carriers[k + 1] = parent, place @ K[k]
            if not heavy:
                continue
        if a == parent and abs(table.beta[k]) < _ROUNDING:
            links.append(_by_columns(model, k, q, lambda c, j: float(getattr(table, c)[j - 1])))
        else:
            links.append(_by_matrix(model, k, parent, q, place @ K[k]))
    return Frames(tuple(links), tuple(carriers), constant_pose(model.base))


def pose_of(model: RobotModel, frames: Frames, frame: str | int | None) -> tuple[int, Pose]:
    """Number of the link that carries a frame, and the world pose of the frame."""
    number, place = carried(model, frames, frame)
    R, p = frames.poses()[number]
    E, e = constant_pose(place)
    columns = tuple(zip(*E, strict=True))
    turned = tuple(times(columns, row) for row in R)  # type: ignore[arg-type]
    return number, (turned, plus(p, times(R, e)))  # type: ignore[return-value]


def carried(model: RobotModel, frames: Frames, frame: str | int | None) -> tuple[int, Array]:
    """The link that carries a frame, and the constant pose (4, 4) of the frame in it."""
    point, own = model.twin.frame(frame), np.eye(4)
    own[:3, :3], own[:3, 3] = point.rotation, point.position
    number, place = frames.carriers[point.parent]
    return number, place @ own


def jacobian(frames: Frames, number: int, point: Vector, n: int) -> list[list[Number]]:
    """Columns ``[v; w]`` of the world-aligned Jacobian of a point on a link."""
    poses = frames.poses()
    columns: list[list[Number]] = [[0.0] * 6 for _ in range(n)]
    for link in frames.path(number):
        if link.joint >= 0:
            R, p = poses[link.number]
            z = R[0][2], R[1][2], R[2][2]
            zero = 0.0, 0.0, 0.0
            arm = zero if link.slides else minus(point, p)
            columns[link.joint] = [
                *(z if link.slides else cross(z, arm)),
                *(zero if link.slides else z),
            ]
    return columns


def constant_pose(T: Array) -> Pose:
    """A constant pose, its rotation exact where it is 0 or +-1 to rounding."""
    R = T[:3, :3]
    near = np.round(R)
    rows = np.where(np.abs(R - near) < _ROUNDING, near + 0.0, R).tolist()
    return tuple(map(tuple, rows)), tuple(T[:3, 3].tolist())  # type: ignore[return-value]


def cosine_sine(angle: Number, offset: float = 0.0) -> tuple[Number, Number]:
    """Cosine and sine of a variable (or constant) angle plus a constant."""
    turns = exact_turns(offset)
    if not isinstance(angle, Scalar):
        turns = exact_turns(angle + offset)
        if turns is None:
            return cos(angle + offset), sin(angle + offset)
        steps = int(12 * turns)
        return _exact_sine(steps + 6), _exact_sine(steps)
    if turns is None or (2 * turns).denominator > 1:
        return function("cos", angle + offset), function("sin", angle + offset)
    c, s = function("cos", angle), function("sin", angle)
    return ((c, s), (-s, c), (-c, -s), (s, -c))[int(2 * turns) % 4]


def _exact_sine(steps: int) -> float:
    steps %= 24
    return _SINES[min(steps, 12 - steps)] if steps <= 12 else -_exact_sine(steps - 12)


def _turned(a: Vector, axis: int, c: Number, s: Number) -> Vector:
    """Planar rotation of a vector about a coordinate axis."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out = list(a)
    out[i], out[j] = a[i] * c - a[j] * s, a[i] * s + a[j] * c
    return out[0], out[1], out[2]


def _by_columns(model: RobotModel, k: int, q: Sequence[Number], constant: Constant) -> Link:
    """Link by the columns of the table."""
    table = model.table
    gamma, beta, alpha = (cosine_sine(constant(c, k + 1)) for c in ("gamma", "beta", "alpha"))
    theta, r = constant("theta", k + 1), constant("r", k + 1)
    # d lies along the axis x that gamma and beta turn; alpha does not turn it
    d = _turned((constant("d", k + 1), 0.0, 0.0), 1, *beta)
    shift = _turned((d[0], d[1], constant("b", k + 1) + d[2]), 2, *gamma)
    before = (2, *gamma), (1, *beta), (0, *alpha)
    return _link(model, k, int(table.antecedent[k]), q, shift, before, theta, r)


def _by_matrix(model: RobotModel, k: int, parent: int, q: Sequence[Number], T: Array) -> Link:
    """Link by its constant pose ``Trans Rot(z, gamma) Rot(x, alpha) Rot(z, theta)``."""
    R, shift = constant_pose(T)
    level = hypot(R[0][2], R[1][2])
    if level > 0.0:
        gamma, theta = atan2(R[0][2], -R[1][2]), atan2(R[2][0], R[2][1])
    else:
        gamma, theta = 0.0, atan2(R[1][0] * R[2][2], R[0][0])
    before = (2, *cosine_sine(gamma)), (0, *cosine_sine(atan2(level, R[2][2])))
    return _link(model, k, parent, q, shift, before, theta, 0.0)


def _link(
    model: RobotModel, k: int, parent: int, q: Sequence[Number], shift: Vector,
    before: Sequence[Turn], theta: Number, r: Number,
) -> Link:  # fmt: skip
    """Link with the joint's variable in its place."""
    sigma, j = model.table.sigma[k], int(model.chain.joint[k])
    if sigma == REVOLUTE and isinstance(theta, Scalar):
        last = cosine_sine(q[j] + theta)
    else:
        last = cosine_sine(q[j], theta) if sigma == REVOLUTE else cosine_sine(theta)
    if sigma == PRISMATIC:
        r = q[j] + r
    turns = tuple(turn for turn in (*before, (2, *last)) if turn[1:] != (1.0, 0.0))
    return Link(k + 1, parent, j, bool(sigma == PRISMATIC), shift, turns, r)
