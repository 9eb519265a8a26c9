"""Inverse and direct dynamic models and their parts.

Seed book section 1.5. One sample goes through Pinocchio, a batch through the compiled recursions
in table order; so does every model that Pinocchio cannot hold (first moments without mass,
negative mass, as in sets of base parameters).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from ._arrays import Array, as_vector, batch_rows, batch_shape
from .errors import SingularMassMatrixError
from .model import RobotModel, check_model

_SINGULAR = 1e-14
_CHUNK = 1024  # Jacobians held at a time: they stay in the cache
_WORLD_ALIGNED = 0  # the kernels' number of that reference


def idm(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    wrench: ArrayLike | None = None,
    drive: bool = True,
) -> Array:
    """Inverse dynamic model: joint torques of a motion.

    Also called inverse dynamics, ``rnea``, ``rne``.

    ``tau = M(q) a + C(q, v) v + g(q) + J^T wrench + Ia a + Fv v + Fc sign(v) + offset``

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q, v, a : array_like, shape (..., n)
        Joint variables (rad or m), velocities and accelerations; the leading axes broadcast.
    wrench : array_like, shape (..., 6), optional
        Force and moment ``[f; m]`` (N, N m) that the tool exerts on the environment, at the tool
        point, in world axes.
    drive : bool
        Whether rotor inertia, friction and offsets are included.

    Returns
    -------
    ndarray, shape (..., n)
        Torques (N m) or forces (N) in table order.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity.

    References
    ----------
    Seed book sections 1.5.1 (eq. of motion, friction, rotors, external forces) and 1.5.2.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.inertia import InertialParameters
    >>> link = InertialParameters.from_com([2.0], [[0.1, 0, 0]], [np.zeros((3, 3))])
    >>> pendulum = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]), link,
    ...                                  gravity=(0, -9.81, 0))
    >>> idm(pendulum, [0.0], [0.0], [0.0])
    array([1.962])
    """
    check_model(model)
    n = model.n
    q, v, a = as_vector(q, n, "q"), as_vector(v, n, "v"), as_vector(a, n, "a")
    if wrench is not None:
        wrench = as_vector(wrench, 6, "wrench")
        batch_shape((q, v, a, wrench), ("q", "v", "a", "wrench"))
    twin = model.twin
    if q.ndim == v.ndim == a.ndim == 1 and twin.serves_dynamics:
        to_pin = twin.to_pin
        rigid = pin.rnea(twin.model, twin.data(), to_pin(q), to_pin(v), to_pin(a))
        tau = twin.from_pin(rigid)
    else:
        tau = _rigid_torques(model, q, v, a)
    if drive and (drives := model.drive_matrices) is not None:
        tau = tau + drives.torque(v, a)
    if wrench is not None:
        tau = tau + _wrench_torque(model, q, wrench)
    return tau


def ddm(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    wrench: ArrayLike | None = None,
    drive: bool = True,
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
        Whether rotor inertia, friction and offsets are included.

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
    drives = model.drive_matrices if drive else None
    if drives is not None:
        tau = tau - drives.torque(v, None)
    if wrench is not None:
        tau = tau - _wrench_torque(model, q, wrench)
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
    from .kernels.direct_dynamics import joint_accelerations

    batch, rows = batch_rows((q, v, tau), ("q", "v", "tau"))
    out = np.empty(rows[0].shape)
    rotor = np.zeros((n, n)) if drives is None else np.ascontiguousarray(drives.rotor)
    pi, gravity = model.inertia.values, model.gravity
    singular = joint_accelerations(*rows, *model.chain, pi, gravity, rotor, out)
    if singular >= 0:
        raise _singular(model, f" (first in sample {singular} of {rows[0].shape[0]})")
    return out.reshape(*batch, n)


def mass_matrix(model: RobotModel, q: ArrayLike, drive: bool = True) -> Array:
    """Joint-space inertia matrix M(q), also called A(q) or generalised inertia.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q : array_like, shape (..., n)
        Joint variables, rad or m.
    drive : bool
        Whether rotor inertia (and that of coupled motors) is included.

    Returns
    -------
    ndarray, shape (..., n, n)
        Symmetric, kg m^2 (kg m, kg for prismatic joints).

    Raises
    ------
    ShapeError, InvalidValueError
        ``q`` of the wrong length, or with NaN or infinity.

    References
    ----------
    Seed book sections 1.5.1.1, 1.5.1.3 and 1.5.1.5.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.inertia import InertialParameters
    >>> link = InertialParameters.from_com([2.0], [[0.1, 0, 0]], [np.zeros((3, 3))])
    >>> mass_matrix(RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]), link), [0.0])
    array([[0.02]])
    """
    check_model(model)
    q = as_vector(q, model.n, "q")
    twin = model.twin
    if q.ndim == 1 and twin.serves_dynamics:
        upper = pin.crba(twin.model, twin.data(), twin.to_pin(q))
        M = np.where(_upper_triangle(model.n), upper, upper.T)
        if not twin.in_table_order:
            M = M[np.ix_(twin.order, twin.order)]
    else:
        from .kernels.mass_matrix import mass_matrices

        batch, (rows,) = batch_rows((q,), ("q",))
        M = np.empty((rows.shape[0], model.n, model.n))
        mass_matrices(rows, *model.chain, model.inertia.values, M)
        M = M.reshape(*batch, model.n, model.n)
    if drive and (drives := model.drive_matrices) is not None:
        M = M + drives.rotor
    return M


def coriolis_matrix(model: RobotModel, q: ArrayLike, v: ArrayLike) -> Array:
    """Matrix C(q, v) of Christoffel symbols: ``C v`` are the Coriolis and centrifugal torques.

    ``dM/dt - 2 C`` is skew-symmetric.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q, v : array_like, shape (..., n)
        Joint variables (rad or m) and velocities; the leading axes broadcast.

    Returns
    -------
    ndarray, shape (..., n, n)
        The matrix, torque per velocity.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity.

    References
    ----------
    Seed book sections 1.5.1.1 and 1.5.1.3; S. Echeandia and P. M. Wensing, "Numerical methods to
    compute the Coriolis matrix and Christoffel symbols for rigid-body systems", ASME JCND 16(9),
    2021.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> coriolis_matrix(arm, [0.0, 0.0], [1.0, 1.0]).shape
    (2, 2)
    """
    check_model(model)
    q, v = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    twin = model.twin
    if q.ndim == v.ndim == 1 and twin.serves_dynamics:
        C = pin.computeCoriolisMatrix(twin.model, twin.data(), twin.to_pin(q), twin.to_pin(v))
        return np.array(C if twin.in_table_order else C[np.ix_(twin.order, twin.order)], order="C")
    from .kernels.coriolis import coriolis_matrices

    batch, rows = batch_rows((q, v), ("q", "v"))
    out = np.empty((rows[0].shape[0], model.n, model.n))
    coriolis_matrices(*rows, *model.chain, model.inertia.values, out)
    return out.reshape(*batch, model.n, model.n)


def gravity_torque(model: RobotModel, q: ArrayLike) -> Array:
    """Torques that hold the robot still against gravity, also called ``gravload``, Q(q).

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q : array_like, shape (..., n)
        Joint variables, rad or m.

    Returns
    -------
    ndarray, shape (..., n)
        Torques (N m) or forces (N).

    Raises
    ------
    ShapeError, InvalidValueError
        ``q`` of the wrong length, or with NaN or infinity.

    References
    ----------
    Seed book section 1.5.1.1.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> gravity_torque(arm, [0.0, 0.0])
    array([0., 0.])
    """
    check_model(model)
    q = as_vector(q, model.n, "q")
    twin = model.twin
    if q.ndim == 1 and twin.serves_dynamics:
        g = pin.computeGeneralizedGravity(twin.model, twin.data(), twin.to_pin(q))
        return twin.from_pin(g)
    zero = np.zeros(model.n)
    return _rigid_torques(model, q, zero, zero)


def kinetic_energy(model: RobotModel, q: ArrayLike, v: ArrayLike, drive: bool = True) -> Array:
    """Kinetic energy ``v^T M v / 2``.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q, v : array_like, shape (..., n)
        Joint variables (rad or m) and velocities; the leading axes broadcast.
    drive : bool
        Whether the rotors' energy is included.

    Returns
    -------
    ndarray, shape (...)
        Joules.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity.

    References
    ----------
    Seed book section 1.5.1.2.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.drive import DriveParameters
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]),
    ...                             drive=DriveParameters(Ia=[0.5]))
    >>> float(kinetic_energy(one, [0.0], [2.0]))
    1.0
    """
    check_model(model)
    q, v = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    twin = model.twin
    if q.ndim == v.ndim == 1 and twin.serves_dynamics:
        energy = np.float64(
            pin.computeKineticEnergy(twin.model, twin.data(), twin.to_pin(q), twin.to_pin(v))
        )
    else:
        from .kernels.energies import kinetic_energies

        batch, rows = batch_rows((q, v), ("q", "v"))
        energy = np.empty(rows[0].shape[0])
        kinetic_energies(*rows, *model.chain, model.inertia.values, energy)
        energy = energy.reshape(batch)
    if drive and (drives := model.drive_matrices) is not None:
        energy = energy + 0.5 * np.einsum("...i,ij,...j->...", v, drives.rotor, v)
    return np.asarray(energy)


def potential_energy(model: RobotModel, q: ArrayLike) -> Array:
    """Potential energy in the gravity field, zero for masses at the world's origin.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q : array_like, shape (..., n)
        Joint variables, rad or m.

    Returns
    -------
    ndarray, shape (...)
        Joules.

    Raises
    ------
    ShapeError, InvalidValueError
        ``q`` of the wrong length, or with NaN or infinity.

    References
    ----------
    Seed book section 1.5.1.2.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.inertia import InertialParameters
    >>> slide = InertialParameters.from_com([2.0], [[0, 0, 0]], [np.zeros((3, 3))])
    >>> lift = RobotModel.from_table(DHTable(antecedent=[0], sigma=[1]), slide)
    >>> round(float(potential_energy(lift, [0.5])), 12)
    9.81
    """
    check_model(model)
    q = as_vector(q, model.n, "q")
    twin = model.twin
    # Pinocchio leaves out what is fixed to the base
    if q.ndim == 1 and twin.serves_dynamics and twin.base_is_massless:
        return np.asarray(
            pin.computePotentialEnergy(twin.model, twin.data(), twin.to_pin(q)), dtype=np.float64
        )
    from .kernels.energies import potential_energies

    batch, (rows,) = batch_rows((q,), ("q",))
    energy = np.empty(rows.shape[0])
    potential_energies(rows, *model.chain, model.inertia.values, model.gravity, energy)
    return energy.reshape(batch)


def _rigid_torques(model: RobotModel, q: Array, v: Array, a: Array) -> Array:
    """Torques of the rigid bodies under gravity, by the compiled recursion."""
    from .kernels.newton_euler import joint_torques

    batch, rows = batch_rows((q, v, a), ("q", "v", "a"))
    out = np.empty(rows[0].shape)
    joint_torques(*rows, *model.chain, model.inertia.values, model.gravity, out)
    return out.reshape(*batch, model.n)


def _wrench_torque(model: RobotModel, q: Array, w: Array) -> Array:
    """``J^T w``: what the joints add so that the tool exerts a wrench."""
    twin = model.twin
    tool = twin.frame(None)
    if q.ndim == w.ndim == 1 and twin.serves_poses:
        J = pin.computeFrameJacobian(
            twin.model, twin.data(), twin.to_pin(q), tool.pin_id, pin.LOCAL_WORLD_ALIGNED
        )
        return twin.from_pin(w @ J.reshape(6, model.n))
    from .kernels.jacobians import jacobians

    batch, rows = batch_rows((q, w), ("q", "wrench"))
    tau = np.empty(rows[0].shape)
    J = np.empty((min(_CHUNK, rows[0].shape[0]), 6, model.n))
    for start in range(0, rows[0].shape[0], _CHUNK):
        piece = slice(start, start + _CHUNK)
        configurations = rows[0][piece]
        k = configurations.shape[0]
        jacobians(configurations, *model.chain, *tool.kernel_arguments, _WORLD_ALIGNED, J[:k])
        np.einsum("ki,kij->kj", rows[1][piece], J[:k], out=tau[piece])
    return tau.reshape(*batch, model.n)


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


@lru_cache
def _upper_triangle(n: int) -> NDArray[np.bool_]:
    return np.triu(np.ones((n, n), dtype=bool))


def _singular(model: RobotModel, where: str) -> SingularMassMatrixError:
    return SingularMassMatrixError(
        f"the mass matrix of {model.name!r} is singular{where}: some joint (or combination of "
        "joints) moves no inertia. Give inertial parameters with model.with_inertia(...), or "
        "rotor inertias Ia with model.with_drive(...)."
    )
