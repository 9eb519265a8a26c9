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
from dataclasses import dataclass, replace
from math import cos, sin, sqrt

import numpy as np

from .._arrays import Array
from ..geometry import PRISMATIC, REVOLUTE
from ..model import RobotModel
from ..symbolic.angles import exact_turns
from .tape import Number, Scalar, Vector, cross, function, plus, times

Constant = Callable[[str, int], Number]
"""Value of a geometric parameter: column and number of the row."""
Pose = tuple[Sequence[Vector], Vector]
"""Rows of a rotation, and a position."""

_SINES = {0: 0.0, 2: 0.5, 3: sqrt(0.5), 4: sqrt(0.75), 6: 1.0}  # of multiples of 15 degrees


@dataclass(frozen=True, slots=True)
class Link:
    """Frame in its antecedent: the shift, the turns, then ``r`` along its own z axis."""

    antecedent: int
    joint: int  # column of q, -1 if it does not move
    slides: bool
    shift: Vector  # in the axes of the antecedent
    turns: tuple[tuple[int, Number, Number], ...]  # axis (0 x, 1 y, 2 z), cosine, sine
    r: Number
    lift: Number = 0.0  # place along the axis of a link without successors, if it is not r

    def inward(self, a: Vector) -> Vector:
        """Vector of the antecedent's axes in those of the link."""
        for axis, c, s in self.turns:
            a = _turned(a, axis, c, -s)
        return a

    def outward(self, a: Vector) -> Vector:
        """Vector of the link's axes in those of the antecedent."""
        for axis, c, s in reversed(self.turns):
            a = _turned(a, axis, c, s)
        return a


def _turned(a: Vector, axis: int, c: Number, s: Number) -> Vector:
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out = list(a)
    out[i], out[j] = a[i] * c - a[j] * s, a[i] * s + a[j] * c
    return out[0], out[1], out[2]


def links_of(model: RobotModel, q: Sequence[Number], constant: Constant) -> list[Link]:
    """The frames of a robot in the order of its table."""
    table, links = model.table, []
    for k, (sigma, j) in enumerate(zip(table.sigma, model.chain.joint.tolist(), strict=True)):
        gamma, b, beta, alpha, d, theta, r = (constant(c, k + 1) for c in COLUMNS)
        before = [(axis, *cosine_sine(x)) for axis, x in ((2, gamma), (1, beta), (0, alpha))]
        # d lies along the axis x that gamma and beta turn; alpha does not turn it
        x, y, z = _turned((d, 0.0, 0.0), *before[1])
        if sigma == REVOLUTE:
            is_number = not isinstance(theta, Scalar)
            last = cosine_sine(q[j], theta) if is_number else cosine_sine(q[j] + theta)
        else:
            last = cosine_sine(theta)
            r = q[j] + r if sigma == PRISMATIC else r
        turns = tuple(turn for turn in (*before, (2, *last)) if turn[1:] != (1.0, 0.0))
        shift, a = _turned((x, y, z + b), *before[0]), int(table.antecedent[k])
        links.append(Link(a, j, bool(sigma == PRISMATIC), shift, turns, r))
    return links


COLUMNS: tuple[str, ...] = ("gamma", "b", "beta", "alpha", "d", "theta", "r")


def lowered(links: Sequence[Link]) -> list[Link]:
    """Links without successors moved along their axes, so that no motion depends on ``r``."""
    inner = {link.antecedent - 1 for link in links}
    return [
        link if k in inner or link.slides else replace(link, r=0.0, lift=link.r)
        for k, link in enumerate(links)
    ]


def poses(model: RobotModel, links: Sequence[Link]) -> list[Pose]:
    """World poses of frames 0 to f."""
    out = [constant_pose(model.base)]
    for link in links:
        R, p = out[link.antecedent]
        p = plus(p, times(R, link.shift))
        R = [link.inward(row) for row in R]
        out.append((R, (p[0] + R[0][2] * link.r, p[1] + R[1][2] * link.r, p[2] + R[2][2] * link.r)))
    return out


def point_of(model: RobotModel, frame: str | int | None) -> tuple[int, Pose]:
    """Number of the table's frame that carries a frame, and the constant pose in it."""
    point, pose = model.twin.frame(frame), np.eye(4)
    pose[:3, :3], pose[:3, 3] = point.rotation, point.position
    return point.parent, constant_pose(pose)


def world_pose(places: Sequence[Pose], number: int, point: Pose) -> Pose:
    """World pose of a constant pose in a frame."""
    (R, p), (E, e) = places[number], point
    columns: Sequence[Vector] = list(zip(*E, strict=True))  # type: ignore[arg-type]
    return [times(columns, row) for row in R], plus(p, times(R, e))


def jacobian(
    model: RobotModel, links: Sequence[Link], number: int, point: Pose
) -> list[list[Number]]:
    """Rows of the world-aligned Jacobian of a constant pose in a frame."""
    places, zero = poses(model, links), (0.0, 0.0, 0.0)
    _, tip = world_pose(places, number, point)
    columns: list[tuple[Number, ...]] = [(0.0,) * 6] * model.n
    for k in model.table.path(number):
        link, (R, p) = links[k - 1], places[k]
        z = R[0][2], R[1][2], R[2][2]
        arm = tip[0] - p[0], tip[1] - p[1], tip[2] - p[2]
        if link.joint >= 0:
            columns[link.joint] = (*z, *zero) if link.slides else (*cross(z, arm), *z)
    return [[column[i] for column in columns] for i in range(6)]


def constant_pose(T: Array) -> Pose:
    """A constant pose, its rotation exact where it is 0 or +-1 to rounding."""
    R, near = T[:3, :3], np.round(T[:3, :3])
    rows = np.where(np.abs(R - near) < 1e-15, near + 0.0, R).tolist()
    return [tuple(row) for row in rows], tuple(T[:3, 3].tolist())


def cosine_sine(angle: Number, offset: float = 0.0) -> tuple[Number, Number]:
    """Cosine and sine of a variable (or constant) angle plus a constant."""
    if not isinstance(angle, Scalar):
        turns = exact_turns(angle + offset)
        if turns is None:
            return cos(angle + offset), sin(angle + offset)
        return _exact_sine(int(12 * turns) + 6), _exact_sine(int(12 * turns))
    turns = exact_turns(offset)
    if turns is None or (2 * turns).denominator > 1:
        return function("cos", angle + offset), function("sin", angle + offset)
    c, s = function("cos", angle), function("sin", angle)
    return ((c, s), (-s, c), (-c, -s), (s, -c))[int(2 * turns) % 4]


def _exact_sine(steps: int) -> float:
    steps %= 24
    return _SINES[min(steps, 12 - steps)] if steps <= 12 else -_exact_sine(steps - 12)
