"""Where a robot is singular: maps of factors of a determinant over two joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector
from ..errors import InvalidValueError, ShapeError
from ..model import RobotModel
from ..symbolic import SingularityMap
from .figures import (
    COLUMN,
    LABEL_SIZE,
    LIMIT_DASHES,
    LIMIT_WIDTH,
    PAGE,
    SMALL_SIZE,
    THIN_WIDTH,
    heading,
    legend_above,
    new_figure,
    panels,
)
from .palette import INK, PALE, SIGNED_MAP
from .plot_units import Unit, as_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_EVERY = 10  # of the postures of a long path has a marker
_ASIDE = 1e-9  # of a cell
_ZERO = 1e-12  # beside the greatest value


def plot_singularities(
    maps: SingularityMap | Sequence[SingularityMap],
    model: RobotModel | None = None,
    *,
    q: ArrayLike | None = None,
    degrees: bool = True,
    columns: int | None = None,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Maps of singular factors, or of the determinant, over two joints.

    The robot is singular where they are zero, which is drawn bold: where the values change sign,
    or are zero on the grid itself. A zero that they only touch between the grid's values is not
    found.

    Parameters
    ----------
    maps : SingularityMap or sequence of them
        From `singularity_map`; several stand beside each other.
    model : RobotModel, optional
        The robot: what lies outside its joint limits is hatched.
    q : array_like, shape (n,) or (N, n), optional
        Postures to mark, rad or m; several are joined by a line in their order. A map shows their
        two joints only: the other ones need not stand where the map was made.
    degrees : bool
        Whether angles are in degrees on the axes instead of radians.
    columns : int, optional
        How many maps stand in a row; default two, or one for a single map.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        With a colour bar for each map, centred at zero.

    Raises
    ------
    InvalidValueError, ShapeError
        No maps; maps with less than two values on an axis, or without any number; a model or
        postures without these joints.
    MissingExtraError
        Matplotlib is not installed.

    References
    ----------
    Seed book section 1.3.1.3.

    Examples
    --------
    >>> a = b = np.linspace(-1.0, 1.0, 21)
    >>> wrist = SingularityMap("arm", np.array([2, 4]), ("joint_3", "joint_5"), a, b,
    ...                        np.sin(a)[:, None] * np.cos(b), "S3 C5", ("rad", "rad", "1"))
    >>> figure = plot_singularities(wrist)
    >>> figure.axes[0].get_xlabel(), figure.axes[0].get_title()
    ('joint_3 (deg)', 'S3 C5')
    """
    given = [maps] if isinstance(maps, SingularityMap) else _as_list(maps)
    for grid in given:
        _check(grid, model)
    postures = None if q is None else _postures(q, given)
    wide = _columns(columns, len(given))
    rows = -(-len(given) // wide)
    width = COLUMN if wide == 1 else PAGE
    figure = new_figure(width, 0.35 + rows * min(0.85 * width / wide, 3.0), size)
    places = panels(figure, rows, wide)
    for k, axes in enumerate(places.flat):
        if k >= len(given):
            axes.set_visible(False)
            continue
        _map(figure, axes, given[k], degrees)
        if model is not None:
            _outside(axes, given[k], model, degrees)
        if postures is not None:
            x, y = (_scale(given[k], i, degrees)[0] * postures[:, given[k].joints[i]]
                    for i in (0, 1))  # fmt: skip
            axes.plot(x, y, color=INK, linewidth=1.0, marker="o", markersize=3.6,
                      markerfacecolor="white", markeredgecolor=INK, markeredgewidth=0.9,
                      markevery=sorted({*range(0, len(x), _EVERY if len(x) > _EVERY else 1),
                                        len(x) - 1}), label="postures",
                      zorder=4.0)  # fmt: skip
        heading(axes, given[k].label, width / wide)
    legend_above(figure, _handles(figure), title)
    return figure


def _map(figure: Figure, axes: Axes, grid: SingularityMap, degrees: bool) -> None:
    """Colours for the values, a bold line where they are zero."""
    (x_factor, x_unit), (y_factor, y_unit) = (_scale(grid, i, degrees) for i in (0, 1))
    x, y, z = x_factor * grid.first, y_factor * grid.second, np.ma.masked_invalid(grid.values.T)
    most = float(np.abs(z).max())
    bound = most or 1.0
    image = axes.pcolormesh(
        x, y, z, cmap=SIGNED_MAP, vmin=-bound, vmax=bound, shading="nearest", rasterized=True
    )
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    axes.set_xlabel(f"{grid.names[0]} ({x_unit})")
    axes.set_ylabel(f"{grid.names[1]} ({y_unit})")
    axes.grid(False)
    for axis, unit in ((axes.xaxis, x_unit), (axes.yaxis, y_unit)):
        _ticks(axis, unit)
    bar: Any = figure.colorbar(image, ax=axes, pad=0.02, aspect=25)
    bar.ax.tick_params(
        labelsize=SMALL_SIZE, labelcolor=INK, color=PALE, length=2.5, width=THIN_WIDTH
    )
    bar.ax.set_facecolor("white")
    bar.outline.set(edgecolor=PALE, linewidth=THIN_WIDTH)
    bar.ax.yaxis.get_offset_text().set(size=SMALL_SIZE, color=INK)
    unit = grid.units[2].replace("^2", "²").replace("^3", "³")
    bar.set_label("value" if unit == "1" else f"value ({unit})", size=LABEL_SIZE, color=INK)
    if most == 0.0:
        axes.text(
            0.5, 0.5, "zero everywhere:\nsingular in all\nof these postures", color=INK,
            transform=axes.transAxes, size=SMALL_SIZE, ha="center", va="center", zorder=5.0,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.85},
        )  # fmt: skip
        return
    for level in _crossings(np.where(np.abs(z) <= _ZERO * most, 0.0, z.filled(np.nan))):
        if (level > 0.0).any() and (level <= 0.0).any():
            level = np.ma.masked_invalid(level)
            lines = axes.contour(x, y, level, levels=[0.0], colors=[INK], linewidths=2.0)
            lines.set_label("_zero")


