"""Parameter homotopy for the assembly modes of six legs between two rigid bodies.

Soma coordinates (e, g) of the platform, C. Wampler 1996: e is a quaternion, R(e) the rotation, and
``2 g e* / e.e`` the position, with ``e.g = 0``. With the anchors of the first leg as origins, the
legs are quadrics ``4 g.g = l^2 e.e`` and, for the five others, after the first is subtracted,

    e^T A e + g^T B e = 0,    A = c 1 + 2 [a]_L [b]_R,    B = 4 ([b]_R - [a]_L),

with c = a.a + b.b + l_1^2 - l^2 and the matrices of quaternion products ``a e`` and ``e b``. The
family of all symmetric A and antisymmetric B has 40 solutions with e not zero. The 40 of one
member are stored; those of another follow from continuation along the straight segment between
the coefficients. A path is tracked in the chart in which its largest component of e is constant,
with cubic Hermite prediction and Newton correction.

Coefficients of a member, ``m (81,)``: l^2, then for each leg ten of A and six of B.

The stored member (``start.npz``) has normal complex coefficients, of which the first entries of A
were solved for one random point with e.g = 0. Its other solutions were found by monodromy: all that
were known were tracked around triangles of random members until there were 40.
"""

from math import cos, sin, sqrt

import numpy as np

from ..kernels._compile import MATRIX, NOTHING, OUT2, OUT3, VECTOR, Floats, compiled

PATHS = 40
PARAMETERS = 81
ARRIVED, LOST, INFINITE = 0, 1, 2  # ends of paths
_STEPS = 2000
_SHORTEST = 1e-11
_AT_INFINITY = 1e-5  # |e.e| beside |e|^2 at the end of a path that gets stuck


@compiled()
def value_and_jacobian(x: Floats, m: Floats, F: Floats, J: Floats) -> None:
    """Equations of a member and their derivative. Shapes: x (8,), m (81,) -> F (7,), J (7, 8)."""
    e0, e1, e2, e3, g0, g1, g2, g3 = x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7]
    s = m[0]
    F[0] = 4.0 * (g0 * g0 + g1 * g1 + g2 * g2 + g3 * g3)
    F[0] -= s * (e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3)
    F[1] = e0 * g0 + e1 * g1 + e2 * g2 + e3 * g3
    for k in range(4):
        J[0, k] = -2.0 * s * x[k]
        J[0, 4 + k] = 8.0 * x[4 + k]
        J[1, k] = x[4 + k]
        J[1, 4 + k] = x[k]
    for i in range(2, 7):
        k = 16 * i - 31
        h0 = m[k] * e0 + m[k + 1] * e1 + m[k + 2] * e2 + m[k + 3] * e3
        h1 = m[k + 1] * e0 + m[k + 4] * e1 + m[k + 5] * e2 + m[k + 6] * e3
        h2 = m[k + 2] * e0 + m[k + 5] * e1 + m[k + 7] * e2 + m[k + 8] * e3
        h3 = m[k + 3] * e0 + m[k + 6] * e1 + m[k + 8] * e2 + m[k + 9] * e3
        p, q, r = m[k + 10], m[k + 11], m[k + 12]
        u, v, w = m[k + 13], m[k + 14], m[k + 15]
        b0 = p * e1 + q * e2 + r * e3
        b1 = u * e2 + v * e3 - p * e0
        b2 = w * e3 - q * e0 - u * e1
        b3 = -r * e0 - v * e1 - w * e2
        F[i] = e0 * h0 + e1 * h1 + e2 * h2 + e3 * h3 + g0 * b0 + g1 * b1 + g2 * b2 + g3 * b3
        J[i, 0] = 2.0 * h0 - p * g1 - q * g2 - r * g3
        J[i, 1] = 2.0 * h1 + p * g0 - u * g2 - v * g3
        J[i, 2] = 2.0 * h2 + q * g0 + u * g1 - w * g3
        J[i, 3] = 2.0 * h3 + r * g0 + v * g1 + w * g2
        J[i, 4] = b0
        J[i, 5] = b1
        J[i, 6] = b2
        J[i, 7] = b3


