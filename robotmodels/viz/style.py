"""Style of the figures: sizes, colours, lines, panels, legends, colour maps, checked options."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import wraps
from math import ceil
from operator import index
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, ParamSpec, TypedDict, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_count, as_exact
from ..errors import InvalidValueError, MissingExtraError, ShapeError
from ..visual import Color

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
else:  # Matplotlib is imported when the first figure is drawn
    Axes = Figure = Any

COLUMN, PAGE = 3.5, 7.1
"""Widths of one column and of two in print, inches; texts of 8 to 9.5 points suit them."""

# Okabe and Ito's hues in a lightness that keeps any two of them, and each of them and ink, red and
# grey, apart for colour-blind readers as well; then the same hues dark.
_HUES = ["0552a1", "db450a", "00b854", "bd87c7", "694759", "5e9cfa", "ff7d00", "b8c747"]
PALETTE: tuple[Color, ...] = tuple(
    (s * r, s * g, s * b, 1.0)
    for s in (1.0 / 255.0, 0.45 / 255.0)
    for r, g, b in (bytes.fromhex(hue) for hue in _HUES)
)
"""Colours of lines, and of configurations drawn together (16 for those of a general arm)."""

INK, PALE, ALERT = "#1a1a1a", "#828282", "#ab2133"
"""Texts and totals; auxiliary lines; values beyond a limit, outliers."""

BAND = "#e0e0e0"
SIGNED_MAP, POSITIVE_MAP = "PuOr", "viridis"

DASHED = {"linewidth": 0.8, "linestyle": (0, (4.0, 2.5))}
"""Limits and bounds."""

LIMIT, BEYOND = "limit", "beyond the limit"
ZERO: dict[str, Any] = {"color": PALE, "linewidth": 0.8, "zorder": 1.2, "label": "_zero"}

_DASHES = ("", "5 1.5", "1.3 1.1", "6 1.3 1.3 1.3", "9 2", "3 1 1 1 1 1", "2.2 2.2")
_STYLE = Path(__file__).with_name("figures.mplstyle")

P = ParamSpec("P")
R = TypeVar("R")


class Look(TypedDict, total=False):
    """Options of every figure: a text over it; its width and height in inches, shape (2,)."""

    title: str | None
    size: ArrayLike | None


def plot(function: Callable[P, R]) -> Callable[P, R]:
    """Decorator of functions that draw: in the common style, whatever style is set outside."""

    @wraps(function)
    def styled(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            import matplotlib.style
        except ImportError as error:
            raise MissingExtraError(
                "figures need Matplotlib; run: pip install 'matplotlib>=3.10'"
            ) from error
        with matplotlib.style.context(_STYLE, after_reset=True):
            return function(*args, **kwargs)

    return styled


def panels(
    width: float, height: float, look: Look, rows: int = 1, columns: int = 1, **options: Any
) -> tuple[Figure, Any]:
    """Figure in inches, without pyplot and its global state, and its axes (rows, columns)."""
    from .plot_figure import PlotFigure

    if unknown := sorted(set(look) - {"title", "size"}):
        raise TypeError(f"unexpected arguments: {', '.join(unknown)}.")
    size = look.get("size")
    given = np.array((width, height)) if size is None else as_exact(size, (2,), "size")
    if (given <= 0.0).any():
        raise InvalidValueError(f"size: expected positive inches, got {given}.")
    figure = PlotFigure(figsize=(float(given[0]), float(given[1])))
    return figure, figure.subplots(rows, columns, squeeze=False, **options) if rows else None


def panel_list(count: int, columns: int, height: float, look: Look) -> tuple[Figure, list[Any]]:
    """Figure with panels over a common time axis, one below the other in each column."""
    rows = -(-count // columns)
    width = COLUMN if columns == 1 else PAGE
    figure, grid = panels(width, 0.75 + height * rows, look, rows, columns, sharex=True)
    order = list(grid.T.flat)
    for axes in order[count:]:
        axes.set_visible(False)
    for c in range(columns):
        lowest = order[min(rows * (c + 1), count) - 1]
        lowest.set_xlabel("time (s)")
        lowest.tick_params(labelbottom=True)
    return figure, order[:count]


def finished(figure: Figure, look: Look, names: Sequence[str] = ()) -> Figure:
    """Figure with its legend above, in the order of the names; labels of limits come last."""
    entries: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, text in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(str(text), handle)
    rank = {name: k for k, name in enumerate(names)} | {LIMIT: 1000, BEYOND: 1001}
    texts = sorted(entries, key=lambda text: rank.get(text, len(names)))
    figure.align_ylabels([axes for axes in figure.axes if axes.name != "3d"])
    title = look.get("title")
    title = None if title is None else wrapped(str(title), 1.2 * figure.get_figwidth())
    if texts:
        # a letter is about half as wide as it is high; a line takes as much as five letters
        width = (0.5 * max(map(len, texts)) + 5.2) * 8.0 / 72.0
        rows = ceil(len(texts) / int(np.clip(figure.get_figwidth() // width, 1, len(texts))))
        place = {"loc": "outside upper center", "ncols": ceil(len(texts) / rows), "title": title}
        figure.legend([entries[text] for text in texts], texts, **place)
    elif title is not None:
        figure.suptitle(title)
    return figure


def line(k: int) -> dict[str, Any]:
    """Colour and dashes of line number k: told apart without colours too."""
    dashes = tuple(map(float, _DASHES[k % len(_DASHES)].split()))
    return {"color": PALETTE[k % len(PALETTE)], "linestyle": (0, dashes)}


def wrapped(text: str, width: float) -> str:
    """Text in lines of similar lengths that fit into a width in inches."""
    most = max(int(0.8 * width * 72.0 / (0.55 * 8.5)), 4)
    parts = [(part, ceil(len(part) / most)) for part in text.split("\n")]
    return "\n".join(
        fill(part, min(most, len(part) // count + 8), break_long_words=False) if count else part
        for part, count in parts
    )


def note(axes: Axes, text: str) -> None:
    """Text in the middle of a panel."""
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85}
    place: dict[str, Any] = {"transform": axes.transAxes, "ha": "center", "va": "center"}
    axes.text(0.5, 0.5, text, bbox=box, zorder=5, **place)


def plain_logarithmic(axis: Any, most: int = 6) -> None:
    """Logarithmic axis with few plain numbers such as 0.01; more a power where there are few."""
    from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

    low, high = axis.get_view_interval()
    subs = (1.0, 2.0, 5.0) if high < 60.0 * low else (1.0, 3.0) if high < 600.0 * low else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs, numticks=most))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))


def powers_around_zero(axes: Axes, axis: str, least: float, count: int) -> None:
    """Scale that is linear below ``least``, with about so many powers of ten on either side."""
    from matplotlib.ticker import NullLocator

    getattr(axes, f"set_{axis}scale")("symlog", linthresh=least)
    scale = getattr(axes, f"{axis}axis")
    scale.get_major_locator().set_params(numticks=2 * count + 1)
    scale.set_minor_locator(NullLocator())


def color_map(
    figure: Figure, axes: Axes, x: Array, y: Array, values: Array, signed: bool, label: str
) -> float:
    """Values over two variables with a colour bar; the largest magnitude. Shapes: values (x, y)."""
    z = np.ma.masked_invalid(values.T)
    low, high = (float(z.min()), float(z.max())) if z.count() else (0.0, 0.0)
    most = max(abs(low), abs(high))
    if signed:
        low, high = -(most or 1.0), most or 1.0
    elif high - low <= 1e-9 * most:
        low, high = low - 0.5 * (most or 1.0), high + 0.5 * (most or 1.0)
    kind: dict[str, Any] = {"cmap": SIGNED_MAP if signed else POSITIVE_MAP, "shading": "nearest"}
    image = axes.pcolormesh(x, y, z, vmin=low, vmax=high, rasterized=True, **kind)
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    axes.grid(False)
    bar: Any = figure.colorbar(image, ax=axes, pad=0.03, aspect=25)
    bar.outline.set_edgecolor(PALE)
    bar.set_label(label)
    return most


def joint_axes(axes: Axes, names: Sequence[str], units: Sequence[Any]) -> None:
    """Two joints on the axes of a map, with their units."""
    from matplotlib.ticker import MaxNLocator

    for axis, name, unit in zip((axes.xaxis, axes.yaxis), names, units, strict=True):
        axis.set_label_text(f"{name} ({unit.value})")
        degrees = [1.0, 1.5, 3.0, 4.5, 6.0, 9.0, 10.0] if unit.value == "deg" else None
        axis.set_major_locator(MaxNLocator(5, steps=degrees))


def correlation_figure(C: Array, names: Sequence[str], look: Look) -> Figure:
    """Matrix of correlations of estimates. Shapes: C (k, k)."""
    side = float(np.clip(1.3 + 0.155 * len(names), 3.5, PAGE))
    figure, grid = panels(side + 0.6, side, look)
    k = np.arange(len(names))
    axes = grid[0, 0]
    picture = axes.pcolormesh(k, k, C, cmap=SIGNED_MAP, vmin=-1.0, vmax=1.0, rasterized=True)
    shown = k[:: max(1, ceil(len(names) * 0.128 / (side - 1.1)))]
    axes.set_xticks(shown, [names[i] for i in shown], rotation=90)
    axes.set_yticks(shown, [names[i] for i in shown])
    axes.invert_yaxis()
    axes.grid(False)
    figure.colorbar(picture, ax=axes, fraction=0.045, pad=0.02, label="correlation")
    return finished(figure, look)


def interval_panel(
    axes: Axes,
    names: Sequence[str],
    values: Array,
    half: Array,
    groups: Mapping[str, Any],
    truth: Array | None = None,
) -> None:
    """Estimates with intervals, downwards; a scale of powers if few are far larger than most.

    Shapes: values, half widths, truth (k,), groups {label: mask (k,)}.
    """
    axes.axvline(0.0, **ZERO)
    y, half = np.arange(len(names)), np.nan_to_num(half, posinf=0.0)
    for k, (label, mask) in enumerate(groups.items()):
        if mask.any():
            look: dict[str, Any] = {"fmt": "os"[k % 2], "color": PALETTE[k], "label": label}
            look |= {"markersize": 3.2, "elinewidth": 1.1, "capsize": 1.8}
            axes.errorbar(values[mask], y[mask], xerr=half[mask], **look)
    ends = np.abs(values) + half
    if truth is not None and not np.isnan(truth).all():
        axes.plot(truth, y, "x", color=INK, markersize=4.5, zorder=3.0, label="truth")
        ends = np.fmax(ends, np.abs(truth))
    most, usual = float(ends.max(initial=0.0)), float(np.median(ends)) if ends.size else 0.0
    axes.margins(x=0.06)
    if usual and most > 25.0 * usual:
        powers_around_zero(axes, "x", 10.0 ** np.floor(np.log10(usual)), 2)
        axes.set_xlim(-1.4 * most, 1.4 * most)
    else:
        axes.locator_params(axis="x", nbins=5)
    axes.set_yticks(y, list(names))
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.grid(False, axis="y")


# ---------------------------------------------------------------- checked options


def as_texts(values: Any, count: int, name: str, of: str) -> list[str]:
    """One text for each of several things."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise InvalidValueError(f"{name}: expected a list of texts, got {values!r:.60}.")
    words = [str(value) for value in values]
    if len(words) != count:
        raise ShapeError(f"{name}: expected one for each of the {count} {of}, got {len(words)}.")
    return words


