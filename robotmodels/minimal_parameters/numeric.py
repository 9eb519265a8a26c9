"""Base parameters in numbers: independent columns of a regressor, in Khalil's order."""

from __future__ import annotations

from math import ceil, sqrt

import numpy as np

from .._arrays import Array
from ..estimation import ColumnBasis, column_basis, triangular_factor
from ..estimation.columns import DEPENDENT
from ..geometry import PRISMATIC
from ..model import RobotModel
from ..regressors import parameter_names, torque_regressor_chunks
from .result import BaseMethod, BaseParameters

_ROWS_A_COLUMN = 3
_PIECE = 1024


def base_by_numbers(
    model: RobotModel,
    drive: bool,
    samples: tuple[Array, Array, Array] | None = None,
    constraint: Array | None = None,
    tolerance: float = DEPENDENT,
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
        Sine of an angle below which a column depends on those before it.

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
    >>> len(base), base.gap[0] > 0.1, base.gap[1] < 1e-12
    (58, True, True)
    """
    basis = base_columns(model, drive, samples, constraint, tolerance)
    return BaseParameters(
        model, drive, basis.kept, basis.coefficients, BaseMethod.NUMERIC, basis.gap
    )


def base_columns(
    model: RobotModel,
    drive: bool,
    samples: tuple[Array, Array, Array] | None = None,
    constraint: Array | None = None,
    tolerance: float = DEPENDENT,
) -> ColumnBasis:
    """Independent columns of the torque regressor; arguments as `base_by_numbers`.

    The link parameters of the first frames are preferred, then Ia, Fv, Fc, offset: that is the
    order of `parameter_names`, and gives Khalil's choice. Torques of prismatic joints are made
    comparable to those of revolute ones by the size of the robot. Only a triangular factor of
    the regressor is ever held.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> base_columns(load("planar_2r"), drive=False).kept
    array([ 5, 15, 16, 17])
    """
    size = _size(model)
    p = len(parameter_names(model, drive))
    slides = model.table.sigma[model.table.joint_rows] == PRISMATIC
    units = np.where(slides, size, 1.0)
    if samples is None:
        samples = _random_motion(model, p, size, units, constraint)
    chunks = torque_regressor_chunks(model, *samples, drive=drive, size=_PIECE)
    pieces = (
        W * units[:, None] if constraint is None else np.einsum("iu,kip->kup", constraint, W)
        for _, W in chunks
    )
    triangle = triangular_factor(pieces, p)
    return column_basis(triangle, scale=_natural_sizes(model, drive, size), dependent=tolerance)


def _random_motion(
    model: RobotModel, p: int, size: float, units: Array, constraint: Array | None
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
        scale * rng.uniform(-1.0, 1.0, (N, u)) @ spread @ G.T
        for scale in (np.pi, 2.0 * rate, 4.0 * rate**2)
    )
    return q, v, a


def _size(model: RobotModel) -> float:
    """Reach of the table, metres; 1 where all lengths are zero."""
    table = model.table
    reach = float(np.sqrt(table.d**2 + table.r**2 + table.b**2).sum())
    return reach if reach > 0 else 1.0


def _natural_sizes(model: RobotModel, drive: bool, size: float) -> Array:
    """Parameters of a robot of this size and unit mass, in the units of the regressor's rows."""
    link = [size**2] * 6 + [size] * 3 + [1.0]
    slides = model.table.sigma[model.table.joint_rows] == PRISMATIC
    rotor = np.where(slides, 1.0, size**2)
    rate = sqrt(9.81 / size)
    drives = [rotor, rotor * rate, rotor * rate**2, rotor * rate**2] if drive else []
    sizes = np.concatenate((np.tile(link, model.f), *drives))
    rest = len(parameter_names(model, drive)) - len(sizes)
    return np.concatenate((sizes, np.full(rest, size**2)))
