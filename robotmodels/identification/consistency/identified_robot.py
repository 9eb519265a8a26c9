"""From an identification to a robot of real bodies, by a prior where the torques do not decide."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...errors import InertiaError
from ...inertia import InertialParameters
from ...minimal_parameters import uniform_bodies
from ...minimal_parameters.prior import check_definite
from ...model import RobotModel
from ..methods.estimate import Method, check_values
from ..methods.least_squares import used_weights, weights_of
from ..scale.reduction import reduce_equations

if TYPE_CHECKING:
    from ..result import IdentificationResult
    from .result import ConsistentFit


def consistent_robot(
    result: IdentificationResult, prior: InertialParameters | None = None
) -> ConsistentFit:
    """The robot of real bodies and drives that fits the log of an identification best.

    Parameters
    ----------
    result : IdentificationResult
        Of `fit`.
    prior : InertialParameters, optional
        What decides where the torques do not: of a CAD, or `uniform_bodies`; default what
        `prior_bodies` makes of the model's own inertia.

    Returns
    -------
    ConsistentFit
        With its price in residuals, each joint's weighted by their deviation.

    Raises
    ------
    InertiaError
        A prior that is no set of real bodies; a model without any masses, and no prior.
    InvalidValueError
        The simulated robot ran away: there are no parameters.
    MissingExtraError
        The solver for cones is not installed.

    References
    ----------
    Seed book section 1.6.3.

    Examples
    --------
    >>> import robotmodels as rm
    >>> from robotmodels.identification import Log, fit
    >>> arm, t = rm.load("planar_2r"), np.arange(0.0, 20.0, 0.01)[:, None]
    >>> arm, w = arm.with_inertia(uniform_bodies(arm, 5.0)), np.array([1.0, 1.7])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -w * w * np.sin(w * t)
    >>> result = fit(arm, Log(0.01, q, rm.idm(arm, q, v, a)), drive=False, decimation=1)
    >>> bool(consistent_robot(result).inertia.is_physical.all())
    True
    """
    from .fit_consistent import fit_consistent

    check_values(result.estimate)
    if prior is None:
        prior, _ = prior_bodies(result.model)
    reduction = result.reduction
    if result.names != result.base.names:
        # parameters that were left out as not essential act on the torques of a real robot
        reduction = reduce_equations(result.system.with_names(result.base.names))
    method = result.estimate.method
    if method in (Method.WLS, Method.IRLS):
        weights = used_weights(method, reduction)  # so that without bounds it is the same fit
    else:
        weights = weights_of(result.estimate.sigma, reduction)
    R, y, rest = reduction.stacked(weights)
    return fit_consistent(result.base, R, y, rest=rest, rows=reduction.rows, prior=prior)


def prior_bodies(model: RobotModel) -> tuple[InertialParameters, tuple[str, ...]]:
    """The model's own bodies, with uniform ones where it has none with mass and extent.

    Parameters
    ----------
    model : RobotModel
        The robot.

    Returns
    -------
    bodies : InertialParameters
        Of f real bodies; those that were put in have the model's mass of the link, where it has
        one, else that of a uniform robot of the model's total mass.
    sentences : tuple of str
        Which were put in.

    Raises
    ------
    InertiaError
        The model has no masses at all.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> prior_bodies(load("tx40"))[1]
    ('Link 6 has no extent in the model: a uniform body of 0.2 kg was its prior.',)
    """
    values = np.array(model.inertia.values)
    bad = [j for j in range(model.f) if not _is_body(values[j])]
    if not bad:
        return model.inertia, ()
    total = float(np.maximum(values[:, 9], 0.0).sum())
    if total <= 0.0:
        raise InertiaError(
            f"prior: {model.name!r} has no masses that a robot could be near to. Pass "
            "prior=uniform_bodies(model, mass=...) (--prior MASS), or a CAD model of every link."
        )
    spread = uniform_bodies(model, total).values
    sentences = []
    for j in bad:
        mass = float(values[j, 9])
        kind = "extent" if mass > 0.0 else "mass"
        mass = mass if mass > 0.0 else float(spread[j, 9])
        values[j] = spread[j] * (mass / spread[j, 9])
        sentences.append(
            f"Link {j + 1} has no {kind} in the model: a uniform body of {mass:.3g} kg was its "
            "prior."
        )
    return InertialParameters(values), tuple(sentences)


def _is_body(values: np.ndarray) -> bool:
    try:
        check_definite(InertialParameters(values[None]), "prior")
    except InertiaError:
        return False
    return True
