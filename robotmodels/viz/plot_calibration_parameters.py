"""What a calibration found, parameter by parameter, with intervals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_reals
from ..calibration.extended_table import skeleton_of
from ..calibration.parameters import GeometricParameters
from ..calibration.result import CalibrationResult
from ..errors import InvalidValueError, ShapeError
from ..estimation import confidence_intervals
from .figures import PAGE, SMALL_SIZE, legend_above, line_style, new_figure, panels
from .palette import INK, PALE
from .plot_calibration_residuals import as_result
from .plot_correlation import correlation_figure
from .plot_units import Unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STYLES = (("table", line_style(0).color, "o"), ("base and ends", line_style(1).color, "s"))
_FAR = 20.0
SHOWN = {
    "m": (Unit.MILLIMETRE.factor, Unit.MILLIMETRE.value),
    "rad": (Unit.DEGREE.factor, Unit.DEGREE.value),
    "rad/N m": (1e6, "µrad/(N m)"),
    "m/N m": (1e6, "µm/(N m)"),
}
"""Factors and symbols of the units in which deviations are drawn; gains as they are."""
TITLES = {
    "m": "lengths", "rad": "angles", "1": "gains", "rad/N m": "compliance",
    "m/N m": "compliance of lengths",
}  # fmt: skip


def plot_calibration_parameters(
    result: CalibrationResult,
    level: float = 0.95,
    *,
    truth: ArrayLike | Mapping[str, float] | None = None,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Deviations with their intervals; lengths, angles and other units in panels of their own.

    Deviations of base and ends count from where the fit placed them.

    Parameters
    ----------
    result : CalibrationResult
        Of `calibration.fit`.
    level : float
        Probability of the intervals.
    truth : array_like, shape (P,), or mapping of str to float, optional
        Known deviations, such as those of a simulation: drawn as crosses. Of the P parameters of
        the result in their order, NaN where unknown; or by names of candidates (m, rad, ...). Of
        these the regrouped ones are added to the parameters that stand for them, to first order,
        and those that are not named count as zero. They count from the robot as it was given.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        A panel for each unit; parameters from the base to the ends, downwards.

    Raises
    ------
    InvalidValueError
        Not a result; a level that is no probability; true deviations of parameters that are no
        candidates.
    ShapeError
        Not one true deviation for each parameter.
    MissingExtraError
        Matplotlib is not installed.

    References
    ----------
    Seed book section 1.4.4.

    Examples
    --------
    >>> import robotmodels as rm
    >>> import robotmodels.calibration as calibration
    >>> arm = rm.load("rx90")
    >>> q = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 6))
    >>> result = calibration.fit(arm, calibration.Pose(q, rm.dgm(arm, q)), folds=0, held_out=0.0)
    >>> [axes.get_xlabel() for axes in plot_calibration_parameters(result).axes]
    ['deviation (mm)', 'deviation (deg)']
    """
    found = as_result(result)
    known = None if truth is None else _known(truth, found)
    interval = confidence_intervals(found.solution.fit, level)[: len(found.names)]
    entries, f = found.parameters.entries, found.nominal.f
    order = sorted(range(len(entries)), key=lambda k: (entries[k].row, entries[k].element))
    units = sorted(dict.fromkeys(found.units), key=lambda u: ("m", "rad", "1", u).index(u))
    of_unit = {unit: [k for k in order if found.units[k] == unit] for unit in units}
    most = max(len(some) for some in of_unit.values())
    figure = new_figure(PAGE, 0.85 + 0.155 * max(most, 8), size)
    grid = panels(figure, 1, len(units))
    for axes, (unit, some) in zip(grid[0], of_unit.items(), strict=True):
        factor, symbol = SHOWN.get(unit, (1.0, unit))
        axes.axvline(0.0, color=PALE, linewidth=0.9, zorder=1.2)
        y = np.arange(len(some))
        place = np.array([entries[k].row == 0 or entries[k].row > f for k in some])
        for at, (name, color, marker) in enumerate(_STYLES):
            own = place == bool(at)
            if not own.any():
                continue
            k = np.array(some)[own]
            ends = factor * np.abs(interval[k].T - found.deviation[k])
            axes.errorbar(
                factor * found.deviation[k], y[own], xerr=np.nan_to_num(ends, posinf=0.0),
                fmt=marker, color=color, markersize=3.2, elinewidth=1.1, capsize=1.8, label=name,
            )  # fmt: skip
        sizes = factor * np.abs(interval[some]).max(axis=1)
        if known is not None and not np.isnan(known[some]).all():
            axes.plot(
                factor * known[some], y, linestyle="", marker="x", markersize=4.5, color=INK,
                markeredgewidth=0.9, zorder=3.0, label="truth",
            )  # fmt: skip
            sizes = np.fmax(sizes, factor * np.abs(known[some]))
        _spread(axes, sizes[np.isfinite(sizes)], len(units))
        axes.set_yticks(y, [found.names[k] for k in some], size=SMALL_SIZE, color=INK)
        axes.set_ylim(len(some) - 0.4, -0.6)
        axes.margins(x=0.06)
        axes.grid(False, axis="y")
        axes.set_xlabel(f"deviation ({symbol})")
        axes.set_title(TITLES.get(unit, unit), size=SMALL_SIZE + 1.0, color=INK)
    handles = {}
    for axes in grid[0]:
        containers, labels = axes.get_legend_handles_labels()
        handles |= dict(zip(labels, containers, strict=True))
    if "truth" in handles:  # last
        handles["truth"] = handles.pop("truth")
    percent = f"{100.0 * level:g} %"
    legend_above(figure, list(handles.values()), title or f"deviations and {percent} intervals")
    return figure


