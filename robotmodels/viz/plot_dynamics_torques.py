"""The torques of a motion, joint by joint, split into what they are for."""

from __future__ import annotations

from collections.abc import Sequence
from operator import index
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..errors import InvalidValueError, ShapeError
from ..friction import Friction
from ..geometry import PRISMATIC
from ..model import RobotModel, check_model
from ..simulation.result import Simulation
from ..simulation.torque_parts import TorqueParts, simulated_torque_parts, torque_parts
from ..trajectories.trajectory import Samples, Trajectory
from .figures import (
    COLUMN,
    LINE_WIDTH,
    PAGE,
    SMALL_SIZE,
    THIN_WIDTH,
    legend_above,
    line_style,
    new_figure,
    panels,
)
from .palette import INK, PALE
from .plot_sampling import drawn
from .plot_trajectory import draw_line
from .plot_units import joint_names

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PARTS = (
    ("inertia", "inertia"),
    ("coriolis", "Coriolis and centrifugal"),
    ("gravity", "gravity"),
    ("friction", "friction"),
    ("wrench", "wrench of the tool"),
)
_ROUNDING = 1e-12


def plot_torque_parts(
    model: RobotModel,
    motion: Trajectory | Samples | Simulation,
    *,
    wrench: ArrayLike | None = None,
    drive: bool = True,
    friction: Friction | None = None,
    joints: Sequence[int] | None = None,
    columns: int | None = None,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Torques of a motion split into inertia, Coriolis, gravity, friction and wrench, by joint.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints; of a simulation its own.
    motion : Trajectory, Samples or Simulation
        One motion of n joints. A simulation brings its own friction, wrench and drives.
    wrench : array_like, shape (6,), optional
        What the tool exerts on the environment all the time, see `idm`.
    drive : bool
        Whether rotor inertia, friction and offsets of the model's drives are included.
    friction : Friction, optional
        A friction model that acts besides them.
    joints : sequence of int, optional
        Which joints, columns of q from 0; default all.
    columns : int, optional
        How many panels stand in a row; default one, or two from five joints on.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        A panel for each joint; parts that are zero for all of them have no line.

    Raises
    ------
    InvalidValueError, ShapeError
        A motion of another number of joints, or a batch of them; no such joints; a simulation of
        another robot, or one with a wrench, drives or friction given here.
    MissingExtraError
        Matplotlib is not installed.

    References
    ----------
    Seed book sections 1.5.1.1 to 1.5.1.5.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.trajectories import quintic
    >>> move = quintic(np.zeros(6), np.ones(6), duration=1.0)
    >>> figure = plot_torque_parts(load("rx90"), move, joints=[0, 1])
    >>> [axes.get_title(loc="left") for axes in figure.axes]
    ['joint_1 (N m)', 'joint_2 (N m)']
    """
    check_model(model)
    times, parts = _split(model, motion, wrench, drive, friction)
    shown = _joints(joints, model.n)
    names = joint_names(None, model.n, model)
    prismatic = model.table.sigma[model.table.joint_rows] == PRISMATIC
    total = parts.total[:, shown]
    least = _ROUNDING * np.abs(total).max(axis=0, initial=0.0)
    present = [
        (getattr(parts, field)[:, shown], line_style(k), label)
        for k, (field, label) in enumerate(PARTS)
        if (np.abs(getattr(parts, field)[:, shown]) > least).any()
    ]
    wide = _columns(columns, len(shown))
    rows = -(-len(shown) // wide)
    figure = new_figure(COLUMN if wide == 1 else PAGE, 0.8 + 1.1 * rows, size)
    places = panels(figure, rows, wide, sharex=True)
    order = list(places.T.flat)  # one joint below the other
    for axes in order[len(shown) :]:
        axes.set_visible(False)
    for k, j in enumerate(shown):
        axes = order[k]
        axes.axhline(0.0, color=PALE, linewidth=THIN_WIDTH, zorder=1.2, label="_zero")
        for values, style, label in present:
            draw_line(axes, times, values[:, k], style, label)
        axes.plot(times, total[:, k], color=INK, linewidth=1.4 * LINE_WIDTH, alpha=0.85,
                  marker="" if len(times) > 1 else "o", markersize=3.0, label="total",
                  zorder=1.9)  # fmt: skip
        axes.set_title(f"{names[j]} ({'N' if prismatic[j] else 'N m'})", loc="left",
                       size=SMALL_SIZE, color=INK, pad=2.0)  # fmt: skip
        if (k + 1) % rows == 0 or k == len(shown) - 1:
            axes.set_xlabel("time (s)")
            axes.tick_params(labelbottom=True)
    handles: list[Any] = [
        line for line in order[0].get_lines() if not str(line.get_label()).startswith("_")
    ]
    legend_above(figure, handles, title)
    return figure


def _split(
    model: RobotModel,
    motion: Any,
    wrench: ArrayLike | None,
    drive: bool,
    friction: Friction | None,
) -> tuple[Array, TorqueParts]:
    """Times and parts."""
    if isinstance(motion, Simulation):
        if motion.model != model:
            raise InvalidValueError(
                f"model: the simulation is one of {motion.model.name!r} with its parameters, not "
                f"of this {model.name!r}; pass simulation.model."
            )
        if wrench is not None or friction is not None or not drive:
            raise InvalidValueError(
                "motion: a simulation has its own wrench, drives and friction; leave them out."
            )
        return motion.t, simulated_torque_parts(motion)
    samples = drawn(motion, "motion")
    if samples.n != model.n:
        raise ShapeError(
            f"motion: expected one of the {model.n} joints of {model.name!r}, got {samples.n}."
        )
    q, v, a = samples.values[:3]
    return samples.t, torque_parts(model, q, v, a, wrench, drive, friction)


def _joints(joints: Any, n: int) -> list[int]:
    if joints is None:
        if not n:
            raise InvalidValueError("model: there are no joints to draw.")
        return list(range(n))
    try:
        shown = [index(j) for j in joints]
    except TypeError:
        shown = []
    if not shown or len(set(shown)) < len(shown) or min(shown) < 0 or max(shown) >= n:
        raise InvalidValueError(
            f"joints: expected some numbers from 0 to {n - 1}, each once, got {joints!r:.60}."
        )
    return shown


def _columns(columns: Any, count: int) -> int:
    if columns is None:
        return 1 if count < 5 else 2
    if isinstance(columns, bool) or not isinstance(columns, (int, np.integer)) or columns < 1:
        raise InvalidValueError(f"columns: expected a whole number from 1, got {columns!r}.")
    return min(int(columns), count)
