"""Result of a calibration: corrections, standard errors, validation, and the robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError, nearest_names
from ..estimation import FitStatus
from ..estimation.estimate import NamedValues
from ..model import RobotModel
from .identifiable import IdentifiableParameters
from .other_tool import PredictedError, other_tool_error
from .parameters import GeometricParameters
from .robot import CalibratedRobot, calibrated_model
from .solve import Solution
from .validation import Validation

_BY_PRIOR = 0.7
"""Standard error relative to the prior's from which a parameter is determined mainly by it."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CalibrationResult(NamedValues):
    """Result of a calibration: the calibrated robot, standard errors and validation.

    Parameters
    ----------
    nominal : RobotModel
        The robot as given.
    known : tuple of str
        Parameters that were fixed by the caller.
    identifiable, identifiable_after : IdentifiableParameters
        Identifiable parameters at the nominal robot and at the solution.
    solution : Solution
        The fit: parameters, fixtures, covariance, weights, noise.
    validation : Validation
        Errors: ``nominal`` (base and tool alone fitted), ``in_sample``, ``folds``, ``held_out``
        (None without them), ``given``; each with ``.mean, .rms, .max`` by unit, ``rms["m"]``.
    notes : tuple of str
        Findings and advice.

    References
    ----------
    Book section 1.4.
    """

    nominal: RobotModel
    known: tuple[str, ...]
    identifiable: IdentifiableParameters
    identifiable_after: IdentifiableParameters
    solution: Solution
    validation: Validation
    notes: tuple[str, ...]

    @property
    def parameters(self) -> GeometricParameters:
        """The estimated parameters."""
        return self.solution.problem.parameters

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the P estimated parameters."""
        return self.parameters.names

    @property
    def units(self) -> tuple[str, ...]:
        """Their units."""
        return self.parameters.units

    @property
    def corrections(self) -> Array:
        """Corrections of the values at the start of the fit, shape (P,)."""
        return self.solution.corrections

    @property
    def values(self) -> Array:
        """Calibrated values: of the table's columns, base and tool; shape (P,)."""
        return self.parameters.nominal + self.corrections

    @property
    def covariance(self) -> Array:
        """Covariance of the values, shape (P, P)."""
        P = len(self.parameters)
        return self.solution.fit.covariance[:P, :P]

    @property
    def relative_errors(self) -> Array:
        """Standard errors relative to the corrections, shape (P,); inf where these are zero."""
        size = np.abs(self.corrections)
        return np.divide(
            self.standard_errors, size, out=np.full(len(size), np.inf), where=size > 0.0
        )

    @property
    def fixtures(self) -> dict[str, float]:
        """Estimated points, planes and targets, by name, m or rad."""
        return self.solution.fixture_values

    @property
    def status(self) -> FitStatus:
        """Outcome of the fit."""
        return self.solution.fit.status

    def _number(self, name: str) -> int:
        if name not in self.names:
            near = ", ".join(nearest_names(name, self.names)) or "none"
            raise InvalidValueError(
                f"name: {name!r} was not estimated; near it: {near}. `names` lists the estimated "
                "parameters, `identifiable.reasons` why others were not."
            )
        return self.names.index(name)

    @property
    def robot(self) -> CalibratedRobot:
        """The calibrated robot, with its configuration-dependent errors."""
        return calibrated_model(self.parameters, self.corrections)

    @property
    def model(self) -> RobotModel:
        """The calibrated model: table with beta, base, tool, transmission."""
        return self.robot.model

    @property
    def other_tool(self) -> PredictedError:
        """Predicted error of another tool in the measured postures, see `other_tool_error`."""
        return other_tool_error(self)

    @property
    def held_by_prior(self) -> tuple[str, ...]:
        """Parameters that are determined mainly by the prior."""
        sigma = self.solution.fit.prior.sigma[: len(self.names)]
        held = ~(self.standard_errors < _BY_PRIOR * sigma)
        return tuple(np.array(self.names, dtype=object)[held])

    @property
    def measured_mask(self) -> tuple[int, ...]:
        """Components x y z rx ry rz that were measured."""
        units = {unit for m in self.solution.problem.measurements for unit in m.units}
        return (int("m" in units),) * 3 + (int("rad" in units),) * 3

    def __repr__(self) -> str:
        before, after = self.validation.nominal.rms, self.validation.in_sample.rms
        words = {"m": "position", "rad": "angle"}
        errors = [
            f"rms {words[unit]} error {before[unit]:.4g} -> {rms:.4g} {unit}"
            for unit, rms in after.items()
        ]
        return (
            f"<CalibrationResult of {self.nominal.name}: {len(self.names)} parameters, "
            f"{self.status.name.lower()}, {', '.join(errors)}; another tool about "
            f"{self.other_tool.rms:.2g} m; see report(result)>"
        )
