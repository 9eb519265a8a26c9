"""Recorded positions and torques of the joints over time; logs joined, and torques shifted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import LARGEST, Array, Rebuilt, as_bounded, as_number, read_only
from ..errors import InvalidValueError, ShapeError

ARRAYS = ("q", "tau", "v", "a", "q_ref", "v_ref")
_SMALLEST, _LONGEST = 1e-50, 1e12
"""Least magnitude of the largest sample of a nonzero channel; longest sampling period, s."""
_SAME, _WHOLE = 1e-4, 1e-6
"""Tolerances: relative difference of sampling periods, distance from whole samples."""


@dataclass(frozen=True, slots=True)
class RefusedRows:
    """Rows of a source, by their numbers from 0, that are not in the log, and why."""

    source: str
    rows: tuple[int, ...]
    reason: str


@dataclass(frozen=True, slots=True)
class LogSource:
    """A file that a log was read from, or "arrays", with the number of its samples in the log."""

    name: str
    sha256: str
    rows: int


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Log(Rebuilt):
    """Regularly sampled positions and torques of n joints, on the joint side, in SI units.

    Parameters
    ----------
    dt : float
        Sampling period, seconds.
    q : array_like, shape (N, n)
        Joint variables, rad or m. Arrays of float64, memory maps among them, are not copied.
    tau : array_like, shape (N, n)
        Joint torques, N m or N; motor currents where drive gains are to be identified.
    v, a : array_like, shape (N, n), optional
        Velocities and accelerations, where they are more accurate than differences of q.
    q_ref, v_ref : array_like, shape (N, n), optional
        References of the controller, for methods that simulate it.
    starts : array_like of int, shape (S,), optional
        First rows of recordings that are not joined in time, ascending from 0; default one.
    names : sequence of str, optional
        Names of the joints, default "1" to "n".
    delay : float
        Delay of the torque behind the positions that was removed, seconds; for the report.
    sources, refused, notes : sequences, optional
        Files (``name, sha256, rows``), rows that were left out (``source, rows, reason``), and
        sentences about the reading of the files.

    Raises
    ------
    ShapeError, InvalidValueError
        Arrays that do not fit each other, NaN or infinity, a period that is not positive; numbers
        beyond 1e50, or a channel all below 1e-50, whose squares would be no floats.

    References
    ----------
    Book sections 1.6.2.4 and 1.6.2.5.

    Examples
    --------
    >>> log = Log(0.01, q=np.zeros((100, 2)), tau=np.zeros((100, 2)))
    >>> log.n, len(log), round(log.duration, 2)
    (2, 100, 1.0)
    """

    dt: float
    q: Array
    tau: Array
    v: Array | None = None
    a: Array | None = None
    q_ref: Array | None = None
    v_ref: Array | None = None
    starts: Any = (0,)
    names: Any = None
    delay: float = 0.0
    sources: tuple[LogSource, ...] = ()
    refused: tuple[RefusedRows, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        dt = as_number(self.dt, "dt", least=1.0 / _LONGEST, below=_LONGEST)
        values: dict[str, Any] = {"dt": dt, "q": _samples(self.q, "q", None)}
        N, n = values["q"].shape
        for name in ARRAYS[1:]:
            if (given := getattr(self, name)) is not None or name == "tau":
                values[name] = _samples(given, name, (N, n))
        words = tuple(map(str, range(1, n + 1) if self.names is None else self.names))
        if len(words) != n:
            raise ShapeError(f"names: expected {n} names of joints, got {len(words)}.")
        values |= {"starts": _starts(self.starts, N), "names": words, "delay": float(self.delay)}
        values |= {name: tuple(getattr(self, name)) for name in ("sources", "refused", "notes")}
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.q.shape[1]

    @property
    def duration(self) -> float:
        """Seconds of all recordings together."""
        return len(self) * self.dt

    @property
    def t(self) -> Array:
        """Time of each sample, seconds, recordings one after the other, shape (N,)."""
        return np.asarray(self.dt * np.arange(len(self)), np.float64)

    def recordings(self) -> Iterator[slice]:
        """Rows of each recording, whose samples are joined in time."""
        ends = (*self.starts[1:].tolist(), len(self))
        for start, end in zip(self.starts.tolist(), ends, strict=True):
            yield slice(start, end)

    def rows(self, start: int, stop: int) -> Log:
        """Rows from start to before stop (negative ones count from the end), also ``log[a:b]``.

        Views of the same arrays, with the sources, refused rows and notes.
        """
        N = len(self)
        first, last, _ = slice(start, stop).indices(N)
        if not (first < last and max(abs(start), abs(stop)) <= N):
            raise InvalidValueError(
                f"rows: expected a range within the log, got {start} to {stop}; it has {N} rows."
            )
        inner = self.starts[(self.starts > first) & (self.starts < last)] - first
        return selected(self, slice(first, last), (0, *inner.tolist()))

    __iter__ = None  # a log is no sequence of samples

    def __getitem__(self, part: slice) -> Log:
        """Rows ``log[start:stop]``; no steps, since decimation needs a filter."""
        if not isinstance(part, slice) or part.step not in (None, 1):
            raise InvalidValueError(
                f"log[...]: expected log[start:stop], got {part!r:.60}; single samples are in its "
                "arrays (log.q[k]), and decimation needs a filter (processing= of a fit)."
            )
        return self.rows(part.start or 0, len(self) if part.stop is None else part.stop)

    def __len__(self) -> int:
        return self.q.shape[0]

    def __repr__(self) -> str:
        runs = "" if len(self.starts) == 1 else f" in {len(self.starts)} recordings"
        return (
            f"<Log: {len(self)} samples of {self.n} joints at {1.0 / self.dt:g} Hz, "
            f"{self.duration:.3g} s{runs}>"
        )


def selected(log: Log, rows: slice | NDArray[np.int64], starts: Any, **changes: Any) -> Log:
    """Some rows of a log, with new starts of recordings and other changed fields."""
    parts = {name: x[rows] for name in ARRAYS if (x := getattr(log, name)) is not None}
    return replace(log, **(parts | {"starts": starts} | changes))


def check_is_log(log: object) -> None:
    """Raise unless the argument is a `Log`."""
    if isinstance(log, Log):
        return
    has = isinstance(getattr(log, "log", None), Log)
    advice = "give its .log" if has else "make one with Log(dt, q, tau) or read_log"
    raise InvalidValueError(f"log: expected a Log, got {type(log).__name__}; {advice}.")


def _samples(value: ArrayLike | None, name: str, shape: tuple[int, ...] | None) -> Array:
    if value is None:
        raise InvalidValueError(f"{name}: expected samples of shape (N, n), got None.")
    view = as_bounded(value, name, LARGEST, _SMALLEST).view()
    if view.ndim != 2:
        raise ShapeError(f"{name}: expected samples of shape (N, n), got {view.shape}.")
    if not len(view):
        raise InvalidValueError(f"{name}: the log is empty; expected at least one sample.")
    if shape is not None and view.shape != shape:
        raise ShapeError(f"{name}: expected shape {shape} as q has it, got {view.shape}.")
    view.flags.writeable = False
    return view


def _starts(starts: ArrayLike, N: int) -> NDArray[np.int64]:
    values = np.asarray(starts)
    good = values.ndim == 1 and values.size and values.dtype.kind in "iu"
    if not good or values[0] != 0 or (np.diff(values) <= 0).any() or values[-1] >= N:
        raise InvalidValueError(
            f"starts: expected ascending numbers of rows from 0 and below {N}, got {starts!r:.80}."
        )
    return read_only(values, np.int64)


def join_logs(logs: Iterable[Log]) -> Log:
    """Join several logs as separate recordings of one log.

    Parameters
    ----------
    logs : iterable of Log
        Logs with the same joints and the same sampling period (to one part in ten thousand).

    Returns
    -------
    Log
        With the arrays that all have, and the sources, refused rows and notes of each.

    Examples
    --------
    >>> one = Log(0.01, np.zeros((100, 1)), np.zeros((100, 1)))
    >>> join_logs([one, one]).starts
    array([  0, 100])
    """
    each = tuple(logs)
    if not each:
        raise InvalidValueError("logs: expected at least one, got none.")
    first = each[0]
    for k, log in enumerate(each[1:], 1):
        if log.names != first.names:
            raise ShapeError(
                f"logs: number {k} is of the joints {', '.join(log.names)}, the first of "
                f"{', '.join(first.names)}."
            )
        if abs(log.dt - first.dt) > _SAME * first.dt or log.delay != first.delay:
            raise InvalidValueError(
                f"logs: number {k} is sampled every {log.dt:.9g} s (delay {log.delay:g} s), the "
                f"first every {first.dt:.9g} s ({first.delay:g} s); read them with the same dt=, "
                "and use with_delay on all."
            )
    parts = {name: [getattr(log, name) for log in each] for name in ARRAYS}
    missing = {name for name, all_parts in parts.items() if any(x is None for x in all_parts)}
    lengths = [len(log) for log in each]
    offsets = np.cumsum([0, *lengths[:-1]])
    return Log(
        float(np.average([log.dt for log in each], weights=lengths)),
        **{name: np.concatenate(parts[name]) for name in parts if name not in missing},
        starts=np.concatenate([log.starts + o for log, o in zip(each, offsets, strict=True)]),
        names=first.names,
        delay=first.delay,
        sources=tuple(source for log in each for source in log.sources),
        refused=tuple(rows for log in each for rows in log.refused),
        notes=tuple(note for log in each for note in log.notes),
    )


def with_delay(log: Log, delay: float) -> Log:
    """The log with its torques shifted back in time: ``tau(t)`` becomes ``tau(t + delay)``.

    Whole numbers of samples are shifted by rows, others by cubic splines; rows at the ends of
    recordings that have no torque any more are cut.

    Parameters
    ----------
    log : Log
        The recorded log.
    delay : float
        Delay of its torques behind its positions, seconds (`identification.synchronisation`);
        negative if they precede them.

    Returns
    -------
    Log
        Shorter; `Log.delay` is the sum of all removed delays.

    References
    ----------
    Book section 1.6.2.4.

    Examples
    --------
    >>> log = Log(0.001, np.zeros((5, 1)), [[0.0], [0.0], [1.0], [2.0], [3.0]])
    >>> with_delay(log, 0.002).tau.ravel()
    array([1., 2., 3.])
    """
    from scipy.interpolate import CubicSpline

    check_is_log(log)
    seconds = as_number(delay, "delay")
    if seconds == 0.0:
        return log
    shift = seconds / log.dt
    whole = abs(shift - round(shift)) < _WHOLE
    shift = float(round(shift)) if whole else shift
    cut = int(np.ceil(abs(shift)))
    kept, torques, refused = [], [], log.refused
    for rows in log.recordings():
        N = rows.stop - rows.start
        places = np.arange(N - cut) + (cut if shift < 0.0 else 0)
        if len(places) < 2:
            lost, reason = tuple(range(rows.start, rows.stop)), "a recording shorter than the delay"
            refused = (*refused, RefusedRows("log", lost, reason))
            continue
        kept.append(rows.start + places)
        if whole:
            torques.append(log.tau[rows][places + int(shift)])
        else:
            torques.append(CubicSpline(np.arange(N), log.tau[rows])(places + shift))
    if not kept:
        raise InvalidValueError(
            f"delay: {seconds:g} s are {abs(shift):g} samples, no recording is longer."
        )
    note = f"{seconds:.6g} s of delay were removed from the torques ({shift:.4g} samples)."
    starts = np.cumsum([0, *map(len, kept[:-1])])
    changes = {"tau": np.concatenate(torques), "delay": log.delay + seconds, "refused": refused}
    return selected(log, np.concatenate(kept), starts, **changes, notes=(*log.notes, note))
