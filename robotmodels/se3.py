"""Poses as 4x4 matrices: elementary motions, inverse, checks, MATLAB's order, roll-pitch-yaw.

Seed book section 1.1, eq. [1.1]: the columns of a pose are s, n, a (the axes) and P.
"""

from __future__ import annotations

from math import atan2, cos, hypot, pi, sin
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import Array, as_core, as_floats
from .errors import NotARotationError, ShapeError

ROTATION_TOLERANCE = 1e-6
"""Largest entry of ``R R^T - 1`` (and of ``det R - 1``) that still counts as a rotation."""


def rotation(axis: str, angle: float) -> Array:
    """Pose of a rotation about one coordinate axis, ``Rot(axis, angle)``.

    Parameters
    ----------
    axis : {"x", "y", "z"}
        Which axis.
    angle : float
        Radians.

    Returns
    -------
    ndarray, shape (4, 4)
        The pose.

    Examples
    --------
    >>> rotation("z", np.pi)[0, 0]
    np.float64(-1.0)
    """
    c, s = _cos_sin(angle)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    T = np.eye(4)
    T[i, i] = T[j, j] = c
    T[i, j], T[j, i] = -s, s
    return T


def translation(x: float, y: float, z: float) -> Array:
    """Pose of a pure translation.

    Parameters
    ----------
    x, y, z : float
        Metres.

    Returns
    -------
    ndarray, shape (4, 4)
        The pose.

    Examples
    --------
    >>> translation(0, 0, 0.5)[2, 3]
    np.float64(0.5)
    """
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def inverse(T: Array) -> Array:
    """Inverse of rigid poses.

    Parameters
    ----------
    T : ndarray, shape (..., 4, 4)
        Poses.

    Returns
    -------
    ndarray, shape (..., 4, 4)
        ``T^-1`` by transposition.

    Examples
    --------
    >>> inverse(translation(0, 0, 0.5))[2, 3]
    np.float64(-0.5)
    """
    Ti = np.zeros(T.shape)
    Rt = np.swapaxes(T[..., :3, :3], -1, -2)
    Ti[..., :3, :3] = Rt
    Ti[..., :3, 3] = -np.einsum("...ij,...j->...i", Rt, T[..., :3, 3])
    Ti[..., 3, 3] = 1.0
    return Ti


def skew(p: Array) -> Array:
    """Matrices of the vector product, ``skew(p) @ u = p x u``.

    Parameters
    ----------
    p : ndarray, shape (..., 3)
        Vectors.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Skew-symmetric matrices.

    Examples
    --------
    >>> skew(np.array([1.0, 0.0, 0.0]))[2, 1]
    np.float64(1.0)
    """
    S = np.zeros((*p.shape[:-1], 3, 3))
    S[..., 0, 1], S[..., 0, 2], S[..., 1, 2] = -p[..., 2], p[..., 1], -p[..., 0]
    S[..., 1, 0], S[..., 2, 0], S[..., 2, 1] = p[..., 2], -p[..., 1], p[..., 0]
    return S


