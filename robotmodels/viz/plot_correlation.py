"""Correlations of estimates as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from .figures import PAGE, SMALL_SIZE, THIN_WIDTH, new_figure, panels
from .palette import INK, PALE, SIGNED_MAP

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def correlation_figure(
    correlation: Array, names: Sequence[str], title: str | None, size: ArrayLike | None
) -> Figure:
    """Figure of a correlation matrix. Shapes: correlation (k, k), size (2,)."""
    side = float(np.clip(1.3 + 0.155 * len(names), 3.5, PAGE))
    figure = new_figure(side + 0.6, side, size)
    axes = panels(figure, 1)[0, 0]
    picture = axes.imshow(
        correlation, cmap=SIGNED_MAP, vmin=-1.0, vmax=1.0, interpolation="nearest", aspect="auto"
    )
    every = max(1, int(np.ceil(len(names) * (SMALL_SIZE * 1.15 / 72.0) / (side - 1.1))))
    ticks = range(0, len(names), every)
    axes.set_xticks(ticks, [names[k] for k in ticks], rotation=90, size=SMALL_SIZE, color=INK)
    axes.set_yticks(ticks, [names[k] for k in ticks], size=SMALL_SIZE, color=INK)
    axes.grid(False)
    bar = figure.colorbar(picture, ax=axes, fraction=0.045, pad=0.02)
    bar.set_label("correlation", size=SMALL_SIZE + 1.0, color=INK)
    bar.ax.tick_params(labelsize=SMALL_SIZE, labelcolor=INK, color=PALE, length=2.5)
    bar.outline.set(edgecolor=PALE, linewidth=THIN_WIDTH)  # type: ignore[operator]
    if title is not None:
        figure.suptitle(title, size=SMALL_SIZE + 2.0, color=INK)
    return figure
