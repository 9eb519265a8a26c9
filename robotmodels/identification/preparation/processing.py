"""Choices of the signal processing, and the rules by which a log suggests them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, Rebuilt, as_floats, read_only
from ...errors import InvalidValueError, ShapeError
from ...logs import Log
from .filters import central_differences, decimation_window, zero_phase
from .position_noise import noise_draw, noise_levels
from .spectrum import power_density

_POWER = 0.999
"""Part of the power of the velocities below the frequency that the motion is said to have."""
_POSITIONS = 10.0
"""Cutoff of the positions, in frequencies of the motion."""
_TORQUES = 2.5
"""Cutoff of the decimation, in frequencies of the motion."""
_HALF = 0.4
"""Where the decimation's window falls to half, in sampling rates after it."""
_SLOW = 0.003
"""Dead band relative to the greatest velocity."""
_NOISY = 4.0
"""Dead band relative to the deviation of the velocities' noise."""
_ABOVE = 10.0
"""Density relative to that of the noise below which a spectrum is noise."""
_FEW = 100.0
"""Steps of an encoder over which a joint moves at least where its motion is judged."""
_LEVELS = 20
"""Parts of a spectrum over which the level of the noise is averaged."""
_SMEAR = 0.3
"""Periods of the cutoff over which a step of the acceleration is smeared on either side."""
_EDGE = 2.0
"""Periods of the cutoff after which the filter's transient is gone from what a fit could see."""
_HIGHEST = 0.4
"""Cutoff of the positions at most, in sampling rates."""
_BULK, _FAR, _WIDER = 0.95, 8.0, 3.0
"""Frequencies beyond eight times that of 95 % of the power are noise; the motion ends at thrice."""
_MOVES = 1e-3
"""Power of a joint's velocity in a window, relative to the greatest, below which it rests."""
_WINDOWS = 8
"""Windows of the log at most that spectra are made of."""
_LONGEST = 16.0
"""Seconds of the windows that spectra are averaged over."""


