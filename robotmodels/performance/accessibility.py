"""Accessibility of positions and poses: section 3.2 of the book."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_mask, read_only
from .._outcomes import Outcome
from ..errors import InvalidValueError
from ..igm import IGMStatus, igm
from ..igm.known import known_arm, solver_for
from ..igm.request import Task, poses_of
from ..igm.solver import Tolerances, postures
from ..kinematics import dgm
from ..model import RobotModel, check_model
from .arms import (
    Free,
    Result,
    checked_flag,
    checked_word,
    free_predicate,
    plane_normal,
    section_arm,
    sequence,
    turned_inside,
)

LEVELS = ("position", "pose", "every_orientation")
ANGLES, ROTATIONS = 180, 96  # orientations that stand for all, in a plane and in space
_AT_A_TIME = 16384


class AccessStatus(Outcome):
    """Outcome of one position or pose; fits int8."""

    ACCESSIBLE = 0, "A posture within the limits and free of collisions reaches it."
    OUT_OF_REACH = 1, "No posture reaches the position."
    ONLY_OUTSIDE_LIMITS = 2, "Only postures outside the joint limits reach it."
    ONLY_IN_COLLISION = 3, "Every posture within the limits that was found is in collision."
    ORIENTATION_NOT_AVAILABLE = 4, "The position is reached, but not in every orientation asked."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Accessibility(Result):
    """Accessibility of poses.

    Parameters
    ----------
    status : ndarray of int8, shape (...)
        Codes of `AccessStatus`.
    count : ndarray of int64, shape (...)
        Postures within the limits and free of collisions; of several orientations the least.
        Of an infinite family the members that were found.
    level : str
        What was asked: position, pose, or every orientation.
    """

    status: NDArray[np.int8]
    count: NDArray[np.int64]
    level: str

    def reason(self, i: int | tuple[int, ...] = ()) -> str:
        """Outcome of one pose as a sentence; ``i`` is left out for a single pose."""
        try:
            code = np.asarray(self.status[i] if self.status.ndim else self.status)
        except (IndexError, TypeError):
            code = np.zeros(1)
        if code.ndim:
            raise InvalidValueError(
                f"i: expected the index of one pose among {self.status.shape}, got {i!r}."
            )
        return AccessStatus(int(code)).sentence

    def __repr__(self) -> str:
        codes, numbers = np.unique(self.status, return_counts=True)
        text = [f"{m} {AccessStatus(int(c)).name}" for c, m in zip(codes, numbers, strict=True)]
        return f"<Accessibility of {self.level}, {self.status.shape}: {', '.join(text) or 'none'}>"


def accessibility(
    arm: RobotModel,
    T: ArrayLike,
    level: str = "pose",
    limits: bool = True,
    free: Any = None,
    mask: ArrayLike | str | None = None,
) -> Accessibility:
    """Accessibility of poses: can the tool be brought there, and if not, why.

    Parameters
    ----------
    arm : RobotModel
        The robot.
    T : array_like, shape (..., 4, 4)
        World poses of the tool.
    level : {"position", "pose", "every_orientation"}
        What is asked: the position in any orientation, the pose, or the position in every
        orientation, of which 96 stand for all (180 angles for an arm that moves in a plane).
    limits : bool
        Whether the joint limits count.
    free : callable or obstacles, optional
        Function of q (N, n) that returns bool (N,), or obstacles the links must not touch.
    mask : array_like, shape (6,), optional
        Components of the pose that are asked, see `igm`. Of one component of the orientation
        180 angles about its axis, from the orientation of zero joints, stand for every one.

    Returns
    -------
    Accessibility
        Status and number of postures of each pose.

    Raises
    ------
    ShapeError, InvalidValueError
        Matrices that are no poses, an unknown level, ``free`` of the wrong kind.

    References
    ----------
    Seed book sections 3.2.1 and 3.2.2.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.se3 import translation
    >>> found = accessibility(load("planar_2r"), [translation(1, 1, 0), translation(3, 0, 0)],
    ...                       level="position")
    >>> found.count, found.reason(1)
    (array([2, 0]), 'No posture reaches the position.')
    """
    check_model(arm)
    checked_word(level, LEVELS, "level")
    poses = poses_of(T)
    batch = poses.shape[:-2]
    rows = poses.reshape(-1, 4, 4)
    bounded, is_free = checked_flag(limits, "limits"), free_predicate(arm, free)
    components = None if mask is None else as_mask(mask)
    if level == "every_orientation":
        status, count = _every_orientation(arm, rows, bounded, is_free, components)
    else:
        if level == "position":
            place = np.repeat((True, False), 3)
            components = place if components is None else components & place
        status, count = posture_counts(arm, rows, components, bounded, is_free)
        lost = np.flatnonzero(status == AccessStatus.OUT_OF_REACH)
        if lost.size and level == "pose":
            reasons = igm(arm, rows[lost], mask=components).status
            oriented = reasons == IGMStatus.ORIENTATION_NOT_AVAILABLE
            status[lost[oriented]] = AccessStatus.ORIENTATION_NOT_AVAILABLE
    return Accessibility(
        read_only(status.reshape(batch), np.int8), read_only(count.reshape(batch), np.int64), level
    )


def posture_counts(
    arm: RobotModel,
    poses: Array,
    mask: NDArray[np.bool_] | None,
    limits: bool,
    is_free: Free | None,
) -> tuple[NDArray[np.int8], NDArray[np.int64]]:
    """Status and number of postures of poses (N, 4, 4)."""
    status, count = np.zeros(len(poses), np.int8), np.zeros(len(poses), np.int64)
    for k in range(0, len(poses), _AT_A_TIME):
        part = slice(k, k + _AT_A_TIME)
        q, valid, oriented = postures_of(arm, poses[part], mask)
        reached = valid.any(axis=1)
        q, inside = turned_inside(arm, q, limits)
        valid &= inside
        allowed = valid.any(axis=1)
        if is_free is not None:
            valid = with_free(valid, q, is_free)
        count[part] = valid.sum(axis=1)
        status[part] = np.select(
            [valid.any(axis=1), allowed, reached, oriented],
            [
                AccessStatus.ACCESSIBLE,
                AccessStatus.ONLY_IN_COLLISION,
                AccessStatus.ONLY_OUTSIDE_LIMITS,
                AccessStatus.ORIENTATION_NOT_AVAILABLE,
            ],
            AccessStatus.OUT_OF_REACH,
        )
    return status, count


def postures_of(
    arm: RobotModel, poses: Array, mask: NDArray[np.bool_] | None
) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """Postures q (N, S, n), valid (N, S), and poses (N,) that lack only the orientation."""
    section = section_arm(arm)
    if (
        section is not None
        and mask is not None
        and not mask[3:].any()
        and (mask[:3].all() or (section.columns[0] < 0 and _spans(section.frame, mask[:3])))
    ):
        positions = poses[:, :3, 3]
        if not mask[:3].all():
            # in a plane what is not asked is that of the plane
            plane, origin = section.frame[:3, :2], section.frame[:3, 3]
            inverse = np.linalg.inv(plane[mask[:3]])
            positions = origin + (positions - origin)[:, mask[:3]] @ inverse.T @ plane.T
        q, valid = section.postures(positions)
        return section.model_postures(arm, q), valid, np.zeros(len(poses), np.bool_)
    known = known_arm(arm, mask is None)
    task = Task() if mask is None else Task(mask=tuple(mask.tolist()))
    solver = solver_for(arm, known, task)
    if solver is None or solver.chain.k > (6 if mask is None else int(mask.sum())):
        found = igm(arm, poses, mask=mask)
        oriented = found.status == IGMStatus.ORIENTATION_NOT_AVAILABLE
        return np.array(found.q), np.array(found.valid), oriented
    # the solver alone: why a pose is not reached is not asked here
    U = np.ascontiguousarray(known.to_base @ poses)
    solved = postures(solver, U, np.zeros((len(U), solver.chain.k)), Tolerances())
    q = np.where(solved.valid[..., None], 0.0, np.nan) * np.ones(arm.n)
    q[..., solver.chain.columns] = solved.q
    return q, solved.valid.copy(), np.zeros(len(poses), np.bool_)


def _spans(frame: Array, mask: NDArray[np.bool_]) -> bool:
    """Whether two components of a position determine a point of the plane of a frame."""
    return mask.sum() == 2 and abs(float(np.linalg.det(frame[:3, :2][mask]))) > 1e-9


def with_free(valid: NDArray[np.bool_], q: Array, is_free: Free) -> NDArray[np.bool_]:
    """Rows that are valid and free. Shapes: valid (N, S), q (N, S, n)."""
    kept = valid.copy()
    kept[valid] = is_free(q[valid]) if valid.any() else False
    return kept


def orientations(arm: RobotModel, mask: NDArray[np.bool_] | None = None) -> Array:
    """Orientations (K, 3, 3) that stand for all: about the axis asked, the normal, or any."""
    normal = plane_normal(arm)
    if mask is not None and mask[3:].sum() == 1:
        normal = mask[3:].astype(float)
    if normal is not None:
        home = dgm(arm, np.zeros(arm.n))[:3, :3]
        angles = 2.0 * pi * np.arange(ANGLES) / ANGLES
        skew = np.cross(np.eye(3), -normal)
        s, c = np.sin(angles)[:, None, None], 1.0 - np.cos(angles)[:, None, None]
        return np.asarray((np.eye(3) + s * skew + c * (skew @ skew)) @ home)
    u, v, w = sequence(ROTATIONS, 3).T
    a, b = np.sqrt(1.0 - u), np.sqrt(u)
    v, w = 2.0 * pi * v, 2.0 * pi * w
    x, y, z, s = a * np.sin(v), a * np.cos(v), b * np.sin(w), b * np.cos(w)
    # rotations of unit quaternions, spread evenly (K. Shoemake, Uniform random rotations, 1992)
    return np.moveaxis(
        np.array([
            [1 - 2 * (y * y + z * z), 2 * (x * y - s * z), 2 * (x * z + s * y)],
            [2 * (x * y + s * z), 1 - 2 * (x * x + z * z), 2 * (y * z - s * x)],
            [2 * (x * z - s * y), 2 * (y * z + s * x), 1 - 2 * (x * x + y * y)],
        ]), 2, 0,
    )  # fmt: skip


def _every_orientation(
    arm: RobotModel,
    poses: Array,
    limits: bool,
    is_free: Free | None,
    mask: NDArray[np.bool_] | None,
) -> tuple[NDArray[np.int8], NDArray[np.int64]]:
    """The worst status and the least count over the orientations."""
    place = np.repeat((True, False), 3)
    place = place if mask is None else place & mask
    status, count = posture_counts(arm, poses, place, limits, is_free)
    rows = np.flatnonzero(status == AccessStatus.ACCESSIBLE)
    worst, least = in_every_orientation(arm, poses[rows, :3, 3], limits, is_free, mask)
    status[rows], count[rows] = worst, least
    return status, count


def in_every_orientation(
    arm: RobotModel,
    positions: Array,
    limits: bool,
    is_free: Free | None,
    mask: NDArray[np.bool_] | None = None,
) -> tuple[NDArray[np.int8], NDArray[np.int64]]:
    """Status of the first orientation that fails, and the least count, of positions (N, 3).

    A mask without components of the orientation asks for all of them.
    """
    asked = mask if mask is not None and mask[3:].any() else None
    status = np.zeros(len(positions), np.int8)
    count = np.full(len(positions), np.iinfo(np.int64).max)
    rest = np.arange(len(positions))
    for R in orientations(arm, asked):
        if not rest.size:
            break
        T = np.tile(np.eye(4), (rest.size, 1, 1))
        T[:, :3, :3], T[:, :3, 3] = R, positions[rest]
        found, number = posture_counts(arm, T, asked, limits, is_free)
        count[rest] = np.minimum(count[rest], number)
        out = found == AccessStatus.OUT_OF_REACH
        status[rest] = np.where(out, AccessStatus.ORIENTATION_NOT_AVAILABLE, found)
        rest = rest[found == AccessStatus.ACCESSIBLE]
    return status, count
