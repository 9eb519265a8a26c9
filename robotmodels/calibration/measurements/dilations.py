"""Whether measurements know a length: what is still satisfied when the robot shrinks to a point."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_exact
from .measurement import Measurement

_MEETING = 1e-9
"""Distances by which places miss each other, relative to the largest, that are rounding."""


def have_common_place(A: Array, b: Array) -> bool:
    """Whether ``A c = b`` has a solution: points, lines and planes that contain one place.

    Parameters
    ----------
    A : ndarray, shape (m, 3)
        Unit normals.
    b : ndarray, shape (m,)
        Offsets along them, metres.

    Returns
    -------
    bool
        True for none at all.

    Examples
    --------
    >>> up = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
    >>> have_common_place(up, np.array([0.2, 0.2])), have_common_place(up, np.array([0.2, 0.3]))
    (True, False)
    """
    if not len(b):
        return True
    c = np.linalg.lstsq(A, b, rcond=1e-10)[0]
    return bool(np.abs(A @ c - b).max() <= _MEETING * max(float(np.abs(b).max()), 1e-3))


def length_is_known(
    measurements: Iterable[Measurement], base_origin: ArrayLike | None = None
) -> bool:
    """Whether measurements give the scale of a robot, all of them together.

    A robot dilated from a place c, base included, satisfies contacts with unknown points, lines
    and planes as before, and those with known ones if they contain c. One known point gives no
    length unless the origin of the base is known as well and is another one; two known points do.

    Parameters
    ----------
    measurements : iterable of Measurement
        Of one robot.
    base_origin : array_like, shape (3,), optional
        Origin of R_0 in the world, metres, where the place of the robot is known.

    Returns
    -------
    bool
        Whether a length is known.

    Raises
    ------
    ShapeError, InvalidValueError
        An origin of another shape, NaN.

    References
    ----------
    Seed book section 1.4.5.

    Examples
    --------
    >>> from robotmodels.calibration import PointContact
    >>> touched = PointContact(np.zeros((4, 6)), known={0: [0.5, 0.0, 0.2]})
    >>> length_is_known([touched]), length_is_known([touched], [0.0, 0.0, 0.0])
    (False, True)
    """
    measurements = tuple(measurements)
    if any(m.knows_length for m in measurements):
        return True
    parts = [m.dilation_centres for m in measurements]
    if base_origin is not None:
        parts.append((np.eye(3), as_exact(base_origin, (3,), "base_origin")))
    A = np.concatenate([np.zeros((0, 3)), *(part[0] for part in parts)])
    b = np.concatenate([np.zeros(0), *(part[1] for part in parts)])
    return not have_common_place(A, b)
