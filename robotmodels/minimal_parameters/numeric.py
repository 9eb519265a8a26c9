"""Base parameters in numbers: independent columns of a regressor, in Khalil's order."""

from __future__ import annotations

from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..estimation import ColumnBasis, column_basis
from ..estimation.columns import NOTHING
from ..estimation.triangles import factors_by_kind
from ..friction import Friction, check_linear
from ..geometry import PRISMATIC
from ..model import RobotModel
from ..regressors import parameter_names, torque_regressor_chunks
from .branches import columns_by_branches
from .restraint import reach
from .result import BaseMethod, BaseParameters

_ROWS_A_COLUMN = 3
_PIECE = 1024
_MANY = 250
"""Columns beyond which a tree is taken path by path."""
_SLOWEST = 6.0
"""Decades of velocities that friction is looked at on."""


def base_by_numbers(
    model: RobotModel,
    drive: bool,
    samples: tuple[Array, Array, Array] | None = None,
    constraint: Array | None = None,
    tolerance: float = NOTHING,
    friction: Friction | None = None,
    notes: tuple[str, ...] = (),
) -> BaseParameters:
    """Base parameters from the columns of the regressor on random or given motion.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    drive : bool
        Whether drive parameters are among the standard ones.
    samples : tuple of ndarray, shapes (N, n), optional
        Joint variables, velocities and accelerations; default random ones.
    constraint : ndarray, shape (n, u), optional
        Joint velocities are ``constraint`` times u free ones.
    tolerance : float
        Part of the largest torque that counts as nothing.
    friction : Friction, optional
        A linear friction model.
    notes : tuple of str
        Sentences for the result.

    Returns
    -------
    BaseParameters
        Method numeric, with its gap.

    References
    ----------
    M. Gautier, "Numerical calculation of the base inertial parameters of robots", Journal of
    Robotic Systems 8(4), 1991.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> base = base_by_numbers(load("rx90"), drive=True)
    >>> len(base), base.gap[0] > 0.01, base.gap[1] < 1e-12
    (58, True, True)
    """
    basis = base_columns(model, drive, samples, constraint, tolerance, friction)
    return BaseParameters(
        model, drive, basis.kept, basis.coefficients, BaseMethod.NUMERIC, basis.gap, friction,
        tolerance, notes,
    )  # fmt: skip


def base_columns(
    model: RobotModel,
    drive: bool,
    samples: tuple[Array, Array, Array] | None = None,
    constraint: Array | None = None,
    tolerance: float = NOTHING,
    friction: Friction | None = None,
) -> ColumnBasis:
    """Independent columns of the torque regressor; arguments as `base_by_numbers`.

    The link parameters of the first frames are preferred, then Ia, Fv, Fc, offset and those of
    friction: that is the order of `parameter_names`, and gives Khalil's choice. Only triangular
    factors of the regressor are ever held.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> base_columns(load("planar_2r"), drive=False).kept
    array([ 5, 15, 16, 17])
    """
    factors = torque_factors(model, drive, samples, constraint, friction)
    scale, kinds = natural_sizes(model, drive, friction)
    coupled = model.transmission is not None and model.transmission.coupled_motors
    if len(scale) > _MANY and constraint is None and not coupled:
        found = columns_by_branches(model, factors, scale, kinds, tolerance)
        if found is not None:
            return found
    return column_basis(np.vstack(factors), None, scale, tolerance, kinds)


def torque_factors(
    model: RobotModel,
    drive: bool,
    samples: tuple[Array, Array, Array] | None = None,
    constraint: Array | None = None,
    friction: Friction | None = None,
) -> list[Array]:
    """Rows of the regressor by joint (free variable), or matrices with the same products.

    Torques of prismatic joints are made comparable to those of revolute ones by the size of the
    robot. Arguments as `base_by_numbers`.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> len(torque_factors(load("planar_2r"), drive=False))
    2
    """
    size = reach(model)
    p = len(parameter_names(model, drive, friction))
    slides = model.table.sigma[model.table.joint_rows] == PRISMATIC
    units = np.where(slides, size, 1.0)
    if samples is None:
        samples = _random_motion(model, p, size, units, constraint, friction is not None)
    chunks = torque_regressor_chunks(model, *samples, drive=drive, size=_PIECE, friction=friction)
    pieces = (
        W * units[:, None] if constraint is None else np.einsum("iu,kip->kup", constraint, W)
        for _, W in chunks
    )
    return factors_by_kind(pieces, p)


def _random_motion(
    model: RobotModel, p: int, size: float, units: Array, constraint: Array | None, slow: bool
) -> tuple[Array, Array, Array]:
    """Motion in which gravity, centrifugal forces and inertia weigh alike, whatever the size."""
    rng = np.random.default_rng(0)
    G = np.eye(model.n) if constraint is None else constraint
    u = G.shape[1]
    rate = sqrt(9.81 / size)
    N = ceil(_ROWS_A_COLUMN * p / max(u, 1))
    # joints may turn all round and slide by the robot's size
    spread = np.diag(units) if constraint is None else np.eye(u) * units.max(initial=0.0)
    q, v, a = (
        scale * rng.uniform(-1.0, 1.0, (N, u)) @ spread @ G.T for scale in (np.pi, rate, rate**2)
    )
    if slow:
        # half of the samples over all decades: friction may be another near zero velocity
        v[::2] *= 10.0 ** (-_SLOWEST * rng.uniform(size=v[::2].shape))
    return q, v, a


def natural_sizes(
    model: RobotModel, drive: bool, friction: Friction | None = None
) -> tuple[Array, NDArray[np.int64]]:
    """Parameters of a robot of this size and unit mass, and which are of one kind.

    Parameters
    ----------
    model : RobotModel
        The robot.
    drive : bool
        Whether drive parameters are among the standard ones.
    friction : Friction, optional
        A linear friction model.

    Returns
    -------
    sizes : ndarray, shape (p,)
        In the units of the rows of `torque_factors`.
    kinds : ndarray of int, shape (p,)
        Inertias, first moments, masses, then the kinds of the drives and of friction.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> natural_sizes(load("planar_2r"), drive=False)[1][:10]
    array([0, 0, 0, 0, 0, 0, 1, 1, 1, 2])
    """
    size, n = reach(model), model.n
    link = [size**2] * 6 + [size] * 3 + [1.0]
    slides = model.table.sigma[model.table.joint_rows] == PRISMATIC
    rotor = np.where(slides, 1.0, size**2)
    rate = sqrt(9.81 / size)
    drives = [rotor, rotor * rate, rotor * rate**2, rotor * rate**2] if drive else []
    rest = len(parameter_names(model, drive)) - 10 * model.f - n * len(drives)
    added = 0 if friction is None else len(check_linear(friction).kinds)
    sizes = np.concatenate((
        np.tile(link, model.f), *drives, np.full(rest, size**2), *[rotor * rate**2] * added
    ))  # fmt: skip
    kinds = np.concatenate((
        np.tile([0] * 6 + [1] * 3 + [2], model.f),
        np.repeat(np.arange(3, 3 + len(drives)), n),
        np.full(rest, 7),
        np.repeat(np.arange(8, 8 + added), n),
    ))  # fmt: skip
    return sizes, kinds.astype(np.int64)
