"""The compiled iterative inverse: Levenberg-Marquardt on the pose error, pose by pose.

The error of a posture has six components in the axes of the mask: the missing translation
``P_d - P`` and the missing rotation ``phi = log(R_d R^T)``. Turning the tool by ``w dt`` in world
axes gives ``R_d R^T exp(-[w] dt)``, hence ``d phi = -Jr^-1(phi) w dt`` with the inverse right
Jacobian of the rotation group (below). It is regular up to whole turns, so that the derivative is
exact for every mask, also half a turn away, where the sign of phi jumps but its size does not.

Steps are ``(J^T W^2 J + lambda D) dq = J^T W^2 e`` with lambda in proportion to the squared error
(T. Sugihara, IEEE T-RO 27(5), 2011; to the error itself where that is large, as it bends the cost
by its size), raised where a step does not pay. Metres are divided by the length of the arm inside
the iteration only; whether a pose is met is asked in metres and radians.
"""

from math import atan2, inf, nan, pi, sqrt, tan

import numpy as np
from numba import types
from numpy.typing import NDArray

from ..kernels._compile import (
    CHAIN,
    INT,
    INTS,
    MATRIX,
    NOTHING,
    OUT1,
    OUT2,
    STACK,
    VECTOR,
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
    whole_matrix,
    whole_vector,
)
from .status import IGMStatus

__all__ = ["solve_poses"]

Flags = NDArray[np.bool_]
Codes = NDArray[np.int8]
Goal = tuple[Matrix, Vector, Matrix]  # R_d, P_d, the axes of the mask
Arm = tuple[Ints, Ints, Floats, Floats, Matrix, Vector, Ints, Matrix, Vector]  # chain, path, tool
Bounds = tuple[Floats, Floats]
# posture, trial, error, Jacobian, J^T W^2 J, gradient, step, held joints, axes, origins
Work = tuple[Floats, Floats, Floats, Floats, Floats, Floats, Floats, Flags, Floats, Floats]
# weights, mask, tolerances, units and turning joints; restarts and iterations
Task = tuple[Floats, Ints, Floats, Floats, Flags, int, int]

FLOAT = types.float64
ROW_FLAGS, JOINT_FLAGS = (types.Array(types.boolean, ndim, "C") for ndim in (1, 2))
CODES = types.Array(types.int8, 1, "C")

FOUND = int(IGMStatus.REACHED)
FAMILY = int(IGMStatus.REACHED_FAMILY)
BEYOND_LIMITS = int(IGMStatus.OUTSIDE_LIMITS)
NO_ORIENTATION = int(IGMStatus.ORIENTATION_NOT_AVAILABLE)
TOO_FAR = int(IGMStatus.TOO_FAR)
TOO_NEAR = int(IGMStatus.TOO_NEAR)
NOTHING_FOUND = int(IGMStatus.NOT_CONVERGED)

STIFF = 1e3  # weights of the position while the least orientation error is looked for
STIFFER = 1e5
GIVE_UP = 0.7  # of the cost that is left after five steps; more, and another start is better
SIDE_STARTS = 16  # starts for the questions asked when a pose could not be met
START_DAMPING = 0.1  # of the first step, in units of the cost
EXACT = 1e-28  # cost below which only rounding is left
SPREAD = 0.5  # weight of the orientation in the choice of the next start
IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


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

    Within the tolerances it goes on while a step takes away most of the error, so that what is
    returned is as good as rounding allows where the pose can be met exactly. It gives up where
    steps stop paying: where after five of them more than ``patience`` of the cost is left. The
    error e in ``work`` is that of the posture it ends with; its sizes are returned.
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


@compiled()
def rate_starts(poses: Floats, goal: Goal, weight: Floats, score: Floats) -> None:
    """How far the pose of each start is from the goal, smallest first to be tried."""
    Rd, pd, axes = goal
    angular = max(weight[3], weight[4], weight[5])
    for s in range(score.shape[0]):
        p = (poses[s, 0, 3], poses[s, 1, 3], poses[s, 2, 3])
        away = transpose_times(axes, subtract(pd, p))
        total = 0.0
        for c in range(3):
            total += (weight[c] * away[c]) ** 2
        if angular > 0.0:
            trace = 0.0
            for row in range(3):
                for c in range(3):
                    trace += poses[s, row, c] * Rd[3 * row + c]
            total += SPREAD * angular * angular * (3.0 - trace)
        score[s] = total


