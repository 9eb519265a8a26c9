"""Members of families where no posture exists at the reference: found on a grid, walked to it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ... import se3
from ..._arrays import Array, read_only
from ..check import checked
from ..lock import stacked
from ..loop import JointChain
from ..self_motion import settle_families
from ..solver import Found, Tolerances, nothing_found
from .arm import Redundant
from .locked_arms import at_an_end, locked_postures

GRID = 48
"""Values of the last free joint at which members of a family are looked for."""
MANY = 256
"""Values, of several free joints together, at which members are looked for."""
WALKED = 8, 3
"""Members of a pose that are walked along their family: of one dimension, of more."""
_SAME = 1e-7  # values of free joints closer than this are one [rad, m]


def members(
    solver: Redundant, U: Array, references: Array, tolerances: Tolerances
) -> tuple[Array, NDArray[np.bool_]]:
    """Sampled members of the infinite family of each pose.

    Shapes: U (N, 4, 4), references (N, k) -> q (N, C, k), valid (N, C).
    """
    N, k = U.shape[0], solver.chain.k
    parts = []
    for joints in (solver.sampled, solver.last):
        if not joints:
            continue
        grid = _samples(solver.chain, joints, U)
        G = len(grid)
        found = locked_postures(
            solver.arms, joints, np.tile(grid, (N, 1)), np.repeat(U, G, axis=0),
            np.repeat(references, G, axis=0), tolerances,
        )  # fmt: skip
        S = found.q.shape[1]
        parts.append((found.q.reshape(N, G * S, k), found.valid.reshape(N, G * S)))
    q, valid = zip(*parts, strict=True)
    return np.concatenate(q, axis=1), np.concatenate(valid, axis=1)


def _samples(chain: JointChain, joints: tuple[int, ...], U: Array) -> Array:
    """Values of joints at which members of families are looked for, shape (G, m)."""
    reach = np.linalg.norm(chain.D[:, :3, 3], axis=1).sum()
    reach += float(np.linalg.norm(U[:, :3, 3], axis=1).max(initial=0.0))
    m = len(joints)
    ends = at_an_end(joints, chain.k)
    spread = np.arange(GRID if m == 1 or not ends else MANY) + 0.5
    if m == 1:
        unit = spread[:, None] / GRID
    else:
        # points of an additive recurrence fill the cube evenly; joints inside the chain take few
        # values, because each is a chain to prepare
        steps = np.sqrt(np.array([2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0, 23.0, 29.0])[:m])
        unit = np.mod(spread[:, None] * 4.0 * steps, 1.0)
        if not ends:
            unit = (np.floor(unit * 4) + 0.5) / 4
            unit = np.unique(unit, axis=0)
    turning = chain.sigma[list(joints)] == 0
    return np.where(turning, np.pi, reach) * (2.0 * unit - 1.0)


def nearest_members(
    solver: Redundant, U: Array, references: Array, tolerances: Tolerances
) -> Found:
    """Postures whose free joints are as near to their references as they can be."""
    chain, order = solver.chain, list(solver.order)
    N = U.shape[0]
    q, valid = members(solver, U, references, tolerances)
    # those are walked along their families that are nearest in the free joints, the first of all
    near = np.abs(_way(chain, q, references))[..., order]
    near = np.where(valid, near @ 0.1 ** np.arange(len(order)), np.inf)
    first = np.argsort(near, axis=1, kind="stable")[:, : WALKED[len(order) > 1]]
    q = np.take_along_axis(q, first[..., None], axis=1)
    valid = np.take_along_axis(valid, first, axis=1)
    out, rows = [nothing_found(0, 1, chain.k)], [np.zeros(0, np.int64)]
    for n in np.flatnonzero(valid.any(axis=1)):
        turned, pose, columns = _virtual_last(chain, U[n])
        one = nothing_found(1, valid.shape[1], chain.k)
        one.q[...], one.valid[...], one.family[...] = q[n][:, columns], valid[n], valid[n]
        settled = settle_families(
            turned, pose[None], one, references[n : n + 1, columns], tolerances
        )
        back = np.argsort(columns)
        found = Found(
            settled.q[..., back], settled.valid.copy(), settled.residual.copy(),
            settled.double.copy(), settled.free[..., back], settled.family.copy(),
        )  # fmt: skip
        keep = found.valid[0].copy()
        for j in order:
            # the nearest value of each joint, given the ones before
            away = np.abs(_way(chain, found.q[0], references[n]))[:, j]
            keep &= away <= np.min(away[keep], initial=np.inf) + _SAME
        if keep.any():
            out.append(
                _completed(solver, U[n : n + 1], references[n : n + 1], found, keep, tolerances)
            )
            rows.append(np.array([n]))
    found = stacked(out, rows, N)
    return found


def _completed(
    solver: Redundant,
    U: Array,
    references: Array,
    found: Found,
    keep: NDArray[np.bool_],
    tolerances: Tolerances,
) -> Found:
    """Chosen rows of a single pose, and all others that have their values of the free joints."""
    chain, order = solver.chain, list(solver.order)
    q = found.q[:, keep]
    if solver.order == solver.sampled:
        values = q[:, 0, order]
        others = locked_postures(solver.arms, solver.order, values, U, references, tolerances)
        q = np.concatenate((q, others.q[:, others.valid[0]]), axis=1)
    held = np.array(np.broadcast_to(np.isin(np.arange(chain.k), order), q.shape), order="C")
    return checked(chain, U, q, np.ones(q.shape[:2], np.bool_), tolerances, free=held)


def _way(chain: JointChain, q: Array, references: Array) -> Array:
    """From references ``(..., k)`` to postures ``(..., S, k)``, angles by the shorter way round."""
    d = q - references[..., None, :]
    return np.where(chain.sigma == 0, np.remainder(d + np.pi, 2.0 * np.pi) - np.pi, d)


def _virtual_last(chain: JointChain, U: Array) -> tuple[JointChain, Array, NDArray[np.int64]]:
    """The loop of chain and pose, opened behind the virtual joints that stand at the base.

    Returns the chain, its pose and which joint of the chain each of its joints is. The tool stays
    the last frame before the pose, so that real joints come first.
    """
    lead = 0
    while lead < chain.k and chain.columns[lead] < 0:
        lead += 1
    columns = np.roll(np.arange(chain.k), -lead)
    if lead == 0:
        return chain, U, columns
    D = np.concatenate(
        (
            chain.D[lead : chain.k],
            (chain.D[chain.k] @ se3.inverse(U) @ chain.D[0])[None],
            chain.D[1:lead],
            np.eye(4)[None],
        )
    )
    turned = JointChain(
        columns=read_only(chain.columns[columns], np.int64),
        sigma=read_only(chain.sigma[columns], np.int64),
        D=read_only(D),
        base=chain.base,
    )
    return turned, np.eye(4), columns
