"""Direct dynamic model."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector, batch_rows, batch_shape
from ..errors import SingularMassMatrixError
from ..friction import Friction, check_friction
from ..model import RobotModel, check_model
from .mass import mass_matrix
from .wrench import wrench_torque

_SINGULAR = 1e-14


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

    Also called forward dynamics.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q, v, tau : array_like, shape (..., n)
        Joint variables (rad or m), velocities and torques; the leading axes broadcast.
    wrench : array_like, shape (..., 6), optional
        What the tool exerts on the environment, see `idm`.
    drive : bool
        Whether rotor inertia, friction and offsets of the model's drives are included.
    friction : Friction, optional
        A friction model that acts besides the Fv, Fc and offset of the drives, see
        `robotmodels.friction`; ``model.with_drive(...)`` takes those away.

    Returns
    -------
    ndarray, shape (..., n)
        Accelerations, rad/s^2 or m/s^2.

    Raises
    ------
    SingularMassMatrixError
        The mass matrix cannot be inverted: a joint moves no inertia.
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity.

    References
    ----------
    Seed book section 1.5 (introduction) and 1.5.1.

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
    n = model.n
    q, v, tau = as_vector(q, n, "q"), as_vector(v, n, "v"), as_vector(tau, n, "tau")
    batch_shape((q, v, tau), ("q", "v", "tau"))
    if wrench is not None:
        wrench = as_vector(wrench, 6, "wrench")
        batch_shape((q, v, tau, wrench), ("q", "v", "tau", "wrench"))
    if friction is not None:
        tau = tau - check_friction(friction, n).torque(v)
    drives = model.drive_matrices if drive else None
    if drives is not None:
        tau = tau - drives.torque(v, None)
    if wrench is not None:
        tau = tau - wrench_torque(model, q, wrench)
    twin = model.twin
    if n and q.ndim == v.ndim == tau.ndim == 1 and twin.serves_dynamics:
        to_pin = twin.to_pin
        h = twin.from_pin(pin.nonLinearEffects(twin.model, twin.data(), to_pin(q), to_pin(v)))
        M = mass_matrix(model, q, drive)
        # as the kernel does: coordinates of unit diagonal, so that units and sizes do not matter
        size = np.abs(np.diag(M))
        size = np.sqrt(np.where(size > 0.0, size, np.abs(M).max(axis=1)))
        scaled = M / (size[:, None] * size) if size.all() else np.zeros_like(M)
        if _is_singular(scaled):
            raise _singular(model, "")
        return np.asarray(np.linalg.solve(scaled, (tau - h) / size) / size, np.float64)
    from ..kernels.direct_dynamics import joint_accelerations

    batch, rows = batch_rows((q, v, tau), ("q", "v", "tau"))
    out = np.empty(rows[0].shape)
    rotor = np.zeros((n, n)) if drives is None else np.ascontiguousarray(drives.rotor)
    pi, gravity = model.inertia.values, model.gravity
    singular = joint_accelerations(*rows, *model.chain, pi, gravity, rotor, out)
    if singular >= 0:
        raise _singular(model, f" (first in sample {singular} of {rows[0].shape[0]})")
    return out.reshape(*batch, n)


def _is_singular(M: Array) -> bool:
    """Whether a symmetric matrix of unit diagonal is singular to rounding."""
    try:
        pivots = np.linalg.cholesky(M).diagonal()
        return bool((pivots * pivots).min() <= 4 * len(M) * np.finfo(np.float64).eps)
    except np.linalg.LinAlgError:
        # not positive definite: parameters that are not physical, or values out of range
        if not np.isfinite(M).all():
            return True
        return bool(np.linalg.cond(M) > 1 / _SINGULAR)


def _singular(model: RobotModel, where: str) -> SingularMassMatrixError:
    return SingularMassMatrixError(
        f"the mass matrix of {model.name!r} is singular{where}: some joint (or combination of "
        "joints) moves no inertia. Give inertial parameters with model.with_inertia(...), or "
        "rotor inertias Ia with model.with_drive(...)."
    )
