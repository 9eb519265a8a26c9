"""Differentials of the coordinates of an orientation with respect to the entries of the rotation.

What `angles_of`, `quaternions_of` and `rotation_vectors_of` compute, differentiated as it stands:
given the derivative of the rotation in some direction, the derivatives of the coordinates in it;
and the time derivatives of these along a motion, which is in another direction. A name that ends
in _j is a derivative in the first direction, in _t in that of the motion, in _jt the second
derivative.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...se3.orientation import linear_products_of, products_of
from ._angles import ANGLE_SEQUENCES, AngleSequence, inclination
from ._quaternions import quaternions_of_vectors
from ._vectors import inverse_left_factor, inverse_left_factor_slope
from .conversion import columns_of, in_order
from .kinds import OrientationKind


def orientation_differential(kind: OrientationKind, y: Array, R: Array, R_j: Array) -> Array:
    """Derivatives of the coordinates of an orientation.

    Shapes: y (N, 1, k), R (N, 1, 3, 3), R_j (N, n, 3, 3) -> (N, n, k).
    """
    if kind in ANGLE_SEQUENCES:
        return in_order(kind, _angles(ANGLE_SEQUENCES[kind], in_order(kind, y), R, R_j))
    if kind is OrientationKind.QUATERNION:
        return _quaternion(y, R, R_j)
    if kind is OrientationKind.ANGLE_AXIS:
        Q = quaternions_of_vectors(y)
        return _vector(y, Q, _quaternion(Q, R, R_j))
    return columns_of(R_j, kind)


def orientation_differential_rate(
    kind: OrientationKind, y: Array, R: Array, R_j: Array, R_t: Array, R_jt: Array
) -> Array:
    """Time derivatives of `orientation_differential` along a motion.

    Shapes: R_t (N, 1, 3, 3), R_jt (N, n, 3, 3) -> (N, n, k).
    """
    if kind in ANGLE_SEQUENCES:
        sequence = ANGLE_SEQUENCES[kind]
        return in_order(kind, _angles_rate(sequence, in_order(kind, y), R, R_j, R_t, R_jt))
    if kind is OrientationKind.QUATERNION:
        return _quaternion_rate(y, R, R_j, R_t, R_jt)
    if kind is OrientationKind.ANGLE_AXIS:
        Q = quaternions_of_vectors(y)
        return _vector_rate(
            y,
            Q,
            _quaternion(Q, R, R_j),
            _quaternion(Q, R, R_t),
            _quaternion_rate(Q, R, R_j, R_t, R_jt),
        )
    return columns_of(R_jt, kind)


def _signed_length(sequence: AngleSequence, y: Array, R: Array) -> Array:
    """Sine s of the inclination from the entries, with the sign of the solution that is meant."""
    s = np.hypot(R[..., 0, sequence.fixed], R[..., 1, sequence.fixed])
    return np.copysign(s, inclination(sequence, y[..., 1])[0])


def _outer(a: Array, b: Array) -> Array:
    """Vertical component of the vector product of vectors given by their first two."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _inner(a: Array, b: Array) -> Array:
    """Scalar product of the horizontal parts of vectors."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1]


def _angles(sequence: AngleSequence, y: Array, R: Array, R_j: Array) -> Array:
    g, g_j = R[..., sequence.fixed], R_j[..., sequence.fixed]
    s = _signed_length(sequence, y, R)
    s_j = _inner(g, g_j) / s
    # the third angle is atan2(sign u, v), with s times the sine and the cosine
    (u, u_j), (v, v_j) = (
        (_outer(g, R[..., k]), _outer(g_j, R[..., k]) + _outer(g, R_j[..., k]))
        for k in (sequence.sine, sequence.cosine)
    )
    phi_j = _outer(g, g_j) / s**2
    theta_j = g[..., 2] * s_j - s * g_j[..., 2]
    psi_j = sequence.sign * (v * u_j - u * v_j) / s**2
    return np.stack(np.broadcast_arrays(phi_j, theta_j, psi_j), axis=-1)


def _angles_rate(
    sequence: AngleSequence, y: Array, R: Array, R_j: Array, R_t: Array, R_jt: Array
) -> Array:
    g, g_j, g_t, g_jt = (X[..., sequence.fixed] for X in (R, R_j, R_t, R_jt))
    s = _signed_length(sequence, y, R)
    s_j, s_t = _inner(g, g_j) / s, _inner(g, g_t) / s
    s_jt = (_inner(g_t, g_j) + _inner(g, g_jt) - s_t * s_j) / s
    (u, u_j, u_t, u_jt), (v, v_j, v_t, v_jt) = (
        (
            _outer(g, R[..., k]),
            _outer(g_j, R[..., k]) + _outer(g, R_j[..., k]),
            _outer(g_t, R[..., k]) + _outer(g, R_t[..., k]),
            _outer(g_jt, R[..., k])
            + _outer(g_j, R_t[..., k])
            + _outer(g_t, R_j[..., k])
            + _outer(g, R_jt[..., k]),
        )
        for k in (sequence.sine, sequence.cosine)
    )
    phi_jt = (_outer(g_t, g_j) + _outer(g, g_jt) - 2.0 * _outer(g, g_j) * s_t / s) / s**2
    theta_jt = g_t[..., 2] * s_j + g[..., 2] * s_jt - s_t * g_j[..., 2] - s * g_jt[..., 2]
    psi_jt = v_t * u_j + v * u_jt - u_t * v_j - u * v_jt - 2.0 * (v * u_j - u * v_j) * s_t / s
    return np.stack(np.broadcast_arrays(phi_jt, theta_jt, sequence.sign * psi_jt / s**2), axis=-1)


def _pivot(R: Array, *derivatives: Array) -> tuple[NDArray[np.intp], list[Array]]:
    """The largest component's number k, and row k of ``4 Q Q^T`` for each derivative of R."""
    diagonal = np.diagonal(products_of(R), axis1=-2, axis2=-1)
    k = diagonal.argmax(axis=-1)[..., None]
    return k, [
        np.take_along_axis(linear_products_of(D), k[..., None], axis=-2)[..., 0, :]
        for D in derivatives
    ]


