"""The inverse geometric model: every posture of a pose, for every arm that has a closed form."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import Array, as_core, as_vector, batch_rows, read_only
from ..errors import InvalidValueError
from ..model import RobotModel
from .asked import Task, above_zero, locks_of, mask_of
from .known import known_arm, solver_for
from .rows import Call, Rows, rows_by_family, rows_by_plan
from .solutions import IGMSolutions
from .solver import Tolerances

NO_FAMILY = "numeric search for one posture: no family of closed forms serves this arm"
"""What a result says of its method where there is none but the search."""

_WHOLE, _EXACT = Task(), Tolerances()


def igm(
    model: RobotModel,
    T: ArrayLike,
    q_ref: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    mask_axes: str = "world",
    limits: bool = False,
    lock: Mapping[int | str, float] | None = None,
    arm_angle: ArrayLike | None = None,
    position_tolerance: float = 1e-9,
    orientation_tolerance: float = 1e-9,
) -> IGMSolutions:
    """Inverse geometric model (inverse kinematics): all postures that bring the tool to a pose.

    Looks at the table once, picks the family of the arm and keeps what it prepared for the next
    call with the same model: Paul's equations where they suffice; three axes that meet or three
    that are parallel, wherever they stand in the chain; three or two prismatic joints; arms that
    are one of these up to calibration errors; elimination to up to 16 postures for other six-joint
    arms; virtual joints for arms of fewer joints and for masks; the arm angle or locked joints
    for seven joints and more. ``print(found.method)`` says which.

    Parameters
    ----------
    model : RobotModel
        The robot.
    T : array_like, shape (..., 4, 4)
        World poses of the tool [m]. A rotation that is off by no more than 1e-6 is projected onto
        a proper one.
    q_ref : array_like, shape (..., n), optional
        Reference postures [rad or m]; the leading axes broadcast with those of ``T``. Solutions
        are ordered by their distance to it, and joints that a pose leaves free take its value
        (0 without it; where no posture exists at that value, the nearest one where one does).
    mask : array_like, shape (6,), optional
        Ones for the components ``x y z rx ry rz`` that are asked for, zeros for the others;
        default all. Rotations are the components of ``log(R_desired R^T)``.
    mask_axes : {"world", "tool"}
        Axes of the components: the world's, or those of the tool at the desired pose. Pointing
        the tool's z axis is ``[1, 1, 1, 1, 1, 0]`` in tool axes.
    limits : bool
        Whether solutions must lie within the joint limits. Angles are then shifted by whole turns
        to be nearest to ``q_ref`` (else to mid-range) inside the limits, and postures that cannot
        are dropped; otherwise angles are in (-pi, pi] and ``within_limits`` tells.
    lock : mapping, optional
        Joints (column of q, from 0, or name) that keep a value [rad or m].
    arm_angle : array_like, shape (...), optional
        Arms with three axes that meet in a shoulder, an elbow, and three that meet in a wrist: the
        angle of the elbow about the line from shoulder to wrist [rad], see `ArmAngle`. The axes of
        an array are added behind those of ``T``. Without it the angle of ``q_ref`` is taken.
    position_tolerance : float
        Metres. What is missing of the position may be as long as this. For poses given with few
        digits take wider tolerances.
    orientation_tolerance : float
        Radians, on the rotation that is missing.

    Returns
    -------
    IGMSolutions
        All postures of each pose, with a status for each pose.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        ``T`` that are not poses; arguments of the wrong length, with NaN or infinity; a mask that
        leaves nothing or asks for what is no mask; locked joints that do not exist; an arm angle
        for an arm without one.

    Notes
    -----
    A posture is returned after a forward pass over the table; ``residual`` is what that found.
    Poses without one are given to a short numeric search, `igm_numeric`, which says why: too far,
    too near, or the orientation not available there. An arm outside every family (more joints
    than can be solved, or a degenerate one) gets the single posture of that search, and
    ``method`` says so.

    References
    ----------
    Section 1.2.3 of the book; Pieper 1968, Raghavan and Roth 1990.

    Examples
    --------
    >>> import numpy as np
    >>> from robotmodels.igm import igm
    >>> from robotmodels.kinematics import dgm
    >>> from robotmodels.robots import load
    >>> arm = load("rx90")
    >>> found = igm(arm, dgm(arm, [0.1, 0.2, 1.3, 0.4, 0.5, 0.6]))
    >>> int(found.count), bool(found.residual.max() < 1e-12)
    (8, True)
    >>> found.nearest([0.1, 0.2, 1.3, 0.4, 0.5, 0.6]).round(6)
    array([0.1, 0.2, 1.3, 0.4, 0.5, 0.6])
    """
    if not isinstance(model, RobotModel):
        raise InvalidValueError(f"model: expected a RobotModel, got {type(model).__name__}.")
    if not isinstance(limits, (bool, np.bool_)):
        raise InvalidValueError(f"limits: expected True or False, got {limits!r}.")
    if mask_axes not in ("world", "tool"):
        raise InvalidValueError(f"mask_axes: expected 'world' or 'tool', got {mask_axes!r}.")
    arm = known_arm(model)
    tolerances = Tolerances(
        above_zero(position_tolerance, "position_tolerance"),
        above_zero(orientation_tolerance, "orientation_tolerance"),
    )
    task = _WHOLE
    if mask is not None or lock is not None or arm_angle is not None:
        task = Task(
            mask=tuple(mask_of(mask).tolist()),
            in_tool_axes=mask_axes == "tool",
            locks=locks_of(model, lock),
            by_arm_angle=arm_angle is not None,
        )
    batch, poses, references = _rows_of_call(model, T, q_ref)
    if limits:
        references = np.clip(references, model.lower, model.upper)
    solver = solver_for(model, arm, task)
    call = Call(model, arm, task, solver, q_ref is not None, bool(limits), tolerances)
    if arm.plan is not None and solver is arm.plan and tolerances == _EXACT:
        return _solutions(call, batch, rows_by_plan(call, poses, references))
    psi = None
    if arm_angle is not None:
        # every pose once for every angle, the angles behind
        angles = as_core(arm_angle, (), "arm_angle")
        psi = np.tile(angles.ravel(), poses.shape[0])
        poses, references = (np.repeat(a, angles.size, axis=0) for a in (poses, references))
        batch = (*batch, *angles.shape)
    return _solutions(call, batch, rows_by_family(call, poses, references, psi))


def _rows_of_call(
    model: RobotModel, T: ArrayLike, q_ref: ArrayLike | None
) -> tuple[tuple[int, ...], Array, Array]:
    """Batch shape, poses (N, 4, 4) and references (N, n), checked."""
    from ..kernels.rotations import improper_pose

    # proper poses, which are nearly all, pass a quick look; what does not is told or mended
    if not (
        isinstance(T, np.ndarray)
        and T.dtype == np.float64
        and T.flags.c_contiguous
        and T.shape[-2:] == (4, 4)
        and improper_pose(T.reshape(-1, 4, 4)) < 0
    ):
        T = se3.as_pose(T)
    if q_ref is None:
        poses = T.reshape(-1, 4, 4)
        return T.shape[:-2], poses, np.zeros((poses.shape[0], model.n))
    reference = as_vector(q_ref, model.n, "q_ref")
    batch, (rows, references) = batch_rows(
        (T.reshape(*T.shape[:-2], 16), reference), ("T", "q_ref")
    )
    return batch, rows.reshape(-1, 4, 4), references


def _solutions(call: Call, batch: tuple[int, ...], rows: Rows) -> IGMSolutions:
    """The result of a call."""
    n, most = call.model.n, rows.most

    def cut(array: NDArray[Any], *core: int) -> NDArray[Any]:
        if most < array.shape[1]:
            array = np.ascontiguousarray(array[:, :most])
        array = array.reshape(*batch, most, *core)
        array.flags.writeable = False
        return array

    status = rows.status.reshape(batch)
    status.flags.writeable = False
    closest = missing = None
    if rows.closest is not None and rows.missing is not None:
        closest, missing = rows.closest.reshape(*batch, n), rows.missing.reshape(*batch, 6)
        closest.flags.writeable = missing.flags.writeable = False
    return IGMSolutions.checked_before(
        cut(rows.q, n),
        cut(rows.valid),
        cut(rows.residual),
        cut(rows.inside),
        cut(rows.code),
        rows.labels,
        status,
        cut(rows.double),
        cut(rows.free, n),
        cut(rows.family, n),
        NO_FAMILY if call.solver is None else call.solver.method,
        call.arm.never if call.limits else call.arm.turns,
        _mask_array(call.task.mask),
        None,
        closest,
        missing,
    )


@lru_cache(maxsize=64)
def _mask_array(mask: tuple[bool, ...]) -> NDArray[np.bool_]:
    return read_only(mask, np.bool_)
