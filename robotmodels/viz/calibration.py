"""Figures of calibrations: residuals, parameters, errors in space, selected configurations.

Parameters
----------
result, selected : CalibrationResult and SelectedConfigurations
    Of `calibration.fit` and `calibration.select_configurations`.
level : float
    Probability of the intervals.
truth : array_like, shape (P,), or mapping of str to float, optional
    Known corrections, drawn as crosses: of the P parameters of the result, NaN where unknown; or
    by names of candidates (m, rad, ...), of which the regrouped ones are added to the parameters
    that stand for them, to first order. They count from the robot as it was given.
magnification : float, optional
    Of the arrows in all panels; default for each panel so that they can be seen.
gain : float
    Part of the expected error below which a further configuration is not worth it.

Returns
-------
matplotlib.figure.Figure

References
----------
Book sections 1.4.4 and 1.4.5.

Examples
--------
>>> import robotmodels as rm
>>> import robotmodels.calibration as calibration
>>> arm, rng = rm.load("rx90"), np.random.default_rng(0)
>>> q = rng.uniform(-1.5, 1.5, (40, 6))
>>> result = calibration.fit(arm, calibration.Pose(q, rm.dgm(arm, q)), folds=0, held_out=0.0)
>>> [axes.get_xlabel() for axes in plot_calibration_parameters(result).axes]
['correction (mm)', 'correction (deg)']
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_number, as_reals
from .._choices import as_instance
from ..calibration.extended_table import extend_table
from ..calibration.parameters import GeometricParameters
from ..calibration.report import MeasuredResiduals, measured_residuals
from ..calibration.result import CalibrationResult
from ..calibration.selection import SelectedConfigurations
from ..errors import InvalidValueError, ShapeError
from ..estimation import confidence_intervals
from . import style
from .over_time import Unit
from .shapes import rounded_down
from .space import across, space
from .style import ALERT, DASHED, INK, PAGE, PALE, PALETTE, ZERO, Figure, Look

_SIDES = (
    ("before", PALETTE[1], "D", "before: base and tool fitted"),
    ("after", PALETTE[0], "o", "after the calibration"),
)
_RING: dict[str, Any] = {"marker": "o", "linestyle": "", "color": ALERT, "markersize": 6.0}
_RING |= {"markerfacecolor": "none", "markeredgewidth": 0.9, "clip_on": False}
_UNITS = {
    "m": (1e3, "mm", "lengths"),
    "rad": (Unit.DEGREE.factor, "deg", "angles"),
    "1": (1.0, "1", "gains"),
    "rad/N m": (1e6, "µrad/(N m)", "compliance"),
    "m/N m": (1e6, "µm/(N m)", "compliance of lengths"),
}
"""Factors and symbols of the units in which parameters are drawn, and their kinds, in order."""

_NEAR = 0.3  # m: extent from which on axes in space are in metres
_LONGEST = 0.22  # longest arrow beside the longest edge of the box


def as_result(result: Any) -> CalibrationResult:
    """The result, checked."""
    return as_instance(result, CalibrationResult, "result", " of calibration.fit")


def _parts(result: Any) -> list[MeasuredResiduals]:
    """Residuals of the measurements of a robot, not of known distances."""
    return [part for part in measured_residuals(as_result(result)) if part.measurement.views]


@style.plot
def plot_calibration_residuals(result: CalibrationResult, **look: Unpack[Look]) -> Figure:
    """Residuals before (left) and after (right), a panel for each row of a measurement.

    Predicted minus measured over the number of the configuration. "Before" is the nominal robot
    with base and tool fitted. The scales of the two sides differ; the root mean square, outliers
    included, stands over each panel. Rings are outliers, which do not set the scales. Rows of
    different kinds of measurement that have the same name share a panel.
    """
    parts = _parts(result)
    every = [list(zip(p.measurement.axes, p.measurement.units, strict=True)) for p in parts]
    rows = list(dict.fromkeys(row for own in every for row in own))
    figure, grid = style.panels(PAGE, 0.75 + len(rows), look, len(rows), 2, sharex=True)
    count = int(parts[-1].blocks[-1]) + 1
    dot = min(3.2, 3.2 * np.sqrt(60.0 / count) + 0.4)
    for places, row in zip(grid, rows, strict=True):
        columns = [(p, own.index(row)) for p, own in zip(parts, every, strict=True) if row in own]
        x = np.concatenate([part.blocks for part, _ in columns]) + 1
        outlier = np.concatenate([part.outlier for part, _ in columns])
        factor, symbol, _ = _UNITS[row[1]]
        usual = ~outlier if not outlier.all() else outlier
        for axes, (side, color, marker, label) in zip(places, _SIDES, strict=True):
            y = factor * np.concatenate([getattr(part, side)[:, k] for part, k in columns])
            most = 1.12 * float(np.abs(y[usual]).max(initial=0.0))
            most = most if most > 1e-9 else 1.0  # rounding errors do not fill a scale
            axes.axhline(0.0, **ZERO)
            axes.vlines(x, 0.0, y, color=color, linewidth=0.8, alpha=min(0.6, 36.0 / count))
            line = {"color": color, "markersize": dot, "markeredgewidth": 0.0, "label": label}
            axes.plot(x, y, marker, **line)
            if outlier.any():
                far = np.clip(y[outlier], -most, most)
                axes.plot(x[outlier], far, label="outlier (at the edge: beyond it)", **_RING)
            axes.set_ylim(-most, most)
            axes.locator_params(axis="y", nbins=5)
            axes.set_title(f"rms {np.sqrt(np.mean(y**2)):.3g} {symbol}", loc="right")
        places[0].set_ylabel(f"{row[0]} ({symbol})")
    for axes in grid[-1]:
        axes.set(xlabel="configuration", xlim=(0.0, count + 1.0))
    for k, part in enumerate(parts if len(parts) > 1 else ()):
        for axes in grid.flat if k else ():
            axes.axvline(part.blocks[0] + 0.5, color=PALE, linewidth=0.8)
        name, place = part.measurement.name, grid[0, 0].get_xaxis_transform()
        if 0.065 * len(name) < 3.0 * len(part.blocks) / count:  # inches
            grid[0, 0].text(part.blocks[0] + 0.7, 0.98, name, transform=place, va="top")
    return style.finished(figure, look, [side[-1] for side in _SIDES])


@style.plot
def plot_calibration_normality(result: CalibrationResult, **look: Unpack[Look]) -> Figure:
    """Residuals in standard deviations: histogram, and their quantiles against the normal ones.

    Left the histogram of the rows with the normal density, right the quantiles of lengths and
    angles; Gaussian residuals lie on the line. Rows of outliers are left out.
    """
    from scipy.stats import norm

    parts = _parts(result)
    values = np.concatenate([part.whitened[~part.outlier].ravel() for part in parts])
    units = np.concatenate([np.tile(p.measurement.units, (~p.outlier).sum()) for p in parts])
    figure, ((left, right),) = style.panels(PAGE, 3.0, look, 1, 2)
    reach = 1.05 * max(3.5, float(np.abs(values).max(initial=0.0)))
    bins = int(np.clip(np.sqrt(len(values)) * 1.5, 8, 50))
    bars: dict[str, Any] = {"color": PALETTE[0], "alpha": 0.55, "rwidth": 0.94, "label": "rows"}
    left.hist(values, bins, range=(-reach, reach), **bars)
    x = np.linspace(-reach, reach, 301)
    size = len(values) * 2.0 * reach / bins
    y = size * norm.pdf(x, scale=float(values.std()) or 1.0)
    left.plot(x, y, color=INK, label="normal, same size")
    left.set(xlabel="residual / standard deviation", ylabel="rows")
    reach = 0.0
    for k, (name, own) in enumerate((("lengths", units == "m"), ("angles", units != "m"))):
        y = np.sort(values[own])
        if len(y):
            x = norm.ppf((np.arange(len(y)) + 0.5) / len(y))
            dot: dict[str, Any] = {"color": PALETTE[k], "markersize": 2.6, "markeredgewidth": 0.0}
            right.plot(x, y, "os"[k], label=name, **dot)
            reach = max(reach, 1.05 * float(x[-1]))
    right.plot((-reach, reach), (-reach, reach), color=PALE, label="as stated", **DASHED)
    right.set(xlabel="normal quantile", ylabel="residual / standard deviation")
    left_out = sum(p.outlier.sum() * len(p.measurement.units) for p in parts)
    if left_out and look.get("title") is None:
        look["title"] = f"{left_out} rows of outliers are left out"
    return style.finished(figure, look)


@style.plot
def plot_calibration_parameters(
    result: CalibrationResult,
    level: float = 0.95,
    *,
    truth: ArrayLike | Mapping[str, float] | None = None,
    **look: Unpack[Look],
) -> Figure:
    """Corrections with their intervals; lengths, angles and other units in panels of their own.

    Corrections of base and ends count from where the fit placed them.
    """
    found = as_result(result)
    known = None if truth is None else _known(truth, found)
    half = confidence_intervals(found.solution.fit, level)[: len(found.names), 1]
    half = half - found.corrections
    entries, f = found.parameters.entries, found.nominal.f
    units = sorted(dict.fromkeys(found.units), key=list(_UNITS).index)
    of_unit = {unit: [k for k in _order(found) if found.units[k] == unit] for unit in units}
    most = max(len(some) for some in of_unit.values())
    figure, grid = style.panels(PAGE, 0.85 + 0.155 * max(most, 8), look, 1, len(units))
    for axes, (unit, some) in zip(grid[0], of_unit.items(), strict=True):
        factor, symbol, kind = _UNITS[unit]
        at_table = np.array([0 < entries[k].row <= f for k in some])
        style.interval_panel(
            axes,
            [found.names[k] for k in some],
            factor * found.corrections[some],
            factor * half[some],
            {"table": at_table, "base and ends": ~at_table},
            None if known is None else factor * known[some],
        )
        axes.set(xlabel=f"correction ({symbol})", title=kind)
    look["title"] = look.get("title") or f"corrections and {100.0 * level:g} % intervals"
    return style.finished(figure, look, ("table", "base and ends"))


def _order(found: CalibrationResult) -> list[int]:
    """Numbers of the parameters from the base to the end."""
    entries = found.parameters.entries
    return sorted(range(len(entries)), key=lambda k: (entries[k].row, entries[k].element))


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
def plot_calibration_correlations(result: CalibrationResult, **look: Unpack[Look]) -> Figure:
    """Correlations of the estimates: pairs that the measurements hardly separate are dark."""
    found = as_result(result)
    if not found.names:
        raise InvalidValueError("result: no parameters were estimated.")
    order = _order(found)
    C = found.correlation[np.ix_(order, order)]
    return style.correlation_figure(C, [found.names[k] for k in order], look)


@style.plot
def plot_calibration_in_space(
    result: CalibrationResult,
    *,
    magnification: float | None = None,
    view: ArrayLike | None = None,
    **look: Unpack[Look],
) -> Figure:
    """Errors of position as arrows where the end was, before (left) and after (right).

    Arrows go from the predicted towards the measured or touched position; they are magnified as it
    stands over each panel. Crosses are outliers, without arrows. Each measurement has a row of
    panels with limits and a magnification of its own; those without three coordinates of a
    position are left out. "Before" is the nominal robot with base and tool fitted.
    """
    parts = [
        part
        for part in _parts(result)
        if len(part.measurement.views) == 1 and set("xyz") <= set(part.measurement.axes)
    ]
    if not parts:
        raise InvalidValueError(
            "result: none of its measurements has the three coordinates of a position; see "
            "plot_calibration_residuals."
        )
    if magnification is not None:
        magnification = as_number(magnification, "magnification", above=0.0)
    rows = len(parts)
    figure, _ = style.panels(PAGE, 3.6 if rows == 1 else 2.4 * rows, look, rows=0)
    for row, part in enumerate(parts):
        columns = [part.measurement.axes.index(axis) for axis in "xyz"]
        outlier = part.outlier & ~part.outlier.all()
        p, gone = part.p[~outlier], part.p[outlier]
        angles = across(p) if view is None else as_exact(view, (2,), "view")
        for column, (side, color, *_) in enumerate(_SIDES):
            error = -getattr(part, side)[:, columns]
            place = (rows, 2, 2 * row + column + 1)
            drawn = (p, error[~outlier], gone, magnification, color, angles)
            axes, scale = _draw_arrows(figure, place, *drawn)
            # outliers count, as in the report
            rms = 1e3 * float(np.sqrt(np.mean(np.sum(error**2, axis=1))))
            name = f"{part.measurement.name:.14}, " if rows > 1 else ""
            axes.set_title(f"{name}{side}: rms {rms:.3g} mm, arrows x {scale:g}")
    return style.finished(figure, look)


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
    """Axes with the errors of one measurement, and their magnification."""
    extent = float(np.ptp(p, axis=0).max()) or float(np.abs(p).max()) or 1.0
    unit = Unit.METRE if extent > _NEAR else Unit.MILLIMETRE
    k = unit.factor
    most = max(float(np.linalg.norm(error, axis=1).max()), 1e-12)
    scale = magnification or max(rounded_down(_LONGEST * extent / most), 1.0)
    axes = space(figure, place, k * np.concatenate([p, p + scale * error, outside]), unit, view)
    ends = (*(k * p).T, *(k * scale * error).T)
    axes.quiver(*ends, color=color, linewidth=1.0, arrow_length_ratio=0.3)
    dot = {"s": 5.0 if len(p) <= 100 else 2.0, "color": INK, "alpha": 0.5, "linewidth": 0.0}
    axes.scatter(*(k * p).T, depthshade=False, **dot)
    cross = {"s": 22.0, "color": ALERT, "marker": "x", "linewidth": 1.0}
    axes.scatter(*(k * outside).T, depthshade=False, **cross)
    return axes, scale


@style.plot
def plot_selection(
    selected: SelectedConfigurations, gain: float = 0.02, **look: Unpack[Look]
) -> Figure:
    """Criterion and expected standard errors over the number of configurations.

    A panel for the criterion, then one for each unit of parameters with the median of their
    expected standard errors, the largest of them, and a thin line for each one. A dashed line
    marks the number from which on further configurations bring little.
    """
    as_instance(selected, SelectedConfigurations, "selected", " of select_configurations")
    counts = selected.counts
    if not len(counts):
        raise InvalidValueError(
            "selected: no part of it shows all parameters; choose more configurations."
        )
    enough, sentence = selected.enough(gain), selected.enough_sentence(gain)
    units = np.array(selected.parameters.units)
    kinds = [unit for unit in _UNITS if unit in units]
    rows = -(-(1 + len(kinds)) // 3)
    columns = -(-(1 + len(kinds)) // rows)
    figure, grid = style.panels(PAGE, 0.5 + 2.3 * rows, look, rows, columns)
    first, *others = grid.flat[: 1 + len(kinds)]
    for axes in grid.flat[1 + len(kinds) :]:
        axes.remove()
    marker = "o" if len(counts) <= 25 else ""
    first.plot(counts, selected.values, marker=marker, color=PALETTE[0], label="_criterion")
    first.set_ylabel(f"criterion {selected.criterion.name}")
    first.set(ylim=(0.0, 1.08 * float(selected.values.max())), title="criterion, larger is better")
    for axes, unit in zip(others, kinds, strict=True):
        factor, symbol, kind = _UNITS[unit]
        own = factor * selected.standard_errors[:, units == unit]
        axes.plot(counts, own, color=PALE, linewidth=0.8, alpha=0.8, label="each parameter")
        for k, (label, values) in enumerate(
            (("median", np.median(own, axis=1)), ("largest", own.max(axis=1)))
        ):
            axes.plot(counts, values, marker=marker, label=label, **style.line(k))
        axes.set_yscale("log")
        style.plain_logarithmic(axes.yaxis, 8)
        axes.set(ylabel=f"expected standard error ({symbol})", title=kind)
    for axes in (first, *others):
        axes.set_xlabel("contacts" if selected.groups.shape[1] > 1 else "configurations")
        if enough is not None:
            axes.axvline(enough, color=INK, zorder=1.5, label=f"enough: {enough}", **DASHED)
    look["title"] = look.get("title") or sentence
    return style.finished(figure, look, ("each parameter", "largest", "median"))
