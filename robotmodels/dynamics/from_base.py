"""Robot model with base parameters as standard parameters, and its inverse dynamics.

Book sections 1.5.2.2 and 1.5.3.

Returns
-------
RobotModel or ndarray
    A new model, or torques (..., n) as of `idm`. Geometry, base, tool and gravity are the model's.

Raises
------
InvalidValueError
    Base parameters of another robot (structure, geometry, gravity, couplings), or, for a model,
    with those of a friction model; NaN or infinity.
ShapeError
    Not one value for each base parameter, or motion of the wrong length.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact
from ..drive import DriveKind, DriveParameters, Transmission, drive_kinds
from ..errors import InvalidValueError
from ..friction import Friction, check_linear
from ..friction.protocols import basis_at
from ..inertia import InertialParameters
from ..model import RobotModel, check_model
from .inverse import idm

Base = Any
"""`BaseParameters`, which depend on this package."""


def base_model(model: RobotModel, base: Base, values: ArrayLike) -> RobotModel:
    """Robot model with base parameters as standard parameters, the others zero.

    Shapes: values (b,). `idm`, `ddm`, `mass_matrix` and the others, with drives included, are
    those of the robot. Its links are not physical (first moments without mass) and partly contain
    the rotors, so that single links and ``drive=False`` have no meaning.
    """
    if base.friction is not None:
        raise InvalidValueError(
            f"base: parameters of {type(base.friction).__name__} are among them, which a model "
            "does not contain; use idm_from_base, or base parameters without friction."
        )
    return _split(model, base, values)[0]


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

    ``values`` are (b,), ``q, v, a`` (..., n) and the torques (..., n).

    Examples
    --------
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> from robotmodels.robots import load
    >>> arm, motion = load("puma560"), np.ones((3, 6))
    >>> base = base_parameters(arm)
    >>> tau = idm_from_base(arm, base, base.values(arm), *motion)
    >>> bool(np.allclose(tau, idm(arm, *motion), rtol=1e-12))
    True
    """
    robot, extra = _split(model, base, values)
    tau = idm(robot, q, v, a, wrench, friction=friction)
    if extra is not None and base.friction is not None:
        tau = tau + (basis_at(check_linear(base.friction), v, q) * extra).sum(axis=-2)
    return tau


def _split(model: RobotModel, base: Base, values: ArrayLike) -> tuple[RobotModel, Array | None]:
    """The robot of base parameters, and the parameters (k, n) of a friction model among them."""
    check_model(model)
    base.check(model)
    f, n, K = model.f, model.n, model.transmission
    motors = np.array(() if K is None else K.coupled_motors, dtype=np.int64) - 1
    kinds = drive_kinds(base.drive)
    couplings = [kind.coupling for kind in kinds if kind.coupling is not None]
    linear = () if base.friction is None else check_linear(base.friction).kinds
    sizes = [10 * f, n * len(kinds), motors.size * len(couplings), n * len(linear)]
    whole = np.zeros(sum(sizes))
    whole[base.kept] = as_exact(values, (len(base.kept),), "values")
    links, drives, coupled, extra = np.split(whole, np.cumsum(sizes)[:-1])
    robot = model.with_inertia(InertialParameters(links.reshape(f, 10)))
    if kinds:
        terms = {kind.value: getattr(model.drive, kind.value) for kind in DriveKind}
        terms |= zip((kind.value for kind in kinds), drives.reshape(-1, n), strict=True)
        robot = robot.with_drive(DriveParameters(**terms))
    if K is not None and coupled.size:
        terms = {name: getattr(K, name).copy() for name in ("Iam", "Fvm", "Fcm")}
        for name, of_motors in zip(couplings, coupled.reshape(len(couplings), -1), strict=True):
            terms[name][motors] = of_motors
        robot = robot.with_transmission(Transmission(K.matrix, K.offset, **terms))
    return robot, extra.reshape(-1, n) if linear else None
