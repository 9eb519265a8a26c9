"""Checks of a log: units, limits, channels, and whether it fits a model.

A finding has a kind and a severity, whose values describe them, and prints as its sentence.

Examples
--------
>>> print(LogFinding(FindingKind.STUCK, Severity.NOTE, ("2",), "Joint 2: ..."))
Joint 2: ...
>>> FindingKind.STUCK.value, Severity.USELESS.value
('a channel repeats its value', 'a fit would mean nothing')
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np

from .._arrays import Array
from ..geometry import PRISMATIC
from ..model import RobotModel, check_model
from .channels import BadSamples, bad_samples, moves, runs, spread, stretches
from .log import Log, check_is_log

_LONGEST_PERIOD = 0.5  # s, of a log that resolves the motion of a robot
_SHORTEST_PERIOD = 2.1e-5  # s, shorter than that of the current loop of a drive
_MARGIN, _UNIT = 0.05, 4.0  # of limits: tolerance relative to the range, ratio of a wrong unit
_UNUSUAL, _IMPOSSIBLE = 30.0, 1000.0  # rad, angles of a joint without limits
_LARGE, _TOO_LARGE = 1.1, 10.0  # ratios of torque to limit: excess, wrong unit
_PER_PARAMETER = 10  # least number of equations for each parameter
_SATURATED, _REPEATED = 0.02, 0.01  # least shares of extreme samples and of repeated rows
_JUMP = 20.0  # least jump of a position relative to the 99 % quantile of its steps
_WINDOW, _STRETCH = 0.05, 5_000  # s over which increments are compared, and rows of a stretch
_CORRELATION, _SIGNAL, _FACTOR = 0.95, 5.0, 0.1  # of rates: least, least over noise, tolerance


class Severity(Enum):
    """Severity of a finding; the value states the consequence."""

    NOTE = "worth knowing"
    DOUBTFUL = "results may be wrong"
    USELESS = "a fit would mean nothing"


class FindingKind(Enum):
    """Kind of a finding; the value describes it."""

    WRONG_JOINT_COUNT = "log and model have different numbers of joints"
    WRONG_JOINT_ORDER = "its joints are the model's in another order"
    IMPLAUSIBLE_PERIOD = "the sampling period is too long or too short for a robot"
    POSITIONS_IN_DEGREES = "positions look like degrees"
    MOTOR_SIDE_POSITIONS = "positions look like those of motors"
    OUTSIDE_LIMITS = "positions are outside the limits"
    RATES_OFF_POSITIONS = "velocities or accelerations are not the derivatives of the positions"
    TORQUE_ABOVE_LIMITS = "torques are above the limits"
    TORQUE_OFF_INERTIA = "torques differ in size from those of the model's inertia"
    CONSTANT_POSITION = "a joint does not move"
    CONSTANT_TORQUE = "a torque is constant"
    NOTHING_MOVES = "nothing moves"
    SATURATED = "torques stay at their extreme values"
    STUCK = "a channel repeats its value"
    SPIKES = "single samples are outliers"
    JUMP = "positions jump"
    TOO_SHORT = "the log is too short for the parameters"
    NOT_EXCITING = "the motion does not excite all parameters"
    SWAPPED_JOINTS = "joints look swapped"
    WRONG_SIGN = "a sign looks wrong"
    OUT_OF_STEP = "positions and torques are not synchronous"


@dataclass(frozen=True, slots=True)
class LogFinding:
    """A finding: kind, severity, joints (none if it concerns the whole log), remedy in words."""

    kind: FindingKind
    severity: Severity
    joints: tuple[str, ...]
    sentence: str

    def __str__(self) -> str:
        return self.sentence


def check_log(log: Log, model: RobotModel | None = None) -> tuple[LogFinding, ...]:
    """Check a log for implausible units, limits and channels; each finding states a remedy.

    Channels are checked always; joints, units, limits and the number of samples against a model.
    Swapped joints and wrong signs are found by `robotmodels.identification.fit` (checked=True).

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

    References
    ----------
    Book sections 1.6.2.3 to 1.6.2.5.

    Examples
    --------
    >>> t = np.linspace(0.0, 10.0, 1001)[:, None]
    >>> print(*check_log(Log(0.01, q=np.sin(t), tau=np.zeros((1001, 1)))))
    Joint 1: its torque is 0 in every sample; check whether the right column was read.
    """
    check_is_log(log)
    findings: list[LogFinding] = []
    if model is not None:
        check_model(model)
        if model.n != log.n:
            words = f"The log has {log.n} joints, {model.name} has {model.n}; choose other columns."
            return (LogFinding(FindingKind.WRONG_JOINT_COUNT, Severity.USELESS, (), words),)
        findings += _against_model(log, model)
    if log.dt > _LONGEST_PERIOD:
        words = (
            f"Its samples are {log.dt:.4g} s apart, too coarse for a robot motion; the times "
            "may be in milliseconds. See times= and dt= of read_log."
        )
        findings.append(LogFinding(FindingKind.IMPLAUSIBLE_PERIOD, Severity.USELESS, (), words))
    if log.dt < _SHORTEST_PERIOD:
        words = (
            f"Its samples are {log.dt:.4g} s apart, closer than a robot is sampled; the times may "
            "be in seconds, or in a larger unit than given. See times= and dt= of read_log."
        )
        findings.append(LogFinding(FindingKind.IMPLAUSIBLE_PERIOD, Severity.USELESS, (), words))
    findings += [*_channels(log), *_rates(log)]
    order = list(Severity)[::-1]
    return tuple(sorted(findings, key=lambda finding: order.index(finding.severity)))


def _of_joint(log: Log, j: int, kind: FindingKind, useless: bool, words: str) -> LogFinding:
    """A finding about joint ``j``, named in the sentence."""
    severity = Severity.USELESS if useless else Severity.DOUBTFUL
    return LogFinding(kind, severity, (log.names[j],), f"Joint {log.names[j]}: {words}")


def _against_model(log: Log, model: RobotModel) -> Iterator[LogFinding]:
    """Findings about the order of the joints, limits, and the number of samples."""
    names = model.table.joint_names
    if log.names != names and sorted(log.names) == sorted(names):
        words = (
            f"The joints of the log are {', '.join(log.names)}, those of {model.name} "
            f"{', '.join(names)}. Columns are taken in their order, not by name; give model= to "
            "read_log, which puts them in the model's order."
        )
        moved = tuple(a for a, b in zip(log.names, names, strict=True) if a != b)
        yield LogFinding(FindingKind.WRONG_JOINT_ORDER, Severity.USELESS, moved, words)
    yield from _positions(log, model)
    for j in np.flatnonzero(np.isfinite(model.table.effort)).tolist():
        effort = float(model.table.effort[j])
        usual = float(np.quantile(np.abs(spread(log.tau[:, j])), 0.99))
        if usual > _LARGE * effort > 0.0:
            words = (
                f"one in a hundred of its torques is above {usual:.4g}, its limit is {effort:.4g}; "
                "check units, drive gains and gear ratios, or the limit of the model."
            )
            unit = usual > _TOO_LARGE * effort
            yield _of_joint(log, j, FindingKind.TORQUE_ABOVE_LIMITS, unit, words)
    count, equations = 10 * model.table.f + 4 * model.n, len(log) * log.n
    if equations < _PER_PARAMETER * count:
        severity = Severity.USELESS if equations < count else Severity.DOUBTFUL
        words = (
            f"The log has {len(log)} samples of {log.n} joints for up to {count} parameters; "
            "record a longer motion."
        )
        yield LogFinding(FindingKind.TOO_SHORT, severity, (), words)


def _positions(log: Log, model: RobotModel) -> Iterator[LogFinding]:
    """Positions outside their limits, and the unit or side (motor, joint) that explains them."""
    revolute = model.table.sigma[model.table.joint_rows] != PRISMATIC
    known = np.isfinite(model.lower) & np.isfinite(model.upper) & (model.upper > model.lower)
    turn = np.where(revolute, 2.0 * np.pi, np.inf)
    margin = _MARGIN * np.where(known, model.upper - model.lower, 0.0)
    lower = np.where(known, model.lower - margin, -turn)
    upper = np.where(known, model.upper + margin, turn)
    ends = np.stack([log.q.min(axis=0), log.q.max(axis=0)])
    size = np.abs(ends).max(axis=0)
    beyond = known & ((ends[0] < lower) | (ends[1] > upper))
    outside = np.flatnonzero(beyond | (revolute & (size > _UNUSUAL)))
    if not len(outside):
        return
    reach = _UNIT * np.where(known, np.maximum(np.abs(model.lower), np.abs(model.upper)), np.pi)
    # a joint without limits may turn several times; the dynamic model decides
    certain = bool((size > np.where(known, reach, _IMPOSSIBLE))[outside].any())
    kind, K = FindingKind.OUTSIDE_LIMITS, model.transmission
    advice = "check units, offsets and signs, or the limits of the model."
    if (size > reach)[outside].any():
        motors = K.to_joint(spread(log.q)) if K is not None and K.is_invertible else None
        kind = FindingKind.MOTOR_SIDE_POSITIONS
        advice = "these may be motor angles: read the log with gears= or transmission=."
        if motors is not None and ((motors >= lower) & (motors <= upper))[:, known].all():
            advice = "through the model's transmission they would be within: read the log with "
            advice += "transmission=model.transmission."
        elif ((np.radians(ends) >= lower) & (np.radians(ends) <= upper))[:, revolute].all():
            kind = FindingKind.POSITIONS_IN_DEGREES
            advice = "as degrees they would be within: read the log with angles='deg', or with "
            advice += "gears= or transmission= if they are motor angles."
    listed = ", ".join(
        f"{log.names[j]} ({ends[0, j]:.4g} to {ends[1, j]:.4g}, limits {model.lower[j]:.4g} to "
        f"{model.upper[j]:.4g})"
        for j in outside
    )
    severity, joints = Severity.USELESS if certain else Severity.DOUBTFUL, log.names
    names = tuple(joints[j] for j in outside)
    yield LogFinding(kind, severity, names, f"Joints outside their limits: {listed}; {advice}")


def _channels(log: Log) -> Iterator[LogFinding]:
    """Findings about the channels of a log, whatever its robot."""
    bad = bad_samples(log)
    for j in range(log.n):
        of_joint = [some for some in bad if some.joint == j]
        for finding in (*_torque(log, j), *map(_bad, of_joint), *_position(log, j, of_joint)):
            yield _of_joint(log, j, *finding)
    moving = np.ptp(log.q, axis=0) > 1e-9
    if not moving.any():
        words = "No joint moves in this log; record a motion that excites the robot, see "
        words += "exciting_trajectory."
        yield LogFinding(FindingKind.NOTHING_MOVES, Severity.USELESS, (), words)
        return
    channels = (*log.q[:, moving].T, *log.tau.T)
    same = np.logical_and.reduce([np.diff(x) == 0.0 for x in channels])
    if _REPEATED * len(log) < same.sum() < len(same) and (repeated := runs(same, 3)):
        words = (
            f"{same.sum()} rows repeat the row before (first at row {repeated[0][0]}): the "
            "recorder is faster than the controller; record with the period of the controller."
        )
        yield LogFinding(FindingKind.STUCK, Severity.DOUBTFUL, (), words)


_Finding = tuple[FindingKind, bool, str]


def _torque(log: Log, j: int) -> Iterator[_Finding]:
    """Constant and saturated torques."""
    tau = log.tau[:, j]
    low, high = float(tau.min()), float(tau.max())
    if low == high:
        words = f"its torque is {low + 0.0:.4g} in every sample; check whether the right column"
        yield FindingKind.CONSTANT_TORQUE, True, f"{words} was read."
        return
    # saturated torques remain at the limit, quantised ones repeat at any value
    least = max(_SATURATED, 5.0 / len(np.unique(spread(tau))), 5.0 / len(tau))
    for end, word in ((high, "largest"), (low, "smallest")):
        share = float((np.abs(tau - end) <= 1e-6 * (high - low)).mean())
        if share > least:
            words = f"{100 * share:.1f} % of its torques are the {word} one ({end:.4g}); the drive"
            words += " looks saturated. Record slower motion, or leave these rows out."
            yield FindingKind.SATURATED, False, words


def _bad(bad: BadSamples) -> _Finding:
    """Outliers or frozen samples of a channel, in words."""
    rows, word = bad.rows, "position" if bad.channel == "q" else "torque"
    if bad.frozen:
        words = f"{len(rows)} samples of its {word} repeat, from row {rows[0] - 1}, while the joint"
        words += " moves; fit interpolates short gaps and leaves out long ones."
        return FindingKind.STUCK, False, words
    words = f"outliers of its {word}: {len(rows)}, the first at row {rows[0]}; fit interpolates."
    return FindingKind.SPIKES, False, words


def _position(log: Log, j: int, bad: list[BadSamples]) -> Iterator[_Finding]:
    """Positions that are constant or jump."""
    q = log.q[:, j]
    if np.ptp(q) <= 1e-9:
        words = f"it stays at {q[0] + 0.0:.4g}; check whether the right column was read, or remove "
        words += "the joint from the model, since its inertia and friction are not identifiable."
        yield FindingKind.CONSTANT_POSITION, False, words
        return
    steps = np.abs(np.diff(q))
    steps[log.starts[1:] - 1] = 0.0
    for rows in (some.rows for some in bad if some.channel == "q"):
        steps[rows - 1] = steps[np.minimum(rows, len(steps) - 1)] = 0.0
    usual = max(float(np.quantile(moves(q[x]), 0.99)) for x in log.recordings() if len(q[x]) > 1)
    k = int(steps.argmax())
    if steps[k] > _JUMP * usual > 0.0:
        words = (
            f"its position jumps by {steps[k]:.4g} at row {k + 1}, {steps[k] / usual:.0f} times "
            "the 99 % quantile of its steps; unwrap it (numpy.unwrap), or split the log there."
        )
        yield FindingKind.JUMP, False, words


def _rates(log: Log) -> Iterator[LogFinding]:
    """Findings where velocities or accelerations are not the derivatives of the positions."""
    part = stretches(log, _STRETCH)
    for order, word, rate in ((1, "velocities", part.v), (2, "accelerations", part.a)):
        if rate is None:
            continue
        wrong: dict[str, list[str]] = {}
        for j in range(log.n):
            factor, correlation = _compared(part, part.q[:, j], rate[:, j], order)
            if correlation < _CORRELATION:
                words = f"do not follow from the positions (correlation {correlation:.1g})"
                wrong.setdefault(words, []).append(log.names[j])
            elif abs(factor - 1.0) > _FACTOR:
                words = f"are {factor:.3g} times the derivatives of the positions"
                wrong.setdefault(words, []).append(log.names[j])
        for words, names in wrong.items():
            severity = Severity.USELESS if words.startswith("are") else Severity.DOUBTFUL
            sentence = (
                f"Joints {', '.join(names)}: {word} {words}; check sign, unit (degrees: 57.3), "
                f"gear ratio and sampling period, or leave them out ({word}=False of read_log)."
            )
            yield LogFinding(FindingKind.RATES_OFF_POSITIONS, severity, tuple(names), sentence)


def _compared(log: Log, q: Array, rate: Array, order: int) -> tuple[float, float]:
    """Factor between a rate and the derivative of positions, and their correlation; 1, 1 at rest.

    Increments over `_WINDOW` seconds are compared with integrals of the rate.
    """
    pairs, thirds = [np.zeros((2, 0))], [np.zeros(0)]
    for rows in log.recordings():
        x, y = q[rows] - q[rows.start], rate[rows]
        m = min(max(1, round(_WINDOW / log.dt)), (len(x) - 1) // (2 * order))
        if m < 1:
            continue
        thirds.append(np.diff(x, 3))
        for _ in range(order):
            y = np.cumsum(np.append(0.0, 0.5 * log.dt * (y[1:] + y[:-1])))
            x, y = x[m:] - x[:-m], y[m:] - y[:-m]
        pairs.append(np.stack([x, y]))
    both, third = np.concatenate(pairs, axis=1), np.concatenate(thirds)
    if both.shape[1] < 2:
        return 1.0, 1.0
    noise = (2.0 if order == 1 else 6.0) * (third @ third) / (20.0 * max(1, len(third)))
    (xx, xy), (_, yy) = np.cov(both, bias=True)
    if not xx > max(_SIGNAL**2 * noise, 1e-18):
        return 1.0, 1.0
    correlation = xy / np.sqrt(xx * yy) if yy > 0.0 else 0.0
    return float(np.sign(correlation) * np.sqrt(yy / xx)), float(abs(correlation))
