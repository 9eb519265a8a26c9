"""Shapes that show a robot: those of a URDF, or a skeleton sized from the table."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import se3
from ._arrays import Array
from .geometry import FIXED, PRISMATIC, REVOLUTE, DHTable

Color = tuple[float, float, float, float]

_LINK_COLOR: Color = (0.62, 0.66, 0.72, 1.0)
_JOINT_COLOR: Color = (0.95, 0.55, 0.15, 1.0)
_SLIDE_COLOR: Color = (0.25, 0.50, 0.80, 1.0)
_BASE_COLOR: Color = (0.30, 0.32, 0.36, 1.0)
_AXIS_COLORS: tuple[Color, Color, Color] = (
    (0.85, 0.15, 0.15, 1.0),
    (0.15, 0.65, 0.20, 1.0),
    (0.15, 0.30, 0.85, 1.0),
)


@dataclass(frozen=True, slots=True)
class Box:
    """A box centred on its origin."""

    size: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Cylinder:
    """A cylinder along z, centred on its origin."""

    radius: float
    length: float


@dataclass(frozen=True, slots=True)
class Sphere:
    """A sphere centred on its origin."""

    radius: float


@dataclass(frozen=True, slots=True)
class Mesh:
    """A mesh file."""

    filename: str
    path: Path | None
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


Shape = Box | Cylinder | Sphere | Mesh


@dataclass(frozen=True, slots=True, eq=False)
class Visual:
    """A shape fixed to a frame."""

    frame: int
    pose: Array
    shape: Shape
    color: Color | None = None


def characteristic_length(table: DHTable, tool: Array) -> float:
    """Characteristic length of a robot: longest branch, tool and longest stroke."""
    lengths = np.abs(table.d) + np.abs(table.r) + np.abs(table.b)
    longest = max((float(lengths[np.array(table.path(j)) - 1].sum())
                   for j in range(1, table.f + 1)), default=0.0)  # fmt: skip
    # a gantry's strokes point in different directions: together they would make thick beams
    strokes = [float(upper - lower) for lower, upper, s in zip(
        table.lower, table.upper, table.sigma[table.joint_rows], strict=True
    ) if s == PRISMATIC and np.isfinite(upper - lower)]  # fmt: skip
    total = longest + float(np.linalg.norm(tool[:3, 3])) + max(strokes, default=0.0)
    return total if total > 1e-6 else 0.5


def skeleton(table: DHTable, tool: Array, tip: int, axes: bool = True) -> tuple[Visual, ...]:
    """Simple shapes for a robot that has none: joints, links, a foot and the tool's axes."""
    size = characteristic_length(table, tool)
    rod, radius = 0.022 * size, 0.036 * size
    shapes = [
        Visual(0, se3.translation(0.0, 0.0, -0.5 * rod), Cylinder(2.2 * radius, rod), _BASE_COLOR)
    ]
    motion = dict(zip(table.joint_rows.tolist(), range(table.n), strict=True))
    # how many joints before this one have their cylinders at the same point
    within = [0] * (table.f + 1)
    for k in range(table.f):
        frame, antecedent = k + 1, int(table.antecedent[k])
        b, d, r = float(table.b[k]), float(table.d[k]), float(table.r[k])
        before = se3.rotation("z", float(table.gamma[k]))
        shapes += link_rod(antecedent, before, b, rod, size)
        before = before @ se3.translation(0.0, 0.0, b) @ se3.rotation("y", float(table.beta[k]))
        shapes += link_rod(antecedent, before @ se3.rotation("y", np.pi / 2), d, rod, size)
        if table.sigma[k] == PRISMATIC:
            i = motion[k]
            low, high = r + float(table.lower[i]), r + float(table.upper[i])
            if not np.isfinite(high - low):
                low, high = r, r + 0.3 * size
            # the bar also reaches back to the antecedent, however far the stroke is from it
            low, high = min(low, 0.0), max(high, 0.0)
            block = Box((2 * radius, 2 * radius, 0.8 * radius))
            carries_slide = (table.sigma[table.antecedent == frame] == PRISMATIC).any()
            if antecedent == 0 or carries_slide:
                start = before @ se3.rotation("x", float(table.alpha[k]))
                start = start @ se3.translation(d, 0.0, 0.0)
                start = start @ se3.rotation("z", float(table.theta[k]))
                shapes.append(_bar(antecedent, start, low, high, radius))
            else:
                shapes.append(_bar(frame, np.eye(4), -high, -low, radius))
            shapes.append(Visual(frame, np.eye(4), block, _JOINT_COLOR))
            continue
        # the rod along r turns about itself, so it may move with the link it leads to
        shapes += link_rod(frame, se3.translation(0.0, 0.0, -r), r, rod, size)
        if table.sigma[k] != FIXED:
            same_point = max(abs(b), abs(d), abs(r)) < 1e-3 * size
            if same_point and antecedent and table.sigma[antecedent - 1] == REVOLUTE:
                within[frame] = within[antecedent] + 1
            thin, long = 0.72 ** within[frame], 1.2 ** within[frame]
            cylinder = Cylinder(thin * radius, 2.6 * long * radius)
            shapes.append(Visual(frame, np.eye(4), cylinder, _JOINT_COLOR))
    reach = float(np.linalg.norm(tool[:3, 3]))
    if reach > 1e-3 * size:
        shapes += link_rod(tip, z_along(tool[:3, 3] / reach), reach, 0.7 * rod, size)
    if axes:
        shapes += triad(tip, tool, 0.1 * size)
    return tuple(shapes)


def triad(frame: int, pose: Array, length: float) -> tuple[Visual, ...]:
    """The three axes of a frame as thin cylinders: x red, y green, z blue."""
    turns = (se3.rotation("y", np.pi / 2), se3.rotation("x", -np.pi / 2), np.eye(4))
    return tuple(
        Visual(frame, pose @ turn @ se3.translation(0.0, 0.0, 0.5 * length),
               Cylinder(0.05 * length, length), color)
        for turn, color in zip(turns, _AXIS_COLORS, strict=True)
    )  # fmt: skip


def link_rod(frame: int, start: Array, length: float, radius: float, size: float) -> list[Visual]:
    """A rod from the origin of ``start`` along its z axis; none if it is too short to see."""
    if abs(length) < 1e-3 * size:
        return []
    pose = start @ se3.translation(0.0, 0.0, 0.5 * length)
    return [Visual(frame, pose, Cylinder(radius, abs(length)), _LINK_COLOR)]


def _bar(frame: int, start: Array, low: float, high: float, radius: float) -> Visual:
    """A square bar along the z axis of ``start``, between two heights."""
    pose = start @ se3.translation(0.0, 0.0, 0.5 * (low + high))
    return Visual(frame, pose, Box((0.9 * radius, 0.9 * radius, high - low)), _SLIDE_COLOR)


def z_along(u: Array) -> Array:
    """A rotation whose z axis is the unit vector ``u``."""
    T = np.eye(4)
    x = np.cross((0.0, 1.0, 0.0) if abs(u[1]) < 0.9 else (1.0, 0.0, 0.0), u)
    x /= np.linalg.norm(x)
    T[:3, :3] = np.column_stack((x, np.cross(u, x), u))
    return T
