"""The ten inertial parameters of one link as tuples: XX XY XZ YY YZ ZZ | MX MY MZ | M.

All of it is linear in the ten and nothing divides by the mass, so it serves base parameters
(M = 0 with first moments) as well.
"""

from ._compile import Floats, compiled
from ._vectors import Matrix, Vector, add, product, product_transpose, scale, times

Moments = tuple[float, float, float, float, float, float]


@compiled()
def inertia_of(pi: Floats, i: int) -> tuple[Moments, Vector, float]:
    """Second moments (6), first moments (3) and mass of link i of ``pi (f, 10)``."""
    return (
        (pi[i, 0], pi[i, 1], pi[i, 2], pi[i, 3], pi[i, 4], pi[i, 5]),
        (pi[i, 6], pi[i, 7], pi[i, 8]),
        pi[i, 9],
    )


@compiled()
def inertia_times(J: Moments, a: Vector) -> Vector:
    """Symmetric inertia matrix, given by its six entries, times a vector."""
    return (
        J[0] * a[0] + J[1] * a[1] + J[2] * a[2],
        J[1] * a[0] + J[3] * a[1] + J[4] * a[2],
        J[2] * a[0] + J[4] * a[1] + J[5] * a[2],
    )


@compiled()
def join_antecedent(
    composite: Floats, i: int, R: Matrix, P: Vector, J: Moments, MS: Vector, M: float
) -> None:
    """Add a body given in a frame with pose (R, P) in link i to row i of ``composite (f, 10)``.

    J_a = R J R^T + 2 (P.h) 1 - P h^T - h P^T + M (P.P 1 - P P^T) and
    MS_a = h + M P, with h = R MS.
    """
    h = times(R, MS)
    K = product_transpose(product(R, (J[0], J[1], J[2], J[1], J[3], J[4], J[2], J[4], J[5])), R)
    # With s = h + M P / 2 the shift is 2 (P.s) 1 - P s^T - s P^T
    s = add(h, scale(0.5 * M, P))
    xx, yy, zz = 2.0 * P[0] * s[0], 2.0 * P[1] * s[1], 2.0 * P[2] * s[2]
    composite[i, 0] += K[0] + (yy + zz)
    composite[i, 1] += K[1] - (P[0] * s[1] + s[0] * P[1])
    composite[i, 2] += K[2] - (P[0] * s[2] + s[0] * P[2])
    composite[i, 3] += K[4] + (xx + zz)
    composite[i, 4] += K[5] - (P[1] * s[2] + s[1] * P[2])
    composite[i, 5] += K[8] + (xx + yy)
    composite[i, 6] += h[0] + M * P[0]
    composite[i, 7] += h[1] + M * P[1]
    composite[i, 8] += h[2] + M * P[2]
    composite[i, 9] += M
