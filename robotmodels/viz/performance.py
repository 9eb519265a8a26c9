"""Figures of chapter 3: workspaces with numbers of postures, aspects, paths over all postures.

Parameters
----------
w : Workspace
    From `workspace`. In the scene, the cells at its border are drawn in space, all in a plane.
curves : bool
    Whether singular curves and cusps are drawn, where they are defined.
a : Aspects
    From `aspects` or `free_components`; of more than two joints that share a factor the first two.
path, joint : FeasiblePath, and int, optional
    From `feasible_path`; column of q, default the one whose postures differ most.
q : array_like, shape (n,), optional
    Configuration of the robot, default zero.

Returns
-------
matplotlib.figure.Figure or Scene

Examples
--------
>>> from robotmodels.performance import workspace
>>> from robotmodels.robots import load
>>> plot_workspace(workspace(load("planar_2r"), limits=False, resolution=20)).axes[0].get_xlabel()
'x (m)'
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from .._choices import as_instance
from ..errors import InvalidValueError
from ..performance import Aspects, FeasiblePath, Workspace, cusps, singular_curves
from ..performance.arms import section_arm
from . import style
from .camera import framed
from .scene import Scene
from .shapes import Node, Triangles
from .show import show
from .style import ALERT, COLUMN, INK, PAGE, PALE, PALETTE, Figure, Look

_LINES = {"boundary": (INK, 1.1), "internal": (ALERT, 0.9), "limit": (PALE, 0.9)}
_TINTS = ("#f4f4f4", "#cfe3f5", "#9cc4e6", "#6aa2d3", "#3f7fbb", "#235c99")
_SECTION = ("distance from axis 1 (m)", "height (m)")
_CORNERS = np.array([(i, j, k) for k in (-0.5, 0.5) for j in (-0.5, 0.5) for i in (-0.5, 0.5)])
_FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
_TRIANGLES = np.array(_FACES)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
"""Of a cell: its corners, and its faces as two triangles each; the first one is that in a plane."""


@style.plot
def plot_workspace(w: Workspace, *, curves: bool = True, **look: Unpack[Look]) -> Figure:
    """Section of a workspace: numbers of postures as colours, singular curves, cusps as points.

    Of a workspace in space the greatest numbers seen along two axes of the world.
    """
    as_instance(w, Workspace, "w", " of workspace")
    if not len(w.points):
        raise InvalidValueError(f"w: there are no cells to draw. {w.reason()}")
    from matplotlib.colors import BoundaryNorm, ListedColormap

    in_space, numbers = w.coordinates == "space", np.unique(w.count)
    width = PAGE if in_space else 1.3 * COLUMN
    figure, grid = style.panels(width, 3.6, look, 1, 1 + in_space)
    axes = [np.unique(coordinate) for coordinate in w.points.T]
    names = _SECTION if w.coordinates == "half plane" else ("x (m)", "y (m)", "z (m)")
    tints = ListedColormap([_TINTS[min(k, len(_TINTS) - 1)] for k in range(len(numbers))])
    norm = BoundaryNorm([*(numbers - 0.5), numbers[-1] + 0.5], len(numbers))
    views = ((0, 2, (1,)), (0, 1, (2,))) if in_space else ((0, 1, ()),)
    for panel, (across, up, along) in zip(grid[0], views, strict=True):
        counts = w.count.reshape(w.shape).max(axis=along).T
        colors: dict[str, Any] = {"cmap": tints, "norm": norm, "shading": "nearest"}
        image = panel.pcolormesh(axes[across], axes[up], counts, rasterized=True, **colors)
        panel.grid(False)
        panel.set(xlabel=names[across], ylabel=names[up], aspect="equal")
        middles = 0.5 * (norm.boundaries[1:] + norm.boundaries[:-1])
        bar: Any = figure.colorbar(image, ax=panel, pad=0.03, aspect=25, ticks=middles)
        bar.ax.set_yticklabels([str(n) for n in numbers])
        bar.ax.minorticks_off()
        bar.set_label("postures")
    if curves and not in_space and w.kind == "positions":
        found = singular_curves(w.model, w.limits)
        for line, kind in zip(found.section, found.kind, strict=True):
            color, width = _LINES[kind.value]
            grid[0, 0].plot(*line.T, color=color, linewidth=width, label=kind.value)
        points = cusps(w.model).section
        if len(points):
            grid[0, 0].plot(*points.T, "o", color=ALERT, markersize=3.5, label="cusp")
    return style.finished(figure, look, ("boundary", "internal", "limit", "cusp"))


@style.plot
def plot_aspects(a: Aspects, **look: Unpack[Look]) -> Figure:
    """Aspects in the joints that share a factor, and beside it where the tool is in each."""
    as_instance(a, Aspects, "a", " of aspects")
    if not a.count:
        raise InvalidValueError(f"a: there are no aspects to draw. {a.reason()}")
    from matplotlib.colors import ListedColormap

    group = max(a.groups, key=lambda g: (len(g.joints) >= 2, len(g.volumes), len(g.joints)))
    arm, count = section_arm(a.model), len(group.volumes)
    of_section = arm is not None and len(group.joints) == 2
    maps = min(count, 3) if of_section else 1
    figure, grid = style.panels(PAGE, 3.1, look, 1, 1 + maps, width_ratios=[maps, *[1] * maps])
    left, *right = grid[0]
    middle = tuple(n // 2 for n in group.labels.shape[2:])
    labels = group.labels[(..., *middle)].reshape(len(group.labels), -1)
    colors = [PALETTE[k % len(PALETTE)] for k in range(count)]
    ends, sides = np.append(group.low, -0.5), np.append(group.side, 1.0)
    x, y = (ends[k] + sides[k] * (np.arange(labels.shape[k]) + 0.5) for k in range(2))
    kind: dict[str, Any] = {"cmap": ListedColormap(colors), "vmin": 0.5, "vmax": count + 0.5}
    kind |= {"shading": "nearest", "alpha": 0.75, "rasterized": True}
    left.pcolormesh(x, y, np.ma.masked_equal(labels, 0).T, **kind)
    names = [f"q{j + 1} (rad)" for j in group.joints] + [""]
    left.set(xlabel=names[0], ylabel=names[1])
    left.grid(False)
    if arm is not None and of_section:
        mesh = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        points, text = arm.values(mesh)[:, :2], _SECTION if arm.radial else ("x (m)", "y (m)")
        dot: dict[str, Any] = {"markersize": 1.6, "markeredgewidth": 0.0, "rasterized": True}
        for k, panel in enumerate(right):
            inside = points[(labels == k + 1).ravel()]
            panel.plot(*points.T, ".", color="#e8e8e8", label="_all", **dot)
            panel.plot(*inside.T, ".", color=colors[k], alpha=0.12, label=f"_{k}", **dot)
            panel.set(xlabel=text[0], ylabel="" if k else text[1], aspect="equal")
            share = 100.0 * group.volumes[k] / group.volumes.sum()
            panel.set_title(f"aspect {k + 1}: {share:.0f} %", fontsize="small")
    else:
        right[0].bar(np.arange(1, a.count + 1), a.volume, color=INK, alpha=0.6)
        right[0].set(xlabel="aspect", ylabel="volume of joint space")
        right[0].locator_params(axis="x", integer=True)
    return style.finished(figure, look)


@style.plot
def plot_feasible_path(
    path: FeasiblePath, joint: int | None = None, **look: Unpack[Look]
) -> Figure:
    """All postures along a path as a graph over one joint: which go on, and where they break."""
    from matplotlib.collections import LineCollection

    as_instance(path, FeasiblePath, "path", " of feasible_path")
    q = path.postures
    if not q.size or np.isnan(q).all():
        raise InvalidValueError(f"path: there are no postures to draw. {path.reason()}")
    spread = np.nan_to_num(np.nanmax(q, axis=(0, 1)) - np.nanmin(q, axis=(0, 1)))
    j = int(spread.argmax())
    if joint is not None:
        j = style.as_choice([joint], q.shape[2], "joint", "a number")[0]
    figure, grid = style.panels(0.5 * (COLUMN + PAGE), 3.2, look)
    axes = grid[0, 0]
    k, s = np.nonzero(path.following >= 0)
    ends = q[k + 1, path.following[k, s], j]
    lines = np.stack(
        (np.stack((k, q[k, s, j]), axis=-1), np.stack((k + 1.0, ends), axis=-1)), axis=1
    )
    lines = lines[np.abs(lines[:, 0, 1] - lines[:, 1, 1]) < np.pi]  # not across the ends of a turn
    axes.add_collection(LineCollection(list(lines), colors=PALE, linewidths=1.2, label="continued"))
    last, s = np.nonzero((path.following < 0) & ~np.isnan(q[:-1, :, j]))
    if len(last):
        axes.plot(last, q[last, s, j], "x", color=ALERT, markersize=5, label="ends here")
    best = path.q[:, j]
    turn = best if spread[j] > 2.0 * np.pi else (best + np.pi) % (2.0 * np.pi) - np.pi
    turn = np.where(np.abs(np.diff(turn, prepend=turn[:1])) > np.pi, np.nan, turn)
    axes.plot(turn, color=PALETTE[0], linewidth=2.2, label="best motion")
    axes.autoscale()
    axes.set(xlabel="number of the pose", ylabel=f"q{j + 1} of all postures (rad or m)")
    return style.finished(figure, look)


def show_workspace(w: Workspace, q: ArrayLike | None = None, **options: Any) -> Scene:
    """Scene of a robot and its workspace: cells as blocks, a colour for each number of postures."""
    as_instance(w, Workspace, "w", " of workspace")
    flags = (w.count > 0).reshape(w.shape)
    if w.coordinates == "space" and flags.size:
        inner = np.pad(flags, 1)
        for axis in range(3):
            inner = inner & np.roll(inner, 1, axis) & np.roll(inner, -1, axis)
        flags = flags & ~inner[1:-1, 1:-1, 1:-1]
    d = len(w.size)
    corners, triangles = (_CORNERS, _TRIANGLES) if d == 3 else (_CORNERS[:4, :2], _TRIANGLES[:2])
    nodes, legend, seen = [], [], np.zeros((0, 3))
    for k, number in enumerate(np.unique(w.count[w.count > 0])):
        cells = w.points[flags.ravel() & (w.count == number)]
        points = (cells[:, None] + corners * w.size).reshape(-1, d) @ w.frame[:3, :d].T
        points = points + w.frame[:3, 3]
        faces = len(corners) * np.arange(len(cells))[:, None, None] + triangles
        color = (*PALETTE[k % 8][:3], 0.35)
        shape = Triangles(points, faces.reshape(-1, 3))
        nodes.append(Node(f"workspace/{number}", np.eye(4), shape, color))
        legend.append((f"{number} posture{'s' if number > 1 else ''}", color))
        seen = np.concatenate((seen, points))
    scene = show(w.model, q, **options)
    camera = framed(seen, None) if len(seen) else scene.camera
    more = {"nodes": (*scene.nodes, *nodes), "legend": (*scene.legend, *legend)}
    return replace(scene, camera=camera, **more)
