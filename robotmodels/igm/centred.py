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
    """Poses without the translation along end prismatic joints.

    Shapes: U (N, 4, 4); references, moved (N, k).
    """

    U: Array
    references: Array
    moved: Array


def centred(
    chain: JointChain, U: Array, references: Array, components: Components
) -> Centred | None:
    """Remove large translations along prismatic joints at the ends of an arm.

    Shapes: U (N, 4, 4), references (N, k).
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
    """Restore the removed translations, and check the postures at their poses.

    Shapes: U (N, 4, 4), references (N, k).
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
