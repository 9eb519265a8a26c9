"""Pictures of parallel robots: scenes with legs, platform and home; assembly modes; sections.

Parameters
----------
robot : ParallelRobot
    The robot; its working mode 0 is drawn.
T : array_like, shape (4, 4) or (N, 4, 4), optional
    Pose of the platform, default home; several are played as a motion at 30 a second.
ghost : bool
    Whether the platform at home is drawn transparent.
modes : AssemblyModes
    Of one set of lengths or angles, from `assembly_modes`; ``columns`` of them stand in a row.
workspace : PlatformWorkspace
    From `parallel.workspace`, planar or a section.
title : str, optional
    Of the page; default the family.

Returns
-------
Scene or matplotlib.figure.Figure

Examples
--------
>>> from robotmodels import parallel
>>> hexapod = parallel.gough_symmetric(1.0, lower=0.8, upper=1.4)
>>> show_parallel(hexapod)
<Scene 'Gough-Stewart platform': 36 shapes>
>>> robot = parallel.planar_3rpr([[0, 0], [2, 0], [1, 2]], [[0, 0], [0.5, 0], [0.2, 0.5]], 0.3, 1.5)
>>> modes = parallel.assembly_modes(robot, [1.0, 1.1, 1.2])
>>> plot_assembly_modes(robot, modes).axes[0].get_title()
'1: det -'
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array
from ..errors import InvalidValueError
from ..parallel import AssemblyModes, ParallelRobot, PlatformWorkspace, determinant, igm
from ..parallel.legs import LegStates, knees
from ..parallel.velocities import states
from ..visual import Color, Cylinder, Sphere
from . import style
from .camera import framed
from .motion import Motion, Track
from .scene import Scene
from .shapes import Node, Triangles, along_bars, chain, floor_grid, moving_chain
from .sliders import SliderPanel
from .style import INK, PAGE, PALETTE, Figure, Look

_BASE: Color = (0.45, 0.48, 0.52, 1.0)
_GHOST: Color = (0.5, 0.6, 0.7, 0.22)
_THIN = 0.012


def show_parallel(
    robot: ParallelRobot,
    T: ArrayLike | None = None,
    *,
    ghost: bool = True,
    title: str | None = None,
    height: int = 480,
    dark: bool = False,
) -> Scene:
    """Draw a parallel robot at a pose, with its home pose as a ghost, or play a motion of poses."""
    poses = (robot.home if T is None else robot.checked(T)).reshape(-1, 4, 4)
    points, legs = _points(robot, poses)
    nodes, tracks = _still(robot, points, ghost, dark), list[Track]()
    times = np.arange(len(poses)) / 30.0
    for name, color, width, start, end in _bars(robot, poses, legs):
        bars, moves = moving_chain(name, "xyzzy", times, along_bars(start, end))
        nodes, tracks = nodes + bars, tracks + moves
        length = float(np.linalg.norm(end[0] - start[0]))
        bar = Cylinder(width * _THIN * robot.size, length)
        middle = se3.translation(0, 0, 0.5 * length)
        nodes.append(Node(f"{nodes[-1].path}/bar", middle, bar, color))
    carrier, moves = moving_chain("platform", "xyzzyx", times, _six(poses))
    nodes, tracks = nodes + carrier, tracks + moves
    nodes += _plate(robot, np.eye(4), f"{nodes[-1].path}/plate", PALETTE[0])
    motion = None
    if len(poses) > 1:
        motion = Motion(tuple(tracks), len(poses), (len(poses) - 1) / 30.0, True)
    name = robot.family.value[0] if title is None else title
    return Scene(name, tuple(nodes), framed(points), motion, height=height, dark=dark)


def jog_parallel(
    robot: ParallelRobot, T: ArrayLike | None = None, *, height: int = 640, dark: bool = False
) -> Scene:
    """Draw a robot with legs of variable length and sliders for the pose of its platform.

    The panel shows the lengths of the legs and marks those outside their limits.
    """
    if robot.has_cranks:
        raise InvalidValueError("robot: sliders of the platform need legs of variable length.")
    pose = robot.checked(robot.home if T is None else T)
    points, _ = _points(robot, np.stack((robot.home, pose)))
    platform = chain("platform", "xyzzyx", _six(pose))
    frame = platform[-1].path
    plate = _plate(robot, np.eye(4), f"{frame}/plate", PALETTE[0])
    nodes, struts = [*_still(robot, points, True, dark), *platform, *plate], []
    for i in range(robot.m):
        bar = Cylinder(_THIN * robot.size, 1.0)
        nodes.append(Node(f"leg_{i}", np.eye(4)))
        nodes.append(Node(f"leg_{i}/bar", se3.translation(0, 0, 0.5), bar, PALETTE[1]))
        limits = {"lower": float(robot.lower[i]), "upper": float(min(robot.upper[i], 1e9))}
        ends = {"start": robot.base[i].tolist(), "end": robot.platform[i].tolist()}
        struts.append({"path": f"leg_{i}", "name": f"leg {i}", "frame": frame} | ends | limits)
    start, home, sliders = _six(pose), _six(robot.home), []
    kept = [3 if k == 5 and robot.m == 3 else k for k in robot.columns]  # planar robots: yaw
    for k, name in enumerate(("x", "y", "z", "yaw", "pitch", "roll")):
        reach = 0.4 * robot.size if k < 3 else (0.9 if k == 3 else 0.45) * np.pi
        middle = home[k] if k < 3 else 0.0
        slider = {"name": name, "path": platform[2 * k + 1].path, "prismatic": k < 3}
        slider |= {"lower": -1e9, "upper": 1e9, "ends": [middle - reach, middle + reach]}
        sliders.append(slider | {"leads": k in kept, "note": "" if k in kept else ", constant"})
    matrix = np.eye(6)[:, kept]
    panel = SliderPanel(
        independent=np.array(kept),
        matrix=matrix,
        offset=start * (matrix.sum(axis=1) == 0),
        start=start[kept],
        joints=tuple(sliders),
        postures=(("home", home[kept]),),
        targets=(("platform", frame, np.eye(4)),),
        struts=tuple(struts),
    )
    name = robot.family.value[0]
    return Scene(name, tuple(nodes), framed(points), height=height, sliders=panel, dark=dark)


@style.plot
def plot_assembly_modes(
    robot: ParallelRobot,
    modes: AssemblyModes,
    *,
    columns: int | None = None,
    **look: Unpack[Look],
) -> Figure:
    """All assembly modes beside each other, with the sign of their determinants."""
    T = np.asarray(modes.T)[modes.valid]
    if modes.valid.ndim != 1 or not len(T):
        raise InvalidValueError("modes: expected the assembly modes of one row, at least one.")
    wide = style.as_columns(columns, len(T), min(len(T), 4 if len(T) < 13 else 8))
    rows, flat = -(-len(T) // wide), 2 not in robot.columns
    tall = 0.3 + rows * PAGE / wide * (1.0 if flat else 1.1)
    figure, places = style.panels(PAGE, tall, look, rows, wide)
    a, e = np.deg2rad([-60.0, 22.0])
    above = (-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e))
    view = np.eye(2, 3) if flat else np.array(((-np.sin(a), np.cos(a), 0.0), above))
    base = np.broadcast_to(robot.base, (len(T), robot.m, 3))
    anchors = robot.platform @ np.swapaxes(T[:, :3, :3], 1, 2) + T[:, None, :3, 3]
    paths = np.stack((base, _knees(robot, T), anchors), axis=2) @ view.T
    low, high = paths.min(axis=(0, 1, 2)), paths.max(axis=(0, 1, 2))
    middle, half = 0.5 * (low + high), 0.56 * (high - low).max()
    for k, axes in enumerate(places.flat):
        axes.set_axis_off()
        if k >= len(T):
            continue
        sign = modes.det[modes.valid][k] > 0
        for path in paths[k]:
            axes.plot(*path.T, color="0.45", linewidth=1.0, zorder=2)
        for outline, color in ((base[k], "0.75"), (anchors[k], PALETTE[0 if sign else 1])):
            ring = outline[_ring(outline)] @ view.T
            axes.fill(*ring.T, facecolor=color, alpha=0.5, edgecolor=color, linewidth=1.2, zorder=3)
        axes.plot(*paths[k, :, 0].T, "o", color=INK, markersize=2.0, zorder=4)
        axes.set_title(f"{k + 1}: det {'+' if sign else '-'}", fontsize=7)
        axes.set(xlim=middle[0] + [-half, half], ylim=middle[1] + [-half, half], aspect="equal")
    return style.finished(figure, look)


@style.plot
def plot_platform_workspace(workspace: PlatformWorkspace, **look: Unpack[Look]) -> Figure:
    """A workspace in a plane with the singular curves of its orientation."""
    if workspace.coordinates != "plane":
        raise InvalidValueError("workspace: expected one in a plane; give workspace(height=...).")
    robot: Any = workspace.model
    figure, ((axes,),) = style.panels(0.5 * PAGE, 0.46 * PAGE, look)
    x, y = (np.unique(column) for column in workspace.points.T)
    margin = workspace.margin.reshape(workspace.shape).T
    axes.contourf(x, y, margin, [0.0, max(margin.max(), 1e-9)], colors=[PALETTE[5]], alpha=0.5)
    axes.contour(x, y, margin, levels=[0.0], colors=[PALETTE[0]], linewidths=1.2)
    axes.fill([], [], color=PALETTE[5], alpha=0.5, label="reached")
    det = determinant(robot, workspace.poses).reshape(workspace.shape).T
    if len(workspace.rotations) == 1 and np.nanmin(det) < 0.0 < np.nanmax(det):
        axes.contour(x, y, det, levels=[0.0], colors=[PALETTE[1]], linewidths=1.4)
        axes.plot([], [], color=PALETTE[1], label="singular")
    axes.plot(*robot.base[:, :2].T, "^", color=INK, markersize=4.0, label="base")
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]), aspect="equal", xlabel="x (m)", ylabel="y (m)")
    return style.finished(figure, look, ["reached", "singular", "base"])


def _points(robot: ParallelRobot, T: Array) -> tuple[Array, LegStates]:
    """Points that the picture holds, and the states of the legs."""
    legs = states(robot, None, T)[2]
    anchors = T[:, None, :3, 3] + legs.arm
    every = (robot.base, legs.knee.reshape(-1, 3), anchors.reshape(-1, 3))
    return np.concatenate(every), legs


def _still(robot: ParallelRobot, points: Array, ghost: bool, dark: bool) -> list[Node]:
    """Fixed parts: the platform at its home pose, anchors of the base, the floor."""
    nodes = _plate(robot, robot.home, "home", _GHOST) if ghost else []
    nodes += [_ball(f"base/{i}", p, robot, _BASE, 1.6) for i, p in enumerate(robot.base)]
    return [*nodes, *floor_grid(points, dark)]


Bar = tuple[str, Color, float, Array, Array]
"""Name, colour, width, starts and ends (N, 3)."""


def _bars(robot: ParallelRobot, T: Array, legs: LegStates) -> list[Bar]:
    """Rigid bars of the legs."""
    anchors, bars = T[:, None, :3, 3] + legs.arm, list[Bar]()
    base = np.broadcast_to(robot.base, anchors.shape)
    for i in range(robot.m):
        if robot.has_cranks:
            bars.append((f"crank_{i}", PALETTE[2], 1.0, base[:, i], legs.knee[:, i]))
            side = np.cross(robot.outward, robot.downward)[i] * 0.04 * robot.size
            for k, shift in enumerate((-side, side) if 2 in robot.columns else (0.0 * side,)):
                ends = legs.knee[:, i] + shift, anchors[:, i] + shift
                bars.append((f"rod_{i}_{k}", PALETTE[1], 0.65, *ends))
        else:  # two parts of a strut slide along each other
            u = 0.75 * legs.q[:, i].min() * legs.direction[:, i]
            bars.append((f"cylinder_{i}", PALETTE[2], 1.0, base[:, i], base[:, i] + u))
            bars.append((f"piston_{i}", PALETTE[1], 0.65, anchors[:, i], anchors[:, i] - u))
    return bars


def _six(T: Array) -> Array:
    """Position, yaw, pitch and roll of poses. Shapes: (..., 4, 4) -> (..., 6)."""
    rows = [(*X[:3, 3], *se3.to_rpy(X[:3, :3])[::-1]) for X in T.reshape(-1, 4, 4)]
    return np.array(rows).reshape(*T.shape[:-2], 6)


def _plate(robot: ParallelRobot, T: Array, path: str, color: Color) -> list[Node]:
    """The platform: a polygon of its anchors, and balls at them."""
    points = robot.platform
    balls = [_ball(f"{path}/{i}", p, robot, color, 1.5) for i, p in enumerate(points)]
    nodes = [Node(path, T), *balls]
    if len(ring := _ring(points)) > 2:
        fan = np.array([(ring[0], a, b) for a, b in pairwise(ring[1:])])
        # both sides with their own corners, or their normals would cancel
        faces = np.concatenate((fan, fan[:, ::-1] + len(points)))
        shape = Triangles(np.tile(points, (2, 1)), faces)
        nodes.append(Node(f"{path}/face", np.eye(4), shape, color))
    return nodes


def _ball(path: str, p: Array, robot: ParallelRobot, color: Color, width: float) -> Node:
    return Node(path, se3.translation(*p), Sphere(width * _THIN * robot.size), color)


def _ring(points: Array) -> list[int]:
    """Order of points around their centre."""
    d = points - points.mean(axis=0)
    _, s, Vt = np.linalg.svd(d)
    if s[1] <= 1e-9 * max(s[0], 1e-300):
        return list(np.argsort(d @ Vt[0]))
    return list(np.argsort(np.arctan2(d @ Vt[1], d @ Vt[0]), kind="stable"))


def _knees(robot: ParallelRobot, T: Array) -> Array:
    """Knees of the legs that all assembly modes have in common. Shapes: -> (S, m, 3)."""
    q = np.zeros((1, robot.m))
    if robot.has_cranks:
        every = igm(robot, T).q
        away = np.abs(np.exp(1j * every[0][:, None]) - np.exp(1j * every[-1])).max(axis=-1)
        q = every[0, [np.nanargmin(np.nanmin(away, axis=1))]]
    return np.broadcast_to(knees(robot, q), (len(T), robot.m, 3))
