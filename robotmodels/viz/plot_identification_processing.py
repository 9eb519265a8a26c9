"""Spectra of a log before and after its processing, and the criteria of its choice."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
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
from .figures import LIMIT_DASHES, PAGE, SMALL_SIZE, legend_above, line_style, new_figure, panels
from .palette import ALERT, BAND, INK
from .plot_decades import plain_decades
from .plot_units import joint_names, joint_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BEFORE, _AFTER, _CURVE = line_style(1).color, line_style(0).color, line_style(4).color
_POSITIONS, _TORQUES, _BOUNDS = (0, (6.0, 1.3, 1.3, 1.3)), (0, (1.3, 1.8)), (0, (2.2, 2.2))
_LONGEST = 1 << 18
"""Largest number of samples for spectra."""
_SEGMENTS = 2
_KAISER = 18.0
"""Window of the spectra; its leakage is below the noise, six decades below the motion."""
_BINS = 240
_CUTOFFS, _WIDTH, _HIGHEST = 16, 10.0, 0.4
"""Cutoffs at which the effect of the noise is predicted; highest of them, in cutoffs of the
equations and in sampling rates."""
_LEAST_BIAS = 1e-6
"""Least drawn bias, in standard errors."""


def plot_processing(
    log: Log | IdentificationResult,
    processing: Processing | None = None,
    *,
    model: RobotModel | None = None,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Spectra of positions and torques before and after processing, and the criteria of its choice.

    Parameters
    ----------
    log : Log or IdentificationResult
        The log; or a result of `identification.fit`, which contains its log, processing and robot.
    processing : Processing, optional
        The choices for a log, of `identification.choose_processing`.
    model : RobotModel, optional
        The robot of a log, for units and names of its joints.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        A row for each joint: densities of position and torque, with the frequency of the motion,
        the cutoff of the positions (of their filter), the cutoff of regressor and torques (of the
        decimation) and the noise of the positions. The grey part above the cutoff is removed; the
        title gives its root mean square, for torques also relative. Densities are averaged over
        bins of equal width on the logarithmic axis.

        For a result, a last row shows the criteria: the largest bias of a parameter that noise of
        the positions is predicted to cause, in standard errors of the parameter, against the lower
        of both cutoffs; and the equations for each parameter (edges and dead bands not subtracted)
        against that of regressor and torques. Dots mark the choice, dashed lines its bounds. A bias
        below 1e-6 is drawn at the lower edge.

    Raises
    ------
    InvalidValueError, ShapeError
        Not a log, not a processing, or of other joints; fewer than 16 samples; a result together
        with a processing or a model.
    MissingExtraError
        Matplotlib is not installed.

    References
    ----------
    Seed book sections 1.6.2.4 and 1.6.2.5; W. Fuller, "Measurement Error Models", 1987, section
    1.1 (bias by noise in the regressor).

    Examples
    --------
    >>> from robotmodels.identification import choose_processing
    >>> rng, t = np.random.default_rng(0), np.arange(0.0, 20.0, 0.001)[:, None]
    >>> log = Log(0.001, np.sin(6.0 * t) + rng.normal(0.0, 1e-4, t.shape), np.cos(6.0 * t))
    >>> [axes.get_xlabel() for axes in plot_processing(log, choose_processing(log)).axes]
    ['frequency (Hz)', 'frequency (Hz)']
    """
    log, processing, model, system = _given(log, processing, model)
    part = max(log.recordings(), key=lambda rows: rows.stop - rows.start)
    rows = slice(part.start, min(part.stop, part.start + _LONGEST))
    if rows.stop - rows.start < 16:
        raise InvalidValueError(
            f"log: its longest recording has {rows.stop - rows.start} samples; expected at least "
            "16 for a spectrum."
        )
    q, tau = np.array(log.q[rows]), np.array(log.tau[rows])
    kept_q = (
        q
        if processing.cutoff is None
        else zero_phase(q, processing.cutoff, log.dt, processing.order)
    )
    kept_tau = _thinned(tau, processing.decimation)
    inner = _inner(len(q), processing)
    names = joint_names(None, log.n, model)
    units = [unit.value for unit in joint_units(None, log.n, model)]
    efforts = [{"rad": "N m", "m": "N"}.get(unit, "N m or N") for unit in units]
    rows_of = log.n + (system is not None)
    figure = new_figure(PAGE, 1.2 + 1.15 * rows_of, size)
    grid = panels(figure, rows_of, 2, sharex=True)
    sides: tuple[tuple[Array, Array, float | None, list[str]], ...] = (
        (q, kept_q, processing.cutoff, units),
        (tau, kept_tau, processing.torque_cutoff, efforts),
    )
    nyquist = 0.5 / log.dt
    for column, (whole, kept, cutoff, of) in enumerate(sides):
        f, before = _density(whole[inner], log.dt)
        _, after = _density(kept[inner], log.dt)
        cut, rms = (np.sqrt(np.mean(x[inner] ** 2, axis=0)) for x in (whole - kept, whole))
        for j, name in enumerate(names):
            axes = grid[j, column]
            axes.loglog(f, before[:, j], color=_BEFORE, linewidth=0.9, label="as recorded")
            axes.loglog(
                f, after[:, j], color=_AFTER, linewidth=1.2, linestyle=(0, (5.0, 1.0)), label="kept"
            )
            if cutoff is not None:
                axes.axvspan(cutoff, nyquist, color=BAND, linewidth=0.0, zorder=0.4)
            _frequencies(axes, processing)
            if column == 0:
                floor = _floor(f, before[:, j], nyquist)
                if floor > 0.0:
                    axes.axhline(floor, color=ALERT, linewidth=0.9, linestyle=(0, (1.3, 1.1)),
                                 label="noise of the positions")  # fmt: skip
            _limit(axes, before[:, j], after[:, j])
            what = ("position", "torque")[column]
            share = f" ({100.0 * cut[j] / rms[j]:.2g} %)" if column and rms[j] > 0.0 else ""
            _over(axes, f"{name}, {what}: {cut[j]:.2g} {of[j]} rms{share} cut")
            axes.set_ylabel(f"({of[j]}/√Hz)" if " or " not in of[j] else "density (1/√Hz)")
        grid[-1, column].set_xlabel("frequency (Hz)")
    if system is not None:
        _reasons(grid[-1], system)
    for axes in grid.flat:
        plain_decades(axes.yaxis, 4)
        plain_decades(axes.xaxis, 6)
    handles: dict[str, Any] = {}
    for axes in (*grid[0], grid[-1, 0]):
        for line in axes.get_lines():
            handles.setdefault(str(line.get_label()), line)
    legend_above(figure, list(handles.values()), title)
    return figure


