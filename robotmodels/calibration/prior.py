"""How large the deviations of a robot are thought to be before anything is measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from .._arrays import Rebuilt, as_reals
from ..errors import InvalidValueError
from ..estimation import Loss, Prior
from .elements import ErrorLaw
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
    law : float
        Of the parameters that depend on the configuration, in their own units.
    named : mapping of str to float
        Standard deviations of single parameters, before the others.
    strength : float or None
        Factor on the information; None chooses it by cross-validation.

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
    law: float = np.inf
    named: Mapping[str, float] = field(default_factory=dict)
    strength: float | None = 1.0

    def __post_init__(self) -> None:
        sizes = {"length": self.length, "angle": self.angle, "law": self.law, **self.named}
        for name, value in sizes.items():
            if not float(as_reals(value, name)) > 0.0:
                raise InvalidValueError(
                    f"{name}: expected a positive standard deviation, or infinity for none, got "
                    f"{value!r}. Name what is known exactly in known=(...)."
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
        A name that is no parameter of the problem.
    """
    entries = problem.parameters.entries
    at = dict(
        zip(prior.named, problem.parameters.index(prior.named, "prior").tolist(), strict=True)
    )
    size = np.array([
        np.inf if e.row == 0 or e.row > problem.parameters.model.f
        else prior.law if e.law is not ErrorLaw.CONSTANT
        else prior.length if e.element.is_length else prior.angle
        for e in entries
    ])  # fmt: skip
    for name, k in at.items():
        size[k] = prior.named[name]
    whole = np.concatenate([size, np.full(problem.F, np.inf)])
    mean = np.zeros(len(whole))
    if prior.strength is not None:
        return Prior(mean, whole, prior.strength)
    scales = solve(problem, loss=loss).scales
    start = np.concatenate([mean[: problem.P], guessed_fixtures(problem, mean[: problem.P])])
    strength = prior_strength(
        lambda x: stacked(problem, x, scales), start, Prior(mean, whole), block=problem.block,
        loss=loss, folds=_FOLDS, rng=rng,
    )  # fmt: skip
    return Prior(mean, whole, strength)
