"""What stands around a robot: the floor's grid, the world's axes, a workspace box, a tool path."""

from __future__ import annotations

from math import floor, log10

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, as_exact
from ..errors import InvalidValueError
from ..visual import Box, Color, Cylinder, triad
from .nodes import Node, Segments, Triangles

_GRID_COLOR: Color = (0.78, 0.80, 0.83, 1.0)
_BOX_COLOR: Color = (0.20, 0.45, 0.80, 0.08)
_BOX_EDGE_COLOR: Color = (0.20, 0.40, 0.75, 1.0)
_PATH_COLOR: Color = (0.80, 0.10, 0.45, 1.0)
_SIDES = 8


def floor_grid(points: Array) -> list[Node]:
    """A grid on the world's plane z = 0 below a robot, and the axes of the world.

    Shapes: points (k, 3).
    """
    low, high = points.min(axis=0), points.max(axis=0)
    cell = _round_length(float((high - low).max()) / 8.0)
    first = np.floor(np.minimum(low[:2], 0.0) / cell) - 1
    last = np.ceil(np.maximum(high[:2], 0.0) / cell) + 1
    x, y = (np.arange(a, b + 1) * cell for a, b in zip(first, last, strict=True))
    lines = [((u, y[0], 0.0), (u, y[-1], 0.0)) for u in x]
    lines += [((x[0], v, 0.0), (x[-1], v, 0.0)) for v in y]
    # a hair below zero, so that it does not shine through what stands on the floor
    below = se3.translation(0.0, 0.0, -0.01 * cell)
    nodes = [Node("grid", below, Segments(np.array(lines).reshape(-1, 3)), _GRID_COLOR)]
    for name, axis in zip("xyz", triad(0, np.eye(4), cell), strict=True):
        if isinstance(axis.shape, Cylinder) and axis.color is not None:
            nodes.append(Node(f"world/{name}", axis.pose, axis.shape, axis.color))
    return nodes


def workspace_box(box: ArrayLike) -> tuple[list[Node], Array]:
    """A transparent box with its edges. Shapes: box (6,) -> corners (8, 3)."""
    ends = as_exact(box, (6,), "box").reshape(3, 2)
    for name, (low, high) in zip("xyz", ends, strict=True):
        if low >= high:
            raise InvalidValueError(
                f"box: expected (xmin, xmax, ymin, ymax, zmin, zmax), got {name} from {low} to "
                f"{high}; the lower end comes first."
            )
    which = np.indices((2, 2, 2)).reshape(3, -1).T
    corners = np.where(which, ends[:, 1], ends[:, 0])
    # two corners are joined if they differ along one axis
    pairs = [(a, b) for a in range(8) for b in range(a) if np.abs(which[a] - which[b]).sum() == 1]
    edges = corners[np.array(pairs).ravel()]
    x, y, z = (float(v) for v in ends.mean(axis=1))
    a, b, c = (float(v) for v in np.ptp(ends, axis=1))
    nodes = [
        Node("box/faces", se3.translation(x, y, z), Box((a, b, c)), _BOX_COLOR),
        Node("box/edges", np.eye(4), Segments(edges), _BOX_EDGE_COLOR),
    ]
    return nodes, corners


def path_tube(points: Array, radius: float) -> Triangles | None:
    """A thin tube along a path: a line of a viewer is one pixel wide, which is hard to see.

    Shapes: points (k, 3).
    """
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    points = points[np.r_[True, steps > 1e-9]]
    if len(points) < 2:
        return None
    edges = np.diff(points, axis=0)
    edges /= np.linalg.norm(edges, axis=1)[:, None]
    along = np.vstack((edges[:1], edges[:-1] + edges[1:], edges[-1:]))
    turn = np.arange(_SIDES) * (2 * np.pi / _SIDES)
    side = np.cross(along[0], np.eye(3)[np.abs(along[0]).argmin()])
    rings = []
    for point, u in zip(points, along, strict=True):
        # carry the side along, so that the tube does not twist; a path that turns back on itself
        # has no direction there and keeps the ring it had
        if np.linalg.norm(u) > 1e-6:
            carried = side - u * (side @ u) / (u @ u)
            if np.linalg.norm(carried) > 1e-6:
                side = carried / np.linalg.norm(carried)
                other = np.cross(u / np.linalg.norm(u), side)
        rings.append(
            point + radius * (np.outer(np.cos(turn), side) + np.outer(np.sin(turn), other))
        )
    first = _SIDES * np.arange(len(points) - 1)[:, None]
    i = np.arange(_SIDES)
    a, b = first + i, first + (i + 1) % _SIDES
    faces = np.stack((a, b, b + _SIDES, a, b + _SIDES, a + _SIDES), axis=-1).reshape(-1, 3)
    return Triangles(np.concatenate(rings).astype(np.float32), faces.astype(np.uint32))


def path_node(name: str, points: Array, size: float) -> list[Node]:
    """The path of a tool as a node. Shapes: points (k, 3)."""
    tube = path_tube(points, 0.005 * size)
    return [] if tube is None else [Node(f"paths/{name}", np.eye(4), tube, _PATH_COLOR)]


def _round_length(length: float) -> float:
    """The largest of 1, 2 or 5 times a power of ten that is not above ``length``."""
    power = 10.0 ** floor(log10(length)) if length > 0 else 0.1
    lead = length / power if length > 0 else 1.0
    return power * (5.0 if lead >= 5 else 2.0 if lead >= 2 else 1.0)
