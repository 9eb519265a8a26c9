"""An exciting trajectory: its motion beside the limits, and how it was found."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..dynamics import idm
from ..errors import InvalidValueError
from ..geometry import PRISMATIC
from ..identification.excitation import ExcitingTrajectory
from ..identification.excitation.result import ExcitationStatus
from .figures import (
    LIMIT_DASHES,
    LIMIT_WIDTH,
    LINE_WIDTH,
    PAGE,
    SMALL_SIZE,
    THIN_WIDTH,
    legend_above,
    limit_lines,
    line_style,
    new_figure,
    styled,
)
from .palette import INK, PALE
from .plot_sampling import drawn
from .plot_trajectory import QUANTITIES, draw_limits, draw_line, limit_handles
from .plot_units import joint_names, joint_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST = 14.0  # logarithm of the largest condition number that is drawn


def plot_excitation(
    found: ExcitingTrajectory,
    *,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Motion and torques of an exciting trajectory within their limits, and its search.

    Parameters
    ----------
    found : ExcitingTrajectory
        Of `identification.excitation.exciting_trajectory`.
    title : str, optional
        Over the figure; default robot and condition number.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        Panels of position, velocity, acceleration and torque over one period, joints of different
        units in columns of their own, limits dashed; below them the criterion over the
        iterations of every start, and that of random motions beside those of the starts, before
        and after.

    Raises
    ------
    InvalidValueError
        Not an exciting trajectory.
    MissingExtraError
        Matplotlib is not installed.

    References
    ----------
    Seed book section 1.6.2.3.

    Examples
    --------
    >>> from robotmodels.identification.excitation import exciting_trajectory
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r")
    >>> found = exciting_trajectory(arm, starts=1, baseline=4, iterations=5, rng=0)
    >>> figure = plot_excitation(found)
    >>> [" ".join(axes.get_ylabel().split()) for axes in figure.axes[:2]]
    ['position (rad)', 'velocity (rad/s)']
    """
    if not isinstance(found, ExcitingTrajectory):
        raise InvalidValueError(
            "found: expected an ExcitingTrajectory of exciting_trajectory, got "
            f"{type(found).__name__}."
        )
    model, limits = found.model, found.limits.motion.limits
    n = model.n
    motion = drawn(found.trajectory)
    torque = idm(model, *motion.values[:3])
    heavy = bool(np.abs(torque).max(initial=0.0) > 0.0)
    labels, kinds = joint_names(None, n, model), joint_units(None, n, model)
    columns = list(dict.fromkeys(kinds))
    rows = 3 + heavy
    figure = new_figure(PAGE, 2.9 + 1.1 * rows + 0.02 * n, size)
    grid = figure.add_gridspec(rows + 1, 2, height_ratios=[1.0] * rows + [1.6])
    # joints are revolute or prismatic: one column over the page, or two
    places = [slice(None)] if len(columns) == 1 else [slice(0, 1), slice(1, 2)]
    handles: list[Any] = []
    for column, unit in enumerate(columns):
        joints = [j for j in range(n) if kinds[j] is unit]
        above: Any = None
        for row in range(rows):
            axes = styled(figure.add_subplot(grid[row, places[column]], sharex=above))
            above = above or axes
            axes.tick_params(labelbottom=row == rows - 1)
            if row < 3:
                for j in joints:
                    draw_line(axes, motion.t, unit.factor * motion.values[row, :, j],
                              line_style(j), labels[j])  # fmt: skip
                draw_limits(axes, motion, row, joints, limits, unit, labels)
                axes.set_ylabel(f"{QUANTITIES[row]}\n({unit.of(row)})")
                if row == 0:
                    handles += axes.get_lines()[: len(joints)]
            else:
                _draw_torques(axes, motion.t, torque, joints, found, labels)
        figure.axes[-1].set_xlabel("time (s)")
    _draw_search(styled(figure.add_subplot(grid[-1, 0])), found)
    _draw_baseline(styled(figure.add_subplot(grid[-1, 1])), found)
    figure.align_ylabels()
    handles.sort(key=lambda line: labels.index(str(line.get_label())))
    text = (
        f"{model.name}: condition number {found.condition:.4g}, {found.scaled_condition:.3g} with "
        "scaled columns"
    )
    legend_above(figure, handles + limit_handles(figure), text if title is None else title)
    return figure


