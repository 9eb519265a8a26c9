"""Cross-validation: folds of whole groups, so that no group is in both parts."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InvalidValueError, ShapeError


def k_folds(group: ArrayLike, k: int, rng: np.random.Generator | int) -> NDArray[np.bool_]:
    """Split groups into k folds of nearly equal numbers of groups.

    One fold is a held-out share of 1 / k.

    Parameters
    ----------
    group : array_like of int, shape (M,)
        Group of each row (or measurement).
    k : int
        Number of folds, 2 to the number of groups.
    rng : Generator or int
        Random generator or seed.

    Returns
    -------
    ndarray of bool, shape (k, M)
        Rows held out in each fold; every row in exactly one.

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
    numbers = np.asarray(group)
    if numbers.ndim != 1:
        raise ShapeError(f"group: expected one number for each row (M,), got {numbers.shape}.")
    if numbers.dtype.kind not in "iu":
        raise InvalidValueError(f"group: expected whole numbers, got {numbers.dtype}.")
    labels, place = np.unique(numbers, return_inverse=True)
    count = len(labels)
    if isinstance(k, bool) or not isinstance(k, (int, np.integer)) or not 2 <= k <= count:
        raise InvalidValueError(
            f"k: expected a number of folds from 2 to the {count} groups there are, got {k!r}."
        )
    fold = np.empty(count, dtype=np.int64)
    fold[np.random.default_rng(rng).permutation(count)] = np.arange(count) % k
    return fold[place] == np.arange(k)[:, None]
