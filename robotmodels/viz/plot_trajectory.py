"""A trajectory over time: position, velocity, acceleration and jerk of its joints."""

from __future__ import annotations

from collections.abc import Sequence
from operator import index
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..errors import InvalidValueError
from ..model import RobotModel
from ..trajectories.limits import MotionLimits
from ..trajectories.trajectory import Samples, Trajectory
from .figures import (
    COLUMN,
    LIMIT_DASHES,
    LIMIT_WIDTH,
    LINE_WIDTH,
    PAGE,
    THIN_WIDTH,
    legend_above,
    limit_lines,
    line_style,
    new_figure,
    panels,
)
from .palette import ALERT, PALE
from .plot_sampling import Drawn, drawn
from .plot_units import Unit, joint_names, joint_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BEYOND = "_beyond the limit"
QUANTITIES = ("position", "velocity", "acceleration", "jerk")
_ROUNDING = 1e-9


def plot_trajectory(
    trajectory: Trajectory | Samples,
    limits: MotionLimits | None = None,
    names: Sequence[str] | None = None,
    units: Unit | str | Sequence[Unit | str] | None = None,
    *,
    model: RobotModel | None = None,
    orders: Sequence[int] = (0, 1, 2, 3),
    breakpoints: bool = True,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Position, velocity, acceleration and jerk of every joint over time.

    Joints of different units stand in columns of their own. Both sides of a jump are drawn.

    Parameters
    ----------
    trajectory : Trajectory or Samples
        One motion of n joints; rad or m, and per s.
    limits : MotionLimits, optional
        Drawn as dashed lines, in the colour of their joint or grey where all joints share them;
        what lies beyond them is underlaid in red. ``MotionLimits.of_model(model)`` are those of
        a robot.
    names : sequence of str, length n, optional
        Of the joints; default those of the model, else ``joint 1`` and so on.
    units : Unit or str, or sequence of them, length n, optional
        ``rad``, ``deg``, ``m``, ``mm`` for the axes; default rad or m by the joint types of the
        model, and "rad or m" without one.
    model : RobotModel, optional
        The robot, n joints.
    orders : sequence of int
        Which panels: 0 position, 1 velocity, 2 acceleration, 3 jerk.
    breakpoints : bool
        Whether the times at which pieces meet are marked: by thin lines where all joints change
        pieces together, else by dots on the lines of the joints.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        Shows itself in a notebook; ``.savefig("move.pdf")`` writes it.

    Raises
    ------
    InvalidValueError, ShapeError
        A batch of motions; names, units, limits or a model of another number of joints.
    MissingExtraError
        Matplotlib is not installed.

    Examples
    --------
    >>> from robotmodels.trajectories import MotionLimits, trapezoidal
    >>> limits = MotionLimits(velocity=1.0, acceleration=2.0)
    >>> figure = plot_trajectory(trapezoidal([0, 0], [1, 2], limits=limits), limits, units="rad")
    >>> [" ".join(axes.get_ylabel().split()) for axes in figure.axes[:2]]
    ['position (rad)', 'velocity (rad/s)']
    """
    motion = drawn(trajectory)
    n = motion.n
    labels, kinds = joint_names(names, n, model), joint_units(units, n, model)
    bounds = as_limits(limits, n)
    shown = as_orders(orders)
    columns = list(dict.fromkeys(kinds))
    wide = COLUMN if len(columns) == 1 else PAGE
    figure = new_figure(wide, 0.55 + 1.05 * len(shown) + 0.02 * n, size)
    grid = panels(figure, len(shown), len(columns), sharex=True)
    for column, unit in enumerate(columns):
        joints = [j for j in range(n) if kinds[j] is unit]
        for row, order in enumerate(shown):
            axes = grid[row, column]
            axes.set_ylabel(f"{QUANTITIES[order]}\n({unit.of(order)})")
            for j in joints:
                style = line_style(j)
                y = unit.factor * motion.values[order, :, j]
                draw_line(axes, motion.t, y, style, labels[j])
                if breakpoints and len(motion.breaks) > 1:
                    _dots(axes, motion, order, j, unit.factor, style.color)
            if breakpoints and len(motion.breaks) == 1:
                break_lines(axes, motion)
            if bounds is not None:
                draw_limits(axes, motion, order, joints, bounds, unit, labels)
        grid[-1, column].set_xlabel("time (s)")
    figure.align_ylabels()
    handles: list[Any] = [line for axes in grid[0] for line in axes.get_lines()
                          if not str(line.get_label()).startswith("_")]  # fmt: skip
    # joints of one unit stand in one column of panels: bring them back to their order
    handles.sort(key=lambda line: labels.index(str(line.get_label())))
    if n == 1 and names is None and model is None:
        handles = []  # one line explains itself
    legend_above(figure, handles + limit_handles(figure), title)
    return figure


def draw_line(axes: Axes, t: Array, y: Array, style: Any, label: str) -> None:
    """One joint's line. Shapes: t, y (N,)."""
    axes.plot(
        t,
        y,
        color=style.color,
        linestyle=style.dashes,
        linewidth=LINE_WIDTH,
        marker="" if len(t) > 1 else "o",
        markersize=3.0,
        label=label,
    )


def break_lines(axes: Axes, motion: Drawn) -> None:
    """Thin lines at the times at which pieces meet, without the two ends."""
    for time in motion.breaks[0][1:-1]:
        axes.axvline(
            time, color=PALE, linewidth=THIN_WIDTH, linestyle="-", zorder=1.2, label="_break"
        )


def draw_limits(
    axes: Axes,
    motion: Drawn,
    order: int,
    joints: Sequence[int],
    limits: MotionLimits,
    unit: Unit,
    names: Sequence[str],
) -> None:
    """Limits of a quantity, and what lies beyond them."""
    lower, upper = (
        (limits.lower, limits.upper),
        (limits.velocity_lower, limits.velocity),
        (limits.acceleration_lower, limits.acceleration),
        (-limits.jerk, limits.jerk),
    )[order]
    some = list(joints)
    for j in some:
        y = motion.values[order, :, j]
        slack = _ROUNDING * max(1.0, float(np.abs(y).max(initial=0.0)))
        beyond = (y > upper[j] + slack) | (y < lower[j] - slack)
        if beyond.any():
            axes.plot(
                motion.t,
                np.where(beyond, unit.factor * y, np.nan),
                color=ALERT,
                alpha=0.35,
                linewidth=4.0 * LINE_WIDTH,
                solid_capstyle="butt",
                zorder=1.8,
                label=f"{BEYOND} of {names[j]}",
            )
    limit_lines(
        axes,
        unit.factor * lower[some],
        unit.factor * upper[some],
        [line_style(j).color for j in some],
        [names[j] for j in some],
    )


def limit_handles(figure: Figure) -> list[Any]:
    """Legend entries of the limits that were drawn."""
    from matplotlib.lines import Line2D

    labels = [str(line.get_label()) for axes in figure.axes for line in axes.get_lines()]
    handles = []
    if any(label.startswith(("_lower limit", "_upper limit")) for label in labels):
        handles.append(
            Line2D([], [], color=PALE, linewidth=LIMIT_WIDTH, linestyle=LIMIT_DASHES, label="limit")
        )
    if any(label.startswith(BEYOND) for label in labels):
        handles.append(
            Line2D([], [], color=ALERT, alpha=0.35, linewidth=4.0 * LINE_WIDTH, label="beyond it")
        )
    return handles


def as_limits(limits: MotionLimits | None, n: int) -> MotionLimits | None:
    """Limits of n joints, checked."""
    if limits is None:
        return None
    if not isinstance(limits, MotionLimits):
        raise InvalidValueError(f"limits: expected MotionLimits, got {type(limits).__name__}.")
    return limits.for_joints(n)


def as_orders(orders: Sequence[int]) -> list[int]:
    """Which quantities are drawn, checked."""
    try:
        shown = [index(order) for order in orders]
    except TypeError:
        shown = []
    if not shown or len(set(shown)) < len(shown) or not set(shown) <= {0, 1, 2, 3}:
        raise InvalidValueError(
            f"orders: expected some of 0 (position), 1 (velocity), 2 (acceleration), 3 (jerk), "
            f"each once, got {orders!r:.60}."
        )
    return shown


def _dots(axes: Axes, motion: Drawn, order: int, j: int, factor: float, color: Any) -> None:
    """Dots where the pieces of one joint meet."""
    times = motion.breaks[j]
    at = np.searchsorted(motion.t, times).clip(max=len(motion.t) - 1)
    axes.plot(
        motion.t[at],
        factor * motion.values[order, at, j],
        color=color,
        linestyle="",
        marker="o",
        markersize=2.4,
        label="_break",
    )
