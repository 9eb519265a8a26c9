"""Derivatives of torque regressors, contracted: of the number sum(G * W(q, v, a)).

Reverse differentiation, written out. Row r of G is a set of parameters of its own, so the number is
the sum over joints r and links k outboard of t . f + z . n, with (t, z) the unit motion of joint r
at link k and (f, n) the wrench that accelerates the link. Motions come down the tree by one rule a
link; their adjoints go up by its transpose. The rotations need none: d(R^T x)/dq = -z x (R^T x).
"""

import numpy as np

from . import Chain
from ._compile import CHAIN, INTS, MATRIX, NOTHING, OUT2, STACK, VECTOR, Floats, Ints, compiled
from ._motion import base_acceleration, carry_acceleration, coordinate, link_pose
from ._vectors import (
    Matrix,
    Vector,
    add,
    cross,
    dot,
    matrix,
    put_matrix,
    put_vector,
    scale,
    times,
    transpose_times,
    vector,
)

__all__ = ["regressor_gradients"]


@compiled()
def spun(y: Vector, adjoint: Vector) -> float:
    """Derivative of ``adjoint . y`` by the angle of the frame that y is seen from."""
    return adjoint[0] * y[1] - adjoint[1] * y[0]


@compiled()
def triple(a: Vector, w: Vector, b: Vector) -> Vector:
    """Derivative of ``a . (w x (w x b))`` by w."""
    wb, aw, ab = dot(w, b), dot(a, w), dot(a, b)
    return (
        a[0] * wb + b[0] * aw - 2.0 * w[0] * ab,
        a[1] * wb + b[1] * aw - 2.0 * w[1] * ab,
        a[2] * wb + b[2] * aw - 2.0 * w[2] * ab,
    )


@compiled()
def add_vector(array: Floats, i: int, a: Vector) -> None:
    """Add vector a to row i of ``array (m, 3)``."""
    array[i, 0] += a[0]
    array[i, 1] += a[1]
    array[i, 2] += a[2]


@compiled()
def unit_motions(down: Floats, turn: Floats, k: int, chain: Chain, R: Matrix, P: Vector) -> None:
    """Unit motions at link k, in its axes, of its own joint and of all joints inboard.

    ``down (f, f, 3)`` and ``turn (f, f, 3)``: linear and angular, by link and joint.
    """
    b = chain.antecedent[k] - 1
    inner = b
    while inner >= 0:
        z = vector(turn[b], inner)
        put_vector(turn[k], inner, transpose_times(R, z))
        put_vector(down[k], inner, transpose_times(R, add(vector(down[b], inner), cross(z, P))))
        inner = chain.antecedent[inner] - 1
    put_vector(turn[k], k, (0.0, 0.0, 1.0 if chain.sigma[k] == 0 else 0.0))
    put_vector(down[k], k, (0.0, 0.0, 1.0 if chain.sigma[k] == 1 else 0.0))


