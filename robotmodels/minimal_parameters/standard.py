"""From base parameters back to a robot: standard parameters nearest to a prior, of real bodies."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Rebuilt, as_core, as_exact, read_only
from ..drive import DriveParameters, Transmission
from ..errors import InvalidValueError, ShapeError
from ..estimation.conic import ConeOutcome
from ..inertia import InertialParameters
from ..model import RobotModel
from .cone import ConeProblem
from .prior import check_definite
from .result import BaseParameters
from .robot_parts import robot_parts, standard_vector
from .standard_table import standard_text

MARGIN = 1e-3
"""Smallest eigenvalue of a link's pseudo-inertia, relative to the prior's."""
_KEPT = 1e-9
"""Deviation relative to the largest base parameter that counts as none."""
_SAME = 1e-14
"""The same, of a prior that has the base parameters already."""


class PhysicalStatus(Enum):
    """What became of the search for a robot with given base parameters.

    Examples
    --------
    >>> PhysicalStatus.EXACT.value
    'The robot has exactly these base parameters.'
    """

    EXACT = "The robot has exactly these base parameters."
    NEAREST = (
        "No real bodies and drives, with the margin asked for, have these base parameters; the "
        "robot has the nearest that some have."
    )
    NOT_CONVERGED = "The solver did not converge; the parameters are not to be used."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StandardParameters(Rebuilt):
    """A full set of standard parameters with given base parameters. Read-only.

    Parameters
    ----------
    inertia : InertialParameters
        Of f real bodies, unless the status says otherwise.
    drive : DriveParameters
        Of n joints; those of the model where drives were not among the base parameters.
    transmission : Transmission or None
        The model's, with the inertia and friction of coupled motors that were found.
    status : PhysicalStatus
        Whether the base parameters were kept.
    deviation : ndarray, shape (b,)
        Base parameters of the robot less those that were given; zero to rounding if kept.
    distance : float
        Distance from the prior: root of the summed squares of the relative changes of the
        pseudo-inertias, ``|P0^-1/2 (P - P0) P0^-1/2|``, and of the drives.
    names : tuple of str
        The p standard parameters.
    prior, values : ndarray, shape (p,)
        Of each, what it was near to and what was found; prints as a table.
    friction : ndarray, shape (k, n), or None
        Parameters of the friction model, where the base parameters have one.

    Examples
    --------
    >>> StandardParameters.__slots__[:2]
    ('inertia', 'drive')
    """

    inertia: InertialParameters
    drive: DriveParameters
    transmission: Transmission | None
    status: PhysicalStatus
    deviation: Array
    distance: float
    names: tuple[str, ...]
    prior: Array
    values: Array
    friction: Array | None = None

    def __post_init__(self) -> None:
        for name in ("deviation", "prior", "values", "friction"):
            if (value := getattr(self, name)) is not None:
                object.__setattr__(self, name, read_only(value))

    def __str__(self) -> str:
        return standard_text(self)

    def __repr__(self) -> str:
        return (
            f"<StandardParameters: {self.inertia.f} links, {len(self.names)} parameters, "
            f"{self.status.name}, distance {self.distance:.3g}>"
        )

    def of(self, model: RobotModel) -> RobotModel:
        """The model with these parameters, ready for `robotmodels.to_urdf`.

        Parameters
        ----------
        model : RobotModel
            The robot the base parameters belong to.

        Returns
        -------
        RobotModel
            With this inertia and these drives.

        Raises
        ------
        InvalidValueError
            The solver did not converge.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> from robotmodels.minimal_parameters import base_parameters, standard_parameters
        >>> from robotmodels.minimal_parameters import uniform_bodies
        >>> arm = load("planar_2r")
        >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
        >>> base = base_parameters(arm, drive=False)
        >>> again = standard_parameters(base, base.values(arm), prior=uniform_bodies(arm, 8.0))
        >>> bool(np.allclose(base.values(again.of(arm)), base.values(arm)))
        True
        """
        if self.status is PhysicalStatus.NOT_CONVERGED:
            raise InvalidValueError(self.status.value)
        whole = model.with_inertia(self.inertia).with_drive(self.drive)
        return whole.with_transmission(self.transmission)


def standard_parameters(
    base: BaseParameters,
    values: ArrayLike,
    prior: InertialParameters | None = None,
    drive_prior: DriveParameters | None = None,
    weights: ArrayLike | None = None,
    margin: float = MARGIN,
) -> StandardParameters:
    """Standard parameters nearest to a prior that give these base parameters, of real bodies.

    What no torque shows is taken from the prior, never from zeros: the result is the robot nearest
    to it among all with positive definite pseudo-inertias, and rotor inertias and frictions that
    are not negative, those of coupled motors together: the matrices of ``Ia`` with ``Iam`` and of
    ``Fv`` with ``Fvm`` are positive semidefinite. A prior that has the base parameters and is such
    a robot is returned as it is. If no such robot has the given base parameters, the nearest base
    parameters that one has are taken, and the status and the deviation say so.

    Parameters
    ----------
    base : BaseParameters
        Which b parameters are kept.
    values : array_like, shape (b,)
        Their values, such as identified ones.
    prior : InertialParameters, optional
        Bodies with mass and extent, such as a CAD model or `uniform_bodies`; default the model's.
    drive_prior : DriveParameters, optional
        Default the model's.
    weights : array_like, shape (k, b), optional
        What "nearest base parameters" means: the norm of ``weights @ (b - values)``; the triangular
        factor of the regressor for the nearest torques. Default relative to the values.
    margin : float
        Smallest eigenvalue of each pseudo-inertia, relative to the prior's.

    Returns
    -------
    StandardParameters
        Inertia and drives, with a status.

    Raises
    ------
    InertiaError
        A prior that is not physical: which link, and what is wrong with it.
    ShapeError, InvalidValueError
        Values or weights of the wrong shape, NaN, or a margin that is not in (0, 1).
    MissingExtraError
        The solver for cones is not installed.

    References
    ----------
    P. Wensing, S. Kim and J.-J. Slotine, "Linear matrix inequalities for physically consistent
    inertial parameter identification", IEEE RA-L 3(1), 2018; T. Lee, P. Wensing and F. Park,
    "Geometric robot dynamic identification", IEEE T-RO 36(2), 2020 (the distance).

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.minimal_parameters import base_parameters, uniform_bodies
    >>> arm = load("lab_rr")
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> base = base_parameters(arm)
    >>> found = standard_parameters(base, base.values(arm))
    >>> found.status.name, round(found.distance, 6)
    ('EXACT', 0.0)
    """
    model = base.model
    b = as_exact(values, (len(base),), "values")
    if not 0.0 < margin < 1.0:
        raise InvalidValueError(f"margin: expected a number between 0 and 1, got {margin}.")
    bodies = model.inertia if prior is None else prior
    if bodies.f != model.f:
        raise InvalidValueError(f"prior: expected {model.f} links, got {bodies.f}.")
    drives = model.drive if drive_prior is None else drive_prior
    if drives.n != model.n:
        raise InvalidValueError(f"drive_prior: expected {model.n} joints, got {drives.n}.")
    P0 = check_definite(bodies, "prior", model.table.names)
    W = _relative(base, b) if weights is None else as_core(weights, (len(base),), "weights")
    if W.ndim != 2:
        raise ShapeError(f"weights: expected shape (k, {len(base)}), got {W.shape}.")
    problem = ConeProblem(base, standard_vector(base, bodies, drives), P0, margin)
    if _is_same(base.matrix @ problem.prior - b, b) and problem.is_met(problem.prior):
        return _result(base, b, problem.prior, drives, PhysicalStatus.EXACT, problem)
    x, outcome = problem.nearest_to_prior(b)
    if outcome is ConeOutcome.SOLVED:
        found = _result(base, b, x, drives, PhysicalStatus.EXACT, problem)
        if _is_kept(found.deviation, b):
            return found
    x, solved = problem.nearest_base(W, b)
    status = PhysicalStatus.NEAREST
    if solved is not ConeOutcome.SOLVED:
        status = PhysicalStatus.NOT_CONVERGED
    found = _result(base, b, x, drives, status, problem)
    if status is PhysicalStatus.NEAREST and _is_kept(found.deviation, b):
        return replace(found, status=PhysicalStatus.EXACT)
    if outcome is ConeOutcome.FAILED:
        # whether real bodies have these base parameters was not told
        return replace(found, status=PhysicalStatus.NOT_CONVERGED)
    return found


def _result(
    base: BaseParameters, b: Array, x: Array, drives: DriveParameters, status: PhysicalStatus,
    problem: ConeProblem,
) -> StandardParameters:  # fmt: skip
    """The robot of the variables, and what it has of the base parameters."""
    parts = robot_parts(base, x, drives)
    return StandardParameters(
        parts.inertia, parts.drive, parts.transmission, status, base.matrix @ x - b,
        problem.distance(x), base.parameter_names, problem.prior, x, parts.friction,
    )  # fmt: skip


def _is_same(deviation: Array, b: Array) -> bool:
    return bool(
        (np.abs(deviation) <= _SAME * np.maximum(np.abs(b), np.abs(b).max(initial=0.0))).all()
    )


def _is_kept(deviation: Array, b: Array) -> bool:
    return float(np.abs(deviation).max(initial=0.0)) <= _KEPT * max(
        1e-300, float(np.abs(b).max(initial=0.0))
    )


def _relative(base: BaseParameters, b: Array) -> Array:
    """Deviations count relative to the values, which are compared with others of their kind."""
    kinds = np.array([name.rstrip("0123456789")[:1] for name in base.names])
    sizes = np.abs(b)
    for kind in set(kinds.tolist()):
        own = kinds == kind
        sizes[own] = np.maximum(sizes[own], 1e-3 * sizes[own].max())
    return np.diag(1.0 / np.where(sizes > 0, sizes, 1.0))