def _crossings(z: Array) -> list[Array]:
    """Arrays whose contours at zero, from above, are the zeros of one with exact zeros.

    A zero between values of different signs takes a neighbour's side; zeros touched from below, or
    at the edge, go to an array of their own with the sign changed.
    """
    z = z.copy()
    for axis in (0, 1):
        w = np.moveaxis(z, axis, 0)  # a view
        here = (w[1:-1] == 0.0) & (w[:-2] * w[2:] < 0.0)
        w[1:-1][here] = _ASIDE * w[2:][here]
    left = np.pad(z == 0.0, 1)
    below = np.pad(z < 0.0, 1)
    rows, columns = z.shape
    around = [(slice(i, i + rows), slice(j, j + columns)) for i in range(3) for j in range(3)]
    touched = np.pad(left[1:-1, 1:-1] & np.any([below[part] for part in around], axis=0), 1)
    near = np.any([touched[part] for part in around], axis=0)
    return [z, np.where(near, -z, np.nan)]


def _ticks(axis: Any, unit: str) -> None:
    """Round numbers of degrees."""
    from matplotlib.ticker import MaxNLocator

    steps = [1.0, 1.5, 3.0, 4.5, 6.0, 9.0, 10.0] if unit == "deg" else None
    axis.set_major_locator(MaxNLocator(6, steps=steps))


