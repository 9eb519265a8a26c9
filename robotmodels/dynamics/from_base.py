"""Inverse dynamics from base parameters alone, with the fewest operations."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_exact, as_vector, batch_rows, batch_shape
from ..drive import DriveKind, DriveParameters, Drives, Transmission, drive_kinds
from ..errors import InvalidValueError
from ..friction import Friction, check_friction, check_linear
from ..friction.protocols import basis_at, torque_at
from ..inertia import InertialParameters
from ..model import RobotModel, check_model
from .wrench import wrench_torque


class Base(Protocol):
    """What is asked of base parameters; `BaseParameters` has it."""

    @property
    def model(self) -> RobotModel:
        """The robot they belong to."""
        ...

    @property
    def drive(self) -> Drives:
        """Which drive parameters are among them."""
        ...

    @property
    def kept(self) -> NDArray[np.int64]:
        """Numbers of the kept ones among the standard parameters."""
        ...

    @property
    def friction(self) -> Friction | None:
        """The friction model whose parameters are among them, after those of the drives."""
        ...

    def check(self, model: RobotModel) -> None:
        """Refuse a robot that they do not belong to."""
        ...


def base_model(model: RobotModel, base: Base, values: ArrayLike) -> RobotModel:
    """The robot whose standard parameters are base parameters, and zero where none is kept.

    It moves as the robot does: `idm`, `ddm`, `mass_matrix`, `coriolis_matrix` and
    `gravity_torque`, with drives included, are the same. Its links are no real bodies (first
    moments without mass), so nothing is to be read from one of them alone, and the rotors are
    partly in the links: what ``drive=False`` leaves has no meaning of its own where the base
    parameters include drives.

    Parameters
    ----------
    model : RobotModel
        The robot; geometry, base, tool and gravity are taken from it.
    base : BaseParameters
        Which b parameters are kept.
    values : array_like, shape (b,)
        Their values, such as identified ones or ``base.values(model)``.

    Returns
    -------
    RobotModel
        A new model. Drive parameters of the kinds that are not among the base ones are those of the
        model.

    Raises
    ------
    InvalidValueError
        Base parameters of another robot (structure, geometry, gravity, couplings), or with those
        of a friction model, which a robot has no place for; NaN or infinity.
    ShapeError
        Not one value for each base parameter.

    References
    ----------
    Seed book section 1.5.3.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> arm = load("puma560")
    >>> base = base_parameters(arm)
    >>> base_model(arm, base, base.values(arm)).inertia.mass
    array([0., 0., 0., 0., 0., 0.])
    """
    robot, friction = _split(model, base, values)
    if friction is not None:
        raise InvalidValueError(
            f"base: parameters of {type(base.friction).__name__} are among them, which a robot has "
            "no place for; idm_from_base takes them, or ask for base parameters without friction."
        )
    return robot


def _split(model: RobotModel, base: Base, values: ArrayLike) -> tuple[RobotModel, Array | None]:
    """The robot of base parameters, and the parameters (k, n) of a friction model among them."""
    check_model(model)
    base.check(model)
    b = as_exact(values, (len(base.kept),), "values")
    f, n = model.f, model.n
    coupled = np.array(_coupled(model), dtype=np.int64) - 1
    asked = drive_kinds(base.drive)
    joined = [kind.coupling for kind in asked if kind.coupling is not None]
    own = 10 * f + n * len(asked)
    count = own + coupled.size * len(joined)
    kinds = 0 if base.friction is None else len(check_linear(base.friction).kinds)
    full = np.zeros(count + kinds * n)
    full[base.kept] = b
    extra = full[count:].reshape(kinds, n) if kinds else None
    bodies = model.with_inertia(InertialParameters(full[: 10 * f].reshape(f, 10)))
    if not asked:
        return bodies, extra
    drives = dict(
        zip((kind.value for kind in asked), full[10 * f : own].reshape(-1, n), strict=True)
    )
    rest = {kind.value: getattr(model.drive, kind.value) for kind in DriveKind}
    bodies = bodies.with_drive(DriveParameters(**{**rest, **drives}))
    if coupled.size and joined and (K := model.transmission) is not None:
        terms = {"Iam": K.Iam, "Fvm": K.Fvm, "Fcm": K.Fcm}
        for name, values_of in zip(joined, full[own:count].reshape(len(joined), -1), strict=True):
            terms[name] = np.zeros(n)
            terms[name][coupled] = values_of
        bodies = bodies.with_transmission(Transmission(K.matrix, K.offset, **terms))
    return bodies, extra


def idm_from_base(
    model: RobotModel,
    base: Base,
    values: ArrayLike,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    wrench: ArrayLike | None = None,
    friction: Friction | None = None,
) -> Array:
    """Inverse dynamic model from base parameters alone: the torques of `idm`, drives included.

    The recursion leaves out what zero parameters multiply, which most are in a base set.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints; its own inertial parameters are not used.
    base : BaseParameters
        Which b parameters are kept.
    values : array_like, shape (b,)
        Their values. Of the kinds of drive parameters that are not among them, those of the model
        act.
    q, v, a : array_like, shape (..., n)
        Joint variables (rad or m), velocities and accelerations; the leading axes broadcast.
    wrench : array_like, shape (..., 6), optional
        What the tool exerts on the environment, see `idm`.
    friction : Friction, optional
        A friction model that acts besides the drives, see `idm`, and besides one whose parameters
        are among the base ones.

    Returns
    -------
    ndarray, shape (..., n)
        Torques (N m) or forces (N) in table order.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong length, or with NaN or infinity; base parameters of another robot.

    References
    ----------
    Seed book section 1.5.3; W. Khalil and J.-F. Kleinfinger, "Minimum operations and minimum
    parameters of the dynamic models of tree structure robots", IEEE J-RA 3(6), 1987.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> from robotmodels.dynamics import idm
    >>> arm = load("puma560")
    >>> base = base_parameters(arm)
    >>> motion = np.ones((3, 6))
    >>> tau = idm_from_base(arm, base, base.values(arm), *motion)
    >>> bool(np.allclose(tau, idm(arm, *motion), rtol=1e-12))
    True
    """
    robot, extra = _split(model, base, values)
    n = model.n
    q, v, a = as_vector(q, n, "q"), as_vector(v, n, "v"), as_vector(a, n, "a")
    if wrench is not None:
        wrench = as_vector(wrench, 6, "wrench")
        batch_shape((q, v, a, wrench), ("q", "v", "a", "wrench"))
    if friction is not None:
        check_friction(friction, n)
    from ..kernels.base_newton_euler import base_torques

    batch, rows = batch_rows((q, v, a), ("q", "v", "a"))
    tau = np.empty(rows[0].shape)
    pi = robot.inertia.values
    base_torques(*rows, *robot.chain, pi, robot.gravity, needed_parts(robot), tau)
    tau = tau.reshape(*batch, n)
    if (drives := robot.drive_matrices) is not None:
        tau = tau + drives.torque(v, a)
    if wrench is not None:
        tau = tau + wrench_torque(model, q, wrench)
    if friction is not None:
        tau = tau + torque_at(friction, v, q)
    if extra is not None and base.friction is not None:
        tau = tau + (basis_at(check_linear(base.friction), v, q) * extra).sum(axis=-2)
    return tau


def needed_parts(model: RobotModel) -> NDArray[np.int64]:
    """Flags of the computations that zero parameters make unnecessary."""
    from ..kernels.base_newton_euler import (
        INERTIA,
        LOADED,
        MASS,
        MOMENTS,
        OFFSET,
        ROTATES,
        TWISTED,
    )

    pi, antecedent = model.inertia.values, model.table.antecedent
    bits = MASS * (pi[:, 9] != 0.0) + MOMENTS * pi[:, 6:9].any(axis=1)
    bits = (bits + INERTIA * pi[:, :6].any(axis=1)).astype(np.int64)
    bits |= LOADED * (bits > 0)
    bits |= np.where(bits & MOMENTS, ROTATES, 0)
    C = model.chain.rotation
    about_x = (C[:, 0] == [1.0, 0.0, 0.0]).all(axis=1) & (C[:, 1:, 0] == 0.0).all(axis=1)
    about_x &= (C[:, 1, 1] == C[:, 2, 2]) & (C[:, 1, 2] == -C[:, 2, 1])
    moves = (model.table.sigma == 1) | model.chain.position.any(axis=1)
    bits |= OFFSET * moves + TWISTED * (about_x & (model.table.sigma == 0))
    for k in range(model.f - 1, -1, -1):
        if (outer := int(antecedent[k]) - 1) >= 0 and bits[k] & LOADED:
            bits[outer] |= LOADED | (ROTATES if moves[k] else 0)
    return bits


def _coupled(model: RobotModel) -> tuple[Any, ...]:
    return () if model.transmission is None else model.transmission.coupled_motors