@compiled()
def values(x: Floats, m: Floats, F: Floats) -> None:
    """Derivative of the equations along the segment; m (81,) are differences of coefficients."""
    e0, e1, e2, e3, g0, g1, g2, g3 = x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7]
    F[0] = -m[0] * (e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3)
    F[1] = 0.0
    for i in range(2, 7):
        k = 16 * i - 31
        total = e0 * (m[k] * e0 + 2.0 * (m[k + 1] * e1 + m[k + 2] * e2 + m[k + 3] * e3))
        total += e1 * (m[k + 4] * e1 + 2.0 * (m[k + 5] * e2 + m[k + 6] * e3))
        total += e2 * (m[k + 7] * e2 + 2.0 * m[k + 8] * e3) + m[k + 9] * e3 * e3
        total += m[k + 10] * (g0 * e1 - g1 * e0) + m[k + 11] * (g0 * e2 - g2 * e0)
        total += m[k + 12] * (g0 * e3 - g3 * e0) + m[k + 13] * (g1 * e2 - g2 * e1)
        total += m[k + 14] * (g1 * e3 - g3 * e1) + m[k + 15] * (g2 * e3 - g3 * e2)
        F[i] = total


@compiled()
def size2(z: complex) -> float:
    """Square of the absolute value."""
    return z.real * z.real + z.imag * z.imag


@compiled()
def solve(J: Floats, c: int, F: Floats, G: Floats) -> bool:
    """Solve J y = F and J y = G in place, column c of J left out; False where J is singular.

    Shapes: J (7, 8), overwritten, F, G (7,). Column c is replaced by the last one.
    """
    for i in range(7):
        J[i, c] = J[i, 7]
    for k in range(7):
        best, pivot = k, size2(J[k, k])
        for i in range(k + 1, 7):
            if size2(J[i, k]) > pivot:
                best, pivot = i, size2(J[i, k])
        if pivot == 0.0:
            return False
        if best != k:
            for j in range(k, 7):
                J[k, j], J[best, j] = J[best, j], J[k, j]
            F[k], F[best] = F[best], F[k]
            G[k], G[best] = G[best], G[k]
        inverse = 1.0 / J[k, k]
        for i in range(k + 1, 7):
            factor = J[i, k] * inverse
            for j in range(k + 1, 7):
                J[i, j] -= factor * J[k, j]
            F[i] -= factor * F[k]
            G[i] -= factor * G[k]
        J[k, k] = inverse
    for k in range(6, -1, -1):
        for j in range(k + 1, 7):
            F[k] -= J[k, j] * F[j]
            G[k] -= J[k, j] * G[j]
        F[k] *= J[k, k]
        G[k] *= J[k, k]
    return True


@compiled()
def newton_step(
    x: Floats, c: int, m: Floats, change: Floats, F: Floats, G: Floats, J: Floats
) -> bool:
    """Error F and slope -G of x along the path with its component c constant. Shapes: (8,)."""
    value_and_jacobian(x, m, F, J)
    values(x, change, G)
    regular = solve(J, c, F, G)
    F[7], G[7] = F[c], G[c]
    F[c] = G[c] = 0.0
    return regular


@compiled()
def chart_of(x: Floats) -> int:
    """Largest component of e."""
    best = 0
    for k in range(1, 4):
        if size2(x[k]) > size2(x[best]):
            best = k
    return best


