"""Direct kinematic model: the twist that joint velocities give, and its time derivative.

Book section 1.3.1.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector, batch_rows, batch_shape
from ..model import RobotModel, check_model
from .jacobians import Reference, jacobian, reference_of


def dkm(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    frame: str | int | None = None,
    reference: Reference = "world_aligned",
) -> Array:
    """Direct kinematic model: twist of the tool or another frame, ``J(q) v``.

    Also called forward velocity kinematics.

    Book eq. [1.18].

    Returns
    -------
    ndarray, shape (..., 6)
        Twist ``[v; w]`` in m/s and rad/s.

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


def dkm_second_order(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    frame: str | int | None = None,
    reference: Reference = "world_aligned",
) -> Array:
    """Second order direct kinematic model: time derivative of a twist, ``J a + dJ/dt v``.

    Also called forward acceleration kinematics. For ``"world_aligned"`` these are the acceleration
    of the frame's origin and the angular acceleration; for the other references the derivatives of
    the twist's entries, as in `jacobian_rate`.

    Book eq. [1.18], differentiated.

    Returns
    -------
    ndarray, shape (..., 6)
        Linear then angular part, m/s^2 and rad/s^2, without gravity.
    """
    check_model(model)
    q, v, a = (as_vector(x, model.n, name) for x, name in ((q, "q"), (v, "v"), (a, "a")))
    pin_reference, number = reference_of(reference)
    twin = model.twin
    point = twin.frame(frame)
    if q.ndim == v.ndim == a.ndim == 1 and twin.serves_poses:
        data = twin.data()
        pin.forwardKinematics(twin.model, data, *map(twin.to_pin, (q, v, a)))
        pin.updateFramePlacement(twin.model, data, point.pin_id)
        of = (
            pin.getFrameClassicalAcceleration
            if reference == "world_aligned"
            else pin.getFrameAcceleration
        )
        return of(twin.model, data, point.pin_id, pin_reference).vector.copy()
    from ..kernels.poses import accelerations

    batch, rows = batch_rows((q, v, a), ("q", "v", "a"))
    out = np.empty((rows[0].shape[0], 6))
    accelerations(*rows, model.chain, *point.kernel_arguments, number, out)
    return out.reshape(*batch, 6)
