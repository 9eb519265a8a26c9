"""Work arrays of the recursion, and the coordinates of motors and links.

A flexible joint has the coordinates of its motor and of its deflection, whose spring loads motor
and link with opposite torques; the link turns by their sum. Shapes as for `kernels.loads`.
"""

from typing import NamedTuple

import numpy as np

from ..kernels._compile import Floats, Ints, compiled
from ..kernels._vectors import Matrix
from .robot import Arm

ONE: Matrix = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


class Work(NamedTuple):
    """Arrays of the f + 1 bodies (row 0: base) with s coordinates at most, and of the modes."""

    W: Floats  # axes in the world
    R: Floats  # rotation of the tip section
    V: Floats  # (15,) root in the world, tip in the body; w, dw, u of the body, then of its tip
    X: Floats  # (6, 6) from motions of the antecedent's tip to the root
    T: Floats  # (6, s) from coordinates to motions of the tip
    A: Floats  # (s, s + 1) inertia and load of the coordinates
    I: Floats  # noqa: E741  # (6, 7) inertia and load of what follows, then its acceleration
    BT: Floats  # (6, s) inertia times T
    G: Floats  # (3, s) accelerations; loads of free coordinates, or accelerations; is free
    body: Floats  # inertial parameters
    now: Floats  # J_k, a, b, Phi and velocity of the section, at e
    K: Floats  # (1, modes, modes + 1) stiffness of a body
    all: Floats  # (1, 3, modes) as G, all free
    Q: Floats  # (3, n + modes) coordinates of the links, velocities and loads


def workspace(arm: Arm, free: Ints) -> Work:
    """Work arrays with the pose of the base and the free coordinates."""
    f, m, most, z = arm.pi.shape[0] + 1, arm.first.shape[0], arm.second.shape[1] // 18, np.zeros
    n = arm.deflection.shape[0]
    s = 7 + most
    work = Work(
        *(z((f, 3, 3)), z((f, 3, 3)), z((f, 15))),
        *(z((f, 6, 6)), z((f, 6, s)), z((f, s, s + 1)), z((f, 6, 7)), z((6, s)), z((f, 3, s))),
        *(z((f, 10)), z((m, 18)), z((1, most, most + 1)), z((1, 3, most)), z((3, n + m))),
    )
    work.all[0, 2] = 1.0
    work.W[0], work.V[0, :3] = arm.chain.base_rotation, arm.chain.base_position
    work.R[0] = np.eye(3)
    if len(free):
        work.G[0, 2], work.G[1:, 2, 7:] = free[n + 1], free[n]
        joint = arm.chain.joint
        work.G[1:, 2, 6] = np.where(joint < 0, 0, free[joint])
    return work


@compiled(counted=False)
def friction(arm: Arm, c: int, v: float) -> float:
    """Viscous and dry friction and offset of the drive of joint c."""
    return arm.drive[c, 1] * v + arm.drive[c, 2] * np.sign(v) + arm.drive[c, 3]


@compiled(counted=False)
def to_links(
    arm: Arm, y: Floats, dy: Floats, given: Floats, i: int, free: Ints, work: Work
) -> None:
    """Write the coordinates of the links and what is given of them."""
    n, Q = arm.deflection.shape[0], work.Q
    for c in range(Q.shape[1]):
        Q[0, c], Q[1, c], Q[2, c] = y[i, c], dy[i, c], given[i, c]
    for c in range(n):
        s = arm.deflection[c]
        if len(free) and free[n + 2]:
            Q[2, c] -= friction(arm, c, dy[i, c])
        if s >= 0:
            Q[0, c] += y[i, s]
            Q[1, c] += dy[i, s]
            spring = arm.drive[c, 4] * y[i, s] + arm.drive[c, 5] * dy[i, s]
            Q[2, c] = -spring if len(free) and free[c] else given[i, c] + given[i, s]


@compiled(counted=False)
def to_motors(
    arm: Arm, y: Floats, dy: Floats, given: Floats, i: int, free: Ints, out: Floats
) -> None:
    """Complete loads and accelerations of the motors and of the deflections of their joints."""
    n = arm.deflection.shape[0]
    for c in range(n):
        s, motor, rotor = arm.deflection[c], given[i, c], arm.drive[c, 0]
        drag = friction(arm, c, dy[i, c]) if free[n] else 0.0
        if s < 0:
            if not free[n + 2]:
                out[i, c] += drag
            continue
        spring = arm.drive[c, 4] * y[i, s] + arm.drive[c, 5] * dy[i, s]
        if not free[c]:
            out[i, s] = out[i, c] + spring
            out[i, c] += rotor * motor
        elif free[n + 2]:
            motor = (motor - drag + spring) / rotor
            out[i, s], out[i, c] = out[i, c] - motor, motor
        else:
            out[i, s], out[i, c] = out[i, c] - motor, rotor * motor - spring + drag
