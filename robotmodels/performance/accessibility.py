"""Accessibility of positions and poses (sections 3.2.1 and 3.2.2): reached or not, and why.

Parameters
----------
arm, limits, free, mask, executor, progress
    See `robotmodels.performance`; of one component of the orientation 180 angles about its axis,
    from the orientation of zero joints, represent all of them.
T : array_like, shape (..., 4, 4)
    World poses of the tool.
level : {"position", "pose", "every_orientation"}
    The request: the position in any orientation, the pose, or the position in every
    orientation, of which 96 represent all (180 angles for an arm that moves in a plane).

Returns
-------
Accessibility
    Of each pose ``status`` (...), codes of `AccessStatus`, and ``count`` (...), the postures within
    the limits and free of collisions; of several orientations the least, of an infinite family
    the members that were found. ``level`` as requested.

Examples
--------
>>> from robotmodels.robots import load
>>> from robotmodels.se3 import translation
>>> found = accessibility(load("planar_2r"), [translation(1, 1, 0), translation(3, 0, 0)],
...                       level="position")
>>> found.count, found.reason(1)
(array([2, 0]), 'No posture reaches the position.')
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from math import pi
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_mask
from .._arrays.tasks import Progress, Workers
from .._choices import one_of
from .._outcomes import Outcome, Result
from ..igm import IGMStatus, igm
from ..igm.families import known_arm, solver_for
from ..igm.request import Task, poses_of
from ..igm.solver import Tolerances, postures
from ..kinematics import dgm
from ..model import RobotModel
from . import arms
from .arms import Flags, Ints, JointSpace

LEVELS = ("position", "pose", "every_orientation")
ANGLES, ROTATIONS = 180, 96  # orientations that represent all, in a plane and in space
_AT_A_TIME = 16384


class AccessStatus(Outcome):
    """Outcome of one position or pose; fits int8."""

    ACCESSIBLE = 0, "A posture within the limits and free of collisions reaches it."
    OUT_OF_REACH = 1, "No posture reaches the position."
    ONLY_OUTSIDE_LIMITS = 2, "Only postures outside the joint limits reach it."
    ONLY_IN_COLLISION = 3, "Every posture within the limits that was found is in collision."
    ORIENTATION_NOT_AVAILABLE = 4, "The position is reached, but not in all requested orientations."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Accessibility(Result):
    """Accessibility of poses, see the head of the file."""

    outcomes: ClassVar = AccessStatus
    status: NDArray[np.int8]
    count: Ints
    level: str


def accessibility(
    arm: RobotModel,
    T: ArrayLike,
    level: str = "pose",
    limits: bool = True,
    free: Any = None,
    mask: ArrayLike | str | None = None,
    executor: Executor | None = None,
    progress: Progress = None,
) -> Accessibility:
    """Accessibility of poses: can the tool be brought there, and if not, why."""
    space, work = arms.joint_space(arm, limits, free), Workers(executor, progress)
    one_of(level, LEVELS, "level")
    poses = poses_of(T)
    batch, rows = poses.shape[:-2], poses.reshape(-1, 4, 4)
    components = None if mask is None else as_mask(mask)
    place = arms.PLACE if components is None else components & arms.PLACE
    requested = components if level == "pose" else place
    first = work.part(0.0, 0.1 if level == "every_orientation" else 1.0)
    status, count = posture_counts(space, rows, requested, first)
    if level == "every_orientation":
        reached = np.flatnonzero(status == AccessStatus.ACCESSIBLE)
        status[reached], count[reached] = in_every_orientation(
            space, rows[reached, :3, 3], components, work.part(0.1, 1.0)
        )
    lost = np.flatnonzero(status == AccessStatus.OUT_OF_REACH)
    if lost.size and level == "pose":
        reasons = igm(arm, rows[lost], mask=components).status
        oriented = reasons == IGMStatus.ORIENTATION_NOT_AVAILABLE
        status[lost[oriented]] = AccessStatus.ORIENTATION_NOT_AVAILABLE
    return Accessibility(status.reshape(batch), count.reshape(batch), level)


def posture_counts(
    space: JointSpace, poses: Array, mask: Flags | None, work: Workers
) -> tuple[NDArray[np.int8], Ints]:
    """Status and number of postures of poses (N, 4, 4)."""
    status, count = work.rows(partial(_counts, space, mask), _AT_A_TIME, poses)
    return status, count


def _counts(space: JointSpace, mask: Flags | None, poses: Array) -> tuple[NDArray[Any], ...]:
    q, valid, oriented = postures_of(space.model, poses, mask)
    q, inside = space.within(q)
    outside = np.flatnonzero(valid.any(axis=1) & ~(valid & inside).any(axis=1))
    if outside.size and (mask is None or arms.section_arm(space.model) is None):
        # other members of an infinite family may lie within the limits
        found = igm(space.model, poses[outside], mask=mask, limits=True)
        S = min(found.q.shape[1], q.shape[1])
        n, s = np.nonzero(found.valid[:, :S])
        q[outside[n], s], valid[outside[n], s], inside[outside[n], s] = found.q[n, s], True, True
    free = free_of(space, q, valid & inside)
    status = np.select(
        [free.any(axis=1), (valid & inside).any(axis=1), valid.any(axis=1), oriented],
        [
            AccessStatus.ACCESSIBLE,
            AccessStatus.ONLY_IN_COLLISION,
            AccessStatus.ONLY_OUTSIDE_LIMITS,
            AccessStatus.ORIENTATION_NOT_AVAILABLE,
        ],
        AccessStatus.OUT_OF_REACH,
    )
    return status.astype(np.int8), free.sum(axis=1)


def allowed_postures(space: JointSpace, poses: Array, mask: Flags | None) -> tuple[Array, Flags]:
    """Postures q (N, S, n), and which are within the limits and free (N, S)."""
    q, valid, _ = postures_of(space.model, poses, mask)
    q, inside = space.within(q)
    return q, free_of(space, q, valid & inside)


def free_of(space: JointSpace, q: Array, valid: Flags) -> Flags:
    """Which of the valid postures (N, S) are free of collisions."""
    if space.free is not None and valid.any():
        valid[valid] = space.is_free(q[valid])
    return valid


def postures_of(arm: RobotModel, poses: Array, mask: Flags | None) -> tuple[Array, Flags, Flags]:
    """Postures q (N, S, n), valid (N, S), and poses (N,) that lack only the orientation."""
    section = arms.section_arm(arm)
    if section is not None and mask is not None and (mask == arms.PLACE).all():
        q, valid, _ = section.postures(poses[:, :3, 3])
        return section.model_postures(arm, q), valid, np.zeros(len(poses), np.bool_)
    known = known_arm(arm, mask is None)
    task = Task() if mask is None else Task(mask=tuple(mask.tolist()))
    solver = solver_for(arm, known, task)
    if solver is None or solver.chain.k > (6 if mask is None else int(mask.sum())):
        found = igm(arm, poses, mask=mask)
        oriented = found.status == IGMStatus.ORIENTATION_NOT_AVAILABLE
        return np.array(found.q), np.array(found.valid), oriented
    # the solver alone: reasons of poses that are not reached are not needed here
    U = np.ascontiguousarray(known.to_base @ poses)
    solved = postures(solver, U, np.zeros((len(U), solver.chain.k)), Tolerances())
    q = np.where(solved.valid[..., None], 0.0, np.nan) * np.ones(arm.n)
    q[..., solver.chain.columns] = solved.q
    return q, solved.valid.copy(), np.zeros(len(poses), np.bool_)


def orientations(arm: RobotModel, mask: Flags | None = None) -> Array:
    """Orientations (K, 3, 3) that represent all: about the requested axis, the normal, or any."""
    from scipy.spatial.transform import Rotation

    normal = arms.plane_normal(arm)
    if mask is not None and mask[3:].sum() == 1:
        normal = mask[3:].astype(float)
    if normal is not None:
        # far from each other in turn, so that what fails is left out early
        angles = 2.0 * pi * (np.arange(ANGLES) * 71 % ANGLES) / ANGLES
        return (
            Rotation.from_rotvec(angles[:, None] * normal).as_matrix()
            @ dgm(arm, np.zeros(arm.n))[:3, :3]
        )
    u, v, w = arms.sequence(ROTATIONS, 3).T * [[1.0], [2.0 * pi], [2.0 * pi]]
    a, b = np.sqrt(1.0 - u), np.sqrt(u)
    # unit quaternions, spread evenly (K. Shoemake, Uniform random rotations, 1992)
    spread = np.column_stack((a * np.sin(v), a * np.cos(v), b * np.sin(w), b * np.cos(w)))
    return Rotation.from_quat(spread).as_matrix()


def in_every_orientation(
    space: JointSpace, positions: Array, mask: Flags | None, work: Workers
) -> tuple[NDArray[np.int8], Ints]:
    """Status of the first orientation that fails, and the least count, of positions (N, 3).

    A mask without components of the orientation means all of them.
    """
    requested = mask if mask is not None and mask[3:].any() else None
    status = np.zeros(len(positions), np.int8)
    count = np.full(len(positions), np.iinfo(np.int64).max)
    rest, every = np.arange(len(positions)), orientations(space.model, requested)
    for k, R in enumerate(every if rest.size else ()):
        T = np.tile(np.eye(4), (rest.size, 1, 1))
        T[:, :3, :3], T[:, :3, 3] = R, positions[rest]
        part = work.part(k / len(every), (k + 1) / len(every))
        found, number = posture_counts(space, T, requested, part)
        count[rest] = np.minimum(count[rest], number)
        out = found == AccessStatus.OUT_OF_REACH
        status[rest] = np.where(out, AccessStatus.ORIENTATION_NOT_AVAILABLE, found)
        rest = rest[found == AccessStatus.ACCESSIBLE]
        if not rest.size:
            break
    work.done()
    return status, count
