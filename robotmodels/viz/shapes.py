"""Nodes of a scene, their motions, and shapes: floor, box, path of a tool, ellipsoids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor, log10
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import Array, as_exact
from ..errors import InvalidValueError
from ..kinematics.ellipsoid import Ellipsoid, EllipsoidQuantity
from ..visual import Box, Color, Cylinder, Sphere, triad
from .motion import Track, keyframes

_GRID_COLOR: Color = (0.78, 0.80, 0.83, 1.0)
_DARK_GRID_COLOR: Color = (0.30, 0.33, 0.38, 1.0)
_BOX_COLOR: Color = (0.20, 0.45, 0.80, 0.08)
_BOX_EDGE_COLOR: Color = (0.20, 0.40, 0.75, 1.0)
_PATH_COLOR: Color = (0.80, 0.10, 0.45, 1.0)
_SIDES = 8
_ALONG = {"x": se3.rotation("y", 0.5 * np.pi), "y": se3.rotation("x", -0.5 * np.pi), "z": np.eye(4)}

# ellipsoids, in parts of the size of the robot
_REACH = 0.25  # of the largest ellipsoid of a kind, at most
_CUT, _BEYOND = 0.32, 0.42  # where longer ones are cut, and how far their axes go on
_THIN = 0.0035  # radius of bars
_LONGEST = 8.0  # length drawn of an unbounded ellipsoid, in its least radii

# none of the palette, in which configurations are drawn
_ELLIPSOID_COLORS: dict[EllipsoidQuantity, Color] = {
    EllipsoidQuantity.LINEAR_VELOCITY: (0.30, 0.25, 0.90, 0.2),
    EllipsoidQuantity.ANGULAR_VELOCITY: (0.00, 0.60, 0.65, 0.2),
    EllipsoidQuantity.FORCE: (0.85, 0.10, 0.35, 0.2),
    EllipsoidQuantity.MOMENT: (0.55, 0.35, 0.05, 0.2),
}
_FORCES = (EllipsoidQuantity.FORCE, EllipsoidQuantity.MOMENT)


@dataclass(frozen=True, slots=True, eq=False)
class Triangles:
    """A surface made of triangles. Shapes: vertices (v, 3), faces (t, 3)."""

    vertices: NDArray[np.floating]
    faces: NDArray[np.integer]


@dataclass(frozen=True, slots=True, eq=False)
class Segments:
    """Thin straight lines, one pixel wide. Shapes: points (2 k, 3)."""

    points: Array


@dataclass(frozen=True, slots=True)
class Label:
    """A text at the origin of its node that always faces the viewer."""

    text: str
    large: bool = False


Drawable = Box | Cylinder | Sphere | Triangles | Segments | Label
Legend = tuple[tuple[str, Color], ...]
"""Entries of a legend: a text and the colour it explains."""


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """A named place in the scene; its pose is relative to that of the node above it."""

    path: str
    pose: Array
    shape: Drawable | None = None
    color: Color = (0.7, 0.7, 0.7, 1.0)


def chain(path: str, axes: str, values: Array) -> list[Node]:
    """Nodes of slides along the first three axes and turns about the others, and of their end.

    Each is below a node that aligns its axis with z.
    """
    nodes, last = list[Node](), np.eye(4)
    for k, (axis, value) in enumerate(zip(axes, values, strict=True)):
        path = f"{path}/{k}a" if k else path
        nodes.append(Node(path, se3.inverse(last) @ _ALONG[axis]))
        path, last = f"{path}/{k}", _ALONG[axis]
        moved = se3.translation(0, 0, value) if k < 3 else se3.rotation("z", value)
        nodes.append(Node(path, moved))
    return [*nodes, Node(f"{path}/end", se3.inverse(last))]


def moving_chain(
    path: str, axes: str, times: Array, values: Array
) -> tuple[list[Node], list[Track]]:
    """Nodes of a chain that follows values (N, k), and their tracks; one node if it rests."""
    angles = np.unwrap(values[:, 3:], axis=0)
    times, values = keyframes(times, np.column_stack([values[:, :3], angles]))
    nodes = chain(path, axes, values[0])
    if len(values) == 1:
        return [Node(path, np.linalg.multi_dot([node.pose for node in nodes]))], []
    pairs = enumerate(zip(nodes[1:-1:2], values.T, strict=True))
    return nodes, [Track(node.path, k < 3, times, column) for k, (node, column) in pairs]


def along_bars(start: Array, end: Array) -> Array:
    """Values (N, 5) of a chain "xyzzy" from starts (N, 3), whose z axis points to the ends."""
    x, y, z = (end - start).T
    return np.column_stack([start, np.arctan2(y, x), np.arctan2(np.hypot(x, y), z)])


def extent(shape: Drawable | None) -> Array:
    """Points that enclose a shape: the corners of its bounding box. Shapes: -> (8, 3)."""
    match shape:
        case Box(size):
            low, high = -0.5 * np.array(size), 0.5 * np.array(size)
        case Cylinder(radius, length):
            high = np.array((radius, radius, 0.5 * length))
            low = -high
        case Sphere(radius):
            low, high = np.full(3, -radius), np.full(3, radius)
        case Triangles(points, _) | Segments(points):
            low, high = points.min(axis=0), points.max(axis=0)
        case _:  # texts, and nodes without a shape
            low = high = np.zeros(3)
    return np.where(np.indices((2, 2, 2)).reshape(3, -1).T, high, low).astype(np.float64)


def apply(T: Array, points: Array) -> Array:
    """Points in a frame as points outside it. Shapes: (..., 4, 4), (k, 3) -> (..., k, 3)."""
    return points @ np.swapaxes(T[..., :3, :3], -1, -2) + T[..., None, :3, 3]


def floor_grid(points: Array, dark: bool) -> list[Node]:
    """A grid on the world's plane z = 0 around points, and the axes of the world."""
    low, high = points.min(axis=0), points.max(axis=0)
    cell = rounded_down(float((high - low).max()) / 8.0)
    first = np.floor(np.minimum(low[:2], 0.0) / cell) - 1
    last = np.ceil(np.maximum(high[:2], 0.0) / cell) + 1
    x, y = (np.arange(a, b + 1) * cell for a, b in zip(first, last, strict=True))
    lines = [((u, y[0], 0.0), (u, y[-1], 0.0)) for u in x]
    lines += [((x[0], v, 0.0), (x[-1], v, 0.0)) for v in y]
    # slightly below zero, so that it does not shine through what stands on the floor
    below = se3.translation(0.0, 0.0, -0.01 * cell)
    color = _DARK_GRID_COLOR if dark else _GRID_COLOR
    nodes = [Node("grid", below, Segments(np.array(lines).reshape(-1, 3)), color)]
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
    a, b, c = (float(v) for v in np.ptp(ends, axis=1))
    middle = se3.translation(*(float(v) for v in ends.mean(axis=1)))
    nodes = [
        Node("box/faces", middle, Box((a, b, c)), _BOX_COLOR),
        Node("box/edges", np.eye(4), Segments(edges), _BOX_EDGE_COLOR),
    ]
    return nodes, corners


