"""Geometric calibration of a robot from measurements."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import count
from typing import Any

import numpy as np

from .._arrays import Array
from .._arrays.tasks import Progress, Workers
from .._choices import chosen
from ..errors import InvalidValueError
from ..estimation import Loss
from ..estimation.linearised import inverse_factor
from ..model import RobotModel, check_model
from .alignment import align_base_and_tool
from .candidates import chosen_candidates
from .checks import notes_before
from .contradiction import with_contradictions
from .identifiable import IdentifiableParameters, Reason, identifiable_on
from .measurements import KnownDistance, Measurement
from .notes import implausible, notes_after, notes_of_errors
from .parameters import Compliance, GeometricParameters, as_names
from .prior import (
    ParameterPrior,
    estimated_with,
    largest_factors,
    note_of_prior,
    sized,
    widened,
)
from .problem import as_measurements, guessed_fixtures, measured_frames, problem_of, stacked
from .result import CalibrationResult
from .solve import Solution, solve
from .structure import helpful_terms, note_of_structure, structure_of
from .validation import (
    Validation,
    cross_validated,
    errors_of,
    errors_on,
    partition,
    settled_prior,
)

_PRIOR = ParameterPrior()
_SEED = 1
_TRIES = 6  # largest number of fits for the choice of parameters and of the prior's width
_LARGEST_LENGTH, _LARGEST_ANGLE = 0.01, 0.02
"""Standard errors above which a parameter is not estimated: relative to the robot's size, and rad
(of the largest effect)."""
_DEPENDENT = 1e-4  # sine of the angle below which a column counts as dependent


def fit(
    model: RobotModel,
    measurements: Measurement | Iterable[Measurement],
    *,
    parameters: GeometricParameters | Iterable[str] | None = None,
    known: Iterable[str] = (),
    known_lengths: Iterable[str] = (),
    base: bool = True,
    tool: bool = True,
    gains: bool = False,
    couplings: Iterable[tuple[int, int]] = (),
    compliance: Compliance | str = Compliance.NONE,
    eccentricity: bool = False,
    loss: Loss | str | None = None,
    prior: ParameterPrior | None = _PRIOR,
    truncation: float | None = None,
    folds: int = 5,
    held_out: float | Measurement | Sequence[Measurement] = 0.2,
    rng: np.random.Generator | int | None = None,
    progress: Progress = None,
) -> CalibrationResult:
    """Estimate the geometric parameters of a robot, also called kinematic calibration.

    Parameters that the measurements do not determine stay nominal or are regrouped into others.
    All measurements take part; the errors on held-out data come from further fits. Where the
    residuals depend on the posture in a way that no parameter explains, a note reports it and,
    with folds, names the term to try next and the gain on held-out data.

    Parameters
    ----------
    model, known, known_lengths, base, tool, gains, couplings, compliance, eccentricity, progress
        See `robotmodels.calibration`. The fit begins with base and tool of the model, or, if they
        are far off, where the measured positions are.
    measurements : Measurement or iterable of Measurement
        One or more, of any kinds.
    parameters : GeometricParameters or iterable of str, optional
        Candidates, or their names; default all.
    loss : Loss or str, optional
        ``"squares"`` (the default), or against outliers ``"huber"``, ``"cauchy"``, ``"tukey"``.
    prior : ParameterPrior, optional
        Expected sizes of the corrections; corrections that contradict it widen it, with a note.
        None for none: parameters that noise hides still stay nominal.
    truncation : float, optional
        Directions whose singular value relative to the largest is smaller are left out.
    folds : int
        Largest number of folds of the cross-validation; 0 for none. A fold leaves out whole
        places (three or more that are touched), else a run of successive postures.
    held_out : float, or Measurement or sequence of them
        Share that one more fit is tested on (0 for none), or measurements that never take part.
    rng : numpy.random.Generator or int, optional
        For the folds; default a fixed seed.

    Returns
    -------
    CalibrationResult
        Corrections with standard errors, errors before and after, the calibrated robot.

    Raises
    ------
    InvalidValueError, ShapeError
        Too few or other measurements, no known length, units that cannot be right; with advice.

    References
    ----------
    Book section 1.4.4.

    Examples
    --------
    >>> import robotmodels as rm
    >>> from robotmodels.calibration import Pose
    >>> arm = rm.load("rx90")
    >>> real = arm.with_tool(rm.se3.translation(0.001, 0.0, 0.1))
    >>> q = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 6))
    >>> fit(arm, Pose(q, rm.dgm(real, q)), folds=0).model.tool[:3, 3].round(6)
    array([0.001, 0.   , 0.1  ])
    """
    check_model(model)
    measured, (share, test) = as_measurements(measurements), _held_out(held_out)
    if folds and folds < 2:
        raise InvalidValueError(f"folds: expected 2 or more, or 0 for none, got {folds}.")
    if not isinstance(prior, ParameterPrior | None):
        raise InvalidValueError(f"prior: expected a ParameterPrior or None, got {prior!r:.60}.")
    loss = Loss.SQUARES if loss is None else chosen(Loss, loss, "loss")
    rng = np.random.default_rng(_SEED if rng is None else rng)
    known, known_lengths = as_names(known), as_names(known_lengths)
    options: dict[str, Any] = {
        "frames": measured_frames((*measured, *test)),
        "base": base,
        "tool": tool,
        "gains": gains,
        "couplings": tuple(couplings),
        "compliance": compliance,
        "eccentricity": eccentricity,
    }
    candidates = chosen_candidates(parameters, model, **options)
    if prior is not None:
        candidates.index(prior.named, "prior")
    as_given = problem_of(candidates, measured)
    notes = [*notes_before(as_given)]
    given = nominal = errors_of(as_given, np.zeros(as_given.P))
    if not isinstance(parameters, GeometricParameters):
        fixed = {*known, *known_lengths, *(() if prior is None else prior.named)}
        aligned = align_base_and_tool(candidates, measured, fixed)
        if aligned is not None:
            aligned_model, nominal = aligned
            candidates = chosen_candidates(candidates.names, aligned_model, **options)
    given_prior = prior = prior and sized(prior, candidates.table.expected_error)
    solution, identifiable, after, prior, identify = _estimated(
        candidates, measured, known, known_lengths, prior, loss, truncation, rng
    )
    expected = given_prior and replace(given_prior, strength=solution.fit.prior.strength)
    size_is_known = bool(known_lengths) or prior is not None
    solution, contradicted = with_contradictions(solution, expected, size_is_known)
    structure = None if implausible(solution) else structure_of(solution, identifiable)
    blocks = sum(m.blocks for m in measured if m.views)
    parts = partition(model, measured, folds if blocks >= 2 * folds else 0, rng)
    last = partition(model, measured, max(round(1.0 / share), 2) if share else 0, rng)
    last = last._replace(splits=last.splits[:1])
    fits = len(parts.splits)
    if folds and blocks < 2 * folds:
        notes.append(
            f"{blocks} measurements are too few for {folds} folds: no cross-validation was made."
        )
    elif (folds or share) and not (parts.splits or last.splits):
        notes.append(
            "No measurements can be held out: each object is measured in only one posture."
        )
    trials_to_fit = len(structure.indicated) if structure and fits else 0
    total, done = 1 + fits + len(last.splits) + trials_to_fit * (1 + fits), count(1)
    work = Workers(progress=progress)

    def step() -> None:
        work.done(next(done) / total)

    step()
    in_folds = cross_validated(solution, parts, nominal, step) if fits else None
    in_test = None
    if test:
        in_test = errors_on(solution, test)
    elif last.splits:
        in_test = cross_validated(solution, last, nominal, step)
    if structure is not None:
        helpful = []
        if in_folds is not None:
            helpful = helpful_terms(
                structure, solution, after.candidates, identify, parts, in_folds, nominal, step
            )
        notes.append(note_of_structure(structure, helpful, in_folds))
    in_sample = errors_of(solution.problem, solution.corrections, solution.fixture_values)
    validation = Validation(given, nominal, in_sample, in_folds, in_test)
    distances = any(isinstance(m, KnownDistance) for m in measured)
    return CalibrationResult(
        nominal=model,
        known=(*known_lengths, *known),
        identifiable=identifiable,
        identifiable_after=after,
        solution=solution,
        validation=validation,
        notes=(
            *notes_of_errors(solution, validation),
            *notes,
            *dict.fromkeys(part.note for part in (parts, last) if part.note),
            *note_of_prior(given_prior, prior, distances),
            *contradicted,
            *notes_after(solution, identifiable, after),
        ),
    )


def _estimated(
    candidates: GeometricParameters,
    measured: tuple[Measurement, ...],
    known: tuple[str, ...],
    known_lengths: tuple[str, ...],
    prior: ParameterPrior | None,
    loss: Loss,
    truncation: float | None,
    rng: np.random.Generator,
) -> tuple[
    Solution,
    IdentifiableParameters,
    IdentifiableParameters,
    ParameterPrior | None,
    Callable[[GeometricParameters], IdentifiableParameters],
]:
    """Fit of the identifiable and significant parameters, with a prior that suits them.

    Also the identifiable ones at the solution, and the function that gives those of candidates.
    """
    identify = partial(identifiable_on, dependent=_DEPENDENT, known_lengths=known_lengths)
    identifiable = identify(candidates, measured, known=known)
    _check_enough(identifiable, measured)
    for attempt in range(1, _TRIES + 1):
        estimated = identifiable.kept
        if prior is not None:
            estimated = estimated_with(prior, identifiable, measured)
        problem = problem_of(estimated, measured)
        zero = np.zeros(problem.P)
        start = np.concatenate([zero, guessed_fixtures(problem, zero)])
        used = settled_prior(prior, problem, loss, rng)
        solution = solve(problem, start, loss=loss, prior=used, truncation=truncation)
        insignificant = [] if truncation else _insignificant_parameters(solution, start)
        identify_there = partial(
            identify,
            measurements=measured,
            known=(*known, *identifiable.of_reason(Reason.NOISE)),
            corrections=dict(zip(estimated.names, solution.corrections, strict=True)),
            fixtures=solution.fixtures,
        )
        after = identify_there(candidates.preferring(estimated.names))
        wider = None if prior is None else widened(prior, problem, solution.fit)
        # columns that depend on others at the nominal robot may not at the solution
        gained = set(after.names) - set(estimated.names) if prior is not None else set()
        if attempt == _TRIES or not (insignificant or gained or wider is not prior):
            break
        prior, identifiable = wider, _adjusted(identifiable, insignificant, gained)
    return solution, identifiable, after, prior, identify_there


def _held_out(
    held_out: float | Measurement | Sequence[Measurement],
) -> tuple[float, tuple[Measurement, ...]]:
    """Share that is held out, and measurements that are."""
    if not isinstance(held_out, float | int):
        return 0.0, as_measurements(held_out, "held_out")
    if not 0.0 <= held_out < 1.0:
        raise InvalidValueError(
            f"held_out: expected a share from 0 to under 1, or measurements, got {held_out}."
        )
    return float(held_out), ()


# --- parameters that the measurements do not determine --------------------------------------------


def _check_enough(identifiable: IdentifiableParameters, measured: Sequence[Measurement]) -> None:
    """Refuse fewer rows than unknowns."""
    problem = problem_of(identifiable.kept, measured)
    P, F = problem.P, problem.F
    if P and problem.rows > P + F:
        return
    if not P:
        raise InvalidValueError(
            "No parameter is identifiable from these measurements. See identifiable_parameters, "
            "and measure with all joints spread over their ranges."
        )
    rows = max(len(m.axes) for m in measured if m.views)
    missing = -(-(P + F + 1 - problem.rows) // rows)
    raise InvalidValueError(
        f"{problem.rows} rows cannot determine {P} parameters and {F} unknown coordinates of "
        f"fixtures: measure at least {missing} more configurations (better three times as many "
        "rows as unknowns), or name fewer parameters."
    )


def _insignificant_parameters(solution: Solution, start: Array) -> list[str]:
    """Names of insignificant parameters, given noise and prior."""
    # The larger standard error of start and solution counts: a fit may have diverged along a
    # parameter, and constraints violated at the start seem to hold information. The worst is
    # removed first, as it may hide others.
    problem, prior = solution.problem, solution.fit.prior
    length = _LARGEST_LENGTH * problem.parameters.table.size
    sizes = [length if e.element.is_length else _LARGEST_ANGLE for e in problem.parameters.entries]
    limit = np.full(problem.P + problem.F, np.inf)
    limit[: problem.P] = sizes / np.maximum(largest_factors(problem), 1e-300)
    information = np.diag(np.sqrt(prior.strength) / prior.sigma)
    factors = [
        np.asarray(
            np.linalg.qr(np.vstack([stacked(problem, x, solution.scales)[1], information]))[1]
        )
        for x in (start, solution.fit.x)
    ]
    kept = list(range(len(limit)))
    names: list[str] = []
    while kept:
        ratio = np.max(
            [np.linalg.norm(inverse_factor(R[:, kept]), axis=1) / limit[kept] for R in factors],
            axis=0,
        )
        worst = int(np.argmax(ratio))
        if ratio[worst] <= 1.0:
            break
        names.append(problem.parameters.names[kept.pop(worst)])
    return names


def _adjusted(
    found: IdentifiableParameters, insignificant: Collection[str], gained: Collection[str]
) -> IdentifiableParameters:
    """Without insignificant parameters, and with those that the solution makes identifiable."""
    names = ({*found.names} - {*insignificant}) | {*gained}
    reasons = {**found.reasons, **dict.fromkeys(insignificant, Reason.NOISE)}
    regrouping = {name: found.regrouping.get(name, {name: 1.0}) for name in names}
    return replace(
        found,
        kept=found.candidates.subset(n for n in found.candidates.names if n in names),
        reasons={name: why for name, why in reasons.items() if name not in gained},
        regrouping={n: regrouping[n] for n in found.candidates.names if n in names},
    )
