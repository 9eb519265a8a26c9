"""Simulation under constant torques in compiled steps, with the coefficients of SciPy's DOP853.

The method has order 8, errors of orders 5 and 3, and dense output of order 7: E. Hairer, S. P.
Norsett and G. Wanner, "Solving Ordinary Differential Equations I", section II.5.

A state has k = n + m coordinates, their velocities, the work, and the integrals of the base's load
(6) and of the arm's first moment (3). Shapes of `follow`: free, damping (k, k), torques (1, k);
table (22, 16) of coefficients, as `table` gives it; times (N,), of samples, or only the last with a
sample after each step; bounds (4,): rtol, atol, evaluations, steps of this call; largest (s,); work
as `workspace` gives it; y (s,); slopes (16, s); clock (7,): time, next step, evaluations, samples
that are passed, code of `FlexibleMotionStatus`, codes 1 and 2 of `SpinStatus` once they occur ->
found (., 1 + s): time and state of samples.
"""

from math import sqrt
from typing import Any

import numpy as np

from ..kernels._compile import INT, INTS, MATRIX, OUT1, OUT2, VECTOR, Floats, Ints, compiled
from .kernels import ARM, WORK, accelerate
from .robot import Arm
from .work import Work, friction

NOT_CONVERGED, DIVERGED, BENT = 1.0, 2.0, 4.0
STAGES = 12
SAFETY, LEAST, MOST = 0.9, 0.2, 10.0  # of changes of the step
TINY = 1e-14  # least step, relative to the time


def table() -> Any:
    """Coefficients (22, 16): stages, end of the step, stages and rows of dense output, errors."""
    from scipy.integrate import DOP853

    rows = np.zeros((22, 16))
    rows[:12, :12], rows[12, :12], rows[13:16] = DOP853.A, DOP853.B, DOP853.A_EXTRA
    rows[16:20], rows[20, :13], rows[21, :13] = DOP853.D, DOP853.E5, DOP853.E3
    return rows


@compiled(counted=False)
def prepare_dense(
    y: Floats, z: Floats, h: float, rows: Floats, slopes: Floats, dense: Floats
) -> None:
    """Write the polynomial (7, s) of a step from y to z."""
    for c in range(len(y)):
        d = z[c] - y[c]
        dense[0, c], dense[1, c] = d, h * slopes[0, c] - d
        dense[2, c] = 2.0 * d - h * (slopes[12, c] + slopes[0, c])
        for i in range(4):
            dense[3 + i, c] = 0.0
            for r in range(16):
                dense[3 + i, c] += h * rows[16 + i, r] * slopes[r, c]


@compiled(counted=False)
def put_sample(found: Floats, i: int, t: float, y: Floats, dense: Floats, x: float) -> None:
    """Write the state at fraction x of a step from y."""
    found[i, 0] = t
    for c in range(len(y)):
        value = 0.0
        for k in range(6, -1, -1):
            value = (value + dense[k, c]) * (x if k % 2 == 0 else 1.0 - x)
        found[i, 1 + c] = y[c] + value


@compiled(counted=False)
def combination(y: Floats, h: float, rows: Floats, s: int, slopes: Floats, z: Floats) -> None:
    """Write the state of stage s."""
    for c in range(len(y)):
        moved = 0.0
        for r in range(s):
            moved += rows[s, r] * slopes[r, c]
        z[c] = y[c] + h * moved


@compiled(counted=False)
def put_slope(
    arm: Arm, damping: Floats, tau: Floats, v: Floats, a: Floats, base: Floats, slopes: Floats,
    s: int,
) -> None:  # fmt: skip
    """Write the derivative of a state of velocities v and accelerations a into row s."""
    k, n, power = damping.shape[0], arm.deflection.shape[0], 0.0
    for c in range(k):
        slopes[s, c], slopes[s, k + c] = v[0, c], a[0, c]
        if c < n:
            power += v[0, c] * (tau[0, c] - friction(arm, c, v[0, c]))
        for b in range(n, k):
            power -= v[0, c] * damping[c, b] * v[0, b]
    slopes[s, 2 * k] = power
    for c in range(9):
        slopes[s, 2 * k + 1 + c] = base[0, c]


