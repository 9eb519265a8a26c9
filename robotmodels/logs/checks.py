"""Whether a log can be what it is said to be: units, limits, channels that say nothing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..geometry import PRISMATIC
from ..model import RobotModel, check_model
from .findings import FindingKind, LogFinding, Severity
from .log import Log, check_is_log
from .rates import rates_off

_DEGREES = 180.0 / np.pi
_BEYOND = 0.05
"""Of its range, how far a joint may be outside its limits: sensors and stops are not exact."""
_OFTEN = 0.01
_TURNS = 30.0
_FACTOR = 4.0
"""Times its limit that a joint must be at to be in another unit, not only off its zero."""
_SATURATED = 0.02
_STUCK = 50
_ROWS = 3
"""Rows in all channels alike, one after the other, that show a recorder that is too fast."""
_JUMP = 20.0
_PER_PARAMETER = 10
_TINY = 1e-3
_WRONG_UNIT = 10.0
"""Times its limit that a torque must be at to be in another unit or of a motor."""
_FEW_LEVELS = 100
_LONGEST_PERIOD = 0.5
"""Seconds between samples above which nothing is seen of how a robot moves."""
_CHUNK = 100_000
"""Samples that are looked at together; statistics of a longer channel are of so many of it."""


def check_log(log: Log, model: RobotModel | None = None) -> tuple[LogFinding, ...]:
    """What is wrong or strange in a log, each with what to do about it.

    Without a model: joints that do not move and torques that are constant, saturation, coarse
    steps, values that repeat, jumps, recordings that are too short, a period that is too long,
    velocities and accelerations that do not follow from the positions. With one, besides: numbers
    of joints and their order, degrees, motor angles, limits of position, velocity and torque,
    samples for the number of parameters. Of a long log quantiles, steps of sensors and turns are
    those of about 1e5 samples spread evenly over it; everything else is looked at in every sample.
    Whether joints are swapped, signs are wrong, and the motion shows the parameters is told by
    `robotmodels.identification.check_joints`, since it takes the dynamic model.

    Parameters
    ----------
    log : Log
        What was recorded.
    model : RobotModel, optional
        The robot it is of.

    Returns
    -------
    tuple of LogFinding
        The worst first; empty if nothing was found.

    Raises
    ------
    InvalidValueError
        What was given is no log.

    References
    ----------
    Seed book sections 1.6.2.3 to 1.6.2.5.

    Examples
    --------
    >>> t = np.linspace(0.0, 10.0, 1001)[:, None]
    >>> log = Log(0.01, q=np.sin(t), tau=np.zeros((1001, 1)))
    >>> for finding in check_log(log):
    ...     print(finding)
    Joint 1: its torque is 0 in every sample, so that nothing can be found of it; see whether the \
right column was read.
    """
    check_is_log(log)
    found: list[LogFinding] = []
    if model is not None:
        check_model(model)
        if model.n != log.n:
            sentence = (
                f"The log has {log.n} joints, {model.name} has {model.n}; choose columns or model "
                "so that they agree."
            )
            return (LogFinding(FindingKind.WRONG_JOINT_COUNT, Severity.USELESS, (), sentence),)
        _order(log, model, found)
    _period(log, found)
    moving = _constant(log, found)
    _saturated(log, found)
    _coarse(log, moving, found)
    _stuck(log, moving, found)
    _jumps(log, moving, found)
    _slow(log, moving, found)
    found += rates_off(log)
    if model is not None:
        _units(log, model, found)
        _torque_limits(log, model, found)
        _samples(log, model, found)
    order = list(Severity)[::-1]
    return tuple(sorted(found, key=lambda finding: order.index(finding.severity)))


def _order(log: Log, model: RobotModel, found: list[LogFinding]) -> None:
    """Report joints that have the model's names in another order: names are not looked at later."""
    names = model.table.joint_names
    if log.names == names or sorted(log.names) != sorted(names):
        return
    other = tuple(name for name, own in zip(log.names, names, strict=True) if name != own)
    found.append(
        LogFinding(
            FindingKind.WRONG_JOINT_ORDER, Severity.USELESS, other,
            f"The joints of the log are {', '.join(log.names)}, those of {model.name} "
            f"{', '.join(names)}: the same in another order. Columns are taken in their order, not "
            "by name; give model= to read_log, which puts them in the model's order.",
        )
    )  # fmt: skip


