"""Boxes in space side by side, each filling a cell of the figure, and places far apart told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .figures import LABEL_SIZE
from .palette import INK
from .plot_pose_path import _taken

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HEADING, _PAD = 0.27, 0.08
"""Height of a line over a cell, and the border of it, inches."""
_PASSES = 7
_NEAR_TICKS, _FAR_FROM_TICKS = 1.5, 9.0
"""Least and greatest distance of the name of an axis from its numbers, points."""


@dataclass(slots=True)
class Cell:
    """A box in space, its edges, its heading, and its place in the rows of the figure."""

    axes: Any
    edges: Array
    heading: str
    row: int
    column: int
    zoom: float = 1.0
    shift: Any = 0.0


def fill_cells(figure: Figure, cells: list[Cell], tallest: float | None, above: float) -> None:
    """Place every box so that it fills its cell, headings over them."""
    dpi, rows = figure.dpi, 1 + max(cell.row for cell in cells)
    if tallest is not None:
        heights = np.full(rows, tallest)
        figure.set_figheight(heights.sum() + above)
        _fit(figure, cells, heights * dpi)
        for row in range(rows):
            own = [_taken(cell.axes) for cell in cells if cell.row == row]
            needed = max(high[1] - low[1] for low, high in own) / dpi
            heights[row] = min(tallest, needed + _HEADING + 2.0 * _PAD)
        figure.set_figheight(heights.sum() + above)
    else:
        heights = np.full(rows, (figure.get_figheight() - above) / rows)
    _fit(figure, cells, heights * dpi)
    height = figure.bbox.height
    for cell in cells:
        top = height - above * dpi - heights[: cell.row].sum() * dpi
        # the heading stays over its cell wherever the box went
        cell.axes.title.set_visible(False)
        figure.text(
            0.25 + 0.5 * cell.column, (top - 0.05 * dpi) / height, cell.heading, size=LABEL_SIZE,
            color=INK, ha="center", va="top",
        )  # fmt: skip
        for artist in cell.axes.get_children():
            artist.set_clip_on(False)
        cell.axes.patch.set_visible(False)  # it would hide what its neighbour draws over the border


def _fit(figure: Figure, cells: list[Cell], heights: Array) -> None:
    """Zoom and shift boxes until each with its texts fills its cell; texts do not grow with it."""
    width, height = figure.bbox.size
    pad = _PAD * figure.dpi
    above = height - heights.sum()
    for cell in cells:
        cell.zoom, cell.shift = 1.0, np.zeros(2)
    for _ in range(_PASSES):
        for cell in cells:
            left, bottom = 0.5 * cell.column, height - above - heights[: cell.row + 1].sum()
            cell.axes.set_position((
                left + cell.shift[0] / width, (bottom + cell.shift[1]) / height,
                0.5, heights[cell.row] / height,
            ))  # fmt: skip
            cell.axes.set_box_aspect(cell.edges, zoom=cell.zoom)
        figure.draw_without_rendering()
        done = True
        for cell in cells:
            free = heights[cell.row] - _HEADING * figure.dpi
            room = np.array((0.5 * width, free)) - 2.0 * pad
            bottom = height - above - heights[: cell.row + 1].sum()
            middle = np.array(((0.25 + 0.5 * cell.column) * width, bottom + 0.5 * free))
            moved = _names_beside_numbers(cell.axes, figure.dpi)
            low, high = _taken(cell.axes)
            fit, off = float((room / (high - low)).min()), middle - 0.5 * (low + high)
            if moved or not 0.98 < fit < 1.01 or np.abs(off).max() > 0.5 * pad:
                cell.zoom, cell.shift = cell.zoom * fit, cell.shift + fit * off
                done = False
        if done:
            break


def _names_beside_numbers(axes: Any, dpi: float) -> bool:
    """Move names of axes off the numbers, or nearer to them; whether any was moved.

    Matplotlib measures their distance in parts of the box, so that it differs with its shape.
    """
    moved = False
    for name in "xyz":
        axis = getattr(axes, f"{name}axis")
        start, stop = sorted(getattr(axes, f"get_{name}lim")())
        numbers = [
            tick.label1.get_window_extent()
            for tick in axis.get_major_ticks()
            if start <= tick.get_loc() <= stop
        ]
        if not numbers:
            continue
        own = axis.label.get_window_extent()
        apart = min(
            max(own.x0 - n.x1, n.x0 - own.x1, own.y0 - n.y1, n.y0 - own.y1) for n in numbers
        ) / (dpi / 72.0)
        if not _NEAR_TICKS <= apart <= _FAR_FROM_TICKS:
            axis.labelpad += float(np.clip(0.5 * (_NEAR_TICKS + _FAR_FROM_TICKS) - apart, -9, 9))
            moved = True
    return moved


def far_apart(points: Array, distance: float) -> NDArray[np.int64]:
    """Group number of each point; groups are separated by more than a distance.

    Shapes: points (N, 3) -> (N,).
    """
    extent = float(np.ptp(points, axis=0).max())
    if extent == 0.0:
        return np.zeros(len(points), dtype=np.int64)
    # few cubes, so that thousands of points are no burden
    edge = 0.35 * distance * extent
    cubes = np.floor((points - points.min(axis=0)) / edge).astype(np.int64)
    _, cube = np.unique(cubes, axis=0, return_inverse=True)
    count = np.bincount(cube)
    centres = np.column_stack([np.bincount(cube, x) / count for x in points.T])
    if len(centres) == 1 or len(centres) > 2000:
        return np.zeros(len(points), dtype=np.int64)
    from scipy.cluster.hierarchy import fcluster, linkage

    group = fcluster(linkage(centres, "single"), distance * extent, "distance")[cube]
    _, first, number = np.unique(group, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[number].astype(np.int64)
