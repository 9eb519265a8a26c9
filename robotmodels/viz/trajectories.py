"""Figures of motions: over time, as laws of motion, along paths of poses.

Parameters
----------
model, names, units, limits, view, **look
    See `robotmodels.viz`. Names of `plot_profiles` are those of a sequence of motions; the limits
    of `plot_joint_path` are by default those of its model.
trajectory, profiles : Trajectory or Samples, and mapping of str to these, or sequence
    One motion of n joints, rad or m, and per s; several of them by their names.
orders : sequence of int
    Which panels: 0 position, 1 velocity, 2 acceleration, 3 jerk.
breakpoints : bool
    Whether the times at which pieces meet are marked: by thin lines where all joints change
    pieces together, else by dots on the lines of the joints.
joint, unit : int, and Unit or str
    Which joint, from 0, and its unit; of `plot_pose_path` ``m`` or ``mm``.
side_by_side : bool
    Whether each motion stands in a column of its own, with common scales.
path : JointPath
    From `joint_path`, drawn over time, or over the number of the pose if it has no times; of
    `plot_pose_path` optional, for its events.
poses : PoseTrajectory, PoseSamples or array_like, shape (N, 4, 4)
    World poses of the tool, m.
frames, frame_size : int and float, optional
    At how many poses the axes of the tool are drawn, and their length, m; default a tenth of the
    extent of the path.

Returns
-------
matplotlib.figure.Figure

Examples
--------
>>> from robotmodels.trajectories import trapezoidal
>>> figure = plot_trajectory(trapezoidal([0, 0], [1, 2], 2.0), units="rad")
>>> [" ".join(axes.get_ylabel().split()) for axes in figure.axes[:2]]
['position (rad)', 'velocity (rad/s)']
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, as_count, as_exact, as_number
from .._choices import as_instance
from ..errors import InvalidValueError, ShapeError
from ..model import RobotModel
from ..trajectories.joint_path import JointPath
from ..trajectories.limits import MotionLimits
from ..trajectories.path_events import PathEventKind
from ..trajectories.pose_trajectory import PoseSamples, PoseTrajectory
from ..trajectories.trajectory import Samples, Trajectory
from . import over_time, style
from .over_time import Sampled, Unit
from .space import across, space
from .style import COLUMN, INK, PAGE, PALETTE, Axes, Figure, Look

_EVENTS: dict[PathEventKind, tuple[str, Any, str]] = {
    PathEventKind.OUT_OF_REACH: ("out of reach", PALETTE[4], "o"),
    PathEventKind.OUTSIDE_LIMITS: ("outside limits", PALETTE[1], "s"),
    PathEventKind.SINGULAR: ("singular", PALETTE[0], "D"),
    PathEventKind.CHANGES_POSTURE: ("posture changes", PALETTE[2], "^"),
    PathEventKind.JUMP: ("jump", PALETTE[3], "X"),
    PathEventKind.TOO_FAST: ("too fast", PALETTE[6], "v"),
}
_RUNS = (PathEventKind.OUT_OF_REACH, PathEventKind.SINGULAR)
_SEEN_ON_LINES = (PathEventKind.OUTSIDE_LIMITS, PathEventKind.TOO_FAST)
_LEAST = 1e-6  # conditioning that is drawn
_POSES = 301
_STILL = 1e-3  # m: a tool that moves less turns on the spot


@style.plot
def plot_trajectory(
    trajectory: Trajectory | Samples,
    limits: MotionLimits | None = None,
    names: Sequence[str] | None = None,
    units: Unit | str | Sequence[Unit | str] | None = None,
    *,
    model: RobotModel | None = None,
    orders: Sequence[int] = (0, 1, 2, 3),
    breakpoints: bool = True,
    **look: Unpack[Look],
) -> Figure:
    """Position, velocity, acceleration and jerk of every joint over time.

    Joints of different units stand in columns of their own. Both sides of a jump are drawn.
    """
    motion = over_time.sampled(trajectory)
    n = motion.n
    labels, columns = over_time.joints_of(n, model, names, units)
    bounds, shown = over_time.as_limits(limits, n), over_time.as_orders(orders)
    if n == 1 and names is None and model is None:
        labels = ["_joint"]  # one line needs no legend
    width, height = COLUMN if len(columns) == 1 else PAGE, 0.55 + 1.05 * len(shown) + 0.02 * n
    figure, grid = style.panels(width, height, look, len(shown), len(columns), sharex=True)
    for column, (unit, joints) in zip(grid.T, columns.items(), strict=True):
        for axes, order in zip(column, shown, strict=True):
            over_time.quantity_over_time(axes, motion, order, joints, unit, labels, bounds)
            if breakpoints:
                over_time.mark_breaks(axes, motion, order, joints, unit)
        column[-1].set_xlabel("time (s)")
    return style.finished(figure, look, labels)


@style.plot
def plot_profiles(
    profiles: Mapping[str, Trajectory | Samples] | Sequence[Trajectory | Samples],
    names: Sequence[str] | None = None,
    joint: int = 0,
    limits: MotionLimits | None = None,
    unit: Unit | str = Unit.UNSTATED,
    *,
    side_by_side: bool = False,
    orders: Sequence[int] = (0, 1, 2, 3),
    **look: Unpack[Look],
) -> Figure:
    """One joint's position, velocity, acceleration and jerk under several laws of motion."""
    named = style.as_named(profiles, names, "profiles", "motion")
    motions = {name: over_time.sampled(motion, repr(name)) for name, motion in named.items()}
    least = min(motion.n for motion in motions.values())
    (j,) = style.as_choice([joint], least, "joint", "a number")
    shown, kind = over_time.as_orders(orders), over_time.as_unit(unit)
    columns = len(motions) if side_by_side else 1
    width, height = COLUMN if columns == 1 else PAGE, 0.75 + 1.05 * len(shown)
    figure, grid = style.panels(width, height, look, len(shown), columns, sharex=True, sharey="row")
    for k, (name, motion) in enumerate(motions.items()):
        column = grid[:, k if side_by_side else 0]
        bounds, duration = over_time.as_limits(limits, motion.n), f"{motion.duration:.4g} s"
        label = {j: f"{'_' * side_by_side}{name}, {duration}"}
        for axes, order in zip(column, shown, strict=True):
            over_time.quantity_over_time(axes, motion, order, [j], kind, label, bounds, [k])
        if side_by_side:
            column[0].set_title(style.wrapped(f"{name}\n{duration}", width / columns))
        column[-1].set_xlabel("time (s)")
    for axes in grid.flat:
        axes.label_outer()
    return style.finished(figure, look)


