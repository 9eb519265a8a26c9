"""Stacks of poses in MATLAB's order, and back."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_core, as_floats
from ..errors import NotARotationError, ShapeError
from .checks import ROTATION_TOLERANCE


def poses_from_matlab(T: ArrayLike) -> Array:
    """Poses from MATLAB's order: ``(4, 4, N)``, page by page, to ``(N, 4, 4)``.

    Only the axes move, no number changes. That ``(4, 4, 4)`` is in MATLAB's order is not guessed:
    the name of this function says so, and the last row of each pose is looked at.

    Parameters
    ----------
    T : array_like, shape (4, 4, N) or (4, 4)
        Pages of poses, as ``ctraj`` of the Robotics Toolbox for MATLAB gives them and
        ``scipy.io.loadmat`` reads them. MATLAB has no last axis of length 1: ``(4, 4)`` is N = 1.

    Returns
    -------
    ndarray, shape (N, 4, 4)
        The poses, C-ordered.

    Raises
    ------
    ShapeError
        Another shape, such as ``(N, 4, 4)``, which needs no conversion.
    InvalidValueError
        NaN or infinity.
    NotARotationError
        A page whose last row is not 0 0 0 1, so that it is no pose, or the order is another one.

    References
    ----------
    The exercise, section 4.3: "an array of 4 x 4 x N".

    Examples
    --------
    >>> from robotmodels.se3 import translation
    >>> pages = np.stack([translation(0, 0, z) for z in (0.1, 0.2, 0.3)], axis=-1)
    >>> pages.shape, poses_from_matlab(pages).shape
    ((4, 4, 3), (3, 4, 4))
    >>> poses_from_matlab(pages)[:, 2, 3]
    array([0.1, 0.2, 0.3])
    """
    pages = as_floats(T, "T")
    if pages.shape == (4, 4):
        pages = pages[:, :, None]
    if pages.ndim != 3 or pages.shape[:2] != (4, 4):
        advice = (
            " This is (N, 4, 4) already: use it as it is."
            if pages.ndim == 3 and pages.shape[1:] == (4, 4)
            else " Give the pages of poses, one behind the other along the last axis."
        )
        raise ShapeError(f"T: expected MATLAB's order (4, 4, N), got shape {pages.shape}.{advice}")
    off = np.abs(pages[3] - np.array([[0.0], [0.0], [0.0], [1.0]])).max(axis=0)
    if (off > ROTATION_TOLERANCE).any():
        k = int((off > ROTATION_TOLERANCE).argmax())
        raise NotARotationError(
            f"T: the last row of page {k}, T[3, :, {k}], must be 0 0 0 1, got "
            f"{pages[3, :, k].tolist()}. If T is (N, 4, 4) already, use it as it is."
        )
    return np.array(np.moveaxis(pages, -1, 0), order="C")


def poses_to_matlab(T: Any) -> Array:
    """Poses in MATLAB's order: ``(N, 4, 4)`` to ``(4, 4, N)``, page by page.

    Parameters
    ----------
    T : array_like, shape (N, 4, 4) or (4, 4)
        Poses; one pose gives one page.

    Returns
    -------
    ndarray, shape (4, 4, N)
        Pages of poses, as ``ikine`` of the Robotics Toolbox for MATLAB takes them, in Fortran's
        order, which is MATLAB's in memory.

    Raises
    ------
    ShapeError
        Another shape; several batch axes have no place in MATLAB's order.
    InvalidValueError
        NaN or infinity.
    NotARotationError
        A pose whose last row is not 0 0 0 1, so that it is none, or the order is another one.

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
    off = np.abs(poses[:, 3] - (0.0, 0.0, 0.0, 1.0)).max(axis=-1)
    if (off > ROTATION_TOLERANCE).any():
        k = int((off > ROTATION_TOLERANCE).argmax())
        raise NotARotationError(
            f"T: the last row of pose {k}, T[{k}, 3], must be 0 0 0 1, got "
            f"{poses[k, 3].tolist()}. If T is (4, 4, N) already, it is in MATLAB's order."
        )
    return np.array(np.moveaxis(poses, 0, -1), order="F")