@compiled(counted=False)
def step_error(
    y: Floats, z: Floats, h: float, rows: Floats, slopes: Floats, bounds: Floats
) -> float:
    """Error of a step from y to z beside what is allowed, by the estimates of orders 5 and 3."""
    third = fifth = 0.0
    for c in range(len(y)):
        scale = bounds[1] + bounds[0] * max(abs(y[c]), abs(z[c]))
        five = three = 0.0
        for s in range(STAGES + 1):
            five += rows[20, s] * slopes[s, c]
            three += rows[21, s] * slopes[s, c]
        fifth += (five / scale) ** 2
        third += (three / scale) ** 2
    if fifth == 0.0 and third == 0.0:
        return 0.0
    return h * fifth / sqrt((fifth + 0.01 * third) * len(y))


@compiled(
    INT(
        *(ARM, INTS, MATRIX, MATRIX, MATRIX, VECTOR, VECTOR, VECTOR, WORK),
        *(OUT1, OUT2, OUT1, OUT2),
    )
)
def follow(
    arm: Arm, free: Ints, damping: Floats, tau: Floats, rows: Floats, times: Floats,
    bounds: Floats, largest: Floats, work: Work, y: Floats, slopes: Floats, clock: Floats,
    found: Floats,
) -> int:  # fmt: skip
    """Steps until the last time, the bounds or a fault; the number of steps."""
    size, k, end, rejected, steps = len(y), damping.shape[0], times[-1], False, 0
    poses, base = np.zeros((1, arm.pi.shape[0] + 1, 3, 4)), np.zeros((1, 10))
    q, v, a, outer = np.zeros((1, k)), np.zeros((1, k)), np.zeros((1, k)), np.zeros((1, 18))
    x, z, dense = np.zeros(size), np.zeros(size), np.zeros((7, size))
    while clock[0] < end and steps < bounds[3] and clock[4] == 0.0:
        if clock[2] >= bounds[2]:
            clock[4] = NOT_CONVERGED
            break
        t, h = clock[0], min(clock[1], end - clock[0])
        now, s, last = end if h == end - t else t + h, 1 if clock[2] else 0, STAGES + 1
        while s < last:
            state = z if s <= STAGES else x  # z is the end of the step, x beyond it
            combination(y, h, rows, s, slopes, state)
            for c in range(k):
                q[0, c], v[0, c] = state[c], state[k + c]
            accelerate(arm, q, v, tau, outer, 0, free, a, base, poses, work)
            put_slope(arm, damping, tau, v, a, base, slopes, s)
            code = base[0, 9]
            if code > 0.0:
                clock[4 + int(code)] = code
            clock[2] += 1
            s += 1
            if s != STAGES + 1:
                continue
            error = step_error(y, z, h, rows, slopes, bounds)
            factor = MOST if error == 0.0 else max(LEAST, min(MOST, SAFETY * error**-0.125))
            if not error < 1.0:  # also where it is not a number
                clock[1], rejected = h * (factor if error >= 1.0 else LEAST), True
                if clock[1] < TINY * max(abs(t), 1.0):
                    clock[4] = DIVERGED
                continue
            clock[1], rejected = h * (min(factor, 1.0) if rejected else factor), False
            if code == 2.0:
                clock[4] = BENT
            for c in range(size):
                if abs(z[c]) > largest[c]:
                    clock[4] = DIVERGED
            if clock[4] == 0.0 and len(times) > 1 and times[int(clock[3])] <= now:
                last = 16  # samples within the step need more stages
        if rejected:
            continue
        if clock[4] != 0.0:
            break
        if last == 16:
            prepare_dense(y, z, h, rows, slopes, dense)
            while clock[3] < len(times) and times[int(clock[3])] <= now:
                i = int(clock[3])
                put_sample(found, i, times[i], y, dense, (times[i] - t) / h)
                clock[3] += 1
        for c in range(size):
            y[c], slopes[0, c] = z[c], slopes[STAGES, c]
            if len(times) == 1:
                found[steps, 0], found[steps, 1 + c] = now, z[c]
        clock[0], steps = now, steps + 1
    return steps
