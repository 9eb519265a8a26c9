"""What was recorded: positions and torques of the joints over time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import LARGEST, Array, as_bounded, as_floats
from ..errors import InvalidValueError, ShapeError

_LEAST = 1e-50
"""Of the largest sample of a channel that is not zero: its square is a float."""
_LONGEST = 1e12
"""Period, s; the shortest is its inverse."""


@dataclass(frozen=True, slots=True)
class RefusedRows:
    """Rows of a source that are not in the log, and why.

    Parameters
    ----------
    source : str
        File or array they come from.
    rows : tuple of int
        Their numbers in it, from 0.
    reason : str
        A sentence.
    """

    source: str
    rows: tuple[int, ...]
    reason: str


@dataclass(frozen=True, slots=True)
class LogSource:
    """A file or array that a log was made of.

    Parameters
    ----------
    name : str
        Name of the file, or "arrays".
    sha256 : str
        Of its bytes, in hexadecimal digits.
    rows : int
        Samples that the log has of it.
    """

    name: str
    sha256: str
    rows: int


@dataclass(frozen=True, slots=True, init=False, eq=False)
class Log:
    """Regularly sampled positions and torques of n joints, on the joint side, in SI units.

    Parameters
    ----------
    dt : float
        Sampling period, seconds.
    q : array_like, shape (N, n)
        Joint variables, rad or m. Arrays of float64, memory maps among them, are not copied.
    tau : array_like, shape (N, n)
        Joint torques, N m or N; motor currents where drive gains are to be found.
    v, a : array_like, shape (N, n), optional
        Velocities and accelerations, where they are known better than by differences of q.
    q_ref, v_ref : array_like, shape (N, n), optional
        What the controller was asked to follow, for methods that simulate it.
    starts : array_like of int, shape (S,), optional
        First rows of recordings that are not joined in time, ascending from 0; default one.
    names : sequence of str, optional
        Of the joints, default "1" to "n".
    delay : float
        Seconds that the torque lags behind the positions, already taken out or 0; for the report.
    sources : sequence of LogSource, optional
        What it was made of.
    refused : sequence of RefusedRows, optional
        What was left out.
    notes : sequence of str, optional
        What is strange.

    Raises
    ------
    ShapeError, InvalidValueError
        Arrays that do not fit each other, NaN or infinity, a period that is not positive; numbers
        beyond 1e50, or a channel all below 1e-50, whose squares would be no floats.

    References
    ----------
    Seed book sections 1.6.2.4 and 1.6.2.5.

    Examples
    --------
    >>> log = Log(0.01, q=np.zeros((100, 2)), tau=np.zeros((100, 2)))
    >>> log.n, len(log), round(log.duration, 2)
    (2, 100, 1.0)
    """

    dt: float
    q: Array
    tau: Array
    v: Array | None
    a: Array | None
    q_ref: Array | None
    v_ref: Array | None
    starts: NDArray[np.int64]
    names: tuple[str, ...]
    delay: float
    sources: tuple[LogSource, ...]
    refused: tuple[RefusedRows, ...]
    notes: tuple[str, ...]

    def __init__(
        self,
        dt: float,
        q: ArrayLike,
        tau: ArrayLike,
        v: ArrayLike | None = None,
        a: ArrayLike | None = None,
        q_ref: ArrayLike | None = None,
        v_ref: ArrayLike | None = None,
        starts: ArrayLike = (0,),
        names: Any = None,
        delay: float = 0.0,
        sources: Any = (),
        refused: Any = (),
        notes: Any = (),
    ) -> None:
        period = as_floats(dt, "dt")
        if period.ndim != 0 or not period > 0.0:
            raise InvalidValueError(f"dt: expected the sampling period in seconds, got {dt!r:.60}.")
        as_bounded(period, "dt", _LONGEST, 1.0 / _LONGEST)
        object.__setattr__(self, "dt", float(period))
        positions = _rows(q, "q")
        given: dict[str, Any] = {"tau": tau, "v": v, "a": a, "q_ref": q_ref, "v_ref": v_ref}
        object.__setattr__(self, "q", positions)
        for name, value in given.items():
            array = None if value is None and name != "tau" else _rows(value, name)
            if array is not None and array.shape != positions.shape:
                raise ShapeError(
                    f"{name}: expected shape {positions.shape} as q has it, got {array.shape}."
                )
            object.__setattr__(self, name, array)
        object.__setattr__(self, "starts", _starts(starts, len(positions)))
        n = positions.shape[1]
        words = tuple(str(k + 1) for k in range(n)) if names is None else tuple(map(str, names))
        if len(words) != n:
            raise ShapeError(f"names: expected {n} names of joints, got {len(words)}.")
        object.__setattr__(self, "names", words)
        object.__setattr__(self, "delay", float(delay))
        for name, value in (("sources", sources), ("refused", refused), ("notes", notes)):
            object.__setattr__(self, name, tuple(value))

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
        """Some rows of it; what was said of the whole stays.

        Parameters
        ----------
        start, stop : int
            First row, and the one after the last; negative ones count from the end.

        Returns
        -------
        Log
            Views of the same arrays.

        Raises
        ------
        InvalidValueError
            No row is in this range, or it goes beyond the log.

        Examples
        --------
        >>> len(Log(0.01, np.zeros((100, 1)), np.zeros((100, 1))).rows(10, 30))
        20
        """
        beyond = [row for row in (start, stop) if not -len(self) <= row <= len(self)]
        if beyond:
            raise InvalidValueError(
                f"rows: asked for {start} to {stop}, the log has {len(self)} rows (0 to {len(self)}"
                "); give a range within it."
            )
        first, last, _ = slice(start, stop).indices(len(self))
        if first >= last:
            raise InvalidValueError(
                f"rows: none from {start} to {stop}; the log has {len(self)} rows."
            )
        inner = self.starts[(self.starts > first) & (self.starts < last)] - first
        part: dict[str, Any] = {
            name: None if (array := getattr(self, name)) is None else array[first:last]
            for name in ("q", "tau", "v", "a", "q_ref", "v_ref")
        }
        return Log(
            self.dt, **part, starts=(0, *inner.tolist()), names=self.names, delay=self.delay,
            sources=self.sources, refused=self.refused, notes=self.notes,
        )  # fmt: skip

    def __getitem__(self, part: slice) -> Log:
        """Rows ``log[start:stop]``, as `rows` gives them.

        Parameters
        ----------
        part : slice
            Without a step: a thinned log is made by a filter, see ``decimation`` of a fit.

        Returns
        -------
        Log
            Views of the same arrays.

        Raises
        ------
        InvalidValueError
            Not a slice of following rows within the log.

        Examples
        --------
        >>> len(Log(0.01, np.zeros((100, 1)), np.zeros((100, 1)))[10:30])
        20
        """
        if not isinstance(part, slice):
            raise InvalidValueError(
                f"log[...]: expected rows as log[start:stop], got {part!r:.60}; single samples are "
                "in its arrays, such as log.q[k]."
            )
        if part.step not in (None, 1):
            raise InvalidValueError(
                f"log[...]: expected following rows, got a step of {part.step!r:.20}; leaving out "
                "samples without a filter folds what is fast into what is slow."
            )
        start = 0 if part.start is None else part.start
        return self.rows(start, len(self) if part.stop is None else part.stop)

    def __len__(self) -> int:
        return self.q.shape[0]

    def __repr__(self) -> str:
        runs = "" if len(self.starts) == 1 else f" in {len(self.starts)} recordings"
        return (
            f"<Log: {len(self)} samples of {self.n} joints at {1.0 / self.dt:g} Hz, "
            f"{self.duration:.3g} s{runs}>"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), tuple(getattr(self, field.name) for field in fields(self))


def check_is_log(log: object) -> None:
    """Raise unless the argument is a `Log`."""
    if isinstance(log, Log):
        return
    has = isinstance(getattr(log, "log", None), Log)
    advice = "give its .log" if has else "make one with Log(dt, q, tau) or read_log"
    raise InvalidValueError(f"log: expected a Log, got {type(log).__name__}; {advice}.")


def _rows(value: ArrayLike | None, name: str) -> Array:
    if value is None:
        raise InvalidValueError(f"{name}: expected samples of shape (N, n), got None.")
    array = as_bounded(value, name, LARGEST, _LEAST)
    if array.ndim != 2:
        raise ShapeError(f"{name}: expected samples of shape (N, n), got {array.shape}.")
    if not array.shape[0]:
        raise InvalidValueError(f"{name}: the log is empty; expected at least one sample.")
    view = array.view()
    view.flags.writeable = False
    return view


def _starts(starts: ArrayLike, N: int) -> NDArray[np.int64]:
    values = np.asarray(starts)
    good = values.ndim == 1 and values.size and values.dtype.kind in "iu"
    if not good or values[0] != 0 or (np.diff(values) <= 0).any() or values[-1] >= N:
        raise InvalidValueError(
            f"starts: expected ascending numbers of rows from 0 and below {N}, got {starts!r:.80}."
        )
    array = values.astype(np.int64)
    array.flags.writeable = False
    return array
