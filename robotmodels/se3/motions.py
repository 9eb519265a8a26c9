"""Elementary motions, their inverse, and the matrix of the vector product.

Seed book section 1.1, eq. [1.1]: the columns of a pose are s, n, a (the axes) and P.
"""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np

from .._arrays import Array


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
    S = np.zeros((*p.shape[:-1], 3, 3), np.result_type(p, float))
    S[..., 0, 1], S[..., 0, 2], S[..., 1, 2] = -p[..., 2], p[..., 1], -p[..., 0]
    S[..., 1, 0], S[..., 2, 0], S[..., 2, 1] = p[..., 2], -p[..., 1], p[..., 0]
    return S


def _cos_sin(angle: float) -> tuple[float, float]:
    """Cosine and sine, exact at the multiples of a right angle that tables are full of."""
    quarter = angle / (pi / 2)
    if quarter == round(quarter) and abs(quarter) <= 8:
        k = int(quarter) % 4
        return (1.0, 0.0, -1.0, 0.0)[k], (0.0, 1.0, 0.0, -1.0)[k]
    return cos(angle), sin(angle)
