"""Figures of identifications: torques, residuals, parameters, exciting trajectories.

Parameters
----------
result, found : IdentificationResult and ExcitingTrajectory
    Of `identification.fit` and `identification.excitation.exciting_trajectory`.
test : Log, optional
    Held-out log of the same joints.

Returns
-------
matplotlib.figure.Figure

References
----------
Book sections 1.6.2 and 1.6.5.

Examples
--------
>>> from robotmodels.datasets import example_log
>>> from robotmodels.identification import fit
>>> result = fit(*example_log())
>>> [axes.get_ylabel() for axes in plot_identification_torques(result).axes]
['torque (N m)', 'torque (N m)']
"""

from __future__ import annotations

from math import ceil
from typing import Any, Unpack

import numpy as np

from .._arrays import Array
from .._choices import as_instance
from ..dynamics import idm
from ..errors import ShapeError
from ..identification.excitation import ExcitingTrajectory
from ..identification.excitation.result import ExcitationStatus
from ..identification.report_tables import WEAK, group_names, group_units
from ..identification.result import IdentificationResult, check_result, predicted_torque, validate
from ..identification.signals import piece_signals, pieces
from ..identification.validation import residual_diagnostics
from ..logs import Log
from . import over_time, style
from .style import BAND, DASHED, INK, PAGE, PALE, PALETTE, ZERO, Axes, Figure, Look

_WORDS = ("measured", "predicted", "measured less predicted")
_BAND: dict[str, Any] = {"color": BAND, "linewidth": 0.0, "zorder": 0.5}
_POINTS = 700  # groups of samples of a log that are drawn
_RESIDUALS = 4000  # residuals that are drawn
_BODIES = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
_NORMAL = 1.959964  # half the width of a 95 % interval in standard errors
_MOST = 14.0  # logarithm of the largest condition number that is drawn


def as_result(result: Any, test: Any = None) -> IdentificationResult:
    """The result, and whether the test is a log of the robot, checked."""
    check_result(result)
    if test is not None and as_instance(test, Log, "test").n != result.model.n:
        raise ShapeError(f"test: expected a log of {result.model.n} joints, got {test.n}.")
    return result


