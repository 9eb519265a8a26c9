"""Standard parameters of a physical robot: bodies and drives, their status and their table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, sqrt

import numpy as np

from .._arrays import Array, Frozen, read_only
from ..drive import DriveParameters
from ..dynamics import base_model
from ..errors import InvalidValueError
from ..friction import check_linear
from ..inertia import InertialParameters
from ..model import RobotModel
from ..table_text import boxed
from .physical import PhysicalFit, PhysicalStatus
from .result import BaseParameters

_ZERO = 1e-9
"""Print tolerance of a change, relative to the largest parameter of its kind."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StandardParameters(Frozen):
    """A full set of standard parameters of physical bodies and drives. Read-only.

    Parameters
    ----------
    requested, prior : ndarray, shapes (b,), (p,)
        Base parameters that were given, or those of the fit without constraints; standard
        parameters of the prior.
    drive_prior : DriveParameters
        Drives of the prior, for the kinds that are not among the parameters.
    fit : PhysicalFit
        ``squares`` of the residuals and ``least`` without constraints, both weighted; ``distance``
        from the prior, of the relative changes of pseudo-inertias, ``|P0^-1/2 (P - P0) P0^-1/2|``,
        and of drives; ``gap``: the part of the squares (with ``gamma``: and of the weighted
        distance) by which a robot within twice the distance may be better, by the solver's dual
        value; ``active`` constraints; ``stopped``: the ending of a solver that stopped early.
    rows : int or None
        Number of residuals.
    """

    base: BaseParameters
    requested: Array
    prior: Array
    drive_prior: DriveParameters
    fit: PhysicalFit
    rows: int | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The p standard parameters."""
        return self.base.parameter_names

    @property
    def values(self) -> Array:
        """Standard parameters of the robot, shape (p,)."""
        return self.fit.x

    @property
    def standard_errors(self) -> None:
        """None: an estimate on the boundary of a set has no covariance."""
        return None

    @property
    def base_values(self) -> Array:
        """Base parameters of the robot, shape (b,)."""
        return read_only(self.base.matrix @ self.values)

    @property
    def deviation(self) -> Array:
        """Base parameters of the robot minus those requested, shape (b,)."""
        return self.base_values - self.requested

    @property
    def model(self) -> RobotModel:
        """The robot of the base parameters with these bodies, drives and couplings."""
        p = len(self.values) - (0 if self.friction is None else self.friction.size)
        whole = replace(self.base, friction=None, kept=np.arange(p), matrix=np.eye(p))
        return base_model(self.base.model.with_drive(self.drive_prior), whole, self.values[:p])

    @property
    def inertia(self) -> InertialParameters:
        """Inertial parameters of f physical bodies."""
        return self.model.inertia

    @property
    def drive(self) -> DriveParameters:
        """Drive parameters of n joints; the prior's where not identified."""
        return self.model.drive

    @property
    def friction(self) -> Array | None:
        """Parameters of the friction model, shape (k, n)."""
        if self.base.friction is None:
            return None
        n, model = self.base.model.n, check_linear(self.base.friction)
        return self.values[len(self.values) - n * len(model.kinds) :].reshape(-1, n)

    @property
    def status(self) -> PhysicalStatus:
        """Outcome."""
        return self.fit.status

    @property
    def is_usable(self) -> bool:
        """Whether a physical robot was found."""
        return self.status not in (PhysicalStatus.INFEASIBLE, PhysicalStatus.FAILED)

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on the solver and on the active constraints."""
        return (self.fit.stopped, *self.fit.active) if self.fit.stopped else self.fit.active

    @property
    def distance(self) -> float:
        """Distance from the prior."""
        return self.fit.distance

    @property
    def optimality(self) -> str:
        """Sentence on the gap."""
        # the dual value bounds only at its optimum
        is_early = self.status is PhysicalStatus.INACCURATE
        word = "estimated to be within" if is_early else "within"
        return f"The sum of squares is {word} {100.0 * self.fit.gap:.1g} % of the optimum."

    @property
    def residual_increase(self) -> float:
        """Percent by which the root of the squares exceeds that of the unconstrained fit."""
        squares, least = self.fit.squares, self.fit.least
        if squares <= least:
            return 0.0
        return inf if least == 0.0 else 100.0 * (sqrt(squares / least) - 1.0)

    @property
    def rms(self) -> float | None:
        """Root of the mean weighted square of the residuals; None where rows were not given."""
        return None if self.rows is None else sqrt(self.fit.squares / self.rows)

    def reason(self) -> str:
        """The status in words, with the gap, the solver's ending and the active constraints."""
        parts = [self.status.sentence]
        if self.is_usable and self.status is not PhysicalStatus.EXACT:
            parts.append(self.optimality)
        return " ".join((*parts, *self.notes))

    def of(self, model: RobotModel) -> RobotModel:
        """The model with these bodies and drives, ready for `robotmodels.to_urdf`.

        A URDF has no place for rotor inertias, torque offsets and coupled motors: a warning lists
        them. Raises where no physical robot was found.
        """
        if not self.is_usable:
            raise InvalidValueError(
                f"{self.reason()} Use a smaller margin, wider bounds or another prior."
            )
        robot = self.model
        model = model.with_inertia(robot.inertia).with_drive(robot.drive)
        return model.with_transmission(robot.transmission)

    def __str__(self) -> str:
        sizes = np.maximum(np.abs(self.prior), np.abs(self.values))
        small = _ZERO * largest_of_kind(self.names, sizes)
        change = self.values - self.prior
        columns = [("parameter", list(self.names))]
        for title, numbers in (("prior", self.prior), ("value", self.values)):
            columns.append((title, [f"{x:.6g}" for x in np.where(sizes > small, numbers, 0.0)]))
        changes = [f"{x:+.3g}" if x else "0" for x in np.where(np.abs(change) > small, change, 0.0)]
        worst = float(abs(self.deviation).max(initial=0.0))
        return (
            f"{self.reason()}\nResiduals: {self.residual_increase:.3g} % above least squares; "
            f"largest deviation of a base parameter {worst:.2e}; distance from the prior "
            f"{self.distance:.3g}.\n{boxed([*columns, ('difference', changes)])}\n"
            "SI units: XX to ZZ kg m^2, MX to MZ kg m, M kg; drives as in their tables."
        )

    def __repr__(self) -> str:
        return (
            f"<StandardParameters: {self.base.model.f} links, {len(self.names)} parameters, "
            f"{self.status.name}, distance {self.distance:.3g}, residuals "
            f"+{self.residual_increase:.3g} %>"
        )


def largest_of_kind(names: Sequence[str], sizes: Array) -> Array:
    """Largest size of the parameters that begin with the same letter. Shapes: (p,) -> (p,)."""
    kinds = np.array([name[:1] for name in names])
    return np.array([sizes[kinds == kind].max() for kind in kinds.tolist()])
