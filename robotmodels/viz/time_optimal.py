"""Figures of optimal motion: the phase plane of a path, and the plan of a motion.

Parameters
----------
title : str, optional
    Text over the figure.
size : array_like, shape (2,), optional
    Width and height, inches.

Returns
-------
matplotlib.figure.Figure
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..dynamics import idm
from ..errors import InvalidValueError
from ..model import RobotModel
from ..trajectories.kinodynamic import Plan
from ..trajectories.time_optimal import TimedPath
from . import style
from .style import COLUMN, DASHED, INK, PAGE, PALE, PALETTE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HIGHEST = 2.5  # of the greatest rate: the maximum velocity curve is drawn up to this
_SAMPLES = 501


@style.plot
def plot_phase_plane(
    timed: TimedPath, *, title: str | None = None, size: ArrayLike | None = None
) -> Figure:
    """Rate over the path parameter, below the maximum velocity curve, and the limit that binds.

    The ribbon below has the colour of the limit that binds at each point; it is white where none
    does.

    Parameters
    ----------
    timed : TimedPath
        From `robotmodels.trajectories.time_optimal`, with a motion.

    Examples
    --------
    >>> from robotmodels.trajectories import MotionLimits, linear, time_optimal
    >>> timed = time_optimal(linear([0.0], [1.0], 1.0), MotionLimits(1.0, 2.0))
    >>> plot_phase_plane(timed).axes[0].get_ylabel()
    'rate s′ (1/s)'
    """
    style.as_instance(timed, TimedPath, "timed", "time_optimal")
    if timed.trajectory is None:
        raise InvalidValueError(f"timed: it has no motion to draw. {timed.reason()}")
    s, rate, most = timed.parameter, timed.rate, timed.maximum_rate
    figure, grid = style.panels(COLUMN, 3.0, size, 2, sharex=True, height_ratios=[1.0, 0.07])
    above, below = grid[:, 0]
    top = 1.1 * min(float(most.max()), _HIGHEST * float(rate.max()))
    above.fill_between(s, np.minimum(most, top), top, color=style.BAND, linewidth=0.0)
    above.plot(s, np.where(most <= top, most, np.nan), color=PALE, label="maximum velocity curve",
               **DASHED)  # fmt: skip
    above.plot(s, rate, color=INK, label="quickest motion")
    above.set_ylim(0.0, top)
    above.set_ylabel("rate s′ (1/s)")
    names = sorted(set(timed.active.tolist()) - {""}, key=_order)
    for k, name in enumerate(names):
        here = (timed.active == name)[:-1]
        starts, steps = s[:-1][here], np.diff(s)[here]
        below.bar(starts, 1.0, steps, align="edge", color=PALETTE[k % len(PALETTE)], label=name)
    below.set_ylim(0.0, 1.0)
    below.set_yticks([])
    below.grid(False)
    below.set_xlabel("path parameter s")
    below.set_xlim(s[0], s[-1])
    return style.finished(figure, title, ["quickest motion", "maximum velocity curve", *names])


def _order(name: str) -> tuple[str, int]:
    words = name.split()
    return words[0], int(words[-1]) if words[-1].isdigit() else 0


@style.plot
def plot_plan(
    plan: Plan, *, model: RobotModel | None = None, torque: ArrayLike | None = None,
    title: str | None = None, size: ArrayLike | None = None,
) -> Figure:  # fmt: skip
    """Joints of a planned motion over time, its torques, and the costs of the search.

    Parameters
    ----------
    plan : Plan
        From `robotmodels.trajectories.kinodynamic`, with a motion.
    model : RobotModel, optional
        The robot, n joints: its torques are drawn.
    torque : array_like, shape () or (n,), optional
        Limits of torque, N m or N: torques are drawn as shares of them; default those of the
        model's table.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.trajectories import MotionLimits, kinodynamic
    >>> arm = load("ur5e")
    >>> plan = kinodynamic(arm, [0, -1.5, 1, 0, 0, 0], [1, -1, 0.5, 0, 0, 0], MotionLimits(),
    ...                    seconds=0.2)
    >>> sorted(" ".join(axes.get_ylabel().split()) for axes in plot_plan(plan, model=arm).axes)
    ['cost', 'position (rad or m)', 'torque (of its limit)']
    """
    style.as_instance(plan, Plan, "plan", "kinodynamic")
    if plan.trajectory is None:
        raise InvalidValueError(f"plan: it has no motion to draw. {plan.reason()}")
    t = np.linspace(0.0, plan.duration, _SAMPLES)
    seen = plan.trajectory.at(t)
    n = seen.q.shape[1]
    figure, grid = style.panels(PAGE, 2.9, size, 2 if model is not None else 1, 2)
    left, right = grid[:, 0], grid[0, 1]
    labels = [f"joint {j + 1}" for j in range(n)]
    for j in range(n):
        left[0].plot(t, seen.q[:, j], label=labels[j], **style.line(j))
        for time in plan.via_times:
            left[0].plot(time, plan.trajectory.q(time)[j], "o", color=INK, markersize=3.0,
                         label="via point")  # fmt: skip
    left[0].set_ylabel("position (rad or m)")
    if model is not None:
        bound = np.asarray(model.table.effort if torque is None else torque, dtype=float)
        share = idm(model, seen.q, seen.v, seen.a) / bound
        for j in range(n):
            left[1].plot(t, share[:, j], label=labels[j], **style.line(j))
        for side in (-1.0, 1.0):
            left[1].axhline(side, color=PALE, label=style.LIMIT, **DASHED)
        left[1].set_ylabel("torque\n(of its limit)")
        left[0].sharex(left[1])
        left[0].tick_params(labelbottom=False)
        grid[1, 1].remove()
        right.set_subplotspec(grid[0, 1].get_gridspec()[:, 1])
    left[-1].set_xlabel("time (s)")
    count, cost, best = plan.history.T
    shown = np.isfinite(cost) & (cost <= 3.0 * best[-1])
    right.plot(count[shown], cost[shown], ".", color=PALE, markersize=1.5, label="candidates")
    right.plot(count, best, color=INK, label="least cost")
    right.axhline(plan.cost, color=style.ALERT, label="checked motion", **DASHED)
    right.set_xlabel("evaluations")
    right.set_ylabel("cost")
    return style.finished(figure, title, labels)
