"""Direct geometric model by Newton's method: the pose near a given one, for batches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_vector, batch_shape
from .._outcomes import Outcome
from ..errors import InvalidValueError
from .families import height_above
from .legs import check_robot, knees
from .looped import LoopedPlatform
from .results import Result
from .robot import Family, ParallelRobot


class PoseStatus(Outcome):
    """Outcome of an iterative direct model."""

    CONVERGED = 0, "The pose is found, on the same side of singular positions as the start."
    NOT_CONVERGED = (
        1,
        "No pose was found near the start; the legs may be too short to meet, see assembly_modes.",
    )
    LEFT_THE_MODE = (
        2,
        "A pose is found beyond a singular position: the determinant has another sign than at the "
        "start.",
    )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PlatformPoses(Result):
    """Poses of the platform. Read-only.

    Parameters
    ----------
    T : ndarray, shape (..., 4, 4)
        Poses; NaN where none was found.
    status : ndarray of int8, shape (...)
        Codes of `PoseStatus`.
    iterations : ndarray of int64, shape (...)
        Newton iterations.
    residual : ndarray, shape (...)
        Largest error of a leg's length, m.
    det : ndarray, shape (...)
        Determinants of the lines of the legs, see `assembly_modes`.
    """

    outcomes: ClassVar = PoseStatus
    T: Array
    status: NDArray[np.int8]
    iterations: NDArray[np.int64]
    residual: Array
    det: Array


def dgm(
    robot: ParallelRobot | LoopedPlatform, q: ArrayLike, T0: ArrayLike | None = None
) -> PlatformPoses:
    """Direct geometric model (forward kinematics) by Newton's method from a pose nearby.

    Where Newton's method leaves the assembly mode, the lengths are continued from those at the
    start in small pieces.

    Parameters
    ----------
    robot : ParallelRobot or LoopedPlatform
        The robot, m legs.
    q : array_like, shape (..., m)
        Actuated lengths, m, or angles, rad.
    T0 : array_like, shape (..., 4, 4), optional
        Where to start; default the home pose, of a Gough platform without limits raised to the
        mean of the lengths.

    Returns
    -------
    PlatformPoses
        Poses, with a status each.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        Arrays of the wrong shape, NaN, negative lengths, no poses.

    References
    ----------
    Seed book section 2.4.1.

    Examples
    --------
    >>> from robotmodels.parallel import dgm, gough_symmetric, igm
    >>> robot = gough_symmetric(1.0)
    >>> T = robot.pose([0.1, 0.0, 1.1, 0.1, 0.2, 0.0])
    >>> bool(abs(dgm(robot, igm(robot, T).q[0]).T - T).max() < 1e-12)
    True
    """
    check_robot(robot)
    if isinstance(robot, LoopedPlatform):
        return PlatformPoses(*robot.closed(q, T0))
    q = checked_actuators(robot, q)
    start = _start(robot, q) if T0 is None else robot.checked(T0, "T0")
    batch = batch_shape((q, start[..., 0]), ("q", "T0"))
    rows = np.ascontiguousarray(np.broadcast_to(q, (*batch, robot.m))).reshape(-1, robot.m)
    poses = np.ascontiguousarray(np.broadcast_to(start, (*batch, 4, 4))).reshape(-1, 4, 4)
    T, out = np.empty((len(rows), 4, 4)), np.empty((len(rows), 4))
    from .kernels import direct

    direct(*rods(robot, rows), poses, np.array(robot.columns), T, out)
    T[out[:, 0] == PoseStatus.NOT_CONVERGED] = np.nan
    code, iterations, residual, det = (x.reshape(batch) for x in out.T)
    T = T.reshape(*batch, 4, 4)
    return PlatformPoses(T, code.astype(np.int8), iterations.astype(np.int64), residual, det)


def checked_actuators(robot: ParallelRobot, q: ArrayLike) -> Array:
    """Actuated lengths or angles, lengths not negative. Shapes: -> (..., m)."""
    q = as_vector(q, robot.m, "q")
    if not robot.has_cranks and (q < 0.0).any():
        raise InvalidValueError(
            f"q: expected lengths of legs in metres that are not negative (not strokes), got "
            f"{q.min():.6g}."
        )
    return q


def rods(robot: ParallelRobot, q: Array) -> tuple[Array, Array, Array]:
    """Ends and lengths of the rods with locked actuators. Shapes: (N, m) -> (N, m, 3), ..."""
    c = np.ascontiguousarray(knees(robot, q))
    lengths = np.broadcast_to(robot.rod, q.shape) if robot.has_cranks else q
    return c, robot.platform, np.ascontiguousarray(lengths)


def _start(robot: ParallelRobot, q: Array) -> Array:
    """Where Newton's method starts without a given pose. Shapes: (..., m) -> (..., 4, 4)."""
    limited = np.isfinite(robot.upper).all()
    if (
        robot.family is not Family.GOUGH
        or limited
        or not np.allclose(robot.home[:3, :3], np.eye(3))
    ):
        return robot.home
    place = robot.base.mean(axis=0) - robot.platform.mean(axis=0)
    up = robot.home[:3, 3] - place
    normal = up / np.linalg.norm(up) if up.any() else np.array([0.0, 0.0, 1.0])
    start = np.broadcast_to(robot.home, (*q.shape[:-1], 4, 4)).copy()
    height = height_above(robot, place, normal, (q**2).mean(axis=-1))
    start[..., :3, 3] = place + height[..., None] * normal
    return start
