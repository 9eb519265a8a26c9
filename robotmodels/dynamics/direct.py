"""Direct dynamic model, with joints that mimic others, and errors of mass matrices.

Where joints mimic others, ``q = K q_c + q_0`` with a singular K. With G the columns of K that are
not zero, ``v = G v_c``, and the forces of the constraint do no work:
``G^T (M G a_c + h - tau) = 0`` (book section 1.2.1, last note, and 1.5.1).
"""

from __future__ import annotations

import warnings
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector, batch_rows, batch_shape
from ..drive import Transmission, check_all_or_none
from ..errors import InertiaError, InvalidValueError, SingularMassMatrixError
from ..friction import Friction, check_friction
from ..friction.protocols import torque_at
from ..inertia import InertiaWarning
from ..model import RobotModel, check_model
from .inverse import rigid_torques, wrench_torque
from .parts import mass_matrix

_FOLLOWS = 1e-9  # relative to 1 + |q|: rounding of joints that follow others
_ROUNDING = 4.0 * float(np.finfo(np.float64).eps)  # of eigenvalues, for each joint
_PART = 0.05  # least share of the largest joint motion of a named joint


def ddm(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    wrench: ArrayLike | None = None,
    drive: bool = True,
    friction: Friction | None = None,
) -> Array:
    """Direct (forward) dynamic model: joint accelerations under torques, the inverse of `idm`.

    Mimic joints follow, and ``K^T tau`` is that of ``idm``.

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
        As `idm`; a singular transmission that is not one of mimic joints; mimic joints that do not
        follow in ``q`` or ``v``.

    Warns
    -----
    InertiaWarning
        A link has a negative mass, though the mass matrix is positive definite.

    Examples
    --------
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.robots import load
    >>> arm, q, v, a = load("puma560"), *np.ones((3, 6))
    >>> bool(np.allclose(ddm(arm, q, v, idm(arm, q, v, a)), a))
    True
    """
    check_model(model)
    check_all_or_none(drive)
    n = model.n
    q, v, tau = as_vector(q, n, "q"), as_vector(v, n, "v"), as_vector(tau, n, "tau")
    w = np.zeros(6) if wrench is None else as_vector(wrench, 6, "wrench")
    batch_shape((q, v, tau, w), ("q", "v", "tau", "wrench"))
    if friction is not None:
        tau = tau - torque_at(check_friction(friction, n), v, q)
    drives = model.drive_matrices if drive else None
    if drives is not None:
        tau = tau - drives.torque(v, None)
    if wrench is not None:
        tau = tau - wrench_torque(model, q, w)
    K = model.transmission
    if K is not None and (free := free_motion(K)) is not None:
        out = following_accelerations(model, K, free, q, v, tau, drive)
    else:
        from ..kernels.mass import joint_accelerations

        batch, rows = batch_rows((q, v, tau), ("q", "v", "tau"))
        out = np.empty(rows[0].shape)
        rotor = np.zeros((n, n)) if drives is None else np.ascontiguousarray(drives.rotor)
        bodies = model.chain, model.inertia.values, model.gravity
        failed = joint_accelerations(*rows, *bodies, rotor, out)
        if failed != -1:  # the number of a sample, or its -2 - number if the matrix is indefinite
            sample = failed if failed >= 0 else -2 - failed
            with np.errstate(over="ignore", invalid="ignore"):
                M = mass_matrix(model, rows[0][sample], drive)
            where = f" (first in sample {sample} of {len(out)})" if batch else ""
            raise mass_matrix_error(model, M, drive, where)
        out = out.reshape(*batch, n)
    if (model.inertia.mass < 0.0).any():
        warnings.warn(
            f"not physical in {model.name!r}: {model.inertia.consistency().not_physical}. The mass "
            "matrix is positive definite here; the accelerations are those of the equations.",
            InertiaWarning,
            stacklevel=2,
        )
    return out


@lru_cache(maxsize=32)
def free_motion(transmission: Transmission) -> Array | None:
    """Joint velocities per free coordinate, shape (n, m); None if all joints are free."""
    if transmission.is_invertible:
        return None
    if not transmission.is_mimicry:
        n, rank = transmission.n, transmission.rank
        raise InvalidValueError(
            f"transmission: the coupling matrix K is singular, it has rank {rank} of {n}, so that "
            "motor torques do not determine the motion. Correct it (columns of mimic joints are "
            "zero), or remove it with model.with_transmission(None)."
        )
    G = transmission.free
    return G / np.linalg.norm(G, axis=0)


