"""What a calibration gives: values with deviations, errors before and after, and the robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import Array, Rebuilt
from ..estimation import FitStatus
from ..model import RobotModel
from .errors_seen import BlockErrors
from .folds import AsideErrors, fixtures_by_name
from .identifiable import IdentifiableParameters
from .other_tool import PredictedError, other_tool_error
from .parameters import GeometricParameters
from .robot import CalibratedRobot, calibrated_model
from .solve import Solution

_SAYS_LITTLE = 0.7
"""Standard error relative to the prior's from which a parameter is determined mainly by the prior.
"""


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationResult(Rebuilt):
    """A calibrated robot, and what is needed to judge it.

    Parameters
    ----------
    nominal : RobotModel
        The robot as it was given.
    known : tuple of str
        Parameters that were told to stay as they are.
    identifiable, again : IdentifiableParameters
        What the measurements tell, judged at the nominal robot and at the solution.
    solution : Solution
        The fit: parameters, fixtures, covariance, weights, noise.
    given, before, after : BlockErrors
        Of all measurements: the robot as it was given, with base and tool alone fitted (where they
        may be off: what is left is what the table is to blame for), and the calibrated one; each
        with the fixtures that suit it.
    cross_validation, held_out : AsideErrors or None
        Errors on data that did not take part.
    notes : tuple of str
        What is strange, and what to do.

    References
    ----------
    Seed book section 1.4.
    """

    nominal: RobotModel
    known: tuple[str, ...]
    identifiable: IdentifiableParameters
    again: IdentifiableParameters
    solution: Solution
    given: BlockErrors
    before: BlockErrors
    after: BlockErrors
    cross_validation: AsideErrors | None
    held_out: AsideErrors | None
    notes: tuple[str, ...]

    @property
    def parameters(self) -> GeometricParameters:
        """The parameters that were estimated."""
        return self.solution.problem.parameters

    @property
    def names(self) -> tuple[str, ...]:
        """Their names, shape (P,)."""
        return self.parameters.names

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the deviations."""
        return self.parameters.units

    @property
    def deviation(self) -> Array:
        """What is added to the values at the start of the fit, shape (P,)."""
        return self.solution.deviation

    @property
    def values(self) -> Array:
        """Calibrated values: of the table's columns, base and tool; shape (P,)."""
        return self.parameters.nominal + self.deviation

    @property
    def covariance(self) -> Array:
        """Of the deviations, shape (P, P)."""
        P = len(self.parameters)
        return self.solution.fit.covariance[:P, :P]

    @property
    def standard_deviation(self) -> Array:
        """Of the deviations, shape (P,)."""
        return np.sqrt(np.diagonal(self.covariance))

    @property
    def relative_deviation(self) -> Array:
        """Standard deviation over the size of the deviation, shape (P,); inf where it is zero."""
        size = np.abs(self.deviation)
        return np.divide(
            self.standard_deviation, size, out=np.full(len(size), np.inf), where=size > 0.0
        )

    @property
    def correlation(self) -> Array:
        """Correlations of the deviations, shape (P, P)."""
        s = self.standard_deviation
        return self.covariance / np.outer(s, s)

    @property
    def fixtures(self) -> dict[str, float]:
        """Estimated points, planes and targets, by name, m or rad."""
        return fixtures_by_name(self.solution)

    @property
    def status(self) -> FitStatus:
        """How the fit ended; its sentence says it."""
        return self.solution.fit.status

    @property
    def robot(self) -> CalibratedRobot:
        """The calibrated robot, with what a table cannot hold."""
        return calibrated_model(self.parameters, self.deviation)

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
        """Parameters that the measurements say little of: they stay near where they were."""
        told = (
            self.standard_deviation
            < _SAYS_LITTLE * self.solution.fit.prior.sigma[: len(self.names)]
        )
        return tuple(name for name, is_told in zip(self.names, told, strict=True) if not is_told)

    @property
    def measured_mask(self) -> tuple[int, ...]:
        """Components x y z rx ry rz that the measurements have seen."""
        units = {unit for m in self.solution.problem.measurements for unit in m.units}
        return (int("m" in units),) * 3 + (int("rad" in units),) * 3

    def __repr__(self) -> str:
        """The headline of the report: a result holds too much to be listed."""
        errors = [
            f"rms {word} error {self.before.summary(unit).rms:.4g} -> "
            f"{self.after.summary(unit).rms:.4g} {unit}"
            for unit, word in (("m", "position"), ("rad", "angle"))
            if self.after.summary(unit).blocks
        ]
        return (
            f"<CalibrationResult of {self.nominal.name}: {len(self.names)} parameters, "
            f"{self.status.name.lower()}, {', '.join(errors)}; another tool about "
            f"{self.other_tool.rms:.2g} m; see .report()>"
        )

    def report(self) -> str:
        """All of it as text."""
        from .reporting.text import report_text

        return report_text(self)
