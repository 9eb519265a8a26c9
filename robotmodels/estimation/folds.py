"""Data kept aside: folds of whole groups, so that no group is in both parts."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InvalidValueError, ShapeError

Masks = NDArray[np.bool_]


def k_folds(group: ArrayLike, k: int, rng: np.random.Generator | int) -> Masks:
    """Split groups into k folds of nearly equal numbers of groups.

    Parameters
    ----------
    group : array_like of int, shape (M,)
        Group of each row (or measurement).
    k : int
        Number of folds, 2 to the number of groups.
    rng : Generator or int
        Chance.

    Returns
    -------
    ndarray of bool, shape (k, M)
        Rows kept aside in each fold; every row in exactly one.

    Raises
    ------
    ShapeError, InvalidValueError
        Groups that are not a list of whole numbers, or fewer groups than folds.

    Examples
    --------
    >>> masks = k_folds([0, 0, 1, 1, 2, 2], 3, rng=1)
    >>> masks.sum(axis=1), masks.sum(axis=0)
    (array([2, 2, 2]), array([1, 1, 1, 1, 1, 1]))
    """
    place, count = _groups(group)
    if isinstance(k, bool) or not isinstance(k, (int, np.integer)) or not 2 <= k <= count:
        raise InvalidValueError(
            f"k: expected a number of folds from 2 to the {count} groups there are, got {k!r}."
        )
    fold = np.empty(count, dtype=np.int64)
    fold[np.random.default_rng(rng).permutation(count)] = np.arange(count) % k
    return fold[place] == np.arange(k)[:, None]


def leave_one_group_out(group: ArrayLike) -> Masks:
    """Each group kept aside once, in the order of their numbers.

    Parameters
    ----------
    group : array_like of int, shape (M,)
        Group of each row (or measurement).

    Returns
    -------
    ndarray of bool, shape (G, M)
        Rows kept aside.

    Raises
    ------
    ShapeError, InvalidValueError
        Groups that are not a list of whole numbers, or one group only.

    Examples
    --------
    >>> leave_one_group_out([7, 3, 7]).astype(int)
    array([[0, 1, 0],
           [1, 0, 1]])
    """
    place, count = _groups(group)
    if count < 2:
        raise InvalidValueError(
            f"group: expected two groups or more to leave one out, got {count}."
        )
    return place == np.arange(count)[:, None]


def held_out(group: ArrayLike, share: float, rng: np.random.Generator | int) -> NDArray[np.bool_]:
    """Keep a share of the groups aside, at least one and not all.

    Parameters
    ----------
    group : array_like of int, shape (M,)
        Group of each row (or measurement).
    share : float
        Of the groups, between 0 and 1.
    rng : Generator or int
        Chance.

    Returns
    -------
    ndarray of bool, shape (M,)
        Rows kept aside.

    Raises
    ------
    ShapeError, InvalidValueError
        Groups that are not a list of whole numbers, one group only, or a share out of range.

    Examples
    --------
    >>> int(held_out(range(10), 0.3, rng=0).sum())
    3
    """
    place, count = _groups(group)
    if not 0 < share < 1:
        raise InvalidValueError(f"share: expected a number between 0 and 1, got {share!r}.")
    if count < 2:
        raise InvalidValueError(f"group: expected two groups or more to split, got {count}.")
    number = min(max(round(share * count), 1), count - 1)
    aside = np.zeros(count, dtype=bool)
    aside[np.random.default_rng(rng).permutation(count)[:number]] = True
    return aside[place]


def _groups(group: ArrayLike) -> tuple[NDArray[np.int64], int]:
    numbers = np.asarray(group)
    if numbers.ndim != 1:
        raise ShapeError(f"group: expected one number for each row (M,), got {numbers.shape}.")
    if not len(numbers) or numbers.dtype.kind not in "iu":
        raise InvalidValueError(
            f"group: expected whole numbers, at least one, got {numbers.dtype} {numbers.shape}."
        )
    labels, place = np.unique(numbers, return_inverse=True)
    return place, len(labels)
