"""Errors of a calibration, on the measurements of the fit and on measurements held out of it.

Cross-validation leaves out whole places that are touched, or runs of successive postures:
measurements next to a posture of the fit resemble it, and their errors would be too small.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from .._arrays import Array, Frozen
from ..errors import InvalidValueError
from ..estimation import Loss, fit_nonlinear
from ..kinematics import dgm
from ..kinematics.lengths import characteristic_length
from ..model import RobotModel
from .measurements import Labelled, Measurement, scale_is_observable, single_observations
from .prior import ParameterPrior
from .problem import Problem, guessed_fixtures, linearised, problem_of, stacked
from .solve import ROUGH, Solution, first_scales, refitted, solve

_NEAR = 0.2  # extent of one place, relative to the size of the robot
_FEWEST = 3  # smallest number of places for leaving places out
_STRENGTHS = np.logspace(-3.0, 3.0, 13)
_FOLDS = 5  # folds for the choice of a prior's strength

Numbers = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Errors(Frozen):
    """Lengths of the residuals of measurements, and their statistics by unit. Read-only.

    ``mean``, ``rms``, ``max`` and ``count`` are mappings with the keys ``"m"`` and ``"rad"``, as
    far as such rows are measured. Known distances are left out.

    Parameters
    ----------
    position, angle : ndarray, shape (B,)
        Of each measurement, m and rad; NaN where it has no rows of the unit.

    Examples
    --------
    >>> errors = Errors(np.array([0.003, 0.004]), np.full(2, np.nan))
    >>> errors.mean, errors.max["m"]
    ({'m': 0.0035}, 0.004)
    """

    position: Array
    angle: Array

    @property
    def mean(self) -> dict[str, float]:
        """Mean length, m or rad."""
        return self._of_lengths(np.mean)

    @property
    def rms(self) -> dict[str, float]:
        """Root mean square length, m or rad."""
        return self._of_lengths(lambda lengths: np.sqrt(np.mean(lengths**2)))

    @property
    def max(self) -> dict[str, float]:
        """Largest length, m or rad."""
        return self._of_lengths(np.max)

    @property
    def count(self) -> dict[str, int]:
        """Number of measurements."""
        return {unit: int(number) for unit, number in self._of_lengths(len).items()}

    def _of_lengths(self, function: Callable[[Array], Any]) -> dict[str, float]:
        by_unit = (("m", self.position), ("rad", self.angle))
        measured = ((unit, lengths[~np.isnan(lengths)]) for unit, lengths in by_unit)
        return {unit: float(function(lengths)) for unit, lengths in measured if len(lengths)}


@dataclass(frozen=True, slots=True, eq=False)
class HeldOutErrors(Errors):
    """Errors of measurements (numbers ``blocks``) held out of ``fits`` fits, and before.

    ``description``: how they were chosen, empty if the caller did.
    """

    blocks: Numbers
    nominal: Errors
    fits: int
    description: str = ""


@dataclass(frozen=True, slots=True)
class Validation:
    """Errors of a calibration.

    Parameters
    ----------
    given, nominal, in_sample : Errors
        Of the robot as given, with base and tool alone fitted, and calibrated.
    folds, held_out : Errors or None
        On data held out (cross-validation; one more fit, or the caller's), and ``nominal`` before.
    """

    given: Errors
    nominal: Errors
    in_sample: Errors
    folds: HeldOutErrors | None = None
    held_out: HeldOutErrors | None = None


def errors_of(
    problem: Problem, corrections: Array, known: Mapping[str, float] = MappingProxyType({})
) -> Errors:
    """Errors at given corrections (P,); fixtures are known ones, or those that suit best."""
    fixtures = suited_fixtures(problem, corrections, known)
    parts = zip(problem.measurements, linearised(problem, corrections, fixtures), strict=True)
    lengths: dict[str, list[Array]] = {"m": [np.zeros(0)], "rad": [np.zeros(0)]}
    for m, part in ((m, part) for m, part in parts if m.views):
        for unit, of_unit in lengths.items():
            rows = np.array(m.units) == unit
            none = 0.0 if rows.any() else np.nan
            of_unit.append(np.linalg.norm(part.residual[:, rows], axis=1) + none)
    return Errors(*map(np.concatenate, lengths.values()))


def suited_fixtures(
    problem: Problem, corrections: Array, known: Mapping[str, float] = MappingProxyType({})
) -> Array:
    """Least-squares fixtures at given corrections (P,), shape (F,)."""
    values = np.array([known.get(fixture.name, np.nan) for fixture in problem.fixtures])
    free = np.flatnonzero(np.isnan(values))
    if not len(free):
        return values
    values[free] = guessed_fixtures(problem, corrections)[free]
    scales = first_scales(problem)

    def linearise(x: Array) -> tuple[Array, Array]:
        values[free] = x
        r, J = stacked(problem, np.concatenate([corrections, values]), scales)
        return r, J[:, problem.P + free]

    values[free] = fit_nonlinear(linearise, values[free], block=problem.block).x
    return values


def cross_validated(
    solution: Solution, parts: Partition, nominal: Errors, done: Callable[[], None]
) -> HeldOutErrors:
    """Errors of the held-out measurements of each part, by a fit of the others."""
    found, known = [], solution.fixture_values
    for split in parts.splits:
        problem = problem_of(solution.problem.parameters, split.training)
        start = np.array([*solution.corrections, *(known[f.name] for f in problem.fixtures)])
        scales = tuple(solution.scales[k] for k in split.numbers)
        fitted = refitted(solution, problem, start, scales, tolerance=ROUGH)
        test = problem_of(problem.parameters, split.test)
        found.append(errors_of(test, fitted.corrections, fitted.fixture_values))
        done()
    blocks = np.concatenate([split.blocks for split in parts.splits])
    position, angle = (
        np.concatenate([getattr(e, x) for e in found]) for x in ("position", "angle")
    )
    before = Errors(nominal.position[blocks], nominal.angle[blocks])
    return HeldOutErrors(position, angle, blocks, before, len(parts.splits), parts.description)


def errors_on(solution: Solution, test: Sequence[Measurement]) -> HeldOutErrors:
    """Errors of measurements that took part in no fit."""
    problem = problem_of(solution.problem.parameters, test)
    errors = errors_of(problem, solution.corrections, solution.fixture_values)
    nominal = errors_of(problem, np.zeros(problem.P))
    blocks = np.arange(len(errors.position))
    return HeldOutErrors(errors.position, errors.angle, blocks, nominal, 1)


def settled_prior(
    prior: ParameterPrior | None, problem: Problem, loss: Loss, rng: np.random.Generator
) -> ParameterPrior | None:
    """The prior with a strength: that given, or chosen by cross-validation."""
    if prior is None or prior.strength is not None:
        return prior
    enough = problem.blocks >= 2 * _FOLDS
    parts = partition(problem.parameters.model, problem.measurements, _FOLDS if enough else 0, rng)
    if not parts.splits:
        raise InvalidValueError(
            f"strength: choosing it by cross-validation needs {2 * _FOLDS} measurements or more in "
            "several postures of each object; give a number for the strength, or measure more."
        )
    whole = solve(problem, loss=loss, prior=prior)
    nominal = errors_of(problem, np.zeros(problem.P))
    candidates = [replace(prior, strength=float(strength)) for strength in _STRENGTHS]
    sizes = []
    for candidate in candidates:
        errors = cross_validated(replace(whole, prior=candidate), parts, nominal, lambda: None)
        by_unit = errors.rms if loss is Loss.SQUARES else errors.mean
        sizes.append([by_unit[unit] / nominal.rms[unit] for unit in by_unit])
    relative = np.array(sizes) / np.min(sizes, axis=0)
    return candidates[int(np.argmin((relative**2).sum(axis=1)))]


# --- partition of measurements into folds ---------------------------------------------------------


class Split(NamedTuple):
    """Measurements to fit and their numbers, those held out with their blocks."""

    training: tuple[Measurement, ...]
    test: tuple[Measurement, ...]
    numbers: tuple[int, ...]
    blocks: Numbers


class Partition(NamedTuple):
    """Splits of measurements, with a description for the report and a note, empty for none."""

    splits: tuple[Split, ...]
    description: str
    note: str


def partition(
    model: RobotModel, measurements: Sequence[Measurement], folds: int, rng: np.random.Generator
) -> Partition:
    """At most ``folds`` parts that are held out in turn: whole places, or runs of postures.

    Equal readings are always in one part.
    """
    seen = [m for m in measurements if m.views]
    if not seen or not folds:
        return Partition((), "", "")
    posture, names = posture_numbers(seen), [name for m in seen for name in _labels(m)]
    number = {name: k for k, name in enumerate(dict.fromkeys(names))}
    label = np.array([number[name] for name in names])
    fold = np.full(len(posture), -1, dtype=np.int64)
    near = _NEAR * characteristic_length(model)
    p = np.concatenate([dgm(model, m.views[0].q, m.views[0].frame)[:, :3, 3] for m in seen])
    held = np.concatenate([np.full(m.blocks, isinstance(m, Labelled)) for m in seen])
    held &= ~np.isin(names, [*single_observations(seen)])
    place = _places(p, posture, np.where(held, label, -1), near)
    count = len(np.unique(place[place >= 0]))
    whole, note = np.zeros(len(posture), dtype=np.bool_), ""
    if count >= _FEWEST:
        assigned = _assigned_places(measurements, place, folds, rng)
        if (assigned >= 0).any():
            fold, whole = assigned, place >= 0
    elif count and (place >= 0).all():
        note = (
            f"Measured at {count} place{'s'[: count > 1]} only: the errors on held-out data are "
            "of other postures there, and may be larger at another place. Measure at three or "
            f"more places, over {near:.2g} m apart."
        )
    places, has_runs = len(np.unique(place[fold >= 0])), False
    of_posture = np.full(int(posture.max()) + 1, -1, dtype=np.int64)
    of_posture[posture[whole]] = fold[whole]
    next_to = np.zeros((folds, len(posture)), dtype=np.bool_)
    for one in np.unique(label[~whole]):
        blocks = np.flatnonzero((label == one) & ~whole)
        met, first = np.unique(posture[blocks], return_index=True)
        met = met[np.argsort(first)]
        if len(met) > 1:
            has_runs = True
            turn = rng.permutation(folds)[np.arange(len(met)) * folds // len(met)]
            of_posture[met] = np.where(of_posture[met] < 0, turn, of_posture[met])
            width = len(met) // (3 * folds)
            for k in range(folds):
                wide = np.convolve(of_posture[met] == k, np.ones(2 * width + 1), "same") > 0.5
                next_to[k, blocks] = np.isin(posture[blocks], met[wide])
    fold[~whole] = of_posture[posture[~whole]]
    splits = []
    for k in np.unique(fold[fold >= 0]):
        training = _restricted(measurements, (fold != k) & ~next_to[k])
        test = tuple(m for _, m in _restricted(measurements, fold == k) if m.views)
        numbers, kept = zip(*training, strict=True) if training else ((), ())
        splits.append(Split(kept, test, numbers, np.flatnonzero(fold == k)))
    runs = "runs of successive postures, those next to a run left out of the fit as well,"
    parts = [f"whole places ({places})"] * bool(places) + [runs] * has_runs
    return Partition(tuple(splits), "; elsewhere ".join(parts), note)


def posture_numbers(measurements: Sequence[Measurement]) -> Numbers:
    """Posture of each block, shape (B,): blocks with equal readings have the same number."""
    found: dict[object, int] = {}
    numbers = []
    for k, m in enumerate(measurements):
        for b in range(m.blocks):
            distinct = dict.fromkeys(view.q[b].tobytes() for view in m.views)
            numbers.append(found.setdefault(b"".join(distinct) or (k, b), len(found)))
    return np.array(numbers, dtype=np.int64)


def _labels(m: Measurement) -> list[str]:
    """Touched or observed object of each block; empty where there is none."""
    if isinstance(m, Labelled):
        return [f"{m.name}:{label}" for label in m.label]
    return [m.name if m.fixtures else ""] * m.blocks


def _places(p: Array, posture: Numbers, label: Numbers, near: float) -> Numbers:
    """Place index of each block at p (N, 3), -1 for blocks without a label or a place."""
    place, at = np.full((2, len(posture)), -1, dtype=np.int64)
    centres: list[Array] = []
    for one in np.unique(label[label >= 0]):
        blocks = label == one
        centre = p[blocks].mean(axis=0)
        if np.linalg.norm(p[blocks] - centre, axis=1).max() < near:
            at[blocks] = len(centres)
            centres.append(centre)
    held = at >= 0
    if not centres:
        return place
    region = np.ones(1, dtype=np.int64)
    if len(centres) > 1:
        region = fcluster(linkage(centres, "complete"), near, "distance").astype(np.int64)
    # objects that are measured in one posture are at one place
    one, other = region[at[held]], posture[held] + len(centres) + 1
    size = int(other.max()) + 1
    links = coo_array((np.ones(len(one)), (one, other)), shape=(size, size))
    place[held] = connected_components(links, directed=False)[1][one]
    return place


def _assigned_places(
    measurements: Sequence[Measurement], place: Numbers, folds: int, rng: np.random.Generator
) -> Numbers:
    """Fold of each block by its place; a known length remains in the fit of each fold."""
    fold = np.full(len(place), -1, dtype=np.int64)
    length = scale_is_observable(measurements)
    for one in rng.permutation(np.unique(place[place >= 0])):
        sizes = np.bincount(fold[fold >= 0], minlength=folds)
        for k in np.argsort(sizes, kind="stable"):
            tried = np.where(place == one, k, fold)
            left = _restricted(measurements, tried != k)
            if left and (not length or scale_is_observable(m for _, m in left)):
                fold = tried
                break
    return fold


def _restricted(measurements: Sequence[Measurement], kept: Mask) -> list[tuple[int, Measurement]]:
    """Measurements restricted to some blocks, with their indices."""
    parts: list[tuple[int, Measurement]] = []
    first = 0
    for k, m in enumerate(measurements):
        part = np.flatnonzero(kept[first : first + m.blocks]) if m.views else np.arange(m.blocks)
        first += m.blocks if m.views else 0
        if len(part):
            parts.append((k, m if len(part) == m.blocks else m.subset(part)))
    touched = {f.name for _, m in parts if m.views for f in m.fixtures}
    return [(k, m) for k, m in parts if m.views or touched.issuperset(f.name for f in m.fixtures)]
