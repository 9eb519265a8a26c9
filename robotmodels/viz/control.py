"""Figures and scenes of controlled robots: errors, torques and forces, sliding surfaces, arrows.

Panels of a force that is zero all the time, and of a law without Lyapunov function, are left out.

Parameters
----------
run : ControlledMotion
    As `robotmodels.control.run` gives it; for `plot_surface` of a law with a surface.
walls : SpringWall or sequence of SpringWall
    Walls that are drawn.
length : float, optional
    Length of the arrow of the largest force, m; default some part of the scene.

Returns
-------
matplotlib.figure.Figure or Scene

References
----------
Book sections 5.2.3 and 5.3.2.

Examples
--------
>>> from robotmodels.control import ComputedTorque, run
>>> from robotmodels.robots import load
>>> arm = load("rx90")
>>> law = ComputedTorque(np.full(6, 0.1), model=arm)
>>> motion = run(arm, law, np.zeros(6), t=0.5)
>>> [axes.get_ylabel() for axes in plot_control(motion).axes]
['error', 'torque (N m)', 'V']
>>> animate_control(motion).motion.duration
0.5
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Unpack

import numpy as np

from .. import se3
from .._arrays import Array, as_number
from .._choices import as_instance
from ..control import ControlledMotion, SpringWall
from ..errors import InvalidValueError
from ..kinematics import dgm
from ..trajectories import Samples
from ..visual import Box, Cylinder, z_along
from . import over_time, style
from .motion import Track, keyframes
from .scene import Scene
from .shapes import Node, Triangles, along_bars, moving_chain
from .show import animate
from .style import Figure, Look

_COMPONENTS = np.array(["x", "y", "z", "rx", "ry", "rz"])
_FORCES = np.array(["fx", "fy", "fz", "mx", "my", "mz"])
_PIECES = 8  # of the shaft of an arrow
_ARROW = (0.85, 0.2, 0.1, 1.0)
_WALL = (0.45, 0.55, 0.7, 0.45)


def _as_run(run: Any) -> ControlledMotion:
    """The run, checked."""
    return as_instance(run, ControlledMotion, "run", " of control.run")


@style.plot
def plot_control(run: ControlledMotion, **look: Unpack[Look]) -> Figure:
    """Error, torques, force on the environment and Lyapunov function of a run over time."""
    model = _as_run(run).simulation.model
    names, efforts = over_time.joint_names(None, model.n, model), over_time.effort_units(model)
    count = run.error.shape[1]
    rows = getattr(getattr(run.law, "inner", run.law), "rows", ())
    errors = names if count == len(names) else [f"component {k + 1}" for k in range(count)]
    if getattr(run.law, "space", "") != "joint" and len(rows) == count:
        errors = _COMPONENTS[rows].tolist()
    unit = " or ".join(u for u in ("N m", "N") if u in efforts)
    felt = np.abs(run.wrench).max(axis=0) > 1e-9 * max(np.abs(run.wrench).max(), 1e-9)
    force = "force, moment\n(N, N m)" if felt[3:].any() else "force (N)"
    V = np.empty((len(run.t), 0)) if run.lyapunov is None else run.lyapunov[:, None]
    panels = [
        ("error", run.error, errors),
        (f"torque ({unit})", run.tau, names),
        (force, run.wrench[:, felt], _FORCES[felt].tolist()),
        ("V", V, ["V"]),
    ]
    return _figure(run.t, [panel for panel in panels if panel[1].size], look)


@style.plot
def plot_surface(run: ControlledMotion, **look: Unpack[Look]) -> Figure:
    """The surface ``s = e' + slope e`` of sliding modes, passivity and adaptive control."""
    if (s := _as_run(run).surface) is None:
        raise InvalidValueError(
            f"run: {type(run.law).__name__} has no surface; sliding modes, passivity and adaptive "
            "control have one."
        )
    names = over_time.joint_names(None, s.shape[1], run.simulation.model)
    return _figure(run.t, [("s (rad/s or m/s)", s, names)], look)


