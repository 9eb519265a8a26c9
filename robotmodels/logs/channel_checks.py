"""Channels of a log that say nothing or not the truth, whatever robot it is of."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .bad_samples import BadSamples
from .findings import FindingKind, LogFinding, Severity, add_of_joint
from .log import Log
from .long_channels import Runs, chunks, moves, resolution, spread

_OFTEN = 0.01
_SATURATED = 0.02
_ROWS = 3
"""Rows in all channels alike, one after the other, that show a recorder that is too fast."""
_JUMP = 20.0
_FEW_LEVELS = 100


def constant(log: Log, found: list[LogFinding]) -> NDArray[np.bool_]:
    """Report channels that do not change; joints that move."""
    span = np.ptp(log.q, axis=0)
    moving = span > 1e-9
    for j in range(log.n):
        if not moving[j]:
            add_of_joint(
                found, FindingKind.CONSTANT_POSITION, Severity.DOUBTFUL, log, j,
                f"it stays at {log.q[0, j] + 0.0:.4g}; nothing is found of its inertia "
                "and friction. See whether the right column was read, or take it out of the model.",
            )  # fmt: skip
        if np.ptp(log.tau[:, j]) == 0.0:
            add_of_joint(
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


def saturated(log: Log, found: list[LogFinding]) -> None:
    """Report torques that stay at their largest or smallest value."""
    for j in range(log.n):
        tau = log.tau[:, j]
        span = float(np.ptp(tau))
        if not span:
            continue
        for end, word in ((float(tau.max()), "largest"), (float(tau.min()), "smallest")):
            count = sum(
                int((np.abs(tau[rows] - end) <= 1e-6 * span).sum()) for rows in chunks(len(tau))
            )
            share = count / len(tau)
            if share <= _SATURATED or count < 5:
                continue
            # a current that is cut stays for several samples, steps of a sensor do so anywhere
            levels = len(np.unique(tau[: min(len(tau), 20000)]))
            if share > 5.0 / levels:
                add_of_joint(
                    found, FindingKind.SATURATED, Severity.DOUBTFUL, log, j,
                    f"{100 * share:.1f} % of its torques are the {word} one ({end:.4g}); the drive "
                    "looks saturated. Record slower motion, or leave these rows out.",
                )  # fmt: skip


def coarse(log: Log, moving: NDArray[np.bool_], found: list[LogFinding]) -> None:
    """Report positions that have few steps over their motion."""
    for j in np.flatnonzero(moving).tolist():
        step = resolution(spread(log.q[:, j]))
        span = float(np.ptp(log.q[:, j]))
        if step > 0.0 and span / step < _FEW_LEVELS:
            add_of_joint(
                found, FindingKind.QUANTISED, Severity.DOUBTFUL, log, j,
                f"its positions have steps of {step:.3g}, only {span / step:.0f} of them over its "
                "motion; velocities and accelerations of them are rough. Record with more digits, "
                "or move it further.",
            )  # fmt: skip


def report_bad_samples(log: Log, bad: list[BadSamples], found: list[LogFinding]) -> None:
    """Report outliers and frozen samples, which a fit interpolates or leaves out."""
    for some in bad:
        rows, word = some.rows, "position" if some.channel == "q" else "torque"
        if some.repeats:
            runs = np.flatnonzero(np.diff(rows, prepend=-2) > 1).tolist()
            first = [*runs, len(rows)][1]
            kind, words = FindingKind.STUCK, (
                f"its {word} repeats for {first + 1} samples from row {rows[0] - 1}"
                + (f", and {len(runs) - 1} times more" if len(runs) > 1 else "")
                + " while the joint moves; the sensor or the recorder stopped. fit interpolates "
                "these samples where the gap is short and leaves the rows out where it is long."
            )  # fmt: skip
        else:
            one = len(rows) == 1
            kind, words = FindingKind.SPIKES, (
                f"{len(rows)} sample{'' if one else 's'} of its {word} "
                f"{'is an outlier (' if one else 'are outliers (the first '}at row {rows[0]}); "
                f"fit replaces {'it' if one else 'them'} by interpolation."
            )  # fmt: skip
        add_of_joint(found, kind, Severity.DOUBTFUL, log, some.joint, words)


def stuck(log: Log, moving: NDArray[np.bool_], found: list[LogFinding]) -> None:
    """Report rows that repeat in every channel: samples that were not taken."""
    if not moving.any():
        return
    whole, repeated = Runs(_ROWS), 0
    for rows in chunks(len(log) - 1):
        both = slice(rows.start, rows.stop + 1)
        still = np.diff(log.q[both], axis=0) == 0.0
        same = still[:, moving].all(axis=1) & (np.diff(log.tau[both], axis=0) == 0.0).all(axis=1)
        whole.add(same)
        repeated += int(same.sum())
    if repeated == len(log) - 1:
        return
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


def jumps(
    log: Log, moving: NDArray[np.bool_], bad: list[BadSamples], found: list[LogFinding]
) -> None:
    """Report positions that jump from a sample to the next; not to or from bad samples."""
    for j in np.flatnonzero(moving).tolist():
        largest, at, usual = 0.0, 0, 0.0
        known = np.ones(len(log), dtype=bool)
        for some in bad:
            if some.joint == j and some.channel == "q":
                known[some.rows] = False
        for rows in log.recordings():
            q = log.q[rows, j]
            if len(q) < 2:
                continue
            usual = max(usual, float(np.quantile(moves(q), 0.99)))
            for part in chunks(len(q) - 1):
                first = rows.start + part.start
                good = known[first : rows.start + part.stop + 1]
                steps = np.abs(np.diff(q[part.start : part.stop + 1])) * (good[1:] & good[:-1])
                k = int(steps.argmax())
                if steps[k] > largest:
                    largest, at = float(steps[k]), first + k + 1
        if usual > 0.0 and largest > _JUMP * usual:
            turn = abs(largest - 2.0 * np.pi) < 0.1
            add_of_joint(
                found, FindingKind.JUMP, Severity.DOUBTFUL, log, j,
                f"its position jumps by {largest:.4g} at row {at}, {largest / usual:.0f} times "
                "what 99 % of its steps are at most; "
                + ("that is a turn: unwrap it (numpy.unwrap)." if turn else
                   "leave the row out, or split the log there."),
            )  # fmt: skip


def one_way(log: Log, moving: NDArray[np.bool_], found: list[LogFinding]) -> None:
    """Report joints that go one way only: less than a period of their motion."""
    for j in np.flatnonzero(moving).tolist():
        span = float(np.ptp(log.q[:, j]))
        way = sum(_reversals(spread(log.q[rows, j]), 0.05 * span) for rows in log.recordings())
        if way == 0:
            add_of_joint(
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
