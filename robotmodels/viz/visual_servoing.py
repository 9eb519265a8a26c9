"""Pictures of visual servoing: image paths, errors, velocities, path and view of the camera.

Parameters
----------
run : ServoMotion
    Result of `servo`.
model : RobotModel, optional
    The robot of the run; it moves, and a camera on its tool moves with it.

Returns
-------
matplotlib.figure.Figure or Scene

Examples
--------
>>> from robotmodels.se3 import translation
>>> from robotmodels.visual_servoing import servo, task_3d
>>> run = servo(task_3d(translation(0, 0, 0.5)), translation(0.1, 0, 1), duration=2.0)
>>> [axes.get_xlabel() for axes in plot_servo(run).axes]
['x (1)', 'time (s)', 'time (s)', 'x (m)']
>>> show_servo(run)
<Scene 'visual servoing': 12 shapes>
"""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np

from .. import se3
from .._arrays import Array
from .._choices import as_instance
from ..kinematics import link_poses
from ..model import RobotModel
from ..visual import Box, Color
from ..visual_servoing import Camera as Sensor
from ..visual_servoing import ServoMotion
from . import style
from .camera import framed
from .motion import Motion, Track, keyframes
from .over_time import Unit, is_prismatic
from .robot import Options, draw_robot
from .scene import Scene
from .shapes import Node, Segments, apply, floor_grid, path_node
from .space import across, space
from .style import INK, PAGE, PALE, PALETTE, Figure, Look

_DARK: Color = (0.10, 0.10, 0.10, 1.0)
_LAST: Color = (0.80, 0.10, 0.45, 1.0)
_SQUARE = np.array(((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)))
_VIEW = Sensor(1.0, (0.4, 0.3), (0.8, 0.6))  # type: ignore[arg-type]
"""Drawn for runs without a camera."""


@style.plot
def plot_servo(run: ServoMotion, **look: Unpack[Look]) -> Figure:
    """Image paths, errors and velocities over time, and the path of the camera.

    Circles are the start, crosses the goal. Pixels with the camera of the run, otherwise
    normalised coordinates; features without points show their centre.
    """
    as_instance(run, ServoMotion, "run", " of servo")
    figure, ((image, errors), (speeds, free)) = style.panels(PAGE, 5.4, look, 2, 2)
    free.remove()
    paths, goal = image_paths(run)
    for k, path in enumerate(paths.swapaxes(0, 1)):
        line: dict[str, Any] = {"color": PALETTE[k % 8], "linewidth": 1.2, "markersize": 4.0}
        image.plot(*path.T, "-o", markevery=[0], **line)
    if goal is not None:
        image.plot(*goal.T, "x", color=INK, markersize=5.0, zorder=3.0)
    unit = "1" if run.camera is None else "pixel"
    image.set(xlabel=f"x ({unit})", ylabel=f"y ({unit})", aspect="equal")
    if run.camera is not None:
        image.set(xlim=(0, run.camera.size[0]), ylim=(0, run.camera.size[1]))
    image.invert_yaxis()
    for k, column in enumerate(run.error.T):
        errors.plot(run.t, column, color=PALETTE[k % 8], linewidth=1.0)
    errors.set(xlabel="time (s)", ylabel="error")
    for k, name in enumerate(("vx (m/s)", "vy (m/s)", "vz (m/s)", "wx (rad/s)", "wy", "wz")):
        line = {"color": PALETTE[k % 3], "linestyle": "-" if k < 3 else "--", "linewidth": 1.1}
        speeds.plot(run.t, run.velocity[:, k], label=name, **line)
    speeds.set(xlabel="time (s)", ylabel="camera velocity")
    places, track = apply(run.cameras[0] @ run.T[0], _corners(run)), run.cameras[:, :3, 3]
    points = np.concatenate((track, places))
    axes = space(figure, (2, 2, 4), points, Unit.METRE, across(points))
    axes.plot(*track.T, color=INK, linewidth=1.2)
    axes.plot(*places.T, ".", color=PALE, markersize=4.0)
    view = frustum(run.camera, 0.12 * float(np.ptp(points, axis=0).max() or 1.0))
    for T in run.cameras[[0, -1]]:
        for edge in apply(T, view).reshape(-1, 2, 3):
            axes.plot(*edge.T, color=PALETTE[0], linewidth=0.8)
    return style.finished(figure, look)


