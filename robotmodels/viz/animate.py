"""Moving pictures of robots."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..kinematics import link_poses
from ..model import RobotModel
from ..trajectories.joint_path import JointPath
from ..trajectories.resolved_motion import ResolvedMotion
from ..trajectories.trajectory import Samples, Trajectory
from .compose import as_color, as_many, as_models, as_opacity, compose, unique_names
from .motion import Motion, Track, joint_tracks, keyframes, timed_samples
from .nodes import Node
from .robot import DrawnRobot, Look, draw_robot
from .scene import Scene
from .surroundings import path_node

Moving = ArrayLike | Trajectory | Samples | JointPath | ResolvedMotion

# Postures looked at to find out how much room the motion takes.
_SEEN = 60


def animate(
    model: RobotModel | Sequence[RobotModel],
    q: Moving | Sequence[Moving],
    dt: float | None = None,
    fps: float | None = None,
    *,
    path: bool = False,
    loop: bool = True,
    frames: bool = False,
    names: bool = False,
    tool: bool = True,
    meshes: bool = True,
    color: ArrayLike | None = None,
    opacity: float = 1.0,
    box: ArrayLike | None = None,
    grid: bool = True,
    view: ArrayLike | None = None,
    height: int = 480,
) -> Scene:
    """Draw a robot, or several, that moves; also called play.

    Thousands of samples stay small: each joint keeps the samples between which straight lines
    miss it by less than 0.5 mrad (or 0.05 % of the robot's size).

    Parameters
    ----------
    model : RobotModel or sequence of RobotModel
        The robot, or R robots.
    q : array_like, shape (N, n), or Trajectory, Samples, JointPath or ResolvedMotion
        Joint variables in radians or metres, N >= 2, or a motion with its own times; for several
        robots a list of them. A trajectory is sampled at the frame rate.
    dt : float, optional
        Seconds from one sample to the next; they replace the times of samples that have some.
    fps : float, optional
        Samples a second, instead of ``dt``; default 30.
    path : bool
        Whether the path of the tool is drawn.
    loop : bool
        Whether the motion starts again at its end.
    frames, names, tool, meshes, opacity, box, grid, view, height
        As in `show`.
    color : array_like, shape (3,) or (4,), optional
        Of the links.

    Returns
    -------
    Scene
        ``.motion`` tells the duration and how many keyframes were kept.

    Raises
    ------
    ShapeError, InvalidValueError
        Wrong joint variables or options; what is no motion of joints; a path with poses that are
        not reached.
    MeshNotFoundError
        A mesh of the source URDF is not where it was looked for.
    MissingExtraError
        A package that draws is not installed.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> q = np.linspace([0.0, 0.0], [1.0, 0.5], 1001)
    >>> animate(arm, q, dt=0.002)
    <Scene 'robot': 11 shapes, 2 s from 1001 samples in 4 keyframes>
    >>> from robotmodels.trajectories import quintic
    >>> animate(arm, quintic([0.0, 0.0], [1.0, 0.5], duration=1.5)).motion.duration
    1.5
    """
    models = as_models(model)
    values = as_many(q, model, len(models), "q")
    samples = [timed_samples(v, m.n, dt, fps, "q") for m, v in zip(models, values, strict=True)]
    rgba = None if color is None else as_color(color)
    look = Look(bool(frames), bool(names), bool(tool), bool(meshes), as_opacity(opacity))
    labels = unique_names(models)
    robots: list[DrawnRobot] = []
    tracks: list[Track] = []
    paths: list[Node] = []
    for item, (times, motion), label in zip(models, samples, labels, strict=True):
        some = motion[np.unique(np.linspace(0, len(motion) - 1, _SEEN).astype(int))]
        robot = draw_robot(item, motion[:1], f"robots/{label}", look, [rgba], some)
        tracks += joint_tracks(item, motion, times, robot.moving, robot.size)
        if path:
            points = (link_poses(item, motion)[:, item.tip - 1] @ item.tool)[:, :3, 3]
            keep = keyframes(times, points, 5e-4 * robot.size)
            paths += path_node(label, points[keep], robot.size)
        robots.append(robot)
    count = max(len(motion) for _, motion in samples)
    end = max(float(times[-1]) for times, _ in samples)
    played = Motion(tuple(tracks), count, end, bool(loop))
    return compose(", ".join(labels), robots, paths, box, grid, view, height, played)
