"""How large the deviations of a robot are thought to be before anything is measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from .._arrays import Array, Rebuilt, as_reals
from ..errors import InvalidValueError
from ..estimation import Loss, Prior, select_strength
from .dealing import dealt_blocks
from .extended_table.elements import ErrorLaw
from .extended_table.parameters import GeometricParameter, GeometricParameters
from .identifiability.identifiable import IdentifiableParameters, Reason
from .problem import Problem, guessed_fixtures, stacked
from .solve import solve

_FOLDS = 5


@dataclass(frozen=True, slots=True, eq=False)
class ParameterPrior(Rebuilt):
    """Gaussian prior of the deviations, zero in the mean: the fit is the maximum a posteriori.

    Parameters
    ----------
    length, angle : float
        Standard deviation of constant deviations of lengths (m) and angles (rad) of the table;
        infinite where nothing is known. Base and tools have no prior, unless they are named.
    gain, compliance, eccentricity : float, optional
        Of gains and couplings (1, or the ratio of the units), of compliances (rad or m per N m or
        N), and of errors in sine and cosine (rad). By default such an error may move its joint as
        far as a constant one (``angle``, ``length``) at the largest reading or load measured.
    named : mapping of str to float
        Standard deviations of single parameters, before the others.
    strength : float or None
        Factor on the information; None chooses it by cross-validation.
    truncated : bool
        Whether parameters that act like combinations of others stay as they are (the default), or
        share the error with them, each as its standard deviation allows.

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

    length: float = 1e-3
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


def estimated_with(prior: ParameterPrior, found: IdentifiableParameters) -> GeometricParameters:
    """Parameters to estimate with a prior.

    Parameters
    ----------
    prior : ParameterPrior
        What is thought.
    found : IdentifiableParameters
        What the measurements tell.

    Returns
    -------
    GeometricParameters
        Those that are identifiable; and, unless truncated, those that act like combinations of
        them and have a finite prior.
    """
    if prior.truncated:
        return found.kept
    f = found.candidates.model.f
    return found.candidates.subset(
        entry.name
        for entry in found.candidates.entries
        if entry.name in found.names
        or (
            found.reasons.get(entry.name) is Reason.REGROUPED
            and np.isfinite(prior.named.get(entry.name, _size(prior, entry, f, 1.0)))
        )
    )


def settled_prior(
    prior: ParameterPrior, problem: Problem, loss: Loss, rng: np.random.Generator
) -> Prior:
    """The prior of the unknowns of a problem; fixtures have none.

    Parameters
    ----------
    prior : ParameterPrior
        What is thought.
    problem : Problem
        The calibration.
    loss : Loss
        Of the fit.
    rng : numpy.random.Generator
        For the folds that choose the strength.

    Returns
    -------
    Prior
        Of the vector [parameters, fixtures].

    Raises
    ------
    InvalidValueError
        Too few measurements to keep some of them aside.
    """
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
    dealt = np.concatenate(dealt_blocks(problem.measurements, _FOLDS, rng))[block]
    masks = np.array([dealt == k for k in range(_FOLDS) if (dealt == k).any()])
    tried = select_strength(
        lambda x: stacked(problem, x, scales), start, whole_prior, masks,
        strengths=_STRENGTHS, block=block, loss=loss,
    )  # fmt: skip
    return whole_prior.with_strength(tried.strength)


_STRENGTHS = np.logspace(-3.0, 3.0, 13)


def standard_deviations(prior: ParameterPrior, problem: Problem) -> Array:
    """What a prior gives to the P parameters of a problem, shape (P,); infinite for none."""
    parameters = problem.parameters
    f = parameters.model.f
    return np.array([
        prior.named.get(e.name, _size(prior, e, f, size))
        for e, size in zip(parameters.entries, largest_factors(problem), strict=True)
    ])  # fmt: skip


def largest_factors(problem: Problem) -> Array:
    """What each of P parameters is multiplied by at most (1, readings, loads), shape (P,)."""
    largest = np.zeros(problem.P)
    for views in problem.factors:
        for factors in views:
            np.maximum.at(largest, problem.parameters.actions[0], np.abs(factors).max(axis=0))
    return largest


def _size(prior: ParameterPrior, entry: GeometricParameter, f: int, largest: float) -> float:
    constant = prior.length if entry.element.is_length else prior.angle
    if entry.law is ErrorLaw.CONSTANT:
        return constant if 0 < entry.row <= f else np.inf
    given = {ErrorLaw.GAIN: prior.gain, ErrorLaw.COMPLIANCE: prior.compliance}
    size = given.get(entry.law, prior.eccentricity)
    if size is not None:
        return size
    return constant / largest if largest > 0.0 else np.inf
