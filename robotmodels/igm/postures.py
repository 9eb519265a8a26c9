"""Postures (IK solutions) of N poses: the one container that all solvers fill and pass on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array

MERGE = 1e-6
"""Postures closer than this in every joint are equal [rad, m]."""

Rows = NDArray[np.int64] | NDArray[np.bool_] | tuple[NDArray[np.int64], ...]


@dataclass(frozen=True, slots=True, eq=False)
class Postures:
    """Postures of N poses in up to S rows each, in the order of the chain.

    Shapes: q, free, moving (N, S, k); valid, residual, double, family (N, S).
    """

    q: Array
    valid: NDArray[np.bool_]
    residual: Array
    double: NDArray[np.bool_]
    free: NDArray[np.bool_]  # joints at their reference
    family: NDArray[np.bool_]  # members of a self-motion; moving: joints that move with the free
    moving: NDArray[np.bool_] = field(default=None)  # pyright: ignore[reportAssignmentType]

    def __post_init__(self) -> None:
        """No joint is known to move."""
        if self.moving is None:
            object.__setattr__(self, "moving", np.zeros(self.q.shape, np.bool_))

    def take(self, rows: Rows) -> Postures:
        """Postures of some of the poses."""
        return Postures(*(array[rows] for array in self._arrays()))

    def put(self, rows: Rows, part: Postures) -> Postures:
        """Postures with those of some poses replaced, and more rows where they need more."""
        N, S, k = self.q.shape
        out = no_postures(N, max(S, part.q.shape[1]), k)
        for whole, old, new in zip(out._arrays(), self._arrays(), part._arrays(), strict=True):
            whole[:, :S] = old
            whole[rows] = np.nan if whole.dtype == np.float64 else False
            whole[rows, : new.shape[1]] = new
        return out

    def pack(self, keep: NDArray[np.bool_]) -> Postures:
        """The rows to keep first, in as few rows as the poses need. Shapes: keep (N, S)."""
        keep = keep & self.valid
        order = np.argsort(~keep, axis=1, kind="stable")
        order = order[:, : int(keep.sum(axis=1).max(initial=0))]
        pick = np.arange(len(order))[:, None], order
        there = keep[pick]
        out = self.take(pick)
        for array in out._arrays():
            array[~there] = np.nan if array.dtype == np.float64 else False
        return out

    def merge(self, sigma: NDArray[np.int64], within: float = MERGE) -> Postures:
        """Each posture once, in the first row it has, packed. Shapes: sigma (k,)."""
        q = np.where(self.valid[..., None], self.q, 0.0)
        gap = np.abs(difference(sigma, q[:, :, None], q[:, None])).max(axis=-1, initial=0.0)
        S = q.shape[1]
        earlier = np.tril(np.ones((S, S), np.bool_), -1) & self.valid[:, None]
        return self.pack(~np.any((gap < within) & earlier, axis=-1))

    def _arrays(self) -> tuple[NDArray, ...]:
        return tuple(getattr(self, name) for name in _NAMES)


_NAMES = tuple(field.name for field in fields(Postures))


def no_postures(N: int, S: int, k: int) -> Postures:
    """Rows without a posture, to be filled in."""
    q, residual = np.full((N, S, k), np.nan), np.full((N, S), np.nan)
    valid, double, family = np.zeros((3, N, S), np.bool_)
    return Postures(q, valid, residual, double, np.zeros((N, S, k), np.bool_), family)


def assembled(N: int, k: int, parts: Iterable[tuple[Rows, Postures]]) -> Postures:
    """Postures of N poses, put together from those of some of the poses."""
    parts = list(parts)
    out = no_postures(N, max((part.q.shape[1] for _, part in parts), default=0), k)
    for rows, part in parts:
        for whole, new in zip(out._arrays(), part._arrays(), strict=True):
            whole[rows, : new.shape[1]] = new
    return out


def side_by_side(parts: Iterable[Postures]) -> Postures:
    """All rows of several sets of postures of the same poses."""
    arrays = zip(*(part._arrays() for part in parts), strict=True)
    return Postures(*(np.concatenate(array, axis=1) for array in arrays))


def difference(sigma: NDArray[np.int64], a: Array, b: Array) -> Array:
    """``a - b``, angles by the shorter way round. Shapes: sigma (k,), a and b (..., k)."""
    d = a - b
    turns = np.where(sigma == 0, np.round(d / (2.0 * np.pi)), 0.0)
    return d - 2.0 * np.pi * turns
