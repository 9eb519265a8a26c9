"""Figures of identifications: torques, residuals, parameters, exciting trajectories.

Parameters
----------
result : IdentificationResult
    Of `identification.fit`.
test : Log, optional
    Held-out log of the same joints.

Returns
-------
matplotlib.figure.Figure

References
----------
Seed book sections 1.6.2 and 1.6.5.

Examples
--------
>>> from robotmodels.datasets import example_log
>>> from robotmodels.identification import fit
>>> result = fit(*example_log())
>>> [axes.get_ylabel() for axes in plot_identification_torques(result).axes]
['torque (N m)', 'torque (N m)']
>>> plot_identification_residuals(result).axes[0].get_ylabel()
'residual (N m)'
>>> [axes.get_title() for axes in plot_identification_parameters(result).axes]
['bodies', 'drives and friction']
>>> plot_identification_standard_errors(result).axes[0].get_ylabel()
'relative standard error (%)'
>>> plot_identification_correlations(result).axes[1].get_ylabel()
'correlation'
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..dynamics import idm
from ..errors import ShapeError
from ..geometry import PRISMATIC
from ..identification.equations import Equations
from ..identification.excitation import ExcitingTrajectory
from ..identification.excitation.result import ExcitationStatus
from ..identification.report_tables import effort_units, group_names, group_units
from ..identification.residuals import residual_diagnostics
from ..identification.result import IdentificationResult, check_result, predicted_torque, validate
from ..identification.signals import piece_signals, pieces
from ..identification.weak_parameters import WEAK
from ..logs import Log
from . import over_time, style
from .style import BAND, DASHED, INK, PAGE, PALE, PALETTE, ZERO

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BAND: dict[str, Any] = {"color": BAND, "linewidth": 0.0, "zorder": 0.5}
_POINTS = 700  # groups of samples of a log that are drawn
_RESIDUALS = 4000  # residuals that are drawn
_BODIES = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
_NORMAL = 1.959964  # half the width of a 95 % interval in standard errors
_IN_A_ROW = 48  # bars
_MOST = 14.0  # logarithm of the largest condition number that is drawn


def as_result(result: Any, test: Any = None) -> IdentificationResult:
    """The result, and whether the test is a log of the robot, checked."""
    check_result(result)
    if test is not None and style.as_instance(test, Log, "test", "").n != result.model.n:
        raise ShapeError(f"test: expected a log of {result.model.n} joints, got {test.n}.")
    return result


@style.plot
def plot_identification_torques(
    result: IdentificationResult,
    test: Log | None = None,
    *,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Measured and predicted torques over time and their difference, a row for each joint.

    Samples are drawn as envelopes, so that peaks of long logs remain visible. Grey areas are in the
    dead band, whose equations are excluded. The title of each panel gives the error relative to
    the measured torque. A held-out log is drawn in a second column, in the same scale.
    """
    found = as_result(result, test)
    logs = [("fitted", found.equations.log, found.validation.in_sample)]
    if test is not None:
        logs.append(("held out", test, validate(found, test)))
    n, units = found.model.n, effort_units(found.model)
    widths = [max(log.duration, 0.25 * logs[0][1].duration) for _, log, _ in logs]
    figure, grid = style.panels(
        PAGE, 0.9 + 1.15 * n, size, n, len(logs), sharex="col", sharey="row", width_ratios=widths
    )
    for column, (word, log, errors) in zip(grid.T, logs, strict=True):
        signals, slow_t, slow = _torques(found, log)
        for j, axes in enumerate(column):
            place = axes.get_xaxis_transform()
            area = {"step": "mid", "transform": place, "label": "dead band"} | _BAND
            axes.fill_between(slow_t, 0.0, 1.0, where=slow[:, j], **area)
            axes.axhline(0.0, **ZERO)
            for k, width, label in (
                (3, 0.8, "measured"),
                (1, 0.8, "measured less predicted"),
                (0, 1.1, "predicted"),
            ):
                t, y = signals[label]
                axes.plot(t[:, j], y[:, j], color=PALETTE[k], linewidth=width, label=label)
            # the second column may be narrow: its joints are named beside it
            name = f"{found.model.table.joint_names[j]}, " if word == "fitted" else ""
            axes.set_title(f"{name}{word}: {100.0 * errors.relative[j]:.3g} %", loc="left")
        column[-1].set_xlabel("time (s)")
    for axes, unit in zip(grid[:, 0], units, strict=True):
        axes.set_ylabel(f"{'force' if unit == 'N' else 'torque'} ({unit})")
    return style.finished(figure, title, ("measured", "measured less predicted", "predicted"))