@style.plot
def plot_joint_path(
    path: JointPath,
    names: Sequence[str] | None = None,
    units: Unit | str | Sequence[Unit | str] | None = None,
    *,
    model: RobotModel | None = None,
    limits: MotionLimits | None = None,
    **look: Unpack[Look],
) -> Figure:
    """Joints along a path of poses, their velocities, the conditioning, and the events.

    The lowest panel has a row for every kind of event on the path. In its colour the other panels
    are shaded where the path leaves the reach or stays singular, and have a thin line where it is
    singular at one pose, where the posture changes and where it jumps.
    """
    if not len(as_instance(path, JointPath, "path", " of joint_path").q):
        raise InvalidValueError("path: there are no poses to draw.")
    n = path.q.shape[1]
    labels, columns = over_time.joints_of(n, model, names, units)
    if limits is None and model is not None:
        limits = MotionLimits.of_model(model)
    bounds = over_time.as_limits(limits, n)
    timed = not np.isnan(path.t).any()
    x = path.t if timed else np.arange(len(path.q), dtype=float)
    motion = Sampled(x, np.stack((path.q, path.v)))
    rows = [(order, *column) for order in range(1 + timed) for column in columns.items()]
    happens = [kind for kind in PathEventKind if path.of_kind(kind)]
    heights = [1.1] * len(rows) + [0.8, 0.16 + 0.17 * max(len(happens), 1)]
    width = COLUMN if n < 5 else 0.5 * (COLUMN + PAGE)
    shared: dict[str, Any] = {"sharex": True, "height_ratios": heights}
    figure, grid = style.panels(width, 1.0 + sum(heights), look, len(heights), **shared)
    *above, lowest = grid[:, 0]
    for axes, (order, unit, joints) in zip(above, rows, strict=False):
        over_time.quantity_over_time(axes, motion, order, joints, unit, labels, bounds)
    least = float(np.nanmin(np.append(path.conditioning, 1.0)))
    shown = np.maximum(path.conditioning, _LEAST)
    above[-1].plot(x, shown, color=INK, linewidth=1.0, label="_conditioning")
    above[-1].set_ylabel("conditioning\n(1)")
    if least < 0.02:
        above[-1].set(yscale="log", ylim=(max(0.5 * least, _LEAST), 1.5))
    else:
        above[-1].set_ylim(0.0, None)
    lowest.set_yticks(range(len(happens)), [_EVENTS[kind][0] for kind in happens])
    lowest.set_ylim(max(len(happens), 1) - 0.4, -0.6)
    lowest.grid(False, axis="y")
    lowest.tick_params(axis="y", length=0.0)
    for event in path.events:
        ends = (event.start, event.stop) if timed else (event.first, event.last)
        _draw_event(lowest, above, happens.index(event.kind), event.kind, ends)
    if not happens:
        style.note(lowest, "no events on the path")
    lowest.set_xlabel("time (s)" if timed else "number of the pose")
    return style.finished(figure, look, labels)


