"""Compiled: the error of a pose, its rate, Jacobian and drift, and a wrench in its coordinates.

The error e has the translation p_d - p and the rotation vector phi = log(R_d R^T), in world axes.
With E(phi) the left Jacobian of the rotation group, R_e = R_d R^T and w_e = w_d - R_e w:

    dphi = E^-1 w_e,    ddphi = E^-1 (dw_d - w_e x R_e w - R_e dw - dE dphi),

so that laws that are linear in e are exact for every rotation below a whole turn. A wrench f, m has
the power -(f . de + (E m) . dphi) on the tool if the desired pose is at rest.
"""

from __future__ import annotations

from math import cos, sin, sqrt, tan

import numpy as np

from ..igm.kernels.damped import rotation_vector
from ..kernels._compile import MATRIX, NOTHING, OUT2, VECTOR, Floats, compiled
from ..kernels._vectors import Vector, add, cross, dot, scale, subtract

SMALL = 1e-2  # squared angle below which series are used


@compiled()
def coefficients(tt: float) -> tuple[float, float, float, float, float]:
    """Of E = I + a [phi] + b [phi]^2 and E^-1 = I - [phi] / 2 + c [phi]^2, tt = phi . phi.

    Also the derivatives of a and b by tt / 2.
    """
    if tt < SMALL:
        return (
            0.5 - tt / 24.0 + tt * tt / 720.0 - tt**3 / 40320.0,
            1.0 / 6.0 - tt / 120.0 + tt * tt / 5040.0 - tt**3 / 362880.0,
            1.0 / 12.0 + tt / 720.0 + tt * tt / 30240.0 + tt**3 / 1209600.0,
            -1.0 / 12.0 + tt / 180.0 - tt * tt / 6720.0 + tt**3 / 453600.0,
            -1.0 / 60.0 + tt / 1260.0 - tt * tt / 60480.0 + tt**3 / 4989600.0,
        )
    angle = sqrt(tt)
    s, k = sin(angle), 1.0 - cos(angle)
    return (
        k / tt,
        (angle - s) / (angle * tt),
        (1.0 - 0.5 * angle / tan(0.5 * angle)) / tt,
        (angle * s - 2.0 * k) / (tt * tt),
        (3.0 * s - angle * (1.0 - k) - 2.0 * angle) / (angle * tt * tt),
    )


@compiled()
def combined(phi: Vector, x: Vector, first: float, second: float) -> Vector:
    """``x + first phi x x + second phi x (phi x x)``: E, E^-1 and R_e applied to a vector."""
    y = cross(phi, x)
    return add(x, add(scale(first, y), scale(second, cross(phi, y))))


@compiled(NOTHING(MATRIX, VECTOR, VECTOR, MATRIX, MATRIX, VECTOR, VECTOR, VECTOR, OUT2, OUT2, OUT2))
def pose_errors(
    desired: Floats,
    twist: Floats,
    acceleration: Floats,
    T: Floats,
    J: Floats,
    Jv: Floats,
    dJv: Floats,
    wrench: Floats,
    E: Floats,
    Je: Floats,
    out: Floats,
) -> None:
    """Error, its rate, its drift, and the wrench in its coordinates: rows of ``out (4, 6)``.

    The second derivative is ``drift + Je a``. Shapes: desired, T (4, 4), J, Je (6, n), E (3, 3).
    """
    for i in range(3):
        for j in range(3):
            E[i, j] = 0.0
            for k in range(3):
                E[i, j] += desired[i, k] * T[j, k]
    turned = np.empty(3)
    rotation_vector(E, turned)
    phi = (turned[0], turned[1], turned[2])
    a, b, c, da, db = coefficients(dot(phi, phi))
    # R_e = I + (sin t / t) [phi] + ((1 - cos t) / t^2) [phi]^2, and sin t / t = 1 - b t^2
    first = 1.0 - b * dot(phi, phi)
    w_r = combined(phi, (Jv[3], Jv[4], Jv[5]), first, a)
    w_e = subtract((twist[3], twist[4], twist[5]), w_r)
    rate = combined(phi, w_e, -0.5, c)
    y, along = cross(phi, rate), dot(phi, rate)
    change = add(
        add(scale(da * along, y), scale(b, cross(rate, y))), scale(db * along, cross(phi, y))
    )
    wanted = subtract((acceleration[3], acceleration[4], acceleration[5]), cross(w_e, w_r))
    turning = combined(phi, (dJv[3], dJv[4], dJv[5]), first, a)
    drift = combined(phi, subtract(subtract(wanted, change), turning), -0.5, c)
    moment = combined(phi, (wrench[3], wrench[4], wrench[5]), a, b)
    for i in range(3):
        out[0, i] = desired[i, 3] - T[i, 3]
        out[1, i] = twist[i] - Jv[i]
        out[2, i] = acceleration[i] - dJv[i]
        out[3, i] = wrench[i]
        out[0, 3 + i] = phi[i]
        out[1, 3 + i] = rate[i]
        out[2, 3 + i] = drift[i]
        out[3, 3 + i] = moment[i]
    for column in range(J.shape[1]):
        # E^-1 R_e is the inverse right Jacobian
        z = combined(phi, (J[3, column], J[4, column], J[5, column]), 0.5, c)
        for i in range(3):
            Je[i, column] = -J[i, column]
            Je[3 + i, column] = -z[i]
