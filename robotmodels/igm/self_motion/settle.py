"""Infinite families of postures, one posture taken from each; and double roots.

Where a pose lets the arm move while the tool stands still, a posture is one of a family. The first
joint, from the base, that moves along the family takes its reference value, or the nearest value
that it reaches; in families of more dimensions then the next joint, given the ones before. Every
posture of the family at that value is returned: a closed curve passes a value more than once.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ..check import checked
from ..loop import JointChain
from ..postures import Postures
from ..shortened import shortened
from ..solver import Found, Tolerances

__all__ = ["Settled", "double_roots", "replaced", "settle_families", "singular_postures"]

Settled = Postures


def settle_families(
    chain: JointChain,
    U: Array,
    found: Found,
    references: Array,
    tolerances: Tolerances,
) -> Settled:
    """Members of every infinite family with its first joints at their reference values.

    Shapes: U (N, 4, 4), references (N, k).
    """
    chosen = np.flatnonzero(np.any(found.family & found.valid, axis=1))
    if chosen.size == 0:
        return found
    goals = np.ascontiguousarray(U[chosen])
    part = _settled(chain, goals, found.take(chosen), references[chosen], tolerances)
    return found.put(chosen, part)


def singular_postures(
    chain: JointChain, found: Found
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Flags of double roots and of members of infinite families, from the Jacobians.

    Shapes: -> double, member (N, S).
    """
    from ._members import singular_postures as singular

    D, unit = shortened(chain)
    double = np.zeros(found.valid.shape, np.bool_)
    member = np.zeros(found.valid.shape, np.bool_)
    q = np.ascontiguousarray(found.q)
    if unit != 1.0 and np.any(chain.sigma == 1):
        q = np.where(chain.sigma == 1, q / unit, q)
    valid = np.ascontiguousarray(found.valid)
    singular(np.ascontiguousarray(chain.sigma), D, q, valid, double, member)
    return double, member


def double_roots(chain: JointChain, found: Found) -> NDArray[np.bool_]:
    """Flags (N, S) of double roots, see `singular_postures`."""
    return singular_postures(chain, found)[0]


def replaced(
    whole: Postures, moving: NDArray[np.bool_], chosen: NDArray[np.int64], part: Postures
) -> Postures:
    """The postures with those of some poses replaced."""
    return replace(whole, moving=moving).put(chosen, part)


def _bits(packed: NDArray[np.int64], k: int) -> NDArray[np.bool_]:
    """The lowest k bits of each number, one joint each, shape (..., k)."""
    return (packed[..., None] >> np.arange(k)) & 1 == 1


def _settled(
    chain: JointChain, U: Array, found: Found, references: Array, tolerances: Tolerances
) -> Settled:
    """Poses with families: their postures, and the joints that move."""
    from ._members import settled_already
    from .family_curves import Family, settled_members

    D, unit = shortened(chain)
    N, S, k = found.q.shape
    sigma = np.ascontiguousarray(chain.sigma)
    lengths = np.where(sigma == 1, unit, 1.0)
    goals = U.copy()
    goals[:, :3, 3] /= unit
    q = np.where(found.valid[..., None], found.q, 0.0) / lengths
    member = found.family & found.valid
    free = np.sum(found.free.astype(np.int64) << np.arange(k), axis=-1)
    moving = np.zeros((N, S), np.int64)
    settled_already(goals, sigma, D, q, free, member, moving)
    unsettled = np.flatnonzero(np.any(member & (moving == 0), axis=1))
    if unsettled.size == 0:
        return replace(found, moving=_bits(moving, k))
    # rows of a pose: posture, free and moving joints, double root
    rows: list[list[tuple[Array, int, int, bool]]] = []
    for n in unsettled:
        family, kept = Family(sigma, D, goals[n], references[n] / lengths), []
        for r in np.flatnonzero(found.valid[n]):
            if member[n, r] and moving[n, r] == 0:
                kept += [
                    (item.q, item.held, item.moving, double)
                    for item, double in settled_members(family, q[n, r])
                ]
            else:
                row = int(free[n, r]), int(moving[n, r]), bool(found.double[n, r])
                kept.append((q[n, r], *row))
        rows.append(kept)
    most = max(len(kept) for kept in rows)
    there = np.arange(most) < np.array([len(kept) for kept in rows])[:, None]
    candidates = np.full((unsettled.size, most, k), np.nan)
    marks = np.zeros((3, unsettled.size, most), np.int64)
    for i, kept in enumerate(rows):
        candidates[i, : len(kept)] = [row[0] for row in kept]
        marks[:, i, : len(kept)] = np.transpose([row[1:] for row in kept])
    candidates *= lengths
    part = checked(
        chain, U[unsettled], candidates, there, tolerances,
        free=_bits(marks[0], k), double=marks[2] == 1,
    )  # fmt: skip
    # which candidate a posture was: the nearest one
    d = np.abs(part.q[:, :, None] - candidates[:, None])
    d = np.where(sigma == 0, np.minimum(d, np.abs(d - 2.0 * np.pi)), d).max(axis=-1)
    source = np.argmin(np.where(np.isnan(d), np.inf, d), axis=-1)
    moves = _bits(np.take_along_axis(marks[1], source, axis=1), k) & part.valid[..., None]
    return replace(found, moving=_bits(moving, k)).put(unsettled, replace(part, moving=moves))
