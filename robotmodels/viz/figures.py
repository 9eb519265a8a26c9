"""What the Matplotlib figures share: sizes, styles of lines, panels, legends beside the data."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact
from ..errors import InvalidValueError, MissingExtraError, ShapeError
from ..visual import Color
from .palette import GRID, INK, LINE_COLORS, PALE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMN, PAGE = 3.5, 7.1
"""Widths of one column and of two in print, inches. Texts are sized for them."""

LABEL_SIZE, SMALL_SIZE = 8.5, 8.0
"""Of the texts, points: what a printed column can be read at."""

LINE_WIDTH, LIMIT_WIDTH, THIN_WIDTH = 1.3, 0.8, 0.8
"""Of data, of limits and of all that helps to read them, points: none thinner, for print."""

LIMIT_DASHES = (0, (4.0, 2.5))

_DPI = 150  # a column is then 525 pixels wide in a notebook
_DASHES = (
    (0, ()), (0, (5.0, 1.5)), (0, (1.3, 1.1)), (0, (6.0, 1.3, 1.3, 1.3)), (0, (9.0, 2.0)),
    (0, (3.0, 1.0, 1.0, 1.0, 1.0, 1.0)), (0, (2.2, 2.2)),
)  # fmt: skip


class LineStyle(NamedTuple):
    """How one of several lines looks: told apart without colours too."""

    color: Color
    dashes: tuple[float, tuple[float, ...]]


def line_style(k: int) -> LineStyle:
    """Style of line number k."""
    return LineStyle(LINE_COLORS[k % len(LINE_COLORS)], _DASHES[k % len(_DASHES)])


def texts(values: Any, count: int, name: str, of: str) -> list[str]:
    """One text for each of several things."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise InvalidValueError(f"{name}: expected a list of texts, got {values!r:.60}.")
    words = [str(value) for value in values]
    if len(words) != count:
        raise ShapeError(f"{name}: expected one for each of the {count} {of}, got {len(words)}.")
    return words


def new_figure(width: float, height: float, size: ArrayLike | None = None) -> Figure:
    """Empty figure with a constrained layout, without pyplot and its global state."""
    given = np.array((width, height)) if size is None else as_exact(size, (2,), "size")
    if (given <= 0.0).any():
        raise InvalidValueError(f"size: expected positive inches, got {given}.")
    try:
        from .plot_figure import PlotFigure
    except ImportError as error:
        raise MissingExtraError(
            "figures need Matplotlib; run: pip install 'matplotlib>=3.10'"
        ) from error
    figure = PlotFigure(
        figsize=(float(given[0]), float(given[1])),
        dpi=_DPI,
        facecolor="white",
        layout="constrained",
    )
    engine: Any = figure.get_layout_engine()
    engine.set(w_pad=0.04, h_pad=0.03, wspace=0.02, hspace=0.02)
    return figure


def panels(figure: Figure, rows: int, columns: int = 1, **options: Any) -> Any:
    """Axes in rows and columns, in the common style. Shapes: -> (rows, columns)."""
    grid = figure.subplots(rows, columns, squeeze=False, **options)
    for axes in grid.flat:
        styled(axes)
    return grid


def styled(axes: Axes) -> Axes:
    """Fonts, colours and grid of axes, whatever style is set for Matplotlib as a whole."""
    axes.set_facecolor("white")
    for side, spine in axes.spines.items():
        spine.set(color=PALE, linewidth=THIN_WIDTH, visible=side in ("left", "bottom"))
    axes.tick_params(
        which="both", labelsize=SMALL_SIZE, labelcolor=INK, color=PALE, length=2.5, width=THIN_WIDTH
    )
    axes.grid(True, color=GRID, linewidth=THIN_WIDTH, linestyle="-")
    axes.set_axisbelow(True)
    for axis in (axes.xaxis, axes.yaxis):
        axis.label.set(size=LABEL_SIZE, color=INK)
        axis.get_offset_text().set(size=SMALL_SIZE, color=INK)
    axes.margins(x=0.01, y=0.07)
    return axes


def wrapped(text: str, width: float) -> str:
    """A text in lines that fit over or under a panel."""
    letters = max(int(0.8 * width * 72.0 / (0.55 * LABEL_SIZE)), 4)
    lines = [wrap(line, letters, break_long_words=False) or [""] for line in text.split("\n")]
    return "\n".join(part for line in lines for part in line)


def heading(axes: Axes, text: str, width: float) -> None:
    """A text over axes that does not reach the next ones."""
    axes.set_title(wrapped(text, width), size=LABEL_SIZE, color=INK)


def legend_above(figure: Figure, handles: Sequence[Any], title: str | None = None) -> None:
    """A legend over all panels, outside of them, in as many columns as fit; and a title over it."""
    text = {"size": LABEL_SIZE + 1.0, "color": INK}
    if not handles:
        if title is not None:
            figure.suptitle(str(title), **text)
        return
    # an average letter is half as wide as it is high; as much as five letters goes to the line
    letters = max(len(str(handle.get_label())) for handle in handles)
    each = (0.5 * letters + 5.2) * SMALL_SIZE / 72.0
    columns = int(np.clip(figure.get_figwidth() // each, 1, len(handles)))
    rows = -(-len(handles) // columns)
    legend = figure.legend(
        handles=handles,
        loc="outside upper center",
        ncols=-(-len(handles) // rows),
        fontsize=SMALL_SIZE,
        labelcolor=INK,
        frameon=False,
        handlelength=2.6,
        columnspacing=1.4,
        handletextpad=0.5,
        labelspacing=0.3,
        borderpad=0.1,
        title=title,  # as a title of the figure it would stand on the legend
    )
    legend.get_title().set(**text)


def limit_lines(
    axes: Axes, lower: Array, upper: Array, colors: Sequence[Color], names: Sequence[str]
) -> None:
    """Dashed lines at limits in the joints' colours; grey where all joints have the same."""
    for side, values in (("lower", lower), ("upper", upper)):
        common = bool(np.isfinite(values).all() and np.ptp(values) == 0.0)
        for j in range(1 if common else len(values)):
            if np.isfinite(values[j]):
                axes.axhline(
                    float(values[j]),
                    color=PALE if common else colors[j],
                    linewidth=LIMIT_WIDTH,
                    linestyle=LIMIT_DASHES,
                    zorder=1.5,
                    label=f"_{side} limit of {' and '.join(names) if common else names[j]}",
                )
