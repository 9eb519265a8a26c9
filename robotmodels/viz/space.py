"""Axes in space with equal scales, that fill their cell of a figure with all of their texts."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._arrays import Array
from .over_time import Unit
from .style import PALE, Figure

_ELEVATION, _OBLIQUE = np.radians((24.0, 60.0))
_OFF_AXIS = np.radians((22.0, 68.0))
_THINNEST = 0.35  # edge of the box in any direction, beside the longest edge
_PASSES = 6


def across(points: Array) -> Array:
    """Azimuth and elevation that show the longest horizontal direction in the picture plane."""
    flat = points[:, :2] - points[:, :2].mean(axis=0)
    _, extents, directions = np.linalg.svd(flat, full_matrices=True)
    if not extents.size or extents[0] < 1e-9:
        return np.array((-_OBLIQUE, _ELEVATION))
    azimuth = float(np.arctan2(directions[0, 1], directions[0, 0])) % np.pi - _OBLIQUE
    # seen along an axis of the world, the numbers on that axis would cover each other
    quarter = 0.5 * np.pi * np.floor(azimuth / (0.5 * np.pi))
    return np.array((quarter + np.clip(azimuth - quarter, *_OFF_AXIS), _ELEVATION))


def space(
    figure: Figure, place: tuple[int, int, int], points: Array, unit: Unit, view: Array
) -> Any:
    """Axes in space around points, with equal scales and a box that is not flat."""
    from matplotlib.ticker import MaxNLocator

    axes: Any = figure.add_subplot(*place, projection="3d")
    low, high = points.min(axis=0), points.max(axis=0)
    edges = 1.06 * (high - low)
    edges = np.maximum(edges, _THINNEST * (edges.max() or 1.0))
    axes.view_init(elev=float(np.degrees(view[1])), azim=float(np.degrees(view[0])))
    for name, middle, edge in zip("xyz", 0.5 * (low + high), edges, strict=True):
        axis = getattr(axes, f"{name}axis")
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.line.set_color(PALE)
        axis._axinfo["grid"].update(color="#ebebeb", linewidth=0.8)
        axis.set_major_locator(MaxNLocator(max(2, round(3.6 * edge / edges.max()))))
        axis.set_label_text(f"{name} ({unit.value})")
        axis.labelpad = 2.0
        axes.tick_params(axis=name, pad=-1.0)
        axes.set(**{f"{name}lim": (middle - 0.5 * edge, middle + 0.5 * edge)})
    axes.set_box_aspect(edges)
    axes.patch.set_visible(False)  # it would hide its neighbours
    return axes


def fill_cells(figure: Figure, cells: list[tuple[Any, tuple[float, ...], str]]) -> Figure:
    """Zoom and shift axes in space until each fills its cell, below its heading.

    Cells are (axes, (left, bottom, width, height) in parts of the figure, heading).
    """
    figure.set_layout_engine("none")  # it does not know how far texts of axes in space reach
    size = np.array(figure.bbox.size)
    pad = 0.05 * figure.dpi
    places = [(size * cell[:2], size * cell[2:], bool(heading)) for _, cell, heading in cells]
    edges = [np.ptp([a.get_xlim(), a.get_ylim(), a.get_zlim()], axis=1) for a, _, _ in cells]
    zoom, shift = np.ones(len(cells)), np.zeros((len(cells), 2))
    for _ in range(_PASSES):  # texts do not grow with the box
        for k, (axes, (left, bottom, width, height), _) in enumerate(cells):
            x, y = shift[k] / size
            axes.set_position((left + x, bottom + y, width, height))
            axes.set_box_aspect(edges[k], zoom=zoom[k])
        figure.draw_without_rendering()
        for k, (corner, room, headed) in enumerate(places):
            low, high = _taken(cells[k][0])
            free = room - (0.0, 0.22 * figure.dpi * headed)
            fit = float(((free - 2.0 * pad) / (high - low)).min())
            zoom[k] *= fit
            shift[k] += fit * (corner + 0.5 * free - 0.5 * (low + high))
    for axes, (left, bottom, width, height), heading in cells:
        at = (left + 0.5 * width, bottom + height - 0.05 / figure.get_figheight())
        figure.text(*at, heading, size=8.5, ha="center", va="top")
        for artist in axes.get_children():
            artist.set_clip_on(False)  # the box may stand a little outside of its rectangle
    return figure


def _taken(axes: Any) -> Array:
    """Least and greatest pixels of the box and of the texts on it, as they were drawn last."""
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    corners = np.array(np.meshgrid(axes.get_xlim(), axes.get_ylim(), axes.get_zlim()))
    x, y, _ = proj_transform(*corners.reshape(3, -1), axes.get_proj())  # type: ignore[call-arg]
    boxes = [axis.get_tightbbox() for axis in (axes.xaxis, axes.yaxis, axes.zaxis)]
    points = [axes.transData.transform(np.column_stack((x, y)))]
    every = np.concatenate(points + [box.get_points() for box in boxes if box is not None])
    return np.array((every.min(axis=0), every.max(axis=0)))
