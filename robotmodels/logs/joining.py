"""Logs one after the other, and torques moved in time."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from .._arrays import Array, as_floats
from ..errors import InvalidValueError, ShapeError
from .log import Log, RefusedRows

_PERIODS = 1e-4
_WHOLE = 1e-6
_OPTIONAL = ("v", "a", "q_ref", "v_ref")


def join_logs(logs: Iterable[Log]) -> Log:
    """Several logs as one, each with its own start.

    Nothing is filtered or differentiated over the joints between them. Velocities, accelerations
    and references stay only if all have them; a note says when they do not.

    Parameters
    ----------
    logs : iterable of Log
        Of the same joints and the same sampling period (to one part in ten thousand).

    Returns
    -------
    Log
        With the sources, refused rows and notes of all.

    Raises
    ------
    ShapeError, InvalidValueError
        None given; joints, periods or delays that differ.

    Examples
    --------
    >>> one = Log(0.01, np.zeros((100, 1)), np.zeros((100, 1)))
    >>> join_logs([one, one])
    <Log: 200 samples of 1 joints at 100 Hz, 2 s in 2 recordings>
    """
    each = tuple(logs)
    if not each:
        raise InvalidValueError("logs: expected at least one, got none.")
    first = each[0]
    for k, log in enumerate(each[1:], 1):
        if log.n != first.n or log.names != first.names:
            raise ShapeError(
                f"logs: number {k} is of the joints {', '.join(log.names)}, the first of "
                f"{', '.join(first.names)}."
            )
        if abs(log.dt - first.dt) > _PERIODS * first.dt:
            raise InvalidValueError(
                f"logs: number {k} is sampled every {log.dt:.9g} s, the first every "
                f"{first.dt:.9g} s; read them with the same dt=, which interpolates."
            )
        if log.delay != first.delay:
            raise InvalidValueError(
                f"logs: {log.delay:g} s of delay were taken out of number {k}, {first.delay:g} s "
                "of the first; take out the same of all with with_delay."
            )
    lengths = np.array([len(log) for log in each])
    offsets = np.concatenate([[0], np.cumsum(lengths)[:-1]])
    notes = [note for log in each for note in log.notes]
    more: dict[str, Array | None] = {}
    for name in _OPTIONAL:
        parts = [getattr(log, name) for log in each]
        have = [part for part in parts if part is not None]
        more[name] = np.concatenate(have) if len(have) == len(parts) else None
        if have and len(have) < len(parts):
            notes.append(
                f"{name} was left out: {len(have)} of {len(parts)} logs that were joined have it."
            )
    return Log(
        float(np.average([log.dt for log in each], weights=lengths)),
        np.concatenate([log.q for log in each]),
        np.concatenate([log.tau for log in each]),
        **more,
        starts=np.concatenate([log.starts + o for log, o in zip(each, offsets, strict=True)]),
        names=first.names,
        delay=first.delay,
        sources=[source for log in each for source in log.sources],
        refused=[rows for log in each for rows in log.refused],
        notes=notes,
    )


def with_delay(log: Log, delay: float) -> Log:
    """The log with its torques moved back in time, so that they belong to their positions.

    ``tau(t)`` becomes ``tau(t + delay)``: a whole number of samples by moving rows, others by
    cubic splines. Rows at the ends of recordings that have no torque any more are cut.

    Parameters
    ----------
    log : Log
        What was recorded.
    delay : float
        Seconds that its torques lag behind its positions; negative if they come before them.

    Returns
    -------
    Log
        Shorter; `Log.delay` says how much was taken out in all, and a note how.

    Raises
    ------
    InvalidValueError
        The delay is as long as every recording, or no number.

    See Also
    --------
    robotmodels.identification.preparation.synchronisation : estimates it.

    References
    ----------
    Seed book section 1.6.2.4.

    Examples
    --------
    >>> log = Log(0.001, np.zeros((5, 1)), [[0.0], [0.0], [1.0], [2.0], [3.0]])
    >>> with_delay(log, 0.002).tau.ravel()
    array([1., 2., 3.])
    """
    value = as_floats(delay, "delay")
    if value.ndim:
        raise InvalidValueError(f"delay: expected one number of seconds, got {delay!r:.60}.")
    if value == 0.0:
        return log
    shift = float(value) / log.dt
    whole = abs(shift - round(shift)) < _WHOLE
    shift = float(round(shift)) if whole else shift
    cut = int(np.ceil(abs(shift)))
    parts: list[tuple[slice, Array]] = []
    short = []
    for rows in log.recordings():
        count = rows.stop - rows.start
        if count <= cut + 1:
            short.append(rows)
            continue
        kept = (
            slice(rows.start, rows.stop - cut) if shift > 0 else slice(rows.start + cut, rows.stop)
        )
        parts.append((kept, _moved(log.tau[rows], shift, kept.start - rows.start, count - cut)))
    if not parts:
        raise InvalidValueError(
            f"delay: {float(value):g} s are {abs(shift):g} samples, no recording is longer."
        )
    refused = list(log.refused)
    notes = list(log.notes)
    if short:
        lost = tuple(k for rows in short for k in range(rows.start, rows.stop))
        refused.append(RefusedRows("log", lost, "its recording is not longer than the delay"))
        notes.append(f"{len(lost)} rows of recordings not longer than the delay were left out.")
    how = "moved by whole samples" if whole else "interpolated by cubic splines"
    notes.append(
        f"{float(value):.6g} s of delay were taken out of the torques ({shift:.4g} samples, {how}; "
        f"{cut} rows of each recording cut)."
    )
    lengths = [rows.stop - rows.start for rows, _ in parts]
    more: dict[str, Any] = {
        name: None
        if (array := getattr(log, name)) is None
        else np.concatenate([array[rows] for rows, _ in parts])
        for name in ("q", *_OPTIONAL)
    }
    return Log(
        log.dt, tau=np.concatenate([tau for _, tau in parts]), **more,
        starts=np.concatenate([[0], np.cumsum(lengths)[:-1]]).astype(np.int64), names=log.names,
        delay=log.delay + float(value), sources=log.sources, refused=refused, notes=notes,
    )  # fmt: skip


def _moved(tau: Array, shift: float, first: int, count: int) -> Array:
    """Torques at rows ``first + shift`` and the ``count`` after it."""
    if shift == round(shift):
        start = first + int(shift)
        return tau[start : start + count]
    from scipy.interpolate import CubicSpline

    return CubicSpline(np.arange(len(tau)), tau)(first + shift + np.arange(count))
