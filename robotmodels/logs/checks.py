"""Checks of a log: units, limits, channels, and whether it fits a model."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..geometry import PRISMATIC
from ..model import RobotModel, check_model
from .bad_samples import BadSamples, bad_samples
from .findings import Finding, FindingKind, LogFinding, Severity, in_words
from .log import Log, check_is_log
from .stretches import moves, runs, spread, stretches

_LONGEST_PERIOD = 0.5
"""Longest sampling period, s, that resolves the motion of a robot."""
_BEYOND = 0.05
"""Tolerance outside the limits, relative to the range."""
_TURNS, _MOST = 30.0, 1000.0
"""Unusual and impossible angles (rad) of a joint without limits."""
_FACTOR = 4.0
"""Ratio of position to limit above which the unit is wrong."""
_TOO_LARGE, _LARGE = 10.0, 1.1
"""Ratios of torque to limit of a wrong unit, and of an excess."""
_PER_PARAMETER = 10
"""Least number of equations for each parameter."""
_SATURATED, _OFTEN = 0.02, 0.01
"""Least share of samples at an extreme value, and of repeated rows."""
_JUMP = 20.0
"""Least jump of a position relative to the 99 % quantile of its steps."""
_WINDOW, _PART = 0.05, 5_000
"""Seconds over which increments are compared (against noise), and rows of a stretch."""
_FOLLOWS, _NOISE, _TOLERANCE = 0.95, 5.0, 0.1
"""For derivatives: least correlation, least signal-to-noise ratio, and error of the factor."""
_FACTORS = {
    "degrees against radians": 180.0 / np.pi,
    "radians against degrees": np.pi / 180.0,
    "millimetres against metres": 1e3,
    "of the other sign": -1.0,
}


def check_log(log: Log, model: RobotModel | None = None) -> tuple[LogFinding, ...]:
    """Check a log for implausible units, limits and channels; each finding states a remedy.

    Without a model: constant, saturated, frozen and jumping channels, outliers, rows that repeat,
    the sampling period, and whether velocities and accelerations are the derivatives of the
    positions. With one, besides: number and order of the joints, degrees, motor angles, limits of
    position and torque, number of samples. Quantiles of a long log are those of 1e5 samples spread
    over it, derivatives those of stretches; other checks use every sample. Swapped joints and wrong
    signs are found by `robotmodels.identification.fit` (checked=True).

    Parameters
    ----------
    log : Log
        The recorded log.
    model : RobotModel, optional
        Its robot.

    Returns
    -------
    tuple of LogFinding
        The most severe first; empty if nothing was found.

    Raises
    ------
    InvalidValueError
        The argument is no log.

    References
    ----------
    Seed book sections 1.6.2.3 to 1.6.2.5.

    Examples
    --------
    >>> t = np.linspace(0.0, 10.0, 1001)[:, None]
    >>> log = Log(0.01, q=np.sin(t), tau=np.zeros((1001, 1)))
    >>> for finding in check_log(log):
    ...     print(finding)
    Joint 1: its torque is 0 in every sample; check whether the right column was read.
    """
    check_is_log(log)
    findings: list[LogFinding] = []
    if model is not None:
        check_model(model)
        if model.n != log.n:
            sentence = (
                f"The log has {log.n} joints, {model.name} has {model.n}; choose columns or model "
                "so that they agree."
            )
            return (LogFinding(FindingKind.WRONG_JOINT_COUNT, Severity.USELESS, (), sentence),)
        findings += _against_model(log, model)
    if log.dt > _LONGEST_PERIOD:
        sentence = (
            f"Its samples are {log.dt:.4g} s apart, too coarse for a robot motion; the times "
            "may be in milliseconds. See times= and dt= of read_log."
        )
        findings.append(LogFinding(FindingKind.IMPLAUSIBLE_PERIOD, Severity.USELESS, (), sentence))
    findings += [*_channels(log), *_rates(log)]
    order = list(Severity)[::-1]
    return tuple(sorted(findings, key=lambda finding: order.index(finding.severity)))


def _against_model(log: Log, model: RobotModel) -> Iterator[LogFinding]:
    names = model.table.joint_names
    if log.names != names and sorted(log.names) == sorted(names):
        words = (
            f"The joints of the log are {', '.join(log.names)}, those of {model.name} "
            f"{', '.join(names)}: the same in another order. Columns are taken in their order, not "
            "by name; give model= to read_log, which puts them in the model's order."
        )
        moved = tuple(a for a, b in zip(log.names, names, strict=True) if a != b)
        yield LogFinding(FindingKind.WRONG_JOINT_ORDER, Severity.USELESS, moved, words)
    yield from _positions(log, model)
    for j in np.flatnonzero(np.isfinite(model.table.effort) & (model.table.effort > 0.0)).tolist():
        for finding in _torque_limit(log.tau[:, j], model.table.effort[j]):
            yield in_words(log, j, finding)
    count, equations = 10 * model.table.f + 4 * model.n, len(log) * log.n
    if equations < _PER_PARAMETER * count:
        severity = Severity.USELESS if equations < count else Severity.DOUBTFUL
        words = f"The log has {len(log)} samples of {log.n} joints, {equations} equations for up to"
        words += f" {count} parameters; record a longer motion."
        yield LogFinding(FindingKind.TOO_SHORT, severity, (), words)


def _torque_limit(tau: Array, effort: float) -> Iterator[Finding]:
    """Torques of a joint that do not fit their limit."""
    usual = float(np.quantile(np.abs(spread(tau)), 0.99))
    if usual > _LARGE * effort:
        severity = Severity.USELESS if usual > _TOO_LARGE * effort else Severity.DOUBTFUL
        words = f"one in a hundred of its torques is above {usual:.4g}, its limit is {effort:.4g}; "
        words += "check units, drive gains and gear ratios, or the limit of the model."
        yield FindingKind.TORQUE_ABOVE_LIMITS, severity, words


def _positions(log: Log, model: RobotModel) -> Iterator[LogFinding]:
    """Positions outside their limits, and the unit or side (motor, joint) that explains them."""
    revolute = model.table.sigma[model.table.joint_rows] != PRISMATIC
    known = np.isfinite(model.lower) & np.isfinite(model.upper) & (model.upper > model.lower)
    turn = np.where(revolute, 2.0 * np.pi, np.inf)
    margin = _BEYOND * np.where(known, model.upper - model.lower, 0.0)
    lower = np.where(known, model.lower - margin, -turn)
    upper = np.where(known, model.upper + margin, turn)

    def inside(q: Array, joints: NDArray[np.bool_]) -> bool:
        return bool(((q >= lower) & (q <= upper))[:, joints].all())

    ends = np.stack([log.q.min(axis=0), log.q.max(axis=0)])
    size = np.abs(ends).max(axis=0)
    beyond = known & ((ends[0] < lower) | (ends[1] > upper))
    outside = np.flatnonzero(beyond | (revolute & (size > _TURNS)))
    if not len(outside):
        return
    reach = _FACTOR * np.where(known, np.maximum(np.abs(model.lower), np.abs(model.upper)), np.pi)
    far = bool((size > reach)[outside].any())
    # a joint without limits may turn several times; the dynamic model decides
    certain = bool((size > np.where(known, reach, _MOST))[outside].any())
    side = model.transmission
    coupled = (
        side is not None and side.is_invertible and not np.allclose(side.matrix, np.eye(log.n))
    )
    kind = FindingKind.MOTOR_SIDE_POSITIONS if far else FindingKind.OUTSIDE_LIMITS
    advice = "check units, offsets and signs, or the limits of the model."
    if certain and side is not None and coupled and inside(side.to_joint(spread(log.q)), known):
        advice = "through the model's transmission they would be within: read the log with "
        advice += "transmission=model.transmission."
    elif far and inside(np.radians(ends), revolute):
        kind = FindingKind.POSITIONS_IN_DEGREES
        advice = "as degrees they would be within: read the log with angles='deg', or with gears= "
        advice += "or transmission= if they are motor angles."
    elif far:
        advice = "these may be motor angles: read the log with gears= or transmission=."
    listed = ", ".join(
        f"{log.names[j]} ({ends[0, j]:.4g} to {ends[1, j]:.4g}, limits "
        + (f"{model.lower[j]:.4g} to {model.upper[j]:.4g})" if known[j] else "unknown)")
        for j in outside
    )
    severity = Severity.USELESS if certain else Severity.DOUBTFUL
    joints = tuple(log.names[j] for j in outside)
    yield LogFinding(kind, severity, joints, f"Joints outside their limits: {listed}; {advice}")


def _channels(log: Log) -> Iterator[LogFinding]:
    """Findings about the channels of a log, whatever its robot."""
    bad = bad_samples(log)
    for j in range(log.n):
        of_joint = [some for some in bad if some.joint == j]
        for finding in (*_torque(log, j), *map(_bad, of_joint), *_position(log, j, of_joint)):
            yield in_words(log, j, finding)
    moving = np.ptp(log.q, axis=0) > 1e-9
    if not moving.any():
        words = "No joint moves in this log; record a motion that excites the robot, see "
        words += "exciting_trajectory."
        yield LogFinding(FindingKind.NOTHING_MOVES, Severity.USELESS, (), words)
        return
    channels = (*(log.q[:, j] for j in np.flatnonzero(moving)), *log.tau.T)
    same = np.logical_and.reduce([np.diff(x) == 0.0 for x in channels])
    if _OFTEN * len(log) < same.sum() < len(same) and (repeated := runs(same, 3)):
        words = (
            f"{same.sum()} rows repeat the row before in every channel (the first three in "
            f"sequence at row {repeated[0][0]}): the recorder is faster than the controller. Read "
            "it with the period of the controller."
        )
        yield LogFinding(FindingKind.STUCK, Severity.DOUBTFUL, (), words)


def _torque(log: Log, j: int) -> Iterator[Finding]:
    tau = log.tau[:, j]
    low, high = float(tau.min()), float(tau.max())
    if low == high:
        words = f"its torque is {low + 0.0:.4g} in every sample; check whether the right column"
        yield FindingKind.CONSTANT_TORQUE, Severity.USELESS, f"{words} was read."
        return
    # saturated torques remain at the limit, quantised ones repeat at any value
    least = max(_SATURATED, 5.0 / len(np.unique(spread(tau))), 5.0 / len(tau))
    for end, word in ((high, "largest"), (low, "smallest")):
        share = float((np.abs(tau - end) <= 1e-6 * (high - low)).mean())
        if share > least:
            words = f"{100 * share:.1f} % of its torques are the {word} one ({end:.4g}); the drive"
            words += " looks saturated. Record slower motion, or leave these rows out."
            yield FindingKind.SATURATED, Severity.DOUBTFUL, words


def _bad(bad: BadSamples) -> Finding:
    """Outliers or frozen samples of a channel, in words."""
    rows, word = bad.rows, "position" if bad.channel == "q" else "torque"
    if bad.frozen:
        firsts = np.flatnonzero(np.diff(rows, prepend=-2) > 1)
        length = int(np.diff(firsts, append=len(rows))[0]) + 1
        more = f", and {len(firsts) - 1} times more" if len(firsts) > 1 else ""
        words = (
            f"its {word} repeats for {length} samples from row {rows[0] - 1}{more} while the joint "
            "moves; the sensor or the recorder stopped. fit interpolates these samples where the "
            "gap is short and leaves the rows out where it is long."
        )
        return FindingKind.STUCK, Severity.DOUBTFUL, words
    words = f"{len(rows)} samples of its {word} are outliers (the first at row {rows[0]}); fit "
    if len(rows) == 1:
        words = f"1 sample of its {word} is an outlier (at row {rows[0]}); fit "
    return FindingKind.SPIKES, Severity.DOUBTFUL, words + "replaces outliers by interpolation."


def _position(log: Log, j: int, bad: list[BadSamples]) -> Iterator[Finding]:
    q = log.q[:, j]
    if np.ptp(q) <= 1e-9:
        words = f"it stays at {q[0] + 0.0:.4g}, and its inertia and friction are not identifiable; "
        words += "check whether the right column was read, or remove the joint from the model."
        yield FindingKind.CONSTANT_POSITION, Severity.DOUBTFUL, words
        return
    steps = np.abs(np.diff(q))
    steps[log.starts[1:] - 1] = 0.0
    for rows in (some.rows for some in bad if some.channel == "q"):
        steps[rows - 1] = steps[np.minimum(rows, len(steps) - 1)] = 0.0
    recordings = [q[rows] for rows in log.recordings()]
    usual = max(float(np.quantile(moves(x), 0.99)) for x in recordings if len(x) > 1)
    k = int(steps.argmax())
    if steps[k] > _JUMP * usual > 0.0:
        turn = abs(steps[k] - 2.0 * np.pi) < 0.1
        advice = "unwrap it (numpy.unwrap)" if turn else "leave the row out, or split the log there"
        words = f"its position jumps by {steps[k]:.4g} at row {k + 1}, {steps[k] / usual:.0f} times"
        words += f" the step that 99 % of its steps do not exceed; {advice}."
        yield FindingKind.JUMP, Severity.DOUBTFUL, words


def _rates(log: Log) -> Iterator[LogFinding]:
    """Findings where velocities or accelerations are not the derivatives of the positions."""
    part = stretches(log, _PART)
    for order, word, rate in ((1, "velocities", part.v), (2, "accelerations", part.a)):
        if rate is None:
            continue
        wrong: dict[str, list[str]] = {}
        for j in range(log.n):
            factor, follows = _compared(part, part.q[:, j], rate[:, j], order)
            if follows < _FOLLOWS:
                words = f"do not follow from the positions (correlation {follows:.1g})"
            elif abs(factor - 1.0) > _TOLERANCE:
                units = [unit for unit, x in _FACTORS.items() if abs(factor / x - 1.0) < 0.02]
                reason = f"that is {units[0]}" if units else "which may be a gear ratio, or a wrong"
                reason += "" if units else " sampling period"
                words = f"are {factor:.3g} times the derivatives of the positions, {reason}"
            else:
                continue
            wrong.setdefault(words, []).append(log.names[j])
        for words, names in wrong.items():
            severity = Severity.USELESS if words.startswith("are") else Severity.DOUBTFUL
            words = f"Joint{'s' * (len(names) > 1)} {', '.join(names)}: {word} {words}; read them "
            words += f"in the unit of the positions, or leave them out ({word}=False of read_log)."
            yield LogFinding(FindingKind.RATES_OFF_POSITIONS, severity, tuple(names), words)


def _compared(log: Log, q: Array, rate: Array, order: int) -> tuple[float, float]:
    """Factor between a rate and the derivative of positions, and their correlation; 1, 1 at rest.

    Source: Seed book section 1.6.2.4.
    """
    xs, ys, thirds = [np.zeros(0)], [np.zeros(0)], [np.zeros(0)]
    for rows in log.recordings():
        x, y = q[rows] - q[rows.start], rate[rows]
        m = min(max(1, round(_WINDOW / log.dt)), (len(x) - 1) // (2 * order))
        if m < 1:
            continue
        thirds.append(np.diff(x, 3))
        for _ in range(order):
            y = np.cumsum(np.append(0.0, 0.5 * log.dt * (y[1:] + y[:-1])))
            x, y = x[m:] - x[:-m], y[m:] - y[:-m]
        xs.append(x)
        ys.append(y)
    x, y, third = (np.concatenate(each) for each in (xs, ys, thirds))
    if len(x) < 2:
        return 1.0, 1.0
    noise = (2.0 if order == 1 else 6.0) * (third @ third) / (20.0 * max(1, len(third)))
    (xx, xy), (_, yy) = np.cov(x, y, bias=True)
    if not xx > max(_NOISE**2 * noise, 1e-18):
        return 1.0, 1.0
    follows = xy / np.sqrt(xx * yy) if yy > 0.0 else 0.0
    return float(np.sign(follows) * np.sqrt(yy / xx)), float(abs(follows))
