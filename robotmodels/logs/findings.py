"""What a check of a log found, in words."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from .log import Log


class Severity(Enum):
    """How bad a finding is; the value says what follows.

    Examples
    --------
    >>> Severity.USELESS.value
    'a fit would mean nothing'
    """

    NOTE = "worth knowing"
    DOUBTFUL = "results may be wrong"
    USELESS = "a fit would mean nothing"


class FindingKind(Enum):
    """What may be wrong with a log; the value says it in words.

    Examples
    --------
    >>> FindingKind.STUCK.value
    'a channel repeats its value'
    """

    WRONG_JOINT_COUNT = "its joints are not as many as the model's"
    WRONG_JOINT_ORDER = "its joints are the model's in another order"
    IMPLAUSIBLE_PERIOD = "its sampling period is that of no recorder of a robot"
    POSITIONS_IN_DEGREES = "positions look like degrees"
    MOTOR_SIDE_POSITIONS = "positions look like those of motors"
    OUTSIDE_LIMITS = "positions are outside the limits"
    TOO_FAST = "velocities are above the limits"
    RATES_OFF_POSITIONS = "velocities or accelerations do not follow from the positions"
    TORQUE_ABOVE_LIMITS = "torques are above the limits"
    TORQUE_BELOW_USE = "torques are too small to be torques of the joints"
    TORQUE_OFF_INERTIA = "torques differ in size from those of the model's inertia"
    CONSTANT_POSITION = "a joint does not move"
    CONSTANT_TORQUE = "a torque is constant"
    NOTHING_MOVES = "nothing moves"
    SATURATED = "torques stay at their extreme values"
    QUANTISED = "positions have coarse steps"
    STUCK = "a channel repeats its value"
    SPIKES = "single samples are outliers"
    JUMP = "positions jump"
    TOO_SHORT = "it is short for what is to be found"
    SLOWER_THAN_LOG = "a joint does not come back in the time of the log"
    NOT_EXCITING = "its motion does not show all parameters"
    SWAPPED_JOINTS = "joints look swapped"
    WRONG_SIGN = "a sign looks wrong"
    OUT_OF_STEP = "positions and torques are out of step"


@dataclass(frozen=True, slots=True)
class LogFinding:
    """One thing that is wrong or strange.

    Parameters
    ----------
    kind : FindingKind
        What.
    severity : Severity
        How bad.
    joints : tuple of str
        Where; empty if it is of the whole log.
    sentence : str
        With numbers, and what to do.

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


def add_of_joint(
    found: list[LogFinding], kind: FindingKind, severity: Severity, log: Log, j: int, words: str
) -> None:
    """Add what is wrong with joint ``j``, named in the sentence."""
    name = log.names[j]
    found.append(LogFinding(kind, severity, (name,), f"Joint {name}: {words}"))
