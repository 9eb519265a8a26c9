"""Findings of the checks of a log."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from .log import Log


class Severity(Enum):
    """Severity of a finding; the value states the consequence.

    Examples
    --------
    >>> Severity.USELESS.value
    'a fit would mean nothing'
    """

    NOTE = "worth knowing"
    DOUBTFUL = "results may be wrong"
    USELESS = "a fit would mean nothing"


class FindingKind(Enum):
    """Kind of a finding; the value describes it.

    Examples
    --------
    >>> FindingKind.STUCK.value
    'a channel repeats its value'
    """

    WRONG_JOINT_COUNT = "log and model have different numbers of joints"
    WRONG_JOINT_ORDER = "its joints are the model's in another order"
    IMPLAUSIBLE_PERIOD = "the sampling period is too long for a robot"
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
    """A finding of a check of a log; it prints as its sentence.

    Parameters
    ----------
    kind : FindingKind
        Its kind.
    severity : Severity
        Its severity.
    joints : tuple of str
        Joints it concerns; empty if it concerns the whole log.
    sentence : str
        With numbers and the remedy.

    Examples
    --------
    >>> print(LogFinding(FindingKind.STUCK, Severity.NOTE, ("2",), "Joint 2: ..."))
    Joint 2: ...
    """

    kind: FindingKind
    severity: Severity
    joints: tuple[str, ...]
    sentence: str

    def __str__(self) -> str:
        return self.sentence


Finding = tuple[FindingKind, Severity, str]
"""Finding about a joint, before its name is added to the sentence."""


def in_words(log: Log, j: int, finding: Finding) -> LogFinding:
    """A finding about joint ``j``, named in the sentence."""
    kind, severity, words = finding
    return LogFinding(kind, severity, (log.names[j],), f"Joint {log.names[j]}: {words}")
