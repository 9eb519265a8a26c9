"""Direct dynamic model."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector, batch_rows, batch_shape
from ..drive import check_all_or_none
from ..friction import Friction, check_friction
from ..friction.protocols import torque_at
from ..model import RobotModel, check_model
from .inverse import wrench_torque
from .mass_errors import mass_matrix_error, warn_of_negative_mass
from .mimicry import check_follows, following_accelerations, free_motion
from .parts import mass_matrix


def ddm(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    wrench: ArrayLike | None = None,
    drive: bool = True,
    friction: Friction | None = None,
) -> Array:
    """Direct dynamic model: joint accelerations under given torques, the inverse of `idm`.

    Also called forward dynamics. Where joints mimic others (a transmission ``q = K q_c + q_0``
    with a singular K), they follow: with G the columns of K that are not zero, ``a = G a_c``,
    ``G^T M G a_c = G^T (tau - C v - g - ...)``, and ``K^T tau`` is that of ``idm(model, q, v, a)``.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q, v, tau : array_like, shape (..., n)
        Joint variables (rad or m), velocities and torques; the leading axes broadcast.
    wrench, drive, friction
        As for `idm`.

    Returns
    -------
    ndarray, shape (..., n)
        Accelerations, rad/s^2 or m/s^2.

    Raises
    ------
    SingularMassMatrixError
        The mass matrix cannot be inverted; the joints that move no inertia are named.
    InertiaError
        The mass matrix is not positive definite; the links that are not physical are named.
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity; a singular transmission that is
        not one of mimic joints; mimic joints that do not follow in ``q`` or ``v``.

    Warns
    -----
    InertiaWarning
        A link has a negative mass, though the mass matrix is positive definite.

    References
    ----------
    Seed book section 1.5 (introduction), 1.5.1 and, for the coupling, 1.2.1.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.inertia import InertialParameters
    >>> link = InertialParameters.from_com([2.0], [[0.1, 0, 0]], [np.zeros((3, 3))])
    >>> pendulum = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]), link)
    >>> ddm(pendulum, [0.0], [0.0], [0.04]).round(12)
    array([2.])
    """
    check_model(model)
    check_all_or_none(drive)
    n = model.n
    q, v, tau = as_vector(q, n, "q"), as_vector(v, n, "v"), as_vector(tau, n, "tau")
    batch_shape((q, v, tau), ("q", "v", "tau"))
    if wrench is not None:
        wrench = as_vector(wrench, 6, "wrench")
        batch_shape((q, v, tau, wrench), ("q", "v", "tau", "wrench"))
    if friction is not None:
        tau = tau - torque_at(check_friction(friction, n), v, q)
    drives = model.drive_matrices if drive else None
    if drives is not None:
        tau = tau - drives.torque(v, None)
    if wrench is not None:
        tau = tau - wrench_torque(model, q, wrench)
    free = None if model.transmission is None else free_motion(model.transmission)
    if free is not None:
        check_follows(model, free, q, v)
        out = following_accelerations(model, free, q, v, tau, drive)
        warn_of_negative_mass(model)
        return out
    from ..kernels.direct_dynamics import joint_accelerations

    batch, rows = batch_rows((q, v, tau), ("q", "v", "tau"))
    out = np.empty(rows[0].shape)
    rotor = np.zeros((n, n)) if drives is None else np.ascontiguousarray(drives.rotor)
    pi, gravity = model.inertia.values, model.gravity
    failed = joint_accelerations(*rows, *model.chain, pi, gravity, rotor, out)
    if failed != -1:  # the number of a sample, or its -2 - number if the matrix is indefinite
        sample = failed if failed >= 0 else -2 - failed
        with np.errstate(over="ignore", invalid="ignore"):
            M = mass_matrix(model, rows[0][sample], drive)
        where = f" (first in sample {sample} of {len(out)})" if batch else ""
        raise mass_matrix_error(model, M, drive, where)
    warn_of_negative_mass(model)
    return out.reshape(*batch, n)