@compiled(NOTHING(MATRIX, MATRIX, MATRIX, CHAIN, VECTOR, INTS, STACK, OUT2, OUT2, OUT2))
def regressor_gradients(
    q: Floats,
    v: Floats,
    a: Floats,
    chain: Chain,
    gravity: Floats,
    place: Ints,
    weight: Floats,
    of_q: Floats,
    of_v: Floats,
    of_a: Floats,
) -> None:
    """Derivatives of ``sum(weight[i] * W[i])`` by the motion of each sample i.

    Shapes: q, v, a, of_q, of_v, of_a (N, n); gravity (3,); place (10 f,); weight (N, n, c).
    """
    f = chain.antecedent.shape[0]
    Rs = np.empty((f, 3, 3))
    Ps = np.empty((f, 3))
    w = np.zeros((f + 1, 3))
    dw = np.zeros((f + 1, 3))
    U = np.zeros((f + 1, 3, 3))
    u = np.empty((f + 1, 3))
    down = np.empty((f, f, 3))
    turn = np.empty((f, f, 3))
    # adjoints of the last five
    w_ = np.empty((f + 1, 3))
    dw_ = np.empty((f + 1, 3))
    u_ = np.empty((f + 1, 3))
    down_ = np.empty((f, f, 3))
    turn_ = np.empty((f, f, 3))
    g = np.empty(10)
    base_acceleration(chain, gravity, u)
    for i in range(q.shape[0]):
        for k in range(f):
            R, P = link_pose(chain, k, q, i)
            carry_acceleration(chain, k, v, a, i, R, P, w, dw, U, u)
            put_matrix(Rs, k, R)
            put_vector(Ps, k, P)
            unit_motions(down, turn, k, chain, R, P)
        w_[:] = 0.0
        dw_[:] = 0.0
        u_[:] = 0.0
        down_[:] = 0.0
        turn_[:] = 0.0
        for k in range(f - 1, -1, -1):
            wk, dwk, uk = vector(w, k + 1), vector(dw, k + 1), vector(u, k + 1)
            # the link's own wrench on the motion of each joint inboard, and its own joint
            inner = k
            while inner >= 0:
                if chain.sigma[inner] != 2:
                    row = chain.joint[inner]
                    seen = False
                    for s in range(10):
                        at = place[10 * k + s]
                        g[s] = weight[i, row, at] if at >= 0 else 0.0
                        seen |= g[s] != 0.0
                    if seen:
                        J = (g[0], g[1], g[2], g[1], g[3], g[4], g[2], g[4], g[5])
                        m = (g[6], g[7], g[8])
                        t, z = vector(down[k], inner), vector(turn[k], inner)
                        Jw = times(J, wk)
                        force = add(scale(g[9], uk), times(matrix(U, k + 1), m))
                        moment = add(add(times(J, dwk), cross(wk, Jw)), cross(m, uk))
                        add_vector(down_[k], inner, force)
                        add_vector(turn_[k], inner, moment)
                        add_vector(u_, k + 1, add(scale(g[9], t), cross(z, m)))
                        add_vector(dw_, k + 1, add(cross(m, t), times(J, z)))
                        add_vector(w_, k + 1, triple(t, wk, m))
                        add_vector(w_, k + 1, add(cross(Jw, z), times(J, cross(z, wk))))
                inner = chain.antecedent[inner] - 1
            # the rule from the antecedent to the link, transposed
            b, c = chain.antecedent[k], chain.joint[k]
            R, P = matrix(Rs, k), vector(Ps, k)
            dq = coordinate(v, i, c)
            wk_, dwk_, uk_ = vector(w_, k + 1), vector(dw_, k + 1), vector(u_, k + 1)
            up = times(R, uk_)
            by_q = 0.0
            if chain.sigma[k] == 0:
                of_a[i, c] += dwk_[2]
                of_v[i, c] += wk_[2] + spun(wk, dwk_)
                wk_ = (wk_[0] - dwk_[1] * dq, wk_[1] + dwk_[0] * dq, wk_[2])
                before = (dwk[0] - wk[1] * dq, dwk[1] + wk[0] * dq, 0.0)
                by_q = spun(wk, wk_) + spun(before, dwk_) + spun(uk, uk_)
            elif chain.sigma[k] == 1:
                of_a[i, c] += uk_[2]
                of_v[i, c] += 2.0 * spun(wk, uk_)
                wk_ = (wk_[0] - 2.0 * uk_[1] * dq, wk_[1] + 2.0 * uk_[0] * dq, wk_[2])
                by_q = dot(up, times(matrix(U, b), (R[2], R[5], R[8])))
            add_vector(u_, b, up)
            add_vector(dw_, b, add(times(R, dwk_), cross(P, up)))
            add_vector(w_, b, add(times(R, wk_), triple(up, vector(w, b), P)))
            inner = b - 1
            while inner >= 0:
                if chain.sigma[inner] != 2:
                    t_, z_ = vector(down_[k], inner), vector(turn_[k], inner)
                    z = vector(turn[k], inner)
                    if chain.sigma[k] == 0:
                        by_q += spun(vector(down[k], inner), t_) + spun(z, z_)
                    elif chain.sigma[k] == 1:
                        by_q += spun(z, t_)
                    up = times(R, t_)
                    add_vector(down_[b - 1], inner, up)
                    add_vector(turn_[b - 1], inner, add(times(R, z_), cross(P, up)))
                inner = chain.antecedent[inner] - 1
            if c >= 0:
                of_q[i, c] += by_q
