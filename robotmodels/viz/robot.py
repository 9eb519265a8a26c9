"""A robot as nodes: one for each frame of its table, hung on one another as its links are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .. import se3
from .._arrays import Array
from ..geometry import PRISMATIC, DHTable, constant_factors
from ..kinematics import link_poses
from ..model import RobotModel
from ..visual import Color, Mesh, Visual, characteristic_length, skeleton, triad
from .meshes import mesh_parts
from .nodes import Drawable, Label, Node, apply, extent

_MESH_COLOR: Color = (0.72, 0.74, 0.78, 1.0)
_AXIS_NAMES = ("x", "y", "z")


@dataclass(frozen=True, slots=True)
class Look:
    """Parts and colours of a robot to draw."""

    frames: bool = False
    names: bool = False
    tool: bool = True
    meshes: bool = True
    opacity: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class DrawnRobot:
    """The nodes of a robot and what a scene needs to know of them. Shapes: points (k, 3)."""

    nodes: tuple[Node, ...]
    points: Array
    moving: tuple[str, ...]
    size: float
    frames: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class _Piece:
    """A shape that moves with a frame; ``name`` is unique among the pieces of that frame."""

    frame: int
    name: str
    pose: Array
    shape: Drawable
    color: Color
    is_link: bool


def draw_robot(
    model: RobotModel,
    q: Array,
    root: str,
    look: Look,
    colors: Sequence[Color | None],
    seen: Array | None = None,
) -> DrawnRobot:
    """Draw a robot in one or several postures. Shapes: q (N, n), seen (M, n)."""
    table = _limited(model.table, q if seen is None else seen)
    size = characteristic_length(table, model.tool)
    pieces = _pieces(model, table, look, size)
    nodes = [Node(root, model.base)]
    # several postures share what stands still: it keeps its own colour
    own_color = colors[0] if len(q) == 1 else None
    nodes += _shapes([p for p in pieces if p.frame == 0], root, own_color, look.opacity)
    moving: list[str] = []
    hung: list[str] = []
    for k, posture in enumerate(q):
        top = root if len(q) == 1 else f"{root}/posture_{k + 1}"
        if top != root:
            nodes.append(Node(top, np.eye(4)))
        frames, paths = _frames(model, posture, top)
        nodes += frames
        for j in range(1, model.f + 1):
            own = [piece for piece in pieces if piece.frame == j]
            nodes += _shapes(own, paths[j], colors[k], look.opacity)
        if k == 0:
            moving, hung = [paths[row + 1] for row in model.table.joint_rows], paths
    points = _extent(model, q if seen is None else seen, pieces)
    return DrawnRobot(tuple(nodes), points, tuple(moving), size, tuple(hung))


def _limited(table: DHTable, q: Array) -> DHTable:
    """The table with limits for every prismatic joint: where it has none, what the motion needs.

    A skeleton's slides are as long as their strokes.
    """
    needed = (table.sigma[table.joint_rows] == PRISMATIC) & ~np.isfinite(table.upper - table.lower)
    return table.replace(
        lower=np.where(needed, np.minimum(q.min(axis=0), 0.0), table.lower),
        upper=np.where(needed, np.maximum(q.max(axis=0), 0.0), table.upper),
    )


def _pieces(model: RobotModel, table: DHTable, look: Look, size: float) -> list[_Piece]:
    use_visuals = look.meshes and bool(model.visuals)
    visuals = model.visuals if use_visuals else skeleton(table, model.tool, model.tip, axes=False)
    pieces = []
    for i, visual in enumerate(visuals):
        for k, (shape, color) in enumerate(_solids(visual)):
            name = f"shape:{i + 1}.{k + 1}"
            pieces.append(_Piece(visual.frame, name, visual.pose, shape, color, True))
    triads = [(j, np.eye(4), f"R{j}", 0.11) for j in range(1, model.f + 1) if look.frames]
    if look.tool:
        triads.append((model.tip, model.tool, "tool", 0.12))
    for j, pose, name, part in triads:
        for axis, visual in zip(_AXIS_NAMES, triad(j, pose, part * size), strict=True):
            shape, color = _solids(visual)[0]
            pieces.append(_Piece(j, f"{name}:{axis}", visual.pose, shape, color, False))
    if look.names:
        before = [0] * (table.f + 1)
        for j, name in enumerate(table.names, start=1):
            # frames of a wrist share their origin, and often an axis: their names do not
            k, i = j - 1, int(table.antecedent[j - 1])
            if i and not (table.b[k] or table.d[k] or table.r[k] or table.sigma[k] == PRISMATIC):
                before[j] = before[i] + 1
            pose = se3.translation(0.0, 0.0, (0.125 + 0.04 * before[j]) * size)
            label = Label(name, 0.15 * size)
            pieces.append(_Piece(j, f"label:{j}", pose, label, (0.1, 0.1, 0.1, 1.0), False))
    return pieces


def _solids(visual: Visual) -> list[tuple[Drawable, Color]]:
    """The drawable parts of a visual; a mesh file's own colours go before the URDF's."""
    if isinstance(visual.shape, Mesh):
        return [
            (part, color or visual.color or _MESH_COLOR) for part, color in mesh_parts(visual.shape)
        ]
    return [(visual.shape, visual.color or _MESH_COLOR)]


def _frames(model: RobotModel, posture: Array, top: str) -> tuple[list[Node], list[str]]:
    """The nodes of R_1..R_f, and the path of each R_j (0: the top) that its shapes hang on."""
    table = model.table
    constant = constant_factors(table)
    joint = {int(row): i for i, row in enumerate(table.joint_rows)}
    nodes, paths = [], [top]
    for k, name in enumerate(table.names):
        path = f"{paths[table.antecedent[k]]}/{name.replace('/', '_')}"
        nodes.append(Node(path, constant[k]))
        if k in joint:
            value = float(posture[joint[k]])
            path += "/q"
            moved = table.sigma[k] == PRISMATIC
            motion = se3.translation(0.0, 0.0, value) if moved else se3.rotation("z", value)
            nodes.append(Node(path, motion))
        paths.append(path)
    return nodes, paths


def _shapes(pieces: list[_Piece], path: str, color: Color | None, opacity: float) -> list[Node]:
    nodes = []
    for piece in pieces:
        r, g, b, a = piece.color if color is None or not piece.is_link else color
        rgba = (r, g, b, a * opacity if piece.is_link else a)
        nodes.append(Node(f"{path}/{piece.name}", piece.pose, piece.shape, rgba))
    return nodes


def _extent(model: RobotModel, q: Array, pieces: list[_Piece]) -> Array:
    """Corners of all shapes in the world, in all postures."""
    R0 = np.broadcast_to(model.base, (len(q), 1, 4, 4))
    poses = np.concatenate((R0, link_poses(model, q)), axis=1)
    points = [poses[:, 0, :3, 3]]
    for piece in pieces:
        corners = apply(piece.pose, extent(piece.shape))
        points.append(apply(poses[:, piece.frame], corners).reshape(-1, 3))
    return np.concatenate(points)
