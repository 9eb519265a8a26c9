"""Velocity of the camera that regulates a task, and a status.

Parameters
----------
task : Task or Hybrid
    The task, k components.
measurement : array_like, shape (..., k) or (..., 4, 4)
    Measured s, or the pose of the object in the camera, which ``depth="true"`` needs.
camera : Camera, optional
    Whose image has to contain the object.
f, T : Points, Lines, ..., and array_like of shape (..., 4, 4)
    Feature that is kept by a virtual link, and poses of its object in the camera.

Returns
-------
ServoStep or VirtualLink
    Velocity, error, rank and status; or the motions that leave the feature unchanged.

References
----------
Book sections 6.3.2 and 6.3.3.

Examples
--------
>>> from robotmodels.se3 import rotation, translation
>>> from robotmodels.visual_servoing import Points, Sphere
>>> square = Points([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0]])
>>> goal = translation(0, 0, 0.5)
>>> camera_velocity(Task(square, goal), goal @ rotation("z", np.pi)).v.round(6) + 0.0
array([ 0. ,  0. , -0.5,  0. ,  0. ,  0. ])
>>> virtual_link(Sphere([0, 0, 0], 0.2), translation(0, 0, 1)).name
'ball joint'
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from .._arrays import LARGEST, Array, Frozen, Value, as_exact, read_only
from .._choices import as_instance
from .._outcomes import Outcome, Result
from ..errors import InvalidValueError
from .camera import Camera
from .features import Feature, as_sensed, sight_of
from .results import packed
from .tasks import Hybrid, Task

RANK_TOLERANCE = 1e-9
"""Singular values of an interaction matrix up to this part of the largest are zero."""
_ZERO = 1e-10  # error of a task that is met
_REDUCIBLE = 1e-3  # part of the error below which a velocity cannot reduce it


class ServoStatus(Outcome):
    """Outcome of a visual servoing law; fits int8.

    With the current matrix at true depths the velocity of ``CONVERGES`` reduces the error; with
    other matrices or depths the error may grow.
    """

    CONVERGES = 0, "The law gives a velocity, or the error is zero."
    AT_MINIMUM = 1, "The error is not zero, yet no velocity of the law reduces it: a local minimum."
    SINGULAR = 2, "The matrix of the law is singular here: parts of the error give no velocity."
    OUT_OF_SIGHT = 3, "A part of the object is outside the image."
    BEHIND = 4, "A part of the object is not in front of the camera, or is seen edge-on."
    LIMITED = 5, "The robot cannot follow: limits of joints, a singular posture, too few joints."
    STEADY_ERROR = 6, "The law gives velocities, yet an error stays: noise, or a moving target."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ServoStep(Result):
    """Velocity ``v`` (..., 6) of the camera, zero for an object that is behind it or out of sight.

    ``error`` (..., k) is ``s - s*``, NaN behind the camera; ``rank`` (...) that of the matrix of
    the law; ``status`` a `ServoStatus` or codes (...).
    """

    v: Array
    error: Array
    rank: int | NDArray[np.int8]
    status: ServoStatus | NDArray[np.int8]
    outcomes = ServoStatus

    def __post_init__(self) -> None:
        self.v.flags.writeable = self.error.flags.writeable = False  # quicker than copies


def camera_velocity(
    task: Task | Hybrid, measurement: Any, camera: Camera | None = None
) -> ServoStep:
    """Velocity of the camera that regulates a task."""
    check_kinds(task, camera=(camera, Camera))
    feature = task.regulated.feature
    given, is_pose = as_sensed(measurement, feature, "measurement")
    core = 2 if is_pose else 1
    batch = given.shape[:-core]
    rows = [given] if not batch else given.reshape(math.prod(batch), *given.shape[-core:])
    found = [law(task, *((None, x) if is_pose else (x, None)), camera)[:4] for x in rows]
    if not batch:
        return ServoStep(*found[0])
    v, error, ranks, codes = zip(*found, strict=True) if found else ((),) * 4
    return ServoStep(
        np.reshape(v, (*batch, 6)), np.reshape(error, (*batch, feature.size)),
        read_only(np.reshape(ranks, batch), np.int8), read_only(np.reshape(codes, batch), np.int8),
    )  # fmt: skip


def check_kinds(task: Any, **given: tuple[Any, type]) -> None:
    """Raise for anything but a task, and for options of another kind."""
    as_instance(getattr(task, "regulated", task), Task, "task", " or Hybrid")
    for name, (value, kind) in given.items():
        if value is not None:
            as_instance(value, kind, name)


def law(
    task: Task | Hybrid, s: Any, T: Array | None, camera: Camera | None = None, sight: Any = None
) -> tuple[Array, Array, int, ServoStatus, Array]:
    """Velocity, error, rank, status and pseudo-inverse (6, k) of a measurement, a pose or both."""
    primary = task.regulated
    feature, L_desired = primary.feature, primary.L_desired
    if sight is None and T is not None:
        sight = sight_of(feature, T)
    measured: Any = sight.s if s is None and sight is not None else s
    exists = sight is None or sight.exists
    error = primary.error(measured) if exists else np.full(feature.size, np.nan)
    size = math.hypot(*error.tolist())
    if not size < LARGEST:  # no measurement, or one from the plane of the object
        return np.zeros(6), np.nan * error, 0, ServoStatus.BEHIND, np.zeros((6, feature.size))
    mean = primary.interaction == "mean"
    A = primary.matrix(measured, sight) if L_desired is None or mean else L_desired
    inverse, rank = own, _ = pseudo_inverse(A)
    if mean and L_desired is not None:
        inverse = 0.5 * (own + pseudo_inverse(L_desired)[0])
        rank = pseudo_inverse(inverse)[1]
    direction, status = inverse @ error, ServoStatus.CONVERGES
    if size > _ZERO:
        seen = A @ direction
        if rank < min(A.shape) and rank < _generic_rank(feature):
            status = ServoStatus.SINGULAR
        elif math.sqrt(seen @ seen) <= _REDUCIBLE * size:
            status = ServoStatus.AT_MINIMUM
            if mean and np.linalg.norm(A @ (own @ error)) > _REDUCIBLE * size:
                status = ServoStatus.SINGULAR  # the two pseudo-inverses nearly cancel each other
    image = None if sight is None else sight.image
    if camera is not None and not feature._in_image(camera, measured, image):
        return np.zeros(6), error, rank, ServoStatus.OUT_OF_SIGHT, inverse
    v = -primary.gain * direction
    if isinstance(task, Hybrid):
        z = _secondary(task, s, T)
        v = v + task.weight * (z - own @ (A @ z))
    return v, error, rank, status, inverse


def pseudo_inverse(A: Array) -> tuple[Array, int]:
    """Pseudo-inverse and rank. Shapes: (k, 6) -> (6, k)."""
    U, S, Vt = np.linalg.svd(A, full_matrices=False)
    sizes = S.tolist()
    rank = sum(size > RANK_TOLERANCE * sizes[0] for size in sizes)
    return (Vt[:rank].T / S[:rank]) @ U[:, :rank].T, rank


@lru_cache(maxsize=64)
def _generic_rank(feature: Feature) -> int:
    """Rank of the interaction matrix where it is not singular: its largest at random poses."""
    T = np.tile(np.eye(4), (10, 8, 1, 1))
    T[..., :3, :3] = Rotation.random(8, random_state=0).as_matrix()
    T[..., 2, 3] = 10.0 ** np.arange(-2.0, 8.0)[:, None]
    L = feature.interaction(T[sight_of(feature, T).exists])
    return int(np.linalg.matrix_rank(L, rtol=RANK_TOLERANCE).max(initial=0))


def _secondary(task: Hybrid, s: Array | None, T: Array | None) -> Array:
    """Twist of the secondary motion."""
    if isinstance(task.secondary, Task):
        if T is None and task.secondary.feature != task.primary.feature:
            raise InvalidValueError(
                "measurement: expected the pose (4, 4), as the secondary task has another feature."
            )
        return law(task.secondary, None if T is not None else s, T)[0]
    if not callable(task.secondary):
        return task.secondary
    if T is None:
        raise InvalidValueError("measurement: a secondary function needs the pose (4, 4).")
    twist: Any = task.secondary(T.copy())
    return as_exact(twist, (6,), "secondary(T)")


def rate_matrix(v: Array) -> Array:
    """M of ``dT/dt = M T``, the motion of a fixed object in a camera with the twist v."""
    a, b, c, x, y, z = v.tolist()
    return np.array(((0.0, z, -y, -a), (-z, 0.0, x, -b), (y, -x, 0.0, -c), (0.0,) * 4))


def moved(T: Array, twist: Array) -> Array:
    """Pose of the object after the camera has moved by a constant twist for 1 s."""
    M, square = rate_matrix(twist), float(twist[3:] @ twist[3:])
    b, c = 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    if square > 1e-8:
        angle = math.sqrt(square)
        b, c = 2.0 * (math.sin(0.5 * angle) / angle) ** 2, (1.0 - math.sin(angle) / angle) / square
    MM = M @ M
    return T + (M + b * MM + c * (M @ MM)) @ T


_LINKS = {
    (0, 0): "rigid", (1, 1): "prismatic", (1, 0): "revolute", (2, 1): "cylindrical joint",
    (3, 2): "planar joint", (3, 0): "ball joint", (4, 2): "line contact",
    (4, 1): "sphere in a cylinder", (5, 2): "point contact", (6, 3): "free",
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class VirtualLink(Frozen, Value):
    """The motions of a camera that leave a feature unchanged at a pose (section 6.3.3.1).

    ``link_class`` (...) is their dimension, 6 - ``rank``; ``kernel_twists`` (..., class, 6)
    orthonormal twists [v; w], missing rows of a batch NaN; ``name`` (...) that of the mechanical
    link with as many rotations and translations, "" for others.
    """

    link_class: int | NDArray[np.int64]
    rank: int | NDArray[np.int64]
    kernel_twists: Array
    name: str | NDArray[np.str_] = ""


def virtual_link(f: Feature, T: ArrayLike) -> VirtualLink:
    """Virtual link between a camera and an object: the kernel of the interaction matrix."""
    _, sizes, Vt = np.linalg.svd(as_instance(f, Feature, "f").interaction(T))
    rank = (sizes > RANK_TOLERANCE * sizes[..., :1]).sum(axis=-1)
    free, motions = np.arange(6) >= rank[..., None], 6 - rank
    turns = np.where(free[..., None], Vt[..., 3:], 0.0)
    shifts = motions - np.linalg.matrix_rank(turns, tol=1e-6)
    kernel = packed(free, Vt)[1]
    names = [_LINKS.get(pair, "") for pair in zip(motions.flat, shifts.flat, strict=True)]
    if not motions.ndim:
        return VirtualLink(int(motions), int(rank), kernel, names[0])
    return VirtualLink(motions, rank, kernel, np.reshape(np.array(names, str), motions.shape))
