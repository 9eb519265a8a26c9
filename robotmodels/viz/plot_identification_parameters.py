"""Identified parameters: effects on the torques, standard errors, correlations."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..identification.result import IdentificationResult
from ..identification.weak_parameters import WEAK
from .figures import (
    LIMIT_DASHES,
    LIMIT_WIDTH,
    PAGE,
    SMALL_SIZE,
    legend_above,
    line_style,
    new_figure,
    panels,
)
from .palette import INK, PALE
from .plot_correlation import correlation_figure
from .plot_decades import plain_decades
from .plot_identification_torques import as_identification

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BODY_KINDS = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
_SEEN, _UNSEEN = line_style(0).color, line_style(1).color
_NORMAL = 1.959964
_IN_A_ROW = 48
_SPAN = 30.0
"""Ratio of the largest to the median effect above which the scale is not linear."""


def plot_identification_parameters(
    result: IdentificationResult, *, title: str | None = None, size: ArrayLike | None = None
) -> Figure:
    """Parameters with their 95 % intervals, as contributions to the torques.

    Values of different units compare by their effect: the root mean square torque of the parameter
    alone on the log, relative to the measured torques, with its sign. An interval that contains
    zero: the parameter is not significant.

    Parameters
    ----------
    result : IdentificationResult
        Result of `identification.fit`.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        A panel for the bodies and one for the drives.

    Raises
    ------
    InvalidValueError
        Not a result.
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
    >>> [axes.get_title() for axes in plot_identification_parameters(result).axes]
    ['bodies', 'drives and friction']
    """
    identification = as_identification(result)
    effect = effects(identification)
    value, wide = effect * identification.values, _NORMAL * effect * identification.standard_errors
    unseen = identification.relative_errors > WEAK
    body = np.array([name.rstrip("0123456789") in _BODY_KINDS for name in identification.names])
    groups = [
        (word, np.flatnonzero(group))
        for word, group in (("bodies", body), ("drives and friction", ~body))
        if group.any()
    ]
    most = max(len(some) for _, some in groups)
    figure = new_figure(PAGE, 1.0 + 0.155 * max(most, 8), size)
    grid = panels(figure, 1, len(groups))
    for axes, (word, some) in zip(grid[0], groups, strict=True):
        axes.axvline(0.0, color=PALE, linewidth=0.9, zorder=1.2)
        y = np.arange(len(some))
        for mask, color, marker, label in (
            (~unseen[some], _SEEN, "o", "determined"),
            (
                unseen[some],
                _UNSEEN,
                "s",
                f"standard error above {100 * WEAK:.0f} %",
            ),
        ):
            if mask.any():
                k = some[mask]
                axes.errorbar(
                    100.0 * value[k], y[mask], xerr=100.0 * wide[k], fmt=marker, color=color,
                    markersize=3.2, elinewidth=1.1, capsize=1.8, label=label,
                )  # fmt: skip
        _scale(axes, 100.0 * (np.abs(value[some]) + wide[some]), len(groups))
        axes.set_yticks(y, [identification.names[k] for k in some], size=SMALL_SIZE, color=INK)
        axes.set_ylim(len(some) - 0.4, -0.6)
        axes.grid(False, axis="y")
        axes.set_xlabel("effect on the torques (%)")
        axes.set_title(word, size=SMALL_SIZE + 1.0, color=INK)
    handles: dict[str, Any] = {}
    for axes in grid[0]:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handle.set_label(label)
            handles.setdefault(label, handle)
    legend_above(figure, list(handles.values()), title)
    return figure


def effects(result: IdentificationResult) -> Array:
    """Root mean square of each column, relative to the measured side."""
    sigma = result.estimate.sigma
    top = float(sigma.max(initial=0.0))
    weights = 1.0 / np.maximum(sigma, 1e-9 * top) if top > 0.0 else np.ones(len(sigma))
    columns, whole = np.zeros(len(result.names)), 0.0
    for R, w in zip(result.factors.factors, weights, strict=True):
        columns += w * w * (R[:, :-1] ** 2).sum(axis=0)
        whole += w * w * float((R[:, -1] ** 2).sum())
    return np.sqrt(columns / whole) if whole > 0.0 else np.zeros(len(columns))


def _scale(axes: Any, sizes: Array, count: int) -> None:
    """Linear scale, or symmetric logarithmic scale where few effects are much larger."""
    most, usual = float(sizes.max(initial=0.0)), float(np.median(sizes)) if sizes.size else 0.0
    if not usual or most < _SPAN * usual:
        axes.margins(x=0.06)
        axes.locator_params(axis="x", nbins=6)
        return
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    first = float(np.floor(np.log10(usual)))
    axes.set_xscale("symlog", linthresh=10.0**first, linscale=1.0)
    powers = 10.0 ** np.arange(first, np.ceil(np.log10(most)) + 1.0)
    powers = powers[:: -(-len(powers) // (3 if count > 1 else 5))]
    axes.xaxis.set_major_locator(FixedLocator([*-powers[::-1], 0.0, *powers]))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlim(-1.4 * most, 1.4 * most)


def plot_identification_standard_errors(
    result: IdentificationResult, *, title: str | None = None, size: ArrayLike | None = None
) -> Figure:
    """Relative standard errors of the parameters, the largest first.

    Parameters
    ----------
    result : IdentificationResult
        Result of `identification.fit`.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        Bars: corrected for correlated residuals; lines: for white residuals, as usually published.
        Dashed: 30 %, above which a parameter is poorly determined.

    Raises
    ------
    InvalidValueError
        Not a result.
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
    >>> plot_identification_standard_errors(result).axes[0].get_ylabel()
    'relative standard error (%)'
    """
    identification = as_identification(result)
    relative = 100.0 * identification.relative_errors
    with np.errstate(divide="ignore", invalid="ignore"):
        white = 100.0 * identification.details.iid_standard_errors / np.abs(identification.values)
    order = np.argsort(-relative, kind="stable")
    count = len(order)
    rows = max(1, -(-count // _IN_A_ROW))
    each = -(-count // rows)
    figure = new_figure(PAGE, 0.7 + 1.8 * rows, size)
    grid = panels(figure, rows, 1, sharey=True)
    finite = relative[np.isfinite(relative) & (relative > 0.0)]
    low = float(finite.min(initial=100.0 * WEAK)) / 2.0
    high = 1.3 * float(finite.max(initial=100.0 * WEAK))
    for row, axes in enumerate(grid[:, 0]):
        some = order[row * each : (row + 1) * each]
        x = np.arange(len(some))
        # a value of zero has an infinite relative standard error: full bar
        height = np.where(np.isfinite(relative[some]), relative[some], high)
        unseen = relative[some] > 100.0 * WEAK
        for mask, color, label in (
            (~unseen, _SEEN, "determined"), (unseen, _UNSEEN, "poorly determined"),
        ):  # fmt: skip
            axes.bar(x[mask], np.maximum(height[mask], low) - low, bottom=low, width=0.7,
                     color=color, label=label)  # fmt: skip
        axes.hlines(white[some], x - 0.42, x + 0.42, color=INK, linewidth=1.1,
                    label="if residuals were white")  # fmt: skip
        axes.axhline(100.0 * WEAK, color=INK, linewidth=LIMIT_WIDTH, linestyle=LIMIT_DASHES,
                     label="_limit")  # fmt: skip
        axes.set_yscale("log")
        axes.set_ylim(low, high)
        plain_decades(axes.yaxis, 6)
        axes.set_xlim(-0.8, each - 0.2)
        axes.set_xticks(
            x, [identification.names[k] for k in some], rotation=90, size=SMALL_SIZE, color=INK
        )
        axes.grid(False, axis="x")
        axes.set_ylabel("relative standard error (%)")
    handles = {}
    for axes in grid[:, 0]:
        for container in axes.containers:
            if len(container):
                container.patches[0].set_label(container.get_label())
                handles.setdefault(container.get_label(), container.patches[0])
    line = grid[0, 0].collections[0]
    legend_above(figure, [*handles.values(), line], title)
    return figure


def plot_identification_correlations(
    result: IdentificationResult, *, title: str | None = None, size: ArrayLike | None = None
) -> Figure:
    """Correlations of the estimates; strongly correlated pairs are dark.

    Parameters
    ----------
    result : IdentificationResult
        Result of `identification.fit`.
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
    Seed book section 1.6.5.

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> from robotmodels.identification import fit
    >>> result = fit(*example_log())
    >>> plot_identification_correlations(result).axes[1].get_ylabel()
    'correlation'
    """
    identification = as_identification(result)
    return correlation_figure(
        identification.estimate.correlation, identification.names, title, size
    )
