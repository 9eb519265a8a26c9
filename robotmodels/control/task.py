"""Task space: the error of the tool's pose, and joint accelerations that change it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_mask
from ..errors import InvalidValueError, ShapeError
from ..kinematics import dgm, jacobian, jacobian_rate
from ..model import RobotModel
from .law import NO_WRENCH

RANK = 1e-9  # relative singular value
_SQUARES = 1e-10  # relative pivot of J J^T
Desired = tuple[Array, Array, Array]


class TaskError(NamedTuple):
    """Error, rate and drift (m,), Jacobian (m, n): the second derivative is ``drift + J a``.

    ``force`` is the wrench exerted on the environment, in the coordinates of the error.
    """

    e: Array
    de: Array
    J: Array
    drift: Array
    force: Array


class ToolMotion(NamedTuple):
    """Pose (4, 4), Jacobian (6, n), twist and drift of the twist ``dJ/dt v`` (6,) of a frame."""

    T: Array
    J: Array
    twist: Array
    drift: Array


def tool_motion(model: RobotModel, q: Array, v: Array, frame: Any = None) -> ToolMotion:
    """Where a frame is and how it moves, in world axes."""
    if q.ndim != 1 or v.ndim != 1:
        raise ShapeError(
            f"q, v: expected one posture, shape ({model.n},), got {q.shape}, {v.shape}."
        )
    J = jacobian(model, q, frame)
    return ToolMotion(dgm(model, q, frame), J, J @ v, jacobian_rate(model, q, v, frame) @ v)


def task_error(
    tool: ToolMotion, desired: Desired, rows: NDArray[np.int64], wrench: Array = NO_WRENCH
) -> TaskError:
    """Rows of the error ``[p_d - p; log(R_d R^T)]`` in world axes, wrench at the frame's origin."""
    from .kernels import pose_errors

    out, J = np.empty((4, 6)), np.empty(tool.J.shape)
    pose_errors(*desired, *tool, wrench, np.empty((3, 3)), J, out)
    if len(rows) < 6:
        out, J = out[:, rows], J[rows]
    return TaskError(out[0], out[1], J, out[2], out[3])


def task_rows(
    model: RobotModel, mask: ArrayLike | None, frame: Any = None, turn: Array | None = None
) -> NDArray[np.int64]:
    """Rows of the task, m <= n: of a mask, or the first that the robot moves independently."""
    n = model.n
    if mask is not None:
        given = np.flatnonzero(as_mask(mask))
        if len(given) > n:
            raise InvalidValueError(
                f"mask: {len(given)} components are more than the {n} joints of {model.name!r} "
                "control; choose fewer."
            )
        return given
    J = jacobian(model, np.random.default_rng(0).uniform(-2.0, 2.0, (4, n)), frame)
    J = J if turn is None else turn @ J
    rows: list[int] = []
    for row in range(6):
        ranks = np.linalg.matrix_rank(J[:, [*rows, row]], rtol=RANK)
        if len(rows) < n and (ranks > len(rows)).any():
            rows.append(row)
    return np.array(rows, dtype=np.int64)


def accelerations(J: Array, wanted: Array, v: Array, damping: Any) -> Array:
    """Joint accelerations a with ``J a = wanted``; motions of no effect are damped.

    Least squares where the rows cannot all be met: directions whose singular value is below RANK of
    the largest are left out, as motions of no effect.
    """
    from scipy.linalg.lapack import dgesv

    m, n = J.shape
    if m == n:
        upper, _, a, _ = dgesv(J, wanted)
        if _regular(upper, RANK):
            return a
    free = -np.max(damping) * v
    missing = wanted - J @ free
    if m < n:  # squares of singular values: near RANK they are rounding
        upper, _, forces, _ = dgesv(J @ J.T, missing)
        if _regular(upper, _SQUARES):
            return free + J.T @ forces
    return free + np.linalg.lstsq(J, missing, RANK)[0]


def _regular(factors: Array, least: float) -> bool:
    """Whether the pivots of a triangular factorisation are of one size."""
    pivots = list(map(abs, factors.diagonal().tolist()))
    return min(pivots) > least * max(pivots)


def singular_notes(
    model: RobotModel, t: Array, q: Array, rows: NDArray[np.int64], frame: Any = None
) -> tuple[str, ...]:
    """A sentence for a motion (N, n) in whose postures components of the task depend."""
    J = jacobian(model, q, frame)[:, rows]
    less = np.linalg.matrix_rank(J, rtol=RANK) < min(J.shape[1:])
    if not less.any():
        return ()
    return (
        f"At t = {t[np.argmax(less)]:.6g} s the posture is singular for the task: motions of the "
        "tool that the joints cannot make there are left out.",
    )


def frozen_mask(mask: Any) -> Any:
    """A mask that can be hashed."""
    return mask if mask is None or isinstance(mask, str) else tuple(map(int, as_mask(mask)))


def row_gains(gains: Array, rows: NDArray[np.int64], name: str) -> Array:
    """Gains of the rows (m,) from one number, six, or m."""
    if gains.size == 6:
        gains = gains[rows]
    if gains.ndim and gains.size != len(rows):
        raise InvalidValueError(
            f"{name}: expected one number, six, or {len(rows)} for the components of the task, "
            f"got {gains.size}."
        )
    return np.full(len(rows), gains)
