"""Choice of the signal processing: by the motion and noise of a log, and by the predicted bias."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_count, as_floats, as_number
from ..errors import InvalidValueError, ShapeError
from ..logs import Log
from ..minimal_parameters import BaseParameters
from .delay import checked_cutoff
from .position_noise import PositionNoise, predicted_bias
from .signals import HALF, Processing, central_differences, zero_phase

CHOICES = ("cutoff", "decimation", "dead_band", "edges")
"""Options of `choose_processing` that `fit` accepts by name."""
LEAST_EQUATIONS = 20
"""Least number of equations for each parameter."""
MOST_BIAS = 0.1
"""Largest predicted bias by noise in the regressor, in standard errors."""
_OF_MOTION, _EQUATIONS_OF_MOTION = 10.0, 2.5
"""Cutoff of the positions and least cutoff of the equations, relative to the motion frequency."""
_NYQUIST = 0.4  # highest cutoff of the positions, relative to the sampling rate
_HIGHEST, _STEP, _WIDTH = 15.0, 1.3, 2.5
"""Highest cutoff of the equations in Hz (joints are flexible above); ratio of the cutoffs that are
tried; cutoff of the positions, in cutoffs of the equations, so that it does not distort them."""
_WINDOWS, _SECONDS = 8, 16.0
"""Largest number and length (s) of the windows for spectra and velocities."""


def choose_processing(
    log: Log,
    cutoff: float | None = None,
    decimation: int | None = None,
    dead_band: ArrayLike | None = None,
    edges: float | None = None,
    order: int = 4,
    accuracy: int = 4,
    filtered: bool = True,
) -> Processing:
    """Choose the processing of a log: given choices, the others from the log alone.

    The motion has the frequency below which the velocities have 99.9 % of their power (less the
    noise power). Positions are cut off at ten times that, regressor and torque at two and a half
    times that, by the decimation. Velocities below 0.3 % of a joint's greatest velocity, or below
    four standard deviations of its velocity noise, form its dead band; samples within 0.3 periods
    of the cutoff beside it are left out as well. `fit` also uses the robot for its choice.

    Parameters
    ----------
    log : Log
        The log.
    cutoff : float, optional
        Hz, -3 dB of the zero-phase filter of the positions.
    decimation : int, optional
        Samples for one equation of each joint; 1 keeps all.
    dead_band : array_like, scalar or shape (n,), optional
        rad/s or m/s; 0 leaves nothing out.
    edges : float, optional
        Seconds cut at both ends of each recording; default two periods of the cutoff.
    order, accuracy : int
        Order of the filter's passes, and of the central differences.
    filtered : bool
        False uses positions (and velocities and accelerations of the log) unfiltered.

    Returns
    -------
    Processing
        Every choice, with its reason.

    References
    ----------
    Book sections 1.6.2.4 and 1.6.2.5; M. Gautier, "Dynamic identification of robots with power
    model", IEEE ICRA 1997 (filter frequencies from that of the motion).

    Examples
    --------
    >>> t = np.arange(0.0, 20.0, 0.001)[:, None]
    >>> swing = Log(0.001, np.sin(2 * np.pi * t), np.cos(2 * np.pi * t))
    >>> chosen = choose_processing(swing)
    >>> round(chosen.motion, 2), chosen.decimation
    (1.06, 150)
    """
    motion, noise = motion_of(log)
    if not filtered:
        if cutoff is not None:
            raise InvalidValueError("cutoff: filtered=False needs no cutoff.")
        band, why = None, "Positions are not filtered."
    elif cutoff is None:
        band = min(_OF_MOTION * motion, _NYQUIST / log.dt)
        why = f"{_filtered(band)}, {band / motion:.3g} times the frequency of the motion."
    else:
        band = checked_cutoff(log, cutoff)
        why = f"{_filtered(band)}, as requested."
    if decimation is None:
        step = decimation_for(_EQUATIONS_OF_MOTION * motion, log.dt)
        decimation = max(1, min(step, _longest(log) // 20))
    choices = band, decimation, dead_band, edges, why, order, accuracy
    return _completed(log, motion, noise, *choices)


def processing_for(
    base: BaseParameters,
    log: Log,
    cutoff: float | None = None,
    decimation: int | None = None,
    dead_band: ArrayLike | None = None,
    edges: float | None = None,
    groups: int | None = None,
) -> Processing:
    """Choose the processing for a robot; ``groups`` equations at a time (default one per joint).

    The cutoff is the highest that biases no parameter by more than `MOST_BIAS` standard errors,
    the decimation leaves `LEAST_EQUATIONS` equations for each parameter where there are as many.
    """
    motion, noise = motion_of(log)
    most = max(1, int(equations_per_parameter(base, log, groups, 1) / LEAST_EQUATIONS))
    step = None if decimation is None else _checked_decimation(log, decimation)
    highest = min(max(_HIGHEST, _EQUATIONS_OF_MOTION * motion), _NYQUIST / log.dt)
    lowest = min(_EQUATIONS_OF_MOTION * motion, highest)
    why = (
        "so that their noise is predicted to bias no parameter by more than "
        f"{MOST_BIAS:g} standard errors"
    )
    if cutoff is not None:
        positions = checked_cutoff(log, cutoff)
        step = step or min(decimation_for(positions / _WIDTH, log.dt), most)
        band = min(positions, HALF / (step * log.dt), _NYQUIST / log.dt)
        ratio = predicted_bias(base, log, min(lowest, band), max(highest, band))(band)
        why = reason = "as requested"
    else:
        band = highest if step is None else min(highest, HALF / (step * log.dt))
        lowest = min(lowest, band)
        bias = predicted_bias(base, log, lowest, band)
        ratio = bias(band)
        if ratio.max(initial=0.0) > MOST_BIAS:
            why += (
                f". Equations up to {band:.3g} Hz would bias {base.names[int(np.argmax(ratio))]} "
                f"by {ratio.max():.2g} standard errors"
            )
        while ratio.max(initial=0.0) > MOST_BIAS and band > lowest:
            band = max(lowest, band / _STEP)
            ratio = bias(band)
        step = step or min(decimation_for(band, log.dt), most)
        # equations above the admissible noise bandwidth: lower cutoff of the positions
        wider = np.clip(_WIDTH * band * step * log.dt / HALF, 1.0, _WIDTH)
        positions = min(float(wider) * band, _NYQUIST / log.dt)
        reason = "the lowest for this motion"
    if ratio.max(initial=0.0) > MOST_BIAS:
        worst = int(np.argmax(ratio))
        why = (
            f"{reason}. Noise of the positions is predicted to bias parameters by up to "
            f"{ratio[worst]:.2g} standard errors ({base.names[worst]}) there; use a lower cutoff "
            "(processing=), better position signals, or method 'iv'"
        )
    why = f"{_filtered(positions)}, {why}."
    return _completed(log, motion, noise, positions, step, dead_band, edges, why)


def decimation_for(cutoff: float, dt: float) -> int:
    """Decimation that leaves frequencies up to ``cutoff`` Hz in the equations."""
    return max(1, int(HALF / (cutoff * dt) * (1.0 + 1e-9)))  # guard against rounding down


def equations_per_parameter(
    base: BaseParameters, log: Log, groups: int | None, decimation: int
) -> float:
    """Equations for each parameter, ``groups`` at a time; edges and dead bands not subtracted."""
    return len(log) * (groups or log.n) / (decimation * len(base))


def _completed(
    log: Log,
    motion: float,
    noise: Array,
    band: float | None,
    step: int,
    dead_band: ArrayLike | None,
    edges: float | None,
    why: str,
    order: int = 4,
    accuracy: int = 4,
) -> Processing:
    """Processing with these cutoffs, and the dead bands and edges that follow from them."""
    step, thinned = _checked_decimation(log, step), "No decimation."
    if step > 1:
        thinned = f"Regressor and torque are low-pass filtered at {HALF / (step * log.dt):.3g} Hz, "
        thinned += f"and one of {step} samples is kept."
    spectrum = f"The velocities have 99.9 % of their power below {motion:.3g} Hz; noise of the "
    spectrum += f"positions {_listed(noise)} (standard deviation)."
    notes = [spectrum, why, thinned]
    if dead_band is None:
        # white noise of density s^2 / (fs / 2) through a low-pass and a derivative
        f = min(band or np.inf, 0.5 / log.dt)
        velocity_noise = noise * 2.0 * np.pi * f * np.sqrt(2.0 * f * log.dt / 3.0)
        slow = min(_OF_MOTION * motion, _NYQUIST / log.dt)
        filtered = (zero_phase(q, slow, log.dt) for q in _windows(log))
        speeds = (np.abs(central_differences(q, log.dt, 2)) for q in filtered)
        fastest = np.max([np.percentile(v, 99.0, axis=0) for v in speeds], axis=0)
        width = np.maximum(0.003 * fastest, 4.0 * velocity_noise)
        notes.append(f"Dead band of the velocities: {_listed(width)}.")
    else:
        width = as_floats(dead_band, "dead_band")
        if width.shape not in ((), (log.n,)):
            raise ShapeError(
                f"dead_band: expected one velocity, or shape ({log.n},), got {width.shape}."
            )
        if (width < 0.0).any():
            raise InvalidValueError(f"dead_band: expected no negative velocity, got {width.min()}.")
    width = np.broadcast_to(width, (log.n,))
    cut = _edges(log, edges, band, notes)
    return Processing(log.dt, band, order, accuracy, step, width, cut, motion, tuple(notes))


def _edges(log: Log, edges: float | None, band: float | None, notes: list[str]) -> int:
    """Number of samples cut at both ends of each recording, and notes."""
    if edges is None:
        cut = 0 if band is None else int(np.ceil(2.0 / (band * log.dt)))
    else:
        cut = round(as_number(edges, "edges", least=0.0) / log.dt)
    if 2 * cut >= _longest(log):
        raise InvalidValueError(
            f"edges: {cut} samples are cut at both ends, but the longest recording has "
            f"{_longest(log)}; give shorter edges, a higher cutoff (processing=), or a longer log."
        )
    short = [part.stop - part.start for part in log.recordings()]
    short = [length for length in short if length <= 2 * cut]
    if short:
        notes.append(
            f"{len(short)} of {len(log.starts)} recordings ({sum(short)} samples) are not longer "
            "than the edges that are cut, and are left out."
        )
    if cut:
        notes.append(f"{cut} samples ({cut * log.dt:.3g} s) are cut at both ends.")
    return cut


def _checked_decimation(log: Log, step: int) -> int:
    """A decimation within the longest recording."""
    return as_count(step, "decimation", most=_longest(log))


def _filtered(band: float) -> str:
    return f"Positions are low-pass filtered at {band:.3g} Hz"


def _longest(log: Log) -> int:
    """Samples of the longest recording."""
    return max(part.stop - part.start for part in log.recordings())


def _listed(values: Array) -> str:
    return " ".join(f"{value:.2g}" for value in values)


def motion_of(log: Log) -> tuple[float, Array]:
    """Frequency of the motion, and standard deviation of the positions' noise (n,)."""
    from scipy.signal import periodogram

    rate, rng = 1.0 / log.dt, np.random.default_rng(0)
    noise = PositionNoise.of(log)
    bands, powers = [], []
    for q in _windows(log):
        both = np.diff(np.concatenate((q, noise.draw(q, log.dt, rng)), axis=1), axis=0) * rate
        f, P = periodogram(both, rate, "hann", axis=0)
        joints = np.array([_band(f[1:], P[1:, j], P[1:, log.n + j]) for j in range(log.n)])
        bands.append(np.maximum(joints[:, 0], f[1]))
        powers.append(joints[:, 1])
    power = np.array(powers)
    # joints that hardly move, or by few encoder steps, are excluded
    moves = (power > 0.0) & (power > 1e-3 * power.max(axis=0))
    moves &= np.ptp(np.asarray(log.q), axis=0) > 100.0 * noise.quantisation_step
    # and joints whose noise is as large as their motion
    clear = moves & (power > 2.0 * (noise.std * rate) ** 2)
    motion = float(np.where(clear if clear.any() else moves, bands, 0.0).max())
    return motion if motion > 0.0 else float(np.min(bands)), noise.std


