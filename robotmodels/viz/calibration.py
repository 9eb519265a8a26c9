"""Figures of calibrations: residuals, parameters, errors in space, selected configurations.

Parameters
----------
result : CalibrationResult
    Of `calibration.fit`.

Returns
-------
matplotlib.figure.Figure

References
----------
Seed book sections 1.4.4 and 1.4.5.

Examples
--------
>>> import robotmodels as rm
>>> import robotmodels.calibration as calibration
>>> arm = rm.load("rx90")
>>> q = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 6))
>>> result = calibration.fit(arm, calibration.Pose(q, rm.dgm(arm, q)), folds=0, held_out=0.0)
>>> [axes.get_ylabel() for axes in plot_calibration_residuals(result).axes][::2][2:4]
['z (mm)', 'rx (deg)']
>>> [axes.get_xlabel() for axes in plot_calibration_parameters(result).axes]
['correction (mm)', 'correction (deg)']
>>> plot_calibration_correlations(result).axes[1].get_ylabel()
'correlation'
>>> [axes.get_xlabel() for axes in plot_calibration_normality(result).axes]
['residual / standard deviation', 'normal quantile']
>>> plot_calibration_in_space(result, magnification=100).texts[0].get_text().split(",")[-1]
' arrows x 100'
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_exact, as_reals
from ..calibration.extended_table import extend_table
from ..calibration.parameters import GeometricParameters
from ..calibration.report import MeasuredResiduals, measured_residuals
from ..calibration.result import CalibrationResult
from ..calibration.selection import SelectedConfigurations
from ..errors import InvalidValueError, ShapeError
from ..estimation import confidence_intervals
from . import style
from .over_time import Unit
from .space import across, fill_cells, space
from .style import ALERT, DASHED, INK, PAGE, PALE, PALETTE, ZERO

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BEFORE, _AFTER = PALETTE[1], PALETTE[0]
_RING: dict[str, Any] = {"marker": "o", "linestyle": "", "color": ALERT, "markersize": 6.0}
_RING |= {"markerfacecolor": "none", "markeredgewidth": 0.9, "clip_on": False}
_FEW = 60  # configurations up to which every residual has a stem
_UNITS = {
    "m": (1e3, "mm", "lengths"),
    "rad": (Unit.DEGREE.factor, "deg", "angles"),
    "1": (1.0, "1", "gains"),
    "rad/N m": (1e6, "µrad/(N m)", "compliance"),
    "m/N m": (1e6, "µm/(N m)", "compliance of lengths"),
}
"""Factors and symbols of the units in which parameters are drawn, and their kinds."""

_NEAR = 0.3  # m: extent from which on axes in space are in metres
_LONGEST = 0.16  # longest arrow beside the longest edge of the box
_FAR, _SPOT = 0.2, 0.03  # distances that separate places, and spots where arrows start
_MOST_PLACES, _FEWEST = 12, 4  # places one below the other, points in each


def as_result(result: Any) -> CalibrationResult:
    """The result, checked."""
    return style.as_instance(result, CalibrationResult, "result", "calibration.fit")


@style.plot
def plot_calibration_residuals(
    result: CalibrationResult, *, title: str | None = None, size: ArrayLike | None = None
) -> Figure:
    """Residuals before (left) and after (right), a panel for each row of a measurement.

    Predicted minus measured over the number of the configuration. "Before" is the nominal robot
    with base and tool fitted. The scales of the two sides differ; the root mean square, outliers
    included, stands over each panel. Rings are outliers, which do not set the scales. Rows of
    different kinds of measurement that have the same name share a panel.
    """
    parts = [part for part in measured_residuals(as_result(result)) if part.measurement.views]
    rows = list(
        dict.fromkeys(
            row
            for part in parts
            for row in zip(part.measurement.axes, part.measurement.units, strict=True)
        )
    )
    figure, grid = style.panels(PAGE, 0.75 + 1.0 * len(rows), size, len(rows), 2, sharex=True)
    count = max(int(part.blocks[-1]) + 1 for part in parts)
    dot = 3.2 if count <= _FEW else 3.2 * np.sqrt(_FEW / count) + 0.4
    for places, (axis, unit) in zip(grid, rows, strict=True):
        factor, symbol, _ = _UNITS[unit]
        columns = [
            (part, list(zip(m.axes, m.units, strict=True)).index((axis, unit)))
            for part in parts
            if (axis, unit) in zip((m := part.measurement).axes, m.units, strict=True)
        ]
        x = np.concatenate([part.blocks for part, _ in columns]) + 1
        outlier = np.concatenate([part.outlier for part, _ in columns])
        usual = ~outlier if not outlier.all() else outlier
        for axes, side, color, marker, label in (
            (places[0], "before", _BEFORE, "D", "before: base and tool fitted"),
            (places[1], "after", _AFTER, "o", "after the calibration"),
        ):
            y = factor * np.concatenate([getattr(part, side)[:, k] for part, k in columns])
            most = 1.12 * float(np.abs(y[usual]).max(initial=0.0))
            most = most if most > 1e-9 else 1.0  # rounding errors do not fill a scale
            axes.axhline(0.0, **ZERO)
            if len(x) <= _FEW:
                axes.vlines(x, 0.0, y, color=color, linewidth=0.8, alpha=0.6)
            axes.plot(x, y, marker, color=color, markersize=dot, markeredgewidth=0.0, label=label)
            if outlier.any():
                far = np.clip(y[outlier], -most, most)
                axes.plot(x[outlier], far, label="outlier (at the edge: beyond it)", **_RING)
            axes.set_ylim(-most, most)
            axes.locator_params(axis="y", nbins=5)
            rms = float(np.sqrt(np.mean(y**2)))
            axes.set_title(f"rms {rms:.3g} {symbol}", loc="right", pad=5.0 if outlier.any() else 2)
        places[0].set_ylabel(f"{axis} ({symbol})")
    for axes in grid[-1]:
        axes.set_xlabel("configuration")
        axes.set_xlim(0.0, count + 1.0)
    _separate(grid, parts)
    order = ("before: base and tool fitted", "after the calibration")
    return style.finished(figure, title, order)


def _separate(grid: Any, parts: list[MeasuredResiduals]) -> None:
    """Lines between measurements, and their names over the first row where there is room."""
    total = int(parts[-1].blocks[-1]) + 1
    for k, part in enumerate(parts if len(parts) > 1 else ()):
        for axes in grid.flat if k else ():
            axes.axvline(part.blocks[0] + 0.5, color=PALE, linewidth=0.8)
        name = part.measurement.name
        if 0.065 * len(name) < 3.0 * len(part.blocks) / total:  # inches
            place = grid[0, 0].get_xaxis_transform()
            grid[0, 0].text(part.blocks[0] + 0.7, 0.98, name, transform=place, va="top")


@style.plot
def plot_calibration_normality(
    result: CalibrationResult, *, title: str | None = None, size: ArrayLike | None = None
) -> Figure:
    """Residuals in standard deviations: histogram, and their quantiles against the normal ones.

    Left the histogram of the rows with the normal density, right the quantiles of lengths and
    angles; Gaussian residuals lie on the line. Rows of outliers are left out.
    """
    from scipy.special import ndtri

    parts = [part for part in measured_residuals(as_result(result)) if part.measurement.views]
    units = [part.measurement.units for part in parts]
    values = np.concatenate([part.whitened.ravel() for part in parts])
    pairs = list(zip(parts, units, strict=True))
    is_length = np.concatenate([np.tile(np.array(u) == "m", len(p.blocks)) for p, u in pairs])
    outlier = np.concatenate([np.repeat(p.outlier, len(u)) for p, u in pairs])
    figure, grid = style.panels(PAGE, 3.0, size, 1, 2)
    left, right = grid[0]
    usual = values[~outlier]
    reach = 1.05 * max(3.5, float(np.abs(usual).max(initial=0.0)))
    bins = int(np.clip(np.sqrt(len(values)) * 1.5, 8, 50))
    ends = (-reach, reach)
    left.hist(usual, bins, range=ends, color=_AFTER, alpha=0.55, rwidth=0.94, label="rows")
    x = np.linspace(-reach, reach, 301)
    spread = float(usual.std()) or 1.0
    density = np.exp(-0.5 * (x / spread) ** 2) / (spread * np.sqrt(2.0 * np.pi))
    y = len(usual) * (2.0 * reach / bins) * density
    left.plot(x, y, color=INK, label="normal, same size")
    left.set(xlabel="residual / standard deviation", ylabel="rows")
    reach = 0.0
    for k, (name, own) in enumerate((("lengths", is_length), ("angles", ~is_length))):
        y = np.sort(values[own & ~outlier])
        if len(y):
            x = ndtri((np.arange(len(y)) + 0.5) / len(y))
            right.plot(
                x, y, "os"[k], color=PALETTE[k], markersize=2.6, markeredgewidth=0.0, label=name
            )
            reach = max(reach, 1.05 * float(x[-1]))
    right.plot((-reach, reach), (-reach, reach), color=PALE, label="as stated", **DASHED)
    right.set(xlabel="normal quantile", ylabel="residual / standard deviation")
    if outlier.any() and title is None:
        title = f"{int(outlier.sum())} rows of outliers are left out"
    return style.finished(figure, title)


@style.plot
def plot_calibration_parameters(
    result: CalibrationResult,
    level: float = 0.95,
    *,
    truth: ArrayLike | Mapping[str, float] | None = None,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Corrections with their intervals; lengths, angles and other units in panels of their own.

    Corrections of base and ends count from where the fit placed them.

    Parameters
    ----------
    level : float
        Probability of the intervals.
    truth : array_like, shape (P,), or mapping of str to float, optional
        Known corrections, such as those of a simulation: drawn as crosses. Of the P parameters of
        the result in their order, NaN where unknown; or by names of candidates (m, rad, ...). Of
        these the regrouped ones are added to the parameters that stand for them, to first order,
        and those that are not named count as zero. They count from the robot as it was given.
    """
    found = as_result(result)
    known = None if truth is None else _known(truth, found)
    interval = confidence_intervals(found.solution.fit, level)[: len(found.names)]
    entries, f = found.parameters.entries, found.nominal.f
    order = sorted(range(len(entries)), key=lambda k: (entries[k].row, entries[k].element))
    first = ("m", "rad", "1")
    units = sorted(dict.fromkeys(found.units), key=lambda u: (*first, u).index(u))
    of_unit = {unit: [k for k in order if found.units[k] == unit] for unit in units}
    most = max(len(some) for some in of_unit.values())
    figure, grid = style.panels(PAGE, 0.85 + 0.155 * max(most, 8), size, 1, len(units))
    for axes, (unit, some) in zip(grid[0], of_unit.items(), strict=True):
        factor, symbol, kind = _UNITS.get(unit, (1.0, unit, unit))
        at_table = np.array([0 < entries[k].row <= f for k in some])
        style.interval_panel(
            axes,
            [found.names[k] for k in some],
            factor * found.corrections[some],
            factor * (interval[some, 1] - found.corrections[some]),
            {"table": at_table, "base and ends": ~at_table},
            len(units) > 2,
            None if known is None else factor * known[some],
        )
        axes.set_xlabel(f"correction ({symbol})")
        axes.set_title(kind)
    title = title or f"corrections and {100.0 * level:g} % intervals"
    return style.finished(figure, title, ("table", "base and ends"))


