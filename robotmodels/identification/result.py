"""What an identification gives: parameters with deviations, and what is needed to judge them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Rebuilt
from ..logs import Log
from ..minimal_parameters import BaseParameters
from ..model import RobotModel
from .equations import Equations
from .methods.estimate import Estimate, EstimateStatus, check_values
from .prediction import predicted_torque
from .scale.reduction import Reduction
from .solving import MethodOptions
from .validation import Validation, validate


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class IdentificationResult(Rebuilt):
    """Identified parameters of a robot.

    Parameters
    ----------
    system : Equations
        Robot, base parameters, log and every choice of the processing.
    reduction : Reduction
        The equations in the identified parameters, reduced.
    estimate : Estimate
        Parameters and their covariance, by the method asked for.
    white : ndarray, shape (b,)
        Deviations that would hold if residuals were white: what is usually published.
    lags : int
        Equations over which the covariance takes correlation into account; 0 for none.
    gap : (float, float)
        Smallest part of its own of a column that was kept, and largest of one that was not, on the
        log's own regressor.
    unseen : tuple of str
        Base parameters of the robot that the log does not tell from others.
    not_essential : tuple of str
        Base parameters that were left out since their relative deviations say they are not seen.
    condition, condition_scaled : float
        Of the regressor, as it is and with columns of length one.
    fitted : Validation
        Errors on the log itself.
    held_out : Validation or None
        On the log that was kept aside.
    options : MethodOptions
        What the method was given beyond the equations.
    ramp : ndarray, shape (n,)
        Velocities (rad/s or m/s) over which dry friction rises where torques are predicted.
    essential_rule : str
        By which parameters were left out; empty where all were kept.
    notes : tuple of str
        What is strange, and what to do.

    References
    ----------
    Seed book section 1.6.
    """

    system: Equations
    reduction: Reduction
    estimate: Estimate
    white: Array
    lags: int
    gap: tuple[float, float]
    unseen: tuple[str, ...]
    not_essential: tuple[str, ...]
    condition: float
    condition_scaled: float
    fitted: Validation
    held_out: Validation | None
    options: MethodOptions
    ramp: Array
    essential_rule: str
    notes: tuple[str, ...]

    @property
    def model(self) -> RobotModel:
        """The robot that was given."""
        return self.system.model

    @property
    def base(self) -> BaseParameters:
        """Base parameters that the log tells."""
        return self.system.base

    @property
    def names(self) -> tuple[str, ...]:
        """The b identified parameters."""
        return self.estimate.names

    @property
    def values(self) -> Array:
        """Their values, SI units, shape (b,)."""
        return self.estimate.values

    @property
    def deviations(self) -> Array:
        """Their standard deviations, corrected for correlated residuals, shape (b,)."""
        return self.estimate.deviations

    @property
    def relative_deviations(self) -> Array:
        """Relative to the values, shape (b,)."""
        return self.estimate.relative_deviations

    def value(self, name: str) -> float:
        """Value of one parameter, by its name such as ``"ZZ1"`` or ``"ZZ1R"``.

        Parameters
        ----------
        name : str
            One of `names`.

        Returns
        -------
        float
            SI units.
        """
        return float(self.values[self._number(name)])

    def deviation(self, name: str) -> float:
        """Standard deviation of one parameter.

        Parameters
        ----------
        name : str
            One of `names`.

        Returns
        -------
        float
            SI units.
        """
        return float(self.deviations[self._number(name)])

    def predict(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Torques that the identified robot needs.

        Parameters
        ----------
        q, v, a : array_like, shape (..., n)
            Joint variables (rad or m), velocities and accelerations.

        Returns
        -------
        ndarray, shape (..., n)
            N m or N; dry friction rises linearly over `ramp`.

        Raises
        ------
        InvalidValueError
            The simulated robot ran away: there are no parameters.
        """
        check_values(self.estimate)
        return predicted_torque(self.base, self.names, self.values, q, v, a, self.ramp)

    def validate(self, log: Log) -> Validation:
        """Errors of the predicted torques on another log, processed alike.

        Parameters
        ----------
        log : Log
            Of the same robot.

        Returns
        -------
        Validation
            By joint.

        Raises
        ------
        InvalidValueError
            The simulated robot ran away: there are no parameters.
        """
        check_values(self.estimate)
        return validate(
            self.base, self.names, self.values, log, self.system.processing, ramp=self.ramp
        )

    def report(self) -> str:
        """One page that a person reads: data, choices, parameters, errors, verdict.

        Returns
        -------
        str
            Of at most 100 columns.
        """
        from .reporting.text import report_text

        return report_text(self)

    def whole(self) -> Array:
        """Values of all base parameters, those that are not essential as zero.

        Returns
        -------
        ndarray, shape (len(base),)
            In the order of ``base.names``.
        """
        found = np.zeros(len(self.base))
        place = {name: k for k, name in enumerate(self.base.names)}
        for name, value in zip(self.names, self.values, strict=True):
            found[place[name]] = value
        return found

    def _number(self, name: str) -> int:
        from ..errors import InvalidValueError, nearest_names
        from ..regressors.columns import plain_name

        plain = plain_name(name, self.names)
        if plain not in self.names:
            near = ", ".join(nearest_names(name, self.names)) or "none"
            raise InvalidValueError(
                f"name: {name!r} was not identified; near it: {near}. `names` lists what was, "
                "`unseen` and `not_essential` what was not."
            )
        return self.names.index(plain)

    def __repr__(self) -> str:
        if self.estimate.status is EstimateStatus.UNSTABLE:
            return f"<IdentificationResult of {self.model.name!r}: {self.estimate.status.sentence}>"
        error = 100.0 * float(np.sqrt(np.nanmean(self.fitted.filtered_relative**2)))
        return (
            f"<IdentificationResult of {self.model.name!r}: {len(self.names)} parameters by "
            f"{self.estimate.method.value}, {self.reduction.rows} equations, residual "
            f"{error:.2g} % of the torque>"
        )
