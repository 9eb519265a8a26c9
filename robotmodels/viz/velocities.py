"""Figures of velocities: inverse models near singularities, ellipsoids, maps of singularities.

Parameters
----------
distance : array_like, shape (N,)
    Distance from the singular position, rad or m, ascending; it may have a sign.
solutions : mapping of str to IKMSolution, or sequence
    Result of each method at these distances, by its name: an `IKMSolution` of N rows, or a pair of
    arrays, the joint velocities (N, n) and the error of the twist (N, 6) or None, linear then
    angular. NaN rows leave a gap.
names, model, units, limits, degrees, columns, **look
    See `robotmodels.viz`; names of the methods of a sequence. Of the limits the velocities are
    drawn, the greater of both directions; in maps, areas outside the joint limits are hatched.
each_joint : bool
    Whether each method has a column with the speeds of all joints, instead of lines for the
    greatest speed of each method.
distance_unit, distance_name : Unit or str, and str
    Of the axis: ``deg``, ``rad``, ``m`` or ``mm``, and its name.
logarithmic : bool, optional
    Whether the distance is on a scale of powers; default where most samples are near zero.
ellipsoids : Ellipsoid or sequence of Ellipsoid
    One, several, or batches, which are taken apart.
labels : sequence of str, optional
    Texts of the legend for the ellipsoids of every quantity, in their order; default numbers.
maps : SingularityMap or sequence of them
    From `singularity_map`; several stand beside each other.
q : array_like, shape (n,) or (N, n), optional
    Postures to mark, rad or m; several are joined by a line in their order.

Returns
-------
matplotlib.figure.Figure

References
----------
Book sections 1.3.1.3 and 1.3.2; Khalil and Dombre, section 5.8.2.

Examples
--------
>>> d = np.linspace(-0.1, 0.1, 11)
>>> bounded = d[:, None] / (d[:, None] ** 2 + 1e-3)
>>> figure = plot_inverse_velocities(d, {"damped": (bounded, None)}, units="rad")
>>> [" ".join(axes.get_ylabel().split()) for axes in figure.axes]
['greatest joint speed (rad/s)']
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_floats, as_reals
from .._choices import as_instance
from ..errors import InvalidValueError, ShapeError
from ..kinematics.ellipsoid import Ellipsoid, EllipsoidQuantity
from ..kinematics.inverse.solution import IKMSolution
from ..model import RobotModel
from ..symbolic import SingularityMap
from ..trajectories.limits import MotionLimits
from . import over_time, style
from .over_time import Unit
from .shapes import as_ellipsoids
from .style import COLUMN, DASHED, INK, LIMIT, PAGE, PALE, Axes, Figure, Look

_DECADES = 30.0  # ratio from which on a scale of powers shows more
_LEAST = 1e-6  # beside the greatest: smaller values are drawn as zero
_BELOW = {
    1: "missing linear\nvelocity (m/s)",
    2: "missing angular\nvelocity (rad/s)",
    3: "least singular\nvalue",
}
_PLANES = ((0, 1), (0, 2), (1, 2))
_SYMBOLS = dict(zip(EllipsoidQuantity, "vωfm", strict=True))
_LONGEST = 8.0  # extent shown of an unbounded ellipsoid, in its least radii
_FAR = 1e3  # times the extent: unbounded axes are drawn up to there


@style.plot
def plot_inverse_velocities(
    distance: ArrayLike,
    solutions: Mapping[str, Any] | Sequence[Any],
    names: Sequence[str] | None = None,
    *,
    model: RobotModel | None = None,
    units: Unit | str | Sequence[Unit | str] | None = None,
    limits: MotionLimits | None = None,
    each_joint: bool = False,
    distance_unit: Unit | str = Unit.DEGREE,
    distance_name: str = "distance from the singular position",
    logarithmic: bool | None = None,
    **look: Unpack[Look],
) -> Figure:
    """Joint speeds and task error of several methods across a singular position.

    Panels: speeds; the missing linear and angular velocity, for those rows that were requested;
    the least singular value, where it is known.
    """
    x = as_floats(distance, "distance")
    if x.ndim != 1 or not x.size or (np.diff(x) <= 0.0).any():
        raise InvalidValueError("distance: expected a vector of distances that ascend.")
    named = style.as_named(solutions, names, "solutions", "method")
    methods = {name: _method(each, name, x.size) for name, each in named.items()}
    counts = sorted({method[0].shape[1] for method in methods.values()})
    if len(counts) > 1:
        raise ShapeError(f"solutions: expected one robot, got {counts} joints.")
    n = counts[0]
    joints, speeds = over_time.joints_of(n, model, None, units)
    bounds, unit = over_time.as_limits(limits, n), over_time.as_unit(distance_unit)
    x = unit.factor * x
    below = [k for k in _BELOW if any(method[k] is not None for method in methods.values())]
    rows, columns = len(speeds) + len(below), len(methods) if each_joint else 1
    width = COLUMN if columns == 1 else PAGE
    shared: dict[str, Any] = {"sharex": True, "sharey": "row"}
    figure, grid = style.panels(width, 0.75 + 1.05 * rows, look, rows, columns, **shared)
    for m, (name, method) in enumerate(methods.items()):
        column = grid[:, m if each_joint else 0]
        for axes, (kind, some) in zip(column, speeds.items(), strict=False):
            which, speed = [joints[j] for j in some], kind.factor * np.abs(method[0][:, some])
            if each_joint:
                over_time.lines_over_time(axes, x, speed, which, some)
            else:
                over_time.lines_over_time(axes, x, speed.max(axis=1, keepdims=True), [name], [m])
            if bounds is not None:
                most = np.maximum(bounds.velocity[some], -bounds.velocity_lower[some])
                over_time.limit_lines(axes, kind.factor * most, which, some if each_joint else None)
        for axes, k in zip(column[len(speeds) :], below, strict=True):
            if method[k] is not None:
                line = {"color": INK} if each_joint else style.line(m)
                axes.plot(x, method[k], label=f"_{name}", **line)
        if each_joint:
            column[0].set_title(style.wrapped(name, width / columns))
    labels = [f"{'' if each_joint else 'greatest '}joint\nspeed ({k.of(1)})" for k in speeds]
    for row, label in zip(grid, labels + [_BELOW[k] for k in below], strict=True):
        row[0].set_ylabel(label)
        if "missing" not in label:
            _set_powers(row[0], "y")
    near = np.median(np.abs(x)) < 0.25 * np.abs(x).max() if logarithmic is None else logarithmic
    for axes in grid[-1]:
        axes.set_xlabel(style.wrapped(f"{distance_name} ({unit.value})", width / columns))
        if near:
            _set_powers(axes, "x")
    return style.finished(figure, look, joints if each_joint else list(methods))


def _method(solution: Any, name: str, N: int) -> tuple[Array, Any, Any, Any]:
    """Joint velocities (N, n); norms of the missing velocities and least singular values (N,)."""
    mask, least = np.ones(6, dtype=bool), None
    if isinstance(solution, IKMSolution) and solution.a is None:
        v, error, mask = solution.v, solution.error, solution.mask
        least = solution.singular_values[..., -1] if solution.singular_values.size else None
    elif isinstance(solution, tuple) and len(solution) == 2:
        v, error = solution
    else:
        raise InvalidValueError(f"{name!r}: expected an IKMSolution or a pair of arrays.")
    v, error = as_reals(v, name), None if error is None else as_reals(error, name)
    if v.ndim != 2 or len(v) != N or (error is not None and error.shape != (N, 6)):
        raise ShapeError(f"{name!r}: expected shapes ({N}, n) and ({N}, 6), got {v.shape}.")
    if error is None:
        return v, None, None, least
    linear, angular = (
        np.linalg.norm(error[:, rows], axis=1) if mask[rows].any() else None
        for rows in (slice(0, 3), slice(3, 6))
    )
    return v, linear, angular, least


def _set_powers(axes: Any, which: str) -> None:
    """A scale of powers where values differ by more than a decade or two; linear around zero."""
    drawn = [each for each in axes.get_lines() if LIMIT not in str(each.get_label())]
    values = np.concatenate([np.ravel(getattr(each, f"get_{which}data")()) for each in drawn])
    sizes = np.abs(values[np.isfinite(values)])
    most = sizes.max(initial=0.0)
    least = sizes.min(where=sizes > _LEAST * most, initial=np.inf)
    if most < _DECADES * least:
        return
    if (values > 0.5 * least).all():
        axes.set(**{f"{which}scale": "log"})
        return
    style.powers_around_zero(axes, which, 10.0 ** np.floor(np.log10(least)), 3)
    if not (values < 0.0).any():
        axes.set(**{f"{which}lim": (0.0, 1.5 * most)})


@style.plot
def plot_ellipsoids(
    ellipsoids: Ellipsoid | Sequence[Ellipsoid],
    *,
    labels: Sequence[str] | None = None,
    **look: Unpack[Look],
) -> Figure:
    """Projections of ellipsoids on the planes xy, xz and yz of the world, a row for each quantity.

    A projection shows the largest component along every direction of the plane. The principal axes
    are drawn in it, unbounded ones as dashes to the border of the picture.
    """
    given = as_ellipsoids(ellipsoids)
    if not given:
        raise InvalidValueError("ellipsoids: expected at least one, got none.")
    rows = [[e for e in given if e.quantity is quantity] for quantity in EllipsoidQuantity]
    rows = [own for own in rows if own]
    count = max(map(len, rows))
    names = [str(k + 1) for k in range(count)] if count > 1 else ["_"]
    if labels is not None:
        names = style.as_texts(labels, count, "labels", "ellipsoids of a kind")
    figure, grid = style.panels(PAGE, 0.35 + 2.35 * len(rows), look, len(rows), len(_PLANES))
    for row, own in zip(grid, rows, strict=True):
        quantity = own[0].quantity
        radii = np.array([e.radii for e in own])
        finite = radii[np.isfinite(radii) & (radii > 0)]
        half = 1.15 * float(finite.max(initial=0.0)) or 1.0
        if not np.isfinite(radii).all() and finite.size:
            half = min(half, 1.15 * _LONGEST * float(finite.min()))
        for axes, plane in zip(row, _PLANES, strict=True):
            for k, ellipsoid in enumerate(own):
                _draw_projection(axes, ellipsoid, plane, half, k, names[k])
            x, y = (f"${_SYMBOLS[quantity]}_{'xyz'[i]}$ ({quantity.unit})" for i in plane)
            axes.set(xlim=(-half, half), ylim=(-half, half), aspect="equal", xlabel=x, ylabel=y)
            axes.locator_params(nbins=5)
    return style.finished(figure, look)


def _draw_projection(
    axes: Axes, ellipsoid: Ellipsoid, plane: tuple[int, int], half: float, k: int, label: str
) -> None:
    """Border, area and principal axes of the projection on a plane."""
    U, r = ellipsoid.axes[list(plane)], np.minimum(ellipsoid.radii, _FAR * half)
    squares, V = np.linalg.eigh((U * r**2) @ U.T)
    t = np.linspace(0.0, 2.0 * np.pi, 361)
    circle = np.stack((np.cos(t), np.sin(t)))
    points = V @ (np.sqrt(np.maximum(squares, 0.0))[:, None] * circle)
    color = style.line(k)["color"]
    axes.plot(*points, zorder=3, linewidth=1.2, label=label, **style.line(k))
    axes.fill(*points, facecolor=color, alpha=0.10, linewidth=0.0, zorder=2)
    for u, radius, endless in zip(U.T, r, ~np.isfinite(ellipsoid.radii), strict=True):
        if np.linalg.norm(u) > 1e-6 and radius > 0.0:
            x, y = np.outer(u, (-radius, radius))
            dashes, name = ((0, (6.0, 3.0)), "_unbounded axis") if endless else ("-", "_axis")
            line: dict[str, Any] = {"color": color, "linestyle": dashes, "linewidth": 0.8}
            axes.plot(x, y, alpha=0.8, label=name, **line)
    if not (r > 0).any():
        axes.plot(0.0, 0.0, "o", color=INK, label="_no motion")


@style.plot
def plot_singularities(
    maps: SingularityMap | Sequence[SingularityMap],
    model: RobotModel | None = None,
    *,
    q: ArrayLike | None = None,
    degrees: bool = True,
    columns: int | None = None,
    **look: Unpack[Look],
) -> Figure:
    """Maps of singular factors, or of the determinant, over two joints.

    The robot is singular where they are zero, drawn as bold lines: where the values change sign,
    and where they are zero on the grid itself (dots). A zero between grid points at which the sign
    does not change is not found.
    """
    given = [maps] if isinstance(maps, SingularityMap) else list(maps)
    if not given:
        raise InvalidValueError("maps: expected at least one SingularityMap, got none.")
    postures = None if q is None else np.atleast_2d(as_floats(q, "q"))
    for grid in given:
        least = 1 + int(as_instance(grid, SingularityMap, "maps").joints.max())
        counts = {"model": None if model is None else model.n}
        counts["q"] = None if postures is None else postures.shape[-1]
        for name, n in counts.items():
            if n is not None and n < least:
                raise ShapeError(f"{name}: {grid.label!r} needs {least} joints, got {n}.")
    wide = style.as_columns(columns, len(given), 2)
    rows = -(-len(given) // wide)
    width = COLUMN if wide == 1 else PAGE
    height = 0.35 + rows * min(0.85 * width / wide, 3.0)
    figure, places = style.panels(width, height, look, rows, wide)
    for axes in places.flat[len(given) :]:
        axes.set_visible(False)
    for axes, grid in zip(places.flat, given, strict=False):
        units = [over_time.as_unit(unit) for unit in grid.units[:2]]
        units = [Unit.DEGREE if degrees and u is Unit.RADIAN else u for u in units]
        _draw_map(figure, axes, grid, units)
        if model is not None:
            _hatch_outside(axes, grid, model, units)
        if postures is not None:
            x, y = (u.factor * postures[:, j] for u, j in zip(units, grid.joints, strict=True))
            line = {"marker": "o", "markersize": 3.6, "markerfacecolor": "white", "zorder": 4.0}
            line |= {"color": INK, "markevery": max(1, len(x) // 10), "label": "postures"}
            axes.plot(x, y, **line)
        axes.set_title(style.wrapped(grid.label, width / wide))
    return style.finished(figure, look)


def _draw_map(figure: Figure, axes: Axes, grid: SingularityMap, units: list[Unit]) -> None:
    """Colours for the values, bold lines where they are zero."""
    x, y = (u.factor * axis for u, axis in zip(units, (grid.first, grid.second), strict=True))
    unit = grid.units[2].replace("^2", "²").replace("^3", "³")
    label = "value" if unit == "1" else f"value ({unit})"
    most = style.color_map(figure, axes, x, y, grid.values, True, label)
    style.joint_axes(axes, grid.names, units)
    if most == 0.0:
        style.note(axes, "zero everywhere:\nsingular in all\nof these postures")
        return
    # exact zeros (to rounding) become a tiny value of the sign of a neighbour, so that lines cross
    z = np.where(np.abs(grid.values) <= 1e-12 * most, 0.0, grid.values)
    zero = z == 0.0
    i, j = np.nonzero(zero)
    axes.plot(x[i], y[j], "o", color=INK, markersize=2.0, markeredgewidth=0.0, label="_zero")
    z = np.ma.masked_invalid(np.where(zero, 1e-12 * most, z).T)
    changes = (z > 0.0).any() and (z < 0.0).any()
    if changes:
        axes.contour(x, y, z, levels=[0.0], colors=[INK], linewidths=2.0)
    if zero.any() or changes:
        axes.plot([], [], color=INK, linewidth=2.0, label="singular: zero")


def _hatch_outside(axes: Axes, grid: SingularityMap, model: RobotModel, units: list[Unit]) -> None:
    """Hatches outside the joint limits, and lines at them."""
    box = {"facecolor": (1.0, 1.0, 1.0, 0.55), "edgecolor": PALE, "hatch": "////"}
    box |= {"linewidth": 0.0, "zorder": 2.4, "label": "outside joint limits"}
    lines, areas = (axes.axvline, axes.axhline), (axes.axvspan, axes.axhspan)
    for i, values in enumerate((grid.first, grid.second)):
        j, k = int(grid.joints[i]), units[i].factor
        first, last = k * values[[0, -1]]
        lower, upper = np.clip((k * model.lower[j], k * model.upper[j]), first, last)
        for limit, edge in ((lower, first), (upper, last)):
            if limit != edge:
                lines[i](limit, color=INK, zorder=2.5, label=f"_limit of {grid.names[i]}", **DASHED)
                areas[i](*sorted((limit, edge)), **box)
