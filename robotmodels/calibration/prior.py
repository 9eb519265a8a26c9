"""Gaussian prior of the geometric corrections."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .._arrays import Array, Rebuilt, as_reals
from ..errors import InvalidValueError
from ..estimation import Loss, Prior
from ..estimation.strength import select_strength
from .identifiable import IdentifiableParameters
from .measurements import Measurement
from .parameters import ErrorLaw, GeometricParameter, GeometricParameters
from .partition import partition_blocks
from .problem import Problem, guessed_fixtures, problem_of, stacked
from .solve import Solution, solve

_FOLDS = 5
_ANOTHER_ROBOT = 3.0
"""Increase of the prior's angles from which zeros or signs of joints may be wrong."""
_LENGTH = 1e-3
"""Prior standard deviation of lengths of robots of 1 m and more, m."""
_SHARED = 0.1
"""Corrections of others in their prior standard deviations, per one of a regrouped parameter, from
which the regrouped parameter shares corrections with them."""
_TRIES = 4
"""Largest number of fits for the prior's width."""
_CONTRADICTED = 2.5
"""Rms of corrections over their prior standard deviations from which the prior is widened."""


@dataclass(frozen=True, slots=True, eq=False)
class ParameterPrior(Rebuilt):
    """Gaussian prior of the deviations, zero in the mean: the fit is the maximum a posteriori.

    Parameters
    ----------
    length, angle : float
        Standard deviations of constant corrections of lengths (m) and angles (rad) of the table;
        infinite for no prior. The length is by default 1 mm, or a thousandth of a robot that is
        smaller than 1 m. `fit` increases them where the corrections contradict them. Base and
        tools have no prior, unless they are named.
    gain, compliance, eccentricity : float, optional
        Of gains and couplings (1, or the ratio of the units), of compliances (rad or m per N m or
        N), and of errors in sine and cosine (rad). By default such an error may move its joint as
        far as a constant one (``angle``, ``length``) at the largest reading or load measured.
    named : mapping of str to float
        Standard deviations of single parameters, before the others.
    strength : float or None
        Factor on the information; None chooses it by cross-validation.
    truncated : bool
        Whether parameters that base and tool can replace stay nominal (the default), or share
        corrections with them as parameters do that act like combinations of others of the table.

    Raises
    ------
    InvalidValueError
        A standard deviation that is not positive.

    References
    ----------
    Seed book section 1.4.4.3.

    Examples
    --------
    >>> ParameterPrior(length=1e-3, angle=2e-3).strength
    1.0
    """

    length: float | None = None
    angle: float = 5e-3
    gain: float | None = None
    compliance: float | None = None
    eccentricity: float | None = None
    named: Mapping[str, float] = field(default_factory=dict)
    strength: float | None = 1.0
    truncated: bool = True

    def __post_init__(self) -> None:
        sizes = {
            "length": self.length, "angle": self.angle, "gain": self.gain,
            "compliance": self.compliance, "eccentricity": self.eccentricity, **self.named,
        }  # fmt: skip
        for name, value in sizes.items():
            if value is not None and not float(as_reals(value, name)) > 0.0:
                raise InvalidValueError(
                    f"{name}: expected a positive standard deviation, or infinity for none, got "
                    f"{value!r}. Name what is known exactly in known=(...)."
                )


def estimated_with(
    prior: ParameterPrior, found: IdentifiableParameters, measured: Sequence[Measurement]
) -> GeometricParameters:
    """Identifiable parameters, and regrouped ones that share corrections with them."""
    candidates = found.candidates
    size = standard_deviations(prior, problem_of(candidates, measured))
    sizes = dict(zip(candidates.names, size, strict=True))
    shared = {
        name for name, terms in found.regrouped_into.items()
        if np.isfinite(sizes[name]) and (
            not prior.truncated
            # those without a prior, base and tool, take its part at no cost
            or any(abs(c) * sizes[name] > _SHARED * sizes[other] for other, c in terms.items())
        )
    }  # fmt: skip
    return candidates.subset(n for n in candidates.names if n in shared or n in found.names)


def settled_prior(
    prior: ParameterPrior, problem: Problem, loss: Loss, rng: np.random.Generator
) -> Prior:
    """The prior of the unknowns of a problem; fixtures have none."""
    whole = np.concatenate([standard_deviations(prior, problem), np.full(problem.F, np.inf)])
    mean = np.zeros(len(whole))
    if prior.strength is not None:
        return Prior(mean, whole, prior.strength)
    whole_prior = Prior(mean, whole)
    if problem.blocks < 2 * _FOLDS:
        raise InvalidValueError(
            f"strength: choosing it needs {2 * _FOLDS} measurements or more, got "
            f"{problem.blocks}; give the strength."
        )
    scales = solve(problem, loss=loss, prior=whole_prior).scales
    start = np.concatenate([mean[: problem.P], guessed_fixtures(problem, mean[: problem.P])])
    block = problem.block
    seen = np.repeat([bool(m.views) for m in problem.measurements],
                     [m.blocks for m in problem.measurements])  # fmt: skip
    model, measurements = problem.parameters.model, problem.measurements
    partition = partition_blocks(model, measurements, _FOLDS, rng, whole_places=False)
    masks = np.zeros((len(partition.parts), len(seen)), dtype=bool)
    masks[:, seen] = [part.aside for part in partition.parts]
    masks = masks[:, block]
    tried = select_strength(
        lambda x: stacked(problem, x, scales), start, whole_prior, masks, _STRENGTHS, block, loss
    )
    return whole_prior.with_strength(tried.strength)


