"""Joint positions within their limits, such as with and without avoiding them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_floats, as_reals
from ..errors import InvalidValueError, ShapeError
from ..model import RobotModel
from .figures import (
    COLUMN,
    LIMIT_DASHES,
    LIMIT_WIDTH,
    PAGE,
    SMALL_SIZE,
    legend_above,
    line_style,
    new_figure,
    panels,
)
from .palette import ALERT, INK
from .plot_trajectory import draw_line
from .plot_units import Unit, joint_names, joint_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MARGIN = 0.12  # of the range, shown beyond either limit


def plot_joint_motion(
    model: RobotModel,
    t: ArrayLike,
    q: ArrayLike | Mapping[str, ArrayLike],
    *,
    degrees: bool = True,
    columns: int | None = None,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Positions of all joints within their limits, and the margin that is left.

    Every joint has a panel that is as high as its range, so that heights compare between joints;
    what lies beyond the limits is shaded. The last panel has the least margin of all joints: 100 %
    where all of them stand in the middle of their ranges, 0 where one is at a limit.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    t : array_like, shape (N,)
        Times, s.
    q : array_like, shape (N, n), or mapping of str to such arrays
        Positions, rad or m; several motions by their names, at the same times. NaN leaves a gap.
    degrees : bool
        Whether angles are in degrees instead of radians.
    columns : int, optional
        How many panels stand in a row; default one, or two from five joints on.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        A panel for each joint; the last one, of the margin, where any joint has both limits.

    Raises
    ------
    InvalidValueError, ShapeError
        Positions that do not fit the times or the robot, no samples, no motions.
    MissingExtraError
        Matplotlib is not installed.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 1], lower=[-1.0, 0.0],
    ...                                     upper=[1.0, 0.5]))
    >>> t = np.linspace(0.0, 1.0, 11)
    >>> figure = plot_joint_motion(arm, t, np.c_[np.sin(t), 0.3 * t])
    >>> [axes.get_title(loc="left") for axes in figure.axes]
    ['joint_1 (deg)', 'joint_2 (m)', 'least margin (%)']
    """
    if not isinstance(model, RobotModel):
        raise InvalidValueError(f"model: expected a RobotModel, got {type(model).__name__}.")
    times = as_floats(t, "t")
    if times.ndim != 1 or not times.size:
        raise ShapeError(f"t: expected shape (N,) with N at least 1, got {times.shape}.")
    motions = _motions(q, times.size, model.n)
    names, units = joint_names(None, model.n, model), joint_units(None, model.n, model)
    if degrees:
        units = [Unit.DEGREE if unit is Unit.RADIAN else unit for unit in units]
    bounded = np.isfinite(model.lower) & np.isfinite(model.upper) & (model.upper > model.lower)
    count = model.n + bool(bounded.any())
    wide = _columns(columns, count)
    rows = -(-count // wide)
    figure = new_figure(COLUMN if wide == 1 else PAGE, 0.75 + 0.95 * rows, size)
    places = panels(figure, rows, wide, sharex=True)
    order = list(places.T.flat)  # one joint below the other
    for axes in order[count:]:
        axes.set_visible(False)
    for j in range(model.n):
        factor = units[j].factor
        for k, (label, values) in enumerate(motions):
            draw_line(order[j], times, factor * values[:, j], line_style(k), label)
        _range(order[j], factor * float(model.lower[j]), factor * float(model.upper[j]))
        _named(order[j], f"{names[j]} ({units[j].value})")
    if bounded.any():
        lower, upper = model.lower[bounded], model.upper[bounded]
        axes = order[model.n]
        for k, (label, values) in enumerate(motions):
            inside = values[:, bounded]
            margin = np.minimum(inside - lower, upper - inside) / (0.5 * (upper - lower))
            draw_line(axes, times, 100.0 * margin.min(axis=1), line_style(k), label)
        _named(axes, "least margin (%)")
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, -0.08 * max(high, 1.0)), high)
        _beyond(axes, -np.inf, 0.0)
    lowest = {id(axes) for axes in (order[min(rows * (c + 1), count) - 1] for c in range(wide))}
    for axes in order[:count]:
        if id(axes) in lowest:
            axes.set_xlabel("time (s)")
            axes.tick_params(labelbottom=True)
    handles = list(order[0].get_lines()[: len(motions)]) if len(motions) > 1 else []
    legend_above(figure, handles + _handles(order[:count]), title)
    return figure