@compiled()
def track(
    x: Floats, start: Floats, change: Floats, accuracy: float, work: Floats, J: Floats
) -> int:
    """Follow one path from t = 0 to 1: why it ends.

    Shapes: x (8,) overwritten, start, change (81,), work (>= 8, 81), J (7, 8).
    """
    m, F, G = work[0], work[1], work[2]
    y, slope, past, past_slope = work[3], work[4], work[5], work[6]
    t, h, last, c = 0.0, 0.01, 0.0, -1
    for _ in range(_STEPS):
        best = chart_of(x)
        if c < 0 or size2(x[c]) < 0.25 * size2(x[best]):
            c, last = best, 0.0
            scale = 1.0 / x[c]
            for k in range(8):
                x[k] *= scale
            for k in range(PARAMETERS):
                m[k] = start[k] + t * change[k]
            newton_step(x, c, m, change, F, G, J)
            for k in range(8):
                slope[k] = -G[k]
        h = min(h, 1.0 - t)
        # cubic prediction from the last two points, else along the slope
        if last > 0.0:
            r = h / last
            a, p, q = r * r * (2.0 * r + 3.0), r * r * (r + 1.0), r * (r + 1.0) * (r + 1.0)
            for k in range(8):
                y[k] = x[k] + a * (past[k] - x[k]) + last * (p * past_slope[k] + q * slope[k])
        else:
            for k in range(8):
                y[k] = x[k] + h * slope[k]
        y[c] = x[c]
        after = t + h if h < 1.0 - t else 1.0
        for k in range(PARAMETERS):
            m[k] = start[k] + after * change[k]
        good, first = False, 0.0
        for correction in range(3):
            if not newton_step(y, c, m, change, F, G, J):
                break
            total, norm = 0.0, 0.0
            for k in range(8):
                total += size2(F[k])
                y[k] -= F[k]
                norm += size2(y[k])
            error = sqrt(total / norm)
            if correction == 0:
                first = error
                if error > accuracy:
                    break
            elif error > 0.3 * first and error > 1e-9:
                break
            if correction > 0 and error < 1e-6:
                good = True
                break
        if good:
            for k in range(8):
                past[k], past_slope[k] = x[k], slope[k]
                x[k], slope[k] = y[k], -G[k]
            last, t = h, after
            if t >= 1.0:
                return ARRIVED
            h *= min(3.0, max(0.5, (0.1 * accuracy / max(first, 1e-12)) ** 0.25))
            continue
        h *= 0.5
        if h < _SHORTEST or first != first:
            ee = x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3]
            scale2 = size2(x[0]) + size2(x[1]) + size2(x[2]) + size2(x[3])
            return INFINITE if sqrt(size2(ee)) < _AT_INFINITY * scale2 else LOST
    return LOST


@compiled(NOTHING(MATRIX, VECTOR, MATRIX, VECTOR, VECTOR, OUT3, OUT2))
def paths(
    members: Floats,
    start: Floats,
    first: Floats,
    turns: Floats,
    options: Floats,
    ends: Floats,
    codes: Floats,
) -> None:
    """Ends of the 40 paths to each member, those with e.e = 0 among them.

    Shapes: members (N, 81), stored start (162,) and first (40, 16), complex; phases turns (7,),
    largest prediction error options (1,) -> ends (N, 40, 16), complex, codes (N, 40).
    """
    work, J = np.zeros((11, PARAMETERS), np.complex128), np.zeros((7, 8), np.complex128)
    F, G, begin, change, target, x = work[1], work[2], work[7], work[8], work[9], work[10]
    for s in range(members.shape[0]):
        for k in range(PARAMETERS):
            turn = turns[(k + 15) // 16]
            begin[k] = complex(start[2 * k], start[2 * k + 1]) * complex(cos(turn), sin(turn))
            target[k] = members[s, k]
            change[k] = target[k] - begin[k]
        for i in range(PATHS):
            for k in range(8):
                x[k] = complex(first[i, 2 * k], first[i, 2 * k + 1])
            codes[s, i] = track(x, begin, change, options[0], work, J)
            for _ in range(3 if codes[s, i] == ARRIVED else 0):
                newton_step(x, chart_of(x), target, change, F, G, J)
                for k in range(8):
                    x[k] -= F[k]
            for k in range(8):
                ends[s, i, 2 * k], ends[s, i, 2 * k + 1] = x[k].real, x[k].imag
