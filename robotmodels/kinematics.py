"""Direct geometric and kinematic models: poses, Jacobians, velocities.

Seed book sections 1.2.2, 1.3.1.1 and 1.3.1.2. One configuration goes through Pinocchio, a batch
through the compiled recursions in table order; tests hold both equal.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from ._arrays import Array, as_vector, batch_rows, batch_shape
from .errors import InvalidValueError
from .model import RobotModel, check_model

Reference = Literal["world_aligned", "local", "world"]

# Pinocchio's name of each reference, and the number by which the kernels know it
_REFERENCES = {
    "world_aligned": (pin.LOCAL_WORLD_ALIGNED, 0),
    "local": (pin.LOCAL, 1),
    "world": (pin.WORLD, 2),
}


def dgm(model: RobotModel, q: ArrayLike, frame: str | int | None = None) -> Array:
    """Direct geometric model: pose of the tool or another frame in the world.

    Also called forward kinematics, ``fkine``, forward geometry.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q : array_like, shape (..., n)
        Joint variables in table order, rad or m.
    frame : str or int, optional
        Name or number of a frame; default the tool.

    Returns
    -------
    ndarray, shape (..., 4, 4)
        World pose, ``Z T(0, tip) E`` for the tool; position in metres.

    Raises
    ------
    ShapeError, InvalidValueError
        ``q`` of the wrong length, or with NaN or infinity.
    FrameNotFoundError
        No such frame; the nearest names are in the message.

    References
    ----------
    Seed book eq. [1.4] and [1.10].

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> dgm(arm, [np.pi / 2, 0.0])[:3, 3].round(12)
    array([0. , 0.3, 0. ])
    >>> dgm(arm, np.zeros((1000, 2))).shape
    (1000, 4, 4)
    """
    check_model(model)
    q = as_vector(q, model.n, "q")
    twin = model.twin
    point = twin.frame(frame)
    if q.ndim == 1 and twin.serves_poses:
        data = twin.data()
        pin.forwardKinematics(twin.model, data, twin.to_pin(q))
        placement = pin.updateFramePlacement(twin.model, data, point.pin_id)
        return np.ascontiguousarray(placement.homogeneous)
    from .kernels.poses import tip_poses

    batch, (rows,) = batch_rows((q,), ("q",))
    out = np.empty((rows.shape[0], 4, 4))
    tip_poses(rows, *model.chain, *point.kernel_arguments, out)
    return out.reshape(*batch, 4, 4)


def link_poses(model: RobotModel, q: ArrayLike) -> Array:
    """World poses of all frames of the table, R_1 to R_f.

    Also called ``fkine_all``. The tool is not among them: see `dgm`.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints and f frames.
    q : array_like, shape (..., n)
        Joint variables, rad or m.

    Returns
    -------
    ndarray, shape (..., f, 4, 4)
        Poses, positions in metres.

    Raises
    ------
    ShapeError, InvalidValueError
        ``q`` of the wrong length, or with NaN or infinity.

    References
    ----------
    Seed book eq. [1.4].

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> link_poses(arm, [0.0, 0.0])[:, 0, 3]
    array([0. , 0.3])
    """
    check_model(model)
    q = as_vector(q, model.n, "q")
    twin = model.twin
    if q.ndim == 1 and twin.serves_poses:
        data = twin.data()
        pin.forwardKinematics(twin.model, data, twin.to_pin(q))
        poses = np.empty((model.f, 4, 4))
        for j in range(model.f):
            frame = twin.frame(j + 1)
            poses[j] = pin.updateFramePlacement(twin.model, data, frame.pin_id).homogeneous
        return poses
    from .kernels.poses import link_poses as kernel

    batch, (rows,) = batch_rows((q,), ("q",))
    out = np.empty((rows.shape[0], model.f, 4, 4))
    kernel(rows, *model.chain, out)
    return out.reshape(*batch, model.f, 4, 4)


def jacobian(
    model: RobotModel,
    q: ArrayLike,
    frame: str | int | None = None,
    reference: Reference = "world_aligned",
) -> Array:
    """Kinematic (basic, geometric) Jacobian: joint velocities to the twist of a frame.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q : array_like, shape (..., n)
        Joint variables, rad or m.
    frame : str or int, optional
        Name or number of a frame; default the tool.
    reference : {"world_aligned", "local", "world"}
        ``"world_aligned"``: velocity of the frame's origin and angular velocity in world axes;
        ``"local"``: the same in the frame's own axes; ``"world"``: the spatial Jacobian, velocity
        of the point of the body that is at the world's origin, in world axes.

    Returns
    -------
    ndarray, shape (..., 6, n)
        Rows ``[v; w]``, m/s and rad/s per joint velocity, columns in table order.

    Raises
    ------
    ShapeError, InvalidValueError
        ``q`` of the wrong length, or with NaN or infinity; an unknown reference.
    FrameNotFoundError
        No such frame.

    References
    ----------
    Seed book sections 1.3.1.1 and 1.3.1.2.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> jacobian(arm, [0.0, 0.0])[1]
    array([0.3, 0. ])
    """
    check_model(model)
    q = as_vector(q, model.n, "q")
    pin_reference, number = _reference(reference)
    twin = model.twin
    point = twin.frame(frame)
    if q.ndim == 1 and twin.serves_poses:
        J = pin.computeFrameJacobian(
            twin.model, twin.data(), twin.to_pin(q), point.pin_id, pin_reference
        )
        # with one joint Pinocchio returns a flat array
        return twin.from_pin(J.reshape(6, model.n))
    from .kernels.jacobians import jacobians

    batch, (rows,) = batch_rows((q,), ("q",))
    out = np.empty((rows.shape[0], 6, model.n))
    jacobians(rows, *model.chain, *point.kernel_arguments, number, out)
    return out.reshape(*batch, 6, model.n)


def jacobian_rate(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    frame: str | int | None = None,
    reference: Reference = "world_aligned",
) -> Array:
    """Time derivative of the Jacobian along a motion, entry by entry.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q, v : array_like, shape (..., n)
        Joint variables (rad or m) and velocities; the leading axes broadcast.
    frame : str or int, optional
        Name or number of a frame; default the tool.
    reference : {"world_aligned", "local", "world"}
        As in `jacobian`.

    Returns
    -------
    ndarray, shape (..., 6, n)
        ``dJ/dt``; the acceleration of the frame is ``J a + dJ/dt v`` for ``"world_aligned"``.

    Raises
    ------
    ShapeError, InvalidValueError, FrameNotFoundError
        As `jacobian`.

    References
    ----------
    Seed book section 1.3.1.2 (differentiated).

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> jacobian_rate(arm, [0.0, 0.0], [1.0, 0.0])[0]
    array([-0.3,  0. ])
    """
    check_model(model)
    q, v = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    pin_reference, number = _reference(reference)
    twin = model.twin
    point = twin.frame(frame)
    if q.ndim == v.ndim == 1 and twin.serves_poses and model.n:  # Pinocchio crashes without joints
        data = twin.data()
        pin.computeJointJacobiansTimeVariation(twin.model, data, twin.to_pin(q), twin.to_pin(v))
        pin.updateFramePlacement(twin.model, data, point.pin_id)
        rate = pin.getFrameJacobianTimeVariation(twin.model, data, point.pin_id, pin_reference)
        return twin.from_pin(rate.reshape(6, model.n))
    from .kernels.jacobians import jacobian_rates

    batch, rows = batch_rows((q, v), ("q", "v"))
    out = np.empty((rows[0].shape[0], 6, model.n))
    jacobian_rates(*rows, *model.chain, *point.kernel_arguments, number, out)
    return out.reshape(*batch, 6, model.n)


def dkm(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    frame: str | int | None = None,
    reference: Reference = "world_aligned",
) -> Array:
    """Direct kinematic model: twist of the tool or another frame, ``J(q) v``.

    Also called forward velocity kinematics.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q, v : array_like, shape (..., n)
        Joint variables (rad or m) and velocities; the leading axes broadcast.
    frame : str or int, optional
        Name or number of a frame; default the tool.
    reference : {"world_aligned", "local", "world"}
        As in `jacobian`.

    Returns
    -------
    ndarray, shape (..., 6)
        Twist ``[v; w]`` in m/s and rad/s.

    Raises
    ------
    ShapeError, InvalidValueError, FrameNotFoundError
        As `jacobian`.

    References
    ----------
    Seed book eq. [1.18].

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> dkm(arm, [0.0, 0.0], [2.0, 0.0])
    array([0. , 0.6, 0. , 0. , 0. , 2. ])
    """
    check_model(model)
    q, v = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    batch_shape((q, v), ("q", "v"))
    J = jacobian(model, q, frame, reference)
    if q.ndim == v.ndim == 1:
        return J @ v
    return np.einsum("...ij,...j->...i", J, v, order="C")


def _reference(reference: str) -> tuple[pin.ReferenceFrame, int]:
    try:
        return _REFERENCES[reference]
    except (KeyError, TypeError):
        raise InvalidValueError(
            f"reference: expected one of {', '.join(map(repr, _REFERENCES))}, got {reference!r}."
        ) from None
