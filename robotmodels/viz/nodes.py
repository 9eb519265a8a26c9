"""What a scene is made of: a tree of named nodes, each with a pose and perhaps a shape."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..visual import Box, Color, Cylinder, Sphere


@dataclass(frozen=True, slots=True, eq=False)
class Triangles:
    """A surface made of triangles.

    Parameters
    ----------
    vertices : ndarray of float32, shape (v, 3)
        Metres.
    faces : ndarray of int, shape (t, 3)
        Three vertex numbers a triangle.

    Examples
    --------
    >>> Triangles(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]])).faces.shape
    (1, 3)
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.integer]


@dataclass(frozen=True, slots=True, eq=False)
class Segments:
    """Thin straight lines, one pixel wide.

    Parameters
    ----------
    points : ndarray, shape (2 k, 3)
        The two ends of each line, in metres.

    Examples
    --------
    >>> Segments(np.zeros((2, 3))).points.shape
    (2, 3)
    """

    points: Array


@dataclass(frozen=True, slots=True)
class Label:
    """A text that always faces the viewer.

    Parameters
    ----------
    text : str
        Short: it is drawn on a square.
    size : float
        Edge of that square in metres.

    Examples
    --------
    >>> Label("R1", 0.1).text
    'R1'
    """

    text: str
    size: float


Drawable = Box | Cylinder | Sphere | Triangles | Segments | Label


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """A named place in the scene.

    Parameters
    ----------
    path : str
        Names from the root down, parted by ``/``; a node moves with the node above it.
    pose : ndarray, shape (4, 4)
        In the node above.
    shape : Box, Cylinder, Sphere, Triangles, Segments or Label, optional
        What is drawn there.
    color : tuple of 4 floats
        Red, green, blue, opacity in [0, 1].

    Examples
    --------
    >>> Node("robots/rx90", np.eye(4)).shape is None
    True
    """

    path: str
    pose: Array
    shape: Drawable | None = None
    color: Color = (0.7, 0.7, 0.7, 1.0)


def extent(shape: Drawable) -> Array:
    """Points that enclose a shape: the corners of its bounding box.

    Parameters
    ----------
    shape : Box, Cylinder, Sphere, Triangles, Segments or Label
        In its own frame.

    Returns
    -------
    ndarray, shape (8, 3)
        Metres.

    Examples
    --------
    >>> extent(Sphere(0.5)).max()
    np.float64(0.5)
    """
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

    Parameters
    ----------
    T : ndarray, shape (..., 4, 4)
        Poses.
    points : ndarray, shape (k, 3)
        Metres.

    Returns
    -------
    ndarray, shape (..., k, 3)
        Metres.

    Examples
    --------
    >>> apply(np.eye(4), np.ones((1, 3)))
    array([[1., 1., 1.]])
    """
    return points @ np.swapaxes(T[..., :3, :3], -1, -2) + T[..., None, :3, 3]
