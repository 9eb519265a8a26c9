"""Signal processing of a log: zero-phase filter, central differences, decimation, fixed pieces.

Book sections 1.6.2.4 and 1.6.2.5.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import astuple, dataclass
from functools import lru_cache

import numpy as np

from .._arrays import Array, Rebuilt, as_count, read_only
from ..errors import InvalidValueError
from ..logs import Log

PIECE = 16384
"""Samples per piece; fixed, so that results do not depend on the number of workers."""
_INSTANTS = 4096  # largest number of equation instants in a piece, which bounds memory
_BESIDE = 16  # samples beyond the decimation window that some equation forms use
_SETTLED = 1e-13  # relative filter transient after the settling time
_DIFFERENCES = {4: (2 / 3, -1 / 12), 6: (3 / 4, -3 / 20, 1 / 60)}
"""Weights of the central differences of orders 4 and 6."""
_HALF_WINDOW = 5  # half length of the decimation's window, in samples after decimation
HALF = 0.4
"""Frequency at which the gain of the decimation's window is 1/2, in sampling rates after it."""
_SMEAR = 0.3
"""Periods of the cutoff over which the filter spreads an acceleration step on either side."""


@dataclass(frozen=True, slots=True, eq=False)
class Processing(Rebuilt):
    """Signal processing from a log to its equations. Read-only.

    Parameters
    ----------
    dt : float
        Sampling period of the log, seconds.
    cutoff, order : float or None, int
        Hz, where the zero-phase filter of positions (and of velocities and accelerations, where the
        log has them) is at -3 dB, None for no filter; order of each of its two passes.
    accuracy : int
        Order of the central differences: 2, 4 or 6.
    decimation : int
        Samples of the log for one equation of each joint; 1 keeps all.
    dead_band : ndarray, shape (n,)
        Velocities (rad/s or m/s) below which a joint's equations are left out, since the sign of
        its dry friction is not known there; the guard samples beside them too.
    edges : int
        Samples cut at both ends of each recording, of every channel.
    motion : float
        Hz: frequency below which the velocities have 99.9 % of their power.
    notes : tuple of str
        Reasons for the values.
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
        as_count(self.order, "order")
        if self.accuracy not in (2, *_DIFFERENCES):
            raise InvalidValueError(f"accuracy: expected 2, 4 or 6, got {self.accuracy!r}.")
        object.__setattr__(self, "dead_band", read_only(self.dead_band))

    @property
    def rate(self) -> float:
        """Equations of each joint per second."""
        return 1.0 / (self.dt * self.decimation)

    @property
    def torque_cutoff(self) -> float | None:
        """Hz, where the gain of the decimation's window is 1/2; None without decimation."""
        return None if self.decimation == 1 else HALF * self.rate

    @property
    def guard(self) -> int:
        """Guard samples on either side of a dead band, over which the filter spreads a reversal."""
        if self.cutoff is None or not self.dead_band.any():
            return 0
        return int(np.ceil(_SMEAR / (self.cutoff * self.dt)))

    @property
    def reach(self) -> int:
        """Samples of the log on either side of an instant that its equations use."""
        return len(decimation_window(self.decimation)) // 2


@dataclass(frozen=True, slots=True, eq=False)
class Signals:
    """Filtered signals at the rate of the log: t (N,) in seconds; q, v, a and raw tau (N, n).

    ``before`` and ``after`` (k, n) are velocities of samples before the first and after the last.
    """

    t: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    before: Array | None = None
    after: Array | None = None

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True, slots=True)
class Piece:
    """Rows of a log processed together, and their recording without and with its edges."""

    start: int
    stop: int
    low: int
    high: int
    begin: int
    end: int


def zero_phase(x: Array, cutoff: float, dt: float, order: int = 4) -> Array:
    """Butterworth low-pass filter of x (N, ...), forward and backward: -3 dB at the cutoff in Hz.

    Each pass takes half of the 3 dB; the ends are extended by odd reflection.
    """
    from scipy.signal import sosfiltfilt

    x = np.asarray(x, dtype=np.float64)
    if not x.size:
        return x.copy()
    sections, settled = _butterworth(float(cutoff), float(dt), order)
    pad = min(settled, len(x) - 1)
    return np.ascontiguousarray(sosfiltfilt(sections, x, axis=0, padtype="odd", padlen=pad))


def settling(cutoff: float, dt: float, order: int = 4) -> int:
    """Settling time of `zero_phase` in samples."""
    return _butterworth(float(cutoff), float(dt), order)[1]


