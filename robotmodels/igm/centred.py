"""Slides at either end of an arm that are run out far: the pose brought back beside the arm.

Closed forms square lengths. Where a slide is out by kilometres, the squares leave no digits for
the arm. How far slides at the base are out moves the whole arm and nothing else, and slides at the
tool only the tool: what the pose has along them is taken off before it is solved and added to
them afterwards. A slide between revolute joints makes a long arm, of which nothing can be taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import Array
from .check import checked
from .components import Components, asked_errors
from .loop import JointChain
from .self_motion import Settled
from .solver import Tolerances

BESIDE = 4.0
"""Way along the slides, in lengths of the arm, up to which a pose is left where it is."""
_ROUNDING = 4.0 * np.finfo(np.float64).eps


@dataclass(frozen=True, slots=True, eq=False)
class Centred:
    """Poses brought back beside the arm.

    Parameters
    ----------
    U : ndarray, shape (N, 4, 4)
        Poses of the tool in R_0 without what they have along the slides [m].
    references : ndarray, shape (N, k)
        References without it [rad or m].
    moved : ndarray, shape (N, k)
        What was taken off each joint [m]; 0 for all but slides at the ends, and for poses that
        were left.
    """

    U: Array
    references: Array
    moved: Array


def centred(
    chain: JointChain, U: Array, references: Array, components: Components
) -> Centred | None:
    """Take off what poses have along the slides at the ends of an arm.

    Parameters
    ----------
    chain : JointChain
        The arm.
    U : ndarray, shape (N, 4, 4)
        Poses of the tool in R_0 [m].
    references : ndarray, shape (N, k)
        Reference postures [rad or m].
    components : Components
        What is asked of a pose: slides at the base need the position, those at the tool all of it.

    Returns
    -------
    Centred or None
        None if no pose is far along such a slide.

    Examples
    --------
    >>> from robotmodels.igm.loop import joint_chain
    >>> from robotmodels.kinematics import dgm
    >>> from robotmodels.robots import load
    >>> arm, q = load("lab_trr"), np.array([[1000.0, 0.2, 0.3]])
    >>> whole = Components((True,) * 6, in_tool_axes=False)
    >>> where = centred(joint_chain(arm), dgm(arm, q), np.zeros((1, 3)), whole)
    >>> where.U[0, :3, 3].round(9) + 0.0
    array([0.37152983, 0.        , 0.36438103])
    """
    slides = chain.sigma == 1
    k = chain.k
    first = int(np.argmin(slides)) if not slides.all() else k
    last = k - int(np.argmin(slides[::-1])) if first < k else k
    first = first if all(components.asked[:3]) else 0
    last = last if all(components.asked) else k
    columns = [*range(first), *range(last, k)]
    if not columns or len(U) == 0:
        return None
    # directions of the slides in R_0, those at the tool by its orientation: (N, m, 3)
    before, behind = chain.D[0][:3, :3], np.eye(3)
    axes = np.empty((len(U), len(columns), 3))
    for i in range(first):
        axes[:, i] = before[:, 2]
        before = before @ chain.D[i + 1][:3, :3]
    for i in range(1, k - last + 1):
        behind = chain.D[k + 1 - i][:3, :3] @ behind
        axes[:, -i] = U[:, :3, :3] @ behind[2]
    way = (U[:, :3, 3] - chain.D[0][:3, 3])[:, None]
    # slides that are nearly parallel share what they have in common, and no more is taken
    away = (way @ np.linalg.pinv(axes, rcond=0.1))[:, 0]
    length = float(np.linalg.norm(chain.D[1:, :3, 3], axis=1).sum()) or 1.0
    away[~np.any(np.abs(away) > BESIDE * length, axis=1)] = 0.0
    if not away.any():
        return None
    poses, moved = U.copy(), np.zeros(references.shape)
    poses[:, :3, 3] -= np.sum(away[..., None] * axes, axis=1)
    moved[:, columns] = away
    return Centred(poses, references - moved, moved)


def put_back(
    chain: JointChain,
    U: Array,
    references: Array,
    where: Centred,
    found: Settled,
    components: Components,
    tolerances: Tolerances,
) -> Settled:
    """Add to the slides what was taken off, and check the postures at their poses.

    Parameters
    ----------
    chain : JointChain
        The arm.
    U : ndarray, shape (N, 4, 4)
        The poses as they are asked for [m].
    references : ndarray, shape (N, k)
        The references as they are given [rad or m].
    where : Centred
        What was taken off.
    found : Settled
        Postures of the poses brought back.
    components : Components
        What is asked of a pose.
    tolerances : Tolerances
        When a pose counts as met.

    Returns
    -------
    Settled
        The same postures. One that rounding of long slides keeps from its pose is none.
    """
    moved = where.moved[:, None]
    q, residual, valid = found.q + moved, found.residual.copy(), found.valid.copy()
    # what took its reference has it to the last digit
    wanted = np.broadcast_to(references[:, None], q.shape)
    q = np.where(found.free & (np.abs(q - wanted) <= _ROUNDING * np.abs(moved)), wanted, q)
    n, s = np.nonzero(valid & moved.any(axis=-1))
    if all(components.asked):
        # slides at the tool make more of what is missing of the orientation: improved once more
        again = checked(
            chain, U[n], q[n, s][:, None], np.ones((n.size, 1), np.bool_), tolerances,
            free=found.free[n, s][:, None],
        )  # fmt: skip
        q[n, s], residual[n, s] = again.q[:, 0], again.residual[:, 0]
        valid[n, s] = again.valid[:, 0]
    else:
        way, angle = asked_errors(chain, U[n], q[n, s], components)
        residual[n, s] = np.maximum(way, angle)
        valid[n, s] = (way <= tolerances.position) & (angle <= tolerances.orientation)
    q[~valid], residual[~valid] = np.nan, np.nan
    return Settled(
        q, valid, residual, found.double & valid, found.free & valid[..., None],
        found.family & valid, found.moving & valid[..., None],
    )  # fmt: skip
