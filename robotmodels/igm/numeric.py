"""The numeric inverse geometric model: any robot, any mask, one configuration a pose."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import as_count, as_mask, as_vector, batch_rows
from ..errors import InvalidValueError
from ..geometry import REVOLUTE
from ..model import RobotModel
from .constraints import Components
from .pose_search import pose_search, space_of
from .request import options_of
from .solutions import IGMSolutions

METHOD = "numeric (Levenberg-Marquardt)"
"""Name of the method in results."""


def igm_numeric(
    model: RobotModel,
    T: ArrayLike,
    q0: ArrayLike | None = None,
    mask: ArrayLike | str | None = None,
    mask_axes: Literal["world", "tool"] = "world",
    position_tolerance: float = 1e-6,
    orientation_tolerance: float = 1e-6,
    rng: np.random.Generator | int | None = None,
    limits: bool = False,
    restarts: int = 100,
    iterations: int = 40,
) -> IGMSolutions:
    """Numeric inverse geometric model: one posture that brings the tool to each pose.

    Also called inverse kinematics, ``ikine``, ``ik_LM``, CLIK. For any robot: any number of
    joints, any tree, redundant or with fewer joints than the task has components. It
    starts from ``q0`` if given, then from postures spread over the joint ranges, those whose pose
    is nearest first. A solution is a posture whose pose was computed again and is met within both
    tolerances.

    Parameters
    ----------
    model, T, mask, mask_axes, position_tolerance, orientation_tolerance
        As in `igm`.
    q0 : array_like, shape (..., n), optional
        Where to start, rad or m; broadcasts with the poses. The solution found from it is usually
        near it. Joints that do not move the tool keep its value. Without it nothing is
        preferred, and such joints stay at 0 (with ``limits`` at the nearest value inside them).
    rng : numpy.random.Generator or int, optional
        Generator or seed of the spread starts; default a fixed seed. The starts are the same for
        all poses of a call, so that a batch has the same results as its poses one by one.
    limits : bool
        As in `igm`, with ``q0`` for ``q_ref``.
    restarts : int
        Number of starts beside ``q0``; 0 needs a ``q0``.
    iterations : int
        Most steps from one start.

    Returns
    -------
    IGMSolutions
        With one row (S = 1) for every pose, its ``error`` per component, and ``closest``: the
        posture the search ended with, also where it is no solution. Then ``status`` states whether
        limits are the reason; whether the position is met but the orientation is not (``closest``
        is where the remaining angle is least); or whether the position is too far or too near.
        These are findings of the search, not proofs.
        Postures of redundant arms are marked as members of an infinite family, with
        the joints that move along it; double roots and families at singular postures are not
        looked for.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        ``T`` that are not poses, ``q0`` or ``mask`` of the wrong length, NaN or infinity; a mask
        that is not of zeros and ones or that leaves nothing; an unknown option.

    References
    ----------
    The exercise, section 4.3 (``ikine`` and its mask). T. Sugihara, Solvability-unconcerned
    inverse kinematics by the Levenberg-Marquardt method, IEEE T-RO 27(5), 2011.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.kinematics import dgm
    >>> arm = load("panda")
    >>> T = dgm(arm, [0.1, 0.2, 0.3, -1.4, 0.5, 1.6, 0.7])
    >>> found = igm_numeric(arm, T, limits=True)
    >>> bool(found.within_limits[0]), bool(np.allclose(dgm(arm, found.q[0]), T, atol=1e-6))
    (True, True)

    The exercise's pose B: its position is reached, its orientation cannot be.

    >>> trr = load("lab_trr")
    >>> B = [[-1, 0, 0, 0.4], [0, 1, 0, 0.2], [0, 0, -1, 0.5], [0, 0, 0, 1]]
    >>> igm_numeric(trr, B, mask=[1, 1, 1, 0, 0, 0]).reason()
    'The pose is reached.'
    >>> igm_numeric(trr, B).reason()
    'The position is reached, but the orientation is not available there. It is off by 180 deg.'
    """
    tolerances = options_of(model, mask_axes, limits, position_tolerance, orientation_tolerance)
    T, requested = se3.as_pose(T), as_mask(mask)
    restarts = as_count(restarts, "restarts", 0)
    iterations = as_count(iterations, "iterations", 1)
    if restarts == 0 and q0 is None:
        raise InvalidValueError("restarts: 0 leaves no start without q0; give q0 or restarts.")
    space = space_of(model, bool(limits), restarts, rng)
    columns, n = space.chain.columns, model.n
    middle = np.zeros(n)
    if limits:
        middle[columns] = space.middle
    first = middle if q0 is None else as_vector(q0, n, "q0")
    flat = T.reshape(*T.shape[:-2], 16)
    batch, (targets, first) = batch_rows((flat, first), ("T", "q0"))
    closest = np.clip(first, model.lower, model.upper) if limits else np.array(first)
    U = se3.inverse(model.base) @ targets.reshape(-1, 4, 4)
    components = Components(tuple(requested.tolist()), mask_axes == "tool")
    effort = (tolerances, restarts, iterations)
    found = pose_search(space, components, effort, U, closest[:, columns], q0 is not None)
    closest[:, columns] = found.q
    family = np.zeros(closest.shape, np.bool_)
    family[:, columns] = found.family
    inside = np.all((closest >= model.lower) & (closest <= model.upper), axis=1)
    rows, valid = (*batch, 1), found.valid
    revolute = model.table.sigma[model.table.joint_rows] == REVOLUTE
    return IGMSolutions(
        q=np.where(valid[:, None], closest, np.nan).reshape(*rows, n),
        valid=valid.reshape(rows),
        residual=found.residual.reshape(rows),
        within_limits=(inside & valid).reshape(rows),
        code=np.where(valid, 0, -1).reshape(rows),
        labels=("",),
        status=found.status.reshape(batch),
        double=np.zeros(rows, np.bool_),
        free_joints=np.zeros((*rows, n), np.bool_),
        family_joints=family.reshape(*rows, n),
        method=METHOD,
        periodic=revolute & (not limits),
        mask=requested,
        error=found.error.reshape(*rows, 6),
        closest=closest.reshape(*batch, n),
    )