def following_accelerations(
    model: RobotModel, K: Transmission, free: Array, q: Array, v: Array, tau: Array, drive: bool
) -> Array:
    """Joint accelerations with mimic joints; raises where these do not follow their masters.

    Shapes: free (n, m); q, v, tau (..., n) -> (..., n).
    """
    for name, values in (("q", q - K.offset), ("v", v)):
        away = np.abs(values - values @ np.linalg.pinv(free).T @ free.T)
        size = 1.0 + np.abs(values).max(axis=-1, initial=0.0, keepdims=True)
        if (away > _FOLLOWS * size).any():
            j = int(np.argmax(away.reshape(-1, model.n).max(axis=0)))
            raise InvalidValueError(
                f"{name}: the joints of {model.name!r} that mimic others do not follow them here "
                f"(joint {j + 1} is off by {away[..., j].max():.3g}). Map encoder variables by "
                "model.transmission (to_joint, matrix), or take model.with_transmission(None)."
            )
    batch, (q, v, tau) = batch_rows((q, v, tau), ("q", "v", "tau"))
    rest = (tau - rigid_torques(model, q, v, np.zeros_like(q))) @ free
    M = free.T @ mass_matrix(model, q, drive) @ free
    size = unit_sizes(M)
    scaled = M / (size[:, :, None] * size[:, None, :])
    definite = np.linalg.eigvalsh(scaled)[:, 0] > _ROUNDING * free.shape[1]
    for i in np.flatnonzero(~definite)[:1]:
        where = f" (first in sample {i} of {len(q)})" if batch else ""
        raise mass_matrix_error(model, M[i], drive, where, free)
    a_c = np.linalg.solve(scaled, (rest / size)[..., None])[..., 0] / size
    return (a_c @ free.T).reshape(*batch, model.n)


def mass_matrix_error(
    model: RobotModel, M: Array, drive: bool, where: str = "", free: Array | None = None
) -> InertiaError | SingularMassMatrixError:
    """Exception for a mass matrix that is singular or not positive definite.

    Shapes: M (m, m), free (n, m).
    """
    title = f"the mass matrix of {model.name!r} is"
    advice = "Give inertial parameters (with_inertia), or rotor inertias Ia (with_drive)."
    if not np.isfinite(M).all():
        return SingularMassMatrixError(f"{title} singular{where}: its entries overflow. {advice}")
    m, size = len(M), unit_sizes(M)
    values, vectors = np.linalg.eigh(M / (size[:, None] * size))
    if values[0] < -_ROUNDING * m:
        reasons = []
        if links := model.inertia.consistency().not_physical:
            reasons.append(f"Not physical: {links}.")
        if drive:
            coupled = np.zeros(0) if model.transmission is None else model.transmission.Iam
            more = f" and, of coupled motors, Iam = {coupled.tolist()}" if coupled.any() else ""
            reasons.append(f"Check the rotor inertias Ia = {model.drive.Ia.tolist()}{more}.")
        return InertiaError(
            f"{title} not positive definite{where}: {(values < 0.0).sum()} of its {m} eigenvalues "
            f"are negative. {' '.join(reasons)} Correct these parameters; standard_parameters(...) "
            "finds the nearest physical ones."
        )
    null = vectors[:, values <= max(_ROUNDING * m, values[0])] / size[:, None]
    motion = np.abs(null if free is None else free @ null).max(axis=1)
    joints = [str(j + 1) for j in np.flatnonzero(motion > _PART * motion.max())]
    return SingularMassMatrixError(
        f"{title} singular{where}: it has rank {m - null.shape[1]} of {m}, and a motion of "
        f"joint{'s' * (len(joints) > 1)} {', '.join(joints)} moves no inertia. {advice}"
    )


def unit_sizes(M: Array) -> Array:
    """Units (..., m) in which mass matrices (..., m, m) have unit (or zero) diagonals."""
    size = np.sqrt(np.abs(np.diagonal(M, axis1=-2, axis2=-1)))
    return np.where(size > 0.0, size, 1.0)
