"""Figure of the processing of a log: spectra, cutoffs, and the criteria of their choice."""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np

from .._arrays import Array
from .._choices import as_instance
from ..errors import InvalidValueError, ShapeError
from ..identification.equations import Equations
from ..identification.position_noise import predicted_bias
from ..identification.processing import (
    LEAST_EQUATIONS,
    MOST_BIAS,
    decimation_for,
    equations_per_parameter,
)
from ..identification.result import IdentificationResult
from ..identification.signals import Processing, decimation_window, zero_phase
from ..logs import Log
from ..model import RobotModel
from . import style
from .over_time import joint_names, joint_units
from .style import ALERT, BAND, DASHED, INK, PAGE, PALETTE, Axes, Figure, Look

_KEPT = (0, (5.0, 1.0))
_POSITIONS, _TORQUES, _BOUNDS = (0, (6.0, 1.3, 1.3, 1.3)), (0, (1.3, 1.8)), (0, (2.2, 2.2))
_NOISE: dict[str, Any] = {"color": ALERT, "linewidth": 0.9, "linestyle": (0, (1.3, 1.1))}
_LONGEST = 1 << 18  # samples for spectra
_KAISER = 18.0  # window of the spectra: its leakage is six decades below the motion
_BINS = 240
_CUTOFFS, _WIDTH, _HIGHEST = 16, 10.0, 0.4
"""Cutoffs at which the effect of the noise is predicted; the highest of them, in cutoffs of the
equations and in sampling rates."""
_LEAST_BIAS = 1e-6  # standard errors


