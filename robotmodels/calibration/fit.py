"""Geometric calibration of a robot from measurements."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial

import numpy as np

from .._choices import chosen
from ..errors import InvalidValueError
from ..estimation import Loss
from ..model import RobotModel, check_model
from .candidates import candidate_parameters
from .contradiction import contradictions
from .enough import check_enough
from .errors_seen import block_errors
from .folds import (
    Refit,
    Split,
    errors_of_others,
    errors_of_splits,
    splits,
    suited_fixtures,
)
from .identifiable import (
    IdentifiableParameters,
    Reason,
    all_deviations,
    identifiable_on,
)
from .insignificant import insignificant_parameters, with_gained, without_insignificant
from .measurements import KnownDistance, Measurement
from .next_term import note_of_structure, trials_of
from .notes import is_implausible, notes_after, notes_before, notes_of_errors
from .outliers import judged
from .parameters import Compliance, GeometricParameters, as_names
from .placing import placed_robot
from .prior import ParameterPrior, estimated_with, note_of_prior, settled_prior, sized, widened
from .problem import as_measurements, guessed_fixtures, measured_frames, problem_of
from .result import CalibrationResult
from .solve import solve
from .structure import structure_of

Progress = Callable[[int, int, str], None]
"""Called with the number of finished fits, their total, and the current task."""

_PRIOR = ParameterPrior()
_SEED = 1
_TRIES = 6
"""Largest number of fits for the choice of parameters and of the prior's width."""
_TOLD_APART = 1e-4
"""Sine of the angle below which a column counts as dependent."""


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
    progress: Progress | None = None,
) -> CalibrationResult:
    """Estimate the geometric parameters of a robot, also called kinematic calibration.

    Parameters that the measurements cannot tell stay as they are or are regrouped into others;
    the result says which. All measurements take part in the estimate; the errors on data kept
    aside come from further fits without them. Where the residuals depend on the posture in a way
    that no parameter takes, a note says so and, with folds, names the term to try next (joint
    compliance, gear eccentricity, gains) and what it gains on data kept aside.

    Parameters
    ----------
    model : RobotModel
        The nominal robot; its base and tool are where the fit begins (if they are far off, the
        measured positions say where it stands).
    measurements : Measurement or iterable of Measurement
        One or more, of any kinds.
    parameters : GeometricParameters or iterable of str, optional
        Candidates, or their names; default all of `candidate_parameters`.
    known, known_lengths : iterable of str
        Parameters that are known and stay as they are. Measurements without a length (contacts)
        need one of ``known_lengths``.
    base, tool, gains, couplings, compliance, eccentricity
        As `candidate_parameters`.
    loss : Loss or str, optional
        ``"squares"`` (the default), or against outliers ``"huber"``, ``"cauchy"``, ``"tukey"``.
    prior : ParameterPrior, optional
        How large the corrections are expected to be, so that the estimate is the maximum a
        posteriori; default `ParameterPrior()`. Corrections that contradict it widen it, and a note
        says so. None for none: parameters that noise hides still stay where they are.
    truncation : float, optional
        Directions whose singular value relative to the largest is smaller are left out.
    folds : int
        Largest number of folds of the cross-validation; 0 for none. A fold leaves out whole
        places (three or more that are touched), else a run of successive postures with all that
        is measured there.
    held_out : float, or Measurement or sequence of them
        Share of the places or postures that one more fit is tested on (0 for none), or
        measurements for that, which never take part.
    rng : numpy.random.Generator or int, optional
        For the folds; default the same each time.
    progress : callable, optional
        ``progress(done, of, doing)`` after each fit.

    Returns
    -------
    CalibrationResult
        Values with deviations, errors before and after, the calibrated robot.

    Raises
    ------
    InvalidValueError, ShapeError
        Measurements of another robot, no known length where one is needed, too few measurements,
        units that cannot be right; with what to measure or to change.

    References
    ----------
    Seed book section 1.4.

    Examples
    --------
    >>> import robotmodels as rm
    >>> import robotmodels.calibration
    >>> arm = rm.load("rx90")
    >>> real = arm.with_tool(rm.se3.translation(0.001, 0.0, 0.1))
    >>> q = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 6))
    >>> found = fit(arm, rm.calibration.Pose(q, rm.dgm(real, q)), folds=0)
    >>> found.model.tool[:3, 3].round(6)
    array([0.001, 0.   , 0.1  ])
    """
    check_model(model)
    measured = as_measurements(measurements)
    aside = _measurements_aside(held_out)
    if folds and folds < 2:
        raise InvalidValueError(f"folds: expected 2 or more, or 0 for none, got {folds}.")
    loss = Loss.SQUARES if loss is None else chosen(Loss, loss, "loss")
    chance = np.random.default_rng(_SEED if rng is None else rng)
    frames = measured_frames((*measured, *aside))
    given = names = None
    if isinstance(parameters, GeometricParameters):
        given = parameters
    elif parameters is not None:
        names = as_names(parameters)

    def candidates_of(robot: RobotModel) -> GeometricParameters:
        found = candidate_parameters(
            robot, frames, base=base, tool=tool, gains=gains, couplings=couplings,
            compliance=compliance, eccentricity=eccentricity,
        )  # fmt: skip
        return found if names is None else found.subset(names)

    known, known_lengths = as_names(known), as_names(known_lengths)
    candidates = candidates_of(model) if given is None else given
    if prior is not None:
        candidates.index(prior.named, "prior")
    as_given = problem_of(candidates, measured)
    notes = notes_before(as_given)
    nothing = np.zeros(as_given.P)
    errors_given = block_errors(as_given, nothing, suited_fixtures(as_given, nothing, {}))
    placed = None
    if given is None:
        fixed = {*known, *known_lengths, *(() if prior is None else prior.named)}
        placed = placed_robot(candidates, measured, fixed)
        if placed is not None:
            candidates = candidates_of(placed.model)
    before = errors_given if placed is None else placed.errors
    share = held_out if isinstance(held_out, float | int) else 0.0
    identifiable = identifiable_on(
        candidates, measured, known_lengths, known, dependent=_TOLD_APART
    )
    check_enough(identifiable, measured, known_lengths, known, _TOLD_APART)
    if prior is not None:
        prior = sized(prior, candidates.skeleton.size)
    prior_of, used = None, prior

    def identifiable_there(some: GeometricParameters) -> IdentifiableParameters:
        return identifiable_on(
            some, measured, known_lengths, (*known, *identifiable.of_reason(Reason.NOISE)),
            deviation=all_deviations(some, estimated, solution.deviation),
            fixtures=solution.fixtures, dependent=_TOLD_APART,
        )  # fmt: skip

    for _ in range(_TRIES):
        if used is not None:
            prior_of = partial(settled_prior, used, loss=loss, rng=chance)
        estimated = (
            identifiable.kept if used is None else estimated_with(used, identifiable, measured)
        )
        problem = problem_of(estimated, measured)
        gaussian = None if prior_of is None else prior_of(problem)
        zero = np.zeros(problem.P)
        start = np.concatenate([zero, guessed_fixtures(problem, zero)])
        solution = solve(problem, start, loss=loss, prior=gaussian, truncation=truncation)
        wider = None if used is None else widened(used, solution)
        insignificant = [] if truncation else insignificant_parameters(solution, start)
        preferred = candidates.preferring(estimated.names)
        again = identifiable_there(preferred)
        # columns that depend on others at the nominal robot may not at the solution
        gained = set(again.names) - set(estimated.names) if used is not None else set()
        if not insignificant and not gained and wider is used:
            break
        used, identifiable = (
            wider,
            with_gained(without_insignificant(identifiable, insignificant), gained),
        )
    size_is_known = bool(known_lengths) or prior is not None
    contradicted = contradictions(solution, prior, size_is_known, truncation)
    solution = judged(solution, contradicted, prior, truncation)
    structure = None if is_implausible(solution) else structure_of(solution, identifiable)
    blocks = sum(m.blocks for m in measured if m.views)
    parts: list[Split] = []
    share_aside: list[Split] = []
    if folds and blocks < 2 * folds:
        notes = (*notes, f"{blocks} measurements are too few for {folds} folds: none were made.")
    elif folds:
        parts = splits(model, measured, folds, chance)
    if share:
        share_aside = splits(model, measured, max(round(1.0 / share), 2), chance)[:1]
    if (folds or share) and blocks >= 2 * folds and not (parts or share_aside):
        notes = (*notes, "Nothing can be kept aside: each thing is measured in one posture alone.")
    fits_to_try = len(structure.indicated) * (1 + len(parts)) if structure and parts else 0
    step = _Steps(progress, 1 + len(parts) + len(share_aside) + fits_to_try)
    step("all measurements")
    refit = Refit(solution, prior_of, truncation)
    validation = kept_aside = None
    if parts:
        validation = errors_of_splits(refit, parts, before, lambda: step("cross-validation"))
    if aside:
        kept_aside = errors_of_others(refit, aside)
    elif share_aside:
        doing = "measurements kept aside"
        kept_aside = errors_of_splits(refit, share_aside, before, lambda: step(doing))
    if structure is not None:
        tried = [] if validation is None else trials_of(
            structure, refit, preferred, identifiable_there, used, parts, before, validation,
            lambda: step("terms to try next"),
        )  # fmt: skip
        notes = (*notes, note_of_structure(structure, tried, validation))
    return CalibrationResult(
        nominal=model, known=(*known_lengths, *known), identifiable=identifiable, again=again,
        solution=solution, given=errors_given, before=before,
        after=block_errors(problem, solution.deviation, solution.fixtures),
        cross_validation=validation, held_out=kept_aside,
        notes=(
            *notes_of_errors(solution, validation, kept_aside),
            *notes,
            *dict.fromkeys(p.partition.note for p in (*parts, *share_aside) if p.partition.note),
            *note_of_prior(prior, used, any(isinstance(m, KnownDistance) for m in measured)),
            *(c.sentence() for c in contradicted),
            *notes_after(solution, identifiable, again),
        ),
    )  # fmt: skip


class _Steps:
    """Counts fits for a progress callback."""

    def __init__(self, progress: Progress | None, total: int) -> None:
        self._progress, self._total, self._done = progress, total, 0

    def __call__(self, doing: str) -> None:
        self._done += 1
        if self._progress is not None:
            self._progress(self._done, self._total, doing)


def _measurements_aside(
    held_out: float | Measurement | Sequence[Measurement],
) -> tuple[Measurement, ...]:
    if isinstance(held_out, float | int):
        if not 0.0 <= held_out < 1.0:
            raise InvalidValueError(
                f"held_out: expected a share from 0 to under 1, or measurements, got {held_out}."
            )
        return ()
    return as_measurements(held_out, "held_out")
