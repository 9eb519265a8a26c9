"""A test whether residuals still depend on the posture: structure that no parameter takes.

Residuals are taken orthogonal to all columns of the geometry, so that a prior has no say. Each test
compares the square of their projection on some columns with those after the signs of whole postures
were drawn at random, which independent noise of any size allows.

Source: C. F. J. Wu, "Jackknife, bootstrap and other resampling methods in regression analysis", The
Annals of Statistics 14, 1986.
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..geometry import FIXED, PRISMATIC
from .candidates import candidate_parameters
from .errors_seen import block_errors
from .extended_table import Element, Skeleton
from .identifiable import IdentifiableParameters, Reason, needs_a_length
from .measurements import Evaluation
from .measurements.noise import whitened
from .parameters import Compliance, ErrorLaw, GeometricParameters
from .problem import Problem, evaluations, problem_of, stacked
from .solve import Solution

_DOUBT = 0.01
"""Significance level of all tests together."""
_HINT = 0.05
"""Significance level at which a family is tried."""
_FLIPS = 999
LEAST_P = 4.0 / (1 + _FLIPS)
"""Smallest p-value that four tests with so many draws of signs can give."""
_FEWEST = 20
"""Smallest numbers of postures and of residual degrees of freedom for the test."""
_ROUNDING = 1e-8
"""Largest residuals of exact data, relative to the robot's size, or rad."""
_DEPENDENT = 1e-4
"""Sine of the angle to the columns of the fit below which a column is one of them."""


class TermFamily(NamedTuple):
    """Error terms: name, option of `fit`, error laws."""

    word: str
    option: str
    laws: tuple[ErrorLaw, ...]


FAMILIES = (
    TermFamily("joint compliance", "compliance='joints'", (ErrorLaw.COMPLIANCE,)),
    TermFamily(
        "gear eccentricity", "eccentricity=True",
        (ErrorLaw.SINE, ErrorLaw.COSINE, ErrorLaw.SINE_2, ErrorLaw.COSINE_2),
    ),
    TermFamily("gains of the readings", "gains=True", (ErrorLaw.GAIN,)),
)  # fmt: skip


class Structure(NamedTuple):
    """Residuals that depend on the posture, and the families of terms that they resemble."""

    p: float
    """p-value of the combined test (Bonferroni)."""
    parameters: GeometricParameters
    """Those of the fit, the others of the table, and those of all families."""
    indicated: tuple[TermFamily, ...]
    """Families that the fit did not include and that the residuals resemble."""
    others: tuple[TermFamily, ...]
    """Families not included and not indicated."""
    is_complete: bool
    """Whether the test allows for every parameter of the table, base and tool."""


def structure_of(solution: Solution, found: IdentifiableParameters) -> Structure | None:
    """Lack-of-fit test of a solution; None if the residuals may be noise."""
    whole, is_complete = _all_parameters(solution, found)
    problem = problem_of(whole, solution.problem.measurements)
    fit, size = solution.fit, whole.skeleton.size
    deviation = np.zeros(problem.P)
    deviation[: len(solution.deviation)] = solution.deviation
    errors = block_errors(problem, deviation, solution.fixtures)
    largest = max(np.nanmax(e, initial=0.0) for e in (errors.position / size, errors.angle))
    posture = _posture_of_rows(problem)
    count = int(posture.max()) + 1
    if largest < _ROUNDING or count < _FEWEST:
        return None
    r, J = stacked(problem, np.concatenate([deviation, solution.fixtures]), solution.scales)
    weight = np.sqrt(fit.weights)
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
        return columns - Q @ (Q.T @ columns)

    total = float(r @ r)
    left = total - ((signs @ by_posture(Q)) ** 2).sum(axis=1)

    def chance(sums: Array) -> float:
        drawn = ((signs @ sums) ** 2).sum(axis=1) / left
        return (1 + int((drawn >= (sums.sum(axis=0) ** 2).sum() / total).sum())) / (1 + _FLIPS)

    odds = {}
    for family in FAMILIES:
        own = [k for k, e in enumerate(whole.entries) if e.law in family.laws]
        columns = _basis(projected(_unit_columns(J[:, own])), _DEPENDENT)
        if included.isdisjoint(family.laws) and columns.shape[1]:
            odds[family] = chance(by_posture(columns))
    smooth = [
        by_posture(projected(_unit_columns(weight[:, None] * columns)))
        for columns in _smooth_columns(problem, deviation, solution)
    ]
    tests = [*odds.values(), *([chance(np.hstack(smooth))] if smooth else [])]
    p = min(1.0, len(tests) * min(tests, default=1.0))
    if p >= _DOUBT:
        return None
    best = sorted(odds, key=lambda family: odds[family])
    indicated = tuple(family for family in best if odds[family] < _HINT)
    others = tuple(family for family in best if family not in indicated)
    return Structure(p, whole, indicated, others, is_complete)


