"""Axes in space with equal scales."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._arrays import Array
from .over_time import Unit
from .style import PALE, Figure

_ELEVATION, _OBLIQUE = np.radians((24.0, 60.0))
_OFF_AXIS = np.radians((22.0, 68.0))
_THINNEST = 0.35  # edge of the box in any direction, beside the longest edge


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
    axes.set_box_aspect(edges, zoom=0.7)
    axes.patch.set_visible(False)  # it would hide its neighbours
    return axes