def _windows(log: Log) -> list[Array]:
    """Positions in windows of bounded number and length, spread over the recordings."""
    length = max(8, int(_SECONDS / log.dt))
    parts = [part for part in log.recordings() if part.stop - part.start >= 8]
    if not parts:
        raise InvalidValueError(
            f"log: its longest recording has {_longest(log)} samples, which are too few for a "
            "spectrum."
        )
    spread = np.unique(np.linspace(0, len(parts) - 1, _WINDOWS).round().astype(int))
    windows = []
    for part in (parts[k] for k in spread):
        count = min(max(1, _WINDOWS // len(spread)), -(-(part.stop - part.start) // length))
        starts = np.linspace(part.start, max(part.start, part.stop - length), count).round()
        windows += [np.asarray(log.q[int(x) : min(int(x) + length, part.stop)]) for x in starts]
    return windows


def _band(f: Array, P: Array, noise: Array) -> tuple[float, float]:
    """Frequency of a joint's motion and its power, from spectra of its velocity and their noise."""
    from scipy.ndimage import uniform_filter1d

    width = max(3, 2 * (len(P) // 1000) + 1)
    if len(P) < width:
        return float(f[0]), float(P.sum())
    # of positions, so that their level changes little within the average
    gain = np.sin(0.5 * np.pi * f / f[-1]) ** 2
    # the noise spectrum is flat: an average over many frequencies has little variance
    S = uniform_filter1d(P / gain, width, mode="nearest")
    N = uniform_filter1d(noise / gain, 2 * (len(P) // 20) + 3, mode="nearest")
    power = np.cumsum(np.where(S >= 10.0 * N, np.maximum(P - gain * N, 0.0), 0.0))
    if not power[-1] > 0.0:
        return 0.0, 0.0
    most, bulk = (float(f[int(np.searchsorted(power, x * power[-1]))]) for x in (0.999, 0.95))
    # power at eight times the frequency of the motion is unmodelled noise
    return (3.0 * bulk if most > 8.0 * bulk else most), float(power[-1])


def checked_processing(given: object, log: Log) -> Processing | dict[str, Any]:
    """Check of a Processing against a log, or of options by name (None where not given)."""
    if isinstance(given, Processing):
        joints = len(given.dead_band)
        if joints != log.n or abs(given.dt - log.dt) > 1e-6 * log.dt:
            raise InvalidValueError(
                f"processing: it was chosen for {joints} joints and samples of {given.dt:g} s, the "
                f"log has {log.n} and {log.dt:g} s; leave out processing= for the default choice."
            )
        return given
    if given is not None and (not isinstance(given, Mapping) or set(given) - set(CHOICES)):
        raise InvalidValueError(
            f"processing: expected a Processing, or choices by name ({', '.join(CHOICES)}) such as "
            f"{{'cutoff': 10.0}}, got {given!r:.80}."
        )
    return dict.fromkeys(CHOICES) | dict(given or {})
