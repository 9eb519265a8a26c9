"""Structure of an arm for closed forms: axes that meet, axes that are parallel.

The six joints and the pose form a loop. Any joint can be called the first and the loop has no
direction, so one solver for three axes that meet at the end of the chain also serves arms
whose shoulder or middle axes meet, and one for three parallel axes those that are mirrored.

Source: D. L. Pieper, "The kinematics of manipulators under computer control", 1968.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array
from .loop import JointChain

LENGTH_TOLERANCE = 1e-9
"""Axes that miss each other by less (m) meet, so that a URDF's rounded numbers still count."""
ANGLE_TOLERANCE = 1e-9
"""Axes that differ in direction by less (rad) are parallel."""


class Family(Enum):
    """Families of six-joint arms with a closed form."""

    CONCURRENT = "three revolute axes that meet in a point (Pieper)"
    PARALLEL = "three consecutive revolute axes that are parallel"


@dataclass(frozen=True, slots=True, eq=False)
class LoopPlan:
    """A six-joint arm as a loop of normal form, ready for a solver.

    Shapes: order, sigma (6,); constants (6, 4, 4); left, right (4, 4); meeting (2,).
    """

    family: Family
    order: NDArray[np.int64]
    sense: float
    constants: Array
    slot: int
    left: Array
    right: Array
    inverted: bool
    sigma: NDArray[np.int64]
    meeting: Array
    size: float
    backwards: bool = False
    """Whether the first three joints are solved from their other end, where two axes are simple."""


def plan_loop(chain: JointChain) -> LoopPlan | None:
    """Find the closed form of a six-joint arm and the joint where its loop starts."""
    if chain.k != 6:
        return None
    best: tuple[int, LoopPlan] | None = None
    for reverse in (False, True):
        for shift in range(6):
            plan = _loop(chain, shift, reverse)
            for rank, found in ((0, _concurrent(plan)), (1, _parallel(plan))):
                # plain order and a wrist at the end are preferred: fewer moves to explain
                cost = 100 * rank + 10 * (found is not None and found.backwards) + 20 * shift
                cost += 5 * reverse
                if found is not None and (best is None or cost < best[0]):
                    best = cost, found
    return None if best is None else best[1]


def _loop(chain: JointChain, shift: int, reverse: bool) -> LoopPlan:
    """The loop that starts at a joint and runs with or against the chain."""
    D = chain.D
    joints = np.arange(6)
    E = np.empty((6, 4, 4))
    E[:5] = D[1:6]
    E[5] = np.eye(4)
    left, right = D[6], D[0]
    if reverse:
        joints = joints[::-1]
        E[:5] = se3.inverse(D[1:6])[::-1]
        left, right = se3.inverse(D[0]), se3.inverse(D[6])
    order = np.roll(joints, -shift)
    size = float(np.linalg.norm(D[1:6, :3, 3], axis=1).sum()) or 1.0
    return LoopPlan(
        family=Family.CONCURRENT,
        order=order,
        sense=-1.0 if reverse else 1.0,
        constants=np.ascontiguousarray(np.roll(E, -shift, axis=0)),
        slot=5 - shift,
        left=np.ascontiguousarray(left),
        right=np.ascontiguousarray(right),
        inverted=not reverse,
        sigma=chain.sigma[order],
        meeting=np.zeros(2),
        size=size,
    )


def _concurrent(plan: LoopPlan) -> LoopPlan | None:
    """Axes 3, 4, 5 of the loop turn and meet, and the first three are independent."""
    E = plan.constants
    if plan.sigma[3:].any() or plan.slot in (3, 4):
        return None
    # axes 3 and 5 seen from the frame of joint 4, whose axis is z through the origin
    into = se3.inverse(E[3])
    on_first = _meets_z(into[:3, 3], into[:3, 2])
    on_last = _meets_z(E[4][:3, 3], E[4][:3, 2])
    if on_first is None or on_last is None or abs(on_first[0] - on_last[0]) > LENGTH_TOLERANCE:
        return None
    first, second = (_pair(E[0], plan.sigma[0], plan.sigma[1]),
                     _pair(E[1], plan.sigma[1], plan.sigma[2]))  # fmt: skip
    slots = {0: plan.slot == 0, 1: plan.slot == 1}
    if (first is None and not slots[0]) or (second is None and not slots[1]):
        return None
    backwards = not (first or slots[0]) and bool(second) and not slots[1]
    return replace(plan, meeting=np.array([on_first[1], on_last[1]]), backwards=backwards)


def _meets_z(point: Array, direction: Array) -> tuple[float, float] | None:
    """Intersection of a line and the z axis: height on z, and distance along the line."""
    across = np.hypot(direction[0], direction[1])
    if across < 1e-6:
        return None
    way = -(point[0] * direction[0] + point[1] * direction[1]) / across**2
    meeting = point + way * direction
    if np.hypot(meeting[0], meeting[1]) > LENGTH_TOLERANCE:
        return None
    return float(meeting[2]), float(way)


def _pair(E: Array, sigma_0: int, sigma_1: int) -> bool | None:
    """Whether two axes are a simple pair (meet or parallel); None if they coincide."""
    parallel = np.hypot(E[0, 2], E[1, 2]) < ANGLE_TOLERANCE
    if sigma_0 == 0 and sigma_1 == 0:
        if parallel:
            return None if np.hypot(E[0, 3], E[1, 3]) < LENGTH_TOLERANCE else True
        return bool(abs(E[0, 2] * E[1, 3] - E[1, 2] * E[0, 3]) < LENGTH_TOLERANCE)
    if sigma_0 == 1 and sigma_1 == 1:
        return None if parallel else True
    return True


def _parallel(plan: LoopPlan) -> LoopPlan | None:
    """Axes 1, 2, 3 of the loop are parallel and apart, and all joints turn."""
    E = plan.constants
    if plan.sigma.any() or plan.slot in (1, 2):
        return None
    for constant in (E[1], E[2]):
        if np.hypot(constant[0, 2], constant[1, 2]) > ANGLE_TOLERANCE:
            return None
        if np.hypot(constant[0, 3], constant[1, 3]) < LENGTH_TOLERANCE:
            return None
    for place in (0, 3):
        side = E[place]
        if plan.slot != place and np.hypot(side[0, 2], side[1, 2]) < ANGLE_TOLERANCE:
            return None  # four parallel axes
    if plan.slot != 4 and np.hypot(E[4][0, 2], E[4][1, 2]) < ANGLE_TOLERANCE:
        return None
    if plan.slot == 4:
        return replace(plan, family=Family.PARALLEL)
    # the frame of joint 5 slides along its axis towards axis 4: where the axes meet it is then seen
    constants, left = plan.constants.copy(), plan.left
    slide = np.eye(4)
    slide[2, 3] = constants[4, :3, 3] @ constants[4, :3, 2]
    constants[4, :3, 3] -= slide[2, 3] * constants[4, :3, 2]
    if plan.slot == 5:
        left = slide @ left
    else:
        constants[5] = slide @ constants[5]
    return replace(plan, family=Family.PARALLEL, constants=constants, left=left)
