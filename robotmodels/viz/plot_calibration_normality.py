"""Whether the residuals of a calibration look like noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..calibration.report import measured_residuals
from ..calibration.result import CalibrationResult
from .figures import LIMIT_DASHES, PAGE, legend_above, line_style, new_figure, panels
from .palette import INK, PALE
from .plot_calibration_residuals import as_result

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_calibration_normality(
    result: CalibrationResult, *, title: str | None = None, size: ArrayLike | None = None
) -> Figure:
    """Residuals in standard deviations: histogram, and their quantiles against the normal ones.

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
        Left the histogram of the rows with the normal density, right the quantiles of lengths and
        angles apart; Gaussian residuals lie on the line. Rows of outliers are left out.

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
    >>> [axes.get_xlabel() for axes in plot_calibration_normality(result).axes]
    ['residual / standard deviation', 'normal quantile']
    """
    from scipy.special import ndtri

    parts = [part for part in measured_residuals(as_result(result)) if part.measurement.views]
    values, is_length, outlier = (
        np.concatenate(x)
        for x in zip(
            *(
                (
                    part.whitened.ravel(),
                    np.tile([u == "m" for u in part.measurement.units], len(part.blocks)),
                    np.repeat(part.outlier, len(part.measurement.units)),
                )
                for part in parts
            ),
            strict=True,
        )
    )
    figure = new_figure(PAGE, 3.0, size)
    left, right = panels(figure, 1, 2)[0]
    usual = values[~outlier]
    reach = 1.05 * max(3.5, float(np.abs(usual).max(initial=0.0)))
    bins = int(np.clip(np.sqrt(len(values)) * 1.5, 8, 50))
    edges = np.linspace(-reach, reach, bins + 1)
    count, _ = np.histogram(usual, edges)
    width = edges[1] - edges[0]
    left.bar(
        0.5 * (edges[1:] + edges[:-1]), count, width=0.94 * width, color=line_style(0).color,
        alpha=0.55, label="rows",
    )  # fmt: skip
    x = np.linspace(-reach, reach, 301)
    spread = float(usual.std()) or 1.0
    density = np.exp(-0.5 * (x / spread) ** 2) / (spread * np.sqrt(2.0 * np.pi))
    left.plot(x, len(usual) * width * density, color=INK, linewidth=1.2, label="normal, same size")
    left.set_xlabel("residual / standard deviation")
    left.set_ylabel("rows")
    left.set_ylim(bottom=0.0)
    reach = 0.0
    for k, (name, own) in enumerate((("lengths", is_length), ("angles", ~is_length))):
        if not own.any():
            continue
        y = np.sort(values[own & ~outlier])
        if not len(y):
            continue
        q = ndtri((np.arange(len(y)) + 0.5) / len(y))
        right.plot(
            q, y, linestyle="", marker="os"[k], markersize=2.6, color=line_style(k).color,
            markeredgewidth=0.0, label=name,
        )  # fmt: skip
        reach = max(reach, float(np.abs(q).max()))
    ends = np.array((-1.05 * reach, 1.05 * reach))
    right.plot(ends, ends, color=PALE, linewidth=1.0, linestyle=LIMIT_DASHES, label="as stated")
    right.set_xlabel("normal quantile")
    right.set_ylabel("residual / standard deviation")
    handles = {}
    for axes in (left, right):
        artists, labels = axes.get_legend_handles_labels()
        handles |= dict(zip(labels, artists, strict=True))
    if outlier.any() and title is None:
        title = f"{int(outlier.sum())} rows of outliers are left out"
    legend_above(figure, list(handles.values()), title)
    return figure
