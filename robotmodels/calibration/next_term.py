"""Fits with additional error terms, compared by cross-validation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .errors_seen import BlockErrors
from .folds import AsideErrors, Refit, Split, errors_of_splits
from .identifiable import IdentifiableParameters
from .parameters import GeometricParameters
from .prior import ParameterPrior, estimated_with
from .problem import problem_of
from .reporting.units import in_unit, printed_unit
from .solve import Solution, solve
from .structure import LEAST_P, Structure, TermFamily, structure_of

_SURE = 3.0
"""Standard errors by which the mean square of errors on data kept aside must fall."""
_GAIN = 0.02
"""Smallest relative decrease of the mean square."""
_ROUGH = 1e-6


class Trial(NamedTuple):
    """A fit with one more family, judged on data kept aside."""

    family: TermFamily
    after: BlockErrors
    gain: float
    """Relative decrease of their mean square."""
    helps: bool
    """Whether the decrease is significant."""
    explains_all: bool = False
    """Whether the residuals of this fit show no structure."""


def trials_of(
    structure: Structure,
    refit: Refit,
    candidates: GeometricParameters,
    identify: Callable[[GeometricParameters], IdentifiableParameters],
    prior: ParameterPrior | None,
    parts: Sequence[Split],
    before: BlockErrors,
    without: AsideErrors,
    done: Callable[[], None],
) -> list[Trial]:
    """Fits with each indicated family, validated on the same folds; largest gain first.

    ``identify`` gives the identifiable ones of some candidates; ``before`` are errors of the
    nominal robot at all blocks, ``without`` those of the folds without the family.
    """
    solution = refit.solution
    problem, old = solution.problem, solution.problem.parameters
    trials: list[Trial] = []
    fits: dict[TermFamily, tuple[Solution, IdentifiableParameters]] = {}
    for family in structure.indicated:
        new = [e for e in structure.parameters.entries if e.law in family.laws]
        told = identify(replace(candidates, entries=(*candidates.entries, *new)))
        kept = told.kept if prior is None else estimated_with(prior, told, problem.measurements)
        added = [e for e in new if e.name in kept.names]
        wider = problem_of(replace(old, entries=(*old.entries, *added)), problem.measurements)
        start = np.concatenate([solution.deviation, np.zeros(len(added)), solution.fixtures])
        found = solve(
            wider, start, from_scales=solution.scales, loss=solution.fit.loss,
            prior=None if refit.prior is None else refit.prior(wider),
            truncation=refit.truncation, tolerance=_ROUGH,
        )  # fmt: skip
        done()
        again = replace(refit, solution=found)
        after = errors_of_splits(again, parts, before, done).after
        trials.append(Trial(family, after, *_gain(without.after, after)))
        fits[family] = found, told
    trials.sort(key=lambda trial: -trial.gain)
    best = next((trial.family for trial in trials if trial.helps), None)
    return [
        trial._replace(explains_all=structure_of(*fits[trial.family]) is None)
        if trial.family == best
        else trial
        for trial in trials
    ]


def _gain(before: BlockErrors, after: BlockErrors) -> tuple[float, bool]:
    """Relative decrease of the mean square, units by their rms; whether it is significant."""
    scale = [before.summary(unit).rms for unit in ("m", "rad")]
    was, now = (
        np.nansum([(e / s) ** 2 for e, s in zip(errors, scale, strict=True) if s > 0.0], axis=0)
        for errors in (before, after)
    )
    fallen = was - now
    mean = float(fallen.mean())
    gain = mean / float(was.mean())
    is_sure = mean > _SURE * float(fallen.std()) / np.sqrt(len(fallen))
    return gain, bool(is_sure and gain > _GAIN)


def note_of_structure(
    structure: Structure, trials: Sequence[Trial], without: AsideErrors | None
) -> str:
    """Note on residual structure and the recommended term."""
    p = f"p {'<=' if structure.p <= LEAST_P else '='} {structure.p:.2g}"
    text = [
        f"Not geometry: the residuals depend on the posture ({p}), and no parameter of the table "
        "explains it."
        if structure.is_complete
        else f"The residuals depend on the posture ({p}), and no estimated parameter explains it; "
        "parameters of the table that were left out may be the cause."
    ]
    text.append("Standard errors assume independent residuals and are too short.")
    helpful = [trial for trial in trials if trial.helps]
    if without is not None and helpful:
        first, *more = [
            f"{trial.family.word} ({trial.family.option}) from "
            f"{_change(without.after, trial.after)}"
            for trial in helpful
        ]
        text.append(
            f"Try {helpful[0].family.word} next. Rms error on data kept aside: {first}"
            f"{''.join('; ' + other for other in more)}."
        )
    doubtful = [
        f"{trial.family.word} ({_change(without.after, trial.after)})"
        for trial in trials
        if without is not None and not trial.helps
    ]
    if doubtful:
        text.append(
            "Tried, with a change of less than three standard errors on data kept aside: "
            f"{', '.join(doubtful)}."
        )
    if without is None and structure.indicated:
        terms = [f"{family.word} ({family.option})" for family in structure.indicated]
        text.append(f"{_sentence(' or '.join(terms))} may explain it; a fit with folds compares.")
    if structure.others:
        words = " or ".join(family.word for family in structure.others)
        text.append(f"{_sentence(words)} would not explain it.")
    if not structure.parameters.model.inertia.values.any():
        text.append("Give the model masses (with_inertia) to try joint compliance.")
    if helpful and not helpful[0].explains_all:
        text.append(f"With {helpful[0].family.word} they still depend on the posture.")
    is_explained = helpful and helpful[0].explains_all
    may_help = any(trial.gain > _GAIN for trial in trials)
    if may_help and not helpful:
        text.append("More postures would decide between them.")
    if (trials or not structure.indicated) and not is_explained and (helpful or not may_help):
        text.append(
            "Backlash, friction, drift or bending links may be the cause: approach every posture "
            "from the same side, and repeat some measurements at the end."
        )
    return " ".join(text)


def _sentence(words: str) -> str:
    """Words with a capital first letter."""
    return words[:1].upper() + words[1:]


def _change(before: BlockErrors, after: BlockErrors) -> str:
    """Rms errors before and after, of each unit that was measured."""
    return " and ".join(
        f"{in_unit(before.summary(unit).rms, unit)} to {in_unit(after.summary(unit).rms, unit)} "
        f"{printed_unit(unit)}"
        for unit in ("m", "rad")
        if after.summary(unit).blocks
    )