def _torques(
    result: IdentificationResult, log: Log
) -> tuple[dict[str, tuple[Array, Array]], Array, Array]:
    """Envelopes of the torques of a log, NaN between recordings; times in the dead band."""
    chosen = result.equations.processing
    step = max(1, len(log) // _POINTS)
    words = ("measured", "predicted", "measured less predicted")
    parts: dict[str, list[tuple[Array, Array]]] = {word: [] for word in words}
    slow_t, slow = [], []
    gap = np.full((1, log.n), np.nan)
    begin = None
    for piece in pieces(log, chosen):
        signals = piece_signals(log, chosen, piece, 0)
        tau = predicted_torque(result, signals.q, signals.v, signals.a)
        for word, y in zip(words, (signals.tau, tau, signals.tau - tau), strict=True):
            if begin is not None and piece.begin != begin:
                parts[word].append((gap, gap))
            parts[word].append(_envelope(signals.t, y, step))
        begin = piece.begin
        starts = np.arange(0, len(signals), step)
        counts = np.diff(np.append(starts, len(signals)))
        inside = (np.abs(signals.v) < chosen.dead_band).astype(float)
        slow_t.append(signals.t[starts] + 0.5 * (counts - 1) * log.dt)
        slow.append(np.add.reduceat(inside, starts, axis=0) > 0.5 * counts[:, None])
    joined = {
        word: (np.concatenate([t for t, _ in part]), np.concatenate([y for _, y in part]))
        for word, part in parts.items()
    }
    return joined, np.concatenate(slow_t), np.concatenate(slow)


def _envelope(t: Array, y: Array, step: int) -> tuple[Array, Array]:
    """The least and the greatest of every so many samples, in their order.

    Shapes: t (N,), y (N, m) -> t, y (k, m).
    """
    N, m = y.shape
    if step <= 2 or not N:
        return np.repeat(t[:, None], m, axis=1), y
    rows = -(-N // step)
    # the last samples are repeated until the last group is full
    groups = y[np.minimum(np.arange(rows * step), N - 1).reshape(rows, step)]
    pairs = np.sort(np.stack((groups.argmin(axis=1), groups.argmax(axis=1)), axis=1), axis=1)
    place = np.minimum(pairs + (np.arange(rows) * step)[:, None, None], N - 1).reshape(-1, m)
    return t[place], np.take_along_axis(y, place, axis=0)


@style.plot
def plot_identification_residuals(
    result: IdentificationResult,
    test: Log | None = None,
    *,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Residuals of the equations with two standard deviations, and their autocorrelation.

    A row for each kind of equations; on the right the 95 % band of white residuals. The residuals
    of a held-out log replace those of the fitted one; the standard deviation is that of the fit.
    """
    found = as_result(result, test)
    system = found.equations if test is None else found.equations.with_log(test)
    names, units, sigma = group_names(found), group_units(found), found.estimate.sigma
    t, e, far = _residuals(system, found.values, sigma)
    correlation = residual_diagnostics(system, found.values)
    lag = np.arange(1, correlation.lags + 1) / found.equations.processing.rate
    figure, grid = style.panels(
        PAGE, 0.9 + 1.1 * len(names), size, len(names), 2, sharex="col", width_ratios=[2.2, 1.0]
    )
    dot = {"color": PALETTE[0], "markersize": 1.4, "markeredgewidth": 0.0}
    both = "two standard deviations; 95 % of white residuals"
    for j, (left, right) in enumerate(grid):
        left.axhspan(-2.0 * sigma[j], 2.0 * sigma[j], label=both, **_BAND)
        left.plot(t, e[:, j], "o", label="residual; its autocorrelation", **dot)
        left.set_ylabel(f"residual ({units[j]})")
        left.set_title(f"{names[j]}: {100.0 * far[j]:.2g} % outside", loc="left")
        bound = correlation.bounds[j, 1:]
        right.fill_between(lag, -bound, bound, **_BAND)
        right.vlines(lag, 0.0, correlation.autocorrelation[j, 1:], color=PALETTE[0], linewidth=1.2)
        right.set(ylim=(-1.05, 1.05), xlim=(0.0, 1.03 * float(lag[-1])))
        for axes in (left, right):
            axes.axhline(0.0, **ZERO)
    grid[0, 1].set_title("autocorrelation", loc="left")
    grid[-1, 0].set_xlabel("time (s)")
    grid[-1, 1].set_xlabel("lag (s)")
    return style.finished(figure, title, (both,))


def _residuals(system: Equations, values: Array, sigma: Array) -> tuple[Array, Array, Array]:
    """Times and residuals (NaN where excluded), the largest of each group if there are many.

    Also the share of residuals beyond two standard deviations.
    """
    step = max(1, int(np.ceil(len(system.log) / system.processing.decimation / _RESIDUALS)))
    far, total = np.zeros(system.groups), np.zeros(system.groups)
    times, rows = [], []
    for block in system.blocks():
        e = np.where(block.use, block.y - block.W @ values, np.nan)
        far += (np.abs(e) > 2.0 * sigma).sum(axis=0)
        total += block.use.sum(axis=0)
        for start in range(0, len(e), step):
            group = np.nan_to_num(np.abs(e[start : start + step]), nan=-1.0)
            times.append(block.t[start])
            rows.append(e[start + group.argmax(axis=0), np.arange(e.shape[1])])
    with np.errstate(invalid="ignore"):
        return np.array(times), np.array(rows).reshape(-1, system.groups), far / total


@style.plot
def plot_identification_parameters(
    result: IdentificationResult, *, title: str | None = None, size: ArrayLike | None = None
) -> Figure:
    """Parameters with their 95 % intervals, as contributions to the torques.

    Values of different units compare by their effect: the root mean square torque of the parameter
    alone on the log, relative to the measured torques, with its sign. A parameter whose interval
    contains zero is not significant. A panel for the bodies and one for the drives.
    """
    found = as_result(result)
    effect = 100.0 * _effects(found)
    value, half = effect * found.values, _NORMAL * effect * found.standard_errors
    weak = found.relative_errors > WEAK
    body = np.array([name.rstrip("0123456789") in _BODIES for name in found.names])
    groups = {"bodies": np.flatnonzero(body), "drives and friction": np.flatnonzero(~body)}
    groups = {word: some for word, some in groups.items() if some.size}
    most = max(some.size for some in groups.values())
    figure, grid = style.panels(PAGE, 1.0 + 0.155 * max(most, 8), size, 1, len(groups))
    weakly = f"standard error above {100 * WEAK:.0f} %"
    for axes, (word, some) in zip(grid[0], groups.items(), strict=True):
        names = [found.names[k] for k in some]
        kinds = {"determined": ~weak[some], weakly: weak[some]}
        style.interval_panel(axes, names, value[some], half[some], kinds, len(groups) > 1)
        axes.set_xlabel("effect on the torques (%)")
        axes.set_title(word)
    return style.finished(figure, title)


def _effects(result: IdentificationResult) -> Array:
    """Root mean square of each column, relative to the measured side. Shapes: -> (b,)."""
    sigma = result.estimate.sigma
    top = float(sigma.max(initial=0.0))
    weights = 1.0 / np.maximum(sigma, 1e-9 * top) if top > 0.0 else np.ones(len(sigma))
    squares = np.zeros(len(result.names) + 1)
    for R, w in zip(result.factors.factors, weights, strict=True):
        squares += w * w * (R**2).sum(axis=0)
    return np.sqrt(squares[:-1] / squares[-1]) if squares[-1] > 0.0 else 0.0 * squares[:-1]


@style.plot
def plot_identification_standard_errors(
    result: IdentificationResult, *, title: str | None = None, size: ArrayLike | None = None
) -> Figure:
    """Relative standard errors of the parameters, the largest first.

    Bars: corrected for correlated residuals; lines: for white residuals, as usually published.
    Dashed: 30 %, above which a parameter is poorly determined.
    """
    found = as_result(result)
    relative = 100.0 * found.relative_errors
    with np.errstate(divide="ignore", invalid="ignore"):
        white = 100.0 * found.details.iid_standard_errors / np.abs(found.values)
    order = np.argsort(-relative, kind="stable")
    rows = max(1, -(-len(order) // _IN_A_ROW))
    each = -(-len(order) // rows)
    figure, grid = style.panels(PAGE, 0.7 + 1.8 * rows, size, rows, 1, sharey=True)
    finite = relative[np.isfinite(relative) & (relative > 0.0)]
    low = float(finite.min(initial=100.0 * WEAK)) / 2.0
    high = 1.3 * float(finite.max(initial=100.0 * WEAK))
    for row, axes in enumerate(grid[:, 0]):
        some = order[row * each : (row + 1) * each]
        x = np.arange(len(some))
        # a value of zero has an infinite relative standard error: full bar
        height = np.clip(np.where(np.isfinite(relative[some]), relative[some], high), low, None)
        weak = relative[some] > 100.0 * WEAK
        for k, (mask, label) in enumerate(((~weak, "determined"), (weak, "poorly determined"))):
            if mask.any():
                axes.bar(x[mask], height[mask] - low, 0.7, low, color=PALETTE[k], label=label)
        axes.hlines(white[some], x - 0.42, x + 0.42, color=INK, label="if residuals were white")
        axes.axhline(100.0 * WEAK, color=INK, label="_limit", **DASHED)
        axes.set_yscale("log")
        axes.set_ylim(low, high)
        style.plain_logarithmic(axes.yaxis)
        axes.set_xlim(-0.8, each - 0.2)
        axes.set_xticks(x, [found.names[k] for k in some], rotation=90)
        axes.grid(False, axis="x")
        axes.set_ylabel("relative standard error (%)")
    return style.finished(figure, title, ("determined", "poorly determined"))


@style.plot
def plot_identification_correlations(
    result: IdentificationResult, *, title: str | None = None, size: ArrayLike | None = None
) -> Figure:
    """Correlations of the estimates; strongly correlated pairs are dark."""
    found = as_result(result)
    return style.correlation_figure(found.estimate.correlation, found.names, title, size)


@style.plot
def plot_excitation(
    found: ExcitingTrajectory, *, title: str | None = None, size: ArrayLike | None = None
) -> Figure:
    """Motion and torques of an exciting trajectory within their limits, and its search.

    Panels of position, velocity, acceleration and torque over one period, joints of different
    units in columns of their own, limits dashed; below them the criterion over the iterations of
    every start, and that of random motions beside those of the starts, before and after.

    Parameters
    ----------
    found : ExcitingTrajectory
        Of `identification.excitation.exciting_trajectory`.

    Examples
    --------
    >>> from robotmodels.identification.excitation import exciting_trajectory
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r")
    >>> found = exciting_trajectory(arm, starts=1, baseline=4, iterations=5, rng=0)
    >>> figure = plot_excitation(found)
    >>> [" ".join(axes.get_ylabel().split()) for axes in figure.axes[:2]]
    ['position (rad)', 'velocity (rad/s)']
    """
    style.as_instance(found, ExcitingTrajectory, "found", "exciting_trajectory")
    model, limits = found.model, found.limits.motion.limits
    motion = over_time.sampled(found.trajectory)
    drive, n = model.drive, model.n
    parameters = (model.inertia.values, drive.Ia, drive.Fv, drive.Fc, drive.offset)
    rows = 3 + any(values.any() for values in parameters)  # torques of a robot that has some
    torque = idm(model, *motion.values[:3]) if rows == 4 else np.empty((0, n))
    labels = over_time.joint_names(None, n, model)
    columns = over_time.joints_by_unit(over_time.joint_units(None, n, model))
    figure, _ = style.panels(PAGE, 2.9 + 1.1 * rows + 0.02 * n, size, rows=0)
    parts: Any = figure.subfigures(2, 1, height_ratios=[1.1 * rows, 1.9])
    above, below = parts
    grid = above.subplots(rows, len(columns), squeeze=False, sharex=True)
    sigma = model.table.sigma[model.table.joint_rows]
    for column, (unit, joints) in zip(grid.T, columns.items(), strict=True):
        for order, axes in enumerate(column[:3]):
            over_time.quantity_over_time(axes, motion, order, joints, unit, labels, limits)
        if rows == 4:
            most, names = found.limits.torque_limits[joints], [labels[j] for j in joints]
            over_time.lines_over_time(
                column[3], motion.t, torque[:, joints], names, joints, -most, most
            )
            force = sigma[joints[0]] == PRISMATIC
            column[3].set_ylabel("force\n(N)" if force else "torque\n(N m)")
        column[-1].set_xlabel("time (s)")
    left, right = below.subplots(1, 2)
    _draw_search(left, found)
    _draw_baseline(right, found)
    if title is None:
        title = (
            f"{model.name}: condition number {found.condition:.4g}, {found.scaled_condition:.3g} "
            "with scaled columns"
        )
    return style.finished(figure, title, labels)


def _draw_search(axes: Axes, found: ExcitingTrajectory) -> None:
    """The smooth criterion over the iterations; the best start in front."""
    best = min(range(len(found.starts)), key=lambda k: found.starts[k].rank(found.criterion))
    ratio = found.criterion == "condition"
    for k, start in enumerate(found.starts):
        # penalties of limits that cannot be kept exceed all numbers
        y = np.exp(np.minimum(start.history, _MOST)) if ratio else np.asarray(start.history)
        color, width = (PALETTE[0], 1.3) if k == best else (PALE, 0.8)
        x = np.arange(1, len(y) + 1)
        axes.plot(x, y, color=color, linewidth=width, zorder=2 + (k == best), label="_start")
    for end in np.cumsum(found.starts[best].stages)[:-1]:
        axes.axvline(end, color=PALE, zorder=1.5, **DASHED)
    _scale_criterion(axes, ratio)
    axes.set_xlabel("iteration")
    axes.set_ylabel("smooth condition number" if ratio else "smooth criterion")
    axes.set_title("every start; dashed: next stage")


def _draw_baseline(axes: Axes, found: ExcitingTrajectory) -> None:
    """The criterion of random motions and of the starts, before and after."""
    feasible = [s for s in found.starts if s.status is not ExcitationStatus.INFEASIBLE]
    groups = {
        "random": (found.baseline, PALE),
        "starts": ([start.before for start in found.starts], PALETTE[1]),
        "improved": ([start.after for start in feasible], PALETTE[0]),
    }
    for k, (judged, color) in enumerate(groups.values()):
        values = np.array([one.of(found.criterion) for one in judged])
        values = values[np.isfinite(values)]
        # spread evenly, so that equal values stay visible
        x = k + 0.25 * np.sin(2.4 * np.arange(len(values)))
        axes.plot(x, values, "o", color=color, markersize=2.6, alpha=0.8, label="_values")
        if len(values):
            median = [float(np.median(values))] * 2
            axes.plot([k - 0.32, k + 0.32], median, color=INK, label="_median")
    ratio = found.criterion == "condition"
    _scale_criterion(axes, ratio)
    axes.set_xlim(-0.6, 2.6)
    axes.set_xticks(range(3), list(groups))
    axes.set_ylabel("condition number" if ratio else "minus log det")
    axes.set_title("line: median")


def _scale_criterion(axes: Axes, ratio: bool) -> None:
    """Logarithmic scale of condition numbers."""
    if ratio:
        axes.set_yscale("log")
        style.plain_logarithmic(axes.yaxis, 8, style.subdivisions(axes.get_ylim()))
