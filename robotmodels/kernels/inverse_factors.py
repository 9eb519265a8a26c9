"""What becomes of each singular value in an inverse: kept, filtered or damped.

A method is four numbers: its kind, a threshold, the largest damping and the largest speed (infinite
where there is none). `robotmodels.kinematics.inverse.methods` names them.
"""

from math import sqrt

from ._compile import Floats, compiled

__all__ = ["inverse_factors"]

PSEUDO_INVERSE = 0
FILTERED = 1
CONSTANT = 2
WEAK_DIRECTIONS = 3
SMALLEST_SINGULAR_VALUE = 4
MANIPULABILITY = 5

_NEWTON_STEPS = 100


@compiled()
def inverse_factors(
    kind: int,
    threshold: float,
    largest: float,
    speed: float,
    sigma: Floats,
    inner: Floats,
    k: int,
    zero: float,
    factors: Floats,
) -> float:
    """Factors f by which ``y = sum f_i (u_i . b) v_i`` solves ``A y = b``; the largest damping.

    Within a bound of the speed |y| the error is least with one more damping mu of all directions,
    where |y(mu)| is the bound: 1 / |y| is concave in mu, so Newton's steps from 0 never overshoot.
    """
    value = 1.0
    if kind == MANIPULABILITY:
        for i in range(k):
            value *= sigma[i]
    elif kind == SMALLEST_SINGULAR_VALUE and k > 0:
        value = sigma[k - 1]
    mu, damping, length = 0.0, 0.0, 0.0
    for _ in range(_NEWTON_STEPS):
        total, slope, damping = 0.0, 0.0, 0.0
        for i in range(k):
            factors[i], bottom = 0.0, 1.0
            if kind == FILTERED and (sigma[i] < threshold or sigma[i] <= zero):
                ratio = min(sigma[i] / threshold, 1.0)
                factors[i] = ratio * (3.0 - 2.0 * ratio) / threshold
            elif sigma[i] > zero and kind <= FILTERED:
                if kind == FILTERED or sigma[i] > threshold * sigma[0]:
                    factors[i] = 1.0 / sigma[i]
            elif kind > FILTERED:
                if kind == WEAK_DIRECTIONS:
                    value = sigma[i]
                square = largest * largest
                if kind != CONSTANT:
                    part = max(1.0 - value / threshold, 0.0) if threshold > 0.0 else 0.0
                    square *= part * (part if kind == MANIPULABILITY else 2.0 - part)
                square += mu
                damping = max(damping, square)
                if sigma[i] > zero:
                    bottom = sigma[i] * sigma[i] + square
                    factors[i] = sigma[i] / bottom if square > 0.0 else 1.0 / sigma[i]
            part = (factors[i] * inner[i]) ** 2
            total += part
            slope += part / bottom
        length = sqrt(total)
        if length <= speed * (1.0 + 1e-13):
            break
        mu += (length / speed - 1.0) * total / slope
    if length > speed:
        # the rounding that remains, so that the bound holds
        for i in range(k):
            factors[i] *= speed / length * (1.0 - 4e-16)
    return sqrt(damping)
