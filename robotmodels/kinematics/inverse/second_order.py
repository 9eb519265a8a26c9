"""Inverse kinematic model of the second order: joint accelerations that give an acceleration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from ..._arrays import as_vector
from ...model import RobotModel, check_model
from ..jacobians import Reference
from .methods import InverseMethod
from .request import Request, Secondary
from .solution import IKMSolution
from .solve import check_size, solved

if TYPE_CHECKING:
    from .bounds import JointBounds
    from .tasks import Task


def ikm_second_order(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    acceleration: ArrayLike,
    frame: str | int | None = None,
    reference: Reference = "world_aligned",
    mask: ArrayLike | None = None,
    method: InverseMethod | None = None,
    joint_weights: ArrayLike | None = None,
    length: float | None = None,
    secondary: Secondary | None = None,
    augmented: Sequence[Task] = (),
    tasks: Sequence[Task] = (),
    limits: JointBounds | bool | None = None,
) -> IKMSolution:
    """Second order inverse kinematic model: joint accelerations for the rate of a twist.

    Solves ``J a = acceleration - dJ/dt v`` as `ikm` solves ``J v = twist``. A redundant robot whose
    null space is left to the least acceleration keeps the self-motion it has: give
    ``secondary=-k * v`` to bring it to rest.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q, v : array_like, shape (..., n)
        Joint variables (rad or m) and velocities; leading axes broadcast with ``acceleration``.
    acceleration : array_like, shape (..., 6)
        Time derivative of the frame's twist, entry by entry [m/s^2, rad/s^2]: what
        `dkm_second_order` gives.
    frame, reference, mask, method, joint_weights, length
        As in `ikm`. A ``largest_speed`` of the method bounds the accelerations.
    secondary : array_like, shape (..., n), criterion, or sequence of them, optional
        Joint accelerations for the null space; gradients are taken as such.
    augmented, tasks : sequence of Task
        As in `ikm`; their rates are accelerations.
    limits : JointBounds or bool, optional
        Bounds that the accelerations must respect; True takes the model's own limits.

    Returns
    -------
    IKMSolution
        With ``a (..., n)``, the joint accelerations; ``v`` is what was given. ``achieved``,
        ``error`` and ``reachable`` are accelerations of the frame; ``dJ/dt v``, which the robot
        has anyway, is part of ``achieved`` and ``reachable``.

    Raises
    ------
    ShapeError, InvalidValueError, FrameNotFoundError
        As `ikm`.

    References
    ----------
    Seed book section 1.3.2 (differentiated); J. Luh, M. Walker and R. Paul 1980.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.kinematics.velocities import dkm_second_order
    >>> arm, q, v = load("rx90"), [0.1, 0.2, 1.3, 0.4, 0.5, 0.6], [1.0, 0.5, -0.3, 0.1, 0.7, -1.0]
    >>> found = ikm_second_order(arm, q, v, [0.1, 0.0, -0.2, 0.0, 0.0, 0.3])
    >>> dkm_second_order(arm, q, v, found.a).round(12) + 0.0
    array([ 0.1,  0. , -0.2,  0. ,  0. ,  0.3])
    """
    check_model(model)
    q, v = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    acceleration = as_vector(acceleration, 6, "acceleration")
    check_size(acceleration, "acceleration")
    return solved(
        model,
        Request(
            q, acceleration, v, frame, reference, mask, method, joint_weights, length, secondary,
            augmented, tasks, limits,
        ),
    )  # fmt: skip
