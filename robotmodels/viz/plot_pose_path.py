"""The path of the tool in space, with its frame at some poses."""

from __future__ import annotations

from operator import index
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, as_exact
from ..errors import InvalidValueError, ShapeError
from ..trajectories.joint_path import JointPath
from ..trajectories.pose_trajectory import PoseSamples, PoseTrajectory
from ..visual import Color
from .figures import (
    COLUMN,
    LABEL_SIZE,
    LINE_WIDTH,
    SMALL_SIZE,
    THIN_WIDTH,
    legend_above,
    new_figure,
)
from .palette import GRID, INK, LINE_COLORS, PALE
from .plot_joint_path import EVENT_STYLES
from .plot_units import Unit, as_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_AXES: tuple[tuple[str, Color], ...] = (
    ("x", LINE_COLORS[1]),
    ("y", LINE_COLORS[2]),
    ("z", LINE_COLORS[0]),
)
_DASHES = ((0, ()), (0, (3.0, 1.0)), (0, (1.0, 0.8)))
_SAMPLES = 301
_ELEVATION, _OBLIQUE = np.radians((24.0, 60.0))
_OFF_AXIS = np.radians((22.0, 68.0))
_STILL = 1e-3  # m: a tool that moves less turns on the spot
_THINNEST = 0.35  # of the box in any direction, beside its longest edge


