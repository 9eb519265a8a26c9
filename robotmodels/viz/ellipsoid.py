"""Velocity and force ellipsoids in a scene: at the tool, to a scale that the legend tells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor, log10
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array, as_exact
from ..errors import InvalidValueError
from ..kinematics.ellipsoid import Ellipsoid, EllipsoidQuantity
from ..visual import Color, Sphere
from .nodes import Node, Segments, Triangles
from .palette import Legend
from .surroundings import path_tube

# parts of the size of the robot
_REACH = 0.25  # of the largest ellipsoid of a kind, at most
_CUT = 0.32  # where what is longer ends
_DASH, _GAP, _DASHES = 0.02, 0.015, 3
_THIN = 0.0035  # radius of bars
_LONGEST = 8.0  # an open ellipsoid is drawn up to so many times its least radius

_OPACITY = 0.2  # not above: the viewer then hides nothing behind it
_INK = 0.65  # lines are so much darker than the surface
_SPHERE = (17, 33)  # polar angles and meridians

# none of the palette, in which postures are drawn
ELLIPSOID_COLORS: dict[EllipsoidQuantity, Color] = {
    EllipsoidQuantity.LINEAR_VELOCITY: (0.30, 0.25, 0.90, 1.0),
    EllipsoidQuantity.ANGULAR_VELOCITY: (0.00, 0.60, 0.65, 1.0),
    EllipsoidQuantity.FORCE: (0.85, 0.10, 0.35, 1.0),
    EllipsoidQuantity.MOMENT: (0.55, 0.35, 0.05, 1.0),
}
_FORCES = (EllipsoidQuantity.FORCE, EllipsoidQuantity.MOMENT)


@dataclass(frozen=True, slots=True, eq=False)
class DrawnEllipsoids:
    """Nodes of ellipsoids and what a scene needs to know of them. Shapes: points (k, 3)."""

    nodes: tuple[Node, ...]
    points: Array
    legend: Legend


def as_ellipsoids(value: Any) -> tuple[Ellipsoid, ...]:
    """One ellipsoid, several, or none, as a tuple; batches are taken apart."""
    if value is None:
        return ()
    given = (value,) if isinstance(value, Ellipsoid) else value
    if not isinstance(given, (tuple, list)) or not all(isinstance(e, Ellipsoid) for e in given):
        raise InvalidValueError(
            "ellipsoids: expected an Ellipsoid or a list of them, such as velocity_ellipsoid gives,"
            f" got {type(value).__name__}."
        )
    return tuple(e.at(i) for e in given for i in np.ndindex(e.rank.shape))


def draw_ellipsoids(
    ellipsoids: Sequence[Ellipsoid], size: float, scale: float | None = None
) -> DrawnEllipsoids:
    """Draw ellipsoids where their frames are."""
    given = None if scale is None else _as_scale(scale)
    nodes, points, legend = list[Node](), [np.zeros((0, 3))], list[tuple[str, Color]]()
    if ellipsoids:
        nodes.append(Node("ellipsoids", np.eye(4)))
    for quantity in EllipsoidQuantity:
        own = [(k, e) for k, e in enumerate(ellipsoids, 1) if e.quantity is quantity]
        if not own:
            continue
        s = given or _round_scale(quantity, np.array([e.radii for _, e in own]), size)
        color, goes_on = ELLIPSOID_COLORS[quantity], False
        for k, ellipsoid in own:
            radii = ellipsoid.radii * s
            longest = _CUT * size
            cut = radii > longest * (1.0 + 1e-9)
            if given is not None:
                cut = ~np.isfinite(radii)
                longest = max(longest, 1.3 * float(np.max(radii, where=~cut, initial=0.0)))
            goes_on = goes_on or bool(cut.any())
            pose = se3.translation(*ellipsoid.centre)
            pose[:3, :3] = ellipsoid.axes
            top = f"ellipsoids/{k}"
            shapes = _shapes(top, radii, cut, longest, size, color)
            nodes += [Node(top, pose), *shapes]
            corners = np.where(cut, longest + _DASHES * (_DASH + _GAP) * size, radii)
            ends = np.concatenate((np.diag(corners), -np.diag(corners)))
            points.append(ends @ ellipsoid.axes.T + ellipsoid.centre)
        beyond = ", goes on along the dashes" if goes_on else ""
        legend.append((f"{quantity.value}: {s:g} m drawn per {quantity.unit}{beyond}", color))
    return DrawnEllipsoids(tuple(nodes), np.concatenate(points), tuple(legend))


def _as_scale(value: float) -> float:
    scale = float(as_exact(value, (), "ellipsoid_scale"))
    if scale <= 0.0:
        raise InvalidValueError(
            f"ellipsoid_scale: expected metres drawn per unit, above 0, got {scale:g}."
        )
    return scale


def _round_scale(quantity: EllipsoidQuantity, radii: Array, size: float) -> float:
    """Metres per unit so that the longest radius is about `_REACH` of the robot."""
    finite = radii[np.isfinite(radii) & (radii > 0)]
    if not finite.size:
        return 1.0
    longest = float(finite.max())
    if quantity in _FORCES:  # near singular positions they have no end
        longest = min(longest, _LONGEST * float(finite.min()))
    exact = _REACH * size / longest
    power = 10.0 ** floor(log10(exact) + 1e-9)
    lead = exact / power * (1.0 + 1e-9)
    return float(f"{power * (5.0 if lead >= 5 else 2.0 if lead >= 2 else 1.0):.6g}")


def _shapes(
    path: str, radii: Array, cut: NDArray[np.bool_], longest: float, size: float, color: Color
) -> list[Node]:
    """Surface, principal ellipses and axes in the ellipsoid's own axes."""
    r, g, b, _ = color
    dark: Color = (_INK * r, _INK * g, _INK * b, 1.0)
    glass: Color = (r, g, b, _OPACITY)
    ends = np.where(cut, longest, radii)
    thin = _THIN * size
    seen = ends > thin
    nodes = []
    surface = _surface(radii, cut, ends, seen)
    if surface is not None:
        nodes.append(Node(f"{path}/surface", np.eye(4), surface, glass))
        lines = _outline(radii, cut, ends, seen)
        if lines is not None:
            nodes.append(Node(f"{path}/outline", np.eye(4), lines, dark))
    elif not seen.any():
        nodes.append(Node(f"{path}/dot", np.eye(4), Sphere(2.0 * thin), dark))
    for i in np.flatnonzero(seen):
        unit = np.eye(3)[i]
        bar = path_tube(
            np.outer((-ends[i], ends[i]), unit), thin if seen.sum() == 1 else 0.4 * thin
        )
        if bar is not None:
            nodes.append(Node(f"{path}/axis_{i + 1}", np.eye(4), bar, dark))
        for sign, side in ((1.0, "+"), (-1.0, "-")) if cut[i] else ():
            for d in range(_DASHES):
                first = longest + ((d + 1) * _GAP + d * _DASH) * size
                dash = path_tube(np.outer((first, first + _DASH * size), sign * unit), thin)
                if dash is not None:
                    nodes.append(Node(f"{path}/dash_{i + 1}{side}{d + 1}", np.eye(4), dash, dark))
    return nodes


