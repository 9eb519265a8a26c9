"""Velocity and force ellipsoids of the tool, of joint velocities or torques of one size.

With the joints in the ball ``sum_i (v_i / s_i)^2 <= 1`` the velocities ``J v`` fill an ellipsoid
whose axes are the left singular vectors of ``J S`` and whose radii are its singular values. The
forces that torques of a ball balance fill the dual one: same axes, reciprocal radii.
"""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_number, as_reals, as_vector
from .._choices import chosen
from ..errors import InvalidValueError, ShapeError
from ..model import RobotModel, check_model
from .ellipsoid import Ellipsoid, EllipsoidQuantity
from .jacobians import complete_svd, jacobian
from .lengths import length_of
from .poses import dgm


class TwistPart(Enum):
    """Half of a twist or a wrench."""

    LINEAR = "linear velocity or force"
    ANGULAR = "angular velocity or moment"


class OtherPart(Enum):
    """Condition on the half of the twist or wrench that an ellipsoid does not show."""

    FREE = "may be anything"
    ZERO = "is zero"


_VELOCITY = {
    TwistPart.LINEAR: EllipsoidQuantity.LINEAR_VELOCITY,
    TwistPart.ANGULAR: EllipsoidQuantity.ANGULAR_VELOCITY,
}
_FORCE = {
    TwistPart.LINEAR: EllipsoidQuantity.FORCE,
    TwistPart.ANGULAR: EllipsoidQuantity.MOMENT,
}


def velocity_ellipsoid(
    model: RobotModel,
    q: ArrayLike,
    part: TwistPart | str = TwistPart.LINEAR,
    frame: str | int | None = None,
    joint_velocity: ArrayLike | None = None,
    other: OtherPart | str = OtherPart.FREE,
    length: float | None = None,
    tolerance: float = 1e-9,
) -> Ellipsoid:
    """Velocities of a frame that joint velocities of one size give; also manipulability ellipsoid.

    Khalil and Dombre, section 5.8.2; T. Yoshikawa, "Manipulability of robotic mechanisms",
    International Journal of Robotics Research 4(2), 1985.

    Parameters
    ----------
    part : TwistPart
        Whether linear or angular velocities are shown.
    joint_velocity : array_like, shape (n,), optional
        Half axes of the ellipsoid of joint velocities (rad/s, m/s): the velocity of each joint
        alone. Default 1 rad/s and 1 m/s; ``model.table.velocity`` compares joints by their limits.
        0 locks a joint.
    other : OtherPart
        Whether the other half of the twist may be anything or is zero, as of a tool that shifts
        without turning.
    length, tolerance : float, optional
        Radii below ``tolerance`` of the size of the Jacobian, ``[J_v; length J_w] S`` for the
        linear part, are zero.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.se3 import translation
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]),
    ...                             tool=translation(0.2, 0, 0))
    >>> disc = velocity_ellipsoid(arm, [0.0, np.pi / 2])
    >>> disc.radii.round(4), int(disc.rank)
    (array([0.3811, 0.1575, 0.    ]), 2)
    """
    check_model(model)
    part, other = chosen(TwistPart, part, "part"), chosen(OtherPart, other, "other")
    scale = joint_scale(model, joint_velocity, "joint_velocity", 0.0)
    axes, radii, rank = _principal(model, q, part, frame, scale, other, length, tolerance)
    return Ellipsoid(_VELOCITY[part], dgm(model, q, frame)[..., :3, 3], axes, radii, rank)


