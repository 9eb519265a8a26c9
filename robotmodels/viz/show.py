"""Pictures of robots: still, moving, with sliders.

Parameters
----------
model : RobotModel, LoopedRobot or sequence of these
    The robot, or R robots that stand where their bases are; `jog` takes one RobotModel.
q : array_like or str
    Joint variables in radians or metres, default zero. `show`: (n,) or (N, n) or the name of one of
    ``model.configurations``; N > 1 postures are drawn together, each in a colour of its own.
    `animate`: (N, n) or (N, 1, n), N >= 2, or a Trajectory, Samples, JointPath or ResolvedMotion
    with its own times. For several robots a list with an entry for each. `jog`: the first posture.
columns : int, optional
    Postures of one robot beside each other, so many in a row, numbered from 1.
legend : sequence of str, optional
    A text for each posture drawn, listed in a corner of the picture with its colour.
ellipsoids : Ellipsoid or sequence of Ellipsoid, optional
    Of velocities or forces, drawn at the tools they belong to; flat ones are discs or bars,
    unbounded ones are cut, their axes go on beyond.
ellipsoid_scale : float, optional
    Metres drawn for 1 m/s, 1 rad/s, 1 N or 1 N m; default a round number, given in the legend.
dt, fps : float, optional
    Seconds from one sample to the next, or samples a second (default 30), in place of the times of
    samples that have some. Motions with more than 30 a second are resampled.
path, loop : bool
    Whether the path of the tool is drawn, and whether the motion starts again at its end.
**options
    Of every scene: frames, names, tool (bool): whether the axes of all frames, their names, the
    axes of the tool are drawn (x red, y green, z blue); meshes (bool): whether the shapes of the
    source URDF are used, otherwise a skeleton sized from the table; color (array_like, shape (3,)
    or (4,)): of the links, red, green, blue and opacity in [0, 1], in `show` also one for each
    posture or robot; opacity (float): of the links, in [0, 1]; box (array_like, shape (6,)):
    workspace to draw, ``xmin, xmax, ymin, ymax, zmin, zmax`` in world axes, m; grid (bool): whether
    the floor z = 0 and the axes of the world are drawn; view; height (int); dark (bool).

Examples
--------
>>> from robotmodels.geometry import DHTable
>>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 1], d=[0, 0.3]))
>>> show(arm, [[0.0, 0.5], [0.4, -0.5]], frames=True)
<Scene 'robot': 31 shapes>
>>> animate(arm, np.linspace([0.0, 0.0], [1.0, 0.5], 1001), dt=0.002)
<Scene 'robot': 12 shapes, 2 s from 1001 samples in 122 keyframes>
>>> jog(arm, [0.5, 0.1])
<Scene 'robot': 12 shapes, 2 sliders>
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, as_count, as_exact, as_floats, as_vector
from .._choices import as_instance, one_of
from ..errors import InvalidValueError, ShapeError
from ..kinematics import link_poses
from ..kinematics.ellipsoid import Ellipsoid
from ..loops import LoopedRobot
from ..model import RobotModel, check_model
from ..trajectories.joint_path import JointPath
from ..trajectories.resolved_motion import ResolvedMotion
from ..trajectories.trajectory import Samples, Trajectory
from ..visual import Color, characteristic_length
from .camera import framed
from .motion import Motion, Track, keyframes, timed_samples
from .over_time import is_prismatic
from .robot import MESH_COLOR, Options, RobotDrawing, draw_robot, with_closures
from .scene import Scene
from .shapes import (
    Label,
    Node,
    as_ellipsoids,
    draw_ellipsoids,
    floor_grid,
    path_node,
    workspace_box,
)
from .sliders import coupled_posture, coupling, slider_panel
from .style import PALETTE, as_texts

Moving = ArrayLike | Trajectory | Samples | JointPath | ResolvedMotion

_SEEN = 60  # configurations used to choose the camera
_FROM_THE_FRONT = (np.radians(-78.0), np.radians(32.0))  # azimuth, elevation
# The picture has room for each joint turned by this much to either side, rad, or moved by this part
# of the way to the ends of its stroke.
_TURN, _STROKE = np.radians(25.0), 0.4


def show(
    model: RobotModel | LoopedRobot | Sequence[RobotModel | LoopedRobot],
    q: ArrayLike | str | Sequence[ArrayLike | str] | None = None,
    *,
    columns: int | None = None,
    legend: Sequence[str] | None = None,
    ellipsoids: Ellipsoid | Sequence[Ellipsoid] | None = None,
    ellipsoid_scale: float | None = None,
    **options: Any,
) -> Scene:
    """Draw a robot, several postures of it over each other, or several robots; also called plot."""
    model, given = with_closures(model, q), Options(**options)
    models = _as_models(model)
    values = _as_many(q, model, len(models))
    postures = [_as_postures(value, item) for item, value in zip(models, values, strict=True)]
    colors = _colors(given.color, [len(p) for p in postures])
    title, key = ", ".join(_unique_names(models)), list[tuple[str, Color]]()
    if legend is not None:
        drawn_colors = [color or MESH_COLOR for each in colors for color in each]
        words = as_texts(legend, len(drawn_colors), "legend", "postures drawn")
        key = list(zip(words, drawn_colors, strict=True))
    drawn, extra = list(models), list[Node]()
    if columns is not None:
        if len(drawn) > 1 or ellipsoids is not None:
            raise InvalidValueError("columns: expected one robot, without ellipsoids.")
        drawn, extra = _side_by_side(drawn[0], postures[0], as_count(columns, "columns", 1))
        postures, colors = [p[None] for p in postures[0]], [[c] for c in colors[0]]
    robots = [
        draw_robot(item, p, f"robots/{label}", given, c)
        for item, p, label, c in zip(drawn, postures, _unique_names(drawn), colors, strict=True)
    ]
    size = max(robot.size for robot in robots)
    nodes, points, more = draw_ellipsoids(as_ellipsoids(ellipsoids), size, ellipsoid_scale)
    robots.append(RobotDrawing(tuple(nodes), points, (), 0.0))
    view = None if columns is None else _FROM_THE_FRONT
    return _scene(title, robots, extra, given, view, legend=(*key, *more))


def animate(
    model: RobotModel | LoopedRobot | Sequence[RobotModel | LoopedRobot],
    q: Moving | Sequence[Moving],
    dt: float | None = None,
    fps: float | None = None,
    *,
    path: bool = False,
    loop: bool = True,
    **options: Any,
) -> Scene:
    """Draw a robot, or several, that moves; also called play."""
    model, given = with_closures(model, q), Options(**options)
    models = _as_models(model)
    values = _as_many(q, model, len(models))
    samples = [timed_samples(v, m.n, dt, fps, "q") for m, v in zip(models, values, strict=True)]
    labels = _unique_names(models)
    robots: list[RobotDrawing] = []
    tracks: list[Track] = []
    paths: list[Node] = []
    for item, (times, motion), label in zip(models, samples, labels, strict=True):
        some = motion[np.unique(np.linspace(0, len(motion) - 1, _SEEN).astype(int))]
        colors = _colors(given.color, [1])[0]
        robot = draw_robot(item, motion[:1], f"robots/{label}", given, colors, some)
        t, kept = keyframes(times, motion)
        slides = is_prismatic(item).tolist()
        tracks += map(Track, robot.joints, slides, [t] * item.n, kept.T)
        if path:
            tips = link_poses(item, kept)[:, item.tip - 1] @ item.tool
            paths += path_node(label, tips[:, :3, 3], robot.size)
        robots.append(robot)
    count = max(len(motion) for _, motion in samples)
    end = max(float(times[-1]) for times, _ in samples)
    played = Motion(tuple(tracks), count, end, bool(loop))
    return _scene(", ".join(labels), robots, paths, given, motion=played)


def jog(model: RobotModel, q: ArrayLike | str | None = None, **options: Any) -> Scene:
    """Draw a robot with a slider for each joint; also called teach, teach panel, joint sliders.

    The page needs no server. Its panel has a slider and a number for each joint (degrees or
    metres) with the joint's limits, the named configurations, and the pose of the tool or of
    another frame. A joint without limits has a slider from -180 to 180 degrees or -1 to 1 m, and
    the panel marks it. Numbers outside the limits may be typed; they are marked. Joints that a
    transmission couples (mimic joints) have no slider and follow the others.
    """
    check_model(model)
    options.setdefault("height", 640)
    given, first = Options(**options), _named(q, model)
    start = coupled_posture(model, None if first is None else as_exact(first, (model.n,), "q"))
    (label,) = _unique_names((model,))
    colors, seen = _colors(given.color, [1])[0], _neighbourhood(model, start)
    robot = draw_robot(model, start[None], f"robots/{label}", given, colors, seen)
    panel = slider_panel(model, start, robot.joints, robot.frames)
    return _scene(model.name, [robot], [], given, sliders=panel)


def _scene(
    title: str,
    robots: Sequence[RobotDrawing],
    extra: Sequence[Node],
    options: Options,
    view: tuple[float, float] | None = None,
    **more: Any,
) -> Scene:
    """Robots, extra nodes and their surroundings as a scene that they fill."""
    points: Array = np.concatenate([robot.points for robot in robots])
    nodes = [node for robot in robots for node in robot.nodes]
    nodes += extra
    if options.box is not None:
        box_nodes, corners = workspace_box(options.box)
        nodes += box_nodes
        points = np.concatenate((points, corners))
    if options.grid:
        nodes += floor_grid(points, options.dark)
    if options.view is not None:
        view = as_exact(options.view, (2,), "view").tolist()
    camera = framed(points, view)
    look = {"height": options.height, "dark": bool(options.dark)}
    return Scene(title, tuple(nodes), camera, **look, **more)


def _side_by_side(model: RobotModel, q: Array, wide: int) -> tuple[list[RobotModel], list[Node]]:
    """Copies of the robot, one for each posture, in rows with numbers. Shapes: q (N, n)."""
    size = characteristic_length(model.table, model.tool)
    poses = link_poses(model, q)
    ends = poses[:, model.tip - 1] @ model.tool
    points = np.concatenate((poses[..., :3, 3].reshape(-1, 3), ends[:, :3, 3], [model.base[:3, 3]]))
    low, high = points.min(axis=0), points.max(axis=0)
    step = high - low + 0.25 * size
    step[1] = max(step[1], 1.2 * (high[2] - low[2]))  # or a row would hide the one behind it
    robots, numbers = [], []
    for k in range(len(q)):
        row, column = divmod(k, wide)
        shift = se3.translation(column * step[0], -row * step[1], 0.0)
        robots.append(model.with_base(shift @ model.base))
        foot = shift @ se3.translation(*(model.base[:3, 3] - (0.0, 0.32 * size, 0.0)))
        numbers.append(Node(f"numbers/{k + 1}", foot, Label(str(k + 1), large=True)))
    return robots, numbers


def _neighbourhood(model: RobotModel, start: Array) -> Array:
    """Named configurations, and the first one with each joint moved a little. Shapes: -> (M, n)."""
    independent, matrix, _ = coupling(model)
    moved = [start, *model.configurations.values()]
    slides = is_prismatic(model)
    for limit, sign in ((model.lower, -1.0), (model.upper, 1.0)):
        to_limit = np.where(np.isfinite(limit), limit - start, 0.0)
        step = np.where(slides, _STROKE * to_limit, sign * _TURN)
        moved += [start + matrix[:, k] * step[i] for k, i in enumerate(independent)]
    return np.stack(moved)


def _as_models(model: Any) -> tuple[RobotModel, ...]:
    """One model or several, as a tuple."""
    models = model if isinstance(model, (tuple, list)) and model else (model,)
    return tuple(as_instance(item, RobotModel, "model", " or a list of them") for item in models)


def _as_many(value: Any, model: object, count: int) -> tuple[Any, ...]:
    """An entry of q for each robot: the value itself for one model, its items for several."""
    if isinstance(model, RobotModel):
        return (value,)
    if value is None or isinstance(value, str):
        return (value,) * count
    if not hasattr(value, "__len__") or len(value) != count:
        raise ShapeError(f"q: expected a list with one entry for each of the {count} robots.")
    return tuple(value)


def _named(q: ArrayLike | str | None, model: RobotModel) -> ArrayLike | None:
    """The configuration of this name; anything but a text as it is."""
    if not isinstance(q, str):
        return q
    name = one_of(q, tuple(model.configurations), "q")
    return model.configurations[name]


def _as_postures(value: ArrayLike | str | None, model: RobotModel) -> Array:
    """Joint variables as (N, n), N at least 1."""
    given = _named("zero" if value is None else value, model)
    q = as_vector(np.zeros(model.n) if given is None else given, model.n, "q")
    if q.ndim > 2 or not q.shape[0]:
        raise ShapeError(
            f"q: expected one posture ({model.n},) or several (N, {model.n}), got {q.shape}."
        )
    return q.reshape(-1, model.n)


def _colors(color: Any, counts: list[int]) -> list[list[Color | None]]:
    """A colour, or None for the links' own, for each posture of each robot."""
    if color is None:
        hues = [PALETTE[k % len(PALETTE)] for k in range(max(counts))]
        return [[None] if count == 1 else [*hues[:count]] for count in counts]
    many = hasattr(color, "__len__") and len(color) > 0 and hasattr(color[0], "__len__")
    each = [_as_color(one) for one in color] if many else [_as_color(color)]
    places = len(counts) if len(counts) > 1 else counts[0]
    if len(each) not in (1, places):
        wanted = f"{places} {'robots' if len(counts) > 1 else 'postures'}"
        raise ShapeError(f"color: expected one, or one for each of the {wanted}, got {len(each)}.")
    each = each * places if len(each) == 1 else each
    if len(counts) > 1:
        return [[one] * count for one, count in zip(each, counts, strict=True)]
    return [[*each]]


def _as_color(value: Any) -> Color:
    """A colour, checked. Shapes: value (3,) or (4,)."""
    numbers = as_floats(value, "color")
    if numbers.shape not in ((3,), (4,)):
        raise ShapeError(f"color: expected (r, g, b) or (r, g, b, a), got shape {numbers.shape}.")
    if numbers.min() < 0 or numbers.max() > 1:
        raise InvalidValueError(f"color: expected numbers from 0 to 1, got {numbers.tolist()}.")
    r, g, b, a = (*numbers.tolist(), 1.0)[:4]
    return r, g, b, a


def _unique_names(models: Sequence[RobotModel]) -> tuple[str, ...]:
    """A name for each robot in the scene: its own, with a number if another one has it."""
    names: list[str] = []
    for model in models:
        own = model.name.replace("/", "_")
        tried = (own if k == 1 else f"{own}_{k}" for k in range(1, len(models) + 1))
        names.append(next(name for name in tried if name not in names))
    return tuple(names)