_STRENGTHS = np.logspace(-3.0, 3.0, 13)


def standard_deviations(prior: ParameterPrior, problem: Problem) -> Array:
    """Prior standard deviations of the parameters, shape (P,); infinite without prior."""
    parameters = problem.parameters
    prior = sized(prior, parameters.skeleton.size)
    f = parameters.model.f
    return np.array([
        prior.named.get(e.name, _size(prior, e, f, largest))
        for e, largest in zip(parameters.entries, largest_factors(problem), strict=True)
    ])  # fmt: skip


def sized(prior: ParameterPrior, size: float) -> ParameterPrior:
    """The prior with a number for lengths: a thousandth of the robot's size, at most 1 mm."""
    if prior.length is not None:
        return prior
    return replace(prior, length=_LENGTH * min(1.0, size))


def widened(prior: ParameterPrior, solution: Solution) -> ParameterPrior:
    """Prior widened by maximum evidence where the corrections contradict it."""
    # the factor maximises the evidence: D. J. C. MacKay, "Bayesian interpolation", Neural
    # Computation 4, 1992
    problem, fit = solution.problem, solution.fit
    f = problem.parameters.model.f
    size = fit.prior.sigma / np.sqrt(fit.prior.strength)
    found = {}
    for name, is_length in (("length", True), ("angle", False)):
        of_kind = [
            k for k, e in enumerate(problem.parameters.entries)
            if e.law is ErrorLaw.CONSTANT and 0 < e.row <= f and e.name not in prior.named
            and e.element.is_length is is_length
        ]  # fmt: skip
        determined = 1.0 - np.diagonal(fit.covariance)[of_kind] / size[of_kind] ** 2
        count = max(float(determined.sum()), 1.0)
        ratio = np.sqrt(float(((fit.x[of_kind] / size[of_kind]) ** 2).sum()) / count)
        if ratio > _CONTRADICTED:
            found[name] = ratio * float(getattr(prior, name))
    return replace(prior, **found) if found else prior


def refitted(
    prior: ParameterPrior | None,
    problem: Problem,
    like: Solution,
    start: Array,
    scales: tuple[Array, ...],
    truncation: float | None,
) -> Solution:
    """Fit of part of the measurements, the prior as given and widened only where they require it.

    Shapes: start (P + F,) of ``problem``; scales, one for each of its measurements.
    """
    loss, gaussian = like.fit.loss, Prior.none(problem.P + problem.F)
    for _ in range(_TRIES):
        if prior is not None:
            sizes = np.full(problem.P + problem.F, np.inf)
            sizes[: problem.P] = standard_deviations(prior, problem)
            gaussian = Prior(np.zeros(len(sizes)), sizes, like.fit.prior.strength)
        solution = solve(
            problem, start, from_scales=scales, loss=loss, prior=gaussian, truncation=truncation
        )
        wider = None if prior is None else widened(prior, solution)
        if wider is prior:
            break
        prior, start, scales = wider, solution.fit.x, solution.scales
    return solution


def note_of_prior(
    given: ParameterPrior | None, used: ParameterPrior | None, distances: bool
) -> tuple[str, ...]:
    """Note if the prior was widened; ``distances``: whether some are known."""
    if given is None or used is None or given is used:
        return ()
    angle = used.angle / given.angle
    check = " Check the zeros and signs of the joints." if angle > _ANOTHER_ROBOT else ""
    check += (
        " Check the known distances."
        if distances and (used.length or 0.0) > (given.length or 0.0)
        else ""
    )
    changes = [
        f"of {name}s from {getattr(given, name):.2g} to {getattr(used, name):.2g} {unit}"
        for name, unit in (("length", "m"), ("angle", "rad"))
        if getattr(given, name) != getattr(used, name)
    ]
    return (
        "The corrections are larger than the prior allows, so its standard deviations were "
        f"increased: {' and '.join(changes)}.{check}",
    )


def largest_factors(problem: Problem) -> Array:
    """Largest factor (1, reading or load) of each parameter, shape (P,)."""
    largest = np.zeros(problem.P)
    for views in problem.factors:
        for factors in views:
            np.maximum.at(largest, problem.parameters.actions[0], np.abs(factors).max(axis=0))
    return largest


def _size(prior: ParameterPrior, entry: GeometricParameter, f: int, largest: float) -> float:
    constant = float(prior.length or np.inf) if entry.element.is_length else prior.angle
    if entry.law is ErrorLaw.CONSTANT:
        return constant if 0 < entry.row <= f else np.inf
    given = {ErrorLaw.GAIN: prior.gain, ErrorLaw.COMPLIANCE: prior.compliance}
    own = given.get(entry.law, prior.eccentricity)
    if own is not None:
        return own
    return constant / largest if largest > 0.0 else np.inf
