"""Pictures of flexible robots: bent links, modes, frequencies over the workspace.

Parameters
----------
arm, link : FlexibleRobot and FlexibleLink
    The robot, n joints and m elastic coordinates; or a link, m modes.
q, e : array_like, shape (..., n) and (..., m), optional
    Configurations, drawn over each other; default zero. Of `plot_frequencies` the other joints.
scale : float
    Factor by which deflections are exaggerated.
grid : bool
    Whether the floor and the axes of the world are drawn.
joint, span : int and array_like, shape (2,)
    Which joint moves, from 0, and its range, rad or m.
joints : str
    ``"locked"`` or ``"free"``, see `robotmodels.flexible.natural_frequencies`.

Returns
-------
Scene or matplotlib.figure.Figure

Examples
--------
>>> from robotmodels import load, flexible
>>> arm = flexible.FlexibleRobot(load("rx90"), {3: flexible.beam(0.45, EI=100.0, modes=1)})
>>> show_flexible(arm, np.zeros(6), [0.0, 0.05]).paths[0]
'configuration_1/row_3'
"""

from __future__ import annotations

from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_number, as_vector
from .._choices import as_instance
from ..errors import InvalidValueError
from ..flexible import FlexibleLink, FlexibleRobot, dgm, link_poses, natural_frequencies
from ..visual import Color, characteristic_length
from . import over_time, style
from .camera import framed
from .scene import Scene
from .shapes import Node, apply, floor_grid, path_tube
from .style import COLUMN, PALETTE, ZERO, Figure, Look

_RIGID: Color = (0.45, 0.47, 0.50, 1.0)
_THICK = 0.018  # radius of links, relative to the size of the robot


def show_flexible(
    arm: FlexibleRobot,
    q: ArrayLike | None = None,
    e: ArrayLike | None = None,
    *,
    scale: float = 1.0,
    grid: bool = True,
    height: int = 480,
) -> Scene:
    """Draw a flexible robot: bent links as swept tubes in colour, rigid ones grey."""
    as_instance(arm, FlexibleRobot, "arm", " of robotmodels.flexible")
    q = as_vector(np.zeros(arm.n) if q is None else q, arm.n, "q")
    e = as_vector(np.zeros(arm.m) if e is None else e, arm.m, "e")
    e = as_number(scale, "scale", above=0.0) * e
    batch = np.broadcast_shapes(q.shape[:-1], e.shape[:-1])
    q, e = (np.broadcast_to(x, (*batch, x.shape[-1])).reshape(-1, x.shape[-1]) for x in (q, e))
    size = characteristic_length(arm.model.table, arm.model.tool)
    nodes, points = list[Node](), [np.zeros((1, 3))]

    def tube(path: str, line: Array, color: Color = _RIGID) -> None:
        """A tube along a line, unless it has no length."""
        points.append(line)
        drawn = path_tube(line, (1.0 if color is _RIGID else 1.2) * _THICK * size)
        nodes.extend([] if drawn is None else [Node(path, np.eye(4), drawn, color)])

    for k, (frames, tool) in enumerate(zip(link_poses(arm, q, e), dgm(arm, q, e), strict=True)):
        ends, name = [arm.model.base, *frames], f"configuration_{k + 1}"
        for row, before in enumerate(arm.model.table.antecedent.tolist(), 1):
            if before not in arm.links:  # from the frame before to this one
                line = np.stack([ends[before][:3, 3], ends[row][:3, 3]])
                tube(f"{name}/row_{row}", line)
            if link := arm.links.get(row):
                here = slice(*arm.parts.chain.start[row - 1 : row + 1])
                axis = apply(ends[row], link.nodes + link.shapes @ e[k, here])
                tube(f"{name}/link_{row}", axis, PALETTE[k % len(PALETTE)])
        if arm.model.tip not in arm.links:
            tube(f"{name}/tool", np.stack([ends[arm.model.tip][:3, 3], tool[:3, 3]]))
    cloud = np.concatenate(points)
    nodes += floor_grid(cloud, False) if grid else []
    return Scene(f"{arm.model.name}, flexible", tuple(nodes), framed(cloud), height=height)


@style.plot
def plot_modes(link: FlexibleLink, **look: Unpack[Look]) -> Figure:
    """Mode shapes of a link: displacements along its axis, with their frequencies."""
    as_instance(link, FlexibleLink, "link", " of robotmodels.flexible")
    along = np.linalg.norm(link.nodes - link.nodes[0], axis=1)
    moved = [c for c in range(link.m) if np.abs(link.shapes[..., c]).max() > 0.0]
    if not moved:
        raise InvalidValueError("link: no mode moves the axis of this link; there is no figure.")
    figure, ((axes,),) = style.panels(COLUMN, 2.4, look)
    for k, c in enumerate(moved):
        shape = link.shapes[..., c]
        axis = int(np.abs(shape).max(axis=0).argmax())
        label = f"along {'xyz'[axis]}, {link.frequencies[c]:.4g} rad/s"
        axes.plot(along, shape[:, axis], label=label, **style.line(k))
    axes.axhline(0.0, **ZERO)
    axes.set(xlabel="distance from the root (m)", ylabel="displacement (m)")
    return style.finished(figure, look, ["modes"])


@style.plot
def plot_frequencies(
    arm: FlexibleRobot,
    joint: int,
    span: ArrayLike = (-np.pi, np.pi),
    q: ArrayLike | None = None,
    joints: str = "locked",
    **look: Unpack[Look],
) -> Figure:
    """Natural frequencies of an arm over the range of a joint."""
    as_instance(arm, FlexibleRobot, "arm", " of robotmodels.flexible")
    (column,) = style.as_choice([joint], arm.n, "joint", "a number")
    low, high = as_exact(span, (2,), "span")
    places = np.linspace(low, high, 61)
    many = np.tile(np.zeros(arm.n) if q is None else as_exact(q, (arm.n,), "q"), (61, 1))
    many[:, column] = places
    found = natural_frequencies(arm, many, joints)
    figure, ((axes,),) = style.panels(COLUMN, 2.4, look)
    for k in range(arm.n if joints == "free" else 0, found.shape[1]):
        axes.plot(places, found[:, k], label=f"_{k}", color=PALETTE[k % 8], linewidth=1.2)
    unit = over_time.joint_units(None, arm.n, arm.model)[column].value
    axes.set(xlabel=f"{arm.model.table.joint_names[column]} ({unit})", yscale="log")
    axes.set_ylabel("natural frequency (rad/s)")
    return style.finished(figure, look)
