"""Gaussian prior of the geometric corrections."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .._arrays import Array, Rebuilt, as_reals
from ..errors import InvalidValueError
from ..estimation import NonlinearFit, Prior
from .identifiable import IdentifiableParameters
from .measurements import Measurement
from .parameters import ErrorLaw, GeometricParameters
from .problem import Problem, problem_of

_WRONG_ZEROS = 3.0  # increase of the prior's angles from which zeros of joints may be wrong
# least ratio of a kept parameter's correction to that of a regrouped one with the same effect, both
# in prior standard deviations, for which the regrouped one is estimated too
_SHARED = 0.1
_CONTRADICTED = 2.5  # rms of corrections over their prior standard deviations that widens it


@dataclass(frozen=True, slots=True, eq=False)
class ParameterPrior(Rebuilt):
    """Gaussian prior of the corrections, zero in the mean: the fit is the maximum a posteriori.

    Parameters
    ----------
    length, angle : float
        Standard deviations of constant corrections of lengths (m) and angles (rad) of the table;
        infinite for no prior. The length is by default 1 mm for a robot whose lengths add up to 1 m
        to 10 m, in proportion for smaller and larger ones. `fit` increases them where the
        corrections contradict them. Base and tools have no prior, unless they are named.
    gain, compliance, eccentricity : float, optional
        Of gains and couplings (1, or the ratio of the units), of compliances (rad or m per N m or
        N), and of errors in sine and cosine (rad). By default such an error may move its joint as
        far as a constant one (``angle``, ``length``) at the largest reading or load measured.
    named : mapping of str to float
        Standard deviations of single parameters, which override the others.
    strength : float or None
        Factor on the information; None chooses it by cross-validation.
    truncated : bool
        True: parameters whose effect base and tool can reproduce keep their nominal values. False:
        they share corrections with base and tool.

    References
    ----------
    Book section 1.4.4.3.
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
        words = ("length", "angle", "gain", "compliance", "eccentricity")
        for name, value in {**{w: getattr(self, w) for w in words}, **self.named}.items():
            if value is not None and not float(as_reals(value, name)) > 0.0:
                raise InvalidValueError(
                    f"{name}: expected a positive standard deviation, or infinity for none, got "
                    f"{value!r}. Name what is known exactly in known=(...)."
                )


def sized(prior: ParameterPrior, length: float) -> ParameterPrior:
    """The prior with a number for lengths, by default this one."""
    return prior if prior.length is not None else replace(prior, length=length)


def standard_deviations(prior: ParameterPrior, problem: Problem) -> Array:
    """Prior standard deviations of the parameters, shape (P,); infinite without prior."""
    prior, f = sized(prior, problem.parameters.table.expected_error), problem.parameters.model.f
    by_law = {ErrorLaw.GAIN: prior.gain, ErrorLaw.COMPLIANCE: prior.compliance}
    sigma = np.full(problem.P, np.inf)
    for k, (e, largest) in enumerate(
        zip(problem.parameters.entries, largest_factors(problem), strict=True)
    ):
        given = prior.named.get(e.name, by_law.get(e.law, prior.eccentricity))
        if e.law is ErrorLaw.CONSTANT:
            given = prior.named.get(e.name, None if 0 < e.row <= f else np.inf)
        if given is not None:
            sigma[k] = given
        elif largest > 0.0:
            sigma[k] = (prior.length if e.element.is_length else prior.angle) / largest
    return sigma


def largest_factors(problem: Problem) -> Array:
    """Largest factor (1, reading or load) of each parameter, shape (P,)."""
    largest = np.zeros(problem.P)
    for factors in (factors for views in problem.factors for factors in views):
        np.maximum.at(largest, problem.parameters.actions[0], np.abs(factors).max(axis=0))
    return largest


def gaussian_prior(prior: ParameterPrior, problem: Problem) -> Prior:
    """The prior of all unknowns of a problem; fixtures have none."""
    sigma = np.concatenate([standard_deviations(prior, problem), np.full(problem.F, np.inf)])
    return Prior(np.zeros(len(sigma)), sigma, 1.0 if prior.strength is None else prior.strength)


def estimated_with(
    prior: ParameterPrior, identifiable: IdentifiableParameters, measured: Sequence[Measurement]
) -> GeometricParameters:
    """Identifiable parameters, and regrouped ones that share corrections with them."""
    candidates = identifiable.candidates
    sigma = standard_deviations(prior, problem_of(candidates, measured))
    sizes = dict(zip(candidates.names, sigma, strict=True))

    def shares(name: str, terms: Mapping[str, float]) -> bool:
        # parameters without a prior, base and tool, take its part at no cost
        costs = (abs(c) * sizes[name] > _SHARED * sizes[other] for other, c in terms.items())
        return bool(np.isfinite(sizes[name])) and (not prior.truncated or any(costs))

    into = identifiable.regrouped_into
    chosen = {*identifiable.names, *(name for name, terms in into.items() if shares(name, terms))}
    return candidates.subset(name for name in candidates.names if name in chosen)


def widened(prior: ParameterPrior, problem: Problem, fit: NonlinearFit) -> ParameterPrior:
    """Prior widened by maximum evidence where the corrections contradict it."""
    # D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4, 1992
    p, size, wider = problem.parameters, fit.prior.sigma / np.sqrt(fit.prior.strength), {}
    for name, is_length in (("length", True), ("angle", False)):
        of_kind = [
            k
            for k, e in enumerate(p.entries)
            if p.is_of_table(e) and e.name not in prior.named and e.element.is_length is is_length
        ]
        determined = 1.0 - np.diagonal(fit.covariance)[of_kind] / size[of_kind] ** 2
        count = max(float(determined.sum()), 1.0)
        ratio = np.sqrt(float(((fit.x[of_kind] / size[of_kind]) ** 2).sum()) / count)
        if ratio > _CONTRADICTED:
            wider[name] = ratio * float(getattr(prior, name))
    return replace(prior, **wider) if wider else prior


def note_of_prior(
    given: ParameterPrior | None, used: ParameterPrior | None, distances: bool
) -> tuple[str, ...]:
    """Note if the prior was widened; ``distances``: whether some are known."""
    if given is None or used is None or given is used:
        return ()
    zeros, lengths = used.angle > _WRONG_ZEROS * given.angle, used.length != given.length
    check = " Check the zeros and signs of the joints." * bool(zeros)
    check += " Check the known distances." * bool(distances and lengths)
    changes = [
        f"of {name}s from {getattr(given, name):.2g} to {getattr(used, name):.2g} {unit}"
        for name, unit in (("length", "m"), ("angle", "rad"))
        if getattr(given, name) != getattr(used, name)
    ]
    return (
        "The corrections are larger than the prior allows, so its standard deviations were "
        f"increased: {' and '.join(changes)}.{check}",
    )
