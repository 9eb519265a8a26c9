"""The joints along a path of poses, with what happens on the way."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..errors import InvalidValueError
from ..model import RobotModel
from ..trajectories.joint_path import JointPath
from ..trajectories.limits import MotionLimits
from ..trajectories.path_events import PathEvent, PathEventKind
from ..visual import Color
from .figures import (
    COLUMN,
    PAGE,
    SMALL_SIZE,
    THIN_WIDTH,
    legend_above,
    line_style,
    new_figure,
    panels,
)
from .palette import INK, LINE_COLORS
from .plot_sampling import Drawn
from .plot_trajectory import QUANTITIES, as_limits, draw_limits, draw_line, limit_handles
from .plot_units import Unit, joint_names, joint_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

EVENT_STYLES: dict[PathEventKind, tuple[str, Color, str]] = {
    PathEventKind.OUT_OF_REACH: ("out of reach", LINE_COLORS[4], "o"),
    PathEventKind.OUTSIDE_LIMITS: ("outside limits", LINE_COLORS[1], "s"),
    PathEventKind.SINGULAR: ("singular", LINE_COLORS[0], "D"),
    PathEventKind.CHANGES_POSTURE: ("posture changes", LINE_COLORS[2], "^"),
    PathEventKind.JUMP: ("jump", LINE_COLORS[3], "X"),
    PathEventKind.TOO_FAST: ("too fast", LINE_COLORS[6], "v"),
}
"""Short text, colour and marker of what may happen on the way."""

_LEAST = 1e-6  # of the conditioning that is shown


def plot_joint_path(
    path: JointPath,
    names: Sequence[str] | None = None,
    units: Unit | str | Sequence[Unit | str] | None = None,
    *,
    model: RobotModel | None = None,
    limits: MotionLimits | None = None,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """The joints along a path of poses, their velocities, the conditioning, and the events.

    The lowest panel has a row for every kind of event that happens. In its colour the other
    panels are shaded where the path leaves the reach or stays singular, and have a thin line where
    it is singular at one pose, where the posture changes and where it jumps.

    Parameters
    ----------
    path : JointPath
        From `joint_path`.
    names : sequence of str, length n, optional
        Of the joints; default those of the model, else ``joint 1`` and so on.
    units : Unit or str, or sequence of them, length n, optional
        ``rad``, ``deg``, ``m``, ``mm`` for the axes; default by the joint types of the model, and
        "rad or m" without one.
    model : RobotModel, optional
        The robot, n joints.
    limits : MotionLimits, optional
        Of position and velocity, drawn as dashed lines; default those of the model, if given.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        Over time, or over the number of the pose where the path has no times.

    Raises
    ------
    InvalidValueError, ShapeError
        No path or an empty one; names, units, limits or a model of another number of joints.
    MissingExtraError
        Matplotlib is not installed.

    Examples
    --------
    >>> from robotmodels.kinematics import dgm
    >>> from robotmodels.robots import load
    >>> from robotmodels.trajectories import cartesian_trajectory, joint_path
    >>> arm, q = load("rx90"), np.array([0.1, 0.2, 1.3, 0.4, 0.5, 0.6])
    >>> path = joint_path(arm, cartesian_trajectory(dgm(arm, q), dgm(arm, q + 0.1), 9), q)
    >>> [axes.get_xlabel() for axes in plot_joint_path(path, model=arm).axes]
    ['', '', 'number of the pose']
    """
    if not isinstance(path, JointPath):
        raise InvalidValueError(f"path: expected a JointPath, got {type(path).__name__}.")
    if not len(path.q):
        raise InvalidValueError("path: there are no poses to draw.")
    n = path.q.shape[1]
    labels, kinds = joint_names(names, n, model), joint_units(units, n, model)
    if limits is None and model is not None:
        limits = MotionLimits.of_model(model)
    bounds = as_limits(limits, n)
    timed = not np.isnan(path.t).any()
    x = path.t if timed else np.arange(len(path.q), dtype=float)
    motion = Drawn(x, np.stack((path.q, path.v)), (), 0.0)
    rows = [(order, unit) for order in ((0, 1) if timed else (0,)) for unit in dict.fromkeys(kinds)]
    happens = [kind for kind in PathEventKind if path.of_kind(kind)]
    heights = [1.1] * len(rows) + [0.8, 0.16 + 0.17 * max(len(happens), 1)]
    wide = COLUMN if n < 5 else 0.5 * (COLUMN + PAGE)
    figure = new_figure(wide, 1.0 + sum(heights), size)
    grid = panels(figure, len(heights), sharex=True, height_ratios=heights)[:, 0]
    for axes, (order, unit) in zip(grid, rows, strict=False):
        axes.set_ylabel(f"{QUANTITIES[order]}\n({unit.of(order)})")
        joints = [j for j in range(n) if kinds[j] is unit]
        for j in joints:
            y = unit.factor * motion.values[order, :, j]
            draw_line(axes, x, y, line_style(j), labels[j])
        if bounds is not None:
            draw_limits(axes, motion, order, joints, bounds, unit, labels)
    _conditioning(grid[-2], x, path.conditioning)
    _events(grid[-1], grid[:-1], path, happens, x, timed)
    grid[-1].set_xlabel("time (s)" if timed else "number of the pose")
    figure.align_ylabels(list(grid))
    handles: list[Any] = [
        line
        for axes in grid[: len(set(kinds))]
        for line in axes.get_lines()
        if str(line.get_label()) in labels
    ]
    handles.sort(key=lambda line: labels.index(str(line.get_label())))
    legend_above(figure, handles + limit_handles(figure), title)
    return figure


def _conditioning(axes: Axes, x: Array, conditioning: Array) -> None:
    """The conditioning, on a scale of powers where it comes near zero."""
    shown = np.maximum(conditioning, _LEAST)  # zero has no place on a scale of powers
    axes.plot(x, shown, color=INK, linewidth=1.0, label="conditioning")
    axes.set_ylabel("conditioning\n(1)")
    least = float(np.nanmin(conditioning)) if np.isfinite(conditioning).any() else 1.0
    if least < 0.02:
        axes.set_yscale("log")
        axes.set_ylim(max(0.5 * least, _LEAST), 1.5)
    else:
        axes.set_ylim(0.0, None)


def _events(
    axes: Axes,
    above: Sequence[Axes],
    path: JointPath,
    happens: Sequence[PathEventKind],
    x: Array,
    timed: bool,
) -> None:
    """A row of bars for every kind of event, and its traces in the panels above."""
    axes.set_yticks(range(len(happens)), [EVENT_STYLES[kind][0] for kind in happens])
    axes.set_ylim(len(happens) - 0.4, -0.6)
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", length=0.0)
    if not happens:
        axes.text(
            0.5, 0.5, "nothing happens on the way", transform=axes.transAxes, size=SMALL_SIZE,
            color=INK, ha="center", va="center",
        )  # fmt: skip
        axes.set_ylim(0.0, 1.0)
    for row, kind in enumerate(happens):
        text, color, marker = EVENT_STYLES[kind]
        for event in path.of_kind(kind):
            start, stop = span(event, timed)
            axes.plot([start, stop], [row, row], color=color, linewidth=4.0, alpha=0.55,
                      solid_capstyle="butt", label=f"_{text}")  # fmt: skip
            axes.plot(sorted({start, stop}), [row] * len({start, stop}), color=color, linestyle="",
                      marker=marker, markersize=3.6, markeredgewidth=0.0,
                      label=f"_ends of {text}")  # fmt: skip
            for panel in above:
                _trace(panel, kind, start, stop)


def _trace(axes: Axes, kind: PathEventKind, start: float, stop: float) -> None:
    """What a panel shows of an event: runs without posture or with a poor one, and moments."""
    if kind in (PathEventKind.OUTSIDE_LIMITS, PathEventKind.TOO_FAST):
        return  # seen on the lines of the joints
    text, color, _ = EVENT_STYLES[kind]
    runs = (PathEventKind.OUT_OF_REACH, PathEventKind.SINGULAR)
    if kind in runs and stop > start:
        axes.axvspan(start, stop, color=color, alpha=0.2, linewidth=0.0, zorder=0.5,
                     label=f"_{text}")  # fmt: skip
    else:
        axes.axvline(0.5 * (start + stop), color=color, linewidth=THIN_WIDTH, zorder=1.2,
                     label=f"_{text}")  # fmt: skip


def span(event: PathEvent, timed: bool) -> tuple[float, float]:
    """Extent of an event along the axis of a figure."""
    return (event.start, event.stop) if timed else (float(event.first), float(event.last))
