"""Standard parameters of physical bodies and drives, from base parameters or from a regressor.

Both functions minimise squares over the standard parameters, subject to linear matrix inequalities:
pseudo-inertias are positive definite, rotor inertias and frictions are not negative, those of
coupled motors together (the matrices of ``Ia`` with ``Iam`` and of ``Fv`` with ``Fvm`` are positive
semidefinite), and bounds hold. Of robots with the same squares the one nearest to the prior is
taken, so that parameters without effect on the torques are those of the prior, not zero.

Parameters
----------
prior : InertialParameters, optional
    Bodies with mass and extent, such as a CAD model or `uniform_bodies`; default the model's.
drive_prior : DriveParameters, optional
    Default the model's.
margin : float
    Smallest eigenvalue of each pseudo-inertia, relative to the prior's.

Returns
-------
StandardParameters
    Inertia and drives with a status, the increase of the residuals, the active constraints and the
    optimality gap; bounds that no physical robot satisfies give the status INFEASIBLE.

Raises
------
InertiaError
    A prior that is not physical: which link, and the violated condition.
ShapeError, InvalidValueError
    Wrong shapes, NaN, a negative rest or weight, or a bound that is no interval.
MissingExtraError
    CVXPY or Clarabel is not installed.

References
----------
Book section 1.6.3; P. Wensing, S. Kim and J.-J. Slotine, IEEE RA-L 3(1), 2018 (LMI);
C. Sousa and R. Cortesao, IJRR 33(6), 2014; T. Lee, P. Wensing and F. Park, "Geometric robot dynamic
identification", IEEE T-RO 36(2), 2020 (the distance).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_core, as_exact
from ..drive import DriveParameters
from ..errors import InvalidValueError, ShapeError
from ..inertia import InertialParameters
from ..regressors import parameter_vector
from .bodies import check_definite
from .constraints import CenterOfMassBound, mass_constraints
from .physical import MARGIN, PhysicalProblem, Squares
from .result import BaseParameters
from .standard import StandardParameters, largest_of_kind

TOLERANCE = 1.9e-4
"""Largest relative increase of the squares by the nearest robot (solver gap below 2e-4)."""
_RANK = 1e-10
"""Rank tolerance: relative singular value of columns in natural units."""


def standard_parameters(
    base: BaseParameters,
    values: ArrayLike,
    prior: InertialParameters | None = None,
    drive_prior: DriveParameters | None = None,
    weights: ArrayLike | None = None,
    margin: float = MARGIN,
) -> StandardParameters:
    """Physical standard parameters, nearest to a prior, that give these base parameters.

    A physical prior with these base parameters is returned unchanged. If no physical robot has
    them, the nearest feasible base parameters are used; see status and ``deviation``.

    Parameters
    ----------
    values : array_like, shape (b,)
        Base parameters, such as identified ones.
    weights : array_like, shape (k, b), optional
        The norm of nearest base parameters is ``|weights @ (b - values)|``; the triangular
        factor of the regressor for the nearest torques. Default relative to the values.
    """
    b = as_exact(values, (len(base),), "values")
    if weights is None:  # relative to the values, at least a thousandth of the largest of a kind
        sizes = np.maximum(np.abs(b), 1e-3 * largest_of_kind(base.names, np.abs(b)))
        sizes = np.maximum(sizes, 1e-4 * sizes.max(initial=0.0))  # a kind may hold rounding only
        weights = np.diag(1.0 / np.where(sizes > 0.0, sizes, 1.0))
    W = _rows(weights, base, "weights")
    near, P0, drives = _checked_prior(base, prior, drive_prior, margin)
    squares = Squares(W, base.matrix, b, float(np.abs(b).max(initial=0.0)))
    fit = PhysicalProblem(base, near, P0, b, margin).fit(squares, b, 0.0, TOLERANCE)
    return StandardParameters(base, b, near, drives, fit)


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
    centre_bounds: Sequence[CenterOfMassBound] = (),
    total_mass: ArrayLike | None = None,
    gamma: float = 0.0,
    tolerance: float = TOLERANCE,
    margin: float = MARGIN,
) -> StandardParameters:
    """Standard parameters of physical bodies and drives with the least residuals of the torques.

    Minimises ``|R (M x) - y|^2 + rest``. `robotmodels.identification.consistent_robot` is the same
    from the result of a fit, which has the factor and the weights.

    Parameters
    ----------
    R, y : array_like, shapes (r, b), (r,)
        Triangular factor of the weighted regressor, and the right side of the same system.
    rest, rows : float, int, optional
        Squares of the weighted residuals outside the factor; number of residuals, for their rms.
    mass_bounds : array_like, shape (f, 2), optional
        Least and greatest mass of each link, kg; infinite for none, equal where it is known.
    centre_bounds : sequence of CenterOfMassBox or CenterOfMassEllipsoid
        Bounds of centres of mass.
    total_mass : float or array_like, shape (2,), optional
        Mass of all links together, known or between two values, kg.
    gamma : float
        Weight of the squared distance from the prior, ``1 / s^2`` where its relative errors are s
        and the rows have unit variance. Default 0: the prior only selects among equal fits.
    tolerance : float
        Where ``gamma`` is 0 and the least squares are not reached: the nearest robot is taken of
        all whose squares exceed the least by at most this part.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.minimal_parameters import base_parameters, uniform_bodies
    >>> arm = load("planar_2r")
    >>> base = base_parameters(arm, drive=False)
    >>> values = [0.2, -0.1, 0.3, 0.0]  # ZZ2 < 0: not physical
    >>> fit_consistent(base, np.eye(4), values, prior=uniform_bodies(arm, 5.0)).status.name
    'CONSTRAINED'
    """
    for name, value, good, expected in (
        ("gamma", gamma, 0.0 <= gamma < inf, "a weight, zero or more"),
        ("tolerance", tolerance, 0.0 < tolerance < 1.0, "a part between 0 and 1"),
        ("rows", rows, rows is None or rows >= 1, "the number of residuals"),
        ("rest", rest, 0.0 <= rest < inf, "a sum of squares, zero or more (0 for rounding)"),
    ):
        if not good:
            raise InvalidValueError(f"{name}: expected {expected}, got {value}.")
    near, P0, drives = _checked_prior(base, prior, drive_prior, margin)
    factor = _rows(R, base, "R")
    right = as_exact(y, (len(factor),), "y")
    lengths = np.linalg.norm(factor, axis=0)
    lengths = np.where(lengths > 0.0, lengths, 1.0)
    rough = np.linalg.lstsq(factor / lengths, right, rcond=_RANK)[0] / lengths
    problem = PhysicalProblem(base, near, P0, rough, margin)
    if not factor.any():
        raise InvalidValueError(
            "R: every entry is zero, so that nothing is identifiable; check the log and weights."
        )
    squares, best = _squares(base, factor, right, float(rest), problem.natural)
    problem.add(
        mass_constraints(base.model.f, problem.unit, mass_bounds, total_mass, centre_bounds)
    )
    fit = problem.fit(squares, best, float(gamma), float(tolerance))
    return StandardParameters(base, best, near, drives, fit, rows)


def _rows(matrix: ArrayLike, base: BaseParameters, name: str) -> Array:
    """Rows (r, b) with a column for each base parameter."""
    rows = as_core(matrix, (len(base),), name)
    if rows.ndim != 2:
        raise ShapeError(f"{name}: expected shape (r, {len(base)}), got {rows.shape}.")
    return rows


def _checked_prior(
    base: BaseParameters,
    prior: InertialParameters | None,
    drive_prior: DriveParameters | None,
    margin: float,
) -> tuple[Array, Array, DriveParameters]:
    """Standard parameters (p,) and pseudo-inertias (f, 4, 4) of a prior, and its drives."""
    model = base.model
    if not 0.0 < margin < 1.0:
        raise InvalidValueError(f"margin: expected a number between 0 and 1, got {margin}.")
    bodies = model.inertia if prior is None else prior
    if bodies.f != model.f:
        raise InvalidValueError(f"prior: expected {model.f} links, got {bodies.f}.")
    drives = model.drive if drive_prior is None else drive_prior
    if drives.n != model.n:
        raise InvalidValueError(f"drive_prior: expected {model.n} joints, got {drives.n}.")
    P0 = check_definite(bodies, "prior", model.table.names)
    robot = model.with_inertia(bodies).with_drive(drives)
    return parameter_vector(robot, base.drive, base.friction), P0, drives


def _squares(
    base: BaseParameters, R: Array, y: Array, rest: float, natural: Array
) -> tuple[Squares, Array]:
    """Squares of the residuals, without directions at rounding, and the unconstrained fit (b,).

    Shapes: R (r, b), y (r,), natural (b,): sizes of the base parameters.
    """
    U, values, V = np.linalg.svd(R * natural, full_matrices=False)
    k = int((values > _RANK * values[0]).sum())
    U, values, V = U[:, :k], values[:k], V[:k]
    target = U.T @ y
    level, same = target / values, (V / natural) @ base.matrix
    least = float(np.sum((y - U @ target) ** 2)) + rest
    squares = Squares(np.diag(values), same, level, float(np.abs(level).max(initial=0.0)), least)
    return squares, (V.T @ level) * natural
