"""Structure in the residuals: a test whether they depend on the posture, and the term to try next.

Residuals are taken orthogonal to all columns of the geometry, so that a prior has no effect. Each
test compares the square of their projection on some columns with those after the signs of whole
postures were drawn at random, which independent noise of any size allows.

Source: C. F. J. Wu, "Jackknife, bootstrap and other resampling methods in regression analysis", The
Annals of Statistics 14, 1986.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from .._arrays import Array
from ..geometry import PRISMATIC
from ..table_text import in_unit, printed_unit
from .candidates import candidate_parameters
from .extended_table import JOINT_VARIABLE
from .identifiable import IdentifiableParameters, Reason, needs_a_length
from .measurements import Evaluation, whitened
from .parameters import Compliance, ErrorLaw, GeometricParameters
from .prior import estimated_with
from .problem import Problem, evaluations, problem_of, stacked
from .solve import ROUGH, Solution, refitted
from .validation import (
    Errors,
    HeldOutErrors,
    Partition,
    cross_validated,
    errors_of,
    posture_numbers,
)

_SIGNIFICANCE = 0.01  # level of all tests together
_INDICATED = 0.05  # significance level at which a family is tried
_FLIPS = 999
_LEAST_P = 4.0 / (1 + _FLIPS)  # smallest p-value that four tests with so many signs can give
_FEWEST = 20  # postures, and residual degrees of freedom, for the test
_ROUNDING = 1e-8  # largest residuals of exact data, relative to the robot's size, or rad
_DEPENDENT = 1e-4  # sine of the angle to the columns of the fit below which a column is one of them
_SURE = 3.0  # standard errors by which the mean square of errors on held-out data must fall
_GAIN = 0.02  # smallest relative decrease of the mean square


class TermFamily(NamedTuple):
    """Error terms: name, option of `fit`, error laws."""

    word: str
    option: str
    laws: tuple[ErrorLaw, ...]


_WAVES = (ErrorLaw.SINE, ErrorLaw.COSINE, ErrorLaw.SINE_2, ErrorLaw.COSINE_2)
_FAMILIES = (
    TermFamily("joint compliance", "compliance='joints'", (ErrorLaw.COMPLIANCE,)),
    TermFamily("gear eccentricity", "eccentricity=True", _WAVES),
    TermFamily("gains of the readings", "gains=True", (ErrorLaw.GAIN,)),
)


class Structure(NamedTuple):
    """Residuals that depend on the posture, and the families of terms that they resemble.

    ``p``: p-value of all tests together; ``parameters``: those of the fit, the others of the table
    and all families.
    """

    p: float
    parameters: GeometricParameters
    indicated: tuple[TermFamily, ...]


def structure_of(solution: Solution, found: IdentifiableParameters) -> Structure | None:
    """Test the residuals of a fit; None without structure, for exact data and few postures."""
    whole = _all_parameters(solution, found)
    problem = problem_of(whole, solution.problem.measurements)
    corrections = np.zeros(problem.P)
    corrections[whole.index(solution.problem.parameters.names)] = solution.corrections
    largest = errors_of(problem, corrections, solution.fixture_values).max
    sizes = {"m": whole.table.size, "rad": 1.0}
    rows = [len(m.axes) for m in problem.measurements for _ in range(m.blocks)]
    posture = np.repeat(posture_numbers(problem.measurements), rows)
    count = int(posture.max()) + 1
    if count < _FEWEST or all(e < _ROUNDING * sizes[unit] for unit, e in largest.items()):
        return None
    r, J = stacked(problem, np.concatenate([corrections, solution.fixtures]), solution.scales)
    weight = np.sqrt(solution.fit.weights)
    r, J = weight * r, weight[:, None] * J
    included = {e.law for e in found.candidates.entries} | {ErrorLaw.CONSTANT}
    taken = [k for k, e in enumerate(whole.entries) if e.law in included]
    Q = _basis(_unit_columns(J[:, [*taken, *range(problem.P, J.shape[1])]]), 1e-9)
    r = r - Q @ (Q.T @ r)
    if len(r) - Q.shape[1] < _FEWEST:
        return None
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(_FLIPS, count))
    order = np.argsort(posture, kind="stable")
    first = np.flatnonzero(np.diff(posture[order], prepend=-1))

    def by_posture(columns: Array) -> Array:
        return np.add.reduceat((columns * r[:, None])[order], first, axis=0)

    def projected(columns: Array) -> Array:
        columns = _unit_columns(columns)
        return columns - Q @ (Q.T @ columns)

    total = float(r @ r)
    left = total - ((signs @ by_posture(Q)) ** 2).sum(axis=1)

    def p_value(sums: Array) -> float:
        drawn = ((signs @ sums) ** 2).sum(axis=1) / left
        return (1 + int((drawn >= (sums.sum(axis=0) ** 2).sum() / total).sum())) / (1 + _FLIPS)

    p_values = {}
    for family in _FAMILIES:
        terms = [k for k, e in enumerate(whole.entries) if e.law in family.laws]
        columns = _basis(projected(J[:, terms]), _DEPENDENT)
        if included.isdisjoint(family.laws) and columns.shape[1]:
            p_values[family] = p_value(by_posture(columns))
    smooth = _smooth_columns(problem, corrections, solution)
    smooth = [by_posture(projected(weight[:, None] * columns)) for columns in smooth]
    tests = [*p_values.values(), *([p_value(np.hstack(smooth))] if smooth else [])]
    p = min(1.0, len(tests) * min(tests, default=1.0))
    if p >= _SIGNIFICANCE:
        return None
    best = sorted(p_values, key=lambda family: p_values[family])
    indicated = tuple(family for family in best if p_values[family] < _INDICATED)
    return Structure(p, whole, indicated)


def _all_parameters(solution: Solution, found: IdentifiableParameters) -> GeometricParameters:
    """Parameters of the fit, all families, and the others of the table unless they lack a scale."""
    table = found.candidates.table
    has_masses = bool(table.model.inertia.values.any())
    everything = candidate_parameters(
        table.model,
        table.frames,
        gains=True,
        eccentricity=True,
        compliance=Compliance.JOINTS if has_masses else Compliance.NONE,
    )
    entries = {e.name: e for e in (*solution.problem.parameters.entries, *found.candidates.entries)}
    others = {e.name: e for e in everything.entries if e.name not in entries}
    missing = {name for name, e in others.items() if e.law is ErrorLaw.CONSTANT}
    if not needs_a_length(problem_of(everything, solution.problem.measurements)):
        return GeometricParameters(table, tuple((entries | others).values()))
    # with all lengths free the robot shrinks until nothing is left of a residual
    left_out = missing.union(*(found.of_reason(why) for why in (Reason.KNOWN, Reason.GAUGE)))
    kept = (e for name, e in (entries | others).items() if name not in left_out)
    return GeometricParameters(table, tuple(kept))


def _unit_columns(columns: Array) -> Array:
    """Columns of length 1, those of length 0 left out."""
    length = np.linalg.norm(columns, axis=0)
    return np.asarray(columns[:, length > 0.0] / length[length > 0.0])


def _basis(columns: Array, least: float) -> Array:
    """Orthonormal columns of the directions whose singular value is above the least."""
    U, s, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(U[:, s > least])


def _smooth_columns(problem: Problem, corrections: Array, solution: Solution) -> list[Array]:
    """Jacobian columns of smooth position errors of each joint: sines, cosines and products."""
    table = problem.parameters.table
    variables = [
        (k, e.row)
        for k, e in enumerate(problem.parameters.entries)
        if problem.parameters.is_of_table(e) and e.element is JOINT_VARIABLE[table.sigma[e.row]]
    ]
    rows = [row for _, row in variables]
    joints, slides = table.joint[rows], table.sigma[rows] == PRISMATIC
    readings = np.concatenate([view.q for m in problem.measurements for view in m.views])[:, joints]
    half = np.where(slides, np.ptp(readings, axis=0) / np.pi, 1.0)
    half[half == 0.0] = 1.0
    seen = evaluations(problem, corrections)
    columns = []
    for k, _ in variables:
        parts = []
        for m, views, scale in zip(problem.measurements, seen, solution.scales, strict=True):
            wide = []
            for at, view in zip(views, m.views, strict=True):
                factor = _harmonics(view.q[:, joints] / half)
                wide.append(Evaluation(at.T, at.psi[:, :, k, None] * factor[:, None, :]))
            by_terms = m.linearise(wide, solution.fixtures[problem.columns(m)]).by_parameters
            parts.append(whitened(m, by_terms, scale).reshape(m.blocks * len(m.axes), -1))
        width = max(part.shape[1] for part in parts)  # 0 of known distances
        columns.append(np.vstack([np.pad(p, ((0, 0), (0, width - p.shape[1]))) for p in parts]))
    return columns


def _harmonics(q: Array) -> Array:
    """Sine and cosine of each joint, and products of those of two, shape (N, D)."""
    waves = np.stack([np.sin(q), np.cos(q)], axis=-1)
    products = [
        (waves[:, i, :, None] * waves[:, j, None, :]).reshape(len(q), 4)
        for i, j in combinations(range(q.shape[1]), 2)
    ]
    return np.concatenate([waves.reshape(len(q), -1), *products], axis=1)


# --- terms to try next ----------------------------------------------------------------------------


def helpful_terms(
    structure: Structure,
    solution: Solution,
    candidates: GeometricParameters,
    identify: Callable[[GeometricParameters], IdentifiableParameters],
    parts: Partition,
    validation: HeldOutErrors,
    nominal: Errors,
    done: Callable[[], None],
) -> list[tuple[TermFamily, Errors]]:
    """Indicated families that surely lower the errors on held-out data; largest gain first.

    ``identify`` gives the identifiable ones of some candidates; ``validation`` are the errors of
    the parts without the family.
    """

    def squares(errors: Errors) -> Array:
        m, rad = (validation.rms.get(unit, np.inf) for unit in ("m", "rad"))
        return np.nansum([(errors.position / m) ** 2, (errors.angle / rad) ** 2], axis=0)

    old, before, found = solution.problem.parameters, squares(validation), []
    for family in structure.indicated:
        new = [e for e in structure.parameters.entries if e.law in family.laws]
        identifiable = identify(replace(candidates, entries=(*candidates.entries, *new)))
        kept = identifiable.kept
        if solution.prior is not None:
            kept = estimated_with(solution.prior, identifiable, solution.problem.measurements)
        added = [e for e in new if e.name in kept.names]
        parameters = replace(old, entries=(*old.entries, *added))
        wider = problem_of(parameters, solution.problem.measurements)
        start = np.concatenate([solution.corrections, np.zeros(len(added)), solution.fixtures])
        fitted = refitted(solution, wider, start, solution.scales, tolerance=ROUGH)
        done()
        errors = cross_validated(fitted, parts, nominal, done)
        fall = before - squares(errors)
        gain, sure = float(fall.mean()), _SURE * float(fall.std()) / np.sqrt(len(fall))
        if gain > max(sure, _GAIN * float(before.mean())):
            found.append((gain, family, errors))
    return [(family, errors) for _, family, errors in sorted(found, key=lambda trial: -trial[0])]


def note_of_structure(
    structure: Structure, helpful: Sequence[tuple[TermFamily, Errors]], without: Errors | None
) -> str:
    """Note on residual structure and the recommended term."""
    text = (
        f"The residuals depend on the posture (p {'<=' if structure.p <= _LEAST_P else '='} "
        f"{structure.p:.2g}), and no geometric parameter of the fit explains it. Standard errors "
        "assume independent residuals and are too small."
    )
    if without is None and structure.indicated:
        terms = " or ".join(f"{family.word} ({family.option})" for family in structure.indicated)
        text += f" A fit with folds shows whether {terms} explains it."
    if without is not None and helpful:
        changes = [
            f"{family.word} ({family.option}) from {in_unit(without.rms[unit], unit)} to "
            f"{in_unit(rms, unit)} {printed_unit(unit)}"
            for family, errors in helpful
            for unit, rms in errors.rms.items()
        ]
        text += f" Try {helpful[0][0].word} next. Rms error on held-out data: {'; '.join(changes)}."
    if not structure.parameters.model.inertia.values.any():
        text += " Give the model masses (with_inertia) to try joint compliance."
    if not helpful and (without is not None or not structure.indicated):
        text += (
            " Backlash, friction, drift or bending links may be the cause: approach every posture "
            "from the same side, and repeat some measurements at the end."
        )
    return text
