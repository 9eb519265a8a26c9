"""Torques of the rigid bodies alone."""

from __future__ import annotations

import numpy as np

from .._arrays import Array, batch_rows
from ..model import RobotModel


def rigid_torques(model: RobotModel, q: Array, v: Array, a: Array) -> Array:
    """Torques of the rigid bodies under gravity, by the compiled recursion."""
    from ..kernels.newton_euler import joint_torques

    batch, rows = batch_rows((q, v, a), ("q", "v", "a"))
    out = np.empty(rows[0].shape)
    joint_torques(*rows, *model.chain, model.inertia.values, model.gravity, out)
    return out.reshape(*batch, model.n)