def _draw_event(
    axes: Axes, above: Sequence[Axes], row: int, kind: PathEventKind, span: tuple[float, float]
) -> None:
    """A bar with marked ends, and shades or lines in the panels above."""
    text, color, marker = _EVENTS[kind]
    start, stop = span
    axes.plot(span, (row, row), color=color, linewidth=4.0, alpha=0.55, solid_capstyle="butt")
    axes.plot(span, (row, row), marker, color=color, markersize=3.6, markeredgewidth=0.0)
    for panel in above:
        if kind in _RUNS and stop > start:
            panel.axvspan(start, stop, color=color, alpha=0.2, linewidth=0.0, label=f"_{text}")
        elif kind not in _SEEN_ON_LINES:
            middle = 0.5 * (start + stop)
            panel.axvline(middle, color=color, linewidth=0.8, zorder=1.2, label=f"_{text}")


@style.plot
def plot_pose_path(
    poses: PoseTrajectory | PoseSamples | ArrayLike,
    path: JointPath | None = None,
    *,
    frames: int = 6,
    frame_size: float | None = None,
    unit: Unit | str = Unit.METRE,
    view: ArrayLike | None = None,
    **look: Unpack[Look],
) -> Figure:
    """Path of the tool in space, with its frame at some poses, equal scales and events."""
    if path is not None:
        as_instance(path, JointPath, "path", " of joint_path")
    T = _poses(poses, path)
    length = over_time.as_unit(unit)
    if length not in (Unit.METRE, Unit.MILLIMETRE):
        raise InvalidValueError(f"unit: expected a length, 'm' or 'mm', got {length.value!r}.")
    count = as_count(frames, "frames", 0)
    if path is not None and len(path.q) != len(T):
        raise ShapeError(f"path: expected the joints of these {len(T)} poses, got {len(path.q)}.")
    k = length.factor
    points = k * T[:, :3, 3]
    extent = float(np.ptp(points, axis=0).max())
    arm = 0.1 * (extent if extent > _STILL * k else k)
    if frame_size is not None:
        arm = k * as_number(frame_size, "frame_size", above=0.0)
    angles = across(points) if view is None else as_exact(view, (2,), "view")
    some = np.unique(np.linspace(0, len(T) - 1, count).round().astype(int))
    tips = points[some, None] + arm * np.swapaxes(T[some, :3, :3], 1, 2)
    figure, _ = style.panels(COLUMN, 1.05 * COLUMN, look, rows=0)
    every = np.concatenate((points, tips.reshape(-1, 3)))
    axes = space(figure, (1, 1, 1), every, length, angles)
    axes.plot(*points.T, color=INK, label="path")
    for a, (color, dashes) in enumerate(((1, "-"), (2, (0, (3.0, 1.0))), (0, (0, (1.0, 0.8))))):
        line = {"color": PALETTE[color], "linestyle": dashes, "linewidth": 1.2}
        for ends in np.stack((points[some], tips[:, a]), axis=-1):
            axes.plot(*ends, label=f"tool {'xyz'[a]}", **line)
    for i, marker, text in ((0, "o", "start"), (-1, "s", "end")):
        axes.plot(*points[i], marker, color=INK, markersize=4.0, label=text)
    for event in () if path is None else path.events:
        text, color, marker = _EVENTS[event.kind]
        run = points[event.first : event.last + 1]
        axes.plot(*run.T, color=color, linewidth=4.0, alpha=0.45, label=f"_{text}")
        axes.plot(*run[[0, -1]].T, marker, color=color, markersize=4.5, label=text)
    return style.finished(figure, look)


def _poses(poses: Any, path: JointPath | None) -> Array:
    if isinstance(poses, PoseTrajectory):
        if path is not None and not np.isnan(path.t).any():
            return poses.pose(path.t)
        poses = poses.resample(_POSES if path is None else len(path.q))
    T = se3.as_pose(poses.T if isinstance(poses, PoseSamples) else poses, "poses")
    if T.ndim != 3 or not len(T):
        raise ShapeError(f"poses: expected shape (N, 4, 4) with N at least 1, got {T.shape}.")
    return T
