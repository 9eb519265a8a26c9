"""Inverse kinematic models: joint velocities of a twist, joint accelerations of its rate.

Book section 1.3.2. Everything about one row happens in one compiled pass: Jacobian from the
chain, its singular values, the inverse by them, and the part of the twist that is missing.
"""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from ..._arrays import as_vector
from ...model import RobotModel, as_positions, check_model
from ..jacobians import Reference
from .bounds import JointBounds
from .methods import InverseMethod
from .solution import IKMSolution
from .solver import Secondary, check_size, solved, solved_alone
from .tasks import Task


def ikm(
    model: RobotModel,
    q: ArrayLike,
    twist: ArrayLike,
    frame: str | int | None = None,
    reference: Reference = "world_aligned",
    mask: ArrayLike | str | None = None,
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
    components along nearly lost directions are reduced. The missing part of the twist is
    ``error``.

    Book sections 1.3.2.1 (regular case), 1.3.2.2 and 1.3.2.3 (near singular positions),
    1.3.2.4 (redundant robots).

    Parameters
    ----------
    model, frame, reference, mask, length
        See `robotmodels.kinematics`. The length matters for compromises between rows, singular
        values and damping only: it has no effect where the twist is met exactly.
    q : array_like, shape (..., n)
        Joint variables, rad or m; its leading axes broadcast with those of ``twist``.
    twist : array_like, shape (..., 6)
        Velocity of the frame, linear then angular [m/s, rad/s].
    method : PseudoInverse, FilteredInverse or DampedInverse, optional
        Treatment of singular positions; default ``DampedInverse()``.
    joint_weights : array_like, shape (n,), optional
        Positive; redundant robots take the ``v`` of least ``sum(joint_weights v^2)``. Default 1
        for revolute joints and ``1 / length^2`` for prismatic ones, so that the motion does not
        depend on the unit of length. ``ones(n)`` gives the plain pseudo-inverse.
    secondary : array_like, shape (..., n), criterion, or sequence of them, optional
        Joint velocities z for the freedom of a redundant robot, ``(I - J^+ J) z``, exactly, also
        where J is damped. A criterion contributes its ``gradient(model, q)``; the entries of a
        sequence are summed.
    augmented : sequence of Task
        More rows, of the same importance as the twist (task augmentation).
    tasks : sequence of Task
        Tasks of lower priorities, in strict order: none disturbs the twist nor those before it.
    limits : JointBounds or bool, optional
        Bounds that ``v`` must respect; True takes ``JointBounds()``, the model's own limits. A
        twist that they do not allow is kept in its direction and made slower: see ``scale``.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> arm = load("rx90")
    >>> found = ikm(arm, [0.1, 0.2, 1.3, 0.4, 0.5, 0.6], [0.1, 0.0, -0.2, 0.0, 0.0, 0.3])
    >>> found.reason(), bool(abs(found.error).max() < 1e-12)
    ('The requested motion is achieved.', True)
    """
    check_model(model)
    q, twist = as_positions(model, q), as_vector(twist, 6, "twist")
    check_size(twist, "twist")
    if (
        mask is joint_weights is length is secondary is limits is None
        and augmented == () == tasks
        and q.ndim == 1 == twist.ndim
    ):
        return solved_alone(model, q, twist, frame, reference, method)
    return solved(
        model, q, twist, None, frame, reference, mask, method, joint_weights, length, secondary,
        augmented, tasks, limits,
    )  # fmt: skip


def ikm_second_order(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    acceleration: ArrayLike,
    frame: str | int | None = None,
    reference: Reference = "world_aligned",
    mask: ArrayLike | str | None = None,
    method: InverseMethod | None = None,
    joint_weights: ArrayLike | None = None,
    length: float | None = None,
    secondary: Secondary | None = None,
    augmented: Sequence[Task] = (),
    tasks: Sequence[Task] = (),
    limits: JointBounds | bool | None = None,
) -> IKMSolution:
    """Second order inverse kinematic model: joint accelerations for the rate of a twist.

    Solves ``J a = acceleration - dJ/dt v`` as `ikm` solves ``J v = twist`` (J. Luh, M. Walker and
    R. Paul 1980). A redundant robot whose null space is left to the least acceleration keeps the
    self-motion it has: give ``secondary=-k * v`` to bring it to rest.

    Parameters
    ----------
    model, frame, reference, mask, method, joint_weights, length, augmented, tasks, limits
        As in `ikm`, for accelerations; ``secondary`` too, gradients are used as accelerations.
    q, v : array_like, shape (..., n)
        Joint variables (rad or m) and velocities; leading axes broadcast with ``acceleration``.
    acceleration : array_like, shape (..., 6)
        Time derivative of the frame's twist, entry by entry [m/s^2, rad/s^2], as
        `dkm_second_order` gives it.
    """
    check_model(model)
    q, v = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    acceleration = as_vector(acceleration, 6, "acceleration")
    check_size(acceleration, "acceleration")
    return solved(
        model, q, acceleration, v, frame, reference, mask, method, joint_weights, length,
        secondary, augmented, tasks, limits,
    )  # fmt: skip