def _known(truth: ArrayLike | Mapping[str, float], found: CalibrationResult) -> Array:
    """True corrections from where the fit started, as the result's; NaN where they are unknown."""
    table = extend_table(found.nominal, found.parameters.table.frames)
    given = GeometricParameters(table, found.parameters.entries)
    moved = found.parameters.nominal - given.nominal
    if not isinstance(truth, Mapping):
        values = as_reals(truth, "truth")
        if values.shape != (len(found.names),):
            raise ShapeError(
                f"truth: expected one correction for each of the {len(found.names)} parameters of "
                f"the result, got shape {values.shape}; or a mapping of names of candidates."
            )
        return values - moved
    candidates = found.identifiable.candidates.names
    known = {str(name): float(as_exact(x, (), f"truth {name}")) for name, x in truth.items()}
    unknown = [name for name in known if name not in candidates]
    if unknown:
        raise InvalidValueError(
            f"truth: expected names of candidates of the result, got {', '.join(unknown[:5])}; "
            f"candidates are {', '.join(candidates)}."
        )
    values = np.full(len(found.names), np.nan)
    for k, name in enumerate(found.names):
        terms = found.identifiable.regrouping.get(name, {}) | {name: 1.0}
        named = [c * known[other] for other, c in terms.items() if other in known]
        if named:
            values[k] = sum(named)
    return values - moved