def force_ellipsoid(
    model: RobotModel,
    q: ArrayLike,
    part: TwistPart | str = TwistPart.LINEAR,
    frame: str | int | None = None,
    joint_torque: ArrayLike | None = None,
    other: OtherPart | str = OtherPart.ZERO,
    length: float | None = None,
    tolerance: float = 1e-9,
) -> Ellipsoid:
    """Forces on the environment that joint torques of one size balance.

    It has the axes and the reciprocal radii of the velocity ellipsoid with
    ``joint_velocity = 1 / joint_torque``: of that with all angular velocities for forces without a
    moment, of that without angular velocity for forces with the moment that costs least torque.
    Weight and friction are left out.

    Khalil and Dombre, sections 5.8.2 and 5.9.3; Yoshikawa 1985.

    Parameters
    ----------
    part : TwistPart
        Whether forces or moments are shown.
    joint_torque : array_like, shape (n,), optional
        Half axes of the ellipsoid of torques (N m, N), above 0: the torque of each joint alone.
        Default 1 N m and 1 N; ``model.table.effort`` are the limits.
    other : OtherPart
        Whether the other half of the wrench is zero or may be anything.
    """
    check_model(model)
    part, other = chosen(TwistPart, part, "part"), chosen(OtherPart, other, "other")
    torque = joint_scale(model, joint_torque, "joint_torque", np.finfo(np.float64).tiny)
    # projecting on one half is dual to cutting at zero of the other
    dual = OtherPart.FREE if other is OtherPart.ZERO else OtherPart.ZERO
    axes, sigma, rank = _principal(model, q, part, frame, 1.0 / torque, dual, length, tolerance)
    radii = np.divide(1.0, sigma, out=np.full(sigma.shape, np.inf), where=sigma > 0)[..., ::-1]
    axes = _right_handed(axes[..., ::-1])
    return Ellipsoid(_FORCE[part], dgm(model, q, frame)[..., :3, 3], axes, radii, rank)


def _principal(
    model: RobotModel,
    q: ArrayLike,
    part: TwistPart,
    frame: str | int | None,
    scale: Array,
    other: OtherPart,
    length: float | None,
    tolerance: float,
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Axes, radii (zero below the threshold) and rank of a velocity ellipsoid."""
    L = length_of(model, frame, length)
    relative = as_number(tolerance, "tolerance", above=0.0, below=1.0)
    J = jacobian(model, as_vector(q, model.n, "q"), frame) * scale
    v, w = J[..., :3, :], J[..., 3:, :] * L
    size = np.linalg.norm(J[..., :3, :], axis=(-2, -1)) + np.linalg.norm(w, axis=(-2, -1))
    threshold = (relative * size)[..., None]
    shown, hidden = (v, w) if part is TwistPart.LINEAR else (w, v)
    if other is OtherPart.ZERO:
        # joint velocities that leave the other half at rest
        _, s, Vt = np.linalg.svd(hidden, full_matrices=False)
        used = np.where((s > threshold)[..., None], Vt, 0.0)
        shown = shown - (shown @ np.swapaxes(used, -1, -2)) @ used
    U, s, _ = complete_svd(shown)
    radii = np.where(s > threshold, s, 0.0)
    if part is TwistPart.ANGULAR:
        radii = radii / L
    return _right_handed(U), radii, (radii > 0).sum(axis=-1)


def _right_handed(axes: Array) -> Array:
    """The same axes as a rotation matrix, the largest entry of the first two columns positive."""
    first = axes[..., :2]
    largest = np.take_along_axis(first, np.abs(first).argmax(axis=-2)[..., None, :], axis=-2)
    first = first * np.where(largest < 0, -1.0, 1.0)
    third = np.cross(first[..., 0], first[..., 1])
    return np.concatenate((first, third[..., None]), axis=-1)


def joint_scale(model: RobotModel, value: ArrayLike | None, name: str, least: float) -> Array:
    """Check the joint weights of an ellipsoid, shape (n,)."""
    if value is None:
        return np.ones(model.n)
    scale = as_reals(value, name)
    if scale.shape != (model.n,):
        raise ShapeError(f"{name}: expected one for each of the {model.n} joints, shape "
                         f"({model.n},), got {scale.shape}.")  # fmt: skip
    wrong = ~((scale >= least) & np.isfinite(scale))
    if wrong.any():
        i = int(wrong.argmax())
        bound = "from 0 up" if least == 0 else "above 0"
        raise InvalidValueError(
            f"{name}: expected finite numbers {bound}, got {scale[i]:g} for joint "
            f"{model.table.joint_names[i]!r}. A joint without a limit has an infinite one: give it "
            "a number here."
        )
    return scale