@compiled()
def take_start(
    s: int, first: Floats, starts: Floats, score: Floats, unit: Floats, bounds: Bounds, q: Floats
) -> None:
    """Start number s into q: the given one for s = 0, else the best that is left.

    Joints off the path stay where the given start has them.
    """
    lower, upper = bounds
    best = 0
    if s > 0:
        for k in range(score.shape[0]):
            if score[k] < score[best]:
                best = k
        score[best] = inf
    for i in range(q.shape[0]):
        value = starts[best, i] if s > 0 and unit[i] > 0.0 else first[i]
        q[i] = min(max(value, lower[i]), upper[i])


@compiled()
def row_space(J: Floats, weight: Floats, unit: Floats, rows: Floats, moves: Floats) -> int:
    """Rank of the asked-for rows of J; ``moves[i]``: motion without effect goes through joint i.

    Gram and Schmidt's method with pivoting gives an orthonormal basis of the rows; what it
    leaves of the unit vector of a joint is the part of it that the task does not see.
    """
    n = J.shape[1]
    for i in range(n):
        moves[i] = 0.0 if unit[i] == 0.0 else 1.0
        for c in range(6):
            rows[c, i] = 0.0 if unit[i] == 0.0 else weight[c] * J[c, i] / unit[i]
    rank = 0
    largest = 0.0
    for _ in range(6):
        best, size = 0, 0.0
        for c in range(6):
            total = 0.0
            for i in range(n):
                total += rows[c, i] * rows[c, i]
            if total > size:
                best, size = c, total
        largest = max(largest, size)
        if size <= 1e-14 * largest:
            break
        rank += 1
        for i in range(n):
            rows[best, i] /= sqrt(size)
            moves[i] -= rows[best, i] * rows[best, i]
        for c in range(6):
            if c != best:
                total = 0.0
                for i in range(n):
                    total += rows[c, i] * rows[best, i]
                for i in range(n):
                    rows[c, i] -= total * rows[best, i]
        for i in range(n):
            rows[best, i] = 0.0
    return rank


@compiled()
def which_side(p: Vector, arm: Arm, goal: Goal, mask: Ints, work: Work) -> int:
    """Whether the target is too far or too near for the posture that comes closest.

    There the line from the tool to the target meets every axis that turns the tool. TOO_NEAR if
    one of them lies at the target or beyond: the tool does not come closer to it. Else TOO_FAR.
    """
    sigma, joint, _, _, _, _, path, _, _ = arm
    _, _, axes = goal
    _, _, e, _, _, _, _, held, z, o = work
    missed = times(axes, (mask[0] * e[0], mask[1] * e[1], mask[2] * e[2]))
    distance = sqrt(dot(missed, missed))
    ahead = scale(1.0 / distance, missed)
    for s in range(path.shape[0]):
        k = path[s] - 1
        if sigma[k] != 0 or held[joint[k]]:
            continue
        # where the line passes the axis; along the line it says nothing
        axis = vector(z, s)
        across = cross(axis, cross(ahead, axis))
        slope = dot(across, ahead)
        if slope > 0.01 and dot(across, subtract(vector(o, s), p)) > 0.5 * slope * distance:
            return TOO_NEAR
    return TOO_FAR


@compiled()
def reach_pose(
    goal: Goal,
    arm: Arm,
    task: Task,
    bounds: Bounds,
    box: Bounds,
    first: Floats,
    given: int,
    starts: Floats,
    score: Floats,
    kept: Floats,
    work: Work,
) -> bool:
    """The whole task from one start after the other; the posture that comes closest into kept."""
    asked, mask, tolerance, unit, turns, restarts, iterations = task
    q, _, e, _, _, _, _, _, _, _ = work
    least = inf
    for s in range(1 - given, restarts + 1):
        take_start(s, first, starts, score, unit, bounds, q)
        descend(goal, arm, asked, mask, tolerance, bounds, unit, iterations, GIVE_UP, work)
        settle(q, turns, box, first)
        look(goal, arm, work)
        cost = cost_of(e, asked)
        if cost < least:
            least = cost
            copy(q, kept)
        if is_met(sizes(e, mask), tolerance):
            copy(q, kept)
            return True
    return False


