"""Triangular factors merged in a fixed tree: the same bits, whoever computed the leaves."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

import numpy as np

from .._arrays import Array

T = TypeVar("T")


def merged_tree(leaves: Iterable[T], merge: Callable[[T, T], T]) -> T | None:
    """Merge leaves in a binary tree that depends on their number and order alone."""
    waiting: list[tuple[int, T]] = []
    for leaf in leaves:
        level = 0
        while waiting and waiting[-1][0] == level:
            leaf = merge(waiting.pop()[1], leaf)
            level += 1
        waiting.append((level, leaf))
    if not waiting:
        return None
    root = waiting.pop()[1]
    while waiting:
        root = merge(waiting.pop()[1], root)
    return root


def merged_factor(first: Array, second: Array) -> Array:
    """A factor R of both: ``R^T R = A^T A + B^T B``.

    Shapes: first (r, p), second (s, p) -> (t, p).
    """
    rows = np.vstack((first, second))
    own = rows.any(axis=0)
    part = rows[:, own]
    if len(part) <= part.shape[1]:
        return rows
    R = np.linalg.qr(part, mode="r")
    whole = np.zeros((len(R), rows.shape[1]))
    whole[:, own] = R
    return whole
