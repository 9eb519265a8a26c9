"""The curves that a one-dimensional family of postures is made of, walked from its members."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ..chain import canonical_frames
from ..loop import JointChain

__all__ = ["MemberCurve", "curves_through"]

POINTS = 4000
"""Points of a curve for which room is made at first."""
APART = 0.02
"""Way from a curve within which a member counts as one of it [rad, lengths of the arm]."""


class MemberCurve(NamedTuple):
    """A piece of a curve. Shapes: points, tangents (M, k)."""

    points: Array
    tangents: Array


def curves_through(chain: JointChain, U: Array, q: Array, most: int = 64) -> list[MemberCurve]:
    """Continuation along the curves of a family, each once. Shapes: U (4, 4), q (B, k)."""
    from ._directions import walked

    D, unit = canonical_frames(chain)
    sigma = np.ascontiguousarray(chain.sigma)
    lengths = np.where(sigma == 1, unit, 1.0)
    goal = U.copy()
    goal[:3, 3] /= unit
    members = np.ascontiguousarray(q / lengths)
    waiting = np.ones(len(members), np.bool_)
    # a direction to set out in: whichever the null space has, seen from one that is no axis
    along = np.cos(1.0 + 2.3 * np.arange(chain.k))
    curves: list[MemberCurve] = []
    while waiting.any() and len(curves) < most:
        start = members[int(np.argmax(waiting))]
        waiting[int(np.argmax(waiting))] = False
        for sign in (1.0, -1.0):
            room = POINTS
            while True:
                points, tangents = np.empty((room, chain.k)), np.empty((room, chain.k))
                n, closed = walked(
                    sigma, D, goal, start, sign * along, 0, points, tangents, np.empty(room)
                )
                if n < room:
                    break
                room *= 2
            waiting &= ~_on_curve(sigma, members, points[:n], waiting)
            curves.append(MemberCurve(points[:n] * lengths, tangents[:n]))
            if closed:
                break
    return curves


def _on_curve(
    sigma: NDArray[np.int64], members: Array, points: Array, asked: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Members, of those asked for, that lie on a curve given by its points."""
    on = np.zeros(len(members), np.bool_)
    if len(points) < 2:
        return on
    chords = np.diff(points, axis=0)
    squares = np.maximum((chords**2).sum(axis=1), 1e-30)
    chosen = np.flatnonzero(asked)
    # in parts: members times chords times joints are kept below a megabyte or so
    size = max(1, 20_000 // len(chords))
    for first in range(0, chosen.size, size):
        part = chosen[first : first + size]
        d = members[part, None] - points[:-1]
        d = np.where(sigma == 0, np.remainder(d + np.pi, 2.0 * np.pi) - np.pi, d)
        share = np.clip((d * chords).sum(axis=2) / squares, 0.0, 1.0)
        off = d - share[..., None] * chords
        on[part] = ((off**2).sum(axis=2) < APART**2).any(axis=1)
    return on