def _draw_torques(
    axes: Axes,
    t: np.ndarray,
    torque: np.ndarray,
    joints: list[int],
    found: ExcitingTrajectory,
    labels: list[str],
) -> None:
    """Torques of joints of one unit, and their limits."""
    sigma = found.model.table.sigma[found.model.table.joint_rows]
    for j in joints:
        draw_line(axes, t, torque[:, j], line_style(j), labels[j])
    most = found.limits.torque_limits[joints]
    limit_lines(axes, -most, most, [line_style(j).color for j in joints],
                [labels[j] for j in joints])  # fmt: skip
    axes.set_ylabel("force\n(N)" if sigma[joints[0]] == PRISMATIC else "torque\n(N m)")


def _draw_search(axes: Axes, found: ExcitingTrajectory) -> None:
    """The smooth criterion over the iterations; the best start in front."""
    best = _best(found)
    ratio = found.criterion == "condition"
    for k, start in enumerate(found.starts):
        # penalties of limits that cannot be kept go beyond all numbers
        values = np.exp(np.minimum(start.history, _MOST)) if ratio else start.history
        front = k == best
        color = line_style(0).color if front else PALE
        axes.plot(np.arange(1, len(values) + 1), values, color=color, label="_start",
                  linewidth=LINE_WIDTH if front else THIN_WIDTH,
                  zorder=3 if front else 2)  # fmt: skip
    for end in np.cumsum(found.starts[best].stages)[:-1]:
        axes.axvline(end, color=PALE, linewidth=LIMIT_WIDTH, linestyle=LIMIT_DASHES, zorder=1.5)
    if ratio:
        axes.set_yscale("log")
        _numbers(axes)
    axes.set_xlabel("iteration")
    axes.set_ylabel("smooth condition number" if ratio else "smooth criterion")
    axes.set_title("every start; dashed: next stage", size=SMALL_SIZE, color=INK)


def _draw_baseline(axes: Axes, found: ExcitingTrajectory) -> None:
    """The criterion of random motions and of the starts, before and after."""
    ratio = found.criterion == "condition"
    groups = (
        ("random", found.baseline, PALE),
        ("starts", tuple(start.before for start in found.starts), line_style(1).color),
        ("improved", tuple(start.after for start in found.starts
                           if start.status is not ExcitationStatus.INFEASIBLE),
         line_style(0).color),
    )  # fmt: skip
    for k, (_, judged, color) in enumerate(groups):
        values = np.array([one.of(found.criterion) for one in judged])
        values = values[np.isfinite(values)]
        # spread evenly, so that equal values stay visible
        aside = 0.25 * np.sin(2.4 * np.arange(len(values)))
        axes.plot(k + aside, values, linestyle="", marker="o", markersize=2.6, color=color,
                  label="_values", alpha=0.8)  # fmt: skip
        if len(values):
            axes.plot([k - 0.32, k + 0.32], [np.median(values)] * 2, color=INK,
                      linewidth=LINE_WIDTH, label="_median")  # fmt: skip
    if ratio:
        axes.set_yscale("log")
        _numbers(axes)
    axes.set_xlim(-0.6, 2.6)
    axes.set_xticks(range(3), [name for name, _, _ in groups])
    axes.set_ylabel("condition number" if ratio else "minus log det")
    axes.set_title("line: median", size=SMALL_SIZE, color=INK)


def _numbers(axes: Axes) -> None:
    """Plain numbers on a logarithmic axis of few powers of ten."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axes.get_ylim()
    subs = (1.0, 2.0, 3.0, 5.0) if high < 30.0 * low else (1.0, 3.0)
    axes.yaxis.set_major_locator(LogLocator(subs=subs))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _best(found: ExcitingTrajectory) -> int:
    """Number of the start that the trajectory came from."""
    return min(range(len(found.starts)), key=lambda k: found.starts[k].rank(found.criterion))
