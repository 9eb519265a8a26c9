"""Joint path along poses of the tool: one posture after the other, on one branch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import Array, as_exact, as_mask, as_number
from ..errors import InvalidValueError, ShapeError
from ..igm import IGMSolutions, igm, igm_numeric
from ..igm.loop import joint_chain
from ..model import RobotModel, check_model
from .follow import continuous, follow, follow_singly
from .limits import few_lines
from .path_events import PathEvent, PathEventKind, Task, path_events
from .pose_trajectory import PoseTrajectory
from .trajectory import Sampled


@dataclass(frozen=True, slots=True, eq=False)
class JointPath(Sampled):
    """Postures that follow poses, and the events along the path.

    Parameters
    ----------
    t, status : ndarray, shape (N,)
        Times, s, NaN where the poses have none; codes of `IGMStatus`.
    q, v : ndarray, shape (N, n)
        Postures, rad or m, continuous (angles may leave (-pi, pi]), and velocities; NaN where
        there is none.
    conditioning : ndarray, shape (N,)
        Of the Jacobian, from 1 to 0 where it is singular: the inverse of its condition number in
        the Frobenius norm, positions in units of the arm's lever.
    branch : ndarray of str, shape (N,)
        Labels of the branches; empty where a redundant arm went on by steps.
    events : tuple of PathEvent
        Events, in the order of the path.
    """

    t: Array
    q: Array
    v: Array
    status: NDArray[np.int8]
    conditioning: Array
    branch: NDArray[np.str_]
    events: tuple[PathEvent, ...]

    @property
    def complete(self) -> bool:
        """Whether every pose is reached, inside the joint limits and without a jump."""
        return not self.stops

    @property
    def stops(self) -> tuple[PathEvent, ...]:
        """The events after which the robot cannot go on."""
        kinds = (PathEventKind.OUT_OF_REACH, PathEventKind.OUTSIDE_LIMITS, PathEventKind.JUMP)
        return tuple(event for event in self.events if event.kind in kinds)

    def of_kind(self, kind: PathEventKind) -> tuple[PathEvent, ...]:
        """The events of a kind, in the order of the path."""
        return tuple(event for event in self.events if event.kind is kind)

    def __repr__(self) -> str:
        state = "complete" if self.complete else "not complete"
        return few_lines(f"<JointPath: {len(self.q)} poses, {state}", self.events)


def joint_path(
    model: RobotModel,
    poses: Any,
    q_start: ArrayLike | None = None,
    q_near: ArrayLike | None = None,
    t: ArrayLike | None = None,
    samples: int = 1000,
    mask: ArrayLike | str | None = None,
    mask_axes: Literal["world", "tool"] = "world",
    position_tolerance: float = 1e-9,
    orientation_tolerance: float = 1e-9,
    singular_below: float = 0.002,
) -> JointPath:
    """Joint positions along poses, branch kept, with a report of the events along the path.

    Also called ``ikine`` of a ``ctraj``. Each pose is solved for all postures, and the nearest to
    the last one is taken. Without ``q_start`` the branch is chosen with the fewest jumps, the
    fewest poses outside the limits, and then the shortest way. A redundant arm keeps its arm angle
    if it has one; others go on by the least steps from the last posture.

    Parameters
    ----------
    poses, t : PoseTrajectory or array_like, shape (N, 4, 4); array_like, shape (N,), optional
        World poses of the tool, m; times of an array, s, for its velocities.
    q_start : array_like, shape (n,), optional
        Posture from which the robot comes, rad or m; a first posture more than 0.1 away from it is
        reported as a jump. Joints that do not move the tool keep its value.
    q_near : array_like, shape (n,), optional
        A guess instead: the path begins with the solution of the first pose that is nearest to it.
    samples : int
        Number of poses into which a `PoseTrajectory` is divided.
    mask, mask_axes, position_tolerance, orientation_tolerance
        As in `igm`.
    singular_below : float
        Conditioning below which a position is reported as singular.

    References
    ----------
    Book section 4.3; the exercise, problem 2.

    Examples
    --------
    >>> from robotmodels.kinematics import dgm
    >>> from robotmodels.robots import load
    >>> from robotmodels.trajectories import cartesian_trajectory
    >>> arm, q = load("rx90"), np.array([0.1, 0.2, 1.3, 0.4, 0.5, 0.6])
    >>> path = joint_path(arm, cartesian_trajectory(dgm(arm, q), dgm(arm, q + 0.1), 50), q)
    >>> path.complete, path.q[-1].round(6)
    (True, array([0.2, 0.3, 1.4, 0.5, 0.6, 0.7]))
    """
    check_model(model)
    if q_start is not None and q_near is not None:
        raise InvalidValueError("q_near and q_start: give only one of the two.")
    start = None if q_start is None else as_exact(q_start, (model.n,), "q_start")
    near = start if q_near is None else as_exact(q_near, (model.n,), "q_near")
    motion = poses if isinstance(poses, PoseTrajectory) else None
    if motion is not None:
        if t is not None:
            raise InvalidValueError("t: a PoseTrajectory has its own times; pass samples.")
        grid = motion.resample(samples)
        times, T, twists = grid.t, np.asarray(grid.T), np.asarray(grid.twist)
    else:
        T, twists = se3.as_pose(poses, "poses"), None
        if T.ndim != 3:
            raise ShapeError(f"poses: expected shape (N, 4, 4), got {T.shape}.")
        times = np.full(len(T), np.nan) if t is None else as_exact(t, (len(T),), "t")
        if (np.diff(times) <= 0.0).any():
            raise InvalidValueError("t: expected times that ascend.")
    mask = None if mask is None else as_mask(mask)
    singular_below = as_number(singular_below, "singular_below")
    tolerances: dict[str, Any] = {
        "position_tolerance": position_tolerance,
        "orientation_tolerance": orientation_tolerance,
    }

    def solve(targets: Array, near: Array | None) -> IGMSolutions:
        return igm(model, targets, near, mask, mask_axes, **tolerances)

    def go_on(i: int, near: Array) -> IGMSolutions:
        return igm_numeric(model, T[i], near, mask, mask_axes, restarts=0, **tolerances)

    columns, found = joint_chain(model).columns, None
    if columns.size <= (6 if mask is None else np.count_nonzero(mask)):
        # without a reference postures come in the order of their branches
        found = solve(T, None)
    if found is not None and (found.q.shape[-2] > 1 or not found.method.startswith("numeric")):
        rows = follow(model, found, near, lambda i, near: solve(T[i], near))
    else:
        rows = follow_singly(model, len(T), near, lambda i, near: solve(T[i], near), go_on)
    # joints that do not move the tool stand still: at the start, else near zero
    still = np.setdiff1d(np.arange(model.n), columns)
    rest = np.clip(np.zeros(model.n), model.lower, model.upper) if near is None else near
    rows.q[np.ix_(rows.reached, still)] = rest[still]
    q = continuous(model, rows.q, rows.reached, near)
    task = Task(model, T, q, rows.reached, mask, mask_axes, columns)
    v = (
        task.rates(twists)
        if twists is not None and task.square
        else _differences(times, q, rows.reached)
    )
    events = path_events(model, times, q, v, rows, task, singular_below, start)
    if motion is not None:
        pose = motion.pose
        events = [_located(e, times, lambda t: solve(pose(t), near).count > 0) for e in events]
    return JointPath(times, q, v, rows.status, task.conditioning, rows.branch, tuple(events))


def _differences(times: Array, q: Array, reached: NDArray[np.bool_]) -> Array:
    """Velocities from the neighbours of each pose on either side that are reached."""
    if np.isnan(times).any() or len(q) < 2:
        return np.full(q.shape, np.nan)
    with np.errstate(invalid="ignore"):
        slope = np.diff(q, axis=0) / np.diff(times)[:, None]
    none = np.full((1, q.shape[1]), np.nan)
    left, right = np.vstack((none, slope)), np.vstack((slope, none))
    both = np.where(np.isnan(left), right, np.where(np.isnan(right), left, 0.5 * (left + right)))
    return np.where(reached[:, None], both, np.nan)


def _located(event: PathEvent, times: Array, reached: Callable[[float], Any]) -> PathEvent:
    """The edges of a run out of reach, found between the samples by bisection."""
    if event.kind is not PathEventKind.OUT_OF_REACH:
        return event
    edges = []
    for inside, outside in ((event.first - 1, event.start), (event.last + 1, event.stop)):
        good = times[inside] if 0 <= inside < len(times) else outside
        for _ in range(30):
            middle = 0.5 * (good + outside)
            good, outside = (middle, outside) if reached(middle) else (good, middle)
        edges.append(outside)
    return replace(event, start=edges[0], stop=edges[1])
