"""What a scene is made of: a tree of named nodes, each with a pose and perhaps a shape."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..visual import Box, Color, Cylinder, Sphere


@dataclass(frozen=True, slots=True, eq=False)
class Triangles:
    """A surface made of triangles. Shapes: vertices (v, 3), faces (t, 3)."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.integer]


@dataclass(frozen=True, slots=True, eq=False)
class Segments:
    """Thin straight lines, one pixel wide. Shapes: points (2 k, 3)."""

    points: Array


@dataclass(frozen=True, slots=True)
class Label:
    """A text that always faces the viewer."""

    text: str
    size: float


Drawable = Box | Cylinder | Sphere | Triangles | Segments | Label


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """A named place in the scene."""

    path: str
    pose: Array
    shape: Drawable | None = None
    color: Color = (0.7, 0.7, 0.7, 1.0)


def extent(shape: Drawable) -> Array:
    """Points that enclose a shape: the corners of its bounding box. Shapes: -> (8, 3)."""
    match shape:
        case Box(size):
            high = 0.5 * np.array(size)
            low = -high
        case Cylinder(radius, length):
            high = np.array((radius, radius, 0.5 * length))
            low = -high
        case Sphere(radius):
            high = np.full(3, radius)
            low = -high
        case Label(_, size):
            high = np.full(3, 0.25 * size)
            low = -high
        case Triangles(points, _) | Segments(points):
            low, high = points.min(axis=0), points.max(axis=0)
    corners = np.indices((2, 2, 2)).reshape(3, -1).T
    return np.where(corners, high, low).astype(np.float64)


def apply(T: Array, points: Array) -> Array:
    """Move points: coordinates in the frame ``T`` become coordinates outside it.

    Shapes: T (..., 4, 4), points (k, 3) -> (..., k, 3).
    """
    return points @ np.swapaxes(T[..., :3, :3], -1, -2) + T[..., None, :3, 3]
