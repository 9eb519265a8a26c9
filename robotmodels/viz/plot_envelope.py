"""Long signals in as many points as a figure can show, none of their peaks lost."""

from __future__ import annotations

import numpy as np

from .._arrays import Array


def envelope(t: Array, y: Array, step: int) -> tuple[Array, Array]:
    """The least and the greatest of every so many samples, in the order in which they come.

    Parameters
    ----------
    t : ndarray, shape (N,)
        Times.
    y : ndarray, shape (N, m)
        Samples.
    step : int
        Samples for a pair of points; up to 2 keeps all.

    Returns
    -------
    t : ndarray, shape (k, m)
        Times of the points of each column.
    y : ndarray, shape (k, m)
        Their values.

    Examples
    --------
    >>> y = np.array([0.0, 5.0, 1.0, -2.0, 0.0, 3.0])[:, None]
    >>> envelope(np.arange(6.0), y, 3)[1].ravel()
    array([ 0.,  5., -2.,  3.])
    """
    N, m = y.shape
    if step <= 2 or not N:
        return np.repeat(t[:, None], m, axis=1), y
    rows = -(-N // step)
    # the last samples are repeated until the last group is full
    index = np.minimum(np.arange(rows * step), N - 1).reshape(rows, step)
    groups = y[index]
    pairs = np.sort(np.stack((groups.argmin(axis=1), groups.argmax(axis=1)), axis=1), axis=1)
    place = np.minimum(pairs + (np.arange(rows) * step)[:, None, None], N - 1).reshape(-1, m)
    return t[place], np.take_along_axis(y, place, axis=0)
