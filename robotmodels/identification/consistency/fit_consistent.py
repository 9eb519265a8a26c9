"""Physically consistent identification: the best torque fit that real bodies and drives have."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ...drive import DriveParameters
from ...errors import InvalidValueError
from ...inertia import InertialParameters
from ...minimal_parameters import BaseParameters
from ...minimal_parameters.cone import ConeProblem
from ...minimal_parameters.prior import check_definite
from ...minimal_parameters.robot_parts import robot_parts, standard_vector
from ...minimal_parameters.standard import MARGIN
from .bounds import CentreBound, centre_constraints, mass_constraints
from .constrained_fit import SOUGHT, ConstrainedFit
from .result import ConsistentFit
from .system import checked_factor, torque_squares
from .units import sizes_of_drives

TOLERANCE = 1e-4
"""Part of the squares that a nearer robot may have more: fits as near as this are equal."""


def fit_consistent(
    base: BaseParameters,
    R: ArrayLike,
    y: ArrayLike,
    *,
    rest: float = 0.0,
    rows: int | None = None,
    prior: InertialParameters | None = None,
    drive_prior: DriveParameters | None = None,
    mass_bounds: ArrayLike | None = None,
    centre_bounds: Sequence[CentreBound] | None = None,
    total_mass: ArrayLike | None = None,
    gamma: float = 0.0,
    tolerance: float = TOLERANCE,
    margin: float = MARGIN,
) -> ConsistentFit:
    """Standard parameters of real bodies and drives with the least residuals of the torques.

    The squares ``|R (M x) - y|^2 + rest`` are minimised over the standard parameters x themselves,
    not over the neighbours of the least-squares answer: pseudo-inertias are positive definite,
    rotor inertias and frictions are not negative (those of coupled motors together), and the
    bounds hold. Of all robots with the same residuals the one nearest to the prior is taken, so
    what the torques do not show is the prior's as far as it can be.

    Parameters
    ----------
    base : BaseParameters
        b base parameters of p standard ones, with the drives and friction that were identified.
    R : array_like, shape (r, b)
        Triangular factor of the weighted regressor.
    y : array_like, shape (r,)
        Right side of the same weighted system.
    rest : float
        Squares of the weighted residuals that the factor does not hold.
    rows : int, optional
        Number of residuals, for their root mean square.
    prior : InertialParameters, optional
        Bodies with mass and extent: a CAD model or `uniform_bodies`; default the model's.
    drive_prior : DriveParameters, optional
        Default the model's.
    mass_bounds : array_like, shape (f, 2), optional
        Least and greatest mass of each link, kg; infinite for none, equal where it is known.
    centre_bounds : sequence of CentreBox or CentreEllipsoid, optional
        Where centres of mass are.
    total_mass : float or array_like, shape (2,), optional
        Mass of all links together, known or between two values, kg.
    gamma : float
        Weight of the squared distance from the prior, ``1 / s^2`` where its relative errors are s
        and the rows have unit variance. Default 0: the prior decides only what torques do not show.
    tolerance : float
        Part of the squares by which fits count as equal where ``gamma`` is 0 and the least squares
        are not reached: the nearest robot of all whose squares are at most that much more than the
        least is taken. It must be above 1e-5, what the least is known to.
    margin : float
        Smallest eigenvalue of each pseudo-inertia, relative to the prior's.

    Returns
    -------
    ConsistentFit
        The robot, its price in residuals, the active constraints and a proof of optimality.

    Raises
    ------
    InvalidValueError, ShapeError
        Wrong shapes, NaN, a negative rest or weight, or bounds that no real bodies meet together:
        which.
    InertiaError
        A prior that is no set of real bodies: which link, and what is wrong with it.
    MissingExtraError
        The solver for cones is not installed.

    See Also
    --------
    consistent_robot : the same from the result of `fit`, which has the factor and the weights.

    References
    ----------
    Seed book section 1.6.3; P. Wensing, S. Kim and J.-J. Slotine, "Linear matrix inequalities for
    physically consistent inertial parameter identification", IEEE RA-L 3(1), 2018; C. Sousa and
    R. Cortesao, "Physical feasibility of robot base inertial parameter identification", IJRR 33(6),
    2014.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.minimal_parameters import base_parameters, uniform_bodies
    >>> arm = load("planar_2r")
    >>> base = base_parameters(arm, drive=False)
    >>> values = [0.2, -0.1, 0.3, 0.0]  # ZZ2 < 0: of no real body
    >>> found = fit_consistent(base, np.eye(4), values, prior=uniform_bodies(arm, 5.0))
    >>> found.status.name, bool(found.inertia.is_physical.all())
    ('CONSTRAINED', True)
    """
    model = base.model
    if not (np.isfinite(gamma) and gamma >= 0.0):
        raise InvalidValueError(f"gamma: expected a weight, zero or more, got {gamma}.")
    if not 0.0 < margin < 1.0:
        raise InvalidValueError(f"margin: expected a number between 0 and 1, got {margin}.")
    if not SOUGHT < tolerance < 1.0:
        raise InvalidValueError(
            f"tolerance: expected a part of the squares between {SOUGHT:g} and 1, got {tolerance}."
        )
    if rows is not None and rows < 1:
        raise InvalidValueError(f"rows: expected the number of residuals, got {rows}.")
    bodies = model.inertia if prior is None else prior
    if bodies.f != model.f:
        raise InvalidValueError(f"prior: expected {model.f} links, got {bodies.f}.")
    drives = model.drive if drive_prior is None else drive_prior
    if drives.n != model.n:
        raise InvalidValueError(f"drive_prior: expected {model.n} joints, got {drives.n}.")
    P0 = check_definite(bodies, "prior", model.table.names)
    R, y = checked_factor(base, R, y, rest)
    near = standard_vector(base, bodies, drives)
    problem = ConeProblem(base, near, P0, margin, sizes_of_drives(base, near, R, y))
    system = torque_squares(base, R, y, rest, problem.unit)
    bounds = (
        *mass_constraints(model.f, problem.unit, mass_bounds, total_mass),
        *centre_constraints(model.f, problem.unit, centre_bounds or ()),
    )
    task = ConstrainedFit(problem, system, bounds, float(gamma), float(tolerance))
    if bounds and not task.is_possible(bounds):
        raise InvalidValueError(task.contradiction())
    found = task.free() or task.constrained()
    parts = robot_parts(base, found.x, drives)
    squares = system.sum(found.x)
    if squares - system.least <= system.nothing:
        squares = system.least
    return ConsistentFit(
        *parts, found.status, base.names, base.matrix @ found.x, system.best,
        base.parameter_names, problem.prior, found.x, squares, system.least, rows, found.gap,
        found.violation, found.clipped, problem.distance(found.x), float(gamma), found.active,
        found.stopped,
    )  # fmt: skip
