"""Direct kinematic model: the twist that joint velocities give.

Seed book section 1.3.1.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector, batch_shape
from ..model import RobotModel, check_model
from .jacobians import Reference, jacobian


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
