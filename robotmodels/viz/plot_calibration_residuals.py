"""Residuals of a calibration before and after, row by row and configuration by configuration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..calibration.report import MeasuredResiduals, measured_residuals
from ..calibration.result import CalibrationResult
from ..errors import InvalidValueError
from .figures import (
    LABEL_SIZE,
    PAGE,
    SMALL_SIZE,
    THIN_WIDTH,
    legend_above,
    line_style,
    new_figure,
    panels,
)
from .palette import ALERT, INK, PALE
from .plot_units import Unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BEFORE, AFTER = line_style(1), line_style(0)
"""Colours of the robot before and after its calibration."""

_FEW = 60
_RING, _OVER_RINGS = 6.0, 5.0
"""Diameter of a ring, and distance of a text from axes that keeps it off rings there, points."""


def as_result(result: Any) -> CalibrationResult:
    """Check that the argument is a calibration result."""
    if not isinstance(result, CalibrationResult):
        raise InvalidValueError(
            f"result: expected a CalibrationResult of calibration.fit, got {type(result).__name__}."
        )
    return result


def shown_unit(unit: str) -> Unit:
    """Unit in which residuals are drawn: millimetres, degrees."""
    return Unit.MILLIMETRE if unit == "m" else Unit.DEGREE


def plot_calibration_residuals(
    result: CalibrationResult, *, title: str | None = None, size: ArrayLike | None = None
) -> Figure:
    """Residuals before (left) and after (right), a panel for each row of a measurement.

    Before is the nominal robot with base and tool fitted: what its table is to blame for. The
    scales of the two sides differ; the root mean square stands over each panel. Rings are
    outliers, which neither the scales nor the root mean squares count.

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
        Predicted minus measured over the number of the configuration; rows of different kinds of
        measurement that have the same name share a panel.

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
    >>> [axes.get_ylabel() for axes in plot_calibration_residuals(result).axes][::2][2:4]
    ['z (mm)', 'rx (deg)']
    """
    parts = [part for part in measured_residuals(as_result(result)) if part.measurement.views]
    keys = list(
        dict.fromkeys(
            (axis, unit)
            for part in parts
            for axis, unit in zip(part.measurement.axes, part.measurement.units, strict=True)
        )
    )
    figure = new_figure(PAGE, 0.75 + 1.0 * len(keys), size)
    grid = panels(figure, len(keys), 2, sharex=True)
    count = max(int(part.blocks[-1]) + 1 for part in parts)
    dot = 3.2 if count <= _FEW else 3.2 * np.sqrt(_FEW / count) + 0.4
    for row, (axis, unit) in enumerate(keys):
        shown = shown_unit(unit)
        own = [(part, _column(part, axis, unit)) for part in parts]
        own = [(part, column) for part, column in own if column is not None]
        x = np.concatenate([part.blocks for part, _ in own]) + 1
        outlier = np.concatenate([part.outlier for part, _ in own])
        for side, style in ((0, BEFORE), (1, AFTER)):
            y = shown.factor * np.concatenate(
                [(part.before, part.after)[side][:, column] for part, column in own]
            )
            axes = grid[row, side]
            axes.axhline(0.0, color=PALE, linewidth=0.8, zorder=1.2)
            if len(x) <= _FEW:
                axes.vlines(x, 0.0, y, color=style.color, linewidth=THIN_WIDTH, alpha=0.6)
            axes.plot(
                x, y, linestyle="", marker="o" if side else "D", markersize=dot,
                color=style.color, markeredgewidth=0.0,
                label="after the calibration" if side else "before: base and tool fitted",
            )  # fmt: skip
            usual = y[~outlier] if not outlier.all() else y
            most = _ends(axes, usual)
            if outlier.any():
                axes.plot(
                    x[outlier], np.clip(y[outlier], -most, most), linestyle="", marker="o",
                    markersize=_RING, color=ALERT, markerfacecolor="none", markeredgecolor=ALERT,
                    markeredgewidth=0.9, clip_on=False, label="outlier (at the edge: beyond it)",
                )  # fmt: skip
            rms = float(np.sqrt(np.mean(y**2)))  # outliers count, as in the report
            axes.set_title(
                f"rms {rms:.3g} {shown.value}",
                size=SMALL_SIZE,
                color=INK,
                loc="right",
                pad=_OVER_RINGS if outlier.any() else 2.0,
            )
        grid[row, 0].set_ylabel(f"{axis} ({shown.value})")
    for axes in grid[-1]:
        axes.set_xlabel("configuration")
        axes.set_xlim(0.0, count + 1.0)
    _names(grid, parts)
    figure.align_ylabels()
    handles = {
        str(line.get_label()): line
        for axes in grid[0]
        for line in axes.get_lines()
        if not str(line.get_label()).startswith("_")
    }
    ordered = sorted(handles, key=lambda text: text.startswith("outlier"))
    legend_above(figure, [handles[text] for text in ordered], title)
    return figure


def _column(part: MeasuredResiduals, axis: str, unit: str) -> int | None:
    m = part.measurement
    found = [k for k, key in enumerate(zip(m.axes, m.units, strict=True)) if key == (axis, unit)]
    return found[0] if found else None


def _ends(axes: Any, y: Array) -> float:
    """Zero in the middle; a scale that is not rounding where everything is zero."""
    most = float(np.abs(y).max(initial=0.0))
    most = 1.12 * most if most > 1e-9 else 1.0
    axes.set_ylim(-most, most)
    axes.locator_params(axis="y", nbins=5)
    return most


def _names(grid: Any, parts: list[MeasuredResiduals]) -> None:
    """Lines between measurements, and their names over the first row where there are several."""
    if len(parts) < 2:
        return
    for part in parts[1:]:
        for axes in grid.flat:
            axes.axvline(part.blocks[0] + 0.5, color=PALE, linewidth=THIN_WIDTH)
    total = int(parts[-1].blocks[-1]) + 1
    for part in parts:
        room = (len(part.blocks) / total) * 3.0 * 72.0
        if 0.55 * LABEL_SIZE * len(part.measurement.name) < room:
            grid[0, 0].text(
                part.blocks[0] + 0.7, 0.98, part.measurement.name, size=SMALL_SIZE, color=INK,
                transform=grid[0, 0].get_xaxis_transform(), va="top",
            )  # fmt: skip