def _quaternion(Q: Array, R: Array, R_j: Array) -> Array:
    """Of ``Q = P[k] / (2 r)`` with ``r = sqrt(P[k, k]) = 2 Q[k]`` and P affine in the entries."""
    k, (P_j,) = _pivot(R, R_j)
    r = 2.0 * np.take_along_axis(Q, k, axis=-1)
    r_j = np.take_along_axis(P_j, k, axis=-1) / (2.0 * r)
    return (0.5 * P_j - Q * r_j) / r


def _quaternion_rate(Q: Array, R: Array, R_j: Array, R_t: Array, R_jt: Array) -> Array:
    k, (P_j, P_t, P_jt) = _pivot(R, R_j, R_t, R_jt)
    r = 2.0 * np.take_along_axis(Q, k, axis=-1)
    r_j, r_t = (np.take_along_axis(P, k, axis=-1) / (2.0 * r) for P in (P_j, P_t))
    r_jt = (0.5 * np.take_along_axis(P_jt, k, axis=-1) - r_j * r_t) / r
    Q_j, Q_t = (0.5 * P_j - Q * r_j) / r, (0.5 * P_t - Q * r_t) / r
    return (0.5 * P_jt - Q_t * r_j - Q * r_jt - Q_j * r_t) / r


def _stretch(vector: Array) -> tuple[Array, Array, Array]:
    """``f = angle / sin(angle / 2)``, gamma and its slope, as functions of the vector."""
    t = (vector**2).sum(axis=-1, keepdims=True)
    f = 2.0 / np.sinc(np.sqrt(t) / (2.0 * np.pi))
    return f, inverse_left_factor(t), inverse_left_factor_slope(t)


def _vector(vector: Array, Q: Array, Q_j: Array) -> Array:
    """Of ``v = f e`` with e the vector part of Q: there ``df = -2 gamma f^2 dQ1``."""
    f, gamma, _ = _stretch(vector)
    return f * Q_j[..., 1:] - 2.0 * gamma * f**2 * Q[..., 1:] * Q_j[..., :1]


def _vector_rate(vector: Array, Q: Array, Q_j: Array, Q_t: Array, Q_jt: Array) -> Array:
    f, gamma, slope = _stretch(vector)
    f_t = -2.0 * gamma * f**2 * Q_t[..., :1]
    gamma_t = -4.0 * slope * f * Q_t[..., :1]
    bend, bend_t = gamma * f**2, gamma_t * f**2 + 2.0 * gamma * f * f_t
    e, e_j, e_t, e_jt = (X[..., 1:] for X in (Q, Q_j, Q_t, Q_jt))
    return (
        f_t * e_j
        + f * e_jt
        - 2.0 * bend_t * e * Q_j[..., :1]
        - 2.0 * bend * (e_t * Q_j[..., :1] + e * Q_jt[..., :1])
    )
