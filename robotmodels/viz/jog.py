"""A robot that is moved joint by joint."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact
from ..geometry import REVOLUTE
from ..model import RobotModel, check_model
from .compose import as_color, as_opacity, compose, unique_names
from .robot import Look, draw_robot
from .scene import Scene
from .sliders import coupled_posture, coupling, slider_panel

# The first picture has room for each joint turned by this much to either side, rad, or for this
# part of the way to the ends of its stroke.
_TURN, _STROKE = np.radians(25.0), 0.4


def jog(
    model: RobotModel,
    q: ArrayLike | None = None,
    *,
    frames: bool = False,
    names: bool = False,
    tool: bool = True,
    meshes: bool = True,
    color: ArrayLike | None = None,
    opacity: float = 1.0,
    box: ArrayLike | None = None,
    grid: bool = True,
    view: ArrayLike | None = None,
    height: int = 640,
) -> Scene:
    """Draw a robot with a slider for each joint; also called teach, teach panel, joint sliders.

    The page needs no server. Its panel has a slider and a number for each joint (degrees or
    metres) with the joint's limits, the named configurations, and the pose of the tool or of
    another frame. A joint without limits has a slider from -180 to 180 degrees or -1 to 1 m, and
    the panel says so. Numbers outside the limits may be typed; they are marked. Joints that a
    transmission couples (mimic joints) have no slider and follow the others.

    The address of the page may hold a posture, ``arm.html#q=10,-20,0.3``, in the order and the
    units of the sliders; the page keeps it there, so that a link shows a posture.

    Parameters
    ----------
    model : RobotModel
        The robot.
    q : array_like, shape (n,), optional
        Where it is at first, and after Reset: joint variables in radians or metres; default zero.
    frames, names, tool, meshes, opacity, box, grid, view
        As in `show`.
    color : array_like, shape (3,) or (4,), optional
        Of the links.
    height : int
        Of the picture in a notebook, pixels.

    Returns
    -------
    Scene
        Shows itself in a notebook; ``.save("arm.html")`` writes one offline page.

    Raises
    ------
    ShapeError, InvalidValueError
        Wrong joint variables or options; coupled joints that ``q`` puts elsewhere.
    MeshNotFoundError
        A mesh of the source URDF is not where it was looked for.
    MissingExtraError
        A package that draws is not installed.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 1], d=[0, 0.3]))
    >>> jog(arm, [0.5, 0.1])
    <Scene 'robot': 12 shapes, 2 sliders>
    """
    check_model(model)
    start = coupled_posture(model, None if q is None else as_exact(q, (model.n,), "q"))
    rgba = None if color is None else as_color(color)
    look = Look(bool(frames), bool(names), bool(tool), bool(meshes), as_opacity(opacity))
    (label,) = unique_names((model,))
    robot = draw_robot(model, start[None], f"robots/{label}", look, [rgba], _room(model, start))
    panel = slider_panel(model, start, robot.moving, robot.frames)
    return compose(model.name, [robot], [], box, grid, view, height, sliders=panel)


def _room(model: RobotModel, start: Array) -> Array:
    """Postures that the picture must hold: named ones, and each joint moved a little by itself."""
    independent, matrix, _ = coupling(model)
    turns = model.table.sigma[model.table.joint_rows] == REVOLUTE
    low = np.where(turns, start - _TURN, start + _STROKE * (_finite(model.lower, start) - start))
    high = np.where(turns, start + _TURN, start + _STROKE * (_finite(model.upper, start) - start))
    moved = [start, *model.configurations.values()]
    for k, i in enumerate(independent):
        moved += [start + matrix[:, k] * (end - start[i]) for end in (low[i], high[i])]
    return np.stack(moved)


def _finite(limit: Array, start: Array) -> Array:
    return np.where(np.isfinite(limit), limit, start)
