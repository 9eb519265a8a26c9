"""Whether the velocities and accelerations of a log are the derivatives of its positions.

Source: Seed book section 1.6.2.4.
"""

from __future__ import annotations

import numpy as np

from .._arrays import Array
from .findings import FindingKind, LogFinding, Severity
from .log import Log

_WINDOW = 0.05
"""Seconds over which increments are compared: noise of sensors is small beside what moves."""
_CHUNK = 100_000
_FOLLOWS = 0.95
_TOLERANCE = 0.1
_NEAR = 0.02
_NOISE = 5.0
_DEGREES = 180.0 / np.pi


def rates_off(log: Log) -> list[LogFinding]:
    """Findings where velocities or accelerations contradict the positions."""
    found: list[LogFinding] = []
    for order, rate in ((1, log.v), (2, log.a)):
        if rate is not None:
            _compared(log, rate, order, found)
    return found


def _compared(log: Log, rate: Array, order: int, found: list[LogFinding]) -> None:
    xx, yy, xy, noise, count = _moments(log, rate, order)
    if not count:
        return
    told = (xx > (_NOISE**2) * noise) & (xx > 1e-18)
    factors = np.full(log.n, np.nan)
    follows = np.zeros(log.n)
    alive = told & (yy > 0.0)
    follows[alive] = xy[alive] / np.sqrt(xx[alive] * yy[alive])
    sure = alive & (np.abs(follows) >= _FOLLOWS)
    factors[sure] = np.sign(follows[sure]) * np.sqrt(yy[sure] / xx[sure])
    off = np.flatnonzero(sure & (np.abs(factors - 1.0) > _TOLERANCE)).tolist()
    every = len(off) == int(told.sum()) > 1 and float(np.ptp(factors[off])) <= _NEAR * float(
        np.abs(factors[off]).max()
    )
    word = "velocities" if order == 1 else "accelerations"
    wrong: dict[str, list[int]] = {}
    for j in off:
        told_of = f"{factors[j]:.3g} times what its positions say"
        wrong.setdefault(told_of + _reason(float(factors[j]), order, every), []).append(j)
    for what, joints in wrong.items():
        sentence = (
            f"{word} are {what}; read them in the unit of the positions, or leave them out "
            f"({word}=False of read_log)."
        )
        _add(found, Severity.USELESS, log, joints, sentence)
    lost = np.flatnonzero(told & ~sure).tolist()
    if lost:
        listed = ", ".join(f"{follows[j]:.2f}" for j in lost)
        sentence = (
            f"{word} do not follow from its positions (correlation {listed}); see whether the "
            f"right columns were read, or leave them out ({word}=False of read_log)."
        )
        _add(found, Severity.DOUBTFUL, log, lost, sentence)


def _add(
    found: list[LogFinding], severity: Severity, log: Log, joints: list[int], sentence: str
) -> None:
    names = tuple(log.names[j] for j in joints)
    head = f"Joint {names[0]}: its " if len(names) == 1 else f"Joints {', '.join(names)}: their "
    if len(names) > 1:
        sentence = sentence.replace("its positions", "their positions")
    found.append(LogFinding(FindingKind.RATES_OFF_POSITIONS, severity, names, head + sentence))


def _reason(factor: float, order: int, every: bool) -> str:
    """What such a factor usually is."""
    size = abs(factor)
    sign = " and of the other sign" if factor < 0.0 else ""
    known = (
        (_DEGREES, "that is degrees against radians"),
        (1.0 / _DEGREES, "that is radians against degrees"),
        (1e3, "that is millimetres against metres"),
        (1e-3, "that is metres against millimetres"),
        (2.0 * np.pi, "that is radians against turns"),
        (0.5 / np.pi, "that is turns against radians"),
        (30.0 / np.pi, "that is turns a minute against radians a second"),
    )
    for value, words in known:
        if abs(size / value - 1.0) <= _NEAR:
            return f", {words}{sign}"
    if abs(size - 1.0) <= _TOLERANCE:
        return ", that is of the other sign"
    if every and factor > 0.0:
        power = f"{factor ** (1.0 / order):.4g}"
        return (
            f", in every joint: the sampling period may be {power} times the true one, or motors "
            "are compared with joints"
        )
    return f"{sign}, which may be a gear ratio: motors against joints"


def _moments(log: Log, rate: Array, order: int) -> tuple[Array, Array, Array, Array, int]:
    """Second moments of increments of positions and of rates, and the noise of the former."""
    n = log.n
    sums = np.zeros((5, n))  # x, y, xx, yy, xy
    rough, steps, count = np.zeros(n), 0, 0
    for rows in log.recordings():
        length = rows.stop - rows.start
        m = min(max(1, round(_WINDOW / log.dt)), (length - 1) // (2 * order))
        if m < 1:
            continue
        for start in range(rows.start, rows.stop - order * m, _CHUNK):
            part = slice(start, min(start + _CHUNK + order * m, rows.stop))
            x, y = log.q[part] - log.q[start], rate[part]
            if len(x) > 3:
                third = np.diff(x, 3, axis=0)
                rough += (third**2).sum(axis=0) / 20.0
                steps += len(third)
            for _ in range(order):
                y = _integral(y, log.dt)
            if order == 1:
                x, y = (z[m:] - z[:-m] for z in (x, y))
            else:
                x, y = (z[2 * m :] - 2.0 * z[m:-m] + z[: -2 * m] for z in (x, y))
            sums += [x.sum(axis=0), y.sum(axis=0), (x**2).sum(axis=0), (y**2).sum(axis=0),
                     (x * y).sum(axis=0)]  # fmt: skip
            count += len(x)
    if not count:
        nothing = np.zeros(n)
        return nothing, nothing, nothing, nothing, 0
    sx, sy, xx, yy, xy = sums / count
    noise = (2.0 if order == 1 else 6.0) * rough / max(1, steps)
    return xx - sx**2, yy - sy**2, xy - sx * sy, noise, count


def _integral(rate: Array, dt: float) -> Array:
    """Trapezoids from the first row on."""
    whole = np.zeros_like(rate)
    np.cumsum(0.5 * dt * (rate[1:] + rate[:-1]), axis=0, out=whole[1:])
    return whole
