"""Stacks of poses in MATLAB's order, (4, 4, N), and back. Only the axes move, no number changes.

Parameters
----------
T : array_like
    Pages of poses, shape (4, 4, N), as ``ctraj`` of the Robotics Toolbox for MATLAB gives them and
    ``scipy.io.loadmat`` reads them; or poses of shape (N, 4, 4). One pose, (4, 4), is N = 1.

Returns
-------
ndarray
    The poses, (N, 4, 4) in C order, or pages, (4, 4, N) in Fortran's order, which is MATLAB's.

Raises
------
ShapeError, InvalidValueError
    Another shape, such as the one that needs no conversion; NaN or infinity.
NotARotationError
    A matrix whose last row is not 0 0 0 1: no pose, or axes in another order. The order of an
    array of shape (4, 4, 4) is not guessed; the function that is called defines it.

References
----------
The exercise, section 4.3: "an array of 4 x 4 x N".
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_core, as_floats
from ..errors import NotARotationError, ShapeError
from .checks import ROTATION_TOLERANCE


def poses_from_matlab(T: ArrayLike) -> Array:
    """Poses from MATLAB's order: ``(4, 4, N)``, page by page, to ``(N, 4, 4)``.

    Examples
    --------
    >>> from robotmodels.se3 import translation
    >>> pages = np.stack([translation(0, 0, z) for z in (0.1, 0.2, 0.3)], axis=-1)
    >>> pages.shape, poses_from_matlab(pages)[:, 2, 3]
    ((4, 4, 3), array([0.1, 0.2, 0.3]))
    """
    pages = as_floats(T, "T")
    if pages.shape == (4, 4):
        pages = pages[:, :, None]
    if pages.ndim != 3 or pages.shape[:2] != (4, 4):
        already = pages.ndim == 3 and pages.shape[1:] == (4, 4)
        raise ShapeError(
            f"T: expected MATLAB's order (4, 4, N), got shape {pages.shape}."
            + (" This is (N, 4, 4) already: use it as it is." if already else "")
        )
    poses = np.array(np.moveaxis(pages, -1, 0), order="C")
    _check_rows(poses, "T[3, :, {}]", "If T is (N, 4, 4) already, use it as it is.")
    return poses


def poses_to_matlab(T: Any) -> Array:
    """Poses in MATLAB's order: ``(N, 4, 4)`` to ``(4, 4, N)``, page by page.

    Examples
    --------
    >>> from robotmodels.se3 import translation
    >>> poses_to_matlab(np.array([np.eye(4), translation(1, 2, 3)]))[:3, 3, 1]
    array([1., 2., 3.])
    """
    poses = as_core(getattr(T, "homogeneous", T), (4, 4), "T")
    if poses.ndim > 3:
        raise ShapeError(
            f"T: expected (N, 4, 4) or (4, 4), got shape {poses.shape}; join the batch axes "
            "first, T.reshape(-1, 4, 4)."
        )
    poses = poses.reshape(-1, 4, 4)
    _check_rows(poses, "T[{}, 3]", "If T is (4, 4, N) already, it is in MATLAB's order.")
    return np.array(np.moveaxis(poses, 0, -1), order="F")


def _check_rows(poses: Array, place: str, hint: str) -> None:
    """Refuse poses (N, 4, 4) whose last row is not 0 0 0 1."""
    off = np.abs(poses[:, 3] - (0.0, 0.0, 0.0, 1.0)).max(axis=-1)
    for k in np.flatnonzero(off > ROTATION_TOLERANCE)[:1]:
        raise NotARotationError(
            f"T: the last row of pose {k}, {place.format(k)}, must be 0 0 0 1, got "
            f"{poses[k, 3].tolist()}. {hint}"
        )
