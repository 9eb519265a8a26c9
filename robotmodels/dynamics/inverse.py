"""Inverse dynamic model, and its parts by gravity and by a wrench of the tool."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector, batch_rows, batch_shape
from ..drive import check_all_or_none
from ..friction import Friction, check_friction
from ..friction.protocols import torque_at
from ..inertia import InertiaWarning
from ..model import RobotModel, as_positions, check_model

_CHUNK = 1024  # Jacobians per piece, for the processor's cache
_WORLD_ALIGNED = 0  # frame code of the kernels


def idm(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike | None = None,
    a: ArrayLike | None = None,
    wrench: ArrayLike | None = None,
    drive: bool = True,
    friction: Friction | None = None,
) -> Array:
    """Inverse dynamic model (``rnea``, ``rne``): joint torques of a motion.

    ``tau = M(q) a + C(q, v) v + Q(q) + J^T wrench + Ia a + Fv v + Fc sign(v) + offset + friction``

    It is linear in the inertial parameters; base parameters and negative masses are allowed, too.

    A robot without ``v`` or ``a`` is at rest.

    Returns
    -------
    ndarray, shape (..., n)
        Torques (N m) or forces (N) in table order.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity.

    Warns
    -----
    InertiaWarning
        Once for a robot that has neither masses nor drives.

    References
    ----------
    Book sections 1.5.1 and 1.5.2.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> idm(load("puma560"), [0.0] * 6).round(2)
    array([-1.25, 40.45,  0.97, -0.22, -0.19, -0.25])
    """
    check_model(model)
    check_all_or_none(drive)
    n = model.n
    rest = np.zeros(n)
    q = as_positions(model, q)
    v = rest if v is None else as_vector(v, n, "v")
    a = rest if a is None else as_vector(a, n, "a")
    if model.twin.torques_warn and friction is None:
        warn_without_masses(model)
    return motion_torques(model, q, v, a, wrench, drive, friction)


def motion_torques(
    model: RobotModel,
    q: Array,
    v: Array,
    a: Array,
    wrench: ArrayLike | None = None,
    drive: bool = True,
    friction: Friction | None = None,
) -> Array:
    """Joint torques of a motion, see `idm`; without a warning for a robot without masses."""
    n = model.n
    if wrench is not None:
        wrench = as_vector(wrench, 6, "wrench")
        batch_shape((q, v, a, wrench), ("q", "v", "a", "wrench"))
    if friction is not None:
        check_friction(friction, n)
    twin = model.twin
    if q.ndim == v.ndim == a.ndim == 1 and twin.serves_dynamics:
        to_pin = twin.to_pin
        rigid = pin.rnea(twin.model, twin.data(), to_pin(q), to_pin(v), to_pin(a))
        tau = twin.from_pin(rigid)
    else:
        tau = rigid_torques(model, q, v, a)
    if drive and (drives := model.drive_matrices) is not None:
        tau = tau + drives.torque(v, a)
    if wrench is not None:
        tau = tau + wrench_torque(model, q, wrench)
    if friction is not None:
        tau = tau + torque_at(friction, v, q)
    return tau


def warn_without_masses(model: RobotModel, stacklevel: int = 3) -> None:
    """Warn once for a robot whose torques are zero because it has no masses."""
    model.twin.torques_warn = False
    warnings.warn(
        f"{model.name}: it has no masses and no drives, so its torques are zero. Give it inertial "
        "parameters: with_inertia(...).",
        InertiaWarning,
        stacklevel=stacklevel,
    )


def rigid_torques(model: RobotModel, q: Array, v: Array, a: Array) -> Array:
    """Torques of the rigid bodies under gravity, by the compiled recursion."""
    from ..kernels.torques import joint_torques

    return batched(joint_torques, model, {"q": q, "v": v, "a": a}, (model.n,), model.gravity)


def batched(
    kernel: Callable[..., Any],
    model: RobotModel,
    arrays: Mapping[str, Array],
    core: tuple[int, ...],
    *more: Array,
) -> Array:
    """Result (..., *core) of a compiled recursion in table order at joint vectors (..., n)."""
    batch, rows = batch_rows(tuple(arrays.values()), tuple(arrays))
    out = np.empty((len(rows[0]), *core))
    kernel(*rows, model.chain, model.inertia.values, *more, out)
    return out.reshape((*batch, *core))


def wrench_torque(model: RobotModel, q: Array, w: Array) -> Array:
    """``J^T w``: joint torques (..., n) of a wrench (..., 6) that the tool exerts."""
    twin = model.twin
    tool = twin.frame(None)
    if q.ndim == w.ndim == 1 and twin.serves_poses:
        J = pin.computeFrameJacobian(
            twin.model, twin.data(), twin.to_pin(q), tool.pin_id, pin.LOCAL_WORLD_ALIGNED
        )
        return twin.from_pin(w @ J.reshape(6, model.n))
    from ..kernels.poses import jacobians

    batch, rows = batch_rows((q, w), ("q", "wrench"))
    tau = np.empty(rows[0].shape)
    for start in range(0, len(tau), _CHUNK):
        piece = slice(start, start + _CHUNK)
        J = np.empty((len(tau[piece]), 6, model.n))
        jacobians(rows[0][piece], model.chain, *tool.kernel_arguments, _WORLD_ALIGNED, J)
        np.einsum("ki,kij->kj", rows[1][piece], J, out=tau[piece])
    return tau.reshape(*batch, model.n)
