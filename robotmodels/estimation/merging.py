"""Triangular factors merged in a fixed tree: the same bits, whoever computed the leaves."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

import numpy as np

from .._arrays import Array

T = TypeVar("T")


def merged_tree(leaves: Iterable[T], merge: Callable[[T, T], T]) -> T | None:
    """Merge leaves in a binary tree that depends on their number and order alone.

    Neighbours are merged as soon as both are there, so that no more than the logarithm of their
    number wait at a time.

    Parameters
    ----------
    leaves : iterable
        In order.
    merge : callable
        Of two neighbours.

    Returns
    -------
    object or None
        The root; None where there is no leaf.

    Examples
    --------
    >>> merged_tree("abcde", lambda a, b: f"({a}{b})")
    '(((ab)(cd))e)'
    """
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

    Parameters
    ----------
    first, second : ndarray, shapes (r, p) and (s, p)
        Any matrices, triangular ones of earlier merges among them.

    Returns
    -------
    ndarray, shape (t, p)
        t at most p where there are more rows than columns that are not zero.

    Examples
    --------
    >>> A = np.array([[3.0, 0.0], [4.0, 0.0]])
    >>> abs(merged_factor(A, A)).round(6)
    array([[7.071068, 0.      ]])
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
