"""What the signal processing of an identification keeps of a log, and what it cuts off."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..errors import InvalidValueError, ShapeError
from ..identification.preparation.filters import decimation_window, zero_phase
from ..identification.preparation.processing import Processing
from ..logs import Log
from ..model import RobotModel
from .figures import LIMIT_DASHES, PAGE, SMALL_SIZE, legend_above, line_style, new_figure, panels
from .palette import ALERT, BAND, INK
from .plot_decades import plain_decades
from .plot_units import joint_names, joint_units

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BEFORE, _AFTER = line_style(1).color, line_style(0).color
_LONGEST = 1 << 18
"""Samples of the longest recording that spectra are made of, at most."""
_SEGMENTS = 2
_KAISER = 18.0
"""Of the window: noise is more than six decades below the motion, which must not leak over it."""
_BINS = 240


def plot_processing(
    log: Log,
    processing: Processing,
    *,
    model: RobotModel | None = None,
    title: str | None = None,
    size: ArrayLike | None = None,
) -> Figure:
    """Spectra of positions and torques before and after what a processing does to them.

    Parameters
    ----------
    log : Log
        The log.
    processing : Processing
        The choices, of `identification.choose_processing`.
    model : RobotModel, optional
        The robot, for units and names of its joints.
    title : str, optional
        Over the figure.
    size : array_like, shape (2,), optional
        Width and height, inches.

    Returns
    -------
    matplotlib.figure.Figure
        A row for each joint: positions with the frequency of the motion, the cutoff of the filter
        and the noise; torques with the cutoff of the decimation. What is right of the cutoffs, on
        grey, is cut; its root mean square stands over each panel. Densities are averaged over
        bins of equal width on the logarithmic axis.

    Raises
    ------
    InvalidValueError, ShapeError
        Not a log, not a processing, or of other joints; fewer than 16 samples.
    MissingExtraError
        Matplotlib is not installed.

    References
    ----------
    Seed book sections 1.6.2.4 and 1.6.2.5.

    Examples
    --------
    >>> from robotmodels.identification import choose_processing
    >>> rng, t = np.random.default_rng(0), np.arange(0.0, 20.0, 0.001)[:, None]
    >>> log = Log(0.001, np.sin(6.0 * t) + rng.normal(0.0, 1e-4, t.shape), np.cos(6.0 * t))
    >>> [axes.get_xlabel() for axes in plot_processing(log, choose_processing(log)).axes]
    ['frequency (Hz)', 'frequency (Hz)']
    """
    if not isinstance(log, Log):
        raise InvalidValueError(f"log: expected a Log, got {type(log).__name__}.")
    if not isinstance(processing, Processing):
        raise InvalidValueError(
            "processing: expected a Processing of choose_processing, got "
            f"{type(processing).__name__}."
        )
    if len(processing.dead_band) != log.n:
        raise ShapeError(
            f"processing: expected one of {log.n} joints, got {len(processing.dead_band)}."
        )
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
    figure = new_figure(PAGE, 1.1 + 1.15 * log.n, size)
    grid = panels(figure, log.n, 2, sharex=True)
    sides: tuple[tuple[Array, Array, float | None, list[str]], ...] = (
        (q, kept_q, processing.cutoff, units),
        (tau, kept_tau, processing.torque_cutoff, efforts),
    )
    nyquist = 0.5 / log.dt
    for column, (whole, kept, cutoff, of) in enumerate(sides):
        f, before = _density(whole[inner], log.dt)
        _, after = _density(kept[inner], log.dt)
        cut = np.sqrt(np.mean((whole - kept)[inner] ** 2, axis=0))
        for j, name in enumerate(names):
            axes = grid[j, column]
            axes.loglog(f, before[:, j], color=_BEFORE, linewidth=0.9, label="as recorded")
            axes.loglog(
                f, after[:, j], color=_AFTER, linewidth=1.2, linestyle=(0, (5.0, 1.0)), label="kept"
            )
            if cutoff is not None:
                axes.axvspan(cutoff, nyquist, color=BAND, linewidth=0.0, zorder=0.4)
                axes.axvline(
                    cutoff, color=INK, linewidth=0.9, linestyle=(0, (6.0, 1.3, 1.3, 1.3)),
                    label="cutoff",
                )  # fmt: skip
            axes.axvline(processing.motion, color=INK, linewidth=0.9, linestyle=LIMIT_DASHES,
                         label="motion: 99.9 % of the velocity's power")  # fmt: skip
            if column == 0:
                floor = _floor(f, before[:, j], nyquist)
                if floor > 0.0:
                    axes.axhline(floor, color=ALERT, linewidth=0.9, linestyle=(0, (1.3, 1.1)),
                                 label="noise of the positions")  # fmt: skip
            _limit(axes, before[:, j], after[:, j])
            what = ("position", "torque")[column]
            axes.set_title(f"{name}, {what}: {cut[j]:.2g} {of[j]} rms cut", loc="left",
                           size=SMALL_SIZE, color=INK, pad=2.0)  # fmt: skip
            axes.set_ylabel(f"({of[j]}/√Hz)" if " or " not in of[j] else "density (1/√Hz)")
        grid[-1, column].set_xlabel("frequency (Hz)")
    for axes in grid.flat:
        plain_decades(axes.yaxis, 4)
        plain_decades(axes.xaxis, 6)
    handles: dict[str, Any] = {}
    for axes in grid[0]:
        for line in axes.get_lines():
            handles.setdefault(str(line.get_label()), line)
    legend_above(figure, list(handles.values()), title)
    return figure


def _thinned(tau: Array, step: int) -> Array:
    """Through the decimation's low-pass, at the rate of the log."""
    if step == 1:
        return tau
    from scipy.signal import fftconvolve

    window = decimation_window(step)
    weights = fftconvolve(np.ones(len(tau)), window, mode="same")
    return fftconvolve(tau, window[:, None], mode="same") / weights[:, None]


def _inner(N: int, processing: Processing) -> slice:
    """Rows far enough from the ends, as far as enough are left."""
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
    """Density of the noise: the usual one at the frequencies that no motion has."""
    high = (f > 0.5 * nyquist) & (f < 0.9 * nyquist)
    return float(np.median(density[high])) if high.any() else 0.0


def _limit(axes: Any, before: Array, after: Array) -> None:
    """Not so far down that rounding is all there is to see."""
    top = float(max(before.max(initial=0.0), after.max(initial=0.0)))
    if top <= 0.0:
        axes.set_ylim(1e-12, 1.0)
        return
    least = before[before > 0.0]
    low = max(float(least.min(initial=top)) / 3.0, 1e-12 * top)
    axes.set_ylim(low, 3.0 * top)
