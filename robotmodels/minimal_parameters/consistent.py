"""Standard parameters of physical bodies and drives, from base parameters or from a regressor.

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
Seed book section 1.6.3; P. Wensing, S. Kim and J.-J. Slotine, IEEE RA-L 3(1), 2018 (LMI);
C. Sousa and R. Cortesao, IJRR 33(6), 2014; T. Lee, P. Wensing and F. Park, "Geometric robot dynamic
identification", IEEE T-RO 36(2), 2020 (the distance).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, sqrt

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Rebuilt, as_core, as_exact, read_only
from ..drive import DriveParameters
from ..dynamics import base_model
from ..errors import InvalidValueError, ShapeError
from ..inertia import InertialParameters
from ..model import RobotModel
from ..regressors import parameter_vector
from ..table_text import boxed
from .bodies import check_definite
from .constraints import CenterOfMassBound, mass_constraints
from .physical import MARGIN, PhysicalFit, PhysicalProblem, PhysicalStatus, Squares
from .result import BaseParameters

TOLERANCE = 1.9e-4
"""Largest relative increase of the squares by the nearest robot (solver gap below 2e-4)."""
_RANK = 1e-10
"""Rank tolerance: relative singular value of columns in natural units."""
_ZERO = 1e-9
"""Print tolerance of a change, relative to the largest parameter of its kind."""


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
        from the prior, of the relative changes of pseudo-inertias, ``|P0^-1/2 (P - P0) P0^-1/2|``,
        and of drives; ``gap``: the part of the squares (with ``gamma``: and of the weighted
        distance) by which a robot within twice the distance may be better, by the solver's dual
        value; ``active`` constraints; ``stopped``: the ending of a solver that stopped early.
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
        kinds = self.base.friction.kinds  # type: ignore[attr-defined]
        n = self.base.model.n
        return self.values[len(self.values) - n * len(kinds) :].reshape(-1, n)

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
        percent = self.residual_increase
        increase = "without bound" if percent == inf else f"{percent:.3g} %"
        worst = float(abs(self.deviation).max(initial=0.0))
        lines = [
            f"{self.status.sentence} {self.fit.stopped}".strip(),
            f"Residuals: {increase} above least squares (root of weighted squares "
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
        """Columns of the table: parameter, prior, value and difference."""
        sizes = np.maximum(np.abs(self.prior), np.abs(self.values))
        small = (_ZERO * _largest_of_kind(self.names, sizes)).tolist()
        columns = [("parameter", list(self.names))]
        for title, numbers, form in (
            ("prior", self.prior, ".6g"),
            ("value", self.values, ".6g"),
            ("difference", self.values - self.prior, "+.3g"),
        ):
            pairs = zip(numbers.tolist(), small, strict=True)
            texts = ["0" if abs(x) <= least else f"{x:{form}}" for x, least in pairs]
            columns.append((title, texts))
        return columns

    def __repr__(self) -> str:
        return (
            f"<StandardParameters: {self.base.model.f} links, {len(self.names)} parameters, "
            f"{self.status.name}, distance {self.distance:.3g}, residuals "
            f"+{self.residual_increase:.3g} %>"
        )


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
    if weights is None:  # relative to the values, at least a thousandth of the largest of a kind
        sizes = np.maximum(np.abs(b), 1e-3 * _largest_of_kind(base.names, np.abs(b)))
        weights = np.diag(1.0 / np.where(sizes > 0.0, sizes, 1.0))
    W = as_core(weights, (len(base),), "weights")
    if W.ndim != 2:
        raise ShapeError(f"weights: expected shape (k, {len(base)}), got {W.shape}.")
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
    for name, value, good, expected in (
        ("gamma", gamma, 0.0 <= gamma < inf, "a weight, zero or more"),
        ("tolerance", tolerance, 0.0 < tolerance < 1.0, "a part between 0 and 1"),
        ("rows", rows, rows is None or rows >= 1, "the number of residuals"),
        ("rest", rest, 0.0 <= rest < inf, "a sum of squares, zero or more (0 for rounding)"),
    ):
        if not good:
            raise InvalidValueError(f"{name}: expected {expected}, got {value}.")
    near, P0, drives = _checked_prior(base, prior, drive_prior, margin)
    factor = as_core(R, (len(base),), "R")
    if factor.ndim != 2:
        raise ShapeError(
            f"R: expected shape (r, {len(base)}), a column for each base parameter, got "
            f"{factor.shape}."
        )
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


def _largest_of_kind(names: Sequence[str], sizes: Array) -> Array:
    """Largest size of the parameters that begin with the same letter. Shapes: (p,) -> (p,)."""
    kinds = np.array([name[:1] for name in names])
    return np.array([sizes[kinds == kind].max() for kind in kinds.tolist()])


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
