"""Physical robots from base parameters, and from the factor of an identification.

Both functions minimise squares over the standard parameters, subject to linear matrix inequalities:
pseudo-inertias are positive definite, rotor inertias and frictions are not negative, those of
coupled motors together (the matrices of ``Ia`` with ``Iam`` and of ``Fv`` with ``Fvm`` are positive
semidefinite), and bounds hold. Of robots with the same squares the one nearest to the prior is
taken, so that parameters without effect on the torques are those of the prior, not zero.

Parameters
----------
base : BaseParameters
    b base parameters of p standard ones, with the drives and friction of the values or the factor.
prior : InertialParameters, optional
    Bodies with mass and extent, such as a CAD model or `uniform_bodies`; default the model's.
drive_prior : DriveParameters, optional
    Default the model's.
margin : float
    Smallest eigenvalue of each pseudo-inertia, relative to the prior's.

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
Seed book section 1.6.3; P. Wensing, S. Kim and J.-J. Slotine, "Linear matrix inequalities for
physically consistent inertial parameter identification", IEEE RA-L 3(1), 2018; C. Sousa and
R. Cortesao, "Physical feasibility of robot base inertial parameter identification", IJRR 33(6),
2014; T. Lee, P. Wensing and F. Park, "Geometric robot dynamic identification", IEEE T-RO 36(2),
2020 (the distance).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_core, as_exact
from ..drive import DriveParameters
from ..errors import InvalidValueError, ShapeError
from ..inertia import InertialParameters
from ..regressors import parameter_vector
from .bodies import check_definite
from .bounds import CenterOfMassBound, center_constraints, mass_constraints
from .constraints import drive_sizes, parameter_kinds
from .physical import MARGIN, PhysicalProblem, Squares
from .result import BaseParameters
from .standard import StandardParameters

TOLERANCE = 1.9e-4
"""Largest relative increase of the squares by the nearest robot (solver gap below 2e-4)."""
_RANK = 1e-10
"""Rank tolerance: relative singular value of columns in natural units."""
_ABSENT = 1e-2
"""Largest drive parameter of the prior, relative to the data, that is ignored as a scale."""
_UNSEEN = 1e-3
"""Share of the torques for the smallest scale of a kind of drive parameters."""


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
    base, prior, drive_prior, margin
        See the head of this page.
    values : array_like, shape (b,)
        Base parameters, such as identified ones.
    weights : array_like, shape (k, b), optional
        The norm of nearest base parameters is ``|weights @ (b - values)|``; the triangular
        factor of the regressor for the nearest torques. Default relative to the values.

    Returns
    -------
    StandardParameters
        Inertia and drives, with a status.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.minimal_parameters import base_parameters, uniform_bodies
    >>> arm = load("lab_rr")
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> base = base_parameters(arm)
    >>> robot = standard_parameters(base, base.values(arm))
    >>> robot.status.name, round(robot.distance, 6)
    ('EXACT', 0.0)
    """
    b = as_exact(values, (len(base),), "values")
    W = _relative(base, b) if weights is None else as_core(weights, (len(base),), "weights")
    if W.ndim != 2:
        raise ShapeError(f"weights: expected shape (k, {len(base)}), got {W.shape}.")
    near, P0, drives = _checked_prior(base, prior, drive_prior, margin)
    squares = Squares(W @ base.matrix, W @ b, base.matrix, b)
    fit = PhysicalProblem(base, near, P0, margin).fit(squares, b, 0.0, TOLERANCE)
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
    centre_bounds: Sequence[CenterOfMassBound] | None = None,
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
    base, prior, drive_prior, margin
        See the head of this page.
    R : array_like, shape (r, b)
        Triangular factor of the weighted regressor.
    y : array_like, shape (r,)
        Right side of the same weighted system.
    rest : float
        Squares of the weighted residuals outside the factor.
    rows : int, optional
        Number of residuals, for their root mean square.
    mass_bounds : array_like, shape (f, 2), optional
        Least and greatest mass of each link, kg; infinite for none, equal where it is known.
    centre_bounds : sequence of CenterOfMassBox or CenterOfMassEllipsoid, optional
        Bounds of centres of mass.
    total_mass : float or array_like, shape (2,), optional
        Mass of all links together, known or between two values, kg.
    gamma : float
        Weight of the squared distance from the prior, ``1 / s^2`` where its relative errors are s
        and the rows have unit variance. Default 0: the prior only selects among equal fits.
    tolerance : float
        Where ``gamma`` is 0 and the least squares are not reached: the nearest robot is taken of
        all whose squares exceed the least by at most this part.

    Returns
    -------
    StandardParameters
        The robot, the increase of its residuals, the active constraints and the optimality gap;
        bounds that no physical robot satisfies give the status INFEASIBLE.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.minimal_parameters import base_parameters, uniform_bodies
    >>> arm = load("planar_2r")
    >>> base = base_parameters(arm, drive=False)
    >>> values = [0.2, -0.1, 0.3, 0.0]  # ZZ2 < 0: not physical
    >>> robot = fit_consistent(base, np.eye(4), values, prior=uniform_bodies(arm, 5.0))
    >>> robot.status.name, bool(robot.inertia.is_physical.all())
    ('CONSTRAINED', True)
    """
    if not (np.isfinite(gamma) and gamma >= 0.0):
        raise InvalidValueError(f"gamma: expected a weight, zero or more, got {gamma}.")
    if not 0.0 < tolerance < 1.0:
        raise InvalidValueError(f"tolerance: expected a part between 0 and 1, got {tolerance}.")
    if rows is not None and rows < 1:
        raise InvalidValueError(f"rows: expected the number of residuals, got {rows}.")
    near, P0, drives = _checked_prior(base, prior, drive_prior, margin)
    factor, right = _checked_factor(base, R, y, rest)
    sizes = _drive_sizes(base, near, factor, right)
    problem = PhysicalProblem(base, near, P0, margin, sizes)
    f, unit = base.model.f, problem.unit
    bounds = mass_constraints(f, unit, mass_bounds, total_mass)
    problem.bounds = (*bounds, *center_constraints(f, unit, centre_bounds or ()))
    squares, best = _squares(base, factor, right, float(rest), unit)
    fit = problem.fit(squares, best, float(gamma), float(tolerance))
    return StandardParameters(base, best, near, drives, fit, rows)


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


def _relative(base: BaseParameters, b: Array) -> Array:
    """Weights relative to the values, each at least a thousandth of the largest of its kind."""
    kinds = np.array([name.rstrip("0123456789")[:1] for name in base.names])
    sizes = np.abs(b)
    for kind in set(kinds.tolist()):
        same = kinds == kind
        sizes[same] = np.maximum(sizes[same], 1e-3 * sizes[same].max())
    return np.diag(1.0 / np.where(sizes > 0, sizes, 1.0))


def _checked_factor(
    base: BaseParameters, R: ArrayLike, y: ArrayLike, rest: float
) -> tuple[Array, Array]:
    """Check a weighted system of equations. Shapes: -> R (r, b), y (r,)."""
    factor = as_core(R, (len(base),), "R")
    if factor.ndim != 2:
        raise ShapeError(
            f"R: expected shape (r, {len(base)}), a column for each base parameter, got "
            f"{factor.shape}."
        )
    right = as_exact(y, (len(factor),), "y")
    if not (np.isfinite(rest) and rest >= 0.0):
        raise InvalidValueError(
            f"rest: expected a sum of squares, zero or more, got {rest}; "
            "give 0 for rounding below zero."
        )
    if not factor.any():
        raise InvalidValueError(
            "R: every entry is zero, so that nothing is identifiable; check the log and weights."
        )
    return factor, right


def _squares(
    base: BaseParameters, R: Array, y: Array, rest: float, unit: Array
) -> tuple[Squares, Array]:
    """Squares of the residuals, without directions at rounding, and the unconstrained fit (b,)."""
    scale = 1.0 / np.linalg.norm(base.matrix * unit, axis=1)
    U, values, V = np.linalg.svd(R / scale, full_matrices=False)
    k = int((values > _RANK * values[0]).sum())
    U, values, V = U[:, :k], values[:k], V[:k]
    target = U.T @ y
    level, same = target / values, (V * scale) @ base.matrix
    least = float(np.sum((y - U @ target) ** 2)) + rest
    return Squares(U.T @ R @ base.matrix, target, same, level, least), (V.T @ level) / scale


def _drive_sizes(base: BaseParameters, prior: Array, R: Array, y: Array) -> Array:
    """Natural sizes of drive parameters: the prior's, else those of the data.

    Shapes: prior (p,), R (r, b), y (r,) -> (p - 10 f,).
    """
    first = 10 * base.model.f
    sizes, kinds = drive_sizes(base, prior), parameter_kinds(base)
    lengths = np.linalg.norm(R, axis=0)
    seen = lengths > 0.0
    lengths = np.where(seen, lengths, 1.0)
    values = np.abs(np.linalg.lstsq(R / lengths, y, rcond=_RANK)[0]) / lengths
    whole = np.linalg.norm(y) / lengths  # size that alone explains all torques
    for kind in set(kinds[first:].tolist()):
        same = kinds == kind
        kept = same[base.kept] & seen
        rows, columns = np.nonzero(base.matrix[:, same])
        size = 0.0
        if kept.any():
            size = max(float(np.median(values[kept])), _UNSEEN * float(np.median(whole[kept])))
        elif rows.size:  # regrouped into other parameters: the size of those
            shares = np.abs(base.matrix[:, same][rows, columns])
            size = float(np.median(values[rows] / shares))
        if size > 0.0 and np.abs(prior[same]).max() < _ABSENT * size:
            sizes[same[first:]] = size
    return sizes
