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
def squared_damping(
    kind: int, threshold: float, largest: float, sigma: float, smallest: float, volume: float
) -> float:
    """Square of the damping of a direction whose singular value is sigma."""
    if kind == CONSTANT:
        return largest * largest
    if kind == MANIPULABILITY:
        below = 1.0 - volume / threshold if volume < threshold else 0.0
        return largest * largest * below * below
    value = sigma if kind == WEAK_DIRECTIONS else smallest
    if value >= threshold:
        return 0.0
    ratio = value / threshold
    return largest * largest * (1.0 - ratio * ratio)


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
    """Factors f by which ``y = sum f_i (u_i . b) v_i`` solves ``A y = b``."""
    if k == 0:
        return 0.0
    first, last = sigma[0], sigma[k - 1]
    if kind == PSEUDO_INVERSE:
        for i in range(k):
            factors[i] = 1.0 / sigma[i] if sigma[i] > max(threshold * first, zero) else 0.0
        return 0.0
    if kind == FILTERED:
        for i in range(k):
            if sigma[i] >= threshold and sigma[i] > zero:
                factors[i] = 1.0 / sigma[i]
            else:
                ratio = min(sigma[i] / threshold, 1.0)
                factors[i] = ratio * (3.0 - 2.0 * ratio) / threshold
        return 0.0
    volume = 1.0
    if kind == MANIPULABILITY:
        for i in range(k):
            volume *= sigma[i]
    damping, total = 0.0, 0.0
    for i in range(k):
        square = squared_damping(kind, threshold, largest, sigma[i], last, volume)
        damping = max(damping, square)
        if sigma[i] <= zero:
            factors[i] = 0.0
        elif square == 0.0:
            factors[i] = 1.0 / sigma[i]
        else:
            factors[i] = sigma[i] / (sigma[i] * sigma[i] + square)
        total += (factors[i] * inner[i]) ** 2
    if not total > speed * speed:
        return sqrt(damping)
    # Least error among all speeds within the bound: one more damping mu for all directions, where
    # |y(mu)| = speed. 1 / |y| is concave in mu, so Newton's steps from 0 never overshoot.
    mu = 0.0
    for _ in range(_NEWTON_STEPS):
        total, slope = 0.0, 0.0
        for i in range(k):
            square = squared_damping(kind, threshold, largest, sigma[i], last, volume) + mu
            if sigma[i] <= zero:
                continue
            bottom = sigma[i] * sigma[i] + square
            factors[i] = sigma[i] / bottom
            part = (factors[i] * inner[i]) ** 2
            total += part
            slope += part / bottom
        length = sqrt(total)
        if length <= speed * (1.0 + 1e-13):
            break
        mu += (length / speed - 1.0) * total / slope
    if length > speed:
        # what is left of rounding, so that the bound holds
        for i in range(k):
            factors[i] *= speed / length * (1.0 - 4e-16)
    return sqrt(damping + mu)
