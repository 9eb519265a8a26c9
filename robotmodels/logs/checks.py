"""Whether a log can be what it is said to be: units, limits, channels that say nothing."""

from __future__ import annotations

from ..model import RobotModel, check_model
from .bad_samples import bad_samples
from .channel_checks import (
    coarse,
    constant,
    jumps,
    one_way,
    report_bad_samples,
    saturated,
    stuck,
)
from .findings import FindingKind, LogFinding, Severity
from .log import Log, check_is_log
from .model_checks import joint_order, position_units, samples, torques_and_speeds
from .rates import rates_off

_LONGEST_PERIOD = 0.5
"""Seconds between samples above which nothing is seen of how a robot moves."""


def check_log(log: Log, model: RobotModel | None = None) -> tuple[LogFinding, ...]:
    """What is wrong or strange in a log, each with what to do about it.

    Without a model: joints that do not move and torques that are constant, saturation, coarse
    steps, single samples that stand out, values that repeat, jumps, recordings that are too short,
    a period that is too long, velocities and accelerations that do not follow from the positions.
    With one, besides: numbers of joints and their order, degrees, motor angles, limits of position,
    velocity and torque, samples for the number of parameters. Of a long log quantiles, steps of
    sensors and turns are those of about 1e5 samples spread evenly over it; everything else is
    looked at in every sample.
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
    >>> import numpy as np
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
        joint_order(log, model, found)
    _period(log, found)
    moving = constant(log, found)
    saturated(log, found)
    coarse(log, moving, found)
    bad = bad_samples(log)
    report_bad_samples(log, bad, found)
    stuck(log, moving, found)
    jumps(log, moving, bad, found)
    one_way(log, moving, found)
    found += rates_off(log)
    if model is not None:
        position_units(log, model, found)
        torques_and_speeds(log, model, found)
        samples(log, model, found)
    order = list(Severity)[::-1]
    return tuple(sorted(found, key=lambda finding: order.index(finding.severity)))


def _period(log: Log, found: list[LogFinding]) -> None:
    if log.dt > _LONGEST_PERIOD:
        found.append(
            LogFinding(
                FindingKind.IMPLAUSIBLE_PERIOD, Severity.USELESS, (),
                f"Its samples are {log.dt:.4g} s apart, in which a robot does more than can be "
                "seen; the times may be in milliseconds. See times= and dt= of read_log.",
            )
        )  # fmt: skip
