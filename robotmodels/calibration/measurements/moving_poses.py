"""Poses that depend on unknowns: products, relative poses and differences, with derivatives.

Each is an `Evaluation`: poses of shape (N, 4, 4) and, of shape (N, 6, C), the ``[v; w]`` that a
unit of each of C unknowns gives them, at their origin and along the axes in which they are given.
"""

from __future__ import annotations

import numpy as np

from ..._arrays import Array
from ...se3 import skew
from .measurement import Evaluation
from .rotation_vectors import inverse_left_jacobians, rotation_errors


def widened(pose: Evaluation, columns: int) -> Evaluation:
    """The same poses with further unknowns that do not move them.

    Parameters
    ----------
    pose : Evaluation
        Poses, C unknowns.
    columns : int
        How many more.

    Returns
    -------
    Evaluation
        C + columns unknowns.
    """
    T, psi = pose
    return Evaluation(T, np.concatenate([psi, np.zeros((*psi.shape[:2], columns))], axis=-1))


def product(a: Evaluation, b: Evaluation) -> Evaluation:
    """``T_a T_b``.

    Parameters
    ----------
    a, b : Evaluation
        Of the same unknowns.

    Returns
    -------
    Evaluation
        Axes of a.
    """
    R = a.T[:, :3, :3]
    arm = (R @ b.T[:, :3, 3:])[..., 0]
    psi = np.empty_like(a.psi)
    psi[:, :3] = a.psi[:, :3] - skew(arm) @ a.psi[:, 3:] + R @ b.psi[:, :3]
    psi[:, 3:] = a.psi[:, 3:] + R @ b.psi[:, 3:]
    return Evaluation(a.T @ b.T, psi)


def relative(a: Evaluation, b: Evaluation) -> Evaluation:
    """``T_a^-1 T_b``: pose of b seen in a.

    Parameters
    ----------
    a, b : Evaluation
        Of the same unknowns.

    Returns
    -------
    Evaluation
        Axes of the end a.
    """
    Rt = a.T[:, :3, :3].swapaxes(-1, -2)
    apart = b.T[:, :3, 3] - a.T[:, :3, 3]
    T = np.tile(np.eye(4), (len(Rt), 1, 1))
    T[:, :3, :3] = Rt @ b.T[:, :3, :3]
    T[:, :3, 3] = (Rt @ apart[..., None])[..., 0]
    psi = np.empty_like(a.psi)
    psi[:, :3] = Rt @ (b.psi[:, :3] - a.psi[:, :3] + skew(apart) @ a.psi[:, 3:])
    psi[:, 3:] = Rt @ (b.psi[:, 3:] - a.psi[:, 3:])
    return Evaluation(T, psi)


def difference(a: Evaluation, b: Evaluation) -> tuple[Array, Array]:
    """Position of a less that of b, and the rotation vector that turns b to a.

    Parameters
    ----------
    a, b : Evaluation
        Of the same unknowns.

    Returns
    -------
    residual : ndarray, shape (N, 6)
        ``[p_a - p_b; log(R_a R_b^T)]``, m and rad.
    jacobian : ndarray, shape (N, 6, C)
        Its derivative.
    """
    u = rotation_errors(a.T[:, :3, :3], b.T[:, :3, :3])
    residual = np.hstack([a.T[:, :3, 3] - b.T[:, :3, 3], u])
    J = a.psi - b.psi
    # a turn of b is one behind the rotation vector: there the sign of the vector changes
    J[:, 3:] = inverse_left_jacobians(u) @ a.psi[:, 3:] - inverse_left_jacobians(-u) @ b.psi[:, 3:]
    return residual, J


def motionless(T: Array, columns: int) -> Evaluation:
    """Poses that are known.

    Parameters
    ----------
    T : ndarray, shape (N, 4, 4)
        Poses.
    columns : int
        Number of unknowns.

    Returns
    -------
    Evaluation
        With derivatives zero.
    """
    return Evaluation(T, np.zeros((len(T), 6, columns)))
