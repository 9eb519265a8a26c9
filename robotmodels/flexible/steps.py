"""Simulation under constant torques in compiled steps, with the coefficients of SciPy's DOP853.

E. Hairer, S. P. Norsett and G. Wanner, "Solving Ordinary Differential Equations I", section II.5.
The recursion is called at its address: as an inner function it would be compiled once more.

A state has k = n + m coordinates, their velocities, the work, and the integrals of the base's load
(6) and of the arm's first moment (3). Shapes of `follow`: free and work as for `loads`, torques
(1, k), damping (k, k), rows (15, 13) of coefficients; times (N,) at which steps end; bounds (4,):
rtol, atol, evaluations, whether all steps are samples; largest (s,); y (s,); slopes (14, s), the
last the end of a step; clock (7,): time, next step, evaluations, times that are passed, code of
`FlexibleMotionStatus`, codes 1 and 2 of `SpinStatus` once they occur -> found (., 1 + s): time and
state of samples.
"""

from math import sqrt
from typing import Any

import numpy as np

from ..kernels._compile import INT, INTS, MATRIX, OUT1, OUT2, OUT4, VECTOR, Floats, Ints, compiled
from .kernels import ARM, WORK, recursion
from .robot import Arm
from .work import Work, friction

NOT_CONVERGED, DIVERGED, BENT = 1.0, 2.0, 4.0
STAGES = 12
SAFETY, LEAST, MOST = 0.9, 0.2, 10.0  # of changes of the step
TINY = 1e-14  # least step, relative to the time


def table() -> Any:
    """Coefficients (15, 13): stages, the end of the step, its errors of orders 5 and 3."""
    from scipy.integrate import DOP853

    rows = np.zeros((15, 13))
    rows[:12, :12], rows[12, :12], rows[13], rows[14] = DOP853.A, DOP853.B, DOP853.E5, DOP853.E3
    return rows


@compiled(
    INT(
        *(INT, ARM, INTS, MATRIX, MATRIX, MATRIX, VECTOR, VECTOR, VECTOR, WORK, OUT2, OUT4, OUT2),
        *(OUT1, OUT2, OUT1, OUT2),
    )
)
def follow(
    place: int, arm: Arm, free: Ints, damping: Floats, tau: Floats, rows: Floats, times: Floats,
    bounds: Floats, largest: Floats, work: Work, room: Floats, poses: Floats, base: Floats,
    y: Floats, slopes: Floats, clock: Floats, found: Floats,
) -> int:  # fmt: skip
    """Steps until the last time, the bounds or a fault; the number of samples.

    Scratch: room (4, k or 18), whose last row is zero, poses (1, f + 1, 3, 4), base (1, 10).
    """
    size, k, n, count, rejected = len(y), damping.shape[0], arm.deflection.shape[0], 0, False
    z, q, v, a = slopes[13], room[0:1], room[1:2], room[2:3]
    while clock[3] < len(times) and count < len(found) and clock[4] == 0.0:
        if clock[2] >= bounds[2]:
            clock[4] = NOT_CONVERGED
            break
        t, end = clock[0], times[int(clock[3])]
        h = min(clock[1], end - t)
        now, code = end if h == end - t else t + h, 0.0
        for s in range(1 if clock[2] else 0, STAGES + 1):
            for c in range(size):
                moved = 0.0
                for r in range(s):
                    moved += rows[s, r] * slopes[r, c]
                z[c] = y[c] + h * moved
            for c in range(k):
                q[0, c], v[0, c] = z[c], z[k + c]
            given = arm, q, v, tau, room[3:4], free, work, a, base, poses
            recursion(place, given)  # type: ignore[call-arg]
            power = 0.0
            for c in range(k):
                slopes[s, c], slopes[s, k + c] = v[0, c], a[0, c]
                if c < n:
                    power += v[0, c] * (tau[0, c] - friction(arm, c, v[0, c]))
                for b in range(n, k):
                    power -= v[0, c] * damping[c, b] * v[0, b]
            slopes[s, 2 * k] = power
            for c in range(9):
                slopes[s, 2 * k + 1 + c] = base[0, c]
            code = base[0, 9]
            if code > 0.0:
                clock[4 + int(code)] = code
            clock[2] += 1
        third = fifth = 0.0  # errors of the step beside what is allowed
        for c in range(size):
            scale = bounds[1] + bounds[0] * max(abs(y[c]), abs(z[c]))
            five = three = 0.0
            for s in range(STAGES + 1):
                five += rows[13, s] * slopes[s, c]
                three += rows[14, s] * slopes[s, c]
            fifth += (five / scale) ** 2
            third += (three / scale) ** 2
        error = h * fifth / sqrt((fifth + 0.01 * third) * size) if fifth + third > 0.0 else fifth
        factor = MOST if error == 0.0 else max(LEAST, min(MOST, SAFETY * error**-0.125))
        if not error < 1.0:  # also where it is not a number
            clock[1], rejected = h * (factor if error >= 1.0 else LEAST), True
            if clock[1] < TINY * max(abs(t), 1.0):
                clock[4] = DIVERGED
            continue
        if h == clock[1]:  # else it was shortened
            clock[1] = h * (min(factor, 1.0) if rejected else factor)
        rejected = False
        if code == 2.0:
            clock[4] = BENT
        for c in range(size):
            if abs(z[c]) > largest[c]:
                clock[4] = DIVERGED
        if clock[4] != 0.0:
            break
        clock[0] = now
        for c in range(size):
            y[c], slopes[0, c] = z[c], slopes[STAGES, c]
        if now == end:
            clock[3] += 1
        if now == end or bounds[3]:
            found[count, 0] = now
            for c in range(size):
                found[count, 1 + c] = y[c]
            count += 1
    return count
