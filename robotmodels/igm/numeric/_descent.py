"""Compiled: Levenberg-Marquardt on the pose error from one start.

Steps are ``(J^T W^2 J + lambda D) dq = J^T W^2 e`` with lambda in proportion to the squared error
(T. Sugihara, IEEE T-RO 27(5), 2011; to the error itself where that is large, as it bends the cost
by its size), raised where a step does not pay. Metres are divided by the length of the arm inside
the iteration only; whether a pose is met is asked in metres and radians.
"""

from __future__ import annotations

from math import inf, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from ...kernels._compile import (
    Floats,
    Ints,
    compiled,
)
from ...kernels._vectors import (
    Vector,
)
from ._pose_error import Arm, Goal, cost_of, error_jacobian, forward, is_met, missing, sizes

Flags = NDArray[np.bool_]
Bounds = tuple[Floats, Floats]
# posture, trial, error, Jacobian, J^T W^2 J, gradient, step, held joints, axes, origins
Work = tuple[Floats, Floats, Floats, Floats, Floats, Floats, Floats, Flags, Floats, Floats]

START_DAMPING = 0.1  # of the first step, in units of the cost
EXACT = 1e-28  # cost below which only rounding is left


@compiled()
def copy(a: Floats, b: Floats) -> None:
    """Copy vector a into b."""
    for i in range(a.shape[0]):
        b[i] = a[i]


@compiled()
def factored(H: Floats, held: Flags) -> bool:
    """Cholesky's factor in the lower half of H, in place, without held rows; False if singular."""
    for i in range(H.shape[0]):
        if held[i]:
            continue
        for j in range(i + 1):
            if held[j]:
                continue
            total = H[i, j]
            for k in range(j):
                if not held[k]:
                    total -= H[i, k] * H[j, k]
            if i > j:
                H[i, j] = total / H[j, j]
            elif total > 0.0:
                H[i, i] = sqrt(total)
            else:
                return False
    return True


@compiled()
def substitute(H: Floats, held: Flags, x: Floats) -> None:
    """Solve with the factor of `factored`, in place; held entries of x become 0."""
    n = x.shape[0]
    for i in range(n):
        if held[i]:
            x[i] = 0.0
            continue
        for k in range(i):
            if not held[k]:
                x[i] -= H[i, k] * x[k]
        x[i] /= H[i, i]
    for i in range(n - 1, -1, -1):
        if held[i]:
            continue
        for k in range(i + 1, n):
            if not held[k]:
                x[i] -= H[k, i] * x[k]
        x[i] /= H[i, i]


@compiled()
def gradient(weight: Floats, bounds: Bounds, unit: Floats, work: Work) -> float:
    """Minus half the gradient of the cost into g, and which joints are held; returns its size.

    A joint at a limit that would leave it is held there; a joint off the path always is.
    """
    q, _, e, J, _, g, _, held, _, _ = work
    lower, upper = bounds
    size = 0.0
    for i in range(q.shape[0]):
        total = 0.0
        for c in range(6):
            total += weight[c] * weight[c] * J[c, i] * e[c]
        g[i] = total
        held[i] = (
            unit[i] == 0.0
            or (q[i] <= lower[i] and total <= 0.0)
            or (q[i] >= upper[i] and total >= 0.0)
        )
        if not held[i]:
            size += (total / unit[i]) ** 2
    return sqrt(size)


@compiled()
def look(goal: Goal, arm: Arm, work: Work) -> Vector:
    """Error and Jacobian of the posture in ``work``; returns the tool's position."""
    q, _, e, J, _, _, _, _, z, o = work
    R, p = forward(q, arm, z, o)
    phi = missing(R, p, goal, e)
    error_jacobian(p, phi, goal, arm, z, o, J)
    return p


@compiled()
def descend(
    goal: Goal,
    arm: Arm,
    weight: Floats,
    mask: Ints,
    tolerance: Floats,
    bounds: Bounds,
    unit: Floats,
    iterations: int,
    patience: float,
    work: Work,
) -> tuple[float, float]:
    """Levenberg-Marquardt from the posture q in ``work``, which it improves.

    Ends when a step no longer reduces the error, or when more than ``patience`` of the cost is left
    after five steps. ``work`` holds the final error e; its sizes are returned.
    """
    q, trial, e, J, H, g, step, held, z, o = work
    lower, upper = bounds
    n = q.shape[0]
    look(goal, arm, work)
    cost = cost_of(e, weight)
    damping = START_DAMPING
    due, before = 0, inf
    for count in range(iterations):
        if cost < EXACT:
            break
        if count == due:
            if cost > patience * before:
                break
            due, before = count + 5, cost
        gradient(weight, bounds, unit, work)
        better = False
        new = cost
        for _ in range(8):
            for i in range(n):
                for j in range(i + 1):
                    total = 0.0
                    for c in range(6):
                        total += weight[c] * weight[c] * J[c, i] * J[c, j]
                    H[i, j] = total
                H[i, i] += (damping * min(cost, sqrt(cost)) + 1e-14) * unit[i] * unit[i]
                step[i] = g[i]
            if factored(H, held):
                substitute(H, held, step)
                for i in range(n):
                    trial[i] = min(max(q[i] + step[i], lower[i]), upper[i])
                R, p = forward(trial, arm, z, o)
                phi = missing(R, p, goal, e)
                new = cost_of(e, weight)
                if new < cost:
                    copy(trial, q)
                    error_jacobian(p, phi, goal, arm, z, o, J)
                    better = True
                    break
            damping = 8.0 * damping
        if not better:
            look(goal, arm, work)
            break
        damping = max(damping / 3.0, 1e-3)
        pays = new < 0.1 * cost
        cost = new
        if not pays and is_met(sizes(e, mask), tolerance):
            break
    return sizes(e, mask)


@compiled()
def settle(q: Floats, turns: Flags, box: Bounds, reference: Floats) -> None:
    """Shift the angles of q by whole turns: into (-pi, pi], or inside limits near the reference."""
    lower, upper = box
    for i in range(q.shape[0]):
        if not turns[i]:
            continue
        if lower[i] == -inf and upper[i] == inf:
            angle = q[i] - 2.0 * pi * np.rint(q[i] / (2.0 * pi))
            q[i] = pi if angle <= -pi else angle
        else:
            turn = np.rint((reference[i] - q[i]) / (2.0 * pi))
            turn = max(turn, np.ceil((lower[i] - q[i]) / (2.0 * pi)))
            turn = min(turn, np.floor((upper[i] - q[i]) / (2.0 * pi)))
            # at the ends of the range only rounding is clipped
            q[i] = min(max(q[i] + 2.0 * pi * turn, lower[i]), upper[i])