@compiled()
def reach_position(
    goal: Goal,
    arm: Arm,
    task: Task,
    place: Floats,
    place_mask: Ints,
    stiff: Floats,
    bounds: Bounds,
    box: Bounds,
    first: Floats,
    starts: Floats,
    score: Floats,
    kept: Floats,
    work: Work,
) -> int:
    """The position alone, and there the least orientation error; the best posture into kept.

    Returns FOUND if the pose is met after all, NO_ORIENTATION if its position is, else on which
    side the target lies.
    """
    asked, mask, tolerance, unit, turns, restarts, iterations = task
    q, _, e, _, _, _, _, _, _, _ = work
    placed = False
    closest, angle = inf, inf
    for s in range(min(SIDE_STARTS, restarts) + 2):
        if s == 0:
            copy(kept, q)
        else:
            take_start(s - 1, first, starts, score, unit, bounds, q)
        weight, part, patience = place, place_mask, GIVE_UP
        for stage in range(4):
            # the position; the orientation with it, twice; again the position
            if stage == 1:
                weight, part, patience = stiff, mask, 0.999
                for c in range(3):
                    stiff[c] = STIFF * asked[c]
            elif stage == 2:
                for c in range(3):
                    stiff[c] = STIFFER * asked[c]
            elif stage == 3:
                weight, part, patience = place, place_mask, GIVE_UP
            size = descend(
                goal, arm, weight, part, tolerance, bounds, unit, iterations, patience, work
            )
            if (stage == 0 and not is_met(size, tolerance)) or is_met(sizes(e, mask), tolerance):
                break
        settle(q, turns, box, first)
        look(goal, arm, work)
        away, off = sizes(e, mask)
        if away <= tolerance[0]:
            if off <= tolerance[1]:
                copy(q, kept)
                return FOUND
            if off < angle:
                angle = off
                copy(q, kept)
            placed = True
        elif not placed and away < closest:
            closest = away
            copy(q, kept)
    if placed:
        return NO_ORIENTATION
    copy(kept, q)
    side = NOTHING_FOUND
    for _ in range(20):
        descend(goal, arm, place, place_mask, tolerance, bounds, unit, iterations, GIVE_UP, work)
        p = look(goal, arm, work)
        slope = gradient(place, bounds, unit, work)
        if slope <= 1e-3 * sqrt(cost_of(e, place)):
            side = which_side(p, arm, goal, mask, work)
            break
    settle(q, turns, box, first)
    copy(q, kept)
    return side