def as_named(given: Any, names: Any, name: str, of: str) -> dict[str, Any]:
    """Things by their names, from a mapping, or from a list and names for it."""
    if isinstance(given, Mapping):
        if names is not None:
            raise InvalidValueError(f"names: a mapping of {of}s has its own names.")
        named = {str(key): value for key, value in given.items()}
    elif isinstance(given, Sequence) and not isinstance(given, str):
        default = [f"{of} {k + 1}" for k in range(len(given))]
        words = default if names is None else as_texts(names, len(given), "names", f"{of}s")
        if len(set(words)) < len(words):
            raise InvalidValueError(f"names: expected a different one for each {of}, got {words}.")
        named = dict(zip(words, given, strict=True))
    else:
        raise InvalidValueError(
            f"{name}: expected {of}s by their names, or a list of them, got {type(given).__name__}."
        )
    if not named:
        raise InvalidValueError(f"{name}: expected at least one {of}, got none.")
    return named


def as_columns(columns: Any, count: int, default: int) -> int:
    """Number of panels in a row."""
    return min(count, default if columns is None else as_count(columns, "columns", 1))


def as_choice(values: Any, count: int, name: str, what: str) -> list[int]:
    """Some of the numbers below ``count``, each once, at least one."""
    try:
        chosen = [index(value) for value in values]
    except TypeError:
        chosen = []
    if not chosen or len(set(chosen)) < len(chosen) or not 0 <= min(chosen) <= max(chosen) < count:
        raise InvalidValueError(
            f"{name}: expected {what} from 0 to {count - 1}, each once, got {values!r:.60}."
        )
    return chosen
