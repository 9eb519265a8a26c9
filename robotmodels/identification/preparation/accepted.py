"""Which logs a fit accepts, and what it says of them."""

from __future__ import annotations

import numpy as np

from ...errors import InvalidValueError
from ...friction import Friction
from ...logs import Log, Severity, check_log
from ...model import RobotModel
from .joint_checks import check_joints


def accepted_log(
    log: Log, model: RobotModel, name: str, friction: Friction | None = None
) -> tuple[str, ...]:
    """Sentences on a log that may be used; one that may not is refused with all of them.

    Parameters
    ----------
    log : Log
        What was recorded.
    model : RobotModel
        The robot.
    name : str
        Of the argument, for messages.
    friction : Friction, optional
        The friction model of the fit, as for `check_joints`.

    Returns
    -------
    tuple of str
        What is doubtful.

    Raises
    ------
    InvalidValueError
        What makes a fit meaningless, each finding with what to do.
    """
    found = check_log(log, model)
    if not any(finding.severity is Severity.USELESS for finding in found):
        found = (*found, *check_joints(log, model, friction))
    useless = [str(finding) for finding in found if finding.severity is Severity.USELESS]
    if useless:
        raise InvalidValueError(
            f"{name}: " + " ".join(useless) + " (checked=False takes the log as it is.)"
        )
    return tuple(str(finding) for finding in found)


def accepted_test(log: Log, test: Log, model: RobotModel, checked: bool) -> tuple[str, ...]:
    """What is to be said of the log that is kept aside; it must be like the other, and another.

    Parameters
    ----------
    log, test : Log
        The log that is fitted, and the one kept aside.
    model : RobotModel
        The robot.
    checked : bool
        Whether its channels are looked at.

    Returns
    -------
    tuple of str
        What is doubtful.

    Raises
    ------
    InvalidValueError
        Another number of joints or period, rows of the log that is fitted, useless channels.
    """
    if test.n != model.n:
        raise InvalidValueError(f"test: expected a log of {model.n} joints, got {test.n}.")
    if abs(test.dt - log.dt) > 1e-6 * log.dt:
        raise InvalidValueError(
            f"test: expected the sampling period of the log ({log.dt:g} s), since it is processed "
            f"alike, got {test.dt:g} s; read it with dt={log.dt:g}, or call result.validate."
        )
    if np.shares_memory(log.q, test.q):
        raise InvalidValueError(
            "test: it has rows of the log that is fitted, so that it would test nothing; give rows "
            "that are not fitted."
        )
    if not checked:
        return ()
    # how it moves does not matter, but what it is in does
    found = check_log(test, model)
    useless = [str(finding) for finding in found if finding.severity is Severity.USELESS]
    if useless:
        raise InvalidValueError(
            "test: " + " ".join(useless) + " (checked=False takes the log as it is.)"
        )
    return tuple(f"Of the log kept aside: {finding}" for finding in found)
