"""Blocks dealt to folds, so that what belongs together is kept aside together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .measurements import Measurement


def dealt_blocks(
    measurements: Sequence[Measurement], folds: int, rng: np.random.Generator
) -> list[NDArray[np.int64]]:
    """Deal the blocks of each measurement, and of each group in it, to folds.

    Blocks at the same readings go to the same fold: a repeated measurement is no new one. A group
    that is met in one posture alone is never kept aside, nor what has no postures (known
    distances).

    Parameters
    ----------
    measurements : sequence of Measurement
        Of any kinds.
    folds : int
        How many.
    rng : numpy.random.Generator
        Where chance comes from.

    Returns
    -------
    list of ndarray of int, shapes (B,)
        Fold of each block; -1 for those that are never kept aside.

    Examples
    --------
    >>> from robotmodels.calibration import PointContact
    >>> touched = PointContact([[0.0], [1.0], [1.0], [2.0]], ["a", "a", "a", "b"])
    >>> [fold] = dealt_blocks([touched], 2, np.random.default_rng(0))
    >>> bool(fold[1] == fold[2] != fold[0]), int(fold[3])
    (True, -1)
    """
    dealt, turn = [], 0
    for m in measurements:
        fold = np.full(m.blocks, -1, dtype=np.int64)
        if m.views:
            readings = np.hstack([view.q for view in m.views])
            for group in np.unique(m.groups):
                members = np.flatnonzero(m.groups == group)
                posture = np.unique(readings[members], axis=0, return_inverse=True)[1].ravel()
                count = int(posture.max()) + 1
                if count > 1:
                    fold[members] = ((turn + rng.permutation(count)) % folds)[posture]
                    turn += count
        dealt.append(fold)
    return dealt