def _period(log: Log, found: list[LogFinding]) -> None:
    if log.dt > _LONGEST_PERIOD:
        found.append(
            LogFinding(
                FindingKind.IMPLAUSIBLE_PERIOD, Severity.USELESS, (),
                f"Its samples are {log.dt:.4g} s apart, in which a robot does more than can be "
                "seen; the times may be in milliseconds. See times= and dt= of read_log.",
            )
        )  # fmt: skip


def _add(
    found: list[LogFinding], kind: FindingKind, severity: Severity, log: Log, j: int, words: str
) -> None:
    name = log.names[j]
    found.append(LogFinding(kind, severity, (name,), f"Joint {name}: {words}"))


def _spread(x: Array) -> Array:
    """Samples spread evenly over a long channel, all of a short one."""
    return x[:: -(-len(x) // _CHUNK)] if len(x) else x


def _chunks(N: int) -> Iterator[slice]:
    for start in range(0, N, _CHUNK):
        yield slice(start, min(start + _CHUNK, N))


def _moves(q: Array) -> Array:
    """Sizes of the moves from a sample to the next, of a long channel some."""
    return np.abs(_spread(q[1:]) - _spread(q[:-1]))


class _Runs:
    """Runs of True of a row that is told piece by piece, those that are long enough."""

    def __init__(self, least: int) -> None:
        self.least, self.begun, self.seen = least, -1, 0
        self.found: list[tuple[int, int]] = []

    def add(self, same: NDArray[np.bool_]) -> None:
        """Values that follow those before."""
        if not len(same):
            return
        edges = (np.flatnonzero(same[1:] != same[:-1]) + 1 + self.seen).tolist()
        if bool(same[0]) == (self.begun < 0):  # it changes between the pieces
            edges.insert(0, self.seen)
        self.seen += len(same)
        if self.begun >= 0:
            edges.insert(0, self.begun)
        self.begun = edges.pop() if len(edges) % 2 else -1
        pairs = zip(edges[::2], edges[1::2], strict=True)
        self.found += [pair for pair in pairs if pair[1] - pair[0] >= self.least]

    def ended(self) -> list[tuple[int, int]]:
        """First index of each run, and the one after its last."""
        if self.begun >= 0 and self.seen - self.begun >= self.least:
            self.found.append((self.begun, self.seen))
        self.begun = -1
        return self.found


def _constant(log: Log, found: list[LogFinding]) -> NDArray[np.bool_]:
    """Report channels that do not change; joints that move."""
    span = np.ptp(log.q, axis=0)
    moving = span > 1e-9
    for j in range(log.n):
        if not moving[j]:
            _add(
                found, FindingKind.CONSTANT_POSITION, Severity.DOUBTFUL, log, j,
                f"it stays at {log.q[0, j] + 0.0:.4g}; nothing is found of its inertia "
                "and friction. See whether the right column was read, or take it out of the model.",
            )  # fmt: skip
        if np.ptp(log.tau[:, j]) == 0.0:
            _add(
                found, FindingKind.CONSTANT_TORQUE, Severity.USELESS, log, j,
                f"its torque is {log.tau[0, j] + 0.0:.4g} in every sample, so that nothing can be "
                "found of it; see whether the right column was read.",
            )  # fmt: skip
    if not moving.any():
        found.append(
            LogFinding(
                FindingKind.NOTHING_MOVES, Severity.USELESS, (),
                "No joint moves in this log; record a motion that excites the robot, see "
                "exciting_trajectory.",
            )
        )  # fmt: skip
    return moving


def _saturated(log: Log, found: list[LogFinding]) -> None:
    for j in range(log.n):
        tau = log.tau[:, j]
        span = float(np.ptp(tau))
        if not span:
            continue
        for end, word in ((float(tau.max()), "largest"), (float(tau.min()), "smallest")):
            count = sum(
                int((np.abs(tau[rows] - end) <= 1e-6 * span).sum()) for rows in _chunks(len(tau))
            )
            share = count / len(tau)
            if share <= _SATURATED or count < 5:
                continue
            # a current that is cut stays for several samples, steps of a sensor do so anywhere
            levels = len(np.unique(tau[: min(len(tau), 20000)]))
            if share > 5.0 / levels:
                _add(
                    found, FindingKind.SATURATED, Severity.DOUBTFUL, log, j,
                    f"{100 * share:.1f} % of its torques are the {word} one ({end:.4g}); the drive "
                    "looks saturated. Record slower motion, or leave these rows out.",
                )  # fmt: skip


def _coarse(log: Log, moving: NDArray[np.bool_], found: list[LogFinding]) -> None:
    for j in np.flatnonzero(moving).tolist():
        step = resolution(_spread(log.q[:, j]))
        span = float(np.ptp(log.q[:, j]))
        if step > 0.0 and span / step < _FEW_LEVELS:
            _add(
                found, FindingKind.QUANTISED, Severity.DOUBTFUL, log, j,
                f"its positions have steps of {step:.3g}, only {span / step:.0f} of them over its "
                "motion; velocities and accelerations of them are rough. Record with more digits, "
                "or move it further.",
            )  # fmt: skip


def resolution(values: Array) -> float:
    """Step of a channel that has few values; 0 if it has none that shows.

    Parameters
    ----------
    values : ndarray, shape (N,)
        Samples.

    Returns
    -------
    float
        The step, in the unit of the values.

    Examples
    --------
    >>> round(resolution(np.round(np.sin(np.linspace(0.0, 6.0, 1000)), 2)), 6)
    0.01
    """
    levels = np.unique(values)
    if len(levels) < 2 or len(levels) > 0.5 * len(values):
        return 0.0
    steps = np.diff(levels)
    steps = steps[steps > 1e-9 * float(np.ptp(levels))]
    return float(np.median(steps)) if len(steps) else 0.0


def _stuck(log: Log, moving: NDArray[np.bool_], found: list[LogFinding]) -> None:
    """Report positions and torques that all repeat at once: samples that were not taken."""
    if not moving.any():
        return
    whole, repeated = _Runs(_ROWS), 0
    alone = {j: _Runs(_STUCK) for j in np.flatnonzero(moving).tolist()}
    for rows in _chunks(len(log) - 1):
        both = slice(rows.start, rows.stop + 1)
        still = np.diff(log.q[both], axis=0) == 0.0
        for j, runs in alone.items():
            runs.add(still[:, j])
        same = still[:, moving].all(axis=1) & (np.diff(log.tau[both], axis=0) == 0.0).all(axis=1)
        whole.add(same)
        repeated += int(same.sum())
    if repeated == len(log) - 1:
        return
    # one sensor alone that stops while its torque goes on
    for j, runs in alone.items():
        long = runs.ended()
        if not long:
            continue
        q = log.q[:, j]
        usual = float(np.quantile(_moves(q), 0.9))
        for start, end in long:
            if start == 0 or end == len(log) - 1:
                continue
            before = float(np.abs(np.diff(q[max(0, start - 3) : start + 1])).mean())
            if before > 0.3 * usual and abs(float(q[end + 1] - q[end])) > 5.0 * usual > 0.0:
                _add(
                    found, FindingKind.STUCK, Severity.DOUBTFUL, log, j,
                    f"its position repeats for {end - start + 1} samples from row {start} and then "
                    "jumps; the sensor or the recorder stopped. Leave these rows out.",
                )  # fmt: skip
                break
    rows_alike = whole.ended()
    if rows_alike and repeated > _OFTEN * len(log):
        first, last = max(rows_alike, key=lambda run: run[1] - run[0])
        found.append(
            LogFinding(
                FindingKind.STUCK, Severity.DOUBTFUL, (),
                f"{repeated} rows repeat the row before in every channel (up to {last - first} one "
                f"after the other, from row {first}): the recorder is faster than what it records. "
                "Read it with the period of the controller.",
            )
        )  # fmt: skip


def _jumps(log: Log, moving: NDArray[np.bool_], found: list[LogFinding]) -> None:
    for j in np.flatnonzero(moving).tolist():
        largest, at, usual = 0.0, 0, 0.0
        for rows in log.recordings():
            q = log.q[rows, j]
            if len(q) < 2:
                continue
            usual = max(usual, float(np.quantile(_moves(q), 0.99)))
            for part in _chunks(len(q) - 1):
                steps = np.abs(np.diff(q[part.start : part.stop + 1]))
                k = int(steps.argmax())
                if steps[k] > largest:
                    largest, at = float(steps[k]), rows.start + part.start + k + 1
        if usual > 0.0 and largest > _JUMP * usual:
            turn = abs(largest - 2.0 * np.pi) < 0.1
            _add(
                found, FindingKind.JUMP, Severity.DOUBTFUL, log, j,
                f"its position jumps by {largest:.4g} at row {at}, {largest / usual:.0f} times "
                "what 99 % of its steps are at most; "
                + ("that is a turn: unwrap it (numpy.unwrap)." if turn else
                   "leave the row out, or split the log there."),
            )  # fmt: skip


def _slow(log: Log, moving: NDArray[np.bool_], found: list[LogFinding]) -> None:
    """Report joints that go one way only: less than a period of their motion."""
    for j in np.flatnonzero(moving).tolist():
        span = float(np.ptp(log.q[:, j]))
        way = sum(_reversals(_spread(log.q[rows, j]), 0.05 * span) for rows in log.recordings())
        if way == 0:
            _add(
                found, FindingKind.SLOWER_THAN_LOG, Severity.DOUBTFUL, log, j,
                "it moves one way only, so that friction and offset of its torque cannot be told "
                "apart; record at least one whole period of its motion.",
            )  # fmt: skip


def _reversals(q: Array, least: float) -> int:
    """Times that a joint turns back by more than ``least``."""
    count, way, extreme = 0, 0, float(q[0])
    # extremes alone matter, and they are few
    steps = np.sign(np.diff(q))
    turns = np.flatnonzero(np.diff(steps[steps != 0.0]) != 0.0)
    places = np.flatnonzero(steps != 0.0)
    for value in (*q[places[turns] + 1].tolist(), float(q[-1])):
        move = value - extreme
        if way == 0:
            if abs(move) > least:
                way, extreme = (1 if move > 0 else -1), value
        elif move * way >= 0.0:
            extreme = value
        elif abs(move) > least:
            way, extreme, count = -way, value, count + 1
    return count


def _units(log: Log, model: RobotModel, found: list[LogFinding]) -> None:
    lower, upper = model.lower, model.upper
    prismatic = model.table.sigma[model.table.joint_rows] == PRISMATIC
    known = np.isfinite(lower) & np.isfinite(upper) & (upper > lower)
    margin = np.where(known, _BEYOND * (upper - lower), np.inf)
    least, most = log.q.min(axis=0), log.q.max(axis=0)
    with np.errstate(invalid="ignore"):
        beyond = known & ((least < lower - margin) | (most > upper + margin))
    size = np.maximum(np.abs(least), np.abs(most))
    outside = [j for j in range(log.n) if beyond[j] or (not prismatic[j] and size[j] > _TURNS)]
    if not outside:
        return
    turning = ~prismatic & known
    fits = ((least / _DEGREES >= lower - margin) & (most / _DEGREES <= upper + margin))[
        turning
    ].all()
    ratio = model.transmission
    motors = False
    if ratio is not None and ratio.is_invertible and not np.allclose(ratio.matrix, np.eye(log.n)):
        motors = True
        for rows in _chunks(len(log)):
            q = ratio.to_joint(log.q[rows])
            motors &= bool(((q >= lower - margin) & (q <= upper + margin))[:, known].all())
    names = tuple(log.names[j] for j in outside)
    listed = ", ".join(
        f"{log.names[j]} ({least[j]:.4g} to {most[j]:.4g}, limits {lower[j]:.4g} to {upper[j]:.4g})"
        for j in outside
    )
    reach = np.where(known, np.maximum(np.abs(lower), np.abs(upper)), np.pi)
    surely = (size[outside] > _FACTOR * reach[outside]).any()
    if motors and surely:
        kind, advice = FindingKind.MOTOR_SIDE_POSITIONS, (
            "through the model's transmission they would be within: read the log with "
            "transmission=model.transmission."
        )  # fmt: skip
    elif fits and turning.any() and surely:
        kind, advice = FindingKind.POSITIONS_IN_DEGREES, (
            "as degrees they would be within: read the log with angles='deg', or with gears= or "
            "transmission= if they are motor angles."
        )  # fmt: skip
    elif surely:
        kind, advice = FindingKind.MOTOR_SIDE_POSITIONS, (
            "these may be motor angles: read the log with gears= or transmission=."
        )  # fmt: skip
    else:
        found.append(
            LogFinding(
                FindingKind.OUTSIDE_LIMITS, Severity.DOUBTFUL, names,
                f"Joints outside their limits: {listed}; see units, offsets and signs, or the "
                "limits of the model.",
            )
        )  # fmt: skip
        return
    found.append(
        LogFinding(
            kind, Severity.USELESS, names, f"Joints outside their limits: {listed}; {advice}"
        )
    )


def _torque_limits(log: Log, model: RobotModel, found: list[LogFinding]) -> None:
    effort = model.table.effort
    velocity = model.table.velocity
    for j in range(log.n):
        tau = log.tau[:, j]
        largest = max(abs(float(tau.min())), abs(float(tau.max())))
        usual = float(np.quantile(np.abs(_spread(tau)), 0.99))
        if np.isfinite(effort[j]) and effort[j] > 0.0:
            if usual > _WRONG_UNIT * effort[j]:
                _add(
                    found, FindingKind.TORQUE_ABOVE_LIMITS, Severity.USELESS, log, j,
                    f"its torques are up to {largest:.4g}, its limit is {effort[j]:.4g}; see "
                    "units, drive gains and gear ratios.",
                )  # fmt: skip
            elif usual > 1.1 * effort[j]:
                _add(
                    found, FindingKind.TORQUE_ABOVE_LIMITS, Severity.DOUBTFUL, log, j,
                    f"one in a hundred of its torques is above {usual:.4g}, its "
                    f"limit is {effort[j]:.4g}; see drive gains and gear ratios, or the "
                    "limit of the model.",
                )  # fmt: skip
            elif 0.0 < largest < _TINY * effort[j]:
                _add(
                    found, FindingKind.TORQUE_BELOW_USE, Severity.DOUBTFUL, log, j,
                    f"its torques are below {largest:.3g}, its limit is {effort[j]:.4g}; these may "
                    "be in kN m or of the motor. See units, drive gains and gear ratios.",
                )  # fmt: skip
        if np.isfinite(velocity[j]) and velocity[j] > 0.0:
            parts = [_moves(log.q[rows, j]) / log.dt for rows in log.recordings()]
            speed = float(np.quantile(np.concatenate(parts), 0.95)) if len(log) > 2 else 0.0
            if speed > 2.0 * velocity[j]:
                _add(
                    found, FindingKind.TOO_FAST, Severity.DOUBTFUL, log, j,
                    f"one in twenty of its velocities is above {speed:.4g}, its limit is "
                    f"{velocity[j]:.4g}; see the sampling period, units and noise.",
                )  # fmt: skip


def _samples(log: Log, model: RobotModel, found: list[LogFinding]) -> None:
    count = 10 * model.table.f + 4 * model.n
    equations = len(log) * log.n
    if equations < _PER_PARAMETER * count:
        few = equations < count
        found.append(
            LogFinding(
                FindingKind.TOO_SHORT, Severity.USELESS if few else Severity.DOUBTFUL, (),
                f"The log has {len(log)} samples of {log.n} joints, {equations} equations for up "
                f"to {count} parameters; record a longer motion.",
            )
        )  # fmt: skip