def _surface(
    radii: Array, cut: NDArray[np.bool_], ends: Array, seen: NDArray[np.bool_]
) -> Triangles | None:
    """Sphere, disc, tube or two sheets, by the number of axes that are cut; None of a bar."""
    polar, around = _SPHERE
    turn = np.linspace(0.0, 2.0 * np.pi, around)
    ring = np.stack((np.cos(turn), np.sin(turn)), axis=-1)
    long, short = np.flatnonzero(cut), np.flatnonzero(~cut)
    if seen.sum() < 2 or len(long) == 3:
        return None
    if len(long) == 0 and not seen.all():
        # one side of a disc is enough: both are drawn
        flat = np.zeros((2, around, 3))
        flat[1][:, np.flatnonzero(seen)] = ring * ends[seen]
        return _mesh(flat)
    if len(long) == 0:
        angle = np.linspace(0.0, np.pi, polar)
        grid = np.zeros((polar, around, 3))
        grid[..., :2] = np.sin(angle)[:, None, None] * ring * radii[:2]
        grid[..., 2] = np.cos(angle)[:, None] * radii[2]
        return _mesh(grid)
    if len(long) == 1:
        i, t = long[0], np.linspace(-1.0, 1.0, polar) * ends[long[0]]
        grid = np.zeros((polar, around, 3))
        grid[..., i] = t[:, None]
        narrow = np.sqrt(1.0 - (t / radii[i]) ** 2)  # 1 all along an infinite axis
        grid[..., short] = narrow[:, None, None] * ring * radii[short]
        return _mesh(grid)
    k, rho = short[0], np.linspace(0.0, 1.0, polar)
    grid = np.zeros((polar, around, 3))
    grid[..., long] = rho[:, None, None] * ring * ends[long]
    inside = 1.0 - ((grid[..., long] / radii[long]) ** 2).sum(axis=-1)
    grid[..., k] = radii[k] * np.sqrt(np.maximum(inside, 0.0))
    other = grid.copy()
    other[..., k] *= -1.0
    return _joined(_mesh(grid), _mesh(other))


def _outline(
    radii: Array, cut: NDArray[np.bool_], ends: Array, seen: NDArray[np.bool_]
) -> Segments | None:
    """The ellipses in the principal planes, and the rims of what is cut."""
    turn = np.linspace(0.0, 2.0 * np.pi, 2 * _SPHERE[1])
    ring = np.stack((np.cos(turn), np.sin(turn)), axis=-1)
    lines = []
    for i, j in ((0, 1), (0, 2), (1, 2)):
        pair = [i, j]
        if seen[pair].all() and not cut[pair].any():
            line = np.zeros((len(turn), 3))
            line[:, pair] = ring * radii[pair]
            lines.append(line)
    long, short = np.flatnonzero(cut), np.flatnonzero(~cut)
    for sign in (-1.0, 1.0):
        line = np.zeros((len(turn), 3))
        if len(long) == 1:
            line[:, long[0]] = sign * ends[long[0]]
            line[:, short] = ring * radii[short] * np.sqrt(1 - (ends[long] / radii[long]) ** 2)
            lines.append(line)
        elif len(long) == 2:
            line[:, long] = ring * ends[long]
            inside = 1.0 - ((line[:, long] / radii[long]) ** 2).sum(axis=-1)
            line[:, short[0]] = sign * radii[short[0]] * np.sqrt(np.maximum(inside, 0.0))
            lines.append(line)
    if not lines:
        return None
    return Segments(np.concatenate([np.repeat(line, 2, axis=0)[1:-1] for line in lines]))


def _mesh(grid: Array) -> Triangles:
    """Two triangles for each cell of a grid of points (rows, columns, 3)."""
    rows, columns = grid.shape[:2]
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    a, b, c, d = first, first + 1, first + columns, first + columns + 1
    faces = np.stack((a, b, d, a, d, c), axis=-1).reshape(-1, 3)
    return Triangles(grid.reshape(-1, 3).astype(np.float32), faces.astype(np.uint32))


def _joined(a: Triangles, b: Triangles) -> Triangles:
    faces = np.concatenate((a.faces, b.faces + len(a.vertices)))
    return Triangles(np.concatenate((a.vertices, b.vertices)), faces)
