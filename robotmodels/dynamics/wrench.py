"""Joint torques of a wrench that the tool exerts."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from .._arrays import Array, batch_rows
from ..model import RobotModel

_CHUNK = 1024  # Jacobians held at a time: they stay in the cache
_WORLD_ALIGNED = 0  # the kernels' number of that reference


def wrench_torque(model: RobotModel, q: Array, w: Array) -> Array:
    """``J^T w``: what the joints add so that the tool exerts a wrench."""
    twin = model.twin
    tool = twin.frame(None)
    if q.ndim == w.ndim == 1 and twin.serves_poses:
        J = pin.computeFrameJacobian(
            twin.model, twin.data(), twin.to_pin(q), tool.pin_id, pin.LOCAL_WORLD_ALIGNED
        )
        return twin.from_pin(w @ J.reshape(6, model.n))
    from ..kernels.jacobians import jacobians

    batch, rows = batch_rows((q, w), ("q", "wrench"))
    tau = np.empty(rows[0].shape)
    J = np.empty((min(_CHUNK, rows[0].shape[0]), 6, model.n))
    for start in range(0, rows[0].shape[0], _CHUNK):
        piece = slice(start, start + _CHUNK)
        configurations = rows[0][piece]
        k = configurations.shape[0]
        jacobians(configurations, *model.chain, *tool.kernel_arguments, _WORLD_ALIGNED, J[:k])
        np.einsum("ki,kij->kj", rows[1][piece], J[:k], out=tau[piece])
    return tau.reshape(*batch, model.n)
