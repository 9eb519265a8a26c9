"""What each further configuration of a calibration brings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..calibration.selection import SelectedConfigurations
from ..errors import InvalidValueError
from .figures import (
    LIMIT_DASHES,
    LIMIT_WIDTH,
    LINE_WIDTH,
    PAGE,
    SMALL_SIZE,
    THIN_WIDTH,
    legend_above,
    line_style,
    new_figure,
    panels,
)
from .palette import INK, PALE
from .plot_calibration_parameters import SHOWN, TITLES

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_selection(
    selected: SelectedConfigurations,
    gain: float = 0.02,
    *,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Criterion and expected standard deviations over the number of configurations.

    Where further ones bring little a dashed line stands in every panel.

    Parameters
    ----------
    selected : SelectedConfigurations
        Of `calibration.select_configurations`.
    gain : float
        Part of the expected error below which a further configuration is not worth it, as for
        `SelectedConfigurations.enough`.
    title : str, optional
        Over the figure; default says how many are enough.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        The criterion, then a panel for each unit of parameters with the median of their expected
        standard deviations, the largest of them, and a thin line for each one. Panels of
        deviations are logarithmic.

    Raises
    ------
    InvalidValueError
        Not a selection, or one that is too small for its parameters; a gain that is not between 0
        and 1.
    MissingExtraError
        Matplotlib is not installed.

    References
    ----------
    Seed book section 1.4.5.

    Examples
    --------
    >>> import robotmodels as rm
    >>> import robotmodels.calibration as calibration
    >>> rng = np.random.default_rng(0)
    >>> selected = calibration.select_configurations(
    ...     rm.load("rx90"), "position", 20, drawn=60, starts=1, rng=rng
    ... )
    >>> [axes.get_ylabel() for axes in plot_selection(selected).axes]
    ['criterion O1', 'expected deviation (mm)', 'expected deviation (deg)']
    """
    if not isinstance(selected, SelectedConfigurations):
        raise InvalidValueError(
            "selected: expected SelectedConfigurations of calibration.select_configurations, got "
            f"{type(selected).__name__}."
        )
    if not len(selected.counts):
        raise InvalidValueError(
            "selected: no part of it shows all parameters; choose more configurations."
        )
    enough, sentence = selected.enough(gain), selected.enough_sentence(gain)
    units = selected.parameters.units
    kinds = sorted(dict.fromkeys(units), key=lambda u: ([*SHOWN, "1"].index(u), u))
    rows = -(-(1 + len(kinds)) // 3)
    columns = -(-(1 + len(kinds)) // rows)
    figure = new_figure(PAGE, 0.5 + 2.3 * rows, size)
    every: list[Any] = list(panels(figure, rows, columns).flat)
    for axes in every[1 + len(kinds) :]:
        axes.remove()
    every = every[: 1 + len(kinds)]
    counts, few = selected.counts, len(selected.counts) <= 25
    style = line_style(0)
    marked: dict[str, Any] = {"marker": "o" if few else "", "markersize": 2.6}
    every[0].plot(counts, selected.values, color=style.color, linewidth=LINE_WIDTH, **marked)
    every[0].set_ylabel(f"criterion {selected.criterion.name}")
    every[0].set_ylim(0.0, 1.08 * float(selected.values.max()))
    every[0].set_title("criterion, larger is better", size=SMALL_SIZE + 1.0, color=INK)
    handles = {}
    for axes, unit in zip(every[1:], kinds, strict=True):
        factor, symbol = SHOWN.get(unit, (1.0, unit))
        own = factor * selected.deviations[:, [k for k, u in enumerate(units) if u == unit]]
        axes.plot(counts, own, color=PALE, linewidth=THIN_WIDTH, alpha=0.8)
        handles["each"] = axes.get_lines()[0]
        for k, (name, values) in enumerate(
            (("largest", own.max(axis=1)), ("median", np.median(own, axis=1)))
        ):
            color, dashes = line_style(1 - k)
            (handles[name],) = axes.plot(
                counts, values, color=color, linestyle=dashes, linewidth=LINE_WIDTH, label=name,
                **marked,
            )  # fmt: skip
        axes.set_yscale("log")
        _numbers(axes)
        axes.set_ylabel(f"expected deviation ({symbol})")
        axes.set_title(TITLES.get(unit, unit), size=SMALL_SIZE + 1.0, color=INK)
    for axes in every:
        axes.set_xlabel("contacts" if selected.groups.shape[1] > 1 else "configurations")
        axes.margins(x=0.03)
        axes.xaxis.get_major_locator().set_params(integer=True, nbins=6)
        if enough is not None:
            handles["enough"] = axes.axvline(
                enough, color=INK, linewidth=LIMIT_WIDTH, linestyle=LIMIT_DASHES, zorder=1.5
            )
    for name, line in handles.items():
        line.set_label("each parameter" if name == "each" else name)
    if "enough" in handles:
        handles["enough"].set_label(f"enough: {enough}")
    legend_above(figure, list(handles.values()), sentence if title is None else title)
    return figure


def _numbers(axes: Any) -> None:
    """Numbers such as 0.05, at 1, 2 and 5 of each power of ten where there are few powers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axes.get_ylim()
    within = (1.0, 2.0, 5.0) if high < 60.0 * low else (1.0, 3.0) if high < 600.0 * low else (1.0,)
    axes.yaxis.set_major_locator(LogLocator(subs=within))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