@compiled(
    NOTHING(
        STACK, MATRIX, INT, MATRIX, STACK, *CHAIN, INTS, MATRIX, VECTOR, VECTOR, VECTOR, INT,
        INTS, INT, FLOAT, FLOAT, VECTOR, INT, INT, OUT2, OUT2, OUT2, OUT1, ROW_FLAGS,
        ROW_FLAGS, JOINT_FLAGS, JOINT_FLAGS, CODES,
    )
)  # fmt: skip
def solve_poses(
    targets: Floats,
    first: Floats,
    given: int,
    starts: Floats,
    poses: Floats,
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
    lower: Floats,
    upper: Floats,
    boxed: int,
    mask: Ints,
    tool_axes: int,
    length: float,
    reach: float,
    tolerance: Floats,
    restarts: int,
    iterations: int,
    closest: Floats,
    postures: Floats,
    error: Floats,
    residual: Floats,
    valid: Flags,
    inside: Flags,
    unmoved: Flags,
    family: Flags,
    status: Codes,
) -> None:
    """One posture a pose, or the closest one and why there is none.

    Parameters
    ----------
    targets : (N, 4, 4)
        World poses of the tool [m].
    first : (N, n)
        The first starts, and where joints without effect stay [rad or m].
    given : int
        1 if ``first`` is a start, 0 if it only holds joints without effect and mid-ranges.
    starts : (K, n)
        Further starts, K >= 1, the same for all targets [rad or m].
    poses : (K, 4, 4)
        World poses of the tool at these starts [m].
    antecedent, ..., base_position
        The `Chain`.
    path, tool_rotation, tool_position
        As for `tip_poses`.
    lower, upper : (n,)
        Joint limits [rad or m].
    boxed : int
        1: inside the limits only.
    mask : (6,) int64
        1 for each component of the error that is asked for.
    tool_axes : int
        1: components in the axes of the tool at its target, 0: in world axes.
    length, reach : float
        What makes metres and radians comparable, and what the tool's distance from the origin
        of the first frame of the path never exceeds [m]; infinite if that is not known.
    tolerance : (2,)
        Position [m] and orientation [rad].
    restarts, iterations : int
        Starts beside the given one, at most K; steps from each start.
    closest, postures : (N, n)
        Written: the posture the search ended with; the same where it is a solution, else NaN.
    error, residual : (N, 6), (N,)
        Written: what that posture misses, and the larger of the sizes that were asked for.
    valid, inside : (N,) bool
        Written: whether it is a solution, and one inside the limits.
    unmoved, family : (N, n) bool
        Written: joints off the path; joints that move in the infinite family it belongs to.
    status : (N,) int8
        Written: codes of `IGMStatus`.
    """
    n = starts.shape[1]
    k = path.shape[0]
    arm = (
        sigma, joint, rotation, position, whole_matrix(base_rotation),
        whole_vector(base_position), path, whole_matrix(tool_rotation),
        whole_vector(tool_position),
    )  # fmt: skip
    q, e, J = np.empty(n), np.zeros(6), np.zeros((6, n))
    work = (
        q, np.empty(n), e, J, np.empty((n, n)), np.empty(n), np.empty(n), np.empty(n, np.bool_),
        np.empty((k, 3)), np.empty((k, 3)),
    )  # fmt: skip
    kept, score = np.empty(n), np.empty(starts.shape[0])
    rows, moves = np.empty((6, n)), np.empty(n)

    # weights of the whole task, of its position alone, and of a position that must not be lost
    asked, place, stiff = np.empty(6), np.zeros(6), np.empty(6)
    whole_mask, place_mask = mask.copy(), np.zeros(6, np.int64)
    for c in range(6):
        asked[c] = mask[c] / length if c < 3 else mask[c]
        stiff[c] = asked[c]
        if c < 3:
            place[c], place_mask[c] = asked[c], mask[c]
    unit, turns = np.zeros(n), np.zeros(n, np.bool_)
    for j in range(sigma.shape[0]):
        if sigma[j] == 0:
            turns[joint[j]] = True
    free = 0
    for j in path:
        if sigma[j - 1] != 2:
            unit[joint[j - 1]] = 1.0 if sigma[j - 1] == 0 else 1.0 / length
            free += 1
    # an angle that has a whole turn is not limited: it is shifted inside afterwards
    nowhere = (np.full(n, -inf), np.full(n, inf))
    bounds, box = nowhere, nowhere
    if boxed:
        box = (lower.copy(), upper.copy())
        bounds = (lower.copy(), upper.copy())
        for i in range(n):
            if turns[i] and upper[i] - lower[i] >= 2.0 * pi:
                bounds[0][i], bounds[1][i] = -inf, inf
    task = (asked, whole_mask, tolerance, unit, turns, restarts, iterations)
    has_place = place_mask[0] + place_mask[1] + place_mask[2] > 0
    all_place = place_mask[0] + place_mask[1] + place_mask[2] == 3
    j = path[0] - 1
    centre = add(arm[5], times(arm[4], vector(position, j)))

    generic = -1
    reference = np.empty(n)
    for i in range(targets.shape[0]):
        T = targets[i]
        Rd = (T[0, 0], T[0, 1], T[0, 2], T[1, 0], T[1, 1], T[1, 2], T[2, 0], T[2, 1], T[2, 2])
        pd = (T[0, 3], T[1, 3], T[2, 3])
        goal = (Rd, pd, Rd if tool_axes else IDENTITY)
        if generic < 0:
            # the rank of the task away from singular postures
            for s in range(min(8, starts.shape[0])):
                copy(starts[s], q)
                look(goal, arm, work)
                generic = max(generic, row_space(J, asked, unit, rows, moves))

        copy(first[i], reference)
        copy(reference, kept)
        outcome = NOTHING_FOUND
        away = subtract(pd, centre)
        beyond = sqrt(dot(away, away)) > reach + tolerance[0] and all_place
        if not beyond:
            rate_starts(poses, goal, asked, score)
            if reach_pose(
                goal, arm, task, bounds, box, reference, given, starts, score, kept, work
            ):
                outcome = FOUND
            elif boxed:
                # without limits, to say that they are the reason
                rate_starts(poses, goal, asked, score)
                copy(kept, moves)  # which has no other use here
                if reach_pose(
                    goal, arm, task, nowhere, nowhere, reference, given, starts, score, kept,
                    work,
                ):  # fmt: skip
                    outcome = BEYOND_LIMITS
                else:
                    copy(moves, kept)
        if outcome == NOTHING_FOUND and has_place:
            rate_starts(poses, goal, place, score)
            outcome = reach_position(
                goal, arm, task, place, place_mask, stiff, bounds, box, reference, starts,
                score, kept, work,
            )  # fmt: skip
            if beyond:
                outcome = TOO_FAR

        copy(kept, q)
        look(goal, arm, work)
        solved = outcome == FOUND
        known = solved and generic < free
        known = known and row_space(J, asked, unit, rows, moves) == generic
        within = solved
        for c in range(n):
            unmoved[i, c] = solved and unit[c] == 0.0
            family[i, c] = known and moves[c] > 1e-10
            if unmoved[i, c] or family[i, c]:
                outcome = FAMILY
            within = within and q[c] >= lower[c] and q[c] <= upper[c]
            closest[i, c] = q[c]
            postures[i, c] = q[c] if solved else nan
        for c in range(6):
            error[i, c] = e[c]
        size = sizes(e, whole_mask)
        residual[i] = max(size[0], size[1])
        valid[i], inside[i] = solved, within
        status[i] = outcome
