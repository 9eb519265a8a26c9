"""Gravity torques, inertia and coupling of joints over a range of configurations."""

from __future__ import annotations

from itertools import combinations
from operator import index
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..errors import InvalidValueError
from ..geometry import PRISMATIC
from ..simulation.dynamics_map import DynamicsMap
from .figures import (
    COLUMN,
    LABEL_SIZE,
    PAGE,
    SMALL_SIZE,
    THIN_WIDTH,
    heading,
    legend_above,
    line_style,
    new_figure,
    panels,
)
from .palette import INK, PALE, POSITIVE_MAP, SIGNED_MAP
from .plot_trajectory import draw_line
from .plot_units import Unit, joint_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PAIRS = 5  # lines of coupling that can be told apart
_LEAST = 0.005  # a coupling below it is not seen
_SPREAD = 50.0  # of inertias, from which on their axis is logarithmic
_ROUNDING = 1e-12


def plot_inertia_map(
    grid: DynamicsMap,
    *,
    of: int | None = None,
    pair: ArrayLike | None = None,
    degrees: bool = True,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Gravity torques, diagonal inertia and coupling over one or two joints.

    Over one joint: lines of all joints, and of the pairs of joints that are coupled most. Over two
    joints: three maps, of one joint and one pair. Coupling is ``M_ij / sqrt(M_ii M_jj)``, without
    unit: 0 where neither joint feels the other's acceleration, 1 where they move one body.

    Parameters
    ----------
    grid : DynamicsMap
        As `dynamics_map` gives it.
    of : int, optional
        Of two joints that vary: whose gravity torque and inertia, from 0; default the first.
    pair : array_like of int, shape (2,), optional
        Of two joints that vary: whose coupling, from 0; default these two.
    degrees : bool
        Whether angles are in degrees instead of radians.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        Three panels: gravity, inertia, coupling.

    Raises
    ------
    InvalidValueError
        No map; no such joints; ``of`` or ``pair`` where one joint varies.
    MissingExtraError
        Matplotlib is not installed.

    References
    ----------
    Seed book section 1.5.1.3.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.simulation import dynamics_map
    >>> figure = plot_inertia_map(dynamics_map(load("rx90"), 2))
    >>> [" ".join(axes.get_ylabel().split()) for axes in figure.axes]
    ['gravity torque (N m)', 'inertia (kg m²)', 'coupling (no unit)']
    """
    if not isinstance(grid, DynamicsMap):
        raise InvalidValueError(
            f"grid: expected a DynamicsMap, as dynamics_map(...) gives it, got "
            f"{type(grid).__name__}."
        )
    names = joint_names(None, grid.model.n, grid.model)
    if len(grid.joints) == 1:
        if of is not None or pair is not None:
            raise InvalidValueError(
                "of, pair: these choose what is on a map over two joints; over one joint all lines "
                "are drawn."
            )
        return _lines(grid, names, degrees, title, size)
    joint = grid.joints[0] if of is None else _joint(of, grid.model.n, "of")
    i, j = grid.joints if pair is None else _pair(pair, grid.model.n)
    return _maps(grid, names, joint, (i, j), degrees, title, size)


def _lines(
    grid: DynamicsMap, names: list[str], degrees: bool, title: str | None, size: ArrayLike | None
) -> Figure:
    model, n = grid.model, grid.model.n
    factor, unit = _axis(grid, 0, degrees)
    x = factor * grid.ranges[0]
    figure = new_figure(COLUMN, 4.6, size)
    gravity, inertia, coupling = panels(figure, 3, sharex=True)[:, 0]
    diagonal = np.einsum("kii->ki", grid.mass)
    for j in range(n):
        draw_line(gravity, x, grid.gravity[:, j], line_style(j), names[j])
        draw_line(inertia, x, diagonal[:, j], line_style(j), names[j])
    if (diagonal > 0.0).all() and diagonal.max() > _SPREAD * diagonal.min():
        inertia.set_yscale("log")
    gravity.set_ylabel(f"gravity torque\n({_mixed(model, 'N m', 'N')})")
    inertia.set_ylabel(f"inertia\n({_mixed(model, 'kg m²', 'kg')})")
    coupling.set_ylabel("coupling\n(no unit)")
    pairs = list(combinations(range(n), 2))
    strength = {p: _strength(grid.coupling[:, p[0], p[1]]) for p in pairs}
    # the strongest, in the order of the joints
    kept = sorted(sorted(pairs, key=lambda p: -strength[p])[:_PAIRS])
    drawn = [p for p in kept if strength[p] > _LEAST]
    for k, (i, j) in enumerate(drawn):
        label = f"{names[i]} and {names[j]}"
        draw_line(coupling, x, grid.coupling[:, i, j], line_style(k), label)
    coupling.set_ylim(-1.08, 1.08)
    coupling.axhline(0.0, color=PALE, linewidth=THIN_WIDTH, zorder=1.2, label="_zero")
    if not drawn:
        _note(coupling, "no coupling" if pairs else "one joint: no coupling")
    coupling.set_xlabel(f"{names[grid.joints[0]]} ({unit})")
    figure.align_ylabels()
    legend_above(figure, [line for line in gravity.get_lines() if n > 1], title)
    if drawn:
        figure.legend(
            handles=[line for line in coupling.get_lines() if line.get_label()[0] != "_"],
            loc="outside lower center", ncols=2, fontsize=SMALL_SIZE, labelcolor=INK,
            frameon=False, handlelength=2.6, columnspacing=1.4, handletextpad=0.5,
            labelspacing=0.3, borderpad=0.1,
        )  # fmt: skip
    return figure


def _maps(
    grid: DynamicsMap,
    names: list[str],
    joint: int,
    pair: tuple[int, int],
    degrees: bool,
    title: str | None,
    size: ArrayLike | None,
) -> Figure:
    i, j = pair
    prismatic = grid.model.table.sigma[grid.model.table.joint_rows] == PRISMATIC
    figure = new_figure(PAGE, 2.55 if title is None else 2.8, size)
    places = panels(figure, 1, 3, sharey=True)[0]
    maps = (
        (f"gravity torque\nof {names[joint]}", "N" if prismatic[joint] else "N m",
         _rounded(grid.gravity[..., joint], grid.gravity), True),
        (f"inertia\nof {names[joint]}", "kg" if prismatic[joint] else "kg m²",
         grid.mass[..., joint, joint], False),
        (f"coupling\n{names[i]}, {names[j]}", "no unit",
         _rounded(grid.coupling[..., i, j], np.ones(1)), True),
    )  # fmt: skip
    (x_factor, x_unit), (y_factor, y_unit) = (_axis(grid, k, degrees) for k in (0, 1))
    x, y = x_factor * grid.ranges[0], y_factor * grid.ranges[1]
    for axes, (label, unit, values, signed) in zip(places, maps, strict=True):
        _map(figure, axes, x, y, values, unit, signed)
        heading(axes, label, PAGE / 3.0 - 0.6)  # beside the bar
        axes.set_xlabel(f"{names[grid.joints[0]]} ({x_unit})")
        _ticks(axes.xaxis, x_unit)
    places[0].set_ylabel(f"{names[grid.joints[1]]} ({y_unit})")
    _ticks(places[0].yaxis, y_unit)
    legend_above(figure, [], title)
    return figure


def _map(
    figure: Figure, axes: Axes, x: Array, y: Array, values: Array, unit: str, signed: bool
) -> None:
    """Colours, thin level lines, and a bar that explains them."""
    z = np.ma.masked_invalid(values.T)
    low, high = (float(z.min()), float(z.max())) if z.count() else (0.0, 0.0)
    size = max(abs(low), abs(high))
    if signed:
        low, high = -(size or 1.0), size or 1.0
    elif high - low <= 1e-9 * size:
        low, high = low - 0.5 * (size or 1.0), high + 0.5 * (size or 1.0)
    image = axes.pcolormesh(
        x, y, z, cmap=SIGNED_MAP if signed else POSITIVE_MAP, vmin=low, vmax=high,
        shading="nearest", rasterized=True,
    )  # fmt: skip
    if z.count() and float(np.ptp(z)) > 1e-9 * size:
        axes.contour(
            x, y, z, levels=8, colors=[INK], linewidths=THIN_WIDTH, linestyles="-", alpha=0.6
        )
    elif not size:
        _note(axes, "zero everywhere" if z.count() else "a joint moves\nno inertia")
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    axes.grid(False)
    bar: Any = figure.colorbar(image, ax=axes, pad=0.03, aspect=25)
    bar.ax.tick_params(
        labelsize=SMALL_SIZE, labelcolor=INK, color=PALE, length=2.5, width=THIN_WIDTH
    )
    bar.ax.set_facecolor("white")
    bar.outline.set(edgecolor=PALE, linewidth=THIN_WIDTH)
    bar.ax.yaxis.get_offset_text().set(size=SMALL_SIZE, color=INK)
    bar.set_label(unit if unit == "no unit" else f"({unit})", size=LABEL_SIZE, color=INK)


def _rounded(values: Array, among: Array) -> Array:
    """Zero instead of rounding errors, which would be stretched to all colours of a map."""
    most = float(np.abs(among).max(initial=0.0))
    return np.where(np.abs(values) <= _ROUNDING * most, 0.0, values)


def _note(axes: Axes, text: str) -> None:
    axes.text(
        0.5, 0.5, text, color=INK, transform=axes.transAxes, size=SMALL_SIZE, ha="center",
        va="center", zorder=5.0, bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.85},
    )  # fmt: skip


def _ticks(axis: Any, unit: str) -> None:
    """Round numbers of degrees."""
    from matplotlib.ticker import MaxNLocator

    steps = [1.0, 1.5, 3.0, 4.5, 6.0, 9.0, 10.0] if unit == "deg" else None
    axis.set_major_locator(MaxNLocator(5, steps=steps))


def _axis(grid: DynamicsMap, k: int, degrees: bool) -> tuple[float, str]:
    """Factor and symbol of the unit of a joint that varies."""
    table = grid.model.table
    if table.sigma[table.joint_rows[grid.joints[k]]] == PRISMATIC:
        return 1.0, Unit.METRE.value
    unit = Unit.DEGREE if degrees else Unit.RADIAN
    return unit.factor, unit.value


def _mixed(model: Any, angular: str, linear: str) -> str:
    prismatic = model.table.sigma[model.table.joint_rows] == PRISMATIC
    if prismatic.all():
        return linear
    return f"{angular} or {linear}" if prismatic.any() else angular


def _strength(values: Array) -> float:
    size = np.abs(values[np.isfinite(values)])
    return float(size.max()) if size.size else 0.0


def _joint(value: Any, n: int, name: str) -> int:
    try:
        joint = index(value)
    except TypeError:
        joint = -1
    if not 0 <= joint < n:
        raise InvalidValueError(f"{name}: expected a joint from 0 to {n - 1}, got {value!r:.60}.")
    return joint


def _pair(pair: Any, n: int) -> tuple[int, int]:
    if np.shape(pair) != (2,) or pair[0] == pair[1]:
        raise InvalidValueError(f"pair: expected two different joints, got {pair!r:.60}.")
    return _joint(pair[0], n, "pair"), _joint(pair[1], n, "pair")