@style.plot
def plot_processing(
    log: Log | IdentificationResult,
    processing: Processing | None = None,
    *,
    model: RobotModel | None = None,
    **look: Unpack[Look],
) -> Figure:
    """Spectra of positions and torques before and after processing, and the criteria of its choice.

    A row for each joint has densities of position and torque, with the frequency of the motion, the
    cutoffs of the positions (their filter) and of regressor and torques (the decimation), and the
    noise of the positions. The grey part is removed; the title gives its root mean square. For a
    result a last row has the criteria: the largest bias of a parameter that noise of the positions
    is predicted to cause, and the equations for each parameter. Dots mark the choice.

    Parameters
    ----------
    log : Log or IdentificationResult
        The log; or a result of `identification.fit`, which contains its log, processing and robot.
    processing : Processing, optional
        The choices for a log, of `identification.choose_processing`.
    model, **look
        The robot of a log, for units and names of its joints; see `robotmodels.viz`.

    Returns
    -------
    matplotlib.figure.Figure

    References
    ----------
    Book sections 1.6.2.4 and 1.6.2.5; W. Fuller, "Measurement Error Models", 1987, section
    1.1 (bias by noise in the regressor).

    Examples
    --------
    >>> from robotmodels.identification import choose_processing
    >>> rng, t = np.random.default_rng(0), np.arange(0.0, 20.0, 0.001)[:, None]
    >>> log = Log(0.001, np.sin(6.0 * t) + rng.normal(0.0, 1e-4, t.shape), np.cos(6.0 * t))
    >>> [axes.get_xlabel() for axes in plot_processing(log, choose_processing(log)).axes]
    ['frequency (Hz)', 'frequency (Hz)']
    """
    system = None
    if isinstance(log, IdentificationResult):
        if processing is not None or model is not None:
            raise InvalidValueError(
                "processing, model: the result contains them; leave them out, or give its log."
            )
        system, model = log.equations, log.model
        log, processing = system.log, system.processing
    as_instance(log, Log, "log", " or an IdentificationResult")
    chosen = as_instance(processing, Processing, "processing", " of choose_processing")
    if len(chosen.dead_band) != log.n:
        raise ShapeError(
            f"processing: expected one of {log.n} joints, got {len(chosen.dead_band)}."
        )
    part = max(log.recordings(), key=lambda rows: rows.stop - rows.start)
    rows = slice(part.start, min(part.stop, part.start + _LONGEST))
    N = rows.stop - rows.start
    if N < 16:
        raise InvalidValueError(
            f"log: its longest recording has {N} samples; expected at least 16 for a spectrum."
        )
    q, tau = np.array(log.q[rows]), np.array(log.tau[rows])
    filtered = q if chosen.cutoff is None else zero_phase(q, chosen.cutoff, log.dt, chosen.order)
    names, units = joint_names(None, log.n, model), joint_units(None, log.n, model)
    kinds = [unit.value for unit in units]
    efforts = [{"rad": "N m", "m": "N"}.get(unit, "N m or N") for unit in kinds]
    edge = min(chosen.edges, N // 4)
    inner = slice(edge, N - edge)  # without transients
    count = log.n + (system is not None)
    figure, grid = style.panels(PAGE, 1.2 + 1.15 * count, look, count, 2, sharex=True)
    decimated = _decimated(tau, chosen.decimation)
    for column, what, whole, kept, cutoff, of in (
        (grid[:, 0], "position", q, filtered, chosen.cutoff, kinds),
        (grid[:, 1], "torque", tau, decimated, chosen.torque_cutoff, efforts),
    ):
        f, before = _density(whole[inner], log.dt)
        _, after = _density(kept[inner], log.dt)
        cut, rms = (np.sqrt(np.mean(x[inner] ** 2, axis=0)) for x in (whole - kept, whole))
        for j, axes in enumerate(column[: log.n]):
            axes.loglog(f, before[:, j], color=PALETTE[1], linewidth=0.9, label="as recorded")
            axes.loglog(f, after[:, j], color=PALETTE[0], linestyle=_KEPT, label="kept")
            if cutoff is not None:
                axes.axvspan(cutoff, 0.5 / log.dt, color=BAND, linewidth=0.0, zorder=0.4)
            _draw_frequencies(axes, chosen)
            high = (f > 0.25 / log.dt) & (f < 0.45 / log.dt)  # frequencies without motion
            noise = float(np.median(before[high, j])) if high.any() else 0.0
            if what == "position" and noise > 0.0:
                axes.axhline(noise, label="noise of the positions", **_NOISE)
            y = np.concatenate((before[:, j], after[:, j]))
            top = float(y.max()) or 1.0
            axes.set_ylim(max(before[:, j].min() / 3.0, 1e-12 * top), 3.0 * top)
            relative = what == "torque" and rms[j] > 0.0
            share = f" ({100.0 * cut[j] / rms[j]:.2g} %)" if relative else ""
            axes.set_title(f"{names[j]}: {cut[j]:.2g} {of[j]} rms{share} cut", loc="left")
            axes.set_ylabel(f"{what}\n({'1' if ' or ' in of[j] else of[j]}/√Hz)")
        column[-1].set_xlabel("frequency (Hz)")
    if system is not None:
        _draw_criteria(grid[-1], system)
    for axes in grid.flat:
        style.plain_logarithmic(axes.yaxis, 4)
        style.plain_logarithmic(axes.xaxis)
    return style.finished(figure, look)


def _draw_frequencies(axes: Axes, processing: Processing) -> None:
    """Lines at the frequency of the motion and at both cutoffs."""
    for frequency, dashes, label in (
        (processing.motion, DASHED["linestyle"], "motion: 99.9 % of the velocity's power"),
        (processing.cutoff, _POSITIONS, "cutoff of the positions"),
        (processing.torque_cutoff, _TORQUES, "cutoff of regressor and torques"),
    ):
        if frequency is not None:
            axes.axvline(frequency, color=INK, linewidth=1.1, linestyle=dashes, label=label)  # type: ignore[arg-type]


def _draw_criteria(row: Any, system: Equations) -> None:
    """Bias by noise and equations for each parameter against cutoffs, with their bounds."""
    base, log, processing = system.base, system.log, system.processing
    top = _HIGHEST / log.dt
    torque = processing.torque_cutoff or top
    lower = min(processing.cutoff or top, torque)
    lowest, highest = min(processing.motion, lower), max(min(_WIDTH * lower, top), torque)
    f = np.union1d(np.geomspace(lowest, highest, _CUTOFFS), (lower, torque))
    bias = predicted_bias(base, log, lowest, highest)
    ratios = [bias(x) for x in f]
    biases = np.array([ratio.max(initial=0.0) for ratio in ratios])
    chosen = ratios[int(np.searchsorted(f, lower))]
    worst = int(np.argmax(chosen))

    def equations(decimation: int) -> float:
        return equations_per_parameter(base, log, system.groups, decimation)

    counts = np.array([equations(decimation_for(x, log.dt)) for x in f])
    count = equations(processing.decimation)
    bounds = f"bounds: {MOST_BIAS:g} standard errors, {LEAST_EQUATIONS} equations"
    # without noise there is no bias, and logarithmic axes have no place for it
    biases = np.where(biases > 0.0, biases, np.nan)
    for axes, curve, cutoff, value, bound in (
        (row[0], biases, lower, max(chosen[worst], _LEAST_BIAS), MOST_BIAS),
        (row[1], counts, torque, count, LEAST_EQUATIONS),
    ):
        axes.loglog(f, curve, color=PALETTE[4], label="at other cutoffs")
        axes.axhline(bound, color=ALERT, linewidth=0.9, linestyle=_BOUNDS, label=bounds)
        axes.plot(cutoff, value, "o", color=INK, markersize=4.0, clip_on=False, label="choice")
        _draw_frequencies(axes, processing)
        low, high = axes.get_ylim()
        axes.set_ylim(max(min(low, bound / 3.0), _LEAST_BIAS), max(high, 3.0 * bound))
    worst_text = f"{chosen[worst]:.2g} standard errors ({base.names[worst]})"
    row[0].set_title(f"bias by noise: {worst_text}", loc="left")
    row[0].set(xlabel="lower of both cutoffs (Hz)", ylabel="bias /\nstandard error")
    row[1].set_title(f"about {count:.3g} equations for each parameter", loc="left")
    row[1].set(xlabel="cutoff of regressor and torques (Hz)", ylabel="equations /\nparameter")


def _decimated(tau: Array, step: int) -> Array:
    """Signals through the low-pass filter of the decimation, at the rate of the log."""
    if step == 1:
        return tau
    from scipy.signal import fftconvolve

    window = decimation_window(step)
    weights = fftconvolve(np.ones(len(tau)), window, mode="same")
    return fftconvolve(tau, window[:, None], mode="same") / weights[:, None]


def _density(x: Array, dt: float) -> tuple[Array, Array]:
    """Frequencies and root of the power spectral density, averaged in bins of equal ratio."""
    from scipy.signal import get_window, welch

    window = get_window(("kaiser", _KAISER), max(8, len(x) // 2))
    f, P = welch(x, 1.0 / dt, window=window, detrend="linear", axis=0)  # type: ignore[arg-type]
    f, P = f[1:], P[1:]
    edges = np.geomspace(f[0], f[-1] * (1.0 + 1e-9), _BINS + 1)
    _, first = np.unique(np.searchsorted(edges, f, side="right"), return_index=True)
    counts = np.diff([*first, len(f)])
    power = np.add.reduceat(P, first, axis=0) / counts[:, None]
    return np.add.reduceat(f, first) / counts, np.sqrt(power)
