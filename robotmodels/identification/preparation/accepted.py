"""Which logs a fit accepts, and what it says of them."""

from __future__ import annotations

import numpy as np

from ...errors import InvalidValueError
from ...friction import Friction
from ...logs import FindingKind, Log, LogFinding, Severity, check_log
from ...logs.bad_samples import cleaned
from ...model import RobotModel
from .joint_checks import check_joints


def accepted_log(
    log: Log, model: RobotModel, name: str, friction: Friction | None = None
) -> tuple[Log, tuple[str, ...]]:
    """Check and clean a log; raise if it is unusable."""
    log, found = _cleaned(log, model)
    if not any(finding.severity is Severity.USELESS for finding in found):
        found = (*found, *check_joints(log, model, friction))
    return log, _sentences(found, name)


def accepted_test(
    log: Log, test: Log, model: RobotModel, checked: bool
) -> tuple[Log, tuple[str, ...]]:
    """Check and clean the test log, which must match the fitted one."""
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
        return test, ()
    # how it moves does not matter, but what it is in does
    test, found = _cleaned(test, model)
    return test, tuple(f"Of the log kept aside: {each}" for each in _sentences(found, "test"))


def _cleaned(log: Log, model: RobotModel) -> tuple[Log, tuple[LogFinding, ...]]:
    found = check_log(log, model)
    if any(finding.kind in (FindingKind.STUCK, FindingKind.SPIKES) for finding in found):
        log = cleaned(log)
    return log, found


def _sentences(found: tuple[LogFinding, ...], name: str) -> tuple[str, ...]:
    useless = [str(finding) for finding in found if finding.severity is Severity.USELESS]
    if useless:
        raise InvalidValueError(
            f"{name}: " + " ".join(useless) + " (checked=False takes the log as it is.)"
        )
    return tuple(str(finding) for finding in found)
