"""Inverse kinematic model: joint velocities that give a twist.

Seed book section 1.3.2. Everything about one row happens in one compiled pass: Jacobian from the
chain, its singular values, the inverse by them, and what the result misses.
"""

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
from .solve import check_size, solved, solved_alone

if TYPE_CHECKING:
    from .bounds import JointBounds
    from .tasks import Task


def ikm(
    model: RobotModel,
    q: ArrayLike,
    twist: ArrayLike,
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
    """Inverse kinematic model: joint velocities that give the tool or another frame a twist.

    Also called inverse velocity kinematics, resolved motion rate control. Exact away from singular
    positions, ``J v = twist`` with the least weighted norm; bounded near them, where only the
    directions that the robot is about to lose are slowed down; what is missing is in ``error``.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q : array_like, shape (..., n)
        Joint variables, rad or m; its leading axes broadcast with those of ``twist``.
    twist : array_like, shape (..., 6)
        Velocity of the frame, linear then angular [m/s, rad/s].
    frame : str or int, optional
        Name or number of a frame; default the tool.
    reference : {"world_aligned", "local", "world"}
        Axes and point of the twist, as in `jacobian`.
    mask : array_like, shape (6,), optional
        Ones for the rows of the twist that are asked for, zeros for those that may be anything, in
        the axes of ``reference``; default all.
    method : PseudoInverse, FilteredInverse or DampedInverse, optional
        What to do near singular positions; default ``DampedInverse()``.
    joint_weights : array_like, shape (n,), optional
        Positive; redundant robots take the ``v`` of least ``sum(joint_weights v^2)``. Default 1
        for revolute joints and ``1 / length^2`` for prismatic ones, so that the motion does not
        depend on the unit of length. ``ones(n)`` gives the plain pseudo-inverse.
    length : float, optional
        Metres: a velocity of one length per second counts like a turn of 1 rad/s where a compromise
        between rows, a singular value or a damping is concerned. Default
        `characteristic_length`, the reach of the frame. Where the twist is met it changes nothing.
    secondary : array_like, shape (..., n), criterion, or sequence of them, optional
        Joint velocities that a redundant robot may have besides, as far as they do not disturb the
        twist: ``(I - J^+ J) z``, exactly, also where J is damped. A criterion is an object whose
        ``gradient(model, q)`` is taken; those of a sequence are summed.
    augmented : sequence of Task
        More rows, of the same importance as the twist (task augmentation).
    tasks : sequence of Task
        Tasks of lower priorities, in strict order: none disturbs the twist nor those before it.
    limits : JointBounds or bool, optional
        Bounds that ``v`` must respect; True takes ``JointBounds()``, the model's own limits. A
        twist that they do not allow is kept in its direction and made slower: see ``scale``.

    Returns
    -------
    IKMSolution
        ``v (..., n)``, ``status``, ``achieved``, ``error``, ``reachable``, ``singular_values`` ...

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong shape, with NaN or infinity; an unknown reference; a mask that asks
        for nothing; weights or a length that are not positive.
    FrameNotFoundError
        No such frame.

    References
    ----------
    Seed book sections 1.3.2.1 (regular case), 1.3.2.2 and 1.3.2.3 (near singular positions),
    1.3.2.4 (redundant robots).

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> arm = load("rx90")
    >>> found = ikm(arm, [0.1, 0.2, 1.3, 0.4, 0.5, 0.6], [0.1, 0.0, -0.2, 0.0, 0.0, 0.3])
    >>> found.reason(), bool(abs(found.error).max() < 1e-12)
    ('The motion is met.', True)

    A straight line in 1 s, followed by integrating joint velocities: the position that is due
    minus the position that is, added to the twist, keeps the integration from drifting.

    >>> import numpy as np
    >>> from robotmodels.kinematics import dgm
    >>> q, step = np.array([0.1, 0.2, 0.8, 0.4, 0.5, 0.6]), 0.01
    >>> start, velocity = dgm(arm, q)[:3, 3], np.array([-0.1, 0.2, -0.1])
    >>> for k in range(100):
    ...     behind = start + velocity * k * step - dgm(arm, q)[:3, 3]
    ...     q = q + step * ikm(arm, q, [*(velocity + 50.0 * behind), 0.0, 0.0, 0.0]).v
    >>> bool(abs(dgm(arm, q)[:3, 3] - start - velocity).max() < 1e-4)
    True
    """
    check_model(model)
    q, twist = as_vector(q, model.n, "q"), as_vector(twist, 6, "twist")
    check_size(twist, "twist")
    if (
        mask is joint_weights is length is secondary is limits is None
        and augmented == () == tasks
        and q.ndim == 1 == twist.ndim
    ):
        return solved_alone(model, q, twist, frame, reference, method)
    return solved(
        model,
        Request(
            q, twist, None, frame, reference, mask, method, joint_weights, length, secondary,
            augmented, tasks, limits,
        ),
    )  # fmt: skip
