"""Accelerations of a frame carried by the last frame of a path, in world axes.

Seed book section 1.3.1 differentiated once more: the recursion of velocities and accelerations
from the base to the frame, which needs no Jacobian. With zero joint accelerations it gives
``dJ/dt v``.
"""

from ._compile import CHAIN, INT, INTS, MATRIX, NOTHING, OUT2, VECTOR, Floats, Ints, compiled
from ._motion import coordinate, link_transform
from ._vectors import (
    add,
    cross,
    matrix,
    product,
    scale,
    subtract,
    times,
    transpose_times,
    vector,
    whole_matrix,
    whole_vector,
)

__all__ = ["accelerations"]


@compiled(NOTHING(MATRIX, MATRIX, MATRIX, *CHAIN, INTS, MATRIX, VECTOR, INT, OUT2))
def accelerations(
    q: Floats,
    v: Floats,
    a: Floats,
    antecedent: Ints,
    sigma: Ints,
    joint: Ints,
    rotation: Floats,
    position: Floats,
    base_rotation: Floats,
    base_position: Floats,
    path: Ints,
    tool_rotation: Floats,
    tool_position: Floats,
    reference: int,
    out: Floats,
) -> None:
    """Time derivatives of the twists of a tool, ``J a + dJ/dt v``.

    Shapes: q, v, a (N, n) -> out (N, 6).
    """
    base = whole_matrix(base_rotation)
    origin = whole_vector(base_position)
    E = whole_matrix(tool_rotation)
    e = whole_vector(tool_position)
    zero = (0.0, 0.0, 0.0)
    for i in range(q.shape[0]):
        R, p = base, origin
        w, dw, u, du = zero, zero, zero, zero
        for s in range(path.shape[0] + 1):
            if s == path.shape[0]:
                # the tool does not move in the last frame
                arm = times(R, e)
                du = add(du, add(cross(dw, arm), cross(w, cross(w, arm))))
                u = add(u, cross(w, arm))
                p = add(p, arm)
                R = product(R, E)
                break
            k = path[s] - 1
            qj = coordinate(q, i, joint[k])
            Rj, Pj = link_transform(sigma[k], qj, matrix(rotation, k), vector(position, k))
            arm = times(R, Pj)
            du = add(du, add(cross(dw, arm), cross(w, cross(w, arm))))
            u = add(u, cross(w, arm))
            p = add(p, arm)
            R = product(R, Rj)
            zj = (R[2], R[5], R[8])
            motion = scale(coordinate(v, i, joint[k]), zj)
            change = scale(coordinate(a, i, joint[k]), zj)
            if sigma[k] == 0:
                dw = add(dw, add(change, cross(w, motion)))
                w = add(w, motion)
            else:
                du = add(du, add(change, scale(2.0, cross(w, motion))))
                u = add(u, motion)
        if reference == 1:
            du = transpose_times(R, subtract(du, cross(w, u)))
            dw = transpose_times(R, dw)
        elif reference == 2:
            du = subtract(du, add(cross(dw, p), cross(w, u)))
        for row in range(3):
            out[i, row] = du[row]
            out[i, row + 3] = dw[row]
