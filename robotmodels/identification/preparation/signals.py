"""Positions, velocities, accelerations and torques of a log, filtered alike."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import lru_cache

import numpy as np

from ..._arrays import Array, Rebuilt, read_only
from ...errors import InvalidValueError
from ...logs import Log
from .filters import central_differences, settling, zero_phase
from .processing import Processing

PIECE = 16384
"""Samples of a piece; pieces are fixed, so that results do not depend on who computes them."""
_INSTANTS = 4096
"""Instants whose equations a piece makes at most, since all of them are held at a time."""
_BESIDE = 16
"""Samples beside the decimation's window that some forms of the equations look at."""
_settling = lru_cache(maxsize=64)(settling)  # asked for each piece of each pass


@dataclass(frozen=True, slots=True, eq=False)
class Signals(Rebuilt):
    """What equations are made of, at the rate of the log. Read-only.

    Parameters
    ----------
    t : ndarray, shape (N,)
        Times in the log, seconds.
    q, v, a : ndarray, shape (N, n)
        Filtered positions, velocities, accelerations.
    tau : ndarray, shape (N, n)
        Torques as they were measured.
    before, after : ndarray, shape (k, n), optional
        Velocities of the samples before the first and after the last one.
    """

    t: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    before: Array | None = None
    after: Array | None = None

    def __post_init__(self) -> None:
        for name in ("t", "q", "v", "a", "tau"):
            value = getattr(self, name)
            if value.flags.writeable:
                object.__setattr__(self, name, read_only(value))

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True, slots=True)
class Piece:
    """Range of log rows processed together."""

    start: int
    stop: int
    low: int
    high: int
    begin: int
    end: int


def signals(log: Log, processing: Processing) -> Signals:
    """Filtered signals of a log, its edges cut.

    Parameters
    ----------
    log : Log
        The log.
    processing : Processing
        The choices, of `choose_processing`.

    Returns
    -------
    Signals
        Of all recordings, one after the other.

    References
    ----------
    Seed book sections 1.6.2.4 and 1.6.2.5.

    Examples
    --------
    >>> from robotmodels.identification.preparation.processing import choose_processing
    >>> t = np.arange(0.0, 20.0, 0.01)[:, None]
    >>> log = Log(0.01, np.sin(t), np.zeros(t.shape))
    >>> found = signals(log, choose_processing(log))
    >>> bool(np.abs(found.v[:, 0] - np.cos(found.t)).max() < 1e-4)
    True
    """
    parts = [piece_signals(log, processing, piece, 0) for piece in pieces(log, processing)]
    names = ("t", "q", "v", "a", "tau")
    return Signals(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def pieces(log: Log, processing: Processing) -> Iterator[Piece]:
    """The pieces of a log, always the same ones."""
    step = processing.decimation
    size = max(1, min(PIECE // step, _INSTANTS)) * step
    for part in log.recordings():
        low, high = part.start + processing.edges, part.stop - processing.edges
        for start in range(low, high, size):
            yield Piece(start, min(start + size, high), low, high, part.start, part.stop)


def piece_signals(log: Log, processing: Processing, piece: Piece, reach: int) -> Signals:
    """Signals of a piece and of so many rows on either side of it, as far as there are any."""
    first, last, begin, end = _looked_at(log, processing, piece, reach)
    guard = processing.guard
    if begin < 0 or end > len(log):
        raise InvalidValueError(
            f"piece: its rows {first} to {last} are made of rows {begin} to {end}, and the log has "
            f"rows 0 to {len(log)}; take the pieces of this log, of `pieces`."
        )
    inner = slice(first - begin, last - begin)
    ahead = slice(max(first - guard, begin) - begin, first - begin)
    behind = slice(last - begin, min(last + guard, end) - begin)

    def filtered(x: Array) -> Array:
        rows = np.array(x[begin:end])
        if processing.cutoff is None:
            return rows
        return zero_phase(rows, processing.cutoff, log.dt, processing.order)

    q = filtered(log.q)
    v = central_differences(q, log.dt, processing.accuracy) if log.v is None else filtered(log.v)
    a = central_differences(v, log.dt, processing.accuracy) if log.a is None else filtered(log.a)
    return Signals(
        log.dt * np.arange(first, last, dtype=np.float64), q[inner], v[inner], a[inner],
        np.array(log.tau[first:last]), v[ahead], v[behind],
    )  # fmt: skip


def piece_alone(log: Log, processing: Processing, piece: Piece) -> tuple[Log, Piece]:
    """Slice of a log for the equations of one piece."""
    _, _, begin, end = _looked_at(log, processing, piece, processing.reach + _BESIDE)
    rows = slice(begin, end)
    v, a = (None if x is None else x[rows] for x in (log.v, log.a))
    alone = Log(log.dt, log.q[rows], log.tau[rows], v, a, names=log.names, delay=log.delay)
    moved = (getattr(piece, field.name) - begin for field in fields(Piece))
    return alone, Piece(*moved)


def _looked_at(
    log: Log, processing: Processing, piece: Piece, reach: int
) -> tuple[int, int, int, int]:
    """First and last row of a piece with so many beside it, and of those that they are made of."""
    first, last = max(piece.start - reach, piece.low), min(piece.stop + reach, piece.high)
    # the filter forgets what is farther away; differences look a few samples further
    margin = 2 * processing.accuracy + processing.guard
    if processing.cutoff is not None:
        margin += _settling(processing.cutoff, log.dt, processing.order)
    return first, last, max(first - margin, piece.begin), min(last + margin, piece.end)
