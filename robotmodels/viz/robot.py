"""A robot as nodes: one for each frame of its table, in the tree of its links.

A closure of a looped robot is a ring on its first frame and a ball on the second, which lies in
the ring where the loop is closed; a link without shape towards either is a rod.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, as_number
from ..errors import InvalidValueError, RobotModelsWarning
from ..geometry import PRISMATIC, DHTable, constant_factors
from ..kinematics import link_poses
from ..loops import LoopedRobot
from ..model import RobotModel
from ..visual import (
    Color,
    Cylinder,
    Mesh,
    Sphere,
    Visual,
    characteristic_length,
    link_rod,
    skeleton,
    triad,
    z_along,
)
from .meshes import mesh_parts, with_stand_ins
from .shapes import Drawable, Label, Node, apply, extent

MESH_COLOR: Color = (0.72, 0.74, 0.78, 1.0)
_LINK = "shape:"


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """Options of scenes of robots, explained at the head of `robotmodels.viz.show`."""

    frames: bool = False
    names: bool = False
    tool: bool = True
    meshes: bool = True
    color: Any = None
    opacity: float = 1.0
    box: ArrayLike | None = None
    grid: bool = True
    view: ArrayLike | None = None
    height: int = 480
    dark: bool = False

    def __post_init__(self) -> None:
        """Check the opacity; the other options are checked where they are used."""
        if as_number(self.opacity, "opacity", least=0.0) > 1.0:
            raise InvalidValueError(f"opacity: expected at most 1, got {self.opacity}.")


@dataclass(frozen=True, slots=True, eq=False)
class RobotDrawing:
    """Nodes of a robot; points that enclose it (k, 3); paths of its joints and of its frames."""

    nodes: tuple[Node, ...]
    points: Array
    joints: tuple[str, ...]
    size: float
    frames: tuple[str, ...] = ()


_Pieces = list[tuple[int, Node]]
"""Shapes with the frames they move with; the paths are names, unique for each frame."""


def draw_robot(
    model: RobotModel,
    q: Array,
    root: str,
    options: Options,
    colors: Sequence[Color | None],
    seen: Array | None = None,
) -> RobotDrawing:
    """Draw a robot in several configurations; the picture has room for those seen.

    Shapes: q (N, n), seen (M, n).
    """
    if options.meshes:
        model, missing = with_stand_ins(model)
        if missing:
            warnings.warn(
                f"mesh files not found, a skeleton is drawn for them: {', '.join(missing):.400}. "
                "Files outside of the URDF's folder and package need package_dirs=[...] in "
                "RobotModel.from_urdf (the folders that contain the packages' folders); "
                "meshes=False draws no meshes.",
                RobotModelsWarning,
                stacklevel=3,
            )
    seen = q if seen is None else seen
    table = with_strokes(model.table, seen)
    size = characteristic_length(table, model.tool)
    pieces = _pieces(model, table, options, size)
    one = len(q) == 1
    nodes = [Node(root, model.base)]
    # several configurations share what stands still: it keeps its own colour
    nodes += _shapes(pieces, 0, root, colors[0] if one else None, options)
    paths: list[list[str]] = []
    for k, configuration in enumerate(q):
        top = root if one else f"{root}/posture_{k + 1}"
        nodes += [] if one else [Node(top, np.eye(4))]
        frames, hung = _frames(model, configuration, top)
        nodes += frames
        paths.append(hung)
        for j in range(1, model.f + 1):
            nodes += _shapes(pieces, j, hung[j], colors[k], options)
    joints = tuple(paths[0][row + 1] for row in model.table.joint_rows)
    return RobotDrawing(tuple(nodes), _extent(model, seen, pieces), joints, size, tuple(paths[0]))


def with_strokes(table: DHTable, q: Array) -> DHTable:
    """Table with limits for every prismatic joint, the ends of the motion where it has none."""
    needed = (table.sigma[table.joint_rows] == PRISMATIC) & ~np.isfinite(table.upper - table.lower)
    return table.replace(
        lower=np.where(needed, np.minimum(q.min(axis=0), 0.0), table.lower),
        upper=np.where(needed, np.maximum(q.max(axis=0), 0.0), table.upper),
    )


def _pieces(model: RobotModel, table: DHTable, options: Options, size: float) -> _Pieces:
    """Links, axes of frames, and names."""
    visuals = model.visuals if options.meshes else ()
    pieces = _Pieces()
    for i, visual in enumerate(visuals or skeleton(table, model.tool, model.tip, axes=False)):
        for k, (shape, color) in enumerate(_solids(visual)):
            node = Node(f"{_LINK}{i + 1}.{k + 1}", visual.pose, shape, color)
            pieces.append((visual.frame, node))
    triads = [(j, np.eye(4), f"R{j}", 0.11) for j in range(1, model.f + 1) if options.frames]
    triads += [(model.tip, model.tool, "tool", 0.12)] if options.tool else []
    for j, pose, name, part in triads:
        for axis, visual in zip("xyz", triad(j, pose, part * size), strict=True):
            shape, color = _solids(visual)[0]
            pieces.append((j, Node(f"{name}:{axis}", visual.pose, shape, color)))
    for j, name in enumerate(table.names if options.names else (), start=1):
        at = se3.translation(0.0, 0.0, 0.125 * size)
        pieces.append((j, Node(f"label:{j}", at, Label(name))))
    return pieces


def _solids(visual: Visual) -> list[tuple[Drawable, Color]]:
    """Drawable parts of a visual; a mesh file's own colours go before the URDF's."""
    own = visual.color or MESH_COLOR
    if isinstance(visual.shape, Mesh):
        return [(part, color or own) for part, color in mesh_parts(visual.shape)]
    return [(visual.shape, own)]


def _frames(model: RobotModel, q: Array, top: str) -> tuple[list[Node], list[str]]:
    """Nodes of R_1..R_f, and the path below which the shapes of each R_j (0: the base) are."""
    table = model.table
    constant = constant_factors(table)
    joint = {int(row): i for i, row in enumerate(table.joint_rows)}
    nodes, paths = [], [top]
    for k, name in enumerate(table.names):
        path = f"{paths[table.antecedent[k]]}/{name.replace('/', '_')}"
        nodes.append(Node(path, constant[k]))
        if k in joint:
            value = float(q[joint[k]])
            path += "/q"
            slides = table.sigma[k] == PRISMATIC
            motion = se3.translation(0.0, 0.0, value) if slides else se3.rotation("z", value)
            nodes.append(Node(path, motion))
        paths.append(path)
    return nodes, paths


def _shapes(
    pieces: _Pieces, frame: int, path: str, color: Color | None, options: Options
) -> list[Node]:
    """Nodes of the pieces of a frame, below a path; links in a colour, or in their own."""
    nodes = []
    for node in (node for where, node in pieces if where == frame):
        is_link = node.path.startswith(_LINK)
        r, g, b, a = color if color and is_link else node.color
        rgba = (r, g, b, a * options.opacity if is_link else a)
        nodes.append(replace(node, path=f"{path}/{node.path}", color=rgba))
    return nodes


def _extent(model: RobotModel, q: Array, pieces: _Pieces) -> Array:
    """Corners of all shapes in the world, in all configurations."""
    R0 = np.broadcast_to(model.base, (len(q), 1, 4, 4))
    poses = np.concatenate((R0, link_poses(model, q)), axis=1)
    points = [poses[:, 0, :3, 3]]
    for frame, node in pieces:
        corners = apply(node.pose, extent(node.shape))
        points.append(apply(poses[:, frame], corners).reshape(-1, 3))
    return np.concatenate(points)


# ---------------------------------------------------------------- closures of looped robots

_FIRST: Color = (0.85, 0.15, 0.20, 0.55)
_SECOND: Color = (0.85, 0.15, 0.20, 1.0)


def with_closures(model: Any, q: Any) -> Any:
    """A looped robot as its tree with shapes for the closures; lists of robots; others as given."""
    if isinstance(model, LoopedRobot):
        return _drawn(model, q)
    if isinstance(model, (list, tuple)):
        many = q if isinstance(q, (list, tuple)) and len(q) == len(model) else [None] * len(model)
        return [with_closures(item, values) for item, values in zip(model, many, strict=True)]
    return model


def _drawn(robot: LoopedRobot, q: Any) -> RobotModel:
    """The tree with the shapes of its links, as long as the motion needs, and of its closures."""
    tree = robot.tree
    table = tree.table
    if isinstance(q, (list, tuple, np.ndarray)) and np.shape(q)[-1:] == (tree.n,):
        table = with_strokes(table, np.reshape(np.asarray(q, np.float64), (-1, tree.n)))
    size = characteristic_length(table, tree.tool)
    shapes = list(tree.visuals or skeleton(table, tree.tool, tree.tip, axes=False))
    for closure in robot.closures:
        for number, frame in enumerate(closure.frames):
            place = tree.twin.frame(frame)
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = place.rotation, place.position
            reach = float(np.linalg.norm(place.position))
            if reach > 0.0:
                start = z_along(place.position / reach)
                shapes += link_rod(place.parent, start, reach, 0.012 * size, size)
            shape = Sphere(0.03 * size) if number else Cylinder(0.045 * size, 0.02 * size)
            shapes.append(Visual(place.parent, pose, shape, _SECOND if number else _FIRST))
    return replace(tree, visuals=tuple(shapes))
