"""Physically consistent identification (LMI constraints)."""

from __future__ import annotations

import numpy as np

from ..errors import InertiaError
from ..estimation.linear import inverse_std
from ..inertia import InertialParameters
from ..minimal_parameters import StandardParameters, fit_consistent, uniform_bodies
from ..minimal_parameters.bodies import has_extent
from ..model import RobotModel
from .equations import reduce_equations
from .methods.linear import Wls, used_weights
from .result import IdentificationResult, check_result


def consistent_robot(
    result: IdentificationResult, prior: InertialParameters | None = None
) -> StandardParameters:
    """Physically consistent robot with the least residuals on the log of an identification.

    Parameters
    ----------
    result : IdentificationResult
        Result of `fit`.
    prior : InertialParameters, optional
        Decides where the torques do not: of a CAD, or `uniform_bodies`; default the
        model's bodies, with uniform ones for links without mass or extent.

    Returns
    -------
    StandardParameters
        With the increase of the residuals, weighted by each joint's residual standard deviation.

    Raises
    ------
    InertiaError, InvalidValueError, MissingExtraError
        A prior that is not physical, or no masses and no prior; a result without parameters; CVXPY
        or Clarabel is not installed.

    References
    ----------
    Book section 1.6.3.

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> from robotmodels.identification import fit
    >>> result = fit(*example_log(), drive=("Fv",))
    >>> bool(consistent_robot(result).inertia.is_physical.all())
    True
    """
    check_result(result)
    if prior is None:
        prior, _ = prior_bodies(result.model)
    factors = result.factors
    if result.names != result.base.names:
        # dropped parameters have an effect on the torques of a physical robot
        factors = reduce_equations(result.equations.with_names(result.base.names))
    if isinstance(result.method, Wls):
        weights = used_weights(result.method, factors)  # without constraints it is the same fit
    else:
        weights = inverse_std(factors, result.estimate.sigma)
    R, y, rest = factors.stacked(weights)
    return fit_consistent(result.base, R, y, rest=rest, rows=factors.rows, prior=prior)


def prior_bodies(model: RobotModel) -> tuple[InertialParameters, tuple[str, ...]]:
    """Prior bodies of the model, uniform where it has no mass or extent, and notes."""
    values = np.array(model.inertia.values)
    bad = np.flatnonzero(~has_extent(model.inertia))
    if not bad.size:
        return model.inertia, ()
    total = float(np.maximum(values[:, 9], 0.0).sum())
    if total <= 0.0:
        raise InertiaError(
            f"prior: {model.name!r} has no masses. Pass "
            "prior=uniform_bodies(model, mass=...) (--prior MASS), or a CAD model of every link."
        )
    spread = uniform_bodies(model, total).values
    mass = np.where(values[:, 9] > 0.0, values[:, 9], spread[:, 9])
    values[bad] = (spread * (mass / spread[:, 9])[:, None])[bad]
    bodies = ", ".join(f"{j + 1} ({mass[j]:.3g} kg)" for j in bad)
    return InertialParameters(values), (
        f"Without mass or extent in the model, the prior is a uniform body: link {bodies}.",
    )