def path_node(name: str, points: Array, size: float) -> list[Node]:
    """The path of a tool as a node; none if the tool stands still."""
    tube = path_tube(points, 0.005 * size)
    return [] if tube is None else [Node(f"paths/{name}", np.eye(4), tube, _PATH_COLOR)]


def path_tube(points: Array, radius: float) -> Triangles | None:
    """A thin tube along a path; lines of the viewer are one pixel wide, too thin to see."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    points = points[np.r_[True, steps > 1e-9]]
    if len(points) < 2:
        return None
    edges = np.diff(points, axis=0)
    edges /= np.linalg.norm(edges, axis=1)[:, None]
    along = np.vstack((edges[:1], edges[:-1] + edges[1:], edges[-1:]))
    turn = np.linspace(0.0, 2.0 * np.pi, _SIDES + 1)
    side = np.cross(along[0], np.eye(3)[np.abs(along[0]).argmin()])
    rings = []
    for point, u in zip(points, along, strict=True):
        # the side is carried along, so that the tube does not twist; where the path turns back on
        # itself it has no direction, and the ring stays as it was
        carried = side - u * (side @ u) / max(float(u @ u), 1e-12)
        if np.linalg.norm(u) > 1e-6 and np.linalg.norm(carried) > 1e-6:
            side = carried / np.linalg.norm(carried)
            other = np.cross(u / np.linalg.norm(u), side)
        ring = np.outer(np.cos(turn), side) + np.outer(np.sin(turn), other)
        rings.append(point + radius * ring)
    return _surface(np.stack(rings))


def _surface(grid: Array) -> Triangles:
    """Two triangles for each cell of a grid of points (rows, columns, 3)."""
    rows, columns = grid.shape[:2]
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    a, b, c, d = first, first + 1, first + columns, first + columns + 1
    faces = np.stack((a, b, d, a, d, c), axis=-1).reshape(-1, 3)
    return Triangles(grid.reshape(-1, 3), faces)


def rounded_down(length: float) -> float:
    """The largest of 1, 2 or 5 times a power of ten that is not above a length."""
    if length <= 0.0:
        return 0.1
    power = 10.0 ** floor(log10(length) + 1e-9)
    lead = length / power * (1.0 + 1e-9)
    return float(f"{power * (5.0 if lead >= 5 else 2.0 if lead >= 2 else 1.0):.6g}")


# ---------------------------------------------------------------- ellipsoids


def as_ellipsoids(value: Any) -> tuple[Ellipsoid, ...]:
    """One ellipsoid, several, or none, as a tuple; batches are taken apart."""
    given = () if value is None else (value,) if isinstance(value, Ellipsoid) else value
    if not isinstance(given, (tuple, list)) or not all(isinstance(e, Ellipsoid) for e in given):
        raise InvalidValueError(
            "ellipsoids: expected an Ellipsoid or a list of them, such as velocity_ellipsoid gives,"
            f" got {type(value).__name__}."
        )
    return tuple(e.at(i) for e in given for i in np.ndindex(e.rank.shape))


def draw_ellipsoids(
    ellipsoids: Sequence[Ellipsoid], size: float, scale: float | None = None
) -> tuple[list[Node], Array, Legend]:
    """Nodes of ellipsoids at their frames, points that enclose them (k, 3), and their legend."""
    if scale is not None and float(as_exact(scale, (), "ellipsoid_scale")) <= 0.0:
        raise InvalidValueError(
            f"ellipsoid_scale: expected metres drawn per unit, above 0, got {scale:g}."
        )
    nodes, points, legend = list[Node](), [np.zeros((0, 3))], list[tuple[str, Color]]()
    for quantity, color in _ELLIPSOID_COLORS.items():
        own = [(k, e) for k, e in enumerate(ellipsoids, 1) if e.quantity is quantity]
        if not own:
            continue
        every = np.array([e.radii for _, e in own])
        every = every[np.isfinite(every) & (every > 0)]
        longest = float(every.max(initial=0.0)) or 1.0
        if quantity in _FORCES and every.size:  # near singular positions they grow without bound
            longest = min(longest, _LONGEST * float(every.min()))
        s = scale or (rounded_down(_REACH * size / longest) if every.size else 1.0)
        beyond = ""
        for k, ellipsoid in own:
            radii = ellipsoid.radii * s
            finite = float(np.max(radii, where=np.isfinite(radii), initial=0.0))
            longest = max(_CUT * size, 0.0 if scale is None else 1.3 * finite)
            cut = radii > longest * (1.0 + 1e-9)
            beyond = ", continues along its axes" if cut.any() else beyond
            ends = np.where(cut, longest * _BEYOND / _CUT, radii)
            pose = se3.translation(*ellipsoid.centre)
            pose[:3, :3] = ellipsoid.axes
            nodes.append(Node(f"ellipsoids/{k}", pose))
            nodes += _ellipsoid_nodes(f"ellipsoids/{k}", radii, ends, longest, size, color)
            points.append(apply(pose, np.vstack((np.diag(ends), -np.diag(ends)))))
        text = f"{quantity.value}: {s:g} m drawn per {quantity.unit}{beyond}"
        legend.append((text, (*color[:3], 1.0)))
    return nodes, np.concatenate(points), tuple(legend)


def _ellipsoid_nodes(
    path: str, radii: Array, ends: Array, longest: float, size: float, color: Color
) -> list[Node]:
    """Surface and principal ellipses, cut where they are too long, and axes, in its own axes."""
    dark: Color = (0.65 * color[0], 0.65 * color[1], 0.65 * color[2], 1.0)
    thin, here, nodes = _THIN * size, np.eye(4), list[Node]()
    seen = np.flatnonzero(radii > thin)
    r = np.minimum(radii, 1e6 * longest)
    if len(seen) > 1 and (radii <= longest).any():
        # about the shortest axis: where the others are cut, the surface is a tube or two sheets
        k = int(radii.argmin())
        theta, phi = np.linspace(0.0, np.pi, 33)[:, None], np.linspace(0.0, 2.0 * np.pi, 65)
        round_k = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)
        unit = np.stack((*round_k, np.cos(theta) + 0.0 * phi), axis=-1)
        points = np.clip(r * np.roll(unit, k - 2, axis=-1), -longest, longest)
        nodes.append(Node(f"{path}/surface", here, _surface(points), color))
        lines = []
        for i, j in ((i, j) for i in seen for j in seen if i < j):
            line = np.zeros((len(phi), 3))
            line[:, i], line[:, j] = r[i] * np.cos(phi), r[j] * np.sin(phi)
            lines.append(np.repeat(np.clip(line, -longest, longest), 2, axis=0)[1:-1])
        nodes.append(Node(f"{path}/outline", here, Segments(np.concatenate(lines)), dark))
    elif not len(seen):
        nodes.append(Node(f"{path}/dot", here, Sphere(2.0 * thin), dark))
    for i in seen:
        width = thin if len(seen) == 1 or radii[i] > longest else 0.4 * thin
        tube = path_tube(np.outer((-ends[i], ends[i]), np.eye(3)[i]), width)
        nodes += [] if tube is None else [Node(f"{path}/axis_{i + 1}", here, tube, dark)]
    return nodes
