"""Measurements kept aside: errors on data that did not take part in the fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Rebuilt
from ..estimation import Prior, fit_nonlinear
from ..model import RobotModel
from .errors_seen import BlockErrors, block_errors
from .measurements import Measurement
from .parameters import GeometricParameters
from .partition import Part, Partition, parted, partition_blocks
from .problem import Problem, guessed_fixtures, problem_of, stacked
from .solve import Solution, first_scales, solve

_ROUGH = 1e-6
"""Tolerance of fits without some of the measurements."""


class Split(NamedTuple):
    """Measurements to fit and their numbers, those aside with their blocks, and how all parted."""

    kept: tuple[Measurement, ...]
    aside: tuple[Measurement, ...]
    numbers: tuple[int, ...]
    blocks: NDArray[np.int64]
    partition: Partition


@dataclass(frozen=True, slots=True, eq=False)
class AsideErrors(Rebuilt):
    """Errors of blocks kept aside, before and after.

    Parameters
    ----------
    blocks : ndarray of int, shape (B,)
        Which blocks.
    before, after : BlockErrors
        Of the nominal robot (base and tool fitted where they may be off) and of one calibrated
        without these blocks, each with the fixtures that suit it best.
    folds : int
        Number of fits.
    partition : Partition or None
        How the blocks were chosen; None if the caller did.
    """

    blocks: NDArray[np.int64]
    before: BlockErrors
    after: BlockErrors
    folds: int
    partition: Partition | None = None


def splits(
    model: RobotModel, measurements: Sequence[Measurement], folds: int, rng: np.random.Generator
) -> list[Split]:
    """Parts that are kept aside in turn, at most ``folds``: whole places, or runs of postures."""
    partition = partition_blocks(model, measurements, folds, rng)
    return [_split(measurements, partition, part) for part in partition.parts]


def _split(measurements: Sequence[Measurement], partition: Partition, part: Part) -> Split:
    kept = parted(measurements, part.kept)
    return Split(
        tuple(m for _, m in kept), tuple(m for _, m in parted(measurements, part.aside) if m.views),
        tuple(k for k, _ in kept), np.flatnonzero(part.aside), partition,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Refit(Rebuilt):
    """Settings of a fit that is repeated without some measurements."""

    solution: Solution
    prior: Callable[[Problem], Prior] | None
    truncation: float | None


def errors_of_splits(
    refit: Refit, parts: Sequence[Split], before: BlockErrors, done: Callable[[], None]
) -> AsideErrors:
    """Validation errors of the held-out blocks of each split."""
    parameters = refit.solution.problem.parameters
    found, numbers = [], []
    known = fixtures_by_name(refit.solution)
    for part in parts:
        problem = problem_of(parameters, part.kept)
        start = [known[fixture.name] for fixture in problem.fixtures]
        solution = solve(
            problem, np.concatenate([refit.solution.deviation, start]),
            from_scales=tuple(refit.solution.scales[k] for k in part.numbers),
            loss=refit.solution.fit.loss,
            prior=None if refit.prior is None else refit.prior(problem),
            truncation=refit.truncation, tolerance=_ROUGH,
        )  # fmt: skip
        fixtures = fixtures_by_name(solution)
        found.append(errors_aside(parameters, solution.deviation, part.aside, fixtures))
        numbers.append(part.blocks)
        done()
    blocks = np.concatenate(numbers)
    after = BlockErrors(
        np.concatenate([e.position for e in found]), np.concatenate([e.angle for e in found])
    )
    there = BlockErrors(before.position[blocks], before.angle[blocks])
    return AsideErrors(blocks, there, after, len(parts), parts[0].partition)


def errors_of_others(refit: Refit, aside: Sequence[Measurement]) -> AsideErrors:
    """Errors of measurements that were not used in any fit."""
    solution = refit.solution
    parameters = solution.problem.parameters
    zero = np.zeros(len(parameters))
    after = errors_aside(parameters, solution.deviation, aside, fixtures_by_name(solution))
    before = errors_aside(parameters, zero, aside, {})
    return AsideErrors(np.arange(len(after.position)), before, after, 1)


def fixtures_by_name(solution: Solution) -> dict[str, float]:
    """Fixtures of a solution by name."""
    names = (fixture.name for fixture in solution.problem.fixtures)
    return dict(zip(names, solution.fixtures.tolist(), strict=True))


def errors_aside(
    parameters: GeometricParameters,
    deviation: Array,
    aside: Sequence[Measurement],
    known: dict[str, float],
) -> BlockErrors:
    """Errors of measurements that were not used in a fit. Shapes: deviation (P,)."""
    problem = problem_of(parameters, aside)
    return block_errors(problem, deviation, suited_fixtures(problem, deviation, known))


def suited_fixtures(problem: Problem, deviation: Array, known: dict[str, float]) -> Array:
    """Least-squares fixtures at given parameters of the robot. Shapes: deviation (P,) -> (F,)."""
    names = [fixture.name for fixture in problem.fixtures]
    values = np.array([known.get(name, np.nan) for name in names])
    free = np.flatnonzero(np.isnan(values))
    if not len(free):
        return values
    values[free] = guessed_fixtures(problem, deviation)[free]
    scales = first_scales(problem)
    P = problem.P

    def linearise(x: Array) -> tuple[Array, Array]:
        values[free] = x
        r, J = stacked(problem, np.concatenate([deviation, values]), scales)
        return r, J[:, P + free]

    values[free] = fit_nonlinear(linearise, values[free], block=problem.block).x
    return values
