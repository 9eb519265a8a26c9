"""Standard parameters of a physical robot: bodies and drives, their status and their table."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from .._arrays import Array, Rebuilt, read_only
from ..drive import DriveKind, DriveParameters, Transmission, drive_kinds
from ..errors import InvalidValueError
from ..inertia import InertialParameters
from ..model import RobotModel
from ..table_text import boxed
from .constraints import parameter_kinds
from .physical import PhysicalFit, PhysicalStatus
from .result import BaseParameters

_ZERO = 1e-9
"""Print tolerance of a change, relative to the largest parameter of its kind."""


class RobotParts(NamedTuple):
    """Parts of a robot described by a vector of standard parameters. Shapes: friction (k, n)."""

    inertia: InertialParameters
    drive: DriveParameters
    transmission: Transmission | None
    friction: Array | None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StandardParameters(Rebuilt):
    """A full set of standard parameters of physical bodies and drives. Read-only.

    Parameters
    ----------
    base : BaseParameters
        The b base parameters and p standard parameters.
    requested : ndarray, shape (b,)
        Base parameters that were given, or those of the fit without constraints.
    prior : ndarray, shape (p,)
        Standard parameters of the prior.
    drive_prior : DriveParameters
        Drives of the prior, for the kinds that are not among the parameters.
    fit : PhysicalFit
        ``squares`` of the residuals and ``least`` without constraints, both weighted; ``distance``
        from the prior, the root of the summed squares of the relative changes of the
        pseudo-inertias, ``|P0^-1/2 (P - P0) P0^-1/2|``, and of the drives; ``gap``, by the solver's
        dual value: the part of the squares by which a robot within twice the distance may be better
        (with ``gamma``: of the sum with the weighted distance); ``active`` constraints, a sentence
        each; ``stopped``: the ending of a solver that stopped early.
    rows : int or None
        Number of residuals.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.minimal_parameters import base_parameters, fit_consistent, uniform_bodies
    >>> arm = load("planar_2r")
    >>> base = base_parameters(arm, drive=False)
    >>> robot = fit_consistent(base, np.eye(4), [0.2, -0.1, 0.3, 0.0],
    ...                        prior=uniform_bodies(arm, 5.0))
    >>> "The pseudo-inertia of link 2 is singular to the margin." in robot.reason()
    True
    """

    base: BaseParameters
    requested: Array
    prior: Array
    drive_prior: DriveParameters
    fit: PhysicalFit
    rows: int | None = None

    def __post_init__(self) -> None:
        for name in ("requested", "prior"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        object.__setattr__(self, "fit", self.fit._replace(x=read_only(self.fit.x)))

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
    def parts(self) -> RobotParts:
        """Inertia, drive, transmission and friction of the robot."""
        return robot_parts(self.base, self.values, self.drive_prior)

    @property
    def inertia(self) -> InertialParameters:
        """Inertial parameters of f physical bodies."""
        return self.parts.inertia

    @property
    def drive(self) -> DriveParameters:
        """Drive parameters of n joints; the prior's where not identified."""
        return self.parts.drive

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
        return f"The sum of squares is within {100.0 * self.fit.gap:.1g} % of the optimum."

    @property
    def price(self) -> float:
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
        inertia, drive, transmission, _ = self.parts
        return model.with_inertia(inertia).with_drive(drive).with_transmission(transmission)

    def __str__(self) -> str:
        price = "without bound" if self.price == inf else f"{self.price:.3g} %"
        worst = float(abs(self.deviation).max(initial=0.0))
        lines = [
            f"{self.status.sentence} {self.fit.stopped}".strip(),
            f"Residuals: {price} above least squares (root of weighted squares "
            f"{sqrt(self.fit.squares):.6g}, unconstrained {sqrt(self.fit.least):.6g}). "
            f"{self.optimality}",
            f"Largest deviation of a base parameter {worst:.2e}, distance from the prior "
            f"{self.distance:.3g}.",
            *(f"- {sentence}" for sentence in self.fit.active),
            boxed(self._columns()),
            "SI units: XX to ZZ kg m^2, MX to MZ kg m, M kg; drives as in their tables.",
        ]
        return "\n".join(lines)

    def _columns(self) -> list[tuple[str, list[str]]]:
        """Columns of the table: part, parameter, prior, value and difference."""
        links = zip(range(1, self.inertia.f + 1), self.inertia.is_physical, strict=True)
        parts = [f"link {j}: {'' if good else 'not '}physical" for j, good in links]
        part = [parts[k // 10] if k % 10 == 0 else "" for k in range(10 * len(parts))]
        part += ["drives", *[""] * len(self.names)]
        sizes = _sizes(self).tolist()
        columns = [("", part[: len(self.names)]), ("parameter", list(self.names))]
        for title, numbers, form in (
            ("prior", self.prior, ".6g"),
            ("value", self.values, ".6g"),
            ("difference", self.values - self.prior, "+.3g"),
        ):
            pairs = zip(numbers.tolist(), sizes, strict=True)
            texts = ["0" if abs(x) <= _ZERO * size else f"{x:{form}}" for x, size in pairs]
            columns.append((title, texts))
        return columns

    def __repr__(self) -> str:
        return (
            f"<StandardParameters: {self.inertia.f} links, {len(self.names)} parameters, "
            f"{self.status.name}, distance {self.distance:.3g}, residuals +{self.price:.3g} %>"
        )


def robot_parts(base: BaseParameters, x: Array, drives: DriveParameters) -> RobotParts:
    """Inertia, drives, transmission and friction of standard parameters. Shapes: x (p,)."""
    f, n = base.model.f, base.model.n
    transmission = base.model.transmission
    kinds = drive_kinds(base.drive)
    end = 10 * f + n * len(kinds)
    values = dict(zip((k.value for k in kinds), x[10 * f : end].reshape(-1, n), strict=True))
    rest = {kind.value: getattr(drives, kind.value) for kind in DriveKind}
    drives = DriveParameters(**{**rest, **values})
    if transmission is not None and transmission.coupled_motors:
        motors = np.array(transmission.coupled_motors) - 1
        terms = {
            k.coupling: getattr(transmission, k.coupling).copy() for k in DriveKind if k.coupling
        }
        for kind in kinds:
            if kind.coupling is not None:
                terms[kind.coupling][motors] = x[end : end + len(motors)]
                end += len(motors)
        transmission = Transmission(transmission.matrix, transmission.offset, **terms)
    friction = None if base.friction is None else x[end:].reshape(-1, n)
    return RobotParts(
        InertialParameters(x[: 10 * f].reshape(f, 10)), drives, transmission, friction
    )


def _sizes(robot: StandardParameters) -> Array:
    """Largest parameter of the kind of each: inertias, first moments, masses, ... Shapes: (p,)."""
    inertias = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "Ia")
    kinds = parameter_kinds(robot.base)
    kinds = np.where(np.isin(kinds, inertias), "J", kinds)
    kinds = np.where(np.isin(kinds, ("MX", "MY", "MZ")), "MS", kinds)
    sizes = np.maximum(np.abs(robot.prior), np.abs(robot.values))
    return np.array([sizes[kinds == kind].max() for kind in kinds.tolist()])
