"""What gravity pulls on: its magnitude, and its part along each axis; none is exactly 0."""

from __future__ import annotations

import numpy as np

from .._arrays import Array
from ..model import RobotModel
from .restraint import EXACT

EARTH = 9.81
"""Gravity that motion and torques are compared with, m/s^2."""


def weight_of(model: RobotModel, tolerance: float = EXACT) -> float:
    """Magnitude of gravity, exactly 0 where it is none."""
    weight = float(np.linalg.norm(model.gravity))
    return weight if weight > tolerance * EARTH else 0.0


def loads_of(model: RobotModel, tolerance: float = EXACT) -> list[float]:
    """Gravity along the axis of each frame with every joint at zero; none is exactly 0."""
    weight = weight_of(model, tolerance)
    if weight == 0.0:
        return [0.0] * model.f
    gravity = np.asarray(model.gravity) @ model.chain.base_rotation
    slight = tolerance * weight
    loads = [float(gravity @ axes_in_base(model, j)[:, 2]) for j in range(1, model.f + 1)]
    return [0.0 if abs(load) <= slight else load for load in loads]


def axes_in_base(model: RobotModel, j: int) -> Array:
    """Axes of frame j in frame 0 with every joint at zero."""
    R = np.eye(3)
    for number in model.table.path(j) if j else ():
        R = R @ model.chain.rotation[number - 1]
    return R