def _all_parameters(
    solution: Solution, found: IdentifiableParameters
) -> tuple[GeometricParameters, bool]:
    """Parameters of the fit, the others of the table and all families; whether none is missing."""
    skeleton = found.candidates.skeleton
    has_masses = bool(skeleton.model.inertia.values.any())
    everything = candidate_parameters(
        skeleton.model, skeleton.frames, gains=True, eccentricity=True,
        compliance=Compliance.JOINTS if has_masses else Compliance.NONE,
    )  # fmt: skip
    entries = {e.name: e for e in (*solution.problem.parameters.entries, *found.candidates.entries)}
    others = {e.name: e for e in everything.entries if e.name not in entries}
    missing = {name for name, e in others.items() if e.law is ErrorLaw.CONSTANT}
    entries |= others
    if needs_a_length(problem_of(everything, solution.problem.measurements), ()):
        # with all lengths free the robot shrinks until nothing is left of a residual
        fixed = {n for n, why in found.reasons.items() if why in (Reason.KNOWN, Reason.GAUGE)}
        entries = {n: e for n, e in entries.items() if n not in fixed | missing}
        return GeometricParameters(skeleton, tuple(entries.values())), not missing
    return GeometricParameters(skeleton, tuple(entries.values())), True


def _posture_of_rows(problem: Problem) -> NDArray[np.int64]:
    """Number of the posture of each row, shape (M,): blocks with the same readings share it."""
    numbers: dict[object, int] = {}
    found = []
    for k, m in enumerate(problem.measurements):
        for b in range(m.blocks):
            key = b"".join(view.q[b].tobytes() for view in m.views) or (k, b)
            found += [numbers.setdefault(key, len(numbers))] * len(m.axes)
    return np.array(found, dtype=np.int64)


def _unit_columns(columns: Array) -> Array:
    """Columns of length 1, those of length 0 left out."""
    length = np.linalg.norm(columns, axis=0)
    return np.asarray(columns[:, length > 0.0] / length[length > 0.0])


def _basis(columns: Array, least: float) -> Array:
    """Orthonormal columns of the directions whose singular value is above the least."""
    U, s, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(U[:, s > least])


def _smooth_columns(problem: Problem, deviation: Array, solution: Solution) -> list[Array]:
    """Jacobian columns of smooth position errors of each joint."""
    parameters = problem.parameters
    own = [
        (k, e.row) for k, e in enumerate(parameters.entries)
        if e.law is ErrorLaw.CONSTANT and _is_variable(parameters.skeleton, e.row, e.element)
    ]  # fmt: skip
    joints = parameters.skeleton.joint[[row for _, row in own]]
    slides = parameters.skeleton.sigma[[row for _, row in own]] == PRISMATIC
    readings = np.concatenate([view.q for m in problem.measurements for view in m.views])[:, joints]
    half = np.where(slides, np.ptp(readings, axis=0) / np.pi, 1.0)
    half[half == 0.0] = 1.0
    seen = evaluations(problem, deviation)
    columns = []
    for k, _ in own:
        parts = []
        for m, views, scale in zip(problem.measurements, seen, solution.scales, strict=True):
            wide = []
            for at, view in zip(views, m.views, strict=True):
                factor = _harmonics(view.q[:, joints] / half)
                wide.append(Evaluation(at.T, at.psi[:, :, k, None] * factor[:, None, :]))
            rows = m.linearise(wide, solution.fixtures[problem.columns(m)]).by_parameters
            parts.append(whitened(m, rows, scale).reshape(m.blocks * len(m.axes), -1))
        wide_as = max(part.shape[1] for part in parts)
        columns.append(np.vstack([np.pad(p, ((0, 0), (0, wide_as - p.shape[1]))) for p in parts]))
    return columns


def _is_variable(skeleton: Skeleton, row: int, element: Element) -> bool:
    """Whether an element is the variable of a joint."""
    if not 0 < row <= skeleton.model.f or skeleton.sigma[row] == FIXED:
        return False
    return element is (Element.R if skeleton.sigma[row] == PRISMATIC else Element.THETA)


def _harmonics(q: Array) -> Array:
    """Sine and cosine of each joint, and products of those of two, shape (N, D)."""
    waves = np.stack([np.sin(q), np.cos(q)], axis=-1)
    products = [
        (waves[:, i, :, None] * waves[:, j, None, :]).reshape(len(q), 4)
        for i, j in combinations(range(q.shape[1]), 2)
    ]
    return np.concatenate([waves.reshape(len(q), -1), *products], axis=1)