def _outside(axes: Axes, grid: SingularityMap, model: RobotModel, degrees: bool) -> None:
    """Hatches outside the joint limits, and lines at them."""
    for i, (line, area) in enumerate(((axes.axvline, axes.axvspan), (axes.axhline, axes.axhspan))):
        j = int(grid.joints[i])
        factor = _scale(grid, i, degrees)[0]
        ends = factor * (grid.first, grid.second)[i][[0, -1]]
        for limit, end, side in (
            (model.lower[j], ends[0], "lower"),
            (model.upper[j], ends[1], "upper"),
        ):
            at = factor * float(limit)
            if not ends[0] <= at <= ends[1]:
                if at > ends[1] if side == "lower" else at < ends[0]:
                    at = ends[1] if side == "lower" else ends[0]  # the whole map is outside
                else:
                    continue
            line(at, color=INK, linewidth=LIMIT_WIDTH, linestyle=LIMIT_DASHES, zorder=2.5,
                 label=f"_{side} limit of {grid.names[i]}")  # fmt: skip
            if at != end:
                area(min(at, end), max(at, end), facecolor=(1.0, 1.0, 1.0, 0.55), edgecolor=PALE,
                     hatch="////", linewidth=0.0, zorder=2.4, label="_outside")  # fmt: skip


def _handles(figure: Figure) -> list[Any]:
    """Entries of the legend: what there is on the maps."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    labels = {
        str(artist.get_label())
        for axes in figure.axes
        for artist in (*axes.collections, *axes.patches, *axes.get_lines())
    }
    handles: list[Any] = []
    if "_zero" in labels:
        handles.append(Line2D([], [], color=INK, linewidth=2.0, label="singular: zero"))
    if "_outside" in labels:
        handles.append(
            Patch(facecolor="white", edgecolor=PALE, hatch="////", label="outside joint limits")
        )
    if "postures" in labels:
        handles += [
            line for axes in figure.axes for line in axes.get_lines()
            if line.get_label() == "postures"
        ][:1]  # fmt: skip
    return handles


def _scale(grid: SingularityMap, i: int, degrees: bool) -> tuple[float, str]:
    """Factor and symbol of the unit of an axis."""
    unit = as_unit(grid.units[i])
    if unit is Unit.RADIAN and degrees:
        unit = Unit.DEGREE
    return unit.factor, unit.value


def _as_list(maps: Any) -> list[SingularityMap]:
    given = list(maps) if isinstance(maps, Sequence) and not isinstance(maps, str) else []
    if not given or not all(isinstance(grid, SingularityMap) for grid in given):
        raise InvalidValueError(
            "maps: expected one or several SingularityMap, as singularity_map gives them, got "
            f"{maps!r:.60}."
        )
    return given


def _check(grid: SingularityMap, model: RobotModel | None) -> None:
    shape = (grid.first.size, grid.second.size)
    if grid.values.shape != shape or min(shape) < 2:
        raise ShapeError(
            f"maps: {grid.label!r} needs at least two values of each joint and a value for each "
            f"pair, got {shape} and {grid.values.shape}."
        )
    if not np.isfinite(grid.values).any():
        raise InvalidValueError(f"maps: {grid.label!r} has no finite value.")
    if model is not None and max(grid.joints) >= model.n:
        raise ShapeError(
            f"model: {grid.label!r} is a map over joints {grid.joints.tolist()} (from 0), which "
            f"{model.name!r} with its {model.n} joints does not have."
        )


def _postures(q: ArrayLike, maps: Sequence[SingularityMap]) -> Array:
    values = np.atleast_1d(np.asarray(q, dtype=float))
    rows = as_vector(q, values.shape[-1], "q")
    least = 1 + max(int(grid.joints.max()) for grid in maps)
    if rows.ndim > 2 or rows.shape[-1] < least:
        raise ShapeError(
            f"q: expected one posture (n,) or several (N, n), n at least {least}, got {rows.shape}."
        )
    return rows.reshape(-1, rows.shape[-1])


def _columns(columns: Any, count: int) -> int:
    if columns is None:
        return min(count, 2)
    if isinstance(columns, bool) or not isinstance(columns, (int, np.integer)) or columns < 1:
        raise InvalidValueError(f"columns: expected a whole number from 1, got {columns!r}.")
    return min(int(columns), count)
