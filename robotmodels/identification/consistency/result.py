"""A physically consistent fit: the robot, what it costs, and how it is known to be the best."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, sqrt

from ..._arrays import Array, Rebuilt, read_only
from ..._outcomes import Outcome
from ...drive import DriveParameters, Transmission
from ...errors import InvalidValueError
from ...inertia import InertialParameters
from ...model import RobotModel


class ConsistentStatus(Outcome):
    """What became of a physically consistent fit.

    Examples
    --------
    >>> ConsistentStatus.FREE.sentence
    'Real bodies and drives reach the least squares: physical consistency costs nothing.'
    """

    FREE = 0, "Real bodies and drives reach the least squares: physical consistency costs nothing."
    CONSTRAINED = 1, "The best fit that real bodies and drives within the bounds have."
    WEIGHTED = 2, "The best compromise of residuals and distance from the prior, by its weight."
    LOOSE = (
        3,
        (
            "The solver stopped early: the robot is real, but a better fit may exist, by as much "
            "as the gap says."
        ),
    )
    FAILED = 4, "The solver found no robot; the parameters are not to be used."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ConsistentFit(Rebuilt):
    """Standard parameters of real bodies and drives that fit an identification. Read-only.

    Parameters
    ----------
    inertia : InertialParameters
        Of f real bodies.
    drive : DriveParameters
        Of n joints; those of the prior where drives were not among the parameters.
    transmission : Transmission or None
        The model's, with the terms of coupled motors that were found.
    friction : ndarray, shape (k, n), or None
        Parameters of the friction model, where the base parameters have one.
    status : ConsistentStatus
        What was reached.
    names : tuple of str
        The b base parameters.
    base_values : ndarray, shape (b,)
        Those of the robot.
    least_squares : ndarray, shape (b,)
        Those of the unconstrained fit.
    standard_names : tuple of str
        The p standard parameters.
    prior, values : ndarray, shape (p,)
        Of each, the prior and what was found.
    squares, least : float
        Weighted sum of squared residuals of the robot, and of the unconstrained fit.
    rows : int or None
        Number of residuals.
    gap : float
        How much less of ``squares``, as a part of it, another robot could have at most (with
        ``gamma``: of the sum with the weighted distance; without: within twice the distance from
        the prior). Proved by multipliers, without trust in the solver.
    violation : float
        Most by which a constraint is missed, in natural units; rounding.
    clipped : float
        Most that a parameter was moved, in natural units, to take the solver's rounding away: signs
        turned back, known values made exact.
    distance : float
        From the prior: root of the summed squares of the relative changes of the pseudo-inertias,
        ``|P0^-1/2 (P - P0) P0^-1/2|``, and of the drives.
    gamma : float
        Weight of its square beside the squares of the residuals.
    active : tuple of str
        Constraints without room that are left, a sentence each; known values are not listed.
    stopped : str
        Status and iteration count of the solver where it stopped early, and the constraint that is
        worst there; else empty.

    Examples
    --------
    >>> import numpy as np
    >>> from robotmodels.identification.consistency.fit_consistent import fit_consistent
    >>> from robotmodels.robots import load
    >>> from robotmodels.minimal_parameters import base_parameters, uniform_bodies
    >>> arm = load("planar_2r")
    >>> base = base_parameters(arm, drive=False)
    >>> found = fit_consistent(base, np.eye(4), [0.2, -0.1, 0.3, 0.0],
    ...                        prior=uniform_bodies(arm, 5.0))
    >>> "The pseudo-inertia of link 2 is singular to the margin." in found.reason()
    True
    """

    inertia: InertialParameters
    drive: DriveParameters
    transmission: Transmission | None
    friction: Array | None
    status: ConsistentStatus
    names: tuple[str, ...]
    base_values: Array
    least_squares: Array
    standard_names: tuple[str, ...]
    prior: Array
    values: Array
    squares: float
    least: float
    rows: int | None
    gap: float
    violation: float
    clipped: float
    distance: float
    gamma: float
    active: tuple[str, ...]
    stopped: str = ""

    def __post_init__(self) -> None:
        for name in ("friction", "base_values", "least_squares", "prior", "values"):
            if (value := getattr(self, name)) is not None:
                object.__setattr__(self, name, read_only(value))

    def reason(self) -> str:
        """The status in words: how near the best fit is, and which bounds keep it from less.

        Returns
        -------
        str
            Where the solver stopped early, at which iteration and which constraint as well.

        Examples
        --------
        See `ConsistentFit`.
        """
        parts = [self.status.sentence, self.stopped] if self.stopped else [self.status.sentence]
        if self.status is not ConsistentStatus.FREE:
            parts.append(self.optimality)
        return " ".join((*parts, *self.active))

    @property
    def optimality(self) -> str:
        """How near the sum of squares is to the optimum."""
        return f"The sum of squares is within {100.0 * self.gap:.1g} % of the optimum."

    @property
    def price(self) -> float:
        """Percent by which the root of the squares exceeds that of the unconstrained fit."""
        if self.squares <= self.least:
            return 0.0
        return inf if self.least == 0.0 else 100.0 * (sqrt(self.squares / self.least) - 1.0)

    @property
    def rms(self) -> float | None:
        """Root of the mean weighted square of the residuals; None where rows were not given."""
        return None if self.rows is None else sqrt(self.squares / self.rows)

    def of(self, model: RobotModel) -> RobotModel:
        """The model with these parameters, ready for `robotmodels.to_urdf`.

        A URDF holds the bodies, and viscous and Coulomb friction; rotor inertias, torque offsets
        and coupled motors it does not, and `robotmodels.to_urdf` lists them in a warning.

        Parameters
        ----------
        model : RobotModel
            The robot that was identified.

        Returns
        -------
        RobotModel
            With this inertia, these drives and this transmission; parameters of a friction model
            are in ``friction``.

        Raises
        ------
        InvalidValueError
            The solver found no robot.

        Examples
        --------
        >>> import numpy as np
        >>> from robotmodels.identification.consistency.fit_consistent import fit_consistent
        >>> from robotmodels.robots import load
        >>> from robotmodels.minimal_parameters import base_parameters, uniform_bodies
        >>> arm = load("planar_2r")
        >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
        >>> base = base_parameters(arm, drive=False)
        >>> found = fit_consistent(base, np.eye(4), base.values(arm))
        >>> bool(np.allclose(base.values(found.of(arm)), base.values(arm)))
        True
        """
        if self.status is ConsistentStatus.FAILED:
            raise InvalidValueError(
                f"{self.reason()} Ask for a smaller margin, wider bounds or another prior."
            )
        whole = model.with_inertia(self.inertia).with_drive(self.drive)
        return whole.with_transmission(self.transmission)

    def __str__(self) -> str:
        price = "without bound" if self.price == inf else f"{self.price:.3g} %"
        lines = [
            self.status.sentence,
            *([self.stopped] if self.stopped else ()),
            f"Residuals: {price} more than least squares (root of weighted squares "
            f"{sqrt(self.squares):.6g}, unconstrained {sqrt(self.least):.6g}). "
            f"{self.optimality}",
            f"Distance from the prior {self.distance:.4g}"
            + (f", weight {self.gamma:g}." if self.gamma else "."),
        ]
        if self.clipped > 0.0:
            lines.append(
                f"Rounding of the solver was taken away: parameters moved by {self.clipped:.1g}."
            )
        lines += [f"- {sentence}" for sentence in self.active] or ["No constraint is active."]
        width = max(map(len, self.names))
        lines += ["", f"{'base':{width}}  least squares      real robot"]
        lines += [
            f"{name:{width}}  {before:13.6g}  {now:14.6g}"
            for name, before, now in zip(
                self.names, self.least_squares.tolist(), self.base_values.tolist(), strict=True
            )
        ]
        return "\n".join(lines)

    def __repr__(self) -> str:
        return (
            f"<ConsistentFit: {self.inertia.f} links, {self.status.name}, price {self.price:.3g} %,"
            f" {len(self.active)} active constraints>"
        )


def largest_violation(slacks: list[Array]) -> float:
    """Largest violation of the constraints."""
    return max(0.0, -min((float(s.min()) for s in slacks if s.size), default=0.0))
