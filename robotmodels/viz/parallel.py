"""Pictures of parallel robots: scenes with legs, platform and home; assembly modes; sections.

Parameters
----------
robot : ParallelRobot
    The robot; its working mode 0 is drawn.

Raises
------
InvalidValueError, ShapeError
    Poses out of reach, arguments that do not fit.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array
from ..errors import InvalidValueError
from ..parallel import AssemblyModes, ParallelRobot, PlatformWorkspace, determinant
from ..parallel.legs import LegStates
from ..parallel.velocities import states
from ..visual import Color, Cylinder, Sphere
from . import style
from .camera import framed
from .motion import Motion, Track, keyframes
from .scene import Scene
from .shapes import Node, Triangles, floor_grid
from .sliders import SliderPanel
from .style import INK, PAGE, PALETTE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
    """Draw a parallel robot at a pose, with its home pose as a ghost, or play a motion of poses.

    Parameters
    ----------
    robot
        See the head of the file.
    T : array_like, shape (4, 4) or (N, 4, 4), optional
        Pose of the platform, default home; several are played as a motion at 30 a second.
    ghost : bool
        Whether the platform at home is drawn transparent.
    title : str, optional
        Of the page; default the family.
    height : int
        Pixels in a notebook.
    dark : bool
        Whether the background is dark.

    Returns
    -------
    Scene
        Shows itself in a notebook; ``.save("hexapod.html")`` writes one offline page.

    Examples
    --------
    >>> from robotmodels.parallel import gough_symmetric
    >>> show_parallel(gough_symmetric(1.0))
    <Scene 'Gough-Stewart platform': 36 shapes>
    """
    poses = (robot.home if T is None else robot.checked(T)).reshape(-1, 4, 4)
    points, legs = _points(robot, poses)
    nodes = _plate(robot, robot.home, "home", _GHOST) if ghost else []
    nodes += [_ball(f"base/{i}", p, robot, _BASE, 1.6) for i, p in enumerate(robot.base)]
    tracks: list[Track] = []
    for name, color, start, end in _bars(robot, poses, legs):
        bars = _between(start, end)
        length = float(np.linalg.norm(end[0] - start[0], axis=-1))
        middle = se3.translation(0, 0, 0.5 * length)
        nodes += _placed(name, bars, tracks)
        path = nodes[-1].path
        width = _THIN * robot.size * (0.65 if "piston" in name or "rod" in name else 1.0)
        nodes.append(Node(f"{path}/bar", middle, Cylinder(width, length), color))
    nodes += _placed("platform", poses, tracks)
    nodes += _plate(robot, np.eye(4), f"{nodes[-1].path}/plate", PALETTE[0])
    nodes += floor_grid(points, dark)
    motion = None
    if len(poses) > 1:
        motion = Motion(tuple(tracks), len(poses), (len(poses) - 1) / 30.0, True)
    name = robot.family.value[0] if title is None else title
    return Scene(name, tuple(nodes), framed(points), motion, height=height, dark=dark)


def jog_parallel(
    robot: ParallelRobot, T: ArrayLike | None = None, *, height: int = 640, dark: bool = False
) -> Scene:
    """Draw a robot with legs of variable length and sliders for the pose of its platform.

    Parameters
    ----------
    robot
        See the head of the file.
    T : array_like, shape (4, 4), optional
        First pose; default home.
    height : int
        Pixels in a notebook.
    dark : bool
        Whether the background is dark.

    Returns
    -------
    Scene
        The panel shows the lengths of the legs and marks those outside their limits.

    Examples
    --------
    >>> from robotmodels.parallel import gough_symmetric
    >>> jog_parallel(gough_symmetric(1.0, lower=0.8, upper=1.4))
    <Scene 'Gough-Stewart platform': 30 shapes, 6 sliders>
    """
    if robot.has_cranks:
        raise InvalidValueError("robot: sliders of the platform need legs of variable length.")
    pose = robot.checked(robot.home if T is None else T)
    points, _ = _points(robot, np.stack((robot.home, pose)))
    nodes = _plate(robot, robot.home, "home", _GHOST)
    nodes += [_ball(f"base/{i}", p, robot, _BASE, 1.6) for i, p in enumerate(robot.base)]
    chain = _chain("platform", pose)
    nodes += chain
    joints = [node.path for node in chain[1::2]]
    frame = nodes[-1].path
    nodes += _plate(robot, np.eye(4), f"{frame}/plate", PALETTE[0])
    struts = []
    for i in range(robot.m):
        bar = Cylinder(_THIN * robot.size, 1.0)
        nodes.append(Node(f"leg_{i}", np.eye(4)))
        nodes.append(Node(f"leg_{i}/bar", se3.translation(0, 0, 0.5), bar, PALETTE[1]))
        struts.append({
            "path": f"leg_{i}", "name": f"leg {i}", "start": robot.base[i].tolist(),
            "end": robot.platform[i].tolist(), "lower": float(robot.lower[i]),
            "upper": float(min(robot.upper[i], 1e9)), "frame": frame,
        })  # fmt: skip
    nodes += floor_grid(points, dark)
    start, home = _six(pose), _six(robot.home)
    kept = [k for k in range(6) if k in robot.columns]
    matrix = np.eye(6)[:, kept]
    names = ("x", "y", "z", "yaw", "pitch", "roll")
    panel = SliderPanel(
        np.array(kept), matrix, start * (matrix.sum(axis=1) == 0), start[kept],
        tuple(_slider(k, names[k], joints[k], home[k], robot.size, k in kept) for k in range(6)),
        (("home", home[kept]),), (("platform", frame, np.eye(4)),), tuple(struts),
    )  # fmt: skip
    camera = framed(points)
    title = robot.family.value[0]
    return Scene(title, tuple(nodes), camera, height=height, sliders=panel, dark=dark)


@style.plot
def plot_assembly_modes(
    robot: ParallelRobot,
    modes: AssemblyModes,
    *,
    columns: int | None = None,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """All assembly modes beside each other, with the sign of their determinants.

    Parameters
    ----------
    robot
        See the head of the file.
    modes : AssemblyModes
        Of one set of lengths or angles, from `assembly_modes`.
    columns : int, optional
        How many stand in a row.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.

    Examples
    --------
    >>> from robotmodels.parallel import assembly_modes, planar_3rpr
    >>> robot = planar_3rpr([[0, 0], [15.91, 0], [0, 10]], [[0, 0], [17.04, 0], [13.23, 16.1]])
    >>> len(plot_assembly_modes(robot, assembly_modes(robot, [14.98, 15.38, 12.0])).axes)
    8
    """
    T = np.asarray(modes.T)[modes.valid]
    if modes.valid.ndim != 1 or not len(T):
        raise InvalidValueError("modes: expected the assembly modes of one row, at least one.")
    wide = style.as_columns(columns, len(T), min(len(T), 4 if len(T) < 13 else 8))
    rows, flat = -(-len(T) // wide), 2 not in robot.columns
    figure, places = style.panels(
        PAGE, 0.3 + rows * PAGE / wide * (1.0 if flat else 1.1), size, rows, wide
    )
    # rods of the same knees for all modes, whatever the mode of their cranks is
    legs = np.stack([_anchors(robot, pose) for pose in T])
    q = _knees(robot, modes, T)
    points = np.concatenate((legs.reshape(-1, 3), robot.base, q.reshape(-1, 3)))
    x, y = points @ _view(flat).T[:, 0], points @ _view(flat).T[:, 1]
    half = 0.56 * max(np.ptp(x), np.ptp(y))
    for k, axes in enumerate(places.flat):
        axes.set_axis_off()
        if k >= len(T):
            continue
        det = modes.det[modes.valid][k]
        color = PALETTE[0] if det > 0 else PALETTE[1]
        for i in range(robot.m):
            path = np.array((robot.base[i], q[k, i], legs[k, i])) @ _view(flat).T
            axes.plot(*path.T, color="0.45", linewidth=1.0, zorder=2)
        for outline, look in ((robot.base, "0.75"), (legs[k], color)):
            ring = outline[_ring(outline)] @ _view(flat).T
            axes.fill(*ring.T, facecolor=look, alpha=0.5, edgecolor=look, linewidth=1.2, zorder=3)
        axes.plot(*(robot.base @ _view(flat).T).T, "o", color=INK, markersize=2.0, zorder=4)
        axes.set_title(f"{k + 1}: det {'+' if det > 0 else '-'}", fontsize=7)
        axes.set_xlim(0.5 * (x.min() + x.max()) - half, 0.5 * (x.min() + x.max()) + half)
        axes.set_ylim(0.5 * (y.min() + y.max()) - half, 0.5 * (y.min() + y.max()) + half)
        axes.set_aspect("equal")
    return style.finished(figure, title)


@style.plot
def plot_platform_workspace(
    workspace: PlatformWorkspace, *, title: str | None = None, size: ArrayLike | None = None
) -> Figure:
    """A workspace in a plane with the singular curves of its orientation.

    Parameters
    ----------
    workspace : PlatformWorkspace
        From `parallel.workspace`, planar or a section.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.

    Examples
    --------
    >>> from robotmodels.parallel import planar_3rpr
    >>> from robotmodels import parallel
    >>> robot = planar_3rpr([[0, 0], [2, 0], [1, 2]], [[0, 0], [0.5, 0], [0.2, 0.5]], 0.3, 1.5)
    >>> figure = plot_platform_workspace(parallel.workspace(robot, orientation=0.3, resolution=50))
    >>> figure.axes[0].get_xlabel()
    'x (m)'
    """
    if workspace.coordinates != "plane":
        raise InvalidValueError("workspace: expected one in a plane; give workspace(height=...).")
    robot: Any = workspace.model
    figure, places = style.panels(0.5 * PAGE, 0.46 * PAGE, size, 1, 1)
    axes = places.flat[0]
    x, y = (np.unique(column) for column in workspace.points.T)
    margin = workspace.margin.reshape(workspace.shape).T
    inside = [0.0, max(margin.max(), 1e-9)]
    axes.contourf(x, y, margin, levels=inside, colors=[PALETTE[5]], alpha=0.5)
    axes.contour(x, y, margin, levels=[0.0], colors=[PALETTE[0]], linewidths=1.2)
    names = ["reached"]
    axes.fill([], [], color=PALETTE[5], alpha=0.5, label="reached")
    det = determinant(robot, workspace.poses).reshape(workspace.shape).T
    if len(workspace.rotations) == 1 and np.nanmin(det) < 0.0 < np.nanmax(det):
        axes.contour(x, y, det, levels=[0.0], colors=[PALETTE[1]], linewidths=1.4)
        axes.plot([], [], color=PALETTE[1], label="singular")
        names.append("singular")
    axes.plot(*robot.base[:, :2].T, "^", color=INK, markersize=4.0, label="base")
    axes.set_aspect("equal")
    axes.set_xlim(x[0], x[-1])
    axes.set_ylim(y[0], y[-1])
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    return style.finished(figure, title, [*names, "base"])


def _points(robot: ParallelRobot, T: Array) -> tuple[Array, LegStates]:
    """Points that the picture holds, and the states of the legs."""
    legs = states(robot, None, T)[2]
    anchors = T[:, None, :3, 3] + legs.arm
    every = (robot.base, legs.knee.reshape(-1, 3), anchors.reshape(-1, 3))
    return np.concatenate(every), legs


def _bars(robot: ParallelRobot, T: Array, legs: LegStates) -> list[tuple[str, Color, Array, Array]]:
    """Rigid bars of the legs: name, colour, starts and ends (N, 3)."""
    anchors, bars = T[:, None, :3, 3] + legs.arm, []
    base = np.broadcast_to(robot.base, anchors.shape)
    least = np.linalg.norm(anchors - base, axis=-1).min(axis=0)
    for i in range(robot.m):
        if robot.has_cranks:
            bars.append((f"crank_{i}", PALETTE[2], base[:, i], legs.knee[:, i]))
            side = np.cross(robot.outward, robot.downward)[i] * 0.04 * robot.size
            pair = (-side, side) if 2 in robot.columns else (0.0 * side,)
            for k, shift in enumerate(pair):
                start, end = legs.knee[:, i] + shift, anchors[:, i] + shift
                bars.append((f"rod_{i}_{k}", PALETTE[1], start, end))
        else:  # two parts of a strut slide along each other
            u = 0.75 * least[i] * legs.direction[:, i]
            bars.append((f"cylinder_{i}", PALETTE[2], base[:, i], base[:, i] + u))
            bars.append((f"piston_{i}", PALETTE[1], anchors[:, i], anchors[:, i] - u))
    return bars


def _between(start: Array, end: Array) -> Array:
    """Poses at the starts of bars whose z axes point to their ends. Shapes: (N, 3) -> (N, 4, 4)."""
    z = end - start
    z = z / np.linalg.norm(z, axis=1)[:, None]
    yaw, pitch = np.unwrap(np.arctan2(z[:, 1], z[:, 0])), np.arccos(np.clip(z[:, 2], -1.0, 1.0))
    pairs = zip(yaw, pitch, strict=True)
    T = np.array([se3.rotation("z", a) @ se3.rotation("y", b) for a, b in pairs])
    T[:, :3, 3] = start
    return T


def _six(T: Array) -> Array:
    """Position, yaw, pitch and roll of poses. Shapes: (..., 4, 4) -> (..., 6)."""
    rows = [(*X[:3, 3], *se3.to_rpy(X[:3, :3])[::-1]) for X in T.reshape(-1, 4, 4)]
    return np.array(rows).reshape(*T.shape[:-2], 6)


_AXES = {"x": se3.rotation("y", 0.5 * np.pi), "y": se3.rotation("x", -0.5 * np.pi), "z": np.eye(4)}


def _chain(path: str, T: Array) -> list[Node]:
    """Nodes of three slides and three turns about z, y, x, each below one that aligns its axis."""
    nodes, here, last = [], path, np.eye(4)
    for k, (axis, value) in enumerate(zip("xyzzyx", _six(T), strict=True)):
        align = se3.inverse(last) @ _AXES[axis]
        here = f"{here}/{k}a" if k else here
        nodes.append(Node(here, align))
        here = f"{here}/{k}"
        moved = se3.translation(0, 0, value) if k < 3 else se3.rotation("z", value)
        nodes.append(Node(here, moved))
        last = _AXES[axis]
    return [*nodes, Node(f"{here}/end", se3.inverse(last))]


def _placed(path: str, T: Array, tracks: list[Track]) -> list[Node]:
    """A node at a pose, or nodes that follow poses (N, 4, 4), with their tracks."""
    if len(T) == 1:
        return [Node(path, T[0])]
    nodes, values = _chain(path, T[0]), _six(T)
    values[:, 3:] = np.unwrap(values[:, 3:], axis=0)
    times, values = keyframes(np.arange(len(T)) / 30.0, values)
    for k, node in enumerate(nodes[1:-1:2]):
        tracks.append(Track(node.path, k < 3, times, values[:, k]))
    return nodes


def _plate(robot: ParallelRobot, T: Array, path: str, color: Color) -> list[Node]:
    """The platform: a polygon of its anchors, and balls at them."""
    points = robot.platform
    balls = [_ball(f"{path}/{i}", p, robot, color, 1.5) for i, p in enumerate(points)]
    nodes = [Node(path, T), *balls]
    if len(ring := _ring(points)) > 2:
        fan = np.array([(ring[0], a, b) for a, b in pairwise(ring[1:])])
        # both sides with their own corners, or their normals would cancel
        faces = np.concatenate((fan, fan[:, ::-1] + len(points))).astype(np.uint32)
        shape = Triangles(np.tile(points, (2, 1)).astype(np.float32), faces)
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


def _anchors(robot: ParallelRobot, T: Array) -> Array:
    return robot.platform @ T[:3, :3].T + T[:3, 3]


def _knees(robot: ParallelRobot, modes: AssemblyModes, T: Array) -> Array:
    """Knees of the legs, on the base without cranks. Shapes: -> (S, m, 3)."""
    if not robot.has_cranks:
        return np.broadcast_to(robot.base, (len(T), robot.m, 3))
    from ..parallel import igm
    from ..parallel.legs import knees

    # the angles that all assembly modes have in common
    every = igm(robot, T)
    first, last = every.q[0], every.q[-1]
    away = np.abs(np.exp(1j * first[:, None]) - np.exp(1j * last)).max(axis=-1)
    best = first[np.nanargmin(np.nanmin(away, axis=1))]
    return np.broadcast_to(knees(robot, best), (len(T), robot.m, 3))


def _view(flat: bool) -> Array:
    """Projection on the picture, shape (2, 3)."""
    if flat:
        return np.eye(2, 3)
    a, e = np.deg2rad([-60.0, 22.0])
    return np.array(
        ((-np.sin(a), np.cos(a), 0.0), (-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)))
    )


def _slider(k: int, name: str, path: str, home: float, size: float, leads: bool) -> dict[str, Any]:
    """A component of the pose as data of the panel."""
    reach = 0.4 * size if k < 3 else (np.pi if k == 3 else 0.5 * np.pi) * 0.9
    ends = (home - reach, home + reach) if k < 3 else (-reach, reach)
    return {
        "name": name, "path": path, "prismatic": k < 3, "lower": -1e9, "upper": 1e9,
        "ends": list(ends), "leads": leads, "note": "" if leads else "constant",
    }  # fmt: skip