@lru_cache(maxsize=64)  # called for each piece of each pass
def _butterworth(cutoff: float, dt: float, order: int) -> tuple[Array, int]:
    """Second-order sections of one pass of the filter, and its settling time in samples."""
    from scipy.signal import butter

    # one pass of a wider filter is at -1.5 dB here; the bilinear transform warps by a tangent
    wider = np.tan(np.pi * cutoff * dt) / (np.sqrt(2.0) - 1.0) ** (0.5 / order)
    sections = np.asarray(butter(order, 2.0 / np.pi * np.arctan(wider), output="sos"))
    poles = np.abs([np.roots(section[3:]) for section in sections])
    slowest = float(poles.max())
    return sections, int(np.ceil(np.log(_SETTLED) / np.log(slowest))) if slowest > 0.0 else 1


def central_differences(x: Array, dt: float, accuracy: int = 4) -> Array:
    """Derivative of samples x (N, ...) by central differences, of lower order near the ends."""
    x = np.asarray(x, dtype=np.float64)
    out = np.gradient(x, dt, axis=0)
    for weights in list(_DIFFERENCES.values())[: accuracy // 2 - 1]:
        width, N = len(weights), len(x)
        if 2 * width >= N:
            break
        out[width:-width] = 0.0
        for k, weight in enumerate(weights, start=1):
            ahead, behind = x[width + k : N - width + k], x[width - k : N - width - k]
            out[width:-width] += weight / dt * (ahead - behind)
    return out


def decimation_window(step: int) -> Array:
    """Weights (odd length, sum 1) of the low-pass by which every ``step``-th sample is kept.

    The same window for regressor and torque keeps them equal ("parallel decimation").
    """
    if step == 1:
        return np.ones(1)
    k = np.arange(-_HALF_WINDOW * step, _HALF_WINDOW * step + 1)
    taps = np.sinc(2.0 * HALF * k / step) * np.hamming(len(k))
    return taps / taps.sum()


def pieces(log: Log, processing: Processing) -> Iterator[Piece]:
    """Fixed pieces of a log without its edges."""
    step = processing.decimation
    size = max(1, min(PIECE // step, _INSTANTS)) * step
    for part in log.recordings():
        low, high = part.start + processing.edges, part.stop - processing.edges
        for start in range(low, high, size):
            yield Piece(start, min(start + size, high), low, high, part.start, part.stop)


def signals(log: Log, processing: Processing) -> Signals:
    """Filtered signals of all recordings of a log, edges cut."""
    parts = [piece_signals(log, processing, piece, 0) for piece in pieces(log, processing)]
    arrays = zip(*((x.t, x.q, x.v, x.a, x.tau) for x in parts), strict=True)
    return Signals(*map(np.concatenate, arrays))


def piece_signals(log: Log, processing: Processing, piece: Piece, reach: int) -> Signals:
    """Signals of a piece and of ``reach`` rows on either side, within the recording."""
    first, last, begin, end = _margins(log, processing, piece, reach)

    def filtered(x: Array) -> Array:
        if processing.cutoff is None:
            return np.array(x[begin:end])
        return zero_phase(x[begin:end], processing.cutoff, log.dt, processing.order)

    q = filtered(log.q)
    v = central_differences(q, log.dt, processing.accuracy) if log.v is None else filtered(log.v)
    a = central_differences(v, log.dt, processing.accuracy) if log.a is None else filtered(log.a)
    t = log.dt * np.arange(first, last, dtype=np.float64)
    inner, guard = slice(first - begin, last - begin), processing.guard
    before = v[max(inner.start - guard, 0) : inner.start]
    after = v[inner.stop : inner.stop + guard]
    return Signals(t, q[inner], v[inner], a[inner], log.tau[first:last], before, after)


def slice_with_margin(log: Log, processing: Processing, piece: Piece) -> tuple[Log, Piece]:
    """Rows of a log that the equations of a piece need, as a log, and the piece in it."""
    _, _, begin, end = _margins(log, processing, piece, processing.reach + _BESIDE)
    rows = slice(begin, end)
    v, a = (None if x is None else x[rows] for x in (log.v, log.a))
    part = Log(log.dt, log.q[rows], log.tau[rows], v, a, names=log.names, delay=log.delay)
    return part, Piece(*(row - begin for row in astuple(piece)))


def _margins(
    log: Log, processing: Processing, piece: Piece, reach: int
) -> tuple[int, int, int, int]:
    """First and last row of a piece with ``reach`` beside it, and of all that they depend on."""
    first, last = max(piece.start - reach, piece.low), min(piece.stop + reach, piece.high)
    # the filter transient has decayed; differences use a few more samples
    margin = 2 * processing.accuracy + processing.guard
    if processing.cutoff is not None:
        margin += settling(processing.cutoff, log.dt, processing.order)
    return first, last, max(first - margin, piece.begin), min(last + margin, piece.end)
