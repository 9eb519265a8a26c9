"""Basic Jacobians and their time derivatives, from the screws of the joints.

Book section 1.3.1.2. One configuration goes through Pinocchio, a batch through the compiled
recursions in table order; tests hold both equal.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector, batch_rows
from ..errors import InvalidValueError
from ..model import RobotModel, as_positions, check_model

Reference = Literal["world_aligned", "local", "world"]
COMPONENTS = ("vx", "vy", "vz", "wx", "wy", "wz")

# Pinocchio's name of each reference, and the number by which the kernels know it
_REFERENCES = {
    "world_aligned": (pin.LOCAL_WORLD_ALIGNED, 0),
    "local": (pin.LOCAL, 1),
    "world": (pin.WORLD, 2),
}


def jacobian(
    model: RobotModel,
    q: ArrayLike,
    frame: str | int | None = None,
    reference: Reference = "world_aligned",
) -> Array:
    """Kinematic (basic, geometric) Jacobian: joint velocities to the twist of a frame.

    Book sections 1.3.1.1 and 1.3.1.2.

    Parameters
    ----------
    reference : {"world_aligned", "local", "world"}
        ``"world_aligned"``: velocity of the frame's origin and angular velocity in world axes;
        ``"local"``: the same in the frame's own axes; ``"world"``: the spatial Jacobian, velocity
        of the point of the body that is at the world's origin, in world axes.

    Returns
    -------
    ndarray, shape (..., 6, n)
        Rows ``[v; w]``, m/s and rad/s per joint velocity, columns in table order.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> jacobian(arm, [0.0, 0.0])[1]
    array([0.3, 0. ])
    """
    check_model(model)
    q = as_positions(model, q)
    pin_reference, number = reference_of(reference)
    twin = model.twin
    point = twin.frame(frame)
    if q.ndim == 1 and twin.serves_poses:
        J = pin.computeFrameJacobian(
            twin.model, twin.data(), twin.to_pin(q), point.pin_id, pin_reference
        )
        # with one joint Pinocchio returns a flat array
        return twin.from_pin(J.reshape(6, model.n))
    from ..kernels.poses import jacobians

    batch, (rows,) = batch_rows((q,), ("q",))
    out = np.empty((rows.shape[0], 6, model.n))
    jacobians(rows, model.chain, *point.kernel_arguments, number, out)
    return out.reshape(*batch, 6, model.n)


def jacobian_rate(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    frame: str | int | None = None,
    reference: Reference = "world_aligned",
) -> Array:
    """Time derivative of the Jacobian along a motion, entry by entry.

    Returns
    -------
    ndarray, shape (..., 6, n)
        ``dJ/dt``; the acceleration of the frame is ``J a + dJ/dt v`` for ``"world_aligned"``.
    """
    check_model(model)
    q, v = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    pin_reference, number = reference_of(reference)
    twin = model.twin
    point = twin.frame(frame)
    if q.ndim == v.ndim == 1 and twin.serves_poses and model.n:  # Pinocchio crashes without joints
        data = twin.data()
        pin.computeJointJacobiansTimeVariation(twin.model, data, twin.to_pin(q), twin.to_pin(v))
        pin.updateFramePlacement(twin.model, data, point.pin_id)
        rate = pin.getFrameJacobianTimeVariation(twin.model, data, point.pin_id, pin_reference)
        return twin.from_pin(rate.reshape(6, model.n))
    from ..kernels.poses import jacobian_rates

    batch, rows = batch_rows((q, v), ("q", "v"))
    out = np.empty((rows[0].shape[0], 6, model.n))
    jacobian_rates(*rows, model.chain, *point.kernel_arguments, number, out)
    return out.reshape(*batch, 6, model.n)


def reference_of(reference: str) -> tuple[pin.ReferenceFrame, int]:
    """Pinocchio's name of a reference, and the kernels' number."""
    try:
        return _REFERENCES[reference]
    except (KeyError, TypeError):
        raise InvalidValueError(
            f"reference: expected one of {', '.join(map(repr, _REFERENCES))}, got {reference!r}."
        ) from None


def complete_svd(J: Array) -> tuple[Array, Array, Array]:
    """U (..., m, m), m singular values and Vt of matrices (..., m, n), zero columns added."""
    m, n = J.shape[-2:]
    padded = np.concatenate((J, np.zeros((*J.shape[:-1], max(m - n, 0)))), axis=-1)
    return np.linalg.svd(padded, full_matrices=False)