def animate_control(
    run: ControlledMotion,
    *,
    walls: SpringWall | Sequence[SpringWall] = (),
    length: float | None = None,
    **options: Any,
) -> Scene:
    """Draw the robot of a run as it moves, with the force on the environment as an arrow."""
    sim, still = _as_run(run).simulation, 0.0 * run.q
    moving = animate(sim.model, Samples(run.t, run.q, run.v, sim.a, still), **options)
    assert moving.motion is not None
    tips, size = dgm(sim.model, run.q)[:, :3, 3], 0.15 * moving.camera.distance
    size = size if length is None else as_number(length, "length", above=0.0)
    nodes, tracks = _arrow(run.t - run.t[0], tips, run.wrench[:, :3], size)
    given = tuple(walls) if isinstance(walls, (list, tuple)) else (walls,)
    given = [as_instance(wall, SpringWall, "walls", " of control") for wall in given]
    nodes += [_wall(wall, tips, size, f"walls/{k}") for k, wall in enumerate(given, 1)]
    motion = replace(moving.motion, tracks=(*moving.motion.tracks, *tracks))
    return replace(moving, nodes=(*moving.nodes, *nodes), motion=motion)


def _figure(t: Array, panels: Sequence[tuple[str, Array, list[str]]], look: Look) -> Figure:
    """Panels over each other with one axis of time."""
    figure, grid = style.panel_list(len(panels), 1, 1.6, look)
    shown = [""]
    for axes, (label, values, names) in zip(grid, panels, strict=True):
        # hidden from the legend of the figure: each panel has its own
        over_time.lines_over_time(axes, t, values, [f"_{name}" for name in names], zero=True)
        axes.set_ylabel(label)
        if names not in ([label], shown):  # the same names have the legend of the panel above
            shown, lines = names, axes.get_lines()[-len(names) :]
            columns = min(len(names), 3)
            axes.legend(lines, names, ncols=columns, loc="lower right", bbox_to_anchor=(1, 1))
    return style.finished(figure, look)


def _arrow(t: Array, tips: Array, force: Array, size: float) -> tuple[list[Node], list[Track]]:
    """An arrow that begins at the tool; pieces of its shaft spread."""
    norms = np.linalg.norm(force, axis=1)
    if not norms.max() > 0.0:
        return [], []
    seen = np.where(norms[:, None] > 1e-3 * norms.max(), force, 0.0)
    nodes, tracks = moving_chain("force", "xyzzy", t, along_bars(tips, tips + seen))
    times, along = keyframes(t, (size * norms / norms.max())[:, None])
    path = nodes[-1].path
    turn = np.linspace(0.0, 2.0 * np.pi, 25)[:-1]
    circle = 0.045 * size * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    points = np.vstack([circle, [[0.0, 0.0, 0.0], [0.0, 0.0, 0.13 * size]]]).astype(np.float32)
    sides = [(k, (k + 1) % 24, apex) for k in range(24) for apex in (24, 25)]
    rod, head = Cylinder(0.015 * size, size / _PIECES), Triangles(points, np.array(sides))
    pieces = [(f"piece_{k}", (k + 0.5) / _PIECES, rod) for k in range(_PIECES)]
    for name, part, shape in (*pieces, ("head", 1.0, head)):
        at = f"{path}/{name}"
        nodes += [Node(at, se3.translation(0.0, 0.0, part * along[0, 0]))]
        nodes += [Node(f"{at}/shape", np.eye(4), shape, _ARROW)]
        tracks.append(Track(at, True, times, part * along[:, 0]))
    return nodes, tracks


def _wall(wall: SpringWall, tips: Array, size: float, path: str) -> Node:
    """A square plate below the surface, at the point nearest to the path of the tool."""
    above = (tips - wall.point) @ wall.normal
    pose, thin = z_along(wall.normal), 0.03 * size
    pose[:3, 3] = tips[above.argmin()] - (above.min() + 0.5 * thin) * wall.normal
    return Node(path, pose, Box((1.6 * size, 1.6 * size, thin)), _WALL)
