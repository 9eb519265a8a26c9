"""Whether torques belong to the joints they are said to be of, by the dynamic model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..._arrays import Array
from ...errors import InvalidValueError, ShapeError
from ...friction import Friction
from ...friction.combined import by_dependence
from ...logs import FindingKind, Log, LogFinding, Severity
from ...logs.log import check_is_log
from ...minimal_parameters import base_parameters
from ...model import RobotModel, check_model
from ...regressors import torque_regressor
from .delay_rows import filtered_samples, looked_at
from .joint_hypotheses import Hypothesis, JointSamples, better_hypotheses
from .synchronisation import SynchronisationStatus, synchronisation
from .torque_sizes import check_torque_sizes

_CUTOFF, _SHARE = 15.0, 0.1
_ROWS = 300
"""Samples at which the equations of all joints are compared."""
_RANK = 1e-6


def check_joints(
    log: Log, model: RobotModel, friction: Friction | None = None
) -> tuple[LogFinding, ...]:
    """Check a log by the dynamic model: signs, order, units, delay, excitation.

    - Readings of the log with the sign of a joint's position, torque or both changed, with two
      joints swapped in these, with all torques negated, and with positions in degrees are fitted
      to the equations of all joints at once, see `better_hypotheses`. Where one fits significantly
      better than the log as given, it is named.
    - Where the model has masses, torques are compared in size with those of its inertia.
    - The regressor's rank on this motion is compared with the number of base parameters.
    - The delay of the torques is estimated, see `synchronisation`.

    Of a log of more than 1e5 samples so many are looked at, in up to 20 stretches spread evenly
    over it; what is found then says so.

    Parameters
    ----------
    log : Log
        What was recorded.
    model : RobotModel
        The robot it is of; its inertia is used for the size of torques alone.
    friction : Friction, optional
        Gravity compensators of the robot, alone or in a sum: without them their torques may look
        like those of other joints.

    Returns
    -------
    tuple of LogFinding
        Empty if nothing was found.

    Raises
    ------
    ShapeError, InvalidValueError
        The model has other joints; what was given is no log.

    See Also
    --------
    robotmodels.logs.check_log : what can be told without the dynamic model.

    References
    ----------
    Seed book sections 1.6.2.1 to 1.6.2.4.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> t = np.arange(0.0, 4.0, 0.001)[:, None]
    >>> q = np.sin(3.0 * t) + np.sin(7.0 * t)
    >>> v = 3.0 * np.cos(3.0 * t) + 7.0 * np.cos(7.0 * t)
    >>> a = -9.0 * np.sin(3.0 * t) - 49.0 * np.sin(7.0 * t)
    >>> [finding.kind.name for finding in check_joints(Log(0.001, q, -(2.0 * a + v)), one)]
    ['WRONG_SIGN']
    """
    check_is_log(log)
    check_model(model)
    if model.n != log.n:
        raise ShapeError(f"log: {log.n} joints, the model {model.name} has {model.n}.")
    cutoff = min(_CUTOFF, _SHARE / log.dt)
    part = looked_at(log, cutoff)
    found: list[LogFinding] = []
    try:
        samples = JointSamples.of(filtered_samples(part, cutoff, 2, _ROWS))
        _signs_and_order(part, model, samples, by_dependence(friction)[1], found)
        check_torque_sizes(part, model, samples, found)
        _excited(part, model, samples, found)
        _in_step(part, model, found)
    except InvalidValueError as error:  # too short or at rest: no mistake of the log
        words = f"Signs, order, excitation or delay were not checked: {error}"
        found.append(LogFinding(FindingKind.TOO_SHORT, Severity.DOUBTFUL, (), words))
    if part is not log:
        extent = f" (Judged by {len(part)} of {len(log)} samples.)"
        found = [replace(finding, sentence=finding.sentence + extent) for finding in found]
    return tuple(found)


def _signs_and_order(
    log: Log,
    model: RobotModel,
    samples: JointSamples,
    position_dependent: Friction | None,
    found: list[LogFinding],
) -> None:
    """Report flips, swaps and degrees, one after the other where there are several."""
    for _ in range(log.n):
        likely = better_hypotheses(samples, model, position_dependent)
        if not likely:
            return
        best, others = likely[0], likely[1:]
        (kind, words, advice), names = (
            _in_words(best, log),
            tuple(log.names[j] for j in best.joints),
        )
        alike = " Equally likely: " + "; ".join(_in_words(x, log)[1] for x in others) + "."
        found.append(
            LogFinding(
                kind, Severity.USELESS if best.certain else Severity.DOUBTFUL, names,
                f"{words[0].upper()}{words[1:]}: with this correction the equations of all joints "
                f"leave {100.0 * best.left:.2g} % of the variance of the affected torques "
                f"unexplained instead of {100.0 * best.given:.2g} % ({best.significance:.0f} "
                "standard errors). "
                f"{advice}{alike if others else ''}",
            )
        )  # fmt: skip
        if not best.certain:
            return
        samples = samples.read_as(best)


def _in_words(x: Hypothesis, log: Log) -> tuple[FindingKind, str, str]:
    """Kind, name and advice of a hypothesis."""
    names = [log.names[j] for j in x.joints]
    both, (q, tau) = "positions and torques", x.changes
    if x.is_unit:
        return FindingKind.POSITIONS_IN_DEGREES, "positions look like degrees", (
            "Read the log with angles='deg', or with gears= or transmission= if they are motor "
            "angles."
        )  # fmt: skip
    if len(names) == 2 and (x.torque if tau else x.position).trace() >= 0.0:
        what = both if q and tau else "positions" if q else "torques"
        return FindingKind.SWAPPED_JOINTS, (
            f"joints {names[0]} and {names[1]} look swapped in {what}"
        ), "Check the order of the columns (positions=, torques= of read_log)."  # fmt: skip
    if len(names) > 1:
        return FindingKind.WRONG_SIGN, "the torques of all joints have the wrong sign", (
            "Use negative drive_gains= of read_log."
        )  # fmt: skip
    if q and tau:
        return FindingKind.WRONG_SIGN, (
            f"joint {names[0]} looks flipped (wrong sign of position and torque)"
        ), "Give it -1 in signs= of read_log."  # fmt: skip
    what = "position" if q else "torque"
    return FindingKind.WRONG_SIGN, f"the {what} of joint {names[0]} has the wrong sign", (
        "Use signs= of read_log to reverse position and torque together, or negative "
        "drive_gains= to reverse the torque alone."
    )  # fmt: skip


def _excited(log: Log, model: RobotModel, samples: JointSamples, found: list[LogFinding]) -> None:
    base = base_parameters(model, drive=True)
    W = torque_regressor(model, samples.q, samples.v, samples.a, columns=base.names)
    possible, seen = len(base), _rank(W)
    if seen < possible:
        found.append(
            LogFinding(
                FindingKind.NOT_EXCITING, Severity.DOUBTFUL, (),
                f"The motion shows {seen} of {possible} base parameters; the others cannot be told "
                "apart. Record a motion that excites them (exciting_trajectory), or identify the "
                "joints that move.",
            )
        )  # fmt: skip


def _rank(W: Array) -> int:
    R = np.asarray(np.linalg.qr(W.reshape(-1, W.shape[-1]), mode="r"))
    size = np.sqrt((R**2).sum(axis=0))
    kept = size > 1e-9 * size.max(initial=0.0)
    s = np.linalg.svd(R[:, kept] / size[kept], compute_uv=False)
    return int((s > _RANK * s.max(initial=0.0)).sum())


def _in_step(log: Log, model: RobotModel, found: list[LogFinding]) -> None:
    estimate = synchronisation(log, model)
    if estimate.status is SynchronisationStatus.AT_THE_END:
        found.append(
            LogFinding(
                FindingKind.OUT_OF_STEP, Severity.DOUBTFUL, (),
                f"The torques fit the positions best {1e3 * abs(estimate.delay):.0f} ms "
                f"{'late' if estimate.delay > 0.0 else 'early'}, the largest delay that was tried: "
                "either they are further out of step, or of another motion. Try more by "
                "synchronisation(log, model, within=...), and take it out with with_delay.",
            )
        )  # fmt: skip
    if not estimate.status.is_success:
        return
    if estimate.is_out_of_step:
        found.append(
            LogFinding(
                FindingKind.OUT_OF_STEP, Severity.DOUBTFUL, (),
                f"{estimate} Take it out with with_delay(log, {estimate.delay:.3g}).",
            )
        )  # fmt: skip