@style.plot
def plot_calibration_correlations(
    result: CalibrationResult, *, title: str | None = None, size: ArrayLike | None = None
) -> Figure:
    """Correlations of the estimates: pairs that the measurements hardly separate are dark."""
    found = as_result(result)
    if not found.names:
        raise InvalidValueError("result: no parameters were estimated.")
    entries = found.parameters.entries
    order = sorted(range(len(entries)), key=lambda k: (entries[k].row, entries[k].element))
    C = found.correlation[np.ix_(order, order)]
    return style.correlation_figure(C, [found.names[k] for k in order], title, size)


@style.plot
def plot_calibration_in_space(
    result: CalibrationResult,
    *,
    magnification: float | None = None,
    view: ArrayLike | None = None,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Errors of position as arrows where the end was, before (left) and after (right).

    Arrows go from the predicted towards the measured or touched position; they are magnified as it
    stands over each panel. Crosses are outliers, without arrows. Places that are small and far
    from each other, such as sockets around the robot, have a row of panels each, with limits and a
    magnification of their own. Measurements without three coordinates of a position are left out.

    Parameters
    ----------
    magnification : float, optional
        Of the arrows in all panels; default for each panel so that they can be seen.
    view : array_like, shape (2,), optional
        Azimuth and elevation of the eye, rad; default for each place across its longest
        horizontal direction.
    """
    parts = [
        part
        for part in measured_residuals(as_result(result))
        if len(part.measurement.views) == 1 and set("xyz") <= set(part.measurement.axes)
    ]
    if not parts:
        raise InvalidValueError(
            "result: none of its measurements has the three coordinates of a position; see "
            "plot_calibration_residuals."
        )
    if magnification is not None and float(as_exact(magnification, (), "magnification")) <= 0.0:
        raise InvalidValueError(f"magnification: expected a positive number, got {magnification}.")
    p = np.concatenate([part.p for part in parts])
    outlier = np.concatenate([part.outlier for part in parts])
    usual = ~outlier if not outlier.all() else outlier
    columns = [[part.measurement.axes.index(axis) for axis in "xyz"] for part in parts]
    errors = [
        np.concatenate([-getattr(q, side)[:, k] for q, k in zip(parts, columns, strict=True)])
        for side in ("before", "after")
    ]
    names = np.repeat([part.measurement.name for part in parts], [len(part.p) for part in parts])
    place = _places(p, usual)
    headings = _headings(names, place)
    rows = len(headings)
    if title is None and rows > 1:
        title = "before: base and tool fitted"
    above = 0.3 if title is not None else 0.02
    height = above + (0.5 * PAGE if rows == 1 else 2.3 * rows)
    figure, _ = style.panels(PAGE, height, size, rows=0)
    each = (1.0 - above / figure.get_figheight()) / rows
    cells = []
    for row, heading in enumerate(headings):
        here = usual & (place == row)
        angles = across(p[here]) if view is None else as_exact(view, (2,), "view")
        before = "before" if heading else "before (base and tool fitted)"
        for column, (side, color) in enumerate(((before, _BEFORE), ("after", _AFTER))):
            error = errors[column]
            at = (rows, 2, 2 * row + column + 1)
            gone = p[~usual & (place == row)]
            axes, scale = _draw_arrows(
                figure, at, p[here], error[here], gone, magnification, color, angles
            )
            every = error[place == row]  # outliers count, as in the report
            rms = 1e3 * float(np.sqrt(np.mean(np.sum(every**2, axis=1))))
            text = f"{heading}{side}: rms {rms:.3g} mm, arrows x {scale:g}"
            cells.append((axes, (0.5 * column, (rows - 1 - row) * each, 0.5, each), text))
    fill_cells(figure, cells)
    if title is not None:
        figure.suptitle(title, y=1.0 - 0.06 / figure.get_figheight(), va="top")
    return figure


def _draw_arrows(
    figure: Figure,
    place: tuple[int, int, int],
    p: Array,
    error: Array,
    outside: Array,
    magnification: float | None,
    color: Any,
    view: Array,
) -> tuple[Any, float]:
    """Axes with the errors of one place, and their magnification."""
    extent = float(np.ptp(p, axis=0).max()) or float(np.abs(p).max()) or 1.0
    unit = Unit.METRE if extent > _NEAR else Unit.MILLIMETRE
    k = unit.factor
    most = float(np.linalg.norm(error, axis=1).max())
    scale = magnification or (_round(_longest(p, extent) / most) if most > 1e-12 else 1.0)
    box = k * np.concatenate([p, p + scale * error, outside])
    axes = space(figure, place, box, unit, view)
    ends = (*(k * p).T, *(k * scale * error).T)
    axes.quiver(*ends, color=color, linewidth=1.0, arrow_length_ratio=0.3)
    dot = {"s": 5.0 if len(p) <= 100 else 2.0, "color": INK, "alpha": 0.5, "linewidth": 0.0}
    axes.scatter(*(k * p).T, depthshade=False, **dot)
    cross = {"s": 22.0, "color": ALERT, "marker": "x", "linewidth": 1.0}
    axes.scatter(*(k * outside).T, depthshade=False, **cross)
    return axes, scale


def _groups(points: Array, distance: float) -> NDArray[np.int64]:
    """Group of each point, in the order of the points; groups are farther apart than a distance."""
    from scipy.cluster.hierarchy import fcluster, linkage

    if len(points) < 2:
        return np.zeros(len(points), dtype=np.int64)
    # one point for each small cube, so that thousands of points are no burden
    edge = 0.35 * distance
    cubes = np.floor((points - points.min(axis=0)) / max(edge, 1e-300)).astype(np.int64)
    centres, cube = np.unique(cubes, axis=0, return_inverse=True)
    if not 1 < len(centres) <= 2000:
        return np.zeros(len(points), dtype=np.int64)
    group = fcluster(linkage(edge * centres, "single"), distance, "distance")[cube]
    _, first, number = np.unique(group, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[number].astype(np.int64)


def _places(p: Array, usual: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Number of the place of each point; all the same unless places are small and far apart."""
    one = np.zeros(len(p), dtype=np.int64)
    extent = float(np.ptp(p[usual], axis=0).max())
    if extent == 0.0:
        return one
    group = _groups(p[usual], _FAR * extent)
    own = [p[usual][group == g] for g in range(int(group.max()) + 1)]
    size = max(float(np.ptp(x, axis=0).max()) for x in own)
    if not 1 < len(own) <= _MOST_PLACES or min(map(len, own)) < _FEWEST:
        return one
    if not _SPOT * extent <= size <= _FAR / 3.0 * extent:
        return one
    centres = np.array([x.mean(axis=0) for x in own])
    return np.argmin(np.linalg.norm(p[:, None] - centres, axis=2), axis=1)


def _headings(names: NDArray[np.str_], place: NDArray[np.int64]) -> list[str]:
    """Name of each place: that of the measurement which was made there alone."""
    count = int(place.max()) + 1
    own = [tuple(np.unique(names[place == row])) for row in range(count)]
    alone = all(len(some) == 1 for some in own) and len(set(own)) == count
    words = [some[0] if alone else f"place {row + 1}" for row, some in enumerate(own)]
    return [f"{word:.14}, " for word in words] if count > 1 else [""]


def _longest(p: Array, extent: float) -> float:
    """Length of the longest arrow: longer where all arrows start in a few spots."""
    spot = _groups(p, _SPOT * extent)
    count = int(spot.max()) + 1
    if not 1 < count <= _MOST_PLACES or len(p) < _FEWEST * count:
        return _LONGEST * extent
    centres = np.array([p[spot == g].mean(axis=0) for g in range(count)])
    apart = np.linalg.norm(centres[:, None] - centres, axis=2)[np.triu_indices(count, 1)]
    return max(_LONGEST * extent, 0.45 * float(apart.min()))


def _round(value: float) -> float:
    """The next smaller round number, at least 1: arrows as they are."""
    power = 10.0 ** np.floor(np.log10(value))
    round_ones = (k for k in (1.0, 1.5, 2.0, 3.0, 5.0, 7.0) if k * power <= value * 1.0001)
    return float(max(1.0, power * max(round_ones)))


@style.plot
def plot_selection(
    selected: SelectedConfigurations,
    gain: float = 0.02,
    *,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Criterion and expected standard errors over the number of configurations.

    A panel for the criterion, then one for each unit of parameters with the median of their
    expected standard errors, the largest of them, and a thin line for each one. A dashed line
    marks the number from which on further configurations bring little.

    Parameters
    ----------
    selected : SelectedConfigurations
        Of `calibration.select_configurations`.
    gain : float
        Part of the expected error below which a further configuration is not worth it, as for
        `SelectedConfigurations.enough`.

    Examples
    --------
    >>> import robotmodels as rm
    >>> import robotmodels.calibration as calibration
    >>> rng = np.random.default_rng(0)
    >>> selected = calibration.select_configurations(
    ...     rm.load("rx90"), "position", 20, drawn=60, starts=1, rng=rng
    ... )
    >>> [axes.get_ylabel() for axes in plot_selection(selected).axes]
    ['criterion O1', 'expected standard error (mm)', 'expected standard error (deg)']
    """
    style.as_instance(
        selected, SelectedConfigurations, "selected", "calibration.select_configurations"
    )
    counts = selected.counts
    if not len(counts):
        raise InvalidValueError(
            "selected: no part of it shows all parameters; choose more configurations."
        )
    enough, sentence = selected.enough(gain), selected.enough_sentence(gain)
    units = np.array(selected.parameters.units)
    kinds = [unit for unit in ("m", "rad", "rad/N m", "m/N m", "1") if unit in units]
    rows = -(-(1 + len(kinds)) // 3)
    columns = -(-(1 + len(kinds)) // rows)
    figure, grid = style.panels(PAGE, 0.5 + 2.3 * rows, size, rows, columns)
    first, *others = grid.flat[: 1 + len(kinds)]
    for axes in grid.flat[1 + len(kinds) :]:
        axes.remove()
    marker = "o" if len(counts) <= 25 else ""
    first.plot(counts, selected.values, marker=marker, color=PALETTE[0], label="_criterion")
    first.set_ylabel(f"criterion {selected.criterion.name}")
    first.set_ylim(0.0, 1.08 * float(selected.values.max()))
    first.set_title("criterion, larger is better")
    for axes, unit in zip(others, kinds, strict=True):
        factor, symbol, kind = _UNITS[unit]
        own = factor * selected.standard_errors[:, units == unit]
        axes.plot(counts, own, color=PALE, linewidth=0.8, alpha=0.8)
        axes.plot([], [], color=PALE, linewidth=0.8, label="each parameter")
        for k, values in enumerate((np.median(own, axis=1), own.max(axis=1))):
            label = ("median", "largest")[k]
            axes.plot(counts, values, marker=marker, label=label, **style.line(k))
        axes.set_yscale("log")
        style.plain_logarithmic(axes.yaxis, 8, style.subdivisions(axes.get_ylim()))
        axes.set_ylabel(f"expected standard error ({symbol})")
        axes.set_title(kind)
    for axes in (first, *others):
        axes.set_xlabel("contacts" if selected.groups.shape[1] > 1 else "configurations")
        axes.margins(x=0.03)
        axes.xaxis.get_major_locator().set_params(integer=True, nbins=6)
        if enough is not None:
            axes.axvline(enough, color=INK, zorder=1.5, label=f"enough: {enough}", **DASHED)
    order = ("each parameter", "largest", "median")
    return style.finished(figure, sentence if title is None else title, order)
