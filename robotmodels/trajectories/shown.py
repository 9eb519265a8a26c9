"""Numbers as messages and reprs show them.

Bounds are rounded to the side on which they are accepted when they are passed back.
"""

from __future__ import annotations

from collections.abc import Iterable
from decimal import ROUND_CEILING, ROUND_FLOOR, Context

import numpy as np

from .._arrays import Array


def least_shown(value: float, digits: int = 12) -> str:
    """A least value in few digits, not below it.

    Parameters
    ----------
    value : float
        What is just accepted.
    digits : int
        How many are shown at most.

    Returns
    -------
    str
        A number that is at least as great, also when it is read back.

    Examples
    --------
    >>> least_shown(1.0 / 3.0), least_shown(0.5), least_shown(2.0 / 3.0, 3)
    ('0.333333333334', '0.5', '0.667')
    """
    up = Context(prec=digits, rounding=ROUND_CEILING).create_decimal(float(value))
    return f"{float(up):.{digits}g}"


def most_shown(value: float, digits: int = 12) -> str:
    """A greatest value in few digits, not above it.

    Parameters
    ----------
    value : float
        What is just accepted.
    digits : int
        How many are shown at most.

    Returns
    -------
    str
        A number that is at most as great, also when it is read back.

    Examples
    --------
    >>> most_shown(2.0 / 3.0, 3)
    '0.666'
    """
    down = Context(prec=digits, rounding=ROUND_FLOOR).create_decimal(float(value))
    return f"{float(down):.{digits}g}"


def counted(number: int, one: str) -> str:
    """A number of things, with the plural of regular words.

    Parameters
    ----------
    number : int
        How many.
    one : str
        The word for one of them.

    Returns
    -------
    str
        Both.

    Examples
    --------
    >>> counted(1, "joint"), counted(6, "joint")
    ('1 joint', '6 joints')
    """
    return f"{number} {one}" if number == 1 else f"{number} {one}s"


def greatest_shown(rows: Iterable[tuple[str, Array]]) -> str:
    """The greatest sizes of quantities of joints, and which joint has them.

    Parameters
    ----------
    rows : iterable of (str, ndarray of shape (..., n))
        Names and values; NaN is no value.

    Returns
    -------
    str
        One line.

    Examples
    --------
    >>> greatest_shown([("velocity", np.array([[0.5, -2.0], [0.0, 1.0]]))])
    'greatest velocity 2 (joint 2)'
    """
    texts = []
    for name, values in rows:
        size = np.abs(np.where(np.isnan(values), 0.0, values)).reshape(-1, values.shape[-1])
        if size.size:
            size = size.max(axis=0)
            joint = f" (joint {int(size.argmax()) + 1})" if size.size > 1 and size.any() else ""
            texts.append(f"{name} {size.max():.4g}{joint}")
    return "greatest " + ", ".join(texts) if texts else "no values"


def seconds_shown(t: Array) -> str:
    """The times of samples.

    Parameters
    ----------
    t : ndarray, shape (N,)
        Times, s.

    Returns
    -------
    str
        Their number, the first and the last.

    Examples
    --------
    >>> seconds_shown(np.linspace(0.0, 2.0, 5))
    '5 samples from 0 s to 2 s'
    """
    times = f" from {t[0]:.4g} s to {t[-1]:.4g} s" if t.size > 1 else ""
    if t.size == 1:
        times = f" at {t[0]:.4g} s"
    return counted(t.size, "sample") + times
