"""The inverse geometric model: every posture of a pose, for every arm that has a closed form."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache

from numpy.typing import ArrayLike

from ..model import RobotModel
from .solutions import IGMSolutions


def igm(
    model: RobotModel,
    T: ArrayLike,
    q_ref: ArrayLike | None = None,
    mask: ArrayLike | str | None = None,
    mask_axes: str = "world",
    limits: bool = False,
    lock: Mapping[int | str, float] | None = None,
    arm_angle: ArrayLike | None = None,
    position_tolerance: float = 1e-9,
    orientation_tolerance: float = 1e-9,
    relations: tuple[ArrayLike, ArrayLike] | None = None,
) -> IGMSolutions:
    """Inverse geometric model (inverse kinematics): all postures that bring the tool to a pose.

    The solver for the arm is chosen from its table at the first call and kept for later calls:
    Paul's equations where they suffice; three axes that meet or three that are parallel, anywhere
    in the chain; arms that are one of these up to calibration errors; elimination, up to 16
    postures, for other six-joint arms; virtual joints for arms of fewer joints and for masks; the
    arm angle or locked joints for seven joints and more; a numeric search from many starts for the
    rest. ``found.method`` names it.

    Parameters
    ----------
    model : RobotModel
        The robot.
    T : array_like, shape (..., 4, 4)
        World poses of the tool [m]. A rotation that is off by no more than 1e-6 is projected onto
        a proper one; `se3.nearest_pose` does so for matrices with fewer digits.
    q_ref : array_like, shape (..., n), optional
        Reference postures [rad or m]; the leading axes broadcast with those of ``T``. Solutions
        are ordered by their distance to it, and joints that a pose leaves free take its value
        (0 without it; where no posture has that value, the nearest value with a posture).
        Joints that do not move the tool keep its value (0 without it; with ``limits`` within them);
        they are no redundancy: the others are solved as if they were the whole arm.
    mask : array_like, shape (6,), or {"position", "xyz", "orientation"}, optional
        Ones for the components ``x y z rx ry rz`` that are requested, zeros for the others;
        default all. Rotations are the components of ``log(R_desired R^T)``.
    mask_axes : {"world", "tool"}
        Axes of the components: the world's, or those of the tool at the desired pose. Pointing
        the tool's z axis is ``[1, 1, 1, 1, 1, 0]`` in tool axes.
    limits : bool
        Whether solutions must lie within the joint limits. Angles are then shifted by whole turns
        to be nearest to ``q_ref`` (else to mid-range) inside the limits, and postures that cannot
        are dropped; otherwise angles are in (-pi, pi] and ``within_limits`` marks them.
    lock : mapping, optional
        Joints (column of q, from 0, or name) that keep a value [rad or m].
    arm_angle : array_like, shape (...), optional
        Arms with three axes that meet in a shoulder, an elbow, and three that meet in a wrist: the
        angle of the elbow about the line from shoulder to wrist [rad], right-handed. The axes of
        an array are added behind those of ``T``. Without it the angle of ``q_ref`` is taken.
    position_tolerance : float
        Metres. Largest error of the position. For poses given with few
        digits take wider tolerances; singularity is decided on the pose as it is given.
    orientation_tolerance : float
        Radians. Largest error of the rotation.
    relations : (array_like (m, n), array_like (m,)), optional
        Added relations ``A q = b`` between the joints of a redundant arm, as many as it has
        joints more than six (the book's second strategy; locking is the first). They hold modulo
        whole turns of revolute joints. Not together with ``lock``, ``mask`` or ``arm_angle``.

    Returns
    -------
    IGMSolutions
        All postures of each pose, with a status for each pose.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        ``T`` that are not poses, or beyond 1e100 m; arguments of the wrong length, with NaN or
        infinity; a mask that leaves nothing or is not a mask; locked joints that do
        not exist; an arm angle for an arm without one.

    Notes
    -----
    Every posture is checked by the direct model; ``residual`` is its error. Regular poses of an
    arm with a closed form take microseconds. At singular positions and beside them (within some
    1e-6) candidates at perturbed poses are added and self-motions are continued to the reference,
    which takes milliseconds. Redundant arms are quick at a ``q_ref`` from which the pose can be
    reached; else the nearest value of the first free joint is searched, in
    some 0.2 s a pose. Status ``INCOMPLETE`` means that solutions or a nearer value may be missing:
    after that search, with relations between several joints, and where neither a closed form nor
    elimination serves (masks that free two rotations, unless the arm turns about the requested
    axis only; some arms with two prismatic joints).
    For poses without a posture a short numeric search, `igm_numeric`, gives the reason: too far,
    too near, or the orientation not available there. An arm outside every family (more joints
    than can be solved, or a degenerate one) gets the single posture of that search, as
    ``method`` states.

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
    return _solved()(
        model, T, q_ref, mask, mask_axes, limits, lock, arm_angle, position_tolerance,
        orientation_tolerance, relations,
    )  # fmt: skip


@cache
def _solved() -> Callable[..., IGMSolutions]:
    """The families, imported when the first pose is solved."""
    from .call import solved

    return solved