def _known(truth: ArrayLike | Mapping[str, float], found: CalibrationResult) -> Array:
    """True deviations from where the fit started, as the result's; NaN where they are unknown."""
    P = len(found.names)
    skeleton = skeleton_of(found.nominal, found.parameters.skeleton.frames)
    given = GeometricParameters(skeleton, found.parameters.entries)
    moved = found.parameters.nominal - given.nominal
    if not isinstance(truth, Mapping):
        values = as_reals(truth, "truth")
        if values.shape != (P,):
            raise ShapeError(
                f"truth: expected one deviation for each of the {P} parameters of the result, got "
                f"shape {values.shape}; or a mapping of names of candidates."
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
    values = np.full(P, np.nan)
    for k, name in enumerate(found.names):
        terms = found.identifiable.regrouping.get(name, {}) | {name: 1.0}
        named = [c * known[other] for other, c in terms.items() if other in known]
        if named:
            values[k] = sum(named)
    return values - moved


def _spread(axes: Any, sizes: Array, panels: int) -> None:
    """A scale that is linear around zero and of powers beyond, if few are far larger than most."""
    most, usual = float(sizes.max(initial=0.0)), float(np.median(sizes)) if sizes.size else 0.0
    if not usual or most < _FAR * usual:
        axes.locator_params(axis="x", nbins=5 if panels > 2 else 7)
        return
    from matplotlib.ticker import FixedLocator, NullLocator

    first = float(np.ceil(np.log10(usual)))
    axes.set_xscale("symlog", linthresh=10.0**first, linscale=1.5)
    powers = 10.0 ** np.arange(first, np.ceil(np.log10(most)) + 1.0)
    powers = powers[:: -(-len(powers) // (2 if panels > 2 else 3))]
    axes.xaxis.set_major_locator(FixedLocator([*-powers[::-1], 0.0, *powers]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlim(-1.3 * most, 1.3 * most)


def plot_calibration_correlations(
    result: CalibrationResult, *, title: str | None = None, size: ArrayLike | None = None
) -> Figure:
    """Correlations of the estimates: pairs that the measurements hardly tell apart are dark.

    Parameters
    ----------
    result : CalibrationResult
        Of `calibration.fit`.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        A square for each pair.

    Raises
    ------
    InvalidValueError
        Not a result.
    MissingExtraError
        Matplotlib is not installed.

    References
    ----------
    Seed book section 1.4.4.

    Examples
    --------
    >>> import robotmodels as rm
    >>> import robotmodels.calibration as calibration
    >>> arm = rm.load("rx90")
    >>> q = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 6))
    >>> result = calibration.fit(arm, calibration.Pose(q, rm.dgm(arm, q)), folds=0, held_out=0.0)
    >>> plot_calibration_correlations(result).axes[1].get_ylabel()
    'correlation'
    """
    found = as_result(result)
    if not found.names:
        raise InvalidValueError("result: no parameters were estimated.")
    entries = found.parameters.entries
    order = sorted(range(len(entries)), key=lambda k: (entries[k].row, entries[k].element))
    C = found.correlation[np.ix_(order, order)]
    names = [found.names[k] for k in order]
    return correlation_figure(C, names, title, size)