@style.plot
def plot_identification_torques(
    result: IdentificationResult, test: Log | None = None, **look: Unpack[Look]
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
    n, names = found.model.n, found.model.table.joint_names
    widths = [max(log.duration, 0.25 * logs[0][1].duration) for _, log, _ in logs]
    shared: dict[str, Any] = {"sharex": "col", "sharey": "row", "width_ratios": widths}
    figure, grid = style.panels(PAGE, 0.9 + 1.15 * n, look, n, len(logs), **shared)
    for column, (word, log, errors) in zip(grid.T, logs, strict=True):
        t, y, slow_t, slow = _torques(found, log)
        for j, axes in enumerate(column):
            place = axes.get_xaxis_transform()
            area = {"step": "mid", "transform": place, "label": "dead band"} | _BAND
            axes.fill_between(slow_t, 0.0, 1.0, where=slow[:, j], **area)
            axes.axhline(0.0, **ZERO)
            for k, color, width in ((0, 3, 0.8), (2, 1, 0.8), (1, 0, 1.1)):
                line = {"color": PALETTE[color], "linewidth": width, "label": _WORDS[k]}
                axes.plot(t[:, k, j], y[:, k, j], **line)
            # the second column may be narrow: its joints are named beside it
            name = f"{names[j]}, " if word == "fitted" else ""
            axes.set_title(f"{name}{word}: {100.0 * errors.relative[j]:.3g} %", loc="left")
        column[-1].set_xlabel("time (s)")
    for axes, unit in zip(grid[:, 0], over_time.effort_units(found.model), strict=True):
        axes.set_ylabel(f"{'force' if unit == 'N' else 'torque'} ({unit})")
    return style.finished(figure, look, (_WORDS[0], _WORDS[2], _WORDS[1]))


def _torques(result: IdentificationResult, log: Log) -> tuple[Array, Array, Array, Array]:
    """Envelopes of the torques of a log, NaN between recordings, and when joints are slow.

    Shapes: -> times and values (K, 3, n), times (L,) and flags (L, n).
    """
    chosen = result.equations.processing
    step = max(1, len(log) // _POINTS)
    gap, begin = np.full((2, 1, 3 * log.n), np.nan), None
    parts: list[Any] = []
    slow: list[Any] = []
    for piece in pieces(log, chosen):
        s = piece_signals(log, chosen, piece, 0)
        tau = predicted_torque(result, s.q, s.v, s.a)
        if begin is not None and piece.begin != begin:
            parts.append(gap)
        begin = piece.begin
        parts.append(_envelope(s.t, np.hstack((s.tau, tau, s.tau - tau)), step))
        slow.append((s.t[::step], (np.abs(s.v) < chosen.dead_band)[::step]))
    t, y = (np.concatenate(some).reshape(-1, 3, log.n) for some in zip(*parts, strict=True))
    slow_t, flags = (np.concatenate(some) for some in zip(*slow, strict=True))
    return t, y, slow_t, flags


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
    least = np.nan_to_num(groups, nan=np.inf).argmin(axis=1)
    greatest = np.nan_to_num(groups, nan=-np.inf).argmax(axis=1)
    pairs = np.sort(np.stack((least, greatest), axis=1), axis=1)
    place = np.minimum(pairs + (np.arange(rows) * step)[:, None, None], N - 1).reshape(-1, m)
    return t[place], np.take_along_axis(y, place, axis=0)


@style.plot
def plot_identification_residuals(
    result: IdentificationResult, test: Log | None = None, **look: Unpack[Look]
) -> Figure:
    """Residuals of the equations with two standard deviations, and their autocorrelation.

    A row for each kind of equations; on the right the 95 % band of white residuals. The residuals
    of a held-out log replace those of the fitted one; the standard deviation is that of the fit.
    """
    found = as_result(result, test)
    system = found.equations if test is None else found.equations.with_log(test)
    names, units, sigma = group_names(found), group_units(found), found.estimate.sigma
    step = ceil(len(system.log) / system.processing.decimation / _RESIDUALS)
    far, parts = np.zeros((2, system.groups)), list[tuple[Array, Array]]()
    for block in system.blocks():
        e = np.where(block.use, block.y - block.W @ found.values, np.nan)
        far += (np.abs(e) > 2.0 * sigma).sum(axis=0), block.use.sum(axis=0)
        parts.append(_envelope(block.t, e, step))
    t, e = (np.concatenate(some) for some in zip(*parts, strict=True))
    correlation = residual_diagnostics(system, found.values)
    lag = np.arange(1, correlation.lags + 1) / found.equations.processing.rate
    shared: dict[str, Any] = {"sharex": "col", "width_ratios": [2.2, 1.0]}
    figure, grid = style.panels(PAGE, 0.9 + 1.1 * len(names), look, len(names), 2, **shared)
    dot = {"color": PALETTE[0], "markersize": 1.4, "markeredgewidth": 0.0}
    both = "two standard deviations; 95 % of white residuals"
    for j, (left, right) in enumerate(grid):
        left.axhspan(-2.0 * sigma[j], 2.0 * sigma[j], label=both, **_BAND)
        left.plot(t[:, j], e[:, j], "o", label="residual; its autocorrelation", **dot)
        left.set_ylabel(f"residual ({units[j]})")
        share = 100.0 * far[0, j] / max(far[1, j], 1.0)
        left.set_title(f"{names[j]}: {share:.2g} % outside", loc="left")
        bound = correlation.bounds[j, 1:]
        right.fill_between(lag, -bound, bound, **_BAND)
        right.vlines(lag, 0.0, correlation.autocorrelation[j, 1:], color=PALETTE[0], linewidth=1.2)
        right.set(ylim=(-1.05, 1.05), xlim=(0.0, 1.03 * float(lag[-1])))
        for axes in (left, right):
            axes.axhline(0.0, **ZERO)
    grid[0, 1].set_title("autocorrelation", loc="left")
    grid[-1, 0].set_xlabel("time (s)")
    grid[-1, 1].set_xlabel("lag (s)")
    return style.finished(figure, look, (both,))


@style.plot
def plot_identification_parameters(result: IdentificationResult, **look: Unpack[Look]) -> Figure:
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
    both = (("bodies", np.flatnonzero(body)), ("drives and friction", np.flatnonzero(~body)))
    groups = [(word, some) for word, some in both if some.size]
    most = max(some.size for _, some in groups)
    figure, grid = style.panels(PAGE, 1.0 + 0.155 * max(most, 8), look, 1, len(groups))
    weakly = f"standard error above {100 * WEAK:.0f} %"
    for axes, (word, some) in zip(grid[0], groups, strict=True):
        kinds = {"determined": ~weak[some], weakly: weak[some]}
        names = [found.names[k] for k in some]
        style.interval_panel(axes, names, value[some], half[some], kinds)
        axes.set(xlabel="effect on the torques (%)", title=word)
    return style.finished(figure, look)


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
    result: IdentificationResult, **look: Unpack[Look]
) -> Figure:
    """Relative standard errors of the parameters, the largest first.

    Bars: corrected for correlated residuals; lines: for white residuals, as usually published.
    Dashed: 30 %, above which a parameter is poorly determined.
    """
    found = as_result(result)
    relative = 100.0 * found.relative_errors
    with np.errstate(divide="ignore", invalid="ignore"):
        white = 100.0 * found.details.iid_standard_errors / np.abs(found.values)
    order, x = np.argsort(-relative, kind="stable"), np.arange(len(relative))
    finite = relative[np.isfinite(relative) & (relative > 0.0)]
    low, high = (float(f(initial=100.0 * WEAK)) for f in (finite.min, finite.max))
    low, high = 0.5 * low, 1.3 * high
    # a value of zero has an infinite relative standard error: full bar
    height, weak = np.clip(relative[order], low, high), relative[order] > 100.0 * WEAK
    figure, ((axes,),) = style.panels(PAGE, 2.5, look)
    for k, (mask, label) in enumerate(((~weak, "determined"), (weak, "poorly determined"))):
        if mask.any():
            axes.bar(x[mask], height[mask] - low, 0.7, low, color=PALETTE[k], label=label)
    axes.hlines(white[order], x - 0.42, x + 0.42, color=INK, label="if residuals were white")
    axes.axhline(100.0 * WEAK, color=INK, label="_limit", **DASHED)
    axes.set(yscale="log", ylim=(low, high), ylabel="relative standard error (%)")
    style.plain_logarithmic(axes.yaxis)
    size = min(7.5, 350.0 / max(len(x), 1))  # points: names do not touch each other
    axes.set_xticks(x, [found.names[k] for k in order], rotation=90, fontsize=size)
    axes.grid(False, axis="x")
    return style.finished(figure, look, ("determined", "poorly determined"))


@style.plot
def plot_identification_correlations(result: IdentificationResult, **look: Unpack[Look]) -> Figure:
    """Correlations of the estimates; strongly correlated pairs are dark."""
    found = as_result(result)
    return style.correlation_figure(found.estimate.correlation, found.names, look)


@style.plot
def plot_excitation(found: ExcitingTrajectory, **look: Unpack[Look]) -> Figure:
    """Motion and torques of an exciting trajectory within their limits, and its search.

    Panels of position, velocity, acceleration and torque over one period, joints of different
    units in columns of their own, limits dashed; below them the criterion over the iterations of
    every start, and that of random motions beside those of the starts, before and after.
    """
    as_instance(found, ExcitingTrajectory, "found", " of exciting_trajectory")
    model, limits = found.model, found.limits.motion.limits
    motion = over_time.sampled(found.trajectory)
    drive, n = model.drive, model.n
    parameters = (model.inertia.values, drive.Ia, drive.Fv, drive.Fc, drive.offset)
    rows = 3 + any(values.any() for values in parameters)  # torques of a robot that has some
    (names, columns), efforts = over_time.joints_of(n, model), over_time.effort_units(model)
    figure, _ = style.panels(PAGE, 2.9 + 1.1 * rows + 0.02 * n, look, rows=0)
    parts: Any = figure.subfigures(2, 1, height_ratios=[1.1 * rows, 1.9])
    grid = parts[0].subplots(rows, len(columns), squeeze=False, sharex=True)
    for column, (unit, joints) in zip(grid.T, columns.items(), strict=True):
        for order, axes in enumerate(column[:3]):
            over_time.quantity_over_time(axes, motion, order, joints, unit, names, limits)
        if rows == 4:
            torque = idm(model, *motion.values[:3])[:, joints]
            most, some = found.limits.torque_limits[joints], [names[j] for j in joints]
            over_time.lines_over_time(column[3], motion.t, torque, some, joints, -most, most)
            effort = efforts[joints[0]]
            column[3].set_ylabel(f"{'force' if effort == 'N' else 'torque'}\n({effort})")
        column[-1].set_xlabel("time (s)")
    left, right = parts[1].subplots(1, 2)
    _draw_search(left, right, found)
    look["title"] = look.get("title") or (
        f"{model.name}: condition number {found.condition:.4g}, {found.scaled_condition:.3g} "
        "with scaled columns"
    )
    return style.finished(figure, look, names)


def _draw_search(left: Axes, right: Axes, found: ExcitingTrajectory) -> None:
    """The smooth criterion over the iterations; the criterion of random motions and of starts."""
    best = min(range(len(found.starts)), key=lambda k: found.starts[k].rank(found.criterion))
    ratio = found.criterion == "condition"
    for k, start in enumerate(found.starts):
        # penalties of limits that cannot be kept exceed all numbers
        y = np.exp(np.minimum(start.history, _MOST)) if ratio else np.asarray(start.history)
        color, width = (PALETTE[0], 1.3) if k == best else (PALE, 0.8)
        x = np.arange(1, len(y) + 1)
        left.plot(x, y, color=color, linewidth=width, zorder=2 + (k == best), label="_start")
    for end in np.cumsum(found.starts[best].stages)[:-1]:
        left.axvline(end, color=PALE, zorder=1.5, **DASHED)
    left.set(xlabel="iteration", ylabel="smooth condition number" if ratio else "smooth criterion")
    left.set_title("every start; dashed: next stage")
    feasible = [s for s in found.starts if s.status is not ExcitationStatus.INFEASIBLE]
    groups = (
        ("random", found.baseline, PALE),
        ("starts", [start.before for start in found.starts], PALETTE[1]),
        ("improved", [start.after for start in feasible], PALETTE[0]),
    )
    for k, (_, judged, color) in enumerate(groups):
        values = np.array([one.of(found.criterion) for one in judged])
        values = values[np.isfinite(values)]
        # spread evenly, so that equal values stay visible
        x = k + 0.25 * np.sin(2.4 * np.arange(len(values)))
        right.plot(x, values, "o", color=color, markersize=2.6, alpha=0.8, label="_values")
        if len(values):
            right.hlines(np.median(values), k - 0.32, k + 0.32, color=INK)
    right.set_xlim(-0.6, 2.6)
    right.set_xticks(range(3), [word for word, _, _ in groups])
    right.set(ylabel="condition number" if ratio else "minus log det", title="line: median")
    for axes in (left, right) if ratio else ():
        axes.set_yscale("log")
        style.plain_logarithmic(axes.yaxis, 8)
