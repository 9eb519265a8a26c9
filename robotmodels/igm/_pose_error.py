"""Compiled: what a posture misses of a pose, and how that changes with the joints.

The error of a posture has six components in the axes of the mask: the missing translation
``P_d - P`` and the missing rotation ``phi = log(R_d R^T)``. Turning the tool by ``w dt`` in world
axes gives ``R_d R^T exp(-[w] dt)``, hence ``d phi = -Jr^-1(phi) w dt`` with the inverse right
Jacobian of the rotation group (below). It is regular up to whole turns, so that the derivative is
exact for every mask, also half a turn away, where the sign of phi jumps but its size does not.
"""

from __future__ import annotations

from math import atan2, sqrt, tan

from ..kernels._compile import (
    Floats,
    Ints,
    compiled,
)
from ..kernels._motion import link_transform
from ..kernels._vectors import (
    Matrix,
    Vector,
    add,
    cross,
    dot,
    matrix,
    product,
    product_transpose,
    put_vector,
    scale,
    subtract,
    times,
    transpose_times,
    vector,
)

Goal = tuple[Matrix, Vector, Matrix]  # R_d, P_d, the axes of the mask
Arm = tuple[Ints, Ints, Floats, Floats, Matrix, Vector, Ints, Matrix, Vector]  # chain, path, tool


@compiled()
def rotation_vector(m: Matrix) -> Vector:
    """Logarithm of a rotation: axis times angle in [0, pi], through its quaternion (w, x, y, z).

    The largest component of the quaternion is taken from the diagonal, the others from it, so
    that no digit is lost at 0 or at pi (S. W. Shepperd, J. Guidance and Control 1(3), 1978).
    """
    trace = m[0] + m[4] + m[8]
    if trace >= m[0] and trace >= m[4] and trace >= m[8]:
        w, x, y, z = 1.0 + trace, m[7] - m[5], m[2] - m[6], m[3] - m[1]
    elif m[0] >= m[4] and m[0] >= m[8]:
        w, x, y, z = m[7] - m[5], 1.0 + 2.0 * m[0] - trace, m[1] + m[3], m[2] + m[6]
    elif m[4] >= m[8]:
        w, x, y, z = m[2] - m[6], m[1] + m[3], 1.0 + 2.0 * m[4] - trace, m[5] + m[7]
    else:
        w, x, y, z = m[3] - m[1], m[2] + m[6], m[5] + m[7], 1.0 + 2.0 * m[8] - trace
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    s = sqrt(x * x + y * y + z * z)
    if s == 0.0:
        return (0.0, 0.0, 0.0)
    return scale(2.0 * atan2(s, w) / s, (x, y, z))


@compiled()
def turned(phi: Vector, w: Vector) -> Vector:
    """``Jr^-1(phi) w = w + phi x w / 2 + c phi x (phi x w)``, the rate of -phi for a turn w.

    c = (1 - (t / 2) cot(t / 2)) / t^2 with the angle t = |phi|.
    """
    tt = dot(phi, phi)
    if tt < 1e-4:
        c = 1.0 / 12.0 + tt / 720.0
    else:
        half = 0.5 * sqrt(tt)
        c = (1.0 - half / tan(half)) / tt
    once = cross(phi, w)
    return add(w, add(scale(0.5, once), scale(c, cross(phi, once))))


@compiled()
def forward(q: Floats, arm: Arm, z: Floats, o: Floats) -> tuple[Matrix, Vector]:
    """Pose (R, p) of the tool at posture q; axes and origins of the path into z and o."""
    sigma, joint, rotation, position, R, p, path, E, e = arm
    for s in range(path.shape[0]):
        k = path[s] - 1
        qj = q[joint[k]] if joint[k] >= 0 else 0.0
        Rj, Pj = link_transform(sigma[k], qj, matrix(rotation, k), vector(position, k))
        p = add(p, times(R, Pj))
        R = product(R, Rj)
        put_vector(z, s, (R[2], R[5], R[8]))
        put_vector(o, s, p)
    return product(R, E), add(p, times(R, e))


@compiled()
def missing(R: Matrix, p: Vector, goal: Goal, e: Floats) -> Vector:
    """Six components of what is missing at the pose (R, p) into e; phi in world axes."""
    Rd, pd, axes = goal
    phi = rotation_vector(product_transpose(Rd, R))
    linear = transpose_times(axes, subtract(pd, p))
    angular = transpose_times(axes, phi)
    for c in range(3):
        e[c] = linear[c]
        e[c + 3] = angular[c]
    return phi


@compiled()
def error_jacobian(
    p: Vector, phi: Vector, goal: Goal, arm: Arm, z: Floats, o: Floats, J: Floats
) -> None:
    """Minus the derivative of the error, J (6, n), zero in the columns off the path."""
    sigma, joint, _, _, _, _, path, _, _ = arm
    _, _, axes = goal
    for s in range(path.shape[0]):
        k = path[s] - 1
        if sigma[k] == 2:
            continue
        axis = vector(z, s)
        if sigma[k] == 0:
            linear = cross(axis, subtract(p, vector(o, s)))
            angular = transpose_times(axes, turned(phi, axis))
        else:
            linear, angular = axis, (0.0, 0.0, 0.0)
        linear = transpose_times(axes, linear)
        for c in range(3):
            J[c, joint[k]] = linear[c]
            J[c + 3, joint[k]] = angular[c]


@compiled()
def cost_of(e: Floats, weight: Floats) -> float:
    """Squared weighted error."""
    total = 0.0
    for c in range(6):
        total += (weight[c] * e[c]) ** 2
    return total


@compiled()
def sizes(e: Floats, mask: Ints) -> tuple[float, float]:
    """Size of the asked-for translation and of the asked-for rotation of an error."""
    return (
        sqrt((mask[0] * e[0]) ** 2 + (mask[1] * e[1]) ** 2 + (mask[2] * e[2]) ** 2),
        sqrt((mask[3] * e[3]) ** 2 + (mask[4] * e[4]) ** 2 + (mask[5] * e[5]) ** 2),
    )


@compiled()
def is_met(size: tuple[float, float], tolerance: Floats) -> bool:
    """Whether both sizes are within their tolerances."""
    return size[0] <= tolerance[0] and size[1] <= tolerance[1]
