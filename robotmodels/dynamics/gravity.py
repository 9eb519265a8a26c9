"""Gravity torques."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector
from ..model import RobotModel, check_model
from .rigid import rigid_torques


def gravity_torque(model: RobotModel, q: ArrayLike) -> Array:
    """Torques that hold the robot still against gravity, also called ``gravload``, Q(q).

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q : array_like, shape (..., n)
        Joint variables, rad or m.

    Returns
    -------
    ndarray, shape (..., n)
        Torques (N m) or forces (N).

    Raises
    ------
    ShapeError, InvalidValueError
        ``q`` of the wrong length, or with NaN or infinity.

    References
    ----------
    Seed book section 1.5.1.1.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> gravity_torque(arm, [0.0, 0.0])
    array([0., 0.])
    """
    check_model(model)
    q = as_vector(q, model.n, "q")
    twin = model.twin
    if q.ndim == 1 and twin.serves_dynamics:
        g = pin.computeGeneralizedGravity(twin.model, twin.data(), twin.to_pin(q))
        return twin.from_pin(g)
    zero = np.zeros(model.n)
    return rigid_torques(model, q, zero, zero)
