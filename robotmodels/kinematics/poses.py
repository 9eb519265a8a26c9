"""Direct geometric model: poses of the tool and of every frame of the table.

Book section 1.2.2. One configuration goes through Pinocchio, a batch through the compiled
recursions in table order; tests hold both equal.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .._arrays import Array, batch_rows
from ..model import RobotModel, as_positions, check_model


def dgm(model: RobotModel, q: ArrayLike, frame: str | int | None = None) -> Array:
    """Direct geometric model: pose of the tool or another frame in the world.

    Also called forward kinematics, ``fkine``, forward geometry.

    Book eq. [1.4] and [1.10].

    Returns
    -------
    ndarray, shape (..., 4, 4)
        World pose, ``Z T(0, tip) E`` for the tool; position in metres.

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
    q = as_positions(model, q)
    twin = model.twin
    point = twin.frame(frame)
    if q.ndim == 1 and twin.serves_poses:
        data = twin.data()
        pin.forwardKinematics(twin.model, data, twin.to_pin(q))
        placement = pin.updateFramePlacement(twin.model, data, point.pin_id)
        return np.ascontiguousarray(placement.homogeneous)
    from ..kernels.poses import tip_poses

    batch, (rows,) = batch_rows((q,), ("q",))
    out = np.empty((rows.shape[0], 4, 4))
    tip_poses(rows, model.chain, *point.kernel_arguments, out)
    return out.reshape(*batch, 4, 4)


def link_poses(model: RobotModel, q: ArrayLike) -> Array:
    """World poses of all frames of the table, R_1 to R_f; the pose of the tool is `dgm`.

    Book eq. [1.4].

    Returns
    -------
    ndarray, shape (..., f, 4, 4)
        Poses, positions in metres.
    """
    check_model(model)
    q = as_positions(model, q)
    twin = model.twin
    if q.ndim == 1 and twin.serves_poses:
        data = twin.data()
        pin.forwardKinematics(twin.model, data, twin.to_pin(q))
        poses = np.empty((model.f, 4, 4))
        for j in range(model.f):
            frame = twin.frame(j + 1)
            poses[j] = pin.updateFramePlacement(twin.model, data, frame.pin_id).homogeneous
        return poses
    from ..kernels.poses import link_poses as kernel

    batch, (rows,) = batch_rows((q,), ("q",))
    out = np.empty((rows.shape[0], model.f, 4, 4))
    kernel(rows, model.chain, out)
    return out.reshape(*batch, model.f, 4, 4)