def show_servo(
    run: ServoMotion, model: RobotModel | None = None, *, height: int = 480, dark: bool = False
) -> Scene:
    """Scene with the object, the camera's view and path, the robot, and the image beside."""
    as_instance(run, ServoMotion, "run", " of servo")
    places, track = apply(run.cameras[0] @ run.T[0], _corners(run)), run.cameras[:, :3, 3]
    points = np.concatenate((places, track))
    nodes, motion, path, first = list[Node](), None, "camera", run.cameras[0]
    if model is not None and run.q is not None:
        robot = draw_robot(model, run.q[:1], "robots/robot", Options(), [None], run.q)
        nodes += robot.nodes
        points = np.concatenate((points, robot.points))
        t, q = keyframes(run.t, run.q)
        tracks = map(Track, robot.joints, is_prismatic(model).tolist(), [t] * model.n, q.T)
        motion = Motion(tuple(tracks), len(run.t), float(run.t[-1]), True)
        if np.ptp(track, axis=0).max() > 1e-9:  # on the link that carries the tool
            path = f"{robot.frames[model.tip]}/camera"
            first = se3.inverse(link_poses(model, run.q[0])[model.tip - 1]) @ first
    size = float(np.ptp(points, axis=0).max())
    view, body = frustum(run.camera, 0.15 * size), 0.02 * size
    beside, corners = _image_beside(run, points, size)
    nodes += [
        Node(path, first),
        Node(f"{path}/body", np.eye(4), Box((body, body, 2.0 * body)), _DARK),
        Node(f"{path}/view", np.eye(4), Segments(view), _DARK),
        Node("goal", run.cameras[-1], Segments(view), _LAST),
        *path_node("camera", track, size),
        *beside,
    ]
    for k, place in enumerate(places):
        cube = Box((body, body, body))
        nodes.append(Node(f"object/{k + 1}", se3.translation(*place), cube, PALETTE[k % 16]))
    points = np.concatenate((points, corners))
    nodes += floor_grid(points, dark)
    return Scene("visual servoing", tuple(nodes), framed(points), motion, height, dark=dark)


def frustum(camera: Sensor | None, depth: float) -> Array:
    """Edges of the pyramid that a camera sees, pairs of points (16, 3) in its axes."""
    camera = camera or _VIEW
    corners = camera.normalise(_SQUARE * camera.size)
    far = depth * np.c_[corners, np.ones(4)]
    sides = np.stack((np.zeros((4, 3)), far), axis=1)
    return np.concatenate((sides, np.stack((far, np.roll(far, -1, axis=0)), axis=1))).reshape(-1, 3)


def image_paths(run: ServoMotion) -> tuple[Array, Array | None]:
    """Image paths (N, m, 2) of the object's points, in pixels with a camera, and their goal."""
    task = run.task.regulated
    poses = run.T if task.T_desired is None else np.concatenate((run.T, task.T_desired[None]))
    X = apply(poses, _corners(run))
    X = np.where(X[..., 2:] > 0.0, X, np.nan)
    image = X[..., :2] / X[..., 2:]
    if run.camera is not None:
        image = image * run.camera.focal + run.camera.centre
    return image[: len(run.T)], None if task.T_desired is None else image[-1]


def _corners(run: ServoMotion) -> Array:
    """Points of the object in its frame: those of the feature, its centre, or the origin."""
    feature: Any = run.task.regulated.feature
    names = ("object_points", "points", "polygon", "point", "centre")
    given = [getattr(feature, name, None) for name in names]
    found = next((points for points in given if points is not None), np.zeros(3))
    return np.reshape(found, (-1, 3))


def _image_beside(run: ServoMotion, points: Array, size: float) -> tuple[list[Node], Array]:
    """The image upright beside the scene, paths of the points in it, and its corners (4, 3)."""
    paths, goal = image_paths(run)
    reach = np.full(2, 1.1 * float(np.nanmax(np.abs(paths), initial=0.01)))
    first, span = (-reach, 2.0 * reach) if run.camera is None else (0.0 * reach, run.camera.size)
    low, high = points.min(axis=0), points.max(axis=0)
    scale = 0.7 * size / span.max()
    corner = np.array((high[0] + 0.2 * size, low[1], max(low[2], 0.0) + scale * span[1]))

    def drawn(name: str, pairs: Array, color: Color) -> Node:
        flat = scale * (np.clip(pairs.reshape(-1, 2), first, first + span) - first)
        upright = corner + np.c_[flat[:, 0], np.zeros(len(flat)), -flat[:, 1]]
        return Node(f"image/{name}", np.eye(4), Segments(upright), color)

    border = first + span * _SQUARE
    nodes = [drawn("border", np.stack((border, np.roll(border, -1, axis=0)), axis=1), _DARK)]
    for k, path in enumerate(paths.swapaxes(0, 1)):
        path = path[~np.isnan(path[:, 0])]
        if len(path) > 1:
            pairs = np.stack((path[:-1], path[1:]), axis=1)
            nodes.append(drawn(f"{k + 1}", pairs, PALETTE[k % 16]))
    if goal is not None:
        cross = 0.02 * span.max() * np.array(((-1, -1), (1, 1), (-1, 1), (1, -1)))
        nodes.append(drawn("goal", goal[:, None] + cross, _DARK))
    shape = nodes[0].shape
    return nodes, shape.points[::2] if isinstance(shape, Segments) else points
