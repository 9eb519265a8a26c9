"""Checks before a fit: signs, order and units of the joints, excitation, delay.

Book sections 1.6.2.1 to 1.6.2.4.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from .._arrays import Array
from ..dynamics.inverse import motion_torques
from ..errors import InvalidValueError
from ..estimation.factor import triangle
from ..friction import Friction
from ..friction.protocols import by_dependence
from ..logs import FindingKind, Log, LogFinding, Severity, check_log
from ..logs.bad_samples import cleaned
from ..logs.log import check_is_log
from ..minimal_parameters import base_parameters
from ..model import RobotModel
from ..regressors import torque_regressor
from .delay import (
    SynchronisationStatus,
    check_log_and_model,
    default_cutoff,
    filtered_samples,
    representative_part,
    synchronisation,
)
from .joint_hypotheses import ADVICE, better_hypotheses


def accepted_log(
    log: Log, model: Any, name: str, friction: Friction | None = None, joints: bool = True
) -> tuple[Log, tuple[str, ...]]:
    """Check and clean a log, with sentences on the findings; raise if it is unusable."""
    findings = check_log(log, model)
    if any(finding.kind in (FindingKind.STUCK, FindingKind.SPIKES) for finding in findings):
        log = cleaned(log)
    if joints and not any(finding.severity is Severity.USELESS for finding in findings):
        findings = (*findings, *check_joints(log, model, friction))
    useless = [str(finding) for finding in findings if finding.severity is Severity.USELESS]
    if useless:
        advice = "(checked=False uses the log unchanged.)"
        raise InvalidValueError(f"{name}: {' '.join(useless)} {advice}")
    return log, tuple(map(str, findings))


def accepted_test(
    log: Log, test: Log, model: RobotModel, checked: bool
) -> tuple[Log, tuple[str, ...]]:
    """Check and clean the test log, which must match the fitted one."""
    check_is_log(test)
    if test.n != model.n:
        raise InvalidValueError(f"test: expected a log of {model.n} joints, got {test.n}.")
    if abs(test.dt - log.dt) > 1e-6 * log.dt:
        raise InvalidValueError(
            f"test: expected the sampling period of the log ({log.dt:g} s), since it is processed "
            f"in the same way, got {test.dt:g} s; read it with dt={log.dt:g}, or call "
            "validate(result, log)."
        )
    if np.shares_memory(log.q, test.q):
        raise InvalidValueError(
            "test: it has rows of the log that is fitted, so that it is no test; give rows "
            "that are not fitted."
        )
    if not checked:
        return test, ()
    test, sentences = accepted_log(test, model, "test", joints=False)
    return test, tuple(f"Of the held-out log: {sentence}" for sentence in sentences)


def check_joints(
    log: Log, model: RobotModel, friction: Friction | None = None
) -> tuple[LogFinding, ...]:
    """Findings on signs, order and units of the joints of a log, from their equations."""
    check_log_and_model(log, model)
    cutoff = default_cutoff(log)
    part = representative_part(log, cutoff)
    findings: list[LogFinding] = []
    try:
        x, rows = filtered_samples(part, cutoff, 2, 300)
        samples = np.stack([signal[rows] for signal in (x.q, x.v, x.a, x.tau)])
        findings += _signs_and_order(part, model, samples, cutoff, by_dependence(friction)[1])
        findings += _torque_sizes(part, model, samples)
        findings += _excitation(model, samples)
        findings += _delay(part, model)
    except InvalidValueError as error:  # too short or at rest
        words = f"Signs, order, excitation or delay were not checked: {error}"
        findings.append(_doubtful(FindingKind.TOO_SHORT, words))
    if part is not log:
        extent = f" (From {len(part)} of {len(log)} samples.)"
        findings = [replace(finding, sentence=finding.sentence + extent) for finding in findings]
    return tuple(findings)


def _doubtful(kind: FindingKind, sentence: str, joints: tuple[str, ...] = ()) -> LogFinding:
    return LogFinding(kind, Severity.DOUBTFUL, joints, sentence)


def _signs_and_order(
    log: Log, model: RobotModel, samples: Array, cutoff: float, compensators: Friction | None
) -> Iterator[LogFinding]:
    """Wrong signs, swapped joints and degrees, the most likely first."""
    for _ in range(log.n):
        likely = better_hypotheses(samples, model, cutoff, log.names, compensators)
        if not likely:
            return
        best, correction = likely[0], likely[0].correction
        words, advice = correction.words, ADVICE[correction.kind]
        if len(likely) > 1:
            others = "; ".join(other.correction.words for other in likely[1:])
            advice = f"{advice} Equally likely: {others}."
        sentence = (
            f"{words[0].upper()}{words[1:]}: with this correction the equations of all joints "
            f"leave {100.0 * best.left:.2g} % of the variance of the affected torques unexplained "
            f"instead of {100.0 * best.given:.2g} % ({best.significance:.0f} standard errors). "
            f"{advice}"
        )
        severity = Severity.USELESS if best.certain else Severity.DOUBTFUL
        names = tuple(log.names[j] for j in correction.joints)
        yield LogFinding(correction.kind, severity, names, sentence)
        if not best.certain:
            return
        samples = correction.of(samples)


def _torque_sizes(log: Log, model: RobotModel, samples: Array) -> Iterator[LogFinding]:
    """Joints whose torques differ in size from those of the model's inertia, if it has any.

    Joints whose torque the inertia does not explain are skipped.
    """
    if model.inertia is None or not (model.inertia.values[:, 9] > 0.0).any():
        return
    q, v, a, tau = samples
    predicted, gains = motion_torques(model, q, v, a, drive=False), {}
    for j, name in enumerate(log.names):
        friction = np.column_stack([v[:, j], np.sign(v[:, j]), a[:, j], np.ones(len(v))])
        both = np.column_stack([predicted[:, j], tau[:, j]])
        (xx, xy), (_, yy) = np.cov((both - friction @ np.linalg.lstsq(friction, both)[0]).T)
        if xy > 0.0 and xy**2 > 0.5 * xx * yy:
            gains[name] = float(xy / xx)
    # inertias of catalogues are wrong by less than a factor of 20
    large = {name: f"{gain:.3g} times" for name, gain in gains.items() if gain > 20.0}
    small = {name: f"1/{1.0 / gain:.3g}" for name, gain in gains.items() if gain < 1.0 / 20.0}
    units = "in another unit: check units, drive_gains= and gears= of read_log."
    if all(1.0 / 3.0 < gains[name] / 1e3 < 3.0 for name in large):
        units = "in mN m: use drive_gains=0.001."
    some = " or in kN m" if len(small) == len(gains) > 1 else " at these joints only"
    motors = f"motor torques{some}: see gears=, transmission= and drive_gains= of read_log."
    for off, size, advice in ((large, "larger", units), (small, "smaller", motors)):
        if off:
            listed = ", ".join(f"{name}: {factor}" for name, factor in off.items())
            sentence = (
                f"Torques without friction are much {size} than those computed from the model's "
                f"inertia ({listed}); they may be {advice}"
            )
            yield _doubtful(FindingKind.TORQUE_OFF_INERTIA, sentence, tuple(off))


def _excitation(model: RobotModel, samples: Array) -> Iterator[LogFinding]:
    """A motion on which the regressor has less than full rank."""
    base = base_parameters(model, drive=True)
    W = torque_regressor(model, *samples[:3], columns=base.names)
    R = triangle(W.reshape(-1, len(base)))
    size = np.linalg.norm(R, axis=0)
    kept = size > 1e-9 * size.max(initial=0.0)
    rank = int(np.linalg.matrix_rank(R[:, kept] / size[kept], rtol=1e-6)) if kept.any() else 0
    if rank < len(base):
        sentence = (
            f"The motion excites {rank} of {len(base)} base parameters; the others are not "
            "identifiable. Record a motion that excites them (exciting_trajectory), or "
            "identify the joints that move."
        )
        yield _doubtful(FindingKind.NOT_EXCITING, sentence)


def _delay(log: Log, model: RobotModel) -> Iterator[LogFinding]:
    """A delay between torques and positions."""
    estimate = synchronisation(log, model)
    if estimate.status is SynchronisationStatus.AT_THE_END:
        sentence = (
            f"The torques fit the positions best {1e3 * abs(estimate.delay):.0f} ms "
            f"{'late' if estimate.delay > 0.0 else 'early'}, the largest delay tried: "
            "the delay is larger, or they belong to different motions. Extend the range by "
            "synchronisation(log, model, within=...), and remove the delay by with_delay."
        )
        yield _doubtful(FindingKind.OUT_OF_STEP, sentence)
    elif estimate.is_out_of_step:
        sentence = f"{estimate} Remove it by with_delay(log, {estimate.delay:.3g})."
        yield _doubtful(FindingKind.OUT_OF_STEP, sentence)
