"""Residuals of an identification: over time with their standard deviation, and autocorrelation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..identification.equations import Equations
from ..identification.report_tables import group_names, group_units
from ..identification.residuals import residual_diagnostics
from ..identification.result import IdentificationResult
from ..logs import Log
from .figures import PAGE, SMALL_SIZE, THIN_WIDTH, legend_above, line_style, new_figure, panels
from .palette import BAND, INK, PALE
from .plot_identification_torques import as_identification, check_test

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST = 4000
"""Largest number of drawn residuals; above, only the largest of each group."""


def plot_identification_residuals(
    result: IdentificationResult,
    test: Log | None = None,
    *,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Residuals of the equations with two standard deviations, and their autocorrelation.

    Parameters
    ----------
    result : IdentificationResult
        Result of `identification.fit`.
    test : Log, optional
        Held-out log, whose residuals are drawn instead; the standard deviation is that of the fit.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        A row for each kind of equations; on the right the 95 % band of white residuals.

    Raises
    ------
    InvalidValueError, ShapeError
        Not a result; not a log of its joints.
    MissingExtraError
        Matplotlib is not installed.

    References
    ----------
    Seed book section 1.6.5.

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> from robotmodels.identification import fit
    >>> result = fit(*example_log())
    >>> plot_identification_residuals(result).axes[0].get_ylabel()
    'residual (N m)'
    """
    identification = as_identification(result)
    check_test(identification, test)
    system = identification.equations if test is None else identification.equations.with_log(test)
    names, units = group_names(identification), group_units(identification)
    m = len(names)
    t, e, far = _residuals(system, identification.values, identification.estimate.sigma)
    correlation = residual_diagnostics(system, identification.values)
    lag = np.arange(1, correlation.lags + 1) / identification.equations.processing.rate
    figure = new_figure(PAGE, 0.9 + 1.1 * m, size)
    grid = panels(figure, m, 2, sharex="col", width_ratios=[2.2, 1.0])
    color = line_style(0).color
    for j in range(m):
        left, right = grid[j]
        sigma = float(identification.estimate.sigma[j])
        left.axhspan(-2.0 * sigma, 2.0 * sigma, color=BAND, linewidth=0.0, zorder=0.5,
                     label="two standard deviations; 95 % of white residuals")  # fmt: skip
        left.axhline(0.0, color=PALE, linewidth=THIN_WIDTH, zorder=1.2, label="_zero")
        left.plot(t, e[:, j], linestyle="", marker="o", markersize=1.4, color=color,
                  markeredgewidth=0.0, label="residual; its autocorrelation")  # fmt: skip
        left.set_ylabel(f"residual ({units[j]})")
        left.set_title(f"{names[j]}: {100.0 * far[j]:.2g} % outside", loc="left", size=SMALL_SIZE,
                       color=INK, pad=2.0)  # fmt: skip
        bounds, rho = correlation.bounds[j, 1:], correlation.autocorrelation[j, 1:]
        right.fill_between(lag, -bounds, bounds, color=BAND, linewidth=0.0, zorder=0.5)
        right.axhline(0.0, color=PALE, linewidth=THIN_WIDTH, zorder=1.2)
        right.vlines(lag, 0.0, rho, color=color, linewidth=1.2)
        right.set_ylim(-1.05, 1.05)
        right.set_xlim(0.0, 1.03 * float(lag[-1]))
        if j == 0:
            right.set_title("autocorrelation", loc="left", size=SMALL_SIZE, color=INK, pad=2.0)
    grid[-1, 0].set_xlabel("time (s)")
    grid[-1, 1].set_xlabel("lag (s)")
    handles = [*grid[0, 0].patches, *grid[0, 0].get_lines()]
    legend_above(figure, [h for h in handles if not str(h.get_label()).startswith("_")], title)
    return figure


def _residuals(system: Equations, values: Array, sigma: Array) -> tuple[Array, Array, Array]:
    """Times and residuals (NaN where excluded), and the share of large ones.

    If there are many, the largest of each group.
    """
    count = len(system.log) / system.processing.decimation
    step = max(1, int(np.ceil(count / _MOST)))
    far, all_of = np.zeros(system.groups), np.zeros(system.groups)
    times, rows = [], []
    for block in system.blocks():
        e = np.where(block.use, block.y - block.W @ values, np.nan)
        far += (np.abs(e) > 2.0 * sigma).sum(axis=0)
        all_of += block.use.sum(axis=0)
        for start in range(0, len(e), step):
            group = np.nan_to_num(np.abs(e[start : start + step]), nan=-1.0)
            times.append(block.t[start])
            rows.append(e[start + group.argmax(axis=0), np.arange(e.shape[1])])
    with np.errstate(invalid="ignore"):
        return np.array(times), np.array(rows).reshape(-1, system.groups), far / all_of
