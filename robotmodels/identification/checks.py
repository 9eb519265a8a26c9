"""Checks before a fit: signs, order and units of the joints, excitation, delay.

Signs, order and unit are hypotheses, compared by the equations of all joints at once: Q. H. Vuong,
"Likelihood ratio tests for model selection and non-nested hypotheses", Econometrica 57(2), 1989;
book sections 1.6.2.1 to 1.6.2.4.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from .._arrays import Array
from ..dynamics.inverse import motion_torques
from ..errors import InvalidValueError
from ..estimation.factor import triangle
from ..friction import Friction
from ..friction.protocols import by_dependence
from ..geometry import PRISMATIC
from ..logs import FindingKind, Log, LogFinding, Severity, check_log
from ..logs.channels import cleaned
from ..logs.log import check_is_log
from ..minimal_parameters import base_parameters
from ..model import RobotModel
from ..regressors import torque_regressor
from .delay import (
    SMOOTH_DRIVE,
    SynchronisationStatus,
    check_log_and_model,
    default_cutoff,
    filtered_samples,
    motor_speeds,
    representative_part,
    synchronisation,
)


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
    log: Log, test: Log, n: int, model: RobotModel | None, checked: bool
) -> tuple[Log, tuple[str, ...]]:
    """Check and clean the test log of n joints, which must match the fitted one."""
    check_is_log(test)
    if test.n != n:
        raise InvalidValueError(f"test: expected a log of {n} joints, got {test.n}.")
    if abs(test.dt - log.dt) > 1e-6 * log.dt:
        raise InvalidValueError(
            f"test: expected the sampling period of the log ({log.dt:g} s), since it is processed "
            f"in the same way, got {test.dt:g} s; read it with dt={log.dt:g}, or call "
            "validate(result, log)."
        )
    if np.shares_memory(log.q, test.q):
        raise InvalidValueError(
            "test: it shares rows with the fitted log, so that it is not independent; give "
            "rows that are not fitted."
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


_LIKELY, _CERTAIN = np.log(2.0), np.log(3.0)
"""Least mean log ratio of residual variances of a doubtful and of a certain hypothesis; smaller
ratios are explained by errors of the model."""
_SIGNIFICANT = 4.0  # least mean difference of log-likelihoods, in standard errors
_REVERSALS = 6  # least number of reversals of a joint for a certain hypothesis
_ITERATIONS = 4
_FLOOR = 1e-6  # least residual variance relative to the torque; smaller ones are equal
ADVICE = {
    FindingKind.WRONG_SIGN: "Use signs= of read_log to reverse position and torque together, or "
    "negative drive_gains= to reverse the torque alone.",
    FindingKind.SWAPPED_JOINTS: "Check the column order (positions=, torques= of read_log).",
    FindingKind.POSITIONS_IN_DEGREES: "Read the log with angles='deg', or with gears= or "
    "transmission= if they are motor angles.",
}


class LogCorrection(NamedTuple):
    """Correction of a log by matrices (n, n), and the mistake that it corrects."""

    kind: FindingKind
    words: str
    joints: tuple[int, ...]
    position: Array
    torque: Array

    def of(self, samples: Array) -> Array:
        """Samples of q, v, a and tau, shape (4, T, n), after this correction."""
        return np.concatenate([samples[:3] @ self.position.T, samples[3:] @ self.torque.T])


class Hypothesis(NamedTuple):
    """A correction that fits better, the residual variance with and without it, and its test."""

    correction: LogCorrection
    certain: bool
    gain: float
    left: float
    given: float
    significance: float


def better_hypotheses(
    samples: Array,
    model: RobotModel,
    cutoff: float,
    names: Sequence[str],
    compensators: Friction | None = None,
) -> tuple[Hypothesis, ...]:
    """Corrections of samples (4, T, n) that fit significantly better, best first."""
    tau = samples[3]
    fast = [x[np.abs(x) > 0.05 * np.abs(x).max(initial=0.0)] for x in samples[1].T]
    reversals = max(int((np.diff(np.sign(x)) != 0.0).sum()) for x in fast)
    given = _equations(model, samples, cutoff, compensators)
    likelihood, share = given.fit(tau)
    hypotheses: list[Hypothesis] = []
    for group in _corrections(model, samples[0], names):
        corrected, equations = group[0].of(samples), given
        if not np.array_equal(corrected[:3], samples[:3]):
            equations = _equations(model, corrected, cutoff, compensators)
        for correction in group:
            torques, count = tau @ correction.torque.T, min(len(correction.joints), 2)
            # a fit without sign constraints is at least as good, and faster
            part = equations.fit(torques, equations.W.shape[2], share)[1]
            if np.log(share / part).sum() < count * _LIKELY:
                continue
            better, part = equations.fit(torques)
            significance = _significance(better - likelihood)
            gain = float(np.log(share / part).sum())
            left, before = (float(x[list(correction.joints)].mean()) for x in (part, share))
            # better fits of other joints are no evidence for this correction
            if gain >= count * _LIKELY and significance > _SIGNIFICANT and left < before:
                enough = reversals >= _REVERSALS and left < 0.5 * before
                certain = gain >= count * _CERTAIN and enough
                hypotheses.append(Hypothesis(correction, certain, gain, left, before, significance))
    hypotheses.sort(key=lambda hypothesis: -hypothesis.gain)
    return tuple(h for h in hypotheses if h.gain > hypotheses[0].gain - _LIKELY)


def _significance(difference: Array) -> float:
    """Mean of differences over its standard error; 20 blocks of time are treated as independent."""
    means = np.array([block.mean() for block in np.array_split(difference, 20) if block.size])
    error = means.std(ddof=1) / np.sqrt(len(means)) if len(means) > 1 else np.inf
    return float(means.mean() / max(error, 1e-300))


def _corrections(
    model: RobotModel, q: Array, names: Sequence[str]
) -> Iterator[list[LogCorrection]]:
    """Signs, swaps and degrees; corrections of a list have the same positions."""
    n, unit, wrong = model.n, np.eye(model.n), FindingKind.WRONG_SIGN
    changes: list[tuple[tuple[int, ...], Array]]
    changes = [((j,), unit - 2.0 * np.diag(unit[j])) for j in range(n)]
    for i, j in combinations(range(n), 2):
        order = np.arange(n)
        order[[i, j]] = j, i
        changes.append(((i, j), unit[order]))

    def correction(joints: tuple[int, ...], position: Array, torque: Array) -> LogCorrection:
        columns = [x for x, M in (("positions", position), ("torques", torque)) if M is not unit]
        some = " and ".join(names[j] for j in joints)
        if len(joints) > 1:
            words = f"joints {some} look swapped in {' and '.join(columns)}"
            return LogCorrection(FindingKind.SWAPPED_JOINTS, words, joints, position, torque)
        words = f"the {columns[0][:-1]} of joint {some} has the wrong sign"
        if len(columns) > 1:
            words = f"joint {some} looks flipped (wrong sign of position and torque)"
        return LogCorrection(wrong, words, joints, position, torque)

    torques = [correction(joints, unit, change) for joints, change in changes]
    if n > 1:
        words = "the torques of all joints have the wrong sign"
        torques.append(LogCorrection(wrong, words, tuple(range(n)), unit, -unit))
    yield torques
    for joints, change in changes:
        yield [correction(joints, change, unit), correction(joints, change, change)]
    turning = model.table.sigma[model.table.joint_rows] != PRISMATIC
    if (np.abs(q[:, turning]) > 2.0 * np.pi).any():
        kind, words = FindingKind.POSITIONS_IN_DEGREES, "positions look like degrees"
        degrees = np.diag(np.where(turning, np.pi / 180.0, 1.0))
        joints = tuple(np.flatnonzero(turning).tolist())
        yield [LogCorrection(kind, words, joints, degrees, unit)]


class _Equations(NamedTuple):
    """Regressors (n, T, p) and their Gram matrices; the first ``free`` parameters have any sign."""

    W: Array
    grams: Array
    free: int

    def fit(
        self, tau: Array, free: int | None = None, share: Array | float = 1.0
    ) -> tuple[Array, Array]:
        """Weighted least squares of torques (T, n), from initial residual variances.

        Returns the log-likelihood of each sample (T,) and the variance left of each torque (n,).
        """
        moments = np.einsum("jtp,tj->jp", self.W, tau)
        sizes = np.maximum(tau.var(axis=0), 1e-290)
        limit = self.free if free is None else free
        e, variances = tau, np.maximum(share, _FLOOR) * sizes
        for _ in range(_ITERATIONS if free is None else 2):
            weights = 1.0 / variances
            gram = np.einsum("j,jpq->pq", weights, self.grams)
            e = tau - (self.W @ _solved(gram, weights @ moments, limit)).T
            variances = np.maximum((e**2).mean(axis=0), _FLOOR * sizes)
        likelihood = -0.5 * (np.log(variances) + e**2 / variances).sum(axis=1)
        return likelihood, variances / sizes


def _solved(A: Array, b: Array, free: int) -> Array:
    """Solution of normal equations; unknowns from number ``free`` on are not negative."""
    from scipy.linalg import cholesky, solve_triangular
    from scipy.optimize import nnls

    scale = np.sqrt(np.diag(A))
    R = cholesky(A / np.outer(scale, scale) + 1e-10 * np.eye(len(A)), check_finite=False)
    c = solve_triangular(R, b / scale, trans=1, check_finite=False)
    limited = nnls(R[free:, free:], c[free:])[0] if free < len(A) else c[free:]
    rest = c[:free] - R[:free, free:] @ limited
    return np.append(solve_triangular(R[:free, :free], rest, check_finite=False), limited) / scale


def _equations(
    model: RobotModel, samples: Array, cutoff: float, compensators: Friction | None
) -> _Equations:
    """Equations of all joints; masses, second moments, rotors and friction are not negative."""
    q, v, a = samples[:3]
    n, links = model.n, 10 * model.table.f
    W = torque_regressor(model, q, v, a, drive=SMOOTH_DRIVE, friction=compensators)
    bodies = W[:, :, :links].reshape(len(q), n, -1, 10)
    # XX = Lyy + Lzz and so on: second moments Lxx, Lyy, Lzz of a body are not negative
    second = bodies[..., [0, 3, 5]]
    bodies[..., [0, 3, 5]] = second.sum(axis=-1, keepdims=True) - second
    # corrections change velocities sample by sample: the step of dry friction at a reversal is not
    # filtered but drawn out over a quarter of a period of the cutoff
    weights = motor_speeds(model)
    speed, rate = v @ weights.T, a @ weights.T
    near = 0.25 / cutoff * np.sqrt((rate**2).mean(axis=0))
    steps = speed / np.where(near > 0.0, np.hypot(speed, near), 1.0)
    elastic = (q - q.mean(axis=0))[:, :, None] * np.eye(n)
    rows = np.concatenate([W, steps[:, None] * weights.T, elastic], axis=2)
    limited = np.zeros(rows.shape[2], dtype=bool)
    limited[:links] = np.isin(np.arange(links) % 10, (0, 3, 5, 9))
    limited[links : links + 2 * n] = True
    limited[W.shape[2] : W.shape[2] + n] = True
    size = np.sqrt(np.einsum("tjp,tjp->p", rows, rows))
    seen = np.flatnonzero(size > 1e-9 * size.max(initial=0.0))
    order = seen[np.argsort(limited[seen], kind="stable")]
    scaled = np.ascontiguousarray((rows[:, :, order] / size[order]).transpose(1, 0, 2))
    grams = scaled.transpose(0, 2, 1) @ scaled
    return _Equations(scaled, grams, int((~limited[order]).sum()))
