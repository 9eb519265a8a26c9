"""Static models: joint torques that balance a wrench, and the wrench that joint torques balance.

A wrench ``[f; m]`` is exerted by the tool on the environment, as in `idm`; by the principle of
virtual work ``tau = J^T w`` (Khalil and Dombre, Modeling, identification and control of robots,
section 5.9).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_number, as_vector, batch_rows, batch_shape
from .._outcomes import Outcome, Result
from ..geometry import PRISMATIC
from ..model import RobotModel, check_model
from ..se3 import as_pose
from .jacobians import Reference, complete_svd, jacobian
from .lengths import length_of

_EPS = float(np.finfo(np.float64).eps)


class StaticStatus(Outcome):
    """Solvability of ``J^T w = tau``; fits int8. Each member has a ``sentence``."""

    DETERMINED = 0, "One wrench balances the torques."
    UNDETERMINED = (
        1, "Many wrenches balance the torques, as the structure carries some; the least is given.",
    )  # fmt: skip
    UNBALANCED = (
        2, "No wrench balances the torques: the residual would move joints while the tool rests.",
    )  # fmt: skip
    UNBALANCED_UNDETERMINED = (
        3, "No wrench balances the residual, which would move joints while the tool rests; many "
        "balance the other torques, as the structure carries some; the least is given.",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class StaticWrench(Result):
    """The wrench that joint torques balance. Read-only.

    Parameters
    ----------
    wrench : ndarray, shape (..., 6)
        Force and moment ``[f; m]`` (N, N m) exerted on the environment: of all that come nearest to
        the torques the smallest.
    status : ndarray of int8, shape (...)
        Codes of `StaticStatus`.
    undetermined : ndarray of int64, shape (...)
        Number k of independent wrenches that need no torque: 6 minus the rank of J.
    directions : ndarray, shape (..., 6, 6)
        Its first k rows are such wrenches (N, N m), the others are zero; any multiple of them may
        be added to the wrench. They are orthonormal once moments are divided by the length.
    residual : ndarray, shape (..., n)
        Part of the torques that no wrench balances (N m, N).
    """

    wrench: Array
    status: NDArray[np.int8]
    undetermined: NDArray[np.int64]
    directions: Array
    residual: Array
    outcomes = StaticStatus


def static_torque(
    model: RobotModel,
    q: ArrayLike,
    wrench: ArrayLike,
    frame: str | int | None = None,
    reference: Reference = "world_aligned",
    gravity: bool = False,
) -> Array:
    """Joint torques that balance a wrench on a frame, ``J^T w``; also called the static model.

    Khalil and Dombre, section 5.9.2.

    Parameters
    ----------
    wrench : array_like, shape (..., 6)
        Force and moment ``[f; m]`` (N, N m) that the frame exerts on the environment.
    gravity : bool
        Whether the torques that hold the links against gravity are added. Drives are not: at rest
        dry friction can be anything within its bounds.

    Returns
    -------
    ndarray, shape (..., n)
        Torques (N m) or forces (N) in table order.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> static_torque(arm, [0.0, 0.0], [0.0, 10.0, 0.0, 0.0, 0.0, 0.0])
    array([3., 0.])
    """
    check_model(model)
    q, w = as_vector(q, model.n, "q"), as_vector(wrench, 6, "wrench")
    batch_shape((q, w), ("q", "wrench"))
    tau = np.einsum("...ij,...i->...j", jacobian(model, q, frame, reference), w, order="C")
    return tau + _weight_torque(model, q) if gravity else tau


def transported_wrench(wrench: ArrayLike, T: Any) -> Array:
    """The same wrench at another point and in other axes: ``f' = R f``, ``m' = R m + P x R f``.

    Khalil and Dombre, section 5.9.1.

    Parameters
    ----------
    wrench : array_like, shape (..., 6)
        Force and moment ``[f; m]`` (N, N m) in a frame, about its origin.
    T : array_like, shape (..., 4, 4)
        Pose of that frame in the frame in which the wrench is wanted; the leading axes broadcast.

    Returns
    -------
    ndarray, shape (..., 6)
        Force and moment about the origin of the other frame, in its axes.
    """
    w, T = as_vector(wrench, 6, "wrench"), as_pose(T)
    batch_shape((w, T[..., 0, :]), ("wrench", "T"))
    R, P = T[..., :3, :3], T[..., :3, 3]
    force = np.einsum("...ij,...j->...i", R, w[..., :3])
    moment = np.einsum("...ij,...j->...i", R, w[..., 3:]) + np.cross(P, force)
    return np.concatenate((force, moment), axis=-1)


def static_wrench(
    model: RobotModel,
    q: ArrayLike,
    tau: ArrayLike,
    frame: str | int | None = None,
    reference: Reference = "world_aligned",
    gravity: bool = False,
    length: float | None = None,
    tolerance: float = 1e-9,
) -> StaticWrench:
    """Wrench on the environment that joint torques hold in equilibrium, the inverse static model.

    It solves ``J^T w = tau``. Where J has less than six independent rows, some wrenches need no
    torque, because the structure carries them; where the robot can move while the frame rests,
    some torques are balanced by no wrench. Both are reported row by row.

    Khalil and Dombre, sections 5.8.1 (singular value decomposition) and 5.9.

    Parameters
    ----------
    tau : array_like, shape (..., n)
        Torques (N m) or forces (N); the leading axes broadcast.
    gravity : bool
        Whether ``tau`` holds the links against gravity too. Drive friction is never taken off.
    length : float, optional
        Metres that make forces comparable with moments and forces of prismatic joints with
        torques: they decide which wrench is the smallest. Default `characteristic_length`.
    tolerance : float
        Singular values of the dimensionless Jacobian below this part of the largest count as
        zero; a residual below this part of the torques, or of the size of rounding, as balanced.

    Examples
    --------
    Stretched out, a planar arm carries any force along itself without torque.

    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.se3 import translation
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]),
    ...                             tool=translation(0.2, 0, 0))
    >>> found = static_wrench(arm, [0.0, 0.0], [5.0, 2.0])
    >>> found.wrench[[1, 5]].round(9), found.status == StaticStatus.UNDETERMINED
    (array([10., 0.]), np.True_)
    """
    check_model(model)
    n = model.n
    q, tau = as_vector(q, n, "q"), as_vector(tau, n, "tau")
    batch = batch_shape((q, tau), ("q", "tau"))
    L = length_of(model, frame, length)
    threshold = as_number(tolerance, "tolerance", above=0.0, below=1.0)
    weight = _weight_torque(model, q) if gravity else np.zeros(n)
    # All in N m: joint forces times the length, forces times the length
    joints = np.where(model.table.sigma[model.table.joint_rows] == PRISMATIC, L, 1.0)
    rows = np.repeat((1.0 / L, 1.0), 3)
    J = rows[:, None] * jacobian(model, q, frame, reference) * joints
    required = np.broadcast_to(joints * (tau - weight), (*batch, n))
    J = np.broadcast_to(J, (*batch, 6, n))
    U, s, Vt = complete_svd(J)
    kept = s > threshold * s[..., :1]
    along = np.where(kept, np.einsum("...ki,...i->...k", Vt[..., :n], required), 0.0)
    inverse = np.divide(1.0, s, out=np.zeros_like(s), where=kept)
    wrench = np.einsum("...ik,...k->...i", U, inverse * along) * rows
    balanced = np.einsum("...ki,...k->...i", Vt[..., :n], along)
    rank = kept.sum(axis=-1)
    # free wrenches first; moments come back with the length, so that [f; m / length] is the norm
    carried = np.where(kept[..., None, :], 0.0, U)[..., ::-1] * (L * rows)[:, None]
    residual = required - balanced
    least = np.min(np.where(kept, s, np.inf), axis=-1, initial=np.inf)
    condition = np.where(rank > 0, s[..., 0] / least, 0.0)
    allowed = np.maximum(threshold, 16 * n * _EPS * np.maximum(condition, 1.0))
    # torques that only hold the weight leave no more than rounding of it
    size = np.linalg.norm(joints * tau, axis=-1) + np.linalg.norm(joints * weight, axis=-1)
    unbalanced = np.linalg.norm(residual, axis=-1) > allowed * size
    status = (rank < 6).astype(np.int8) + 2 * unbalanced.astype(np.int8)
    return StaticWrench(
        wrench, status, 6 - rank, np.swapaxes(carried, -1, -2) + 0.0, residual / joints
    )


def _weight_torque(model: RobotModel, q: Array) -> Array:
    """Torques that hold the links against gravity."""
    from ..kernels.torques import joint_torques

    batch, (rows,) = batch_rows((q,), ("q",))
    rest = np.zeros_like(rows)
    out = np.empty(rows.shape)
    joint_torques(rows, rest, rest, model.chain, model.inertia.values, model.gravity, out)
    return out.reshape(*batch, model.n)
