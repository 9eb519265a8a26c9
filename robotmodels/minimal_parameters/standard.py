"""From base parameters back to a robot: standard parameters nearest to a prior, of real bodies."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Rebuilt, as_exact, read_only
from ..drive import DriveParameters
from ..errors import InvalidValueError, MissingExtraError
from ..inertia import InertialParameters
from ..model import RobotModel
from ..regressors import parameter_vector
from .prior import check_definite, pseudo_inertias
from .result import BaseParameters

MARGIN = 1e-3
"""Smallest eigenvalue of a link's pseudo-inertia, relative to the prior's."""


class PhysicalStatus(Enum):
    """What became of the search for a robot with given base parameters.

    Examples
    --------
    >>> PhysicalStatus.EXACT.value
    'The robot has exactly these base parameters.'
    """

    EXACT = "The robot has exactly these base parameters."
    NEAREST = "No real bodies have these base parameters; the robot has the nearest that some have."
    NOT_CONVERGED = "The solver did not converge; the parameters are not to be used."


@dataclass(frozen=True, slots=True, eq=False)
class StandardParameters(Rebuilt):
    """A full set of standard parameters with given base parameters. Read-only.

    Parameters
    ----------
    inertia : InertialParameters
        Of f real bodies, unless the status says otherwise.
    drive : DriveParameters
        Of n joints; those of the model where drives were not among the base parameters.
    status : PhysicalStatus
        Whether the base parameters were kept.
    deviation : ndarray, shape (b,)
        Base parameters of the robot less those that were given; zero to rounding if kept.
    distance : float
        Distance from the prior: root of the summed squares of the relative changes of the
        pseudo-inertias, ``|P0^-1/2 (P - P0) P0^-1/2|``, and of the drives.

    Examples
    --------
    >>> StandardParameters.__slots__[:2]
    ('inertia', 'drive')
    """

    inertia: InertialParameters
    drive: DriveParameters
    status: PhysicalStatus
    deviation: Array
    distance: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "deviation", read_only(self.deviation))

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
        return model.with_inertia(self.inertia).with_drive(self.drive)


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
    are not negative. If no such robot has the given base parameters, the nearest base parameters
    that one has are taken, and the status and the deviation say so.

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
        A prior that is not physical.
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
    P0 = check_definite(bodies, "prior")
    problem = _Cone(base, b, _prior_vector(base, bodies, drives), P0, margin)
    x, solved = problem.nearest_to_prior()
    status = PhysicalStatus.EXACT
    if not solved:
        W = _relative(b) if weights is None else as_exact(weights, np.shape(weights), "weights")
        if W.ndim != 2 or W.shape[1] != len(base):
            raise InvalidValueError(f"weights: expected shape (k, {len(base)}), got {W.shape}.")
        x, solved = problem.nearest_base(W)
        status = PhysicalStatus.NEAREST if solved else PhysicalStatus.NOT_CONVERGED
    return _result(base, b, x, drives, status, problem)


def _result(
    base: BaseParameters, b: Array, x: Array, drives: DriveParameters, status: PhysicalStatus,
    problem: _Cone,
) -> StandardParameters:  # fmt: skip
    f, n = base.model.f, base.model.n
    if base.drive:
        Ia, Fv, Fc, offset = x[10 * f : 10 * f + 4 * n].reshape(4, n)
        drives = DriveParameters(Ia=Ia, Fv=Fv, Fc=Fc, offset=offset)
    return StandardParameters(
        InertialParameters(x[: 10 * f].reshape(f, 10)), drives, status,
        base.matrix @ x - b, problem.distance(x),
    )  # fmt: skip


def _prior_vector(
    base: BaseParameters, bodies: InertialParameters, drives: DriveParameters
) -> Array:
    return parameter_vector(base.model.with_inertia(bodies).with_drive(drives), base.drive)


def _relative(b: Array) -> Array:
    size = np.abs(b).max(initial=0.0) or 1.0
    return np.diag(1.0 / np.maximum(np.abs(b), 1e-3 * size))


_PLACES = tuple((i, k) for k in range(4) for i in range(k + 1))
"""Upper triangle of a 4x4 matrix, column by column, as the solver stacks it."""


class _Cone:
    """The convex problem: variables x are the standard parameters, in units of the prior."""

    def __init__(
        self, base: BaseParameters, b: Array, prior: Array, P0: Array, margin: float
    ) -> None:
        f, n = base.model.f, base.model.n
        self.base, self.b, self.prior, self.margin = base, b, prior, margin
        p = len(prior)
        # whitened pseudo-inertia of link j: the identity at the prior
        basis = pseudo_inertias(InertialParameters(np.eye(10)))
        self.maps = np.zeros((f, 16, 10))
        for j in range(f):
            L = np.linalg.inv(np.linalg.cholesky(P0[j]))
            self.maps[j] = np.stack([(L @ B @ L.T).ravel() for B in basis], axis=1)
        # of the drives, changes count relative to the prior's own size
        rest = prior[10 * f :]
        size = np.maximum(np.abs(rest), 1e-2 * np.abs(rest).max(initial=0.0))
        self.sizes = np.where(size > 0, size, 1.0)
        metric = np.zeros((p, p))
        for j in range(f):
            part = slice(10 * j, 10 * j + 10)
            metric[part, part] = self.maps[j].T @ self.maps[j]
        metric[range(10 * f, p), range(10 * f, p)] = 1.0 / self.sizes**2
        self.metric = metric
        # rotor inertias and frictions; offsets, and what couples motors, may have either sign
        self.f, self.positive = f, range(10 * f, min(10 * f + 3 * n, p))

    def distance(self, x: Array) -> float:
        change = x - self.prior
        return float(np.sqrt(max(change @ self.metric @ change, 0.0)))

    def nearest_to_prior(self) -> tuple[Array, bool]:
        """Minimum of the distance on the base parameters."""
        M = self.base.matrix
        x, solved = self._solve(self.metric, -self.metric @ self.prior, M, self.b)
        if not solved:
            return x, False
        # the solver's last digits
        scale = np.diag(1.0 / np.sqrt(np.diag(self.metric)))
        return x + scale @ np.linalg.pinv(M @ scale) @ (self.b - M @ x), True

    def nearest_base(self, W: Array) -> tuple[Array, bool]:
        """Minimum of ``|W (M x - b)|^2``, and among those, nearly, of the distance."""
        A = W @ self.base.matrix
        hessian = A.T @ A
        small = 1e-8 * np.trace(hessian) / np.trace(self.metric)
        H = hessian + small * self.metric
        g = -A.T @ (W @ self.b) - small * self.metric @ self.prior
        return self._solve(H, g, np.zeros((0, len(g))), np.zeros(0))

    def _solve(self, H: Array, g: Array, E: Array, e: Array) -> tuple[Array, bool]:
        clarabel = _clarabel()
        from scipy import sparse

        p = len(g)
        unit = 1.0 / np.sqrt(np.diag(self.metric))
        rows, right, cones = [], [], []
        if len(e):
            scale = 1.0 / np.abs(E * unit).max(axis=1)
            rows.append(E * scale[:, None])
            right.append(e * scale)
            cones.append(clarabel.ZeroConeT(len(e)))
        if len(self.positive):
            bound = np.zeros((len(self.positive), p))
            bound[range(len(self.positive)), self.positive] = -1.0
            rows.append(bound)
            right.append(np.zeros(len(self.positive)))
            cones.append(clarabel.NonnegativeConeT(len(self.positive)))
        for j in range(self.f):
            block = np.zeros((10, p))
            floor = np.zeros(10)
            for k, (i, m) in enumerate(_PLACES):
                weight = 1.0 if i == m else np.sqrt(2.0)
                block[k, 10 * j : 10 * j + 10] = -weight * self.maps[j][4 * i + m]
                floor[k] = -self.margin * (i == m)
            rows.append(block)
            right.append(floor)
            cones.append(clarabel.PSDTriangleConeT(4))
        A = np.concatenate(rows) * unit
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
        settings.max_iter = 500
        scaled = H * unit * unit[:, None]
        size = max(float(np.abs(scaled).max()), 1e-300)
        solver = clarabel.DefaultSolver(
            sparse.csc_matrix(np.triu(scaled / size)), g * unit / size, sparse.csc_matrix(A),
            np.concatenate(right), cones, settings,
        )  # fmt: skip
        solution = solver.solve()
        done = str(solution.status) in ("Solved", "AlmostSolved")
        return unit * np.array(solution.x), done


def _clarabel() -> Any:
    try:
        import clarabel
    except ImportError:
        raise MissingExtraError(
            "Physically consistent parameters need Clarabel, a solver for cones: "
            "pip install 'robotmodels[cones]'."
        ) from None
    return clarabel