def _given(
    log: Log | IdentificationResult, processing: Processing | None, model: RobotModel | None
) -> tuple[Log, Processing, RobotModel | None, Equations | None]:
    """Log, choices, robot and, of a result, its equations."""
    if isinstance(log, IdentificationResult):
        if processing is not None or model is not None:
            raise InvalidValueError(
                "processing, model: the result contains them; leave them out, or give its log."
            )
        return log.equations.log, log.equations.processing, log.model, log.equations
    if not isinstance(log, Log):
        raise InvalidValueError(
            f"log: expected a Log or an IdentificationResult, got {type(log).__name__}."
        )
    if not isinstance(processing, Processing):
        raise InvalidValueError(
            "processing: expected a Processing of choose_processing, got "
            f"{type(processing).__name__}."
        )
    if len(processing.dead_band) != log.n:
        raise ShapeError(
            f"processing: expected one of {log.n} joints, got {len(processing.dead_band)}."
        )
    return log, processing, model, None


def _frequencies(axes: Axes, processing: Processing) -> None:
    """Lines at the frequency of the motion and at both cutoffs."""
    for frequency, dashes, label in (
        (processing.motion, LIMIT_DASHES, "motion: 99.9 % of the velocity's power"),
        (processing.cutoff, _POSITIONS, "cutoff of the positions"),
        (processing.torque_cutoff, _TORQUES, "cutoff of regressor and torques"),
    ):
        if frequency is not None:
            axes.axvline(frequency, color=INK, linewidth=1.1, linestyle=dashes, label=label)


def _over(axes: Axes, text: str) -> None:
    axes.set_title(text, loc="left", size=SMALL_SIZE, color=INK, pad=2.0)