def _range(axes: Axes, lower: float, upper: float) -> None:
    """The range of a joint from one limit to the other, with shades beyond."""
    low, high = axes.get_ylim()
    if np.isfinite(lower) and np.isfinite(upper) and upper > lower:
        margin = _MARGIN * (upper - lower)
        data = axes.dataLim
        low = min(lower - margin, data.y0 - 0.3 * margin)
        high = max(upper + margin, data.y1 + 0.3 * margin)
        axes.set_yticks([lower, 0.5 * (lower + upper), upper])
        axes.yaxis.set_major_formatter(
            lambda value, _: f"{value:.3g}".replace("-", "\N{MINUS SIGN}")
        )
    else:  # a limit that is far away, or none, is no reason to make the line flat
        low = lower if np.isfinite(lower) and lower > low else low
        high = upper if np.isfinite(upper) and upper < high else high
    axes.set_ylim(low, high)
    _beyond(axes, -np.inf, lower)
    _beyond(axes, upper, np.inf)


def _beyond(axes: Axes, start: float, stop: float) -> None:
    """Shade from a limit to the edge, and a line at it."""
    low, high = axes.get_ylim()
    for limit, other in ((start, high), (stop, low)):
        if np.isfinite(limit) and low <= limit <= high:
            axes.axhspan(min(limit, other), max(limit, other), facecolor=ALERT, alpha=0.16,
                         linewidth=0.0, zorder=0.6, label="_beyond the limit")  # fmt: skip
            axes.axhline(limit, color=INK, linewidth=LIMIT_WIDTH, linestyle=LIMIT_DASHES,
                         zorder=1.5, label="_limit")  # fmt: skip
    axes.set_ylim(low, high)


def _named(axes: Axes, text: str) -> None:
    axes.set_title(text, loc="left", size=SMALL_SIZE, color=INK, pad=2.0)


def _handles(panels: list[Any]) -> list[Any]:
    """What a legend says of the limits, if there are any."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    if not any(str(line.get_label()) == "_limit" for axes in panels for line in axes.get_lines()):
        return []
    return [
        Line2D([], [], color=INK, linewidth=LIMIT_WIDTH, linestyle=LIMIT_DASHES, label="limit"),
        Patch(facecolor=ALERT, alpha=0.16, label="beyond it"),
    ]


def _motions(q: Any, N: int, n: int) -> list[tuple[str, Array]]:
    given = list(q.items()) if isinstance(q, Mapping) else [("motion", q)]
    if not given:
        raise InvalidValueError("q: expected at least one motion, got none.")
    motions = []
    for name, values in given:
        where = f"q of {name!r}" if isinstance(q, Mapping) else "q"
        array = as_reals(values, where)
        if array.shape != (N, n):
            raise ShapeError(
                f"{where}: expected positions of shape ({N}, {n}) for {N} times and {n} joints, "
                f"got {array.shape}."
            )
        if np.isinf(array).any():
            raise InvalidValueError(f"{where}: expected finite positions, or NaN for a gap.")
        motions.append((str(name), array))
    return motions


def _columns(columns: Any, count: int) -> int:
    if columns is None:
        return 1 if count < 6 else 2
    if isinstance(columns, bool) or not isinstance(columns, (int, np.integer)) or columns < 1:
        raise InvalidValueError(f"columns: expected a whole number from 1, got {columns!r}.")
    return min(int(columns), count)
