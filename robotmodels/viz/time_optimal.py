"""Figures of motions within limits: phase plane of a path, plan, joints in their ranges.

Parameters
----------
timed, plan : TimedPath and Plan
    From `robotmodels.trajectories.time_optimal` and `kinodynamic`, with a motion.
model, degrees, columns, **look
    See `robotmodels.viz`; of a plan the torques of its model are drawn.
torque : array_like, shape () or (n,), optional
    Limits of torque, N m or N: torques are drawn as shares of them; default those of the table.
t, q : array_like, shape (N,) and (N, n), or q a mapping of str to such arrays
    Times, s, and positions, rad or m; several motions by their names. NaN leaves a gap.

Returns
-------
matplotlib.figure.Figure

Examples
--------
>>> from robotmodels.trajectories import MotionLimits, linear, time_optimal
>>> timed = time_optimal(linear([0.0], [1.0], 1.0), MotionLimits(1.0, 2.0))
>>> plot_phase_plane(timed).axes[0].get_ylabel()
'rate s′ (1/s)'
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import as_floats, as_reals
from .._choices import as_instance
from ..dynamics import idm
from ..errors import InvalidValueError, ShapeError
from ..model import RobotModel
from ..trajectories.kinodynamic import Plan
from ..trajectories.path_limits import checked_torque
from ..trajectories.time_optimal import TimedPath
from . import over_time, style
from .style import (
    ALERT,
    BEYOND,
    COLUMN,
    DASHED,
    INK,
    LIMIT,
    PAGE,
    PALE,
    PALETTE,
    Axes,
    Figure,
    Look,
)

_HIGHEST = 2.5  # of the greatest rate: the maximum velocity curve is drawn below this
_SAMPLES = 501
_MARGIN = 0.12  # of the range of a joint, shown beyond either limit


@style.plot
def plot_phase_plane(timed: TimedPath, **look: Unpack[Look]) -> Figure:
    """Rate over the path parameter, below the maximum velocity curve, and the limit that binds.

    The ribbon below has the colour of the limit that binds at each point; white where none does.
    """
    as_instance(timed, TimedPath, "timed", " of time_optimal")
    if timed.trajectory is None:
        raise InvalidValueError(f"timed: it has no motion to draw. {timed.reason()}")
    s, rate, most = timed.parameter, timed.rate, timed.maximum_rate
    figure, grid = style.panels(COLUMN, 3.0, look, 2, sharex=True, height_ratios=[1.0, 0.07])
    above, below = grid[:, 0]
    shown = most <= _HIGHEST * rate.max()
    top = 1.1 * max(float(rate.max()), float(most.max(where=shown, initial=0.0)))
    above.fill_between(s, np.minimum(most, top), top, color=style.BAND, linewidth=0.0)
    if shown.any():
        curve = np.where(most <= top, most, np.nan)
        above.plot(s, curve, color=PALE, label="maximum velocity curve", **DASHED)
    above.plot(s, rate, color=INK, label="quickest motion")
    above.set(ylim=(0.0, top), ylabel="rate s′ (1/s)")
    names = sorted(set(timed.active.tolist()) - {""}, key=lambda name: (len(name), name))
    for k, name in enumerate(names):
        here = (timed.active == name)[:-1]
        starts, steps = s[:-1][here], np.diff(s)[here]
        below.bar(starts, 1.0, steps, align="edge", color=PALETTE[k % len(PALETTE)], label=name)
    below.set_ylim(0.0, 1.0)
    below.set_yticks([])
    below.grid(False)
    below.set(xlabel="path parameter s", xlim=(s[0], s[-1]))
    return style.finished(figure, look, ["quickest motion", "maximum velocity curve", *names])


@style.plot
def plot_plan(
    plan: Plan,
    *,
    model: RobotModel | None = None,
    torque: ArrayLike | None = None,
    **look: Unpack[Look],
) -> Figure:
    """Joints of a planned motion over time, its torques, and the costs of the search."""
    as_instance(plan, Plan, "plan", " of kinodynamic")
    if plan.trajectory is None:
        raise InvalidValueError(f"plan: it has no motion to draw. {plan.reason()}")
    t = np.linspace(0.0, plan.duration, _SAMPLES)
    seen = plan.trajectory.at(t)
    n = seen.q.shape[1]
    names, kinds = over_time.joints_of(n, model)
    figure, grid = style.panels(PAGE, 2.9, look, 2 if model is not None else 1, 2)
    left, right = grid[:, 0], grid[0, 1]
    over_time.lines_over_time(left[0], t, seen.q, names)
    for time in plan.via_times:
        q = plan.trajectory.q(time)
        left[0].plot([time] * n, q, "o", color=INK, markersize=3.0, label="via point")
    left[0].set_ylabel(f"position ({' or '.join(kind.value for kind in kinds)})")
    if model is not None:
        bound = checked_torque(torque, model, n)
        some = np.flatnonzero(np.isfinite(bound) & (bound > 0.0)).tolist()
        if not some:
            raise InvalidValueError("torque: the model has no positive limits; give some.")
        share = idm(model, seen.q, seen.v, seen.a)[:, some] / bound[some]
        over_time.lines_over_time(left[1], t, share, [names[j] for j in some], some)
        for side in (-1.0, 1.0):
            left[1].axhline(side, color=PALE, label=LIMIT, **DASHED)
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
    right.axhline(plan.cost, color=ALERT, label="checked motion", **DASHED)
    right.set(xlabel="evaluations", ylabel="cost")
    return style.finished(figure, look, names)


@style.plot
def plot_joint_motion(
    model: RobotModel,
    t: ArrayLike,
    q: ArrayLike | Mapping[str, ArrayLike],
    *,
    degrees: bool = True,
    columns: int | None = None,
    **look: Unpack[Look],
) -> Figure:
    """Positions of all joints within their limits, and the margin that is left.

    Every joint has a panel that is as high as its range, so that heights compare between joints;
    values beyond the limits are shaded. The last panel, if any joint has both limits, has the least
    margin of all joints: 100 % where all of them are in the middle of their ranges, 0 where one is
    at a limit.
    """
    names = over_time.joint_names(None, as_instance(model, RobotModel, "model").n, model)
    times = as_floats(t, "t")
    if times.ndim != 1 or not times.size:
        raise ShapeError(f"t: expected shape (N,) with N at least 1, got {times.shape}.")
    given = style.as_named(q if isinstance(q, Mapping) else [q], None, "q", "motion")
    motions = {name: as_reals(values, f"q of {name!r}") for name, values in given.items()}
    for name, values in motions.items():
        if values.shape != (times.size, model.n):
            shape = f"({times.size}, {model.n})"
            raise ShapeError(f"q of {name!r}: expected shape {shape}, got {values.shape}.")
    labels = list(motions) if len(motions) > 1 else ["_motion"]
    units = over_time.joint_units(None, model.n, model, degrees)
    bounded = np.isfinite(model.lower) & np.isfinite(model.upper) & (model.upper > model.lower)
    count = model.n + bool(bounded.any())
    wide = style.as_columns(columns, count, 1 if count < 6 else 2)
    figure, order = style.panel_list(count, wide, 0.95, look)
    for j, (axes, unit) in enumerate(zip(order, units, strict=False)):
        k = unit.factor
        lines = k * np.stack([values[:, j] for values in motions.values()], axis=1)
        over_time.lines_over_time(axes, times, lines, labels)
        _draw_range(axes, k * float(model.lower[j]), k * float(model.upper[j]))
        axes.set_title(f"{names[j]} ({unit.value})", loc="left")
    if bounded.any():
        lower, upper = model.lower[bounded], model.upper[bounded]
        inside = np.stack([values[:, bounded] for values in motions.values()], axis=1)
        margin = np.minimum(inside - lower, upper - inside) / (0.5 * (upper - lower))
        axes = order[-1]
        over_time.lines_over_time(axes, times, 100.0 * margin.min(axis=2), labels)
        axes.set_title("least margin (%)", loc="left")
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, -0.08 * max(high, 1.0)), high)
        _shade_beyond(axes, 0.0, np.inf)
    return style.finished(figure, look, labels)


def _draw_range(axes: Axes, lower: float, upper: float) -> None:
    """The range of a joint from one limit to the other, with shades beyond."""
    low, high = axes.get_ylim()
    if np.isfinite(upper - lower) and upper > lower:
        margin = _MARGIN * (upper - lower)
        low = min(lower - margin, axes.dataLim.y0 - 0.3 * margin)
        high = max(upper + margin, axes.dataLim.y1 + 0.3 * margin)
        axes.set_yticks([lower, 0.5 * (lower + upper), upper])
        axes.yaxis.set_major_formatter(lambda x, _: f"{x:.3g}".replace("-", "\N{MINUS SIGN}"))
    axes.set_ylim(low, high)
    _shade_beyond(axes, lower, upper)


def _shade_beyond(axes: Axes, lower: float, upper: float) -> None:
    """Shades from the limits to the edges, and lines at the limits."""
    low, high = axes.get_ylim()
    for limit, edge in ((lower, low), (upper, high)):
        if low <= limit <= high:
            ends = sorted((limit, edge))
            axes.axhspan(*ends, facecolor=ALERT, alpha=0.16, linewidth=0.0, label=BEYOND)
            axes.axhline(limit, color=INK, zorder=1.5, label=LIMIT, **DASHED)
    axes.set_ylim(low, high)
