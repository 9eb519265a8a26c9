"""Whether a log can be of a robot: order of joints, units, limits, number of samples."""

from __future__ import annotations

import numpy as np

from ..geometry import PRISMATIC
from ..model import RobotModel
from .findings import FindingKind, LogFinding, Severity, add_of_joint
from .log import Log
from .long_channels import chunks, moves, spread

_DEGREES = 180.0 / np.pi
_BEYOND = 0.05
"""Of its range, how far a joint may be outside its limits: sensors and stops are not exact."""
_TURNS = 30.0
_MOST = 1000.0
"""Angle, rad, that no joint of an arm reaches, limits or not."""
_FACTOR = 4.0
"""Times its limit that a joint must be at to be in another unit, not only off its zero."""
_PER_PARAMETER = 10
_TINY = 1e-3
_WRONG_UNIT = 10.0
"""Times its limit that a torque must be at to be in another unit or of a motor."""


def joint_order(log: Log, model: RobotModel, found: list[LogFinding]) -> None:
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


def position_units(log: Log, model: RobotModel, found: list[LogFinding]) -> None:
    """Report positions outside their limits, and the unit or side that would explain them."""
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
    fits = np.where(
        known,
        (least / _DEGREES >= lower - margin) & (most / _DEGREES <= upper + margin),
        size <= 360.0,
    )[~prismatic].all()
    ratio = model.transmission
    motors = False
    if ratio is not None and ratio.is_invertible and not np.allclose(ratio.matrix, np.eye(log.n)):
        motors = True
        for rows in chunks(len(log)):
            q = ratio.to_joint(log.q[rows])
            motors &= bool(((q >= lower - margin) & (q <= upper + margin))[:, known].all())
    names = tuple(log.names[j] for j in outside)
    limits = [
        f"limits {lower[j]:.4g} to {upper[j]:.4g}"
        if known[j]
        else f"{size[j] / (2.0 * np.pi):.3g} turns; the model has no limits"
        for j in range(log.n)
    ]
    listed = ", ".join(
        f"{log.names[j]} ({least[j]:.4g} to {most[j]:.4g}, {limits[j]})" for j in outside
    )
    reach = np.where(known, np.maximum(np.abs(lower), np.abs(upper)), np.pi)
    far = bool((size > _FACTOR * reach)[outside].any())
    # a joint without limits may turn on and on: whether it does is told by the dynamic model
    surely = bool((size > np.where(known, _FACTOR * reach, _MOST))[outside].any())
    if motors and surely:
        kind, advice = FindingKind.MOTOR_SIDE_POSITIONS, (
            "through the model's transmission they would be within: read the log with "
            "transmission=model.transmission."
        )  # fmt: skip
    elif fits and far:
        kind, advice = FindingKind.POSITIONS_IN_DEGREES, (
            f"as degrees they would be within{'' if turning.any() else ' a turn'}: read the log "
            "with angles='deg', or with gears= or transmission= if they are motor angles."
        )  # fmt: skip
    elif far:
        kind, advice = FindingKind.MOTOR_SIDE_POSITIONS, (
            "these may be motor angles: read the log with gears= or transmission=."
        )  # fmt: skip
    else:
        kind, advice = FindingKind.OUTSIDE_LIMITS, (
            "see units, offsets and signs, or the limits of the model."
        )  # fmt: skip
    severity = Severity.USELESS if surely else Severity.DOUBTFUL
    found.append(
        LogFinding(kind, severity, names, f"Joints outside their limits: {listed}; {advice}")
    )


def torques_and_speeds(log: Log, model: RobotModel, found: list[LogFinding]) -> None:
    """Report torques and velocities that do not fit their limits."""
    effort = model.table.effort
    velocity = model.table.velocity
    for j in range(log.n):
        tau = log.tau[:, j]
        largest = max(abs(float(tau.min())), abs(float(tau.max())))
        usual = float(np.quantile(np.abs(spread(tau)), 0.99))
        if np.isfinite(effort[j]) and effort[j] > 0.0:
            if usual > _WRONG_UNIT * effort[j]:
                add_of_joint(
                    found, FindingKind.TORQUE_ABOVE_LIMITS, Severity.USELESS, log, j,
                    f"its torques are up to {largest:.4g}, its limit is {effort[j]:.4g}; see "
                    "units, drive gains and gear ratios.",
                )  # fmt: skip
            elif usual > 1.1 * effort[j]:
                add_of_joint(
                    found, FindingKind.TORQUE_ABOVE_LIMITS, Severity.DOUBTFUL, log, j,
                    f"one in a hundred of its torques is above {usual:.4g}, its "
                    f"limit is {effort[j]:.4g}; see drive gains and gear ratios, or the "
                    "limit of the model.",
                )  # fmt: skip
            elif 0.0 < largest < _TINY * effort[j]:
                add_of_joint(
                    found, FindingKind.TORQUE_BELOW_USE, Severity.DOUBTFUL, log, j,
                    f"its torques are below {largest:.3g}, its limit is {effort[j]:.4g}; these may "
                    "be in kN m or of the motor. See units, drive gains and gear ratios.",
                )  # fmt: skip
        if np.isfinite(velocity[j]) and velocity[j] > 0.0:
            parts = [moves(log.q[rows, j]) / log.dt for rows in log.recordings()]
            speed = float(np.quantile(np.concatenate(parts), 0.95)) if len(log) > 2 else 0.0
            if speed > 2.0 * velocity[j]:
                add_of_joint(
                    found, FindingKind.TOO_FAST, Severity.DOUBTFUL, log, j,
                    f"one in twenty of its velocities is above {speed:.4g}, its limit is "
                    f"{velocity[j]:.4g}; see the sampling period, units and noise.",
                )  # fmt: skip


def samples(log: Log, model: RobotModel, found: list[LogFinding]) -> None:
    """Report logs with few equations for the parameters of the robot."""
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