@dataclass(frozen=True, slots=True, eq=False)
class Processing(Rebuilt):
    """Every choice between a log and the equations that are made of it. Read-only.

    Parameters
    ----------
    dt : float
        Sampling period of the log, seconds.
    cutoff : float or None
        Hz, where the zero-phase filter of positions (and of velocities and accelerations, where the
        log has them) is at -3 dB; None for no filter.
    order : int
        Of each of its two passes.
    accuracy : int
        Order of the central differences: 2, 4 or 6.
    decimation : int
        Samples of the log for one equation of each joint; 1 keeps all.
    dead_band : ndarray, shape (n,)
        Velocities (rad/s or m/s) below which a joint's equations are left out, since the direction
        of its dry friction is not known there, and samples of the guard beside them as well.
    edges : int
        Samples cut at both ends of each recording, of every channel.
    motion : float
        Hz: frequency below which the velocities have 99.9 % of their power.
    notes : tuple of str
        Why these.

    References
    ----------
    Seed book sections 1.6.2.4 and 1.6.2.5.
    """

    dt: float
    cutoff: float | None
    order: int
    accuracy: int
    decimation: int
    dead_band: Array
    edges: int
    motion: float
    notes: tuple[str, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "dead_band", read_only(self.dead_band))

    @property
    def rate(self) -> float:
        """Equations of each joint per second."""
        return 1.0 / (self.dt * self.decimation)

    @property
    def torque_cutoff(self) -> float | None:
        """Hz, where the decimation's window falls to half; None without decimation."""
        return None if self.decimation == 1 else _HALF * self.rate

    @property
    def guard(self) -> int:
        """Samples on either side of a dead band over which the filter smears a reversal."""
        if self.cutoff is None or not self.dead_band.any():
            return 0
        return int(np.ceil(_SMEAR / (self.cutoff * self.dt)))

    @property
    def reach(self) -> int:
        """Samples of the log on either side of an equation that it is made of."""
        return len(decimation_window(self.decimation)) // 2


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
    """Choices for a log: those that are given, the others from what the log shows.

    The motion has the frequency below which the velocities have 99.9 % of their power (that of
    noise taken off). Positions are cut off at ten times that, so that they are not distorted;
    regressor and torque at two and a half times that, by the decimation. Velocities below 0.3 % of
    a joint's greatest velocity, or below four standard deviations of its velocity noise, form its
    dead band; samples within 0.3 periods of the cutoff beside it are left out as well. This is a
    choice from the log alone; `fit` also uses the robot.

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
        Of the filter's passes and of the central differences.
    filtered : bool
        False takes positions (and velocities and accelerations of the log) as they are.

    Returns
    -------
    Processing
        Every choice, with its reason.

    Raises
    ------
    InvalidValueError, ShapeError
        Numbers that make no sense; a recording that is shorter than its edges.

    References
    ----------
    Seed book sections 1.6.2.4 and 1.6.2.5; M. Gautier, "Dynamic identification of robots with power
    model", IEEE ICRA 1997 (filter frequencies from that of the motion).

    Examples
    --------
    >>> t = np.arange(0.0, 20.0, 0.001)[:, None]
    >>> swing = Log(0.001, np.sin(2 * np.pi * t), np.cos(2 * np.pi * t))
    >>> chosen = choose_processing(swing)
    >>> round(chosen.motion, 1), round(chosen.cutoff), chosen.decimation
    (1.1, 11, 150)
    """
    motion, noise = motion_of(log)
    notes: list[str] = []
    if not filtered:
        if cutoff is not None:
            raise InvalidValueError("cutoff: filtered=False leaves the positions as they are.")
        notes.append("Positions are not filtered.")
        band = None
    elif cutoff is None:
        band = min(_POSITIONS * motion, _HIGHEST / log.dt)
        notes.append(
            f"Positions are low-pass filtered at {band:.3g} Hz, {band / motion:.3g} times the "
            "frequency of the motion."
        )
    else:
        band = checked_cutoff(log, cutoff)
        notes.append(requested_cutoff(band))
    longest = max(part.stop - part.start for part in log.recordings())
    if decimation is None:
        step = max(1, min(int(_HALF / (log.dt * _TORQUES * motion)), longest // 20))
    else:
        step = checked_decimation(log, decimation)
    notes.append(decimated(step, log.dt))
    return completed(
        log, motion, noise, band, step, dead_band, edges, tuple(notes), order, accuracy
    )


def completed(
    log: Log, motion: float, noise: Array, band: float | None, step: int,
    dead_band: ArrayLike | None, edges: float | None, reasons: tuple[str, ...],
    order: int = 4, accuracy: int = 4,
) -> Processing:  # fmt: skip
    """A processing of these cutoffs, with the dead bands and edges that go with them."""
    longest = max(part.stop - part.start for part in log.recordings())
    notes = [
        f"The velocities have {100 * _POWER:g} % of their power below {motion:.3g} Hz; noise of "
        f"the positions {_listed(noise)} (standard deviation).",
        *reasons,
    ]
    return Processing(
        log.dt, band, order, accuracy, step,
        _dead_band(log, dead_band, noise, motion, band, notes),
        _edges(log, edges, band, longest, notes), motion, tuple(notes),
    )  # fmt: skip


def checked_cutoff(log: Log, cutoff: float) -> float:
    """A cutoff that the user gives, below half the sampling rate."""
    band = float(as_floats(cutoff, "cutoff"))
    if not 0.0 < band < 0.5 / log.dt:
        raise InvalidValueError(
            "cutoff: expected a frequency between 0 and half the sampling rate "
            f"({0.5 / log.dt:g} Hz), got {cutoff!r}."
        )
    return band


def checked_decimation(log: Log, asked: int) -> int:
    """A decimation that the user gives, within the longest recording."""
    longest = max(part.stop - part.start for part in log.recordings())
    if not isinstance(asked, (int, np.integer)) or not 1 <= asked <= longest:
        raise InvalidValueError(
            f"decimation: expected a whole number from 1 to {longest} (samples of the longest "
            f"recording), got {asked!r}."
        )
    return int(asked)


def requested_cutoff(band: float) -> str:
    """Sentence on a cutoff that the user gave."""
    return f"Positions are low-pass filtered at {band:.3g} Hz, as requested."


def decimated(step: int, dt: float) -> str:
    """Sentence on the decimation."""
    if step == 1:
        return "No decimation."
    return (
        f"Regressor and torque are low-pass filtered at {_HALF / (step * dt):.3g} Hz, and one of "
        f"{step} samples is kept."
    )


def _dead_band(
    log: Log, asked: ArrayLike | None, noise: Array, motion: float, band: float | None,
    notes: list[str],
) -> Array:  # fmt: skip
    if asked is not None:
        width = as_floats(asked, "dead_band")
        if width.shape not in ((), (log.n,)):
            raise ShapeError(
                f"dead_band: expected one velocity, or shape ({log.n},), got {width.shape}."
            )
        if (width < 0.0).any():
            raise InvalidValueError(f"dead_band: expected no negative velocity, got {width.min()}.")
        return np.broadcast_to(width, (log.n,)).copy()
    # white noise of density s^2 / (fs / 2) through a low-pass and a derivative
    f = min(band or np.inf, 0.5 / log.dt)
    velocity_noise = noise * 2.0 * np.pi * f * np.sqrt(2.0 * f * log.dt / 3.0)
    fastest = _fastest(log, min(_POSITIONS * motion, _HIGHEST / log.dt))
    width = np.maximum(_SLOW * fastest, _NOISY * velocity_noise)
    notes.append(f"Dead band of the velocities: {_listed(width)}.")
    return width


def _edges(
    log: Log, asked: float | None, band: float | None, longest: int, notes: list[str]
) -> int:
    if asked is not None:
        seconds = float(as_floats(asked, "edges"))
        if not seconds >= 0.0:
            raise InvalidValueError(f"edges: expected seconds from 0, got {asked!r}.")
        cut = round(seconds / log.dt)
    else:
        cut = 0 if band is None else int(np.ceil(_EDGE / (band * log.dt)))
    if 2 * cut >= longest:
        raise InvalidValueError(
            f"edges: {cut} samples are cut at both ends, but the longest recording has {longest}; "
            "give a shorter edges=, a higher cutoff=, or a longer log."
        )
    short = [part.stop - part.start for part in log.recordings()]
    short = [length for length in short if length <= 2 * cut]
    if short:
        notes.append(
            f"{len(short)} of {len(log.starts)} recordings ({sum(short)} samples) are not longer "
            "than the edges that are cut, and say nothing."
        )
    if cut:
        notes.append(f"{cut} samples ({cut * log.dt:.3g} s) are cut at both ends.")
    return cut


def _windows(log: Log) -> list[slice]:
    """A bounded part of the log: windows spread over each recording, at most `_WINDOWS` in all."""
    length = max(8, int(_LONGEST / log.dt))
    parts = [part for part in log.recordings() if part.stop - part.start >= 8]
    if not parts:
        longest = max(part.stop - part.start for part in log.recordings())
        raise InvalidValueError(
            f"log: its longest recording has {longest} samples, of which no spectrum can be made."
        )
    if len(parts) > _WINDOWS:
        parts = [parts[k] for k in np.linspace(0, len(parts) - 1, _WINDOWS).round().astype(int)]
    each = max(1, _WINDOWS // len(parts))
    found = []
    for part in parts:
        count = min(each, -(-(part.stop - part.start) // length))
        last = max(part.start, part.stop - length)
        starts = np.linspace(part.start, last, count).round().astype(int).tolist()
        found += [slice(start, min(start + length, part.stop)) for start in starts]
    return found


def motion_of(log: Log) -> tuple[float, Array]:
    """Frequency of the motion, and standard deviation of the positions' noise."""
    rate = 1.0 / log.dt
    rng = np.random.default_rng(0)
    levels = noise_levels(log)
    bands, powers = [], []
    for part in _windows(log):
        q = np.asarray(log.q[part])
        noise = noise_draw(q, log.dt, levels, rng)
        both = np.diff(np.concatenate((q, noise), axis=1), axis=0) * rate
        f, P = power_density(both, rate, len(both))
        found = [_band(f[1:], P[1:, j], P[1:, log.n + j]) for j in range(log.n)]
        bands.append([max(band, float(f[1])) for band, _ in found])
        powers.append([power for _, power in found])
    power = np.array(powers)
    # where a joint hardly moves, or over few steps of its encoder, its motion does not show
    moves = (power > 0.0) & (power > _MOVES * power.max(axis=0))
    moves &= np.ptp(np.asarray(log.q), axis=0) > _FEW * levels.step
    # and a joint whose noise is as large as its motion shows less than the others
    clear = moves & (power > 2.0 * (levels.deviation * rate) ** 2)
    moves = clear if clear.any() else moves
    motion = float(np.where(moves, bands, 0.0).max())
    if not motion > 0.0:
        motion = float(np.min(bands))
    return motion, levels.deviation


def _band(f: Array, P: Array, noise: Array) -> tuple[float, float]:
    """Frequency of a joint's motion and its power, from spectra of its velocity and their noise."""
    width = max(3, 2 * (len(P) // 1000) + 1)
    if len(P) < width:
        return float(f[0]), float(P.sum())
    # of positions, so that their level changes little within the average
    gain = np.sin(0.5 * np.pi * f / f[-1]) ** 2
    # the noise is a level, not lines: an average over many frequencies does not scatter
    S, N = _averaged(P / gain, width), _averaged(noise / gain, 2 * (len(P) // _LEVELS) + 3)
    left = np.where(S >= _ABOVE * N, np.maximum(P - gain * N, 0.0), 0.0)
    power = np.cumsum(left)
    if not power[-1] > 0.0:
        return 0.0, 0.0
    most, bulk = (float(f[int(np.searchsorted(power, x * power[-1]))]) for x in (_POWER, _BULK))
    # power far beyond the frequencies of most of it is noise that the model of it does not have
    return (_WIDER * bulk if most > _FAR * bulk else most), float(power[-1])


def _averaged(S: Array, width: int) -> Array:
    return np.convolve(np.pad(S, width // 2, mode="edge"), np.full(width, 1.0 / width), "valid")


def _fastest(log: Log, cutoff: float | None) -> Array:
    """Greatest velocities, noise filtered away, but for one in a hundred samples."""
    found = np.zeros(log.n)
    for part in _windows(log):
        q = np.array(log.q[part])
        if cutoff is not None and len(q) > 1:
            q = zero_phase(q, cutoff, log.dt)
        v = np.abs(central_differences(q, log.dt, 2))
        found = np.maximum(found, np.percentile(v, 99.0, axis=0))
    return found


def _listed(values: Array) -> str:
    return " ".join(f"{value:.2g}" for value in values)
