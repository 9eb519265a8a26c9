"""Measurements kept aside: errors on data that did not take part in the fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Rebuilt
from ..errors import InvalidValueError
from ..estimation import Prior, fit_nonlinear
from .dealing import dealt_blocks
from .errors_seen import BlockErrors, block_errors
from .extended_table.parameters import GeometricParameters
from .measurements import Measurement
from .problem import Problem, guessed_fixtures, problem_of, stacked
from .solve import Solution, first_scales, solve

_ROUGH = 1e-6
"""Tolerance of fits without some of the measurements."""


class Split(NamedTuple):
    """Measurements to fit, and measurements kept aside.

    Attributes
    ----------
    kept, aside : tuple of Measurement
        Known distances and the like are always kept.
    blocks : ndarray of int
        Numbers of the blocks aside, counted through the measurements that have views.
    """

    kept: tuple[Measurement, ...]
    aside: tuple[Measurement, ...]
    blocks: NDArray[np.int64]


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
    """

    blocks: NDArray[np.int64]
    before: BlockErrors
    after: BlockErrors
    folds: int


def splits(
    measurements: Sequence[Measurement], folds: int, rng: np.random.Generator
) -> list[Split]:
    """Deal the blocks of each measurement, and of each group in it, to folds.

    Parameters
    ----------
    measurements : sequence of Measurement
        Of any kinds.
    folds : int
        How many, two or more.
    rng : numpy.random.Generator
        Where chance comes from.

    Returns
    -------
    list of Split
        Each block is aside once; groups with a single block never are.

    Raises
    ------
    InvalidValueError
        Fewer than two folds, or fewer blocks than folds.
    """
    if folds < 2:
        raise InvalidValueError(f"folds: expected 2 or more (0 for none), got {folds}.")
    dealt = dealt_blocks(measurements, folds, rng)
    parts = [_split(measurements, dealt, k) for k in range(folds)]
    return [part for part in parts if part.aside]


def split_aside(
    measurements: Sequence[Measurement], share: float, rng: np.random.Generator
) -> Split | None:
    """Keep a share of the blocks of each group aside.

    Parameters
    ----------
    measurements : sequence of Measurement
        Of any kinds.
    share : float
        Between 0 and 1.
    rng : numpy.random.Generator
        Where chance comes from.

    Returns
    -------
    Split or None
        None if nothing can be kept aside.

    Raises
    ------
    InvalidValueError
        A share that is not between 0 and 1.
    """
    if not 0.0 < share < 1.0:
        raise InvalidValueError(
            f"held_out: expected a share between 0 and 1, or measurements, got {share!r}."
        )
    folds = max(round(1.0 / share), 2)
    dealt = dealt_blocks(measurements, folds, rng)
    part = _split(measurements, dealt, 0)
    return part if part.aside else None


def _split(
    measurements: Sequence[Measurement], dealt: Sequence[NDArray[np.int64]], k: int
) -> Split:
    kept, aside, numbers, first = [], [], [], 0
    for m, fold in zip(measurements, dealt, strict=True):
        out = np.flatnonzero(fold == k)
        numbers.append(first + out)
        first += m.blocks if m.views else 0
        if len(out):
            aside.append(m.subset(out))
            kept.append(m.subset(np.flatnonzero(fold != k)))
        else:
            kept.append(m)
    return Split(tuple(kept), tuple(aside), np.concatenate(numbers).astype(np.int64))


@dataclass(frozen=True, slots=True, eq=False)
class Refit(Rebuilt):
    """How to fit again without some measurements: from the solution.

    Parameters
    ----------
    solution : Solution
        Of all measurements.
    prior : callable or None
        The prior for a problem, from its own measurements alone.
    truncation : float or None
        The same truncation.
    """

    solution: Solution
    prior: Callable[[Problem], Prior] | None
    truncation: float | None


def errors_of_splits(
    refit: Refit, parts: Sequence[Split], before: BlockErrors, done: Callable[[], None]
) -> AsideErrors:
    """Errors of blocks kept aside by splits, each fitted without them.

    Parameters
    ----------
    refit : Refit
        Where each fit starts.
    parts : sequence of Split
        One fit each.
    before : BlockErrors
        Of the nominal robot at all blocks.
    done : callable
        Called after each fit.

    Returns
    -------
    AsideErrors
        Of the blocks aside.
    """
    parameters = refit.solution.problem.parameters
    found, numbers = [], []
    known = fixtures_by_name(refit.solution)
    for part in parts:
        problem = problem_of(parameters, part.kept)
        start = [known[fixture.name] for fixture in problem.fixtures]
        solution = solve(
            problem, np.concatenate([refit.solution.deviation, start]),
            from_scales=refit.solution.scales, loss=refit.solution.fit.loss,
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
    return AsideErrors(blocks, there, after, len(parts))


def errors_of_others(refit: Refit, aside: Sequence[Measurement]) -> AsideErrors:
    """Errors of measurements that never took part.

    Parameters
    ----------
    refit : Refit
        The solution.
    aside : sequence of Measurement
        The others.

    Returns
    -------
    AsideErrors
        Before: the nominal robot with the fixtures that suit it.
    """
    solution = refit.solution
    parameters = solution.problem.parameters
    zero = np.zeros(len(parameters))
    after = errors_aside(parameters, solution.deviation, aside, fixtures_by_name(solution))
    before = errors_aside(parameters, zero, aside, {})
    return AsideErrors(np.arange(len(after.position)), before, after, 1)


def fixtures_by_name(solution: Solution) -> dict[str, float]:
    """Fixtures of a solution by name.

    Parameters
    ----------
    solution : Solution
        Of a fit.

    Returns
    -------
    dict of str to float
        m or rad.
    """
    names = (fixture.name for fixture in solution.problem.fixtures)
    return dict(zip(names, solution.fixtures.tolist(), strict=True))


def errors_aside(
    parameters: GeometricParameters,
    deviation: Array,
    aside: Sequence[Measurement],
    known: dict[str, float],
) -> BlockErrors:
    """Errors of measurements that did not take part in a fit.

    Fixtures that the fit has found are taken from it; others (a point that only they touch) are
    fitted to them, which needs some of their freedom.

    Parameters
    ----------
    parameters : GeometricParameters
        Of the robot.
    deviation : ndarray, shape (P,)
        Their values.
    aside : sequence of Measurement
        Kept aside.
    known : dict of str to float
        Fixtures by name.

    Returns
    -------
    BlockErrors
        Of every block.
    """
    problem = problem_of(parameters, aside)
    return block_errors(problem, deviation, suited_fixtures(problem, deviation, known))


def suited_fixtures(problem: Problem, deviation: Array, known: dict[str, float]) -> Array:
    """Fixtures that suit a robot as it is.

    Parameters
    ----------
    problem : Problem
        Parameters and measurements.
    deviation : ndarray, shape (P,)
        Values of the parameters.
    known : dict of str to float
        Fixtures that stay as they are, by name.

    Returns
    -------
    ndarray, shape (F,)
        In the order of the problem.
    """
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