def as_pose(T: Any, name: str = "T") -> Array:
    """Check poses and bring them exactly onto the rotation group.

    Anything with a ``homogeneous`` attribute (``pinocchio.SE3``) is accepted. A rotation that
    is off by more than rounding, but less than `ROTATION_TOLERANCE`, is replaced by the nearest
    rotation (polar decomposition); rotations exact to rounding are left untouched.

    Parameters
    ----------
    T : array_like, shape (..., 4, 4)
        Poses, last row 0 0 0 1.
    name : str
        Used in error messages.

    Returns
    -------
    ndarray, shape (..., 4, 4)
        Checked poses.

    Raises
    ------
    ShapeError
        Not (..., 4, 4).
    InvalidValueError
        NaN or infinity.
    NotARotationError
        The last row or the rotation is off by more than the tolerance, or it mirrors.

    Examples
    --------
    >>> as_pose([[1, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]).shape
    (4, 4)
    """
    T = as_core(getattr(T, "homogeneous", T), (4, 4), name)
    if T.size == 0:
        return T
    if np.abs(T[..., 3, :] - (0.0, 0.0, 0.0, 1.0)).max() > ROTATION_TOLERANCE:
        raise NotARotationError(f"{name}: the last row of a pose must be 0 0 0 1.")
    R = T[..., :3, :3]
    off = np.abs(R @ np.swapaxes(R, -1, -2) - np.eye(3)).max(axis=(-1, -2))
    worst = float(off.max())
    mirrors = np.linalg.det(R) < 0
    if worst > ROTATION_TOLERANCE or mirrors.any():
        fault = off if worst > ROTATION_TOLERANCE else mirrors
        i = np.unravel_index(int(fault.argmax()), fault.shape) if off.ndim else ()
        row = f" (row {', '.join(map(str, i))})" if i else ""
        raise NotARotationError(
            f"{name}: the 3x3 block is not a rotation{row}: R R^T differs from 1 by "
            f"{float(off[i]):.2g} and det R = {float(np.linalg.det(R)[i]):.6g}; at most "
            f"{ROTATION_TOLERANCE:g} is accepted and rounded away. Make it one first, for "
            "example with scipy.spatial.transform.Rotation.from_matrix(R).as_matrix()."
        )
    T = T.copy()
    T[..., 3, :] = 0.0, 0.0, 0.0, 1.0
    if worst > 4e-15:
        U, _, Vt = np.linalg.svd(R)
        T[..., :3, :3] = np.where((off > 4e-15)[..., None, None], U @ Vt, R)
    return T


def as_single_pose(T: Any, name: str) -> Array:
    """One checked pose; None is the identity.

    Parameters
    ----------
    T : array_like, shape (4, 4), or None
        The pose.
    name : str
        Used in error messages.

    Returns
    -------
    ndarray, shape (4, 4)
        Checked pose.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        As `as_pose`.

    Examples
    --------
    >>> bool((as_single_pose(None, "tool") == np.eye(4)).all())
    True
    """
    if T is None:
        return np.eye(4)
    T = as_pose(T, name)
    if T.ndim != 2:
        raise ShapeError(f"{name}: expected one pose of shape (4, 4), got {T.shape}.")
    return T


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


def from_rpy(rpy: ArrayLike, xyz: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
    """Pose of a URDF ``<origin>``: ``Trans(xyz) Rot(z, yaw) Rot(y, pitch) Rot(x, roll)``.

    Parameters
    ----------
    rpy : array_like, shape (3,)
        Roll, pitch, yaw in radians.
    xyz : array_like, shape (3,)
        Metres.

    Returns
    -------
    ndarray, shape (4, 4)
        The pose.

    Examples
    --------
    >>> from_rpy([0, 0, 0], [1, 2, 3])[:3, 3]
    array([1., 2., 3.])
    """
    roll, pitch, yaw = (float(v) for v in np.asarray(rpy))
    T = rotation("z", yaw) @ rotation("y", pitch) @ rotation("x", roll)
    T[:3, 3] = xyz
    return T


def to_rpy(R: Array) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a rotation, exact also at gimbal lock.

    Roll is found by back-substitution of yaw, not from its own quotient: where pitch is +-90
    degrees yaw is arbitrary, and any value of it then still gives back the same matrix.

    Parameters
    ----------
    R : ndarray, shape (3, 3)
        Rotation.

    Returns
    -------
    roll, pitch, yaw : float
        Radians, pitch in [-pi/2, pi/2].

    Examples
    --------
    >>> [round(v, 12) for v in to_rpy(from_rpy([0.1, 0.2, 0.3])[:3, :3])]
    [0.1, 0.2, 0.3]
    """
    yaw = atan2(R[1, 0], R[0, 0])
    pitch = atan2(-R[2, 0], hypot(R[0, 0], R[1, 0]))
    c, s = cos(yaw), sin(yaw)
    roll = atan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return roll + 0.0, pitch + 0.0, yaw + 0.0


def _cos_sin(angle: float) -> tuple[float, float]:
    """Cosine and sine, exact at the multiples of a right angle that tables are full of."""
    quarter = angle / (pi / 2)
    if quarter == round(quarter) and abs(quarter) <= 8:
        k = int(quarter) % 4
        return (1.0, 0.0, -1.0, 0.0)[k], (0.0, 1.0, 0.0, -1.0)[k]
    return cos(angle), sin(angle)
