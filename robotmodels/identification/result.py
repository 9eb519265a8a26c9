"""Result of an identification: parameters, standard errors and their validation."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Frozen
from ..errors import InertiaError, InvalidValueError
from ..estimation.estimate import Estimate, EstimateStatus, NamedValues
from ..estimation.factor import TriangularFactors
from ..estimation.linear import inverse_std
from ..inertia import InertialParameters
from ..logs import Log
from ..logs.log import check_is_log
from ..minimal_parameters import StandardParameters, fit_consistent, uniform_bodies
from ..minimal_parameters.bodies import has_extent
from ..model import RobotModel
from .equations import Equations, reduce_equations
from .methods.base import Method, check_solved
from .methods.linear import Wls, used_weights
from .validation import Errors, Validation, parameter_torque, prediction_errors


@dataclass(frozen=True, slots=True, eq=False)
class FitDetails(Frozen):
    """Facts about the equations and the covariance of an identification. Read-only.

    Shapes: iid_standard_errors (b,) for white residuals; friction_ramp (n,), rad/s or m/s, within
    which dry friction is linear. Rank gap: least kept and largest dropped part.
    """

    iid_standard_errors: Array
    correlation_lags: int
    rank_gap: tuple[float, float]
    unidentifiable: tuple[str, ...]
    dropped: tuple[str, ...]
    essential_rule: str
    friction_ramp: Array


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class IdentificationResult(NamedValues):
    """Identified parameters of a robot.

    Parameters
    ----------
    equations, factors
        Robot, base parameters, log and processing; triangular factors of these equations.
    method, estimate
        The method with its options; parameters and their covariance.
    validation, details, notes
        Errors of the predicted torques; facts about the equations; findings and advice.
    """

    equations: Equations
    factors: TriangularFactors
    method: Method
    estimate: Estimate
    validation: Validation
    details: FitDetails
    notes: tuple[str, ...]

    model = property(attrgetter("equations.model"), doc="The given robot.")
    base = property(attrgetter("equations.base"), doc="Base parameters, unidentifiable regrouped.")
    names = property(attrgetter("estimate.names"), doc="The b identified parameters.")  # type: ignore[assignment]
    values = property(attrgetter("estimate.values"), doc="SI units, shape (b,).")  # type: ignore[assignment]
    covariance = property(attrgetter("estimate.covariance"), doc="Shape (b, b).")  # type: ignore[assignment]
    status = property(attrgetter("estimate.status"), doc="`EstimateStatus`.")  # type: ignore[assignment]

    @property
    def base_values(self) -> Array:
        """Values of all base parameters, dropped ones zero, shape (len(base),)."""
        known = dict(zip(self.names, self.values.tolist(), strict=True))
        return np.array([known.get(name, 0.0) for name in self.base.names])

    @property
    def condition(self) -> float:
        """Condition number of the regressor."""
        return float(np.linalg.cond(self.factors.stacked()[0]))

    @property
    def scaled_condition(self) -> float:
        """Condition number of the regressor with columns of length one."""
        R, _, _ = self.factors.stacked()
        return float(np.linalg.cond(R / np.linalg.norm(R, axis=0)))

    def __repr__(self) -> str:
        if self.status is EstimateStatus.UNSTABLE:
            return f"<IdentificationResult of {self.model.name!r}: {self.reason()}>"
        relative = self.validation.in_sample.filtered_relative
        return (
            f"<IdentificationResult of {self.model.name!r}: {len(self.names)} parameters by "
            f"{self.method.title}, {self.factors.rows} equations, residual "
            f"{100.0 * float(np.sqrt(np.nanmean(relative**2))):.2g} % of the torque>"
        )


def check_result(result: IdentificationResult, solved: bool = True) -> None:
    """Raise unless it is a result of `fit`, with parameters."""
    if not isinstance(result, IdentificationResult):
        raise InvalidValueError(
            "result: expected an IdentificationResult of identification.fit, got "
            f"{type(result).__name__}."
        )
    if solved:
        check_solved(result.estimate)


def predicted_torque(
    result: IdentificationResult, q: ArrayLike, v: ArrayLike, a: ArrayLike
) -> Array:
    """Torques predicted by the identified parameters (inverse dynamics).

    Parameters
    ----------
    result : IdentificationResult
        Result of `fit`.
    q, v, a : array_like, shape (..., n)
        Joint variables (rad or m), velocities and accelerations.

    Returns
    -------
    ndarray, shape (..., n)
        N m or N. Near zero velocity dry friction is linear, within `FitDetails.friction_ramp`.

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> from robotmodels.identification import fit
    >>> result = fit(*example_log(), drive=("Fv",))
    >>> predicted_torque(result, [0.0, 0.0], [1.0, 0.0], [0.0, 0.0]).round(2)
    array([46.74, 10.11])
    """
    check_result(result)
    ramp = result.details.friction_ramp
    return parameter_torque(result.base, result.names, result.values, q, v, a, ramp)


def validate(result: IdentificationResult, log: Log) -> Errors:
    """Errors of the predicted torques on another log of the robot, with the same processing.

    Parameters
    ----------
    result : IdentificationResult
        Result of `fit`.
    log : Log
        Log that was not fitted.

    Returns
    -------
    Errors
        Errors by joint.

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> from robotmodels.identification import fit
    >>> arm, log = example_log()
    >>> result = fit(arm, log.rows(0, 2500), drive=("Fv",))
    >>> bool((validate(result, log.rows(2500, 4000)).relative < 1e-2).all())
    True
    """
    check_result(result)
    check_is_log(log)
    other = result.equations.with_log(log)
    return prediction_errors(other, result.values, result.details.friction_ramp)[0]


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
