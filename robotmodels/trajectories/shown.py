"""Bounds in messages, rounded to the side on which they are accepted when they are passed back."""

from __future__ import annotations

from decimal import ROUND_CEILING, ROUND_FLOOR, Context


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
