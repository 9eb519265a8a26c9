"""Jacobian of operational coordinates: derivatives of the direct geometric model.

Seed book section 1.3.1.1: ``J = df/dq`` of eq. [1.5], here as the rates of the coordinates at unit
twists, E, times the Jacobian of the frame.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_vector, batch_shape
from ...model import RobotModel, check_model
from ..jacobians import jacobian, jacobian_rate
from ..poses import dgm
from .conversion import near_coordinates
from .kinds import OrientationKind, orientation_kind
from .rates import coordinate_rates, coordinate_rates_rate


def coordinate_jacobian(
    model: RobotModel,
    q: ArrayLike,
    kind: str | OrientationKind,
    frame: str | int | None = None,
    near: ArrayLike | None = None,
) -> Array:
    """Jacobian of the operational coordinates, ``dX/dt = J(q) dq/dt``; the analytic Jacobian.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q : array_like, shape (..., n)
        Joint variables, rad or m.
    kind : OrientationKind or str
        How the orientation is written.
    frame : str or int, optional
        Name or number of a frame; default the tool.
    near : array_like, shape (..., m), optional
        The coordinates whose solution is meant, as in `operational_coordinates`.

    Returns
    -------
    ndarray, shape (..., m, n)
        Derivatives of the m coordinates (m and rad) with respect to the joints, in table order.
        Where the representation is singular (`is_representation_singular`; the robot need not be)
        the derivatives of the orientation do not exist, and their rows are NaN.

    Raises
    ------
    ShapeError, InvalidValueError
        ``q`` or ``near`` of the wrong length, or with NaN or infinity; an unknown kind.
    FrameNotFoundError
        No such frame.

    References
    ----------
    Seed book eq. [1.5] and section 1.3.1.1.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> coordinate_jacobian(arm, [0.0, 0.5], "rpy")[[0, 1, 3]]
    array([[0. , 0. ],
           [0.3, 0. ],
           [1. , 1. ]])
    """
    check_model(model)
    kind = orientation_kind(kind)
    T, near = _broadcast(dgm(model, q, frame), near, kind)
    return coordinate_rates(T, kind, near) @ jacobian(model, q, frame)


def coordinate_jacobian_rate(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    kind: str | OrientationKind,
    frame: str | int | None = None,
    near: ArrayLike | None = None,
) -> Array:
    """Time derivative of `coordinate_jacobian` along a motion.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q, v : array_like, shape (..., n)
        Joint variables (rad or m) and velocities; the leading axes broadcast.
    kind, frame, near
        As in `coordinate_jacobian`.

    Returns
    -------
    ndarray, shape (..., m, n)
        ``dJ/dt``, so that ``d2X/dt2 = J a + dJ/dt v``; NaN rows as in `coordinate_jacobian`.

    Raises
    ------
    ShapeError, InvalidValueError, FrameNotFoundError
        As `coordinate_jacobian`.

    References
    ----------
    Seed book section 1.3.1.1 (differentiated).

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> coordinate_jacobian_rate(arm, [0.0, 0.5], [1.0, 0.0], "rpy")[0]
    array([-0.3,  0. ])
    """
    check_model(model)
    kind = orientation_kind(kind)
    q, v = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    batch_shape((q, v), ("q", "v"))
    T, near = _broadcast(dgm(model, q, frame), near, kind)
    J = jacobian(model, q, frame)
    twist = (J @ v[..., None])[..., 0]
    E, dE = coordinate_rates(T, kind, near), coordinate_rates_rate(T, twist, kind, near)
    return E @ jacobian_rate(model, q, v, frame) + dE @ J


def _broadcast(
    T: Array, near: ArrayLike | None, kind: OrientationKind
) -> tuple[Array, Array | None]:
    """Poses with the leading axes of the coordinates to be near to, which are checked."""
    close = near_coordinates(near, kind, T.shape[:-2])
    if close is not None:
        batch = np.broadcast_shapes(T.shape[:-2], close.shape[:-1])
        T = np.broadcast_to(T, (*batch, 4, 4))
    return T, close
