"""Postures found in parts put together: rows padded, equal ones merged, packed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .solver import Found, nothing_found

MERGE = 1e-6
"""Postures closer than this in every joint are one [rad, m]."""


def assembled(N: int, k: int, parts: Iterable[tuple[NDArray[np.int64], Found]]) -> Found:
    """Combine the postures of parts of N poses."""
    parts = list(parts)
    out = nothing_found(N, max((part.q.shape[1] for _, part in parts), default=0), k)
    for rows, part in parts:
        S = part.q.shape[1]
        out.q[rows, :S], out.valid[rows, :S] = part.q, part.valid
        out.residual[rows, :S], out.double[rows, :S] = part.residual, part.double
        out.free[rows, :S], out.family[rows, :S] = part.free, part.family
    return out


def merged(sigma: NDArray[np.int64], found: Found, within: float = MERGE) -> Found:
    """Merge equal postures of each pose and pack the rows. Shapes: sigma (k,)."""
    q = np.where(found.valid[..., None], found.q, 0.0)
    gap = q[:, :, None] - q[:, None]
    turns = np.where(sigma == 0, np.round(gap / (2.0 * np.pi)), 0.0)
    same = np.all(np.abs(gap - 2.0 * np.pi * turns) < within, axis=-1)
    # a row equal to an earlier one goes
    S = q.shape[1]
    earlier = np.tril(np.ones((S, S), np.bool_), -1)
    valid = found.valid & ~np.any(same & earlier & found.valid[:, None], axis=-1)
    order = np.argsort(~valid, axis=1, kind="stable")
    order = order[:, : int(valid.sum(axis=1).max(initial=0))]
    pick = np.arange(len(q))[:, None], order
    there = valid[pick]
    return replace(
        found,
        q=np.where(there[..., None], found.q[pick], np.nan),
        valid=there,
        residual=np.where(there, found.residual[pick], np.nan),
        double=found.double[pick] & there,
        free=found.free[pick] & there[..., None],
        family=found.family[pick] & there,
    )


def rows_of(
    found: Found, poses: NDArray[np.int64] | NDArray[np.bool_] | tuple[NDArray[np.int64], ...]
) -> Found:
    """What was found for some of the poses."""
    return Found(
        found.q[poses], found.valid[poses], found.residual[poses], found.double[poses],
        found.free[poses], found.family[poses],
    )  # fmt: skip