def plot_pose_path(
    poses: PoseTrajectory | PoseSamples | ArrayLike,
    path: JointPath | None = None,
    *,
    frames: int = 6,
    frame_size: float | None = None,
    unit: Unit | str = Unit.METRE,
    view: ArrayLike | None = None,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """The path of the tool in space, with its frame at some poses and equal scales.

    Parameters
    ----------
    poses : PoseTrajectory, PoseSamples or array_like, shape (N, 4, 4)
        World poses of the tool, m.
    path : JointPath, optional
        What `joint_path` found for these poses; its events are marked.
    frames : int
        At how many poses the axes of the tool are drawn, the two ends included; they are evenly
        spaced in the numbers of the samples, so in time.
    frame_size : float, optional
        Length of the axes, m; default a tenth of the extent of the path.
    unit : Unit or str
        ``m`` or ``mm`` for the axes.
    view : array_like, shape (2,), optional
        Azimuth and elevation from which the path is seen, rad; default obliquely, across its
        longest horizontal direction.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        With one set of axes in space.

    Raises
    ------
    InvalidValueError, ShapeError, NotARotationError
        What are no poses, or none; a path of another number of poses; a unit that is no length.
    MissingExtraError
        Matplotlib is not installed.

    Examples
    --------
    >>> from robotmodels.se3 import translation
    >>> from robotmodels.trajectories import straight_line
    >>> move = straight_line(np.eye(4), translation(0.2, 0.1, 0), duration=1.0)
    >>> plot_pose_path(move).axes[0].get_xlabel()
    'x (m)'
    """
    if path is not None and not isinstance(path, JointPath):
        raise InvalidValueError(f"path: expected a JointPath, got {type(path).__name__}.")
    T = _poses(poses, path)
    length = as_unit(unit)
    if length not in (Unit.METRE, Unit.MILLIMETRE):
        raise InvalidValueError(f"unit: expected a length, 'm' or 'mm', got {length.value!r}.")
    count = _count(frames)
    if path is not None and len(path.q) != len(T):
        raise ShapeError(f"path: expected the joints of these {len(T)} poses, got {len(path.q)}.")
    points = length.factor * T[:, :3, 3]
    extent = float(np.ptp(points, axis=0).max())
    if extent < _STILL * length.factor:
        extent = length.factor
    angles = _across(points) if view is None else as_exact(view, (2,), "view")
    arm = 0.1 * extent if frame_size is None else length.factor * _positive(frame_size)
    figure = new_figure(COLUMN, 0.92 * COLUMN, size)
    axes: Any = figure.add_subplot(projection="3d")
    axes.plot(*points.T, color=INK, linewidth=LINE_WIDTH, label="path")
    some = np.unique(np.linspace(0, len(T) - 1, count).round().astype(int)) if count else []
    tips = [points]
    for k, ((name, color), dashes) in enumerate(zip(_AXES, _DASHES, strict=True)):
        for i in some:
            tip = points[i] + arm * T[i, :3, k]
            tips.append(tip[None])
            axes.plot(
                *np.stack((points[i], tip)).T, color=color, linestyle=dashes, linewidth=1.2,
                label=f"tool {name}" if i == some[0] else f"_tool {name}",
            )  # fmt: skip
    for i, marker, text in ((0, "o", "start"), (len(T) - 1, "s", "end")):
        axes.plot(*points[i : i + 1].T, color=INK, linestyle="", marker=marker, markersize=4.0,
                  label=text)  # fmt: skip
    if path is not None:
        _mark(axes, path, points)
    edges = _box(axes, np.concatenate(tips))
    _style(axes, length, angles, edges)
    legend_above(figure, [line for line in axes.get_lines()
                          if not str(line.get_label()).startswith("_")], title)  # fmt: skip
    _fill(figure, axes, edges)
    return figure


def _poses(poses: Any, path: JointPath | None) -> Array:
    if isinstance(poses, PoseTrajectory):
        if path is not None and not np.isnan(path.t).any():
            return poses.pose(path.t)
        return np.asarray(poses.resample(_SAMPLES if path is None else len(path.q)).T)
    if isinstance(poses, PoseSamples):
        poses = poses.T
    T = se3.as_pose(poses, "poses")
    if T.ndim != 3 or not len(T):
        raise ShapeError(f"poses: expected shape (N, 4, 4) with N at least 1, got {T.shape}.")
    return T


def _count(frames: Any) -> int:
    try:
        count = index(frames)
    except TypeError:
        count = -1
    if count < 0 or isinstance(frames, bool):
        raise InvalidValueError(f"frames: expected how many are drawn, from 0, got {frames!r}.")
    return count


def _positive(frame_size: Any) -> float:
    value = float(as_exact(frame_size, (), "frame_size"))
    if value <= 0.0:
        raise InvalidValueError(f"frame_size: expected a positive length, got {value:g} m.")
    return value


def _mark(axes: Any, path: JointPath, points: Array) -> None:
    """Thick lines where something happens, dots where it happens at one pose."""
    named = set()
    for event in path.events:
        text, color, marker = EVENT_STYLES[event.kind]
        run = points[event.first : event.last + 1]
        few = run[[0, -1]] if len(run) > 1 else run
        label = f"_{text}" if text in named else text
        axes.plot(*run.T, color=color, linewidth=4.0, alpha=0.45, label=f"_run {text}")
        axes.plot(*few.T, color=color, linestyle="", marker=marker, markersize=4.5, label=label)
        named.add(text)


def _across(points: Array) -> Array:
    """Azimuth and elevation from which the longest horizontal direction lies across the page."""
    flat = points[:, :2] - points[:, :2].mean(axis=0)
    _, extents, directions = np.linalg.svd(flat, full_matrices=True)
    if not extents.size or extents[0] < 1e-9:
        return np.array((-_OBLIQUE, _ELEVATION))
    along = float(np.arctan2(directions[0, 1], directions[0, 0])) % np.pi
    azimuth = along - _OBLIQUE
    # seen along an axis of the world, that axis has no length and its numbers stand in a heap
    quarter = 0.5 * np.pi * np.floor(azimuth / (0.5 * np.pi))
    azimuth = quarter + np.clip(azimuth - quarter, *_OFF_AXIS)
    return np.array((azimuth, _ELEVATION))


def _box(axes: Any, points: Array) -> Array:
    """Equal scales, and a box that is not flat; its edges."""
    low, high = points.min(axis=0), points.max(axis=0)
    edges = 1.06 * (high - low)
    edges = np.maximum(edges, _THINNEST * (edges.max() or 1.0))
    middle = 0.5 * (low + high)
    axes.set(**{f"{name}lim": (m - 0.5 * e, m + 0.5 * e)
                for name, m, e in zip("xyz", middle, edges, strict=True)})  # fmt: skip
    axes.set_box_aspect(edges)
    return edges


def _fill(figure: Figure, axes: Any, edges: Array) -> None:
    """Place the box so that it fills the figure below the legend, with all of its texts.

    The layout of Matplotlib does not know how far the texts of axes in space reach.
    """
    figure.set_layout_engine("none")
    figure.draw_without_rendering()
    width, height = figure.bbox.size
    top = min((legend.get_window_extent().y0 for legend in figure.legends), default=height)
    pad = 0.01 * width
    room, middle = np.array((width, top)) - 2.0 * pad, 0.5 * np.array((width, top))
    zoom, shift = 1.0, np.zeros(2)
    for _ in range(5):  # texts do not grow with the box
        axes.set_position((shift[0] / width, shift[1] / height, 1.0, top / height))
        axes.set_box_aspect(edges, zoom=zoom)
        figure.draw_without_rendering()
        low, high = _taken(axes)
        fit, off = float((room / (high - low)).min()), middle - 0.5 * (low + high)
        if 0.98 < fit < 1.02 and np.abs(off).max() < pad:
            break
        zoom, shift = zoom * fit, shift + fit * off
    for artist in axes.get_children():
        artist.set_clip_on(False)  # the box may stand a little outside of its rectangle


def _taken(axes: Any) -> tuple[Array, Array]:
    """Least and greatest pixels of the box and of the texts on it, as they were drawn last."""
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    corners = np.array(np.meshgrid(axes.get_xlim(), axes.get_ylim(), axes.get_zlim()))
    xs, ys, zs = corners.reshape(3, -1)
    x, y, _ = proj_transform(xs, ys, zs, axes.get_proj())
    points = [axes.transData.transform(np.column_stack((x, y)))]
    for name in "xyz":
        axis = getattr(axes, f"{name}axis")
        start, stop = sorted(getattr(axes, f"get_{name}lim")())
        # numbers of ticks beyond the ends of an axis are not drawn
        ticks = [t.label1 for t in axis.get_major_ticks() if start <= t.get_loc() <= stop]
        points += [text.get_window_extent().get_points() for text in (axis.label, *ticks)]
    every = np.concatenate(points)
    return every.min(axis=0), every.max(axis=0)


def _style(axes: Any, unit: Unit, view: Array, edges: Array) -> None:
    from matplotlib.ticker import MaxNLocator

    axes.view_init(elev=float(np.degrees(view[1])), azim=float(np.degrees(view[0])))
    axes.set_facecolor("white")
    for name, edge in zip("xyz", edges, strict=True):
        axis = getattr(axes, f"{name}axis")
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.line.set(color=PALE, linewidth=THIN_WIDTH)
        axis.set_major_locator(MaxNLocator(max(2, round(3.6 * edge / edges.max()))))
        axis.set_label_text(f"{name} ({unit.value})", size=LABEL_SIZE, color=INK)
        axis._axinfo["grid"].update(color=GRID, linewidth=THIN_WIDTH)
        axes.tick_params(axis=name, labelsize=SMALL_SIZE, labelcolor=INK, color=PALE, pad=-1.0)
        axis.labelpad = 4.0