def _reasons(row: Any, system: Equations) -> None:
    """Bias by noise and equations for each parameter against cutoffs, with their bounds."""
    base, log, processing = system.base, system.log, system.processing
    top = _HIGHEST / log.dt
    thinned = processing.torque_cutoff or top
    lower = min(processing.cutoff or top, thinned)
    lowest, highest = min(processing.motion, lower), max(min(_WIDTH * lower, top), thinned)
    f = np.union1d(np.geomspace(lowest, highest, _CUTOFFS), (lower, thinned))
    bias = predicted_bias(base, log, lowest, highest)
    ratios = [bias(x) for x in f]
    biases = np.array([ratio.max(initial=0.0) for ratio in ratios])
    chosen = ratios[int(np.searchsorted(f, lower))]
    worst = int(np.argmax(chosen))
    counts = [
        equations_per_parameter(base, log, system.groups, decimation_for(x, log.dt)) for x in f
    ]
    count = equations_per_parameter(base, log, system.groups, processing.decimation)
    drawn = (
        # without noise there is no bias, and logarithmic axes have no place for it
        (np.where(biases > 0.0, biases, np.nan), lower, max(chosen[worst], _LEAST_BIAS), MOST_BIAS),
        (np.array(counts), thinned, count, LEAST_EQUATIONS),
    )
    bounds = f"bounds: {MOST_BIAS:g} standard errors, {LEAST_EQUATIONS} equations"
    for axes, (curve, cutoff, value, bound) in zip(row, drawn, strict=True):
        axes.loglog(f, curve, color=_CURVE, linewidth=1.2, label="at other cutoffs")
        axes.axhline(bound, color=ALERT, linewidth=0.9, linestyle=_BOUNDS, label=bounds)
        axes.plot(
            cutoff, value, "o", color=INK, markersize=4.0, clip_on=False, zorder=3.0, label="choice"
        )
        _frequencies(axes, processing)
        low, high = axes.get_ylim()
        axes.set_ylim(max(min(low, bound / 3.0), _LEAST_BIAS), max(high, 3.0 * bound))
    row[0].set_xlabel("lower of both cutoffs (Hz)")
    row[1].set_xlabel("cutoff of regressor and torques (Hz)")
    row[0].set_ylabel("bias /\nstandard error")
    row[1].set_ylabel("equations /\nparameter")
    _over(row[0], f"bias by noise: {chosen[worst]:.2g} standard errors ({base.names[worst]})")
    _over(row[1], f"about {count:.3g} equations for each parameter")


def _thinned(tau: Array, step: int) -> Array:
    """Signals through the decimation's low-pass, at the rate of the log."""
    if step == 1:
        return tau
    from scipy.signal import fftconvolve

    window = decimation_window(step)
    weights = fftconvolve(np.ones(len(tau)), window, mode="same")
    return fftconvolve(tau, window[:, None], mode="same") / weights[:, None]


def _inner(N: int, processing: Processing) -> slice:
    """Rows without the filter transients at the ends, where enough remain."""
    cut = min(processing.edges, N // 4)
    return slice(cut, N - cut)


def _density(x: Array, dt: float) -> tuple[Array, Array]:
    """Frequencies and root of the power spectral density, averaged in bins of equal ratio."""
    from scipy.signal import get_window, welch

    width = max(8, len(x) // _SEGMENTS)
    window = get_window(("kaiser", _KAISER), width)
    f, P = welch(x, 1.0 / dt, window=window, detrend="linear", axis=0)  # type: ignore[arg-type]
    f, P = f[1:], P[1:]
    edges = np.geomspace(f[0], f[-1] * (1.0 + 1e-9), _BINS + 1)
    place = np.searchsorted(edges, f, side="right")
    _, first = np.unique(place, return_index=True)
    counts = np.diff([*first, len(f)])[:, None]
    return (
        np.add.reduceat(f, first) / counts[:, 0],
        np.sqrt(np.add.reduceat(P, first, axis=0) / counts),
    )


def _floor(f: Array, density: Array, nyquist: float) -> float:
    """Noise density: median over frequencies without motion."""
    high = (f > 0.5 * nyquist) & (f < 0.9 * nyquist)
    return float(np.median(density[high])) if high.any() else 0.0


def _limit(axes: Any, before: Array, after: Array) -> None:
    """Lower limit of the axis, above rounding."""
    top = float(max(before.max(initial=0.0), after.max(initial=0.0)))
    if top <= 0.0:
        axes.set_ylim(1e-12, 1.0)
        return
    least = before[before > 0.0]
    low = max(float(least.min(initial=top)) / 3.0, 1e-12 * top)
    axes.set_ylim(low, 3.0 * top)
