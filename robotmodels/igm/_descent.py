"""The compiled iterative inverse: Levenberg-Marquardt on the pose error, pose by pose.

The error of a posture has six components in the axes of the mask: the missing translation
``P_d - P`` and the missing rotation ``phi = log(R_d R^T)``. Turning the tool by ``w dt`` in world
axes gives ``R_d R^T exp(-[w] dt)``, hence ``d phi = -Jr^-1(phi) w dt`` with the inverse right
Jacobian of the rotation group (below). It is regular up to whole turns, so that the derivative is
exact for every mask, also half a turn away, where the sign of phi jumps but its size does not.

Steps are ``(J^T W^2 J + lambda D) dq = J^T W^2 e`` with lambda in proportion to the squared error
(T. Sugihara, IEEE T-RO 27(5), 2011), raised where a step does not pay. Metres are divided by the
length of the arm inside the iteration only; whether a pose is met is asked in metres and radians.
"""

from math import atan2, inf, pi, sqrt, tan

import numpy as np
from numba import types

from ..kernels._compile import (
    CHAIN,
    INT,
    INTS,
    MATRIX,
    NOTHING,
    OUT2,
    STACK,
    VECTOR,
    Floats,
    Ints,
    compiled,
)
from ..kernels._motion import coordinate, link_transform
from ..kernels._vectors import (
    Matrix,
    Vector,
    add,
    cross,
    dot,
    matrix,
    product,
    product_transpose,
    put_matrix,
    put_vector,
    scale,
    subtract,
    times,
    transpose_times,
    vector,
    whole_matrix,
    whole_vector,
)

__all__ = ["solve_poses"]

FLOAT = types.float64
FLAGS = types.Array(types.boolean, 2, "C")
CODES = types.Array(types.int64, 1, "C")

# outcomes of `solve_poses`, translated to statuses by its caller
FOUND, BEYOND_LIMITS, NO_ORIENTATION, TOO_FAR, TOO_NEAR, NOTHING_FOUND = range(6)

STIFF = 1e3  # weight of the position while the least orientation error is looked for
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
def forward(q, row, arm, z, o):
    """Pose (R, p) of the tool at posture ``q[row]``; axes and origins of the path into z and o."""
    sigma, joint, rotation, position, R, p, path, E, e = arm
    for s in range(path.shape[0]):
        k = path[s] - 1
        qj = coordinate(q, row, joint[k])
        Rj, Pj = link_transform(sigma[k], qj, matrix(rotation, k), vector(position, k))
        p = add(p, times(R, Pj))
        R = product(R, Rj)
        put_vector(z, s, (R[2], R[5], R[8]))
        put_vector(o, s, p)
    return product(R, E), add(p, times(R, e))


@compiled()
def missing(R, p, goal, e):
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
def error_jacobian(p, phi, goal, arm, z, o, J):
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
def cost_of(e, weight):
    """Squared weighted error."""
    total = 0.0
    for c in range(6):
        total += (weight[c] * e[c]) ** 2
    return total


@compiled()
def part_of(e, mask, first):
    """Size of the asked-for components of the translation (first = 0) or rotation (first = 3)."""
    total = 0.0
    for c in range(first, first + 3):
        if mask[c]:
            total += e[c] * e[c]
    return sqrt(total)


@compiled()
def factored(H, held):
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
def substitute(H, held, x):
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
def gradient(weight, bounds, unit, work):
    """Minus half the gradient of the cost into g, and which joints are held; returns its size.

    A joint at a limit that would leave it is held there; a joint off the path always is.
    """
    q, e, J, _, g, _, held, _, _ = work
    lower, upper = bounds
    size = 0.0
    for i in range(q.shape[1]):
        total = 0.0
        for c in range(6):
            total += weight[c] * weight[c] * J[c, i] * e[c]
        g[i] = total
        held[i] = (
            unit[i] == 0.0
            or (q[0, i] <= lower[i] and total <= 0.0)
            or (q[0, i] >= upper[i] and total >= 0.0)
        )
        if not held[i]:
            size += (total / unit[i]) ** 2
    return sqrt(size)


@compiled()
def descend(goal, arm, weight, mask, tolerance, bounds, unit, iterations, work):
    """Levenberg-Marquardt from the posture in row 0 of ``work.q``, which it improves.

    Within the tolerances it goes on while a step takes away most of the error, so that what is
    returned is as good as rounding allows where the pose can be met exactly. It gives up where
    steps stop paying. Returns the sizes of the asked-for errors in metres and radians.
    """
    q, e, J, H, g, step, held, z, o = work
    lower, upper = bounds
    n = q.shape[1]
    R, p = forward(q, 0, arm, z, o)
    phi = missing(R, p, goal, e)
    cost = cost_of(e, weight)
    damping = START_DAMPING
    due, before = 0, inf
    for count in range(iterations):
        if cost < EXACT:
            break
        if count == due:
            # a valley that takes this long is left for another start
            if cost > 0.7 * before:
                break
            due, before = count + 5, cost
        error_jacobian(p, phi, goal, arm, z, o, J)
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
                H[i, i] += (damping * cost + 1e-14) * unit[i] * unit[i]
                step[i] = g[i]
            if factored(H, held):
                substitute(H, held, step)
                for i in range(n):
                    q[1, i] = min(max(q[0, i] + step[i], lower[i]), upper[i])
                R, p = forward(q, 1, arm, z, o)
                phi = missing(R, p, goal, e)
                new = cost_of(e, weight)
                if new < cost:
                    better = True
                    break
            damping = 8.0 * damping
        if not better:
            R, p = forward(q, 0, arm, z, o)
            missing(R, p, goal, e)
            break
        for i in range(n):
            q[0, i] = q[1, i]
        damping = max(damping / 3.0, 1e-3)
        pays = new < 0.1 * cost
        cost = new
        met = part_of(e, mask, 0) <= tolerance[0] and part_of(e, mask, 3) <= tolerance[1]
        if met and not pays:
            break
    return part_of(e, mask, 0), part_of(e, mask, 3)


@compiled()
def settle(q, turns, box, boxed, reference):
    """Shift the angles in row 0 of q by whole turns.

    Without limits into (-pi, pi]; with limits inside them, nearest to the reference.
    """
    lower, upper = box
    for i in range(q.shape[1]):
        if not turns[i]:
            continue
        if boxed:
            angle = q[0, i] + 2.0 * pi * round((reference[i] - q[0, i]) / (2.0 * pi))
            while angle > upper[i]:
                angle -= 2.0 * pi
            while angle < lower[i]:
                angle += 2.0 * pi
            # at the ends of the range only rounding is clipped
            q[0, i] = min(max(angle, lower[i]), upper[i])
        else:
            angle = q[0, i] - 2.0 * pi * round(q[0, i] / (2.0 * pi))
            q[0, i] = pi if angle <= -pi else angle


@compiled()
def rate_starts(Rs, ps, goal, weight, spread, score):
    """How far the pose of each start is from the goal, smallest first to be tried."""
    Rd, pd, axes = goal
    angular = 0.0
    for c in range(3, 6):
        angular = max(angular, weight[c])
    for s in range(score.shape[0]):
        away = transpose_times(axes, subtract(pd, vector(ps, s)))
        total = 0.0
        for c in range(3):
            total += (weight[c] * away[c]) ** 2
        if angular > 0.0:
            R = matrix(Rs, s)
            trace = 0.0
            for c in range(9):
                trace += R[c] * Rd[c]
            total += spread * angular * angular * (3.0 - trace)
        score[s] = total


@compiled()
def take_start(starts, score, q):
    """Copy the best start that is left into row 0 of q."""
    best = 0
    for s in range(score.shape[0]):
        if score[s] < score[best]:
            best = s
    score[best] = inf
    for i in range(q.shape[1]):
        q[0, i] = starts[best, i]


@compiled()
def copy_row(a, i, b, j):
    """Copy row i of a into row j of b."""
    for c in range(a.shape[1]):
        b[j, c] = a[i, c]


@compiled()
def clip_row(q, bounds):
    """Bring the posture in row 0 of q inside the bounds."""
    lower, upper = bounds
    for i in range(q.shape[1]):
        q[0, i] = min(max(q[0, i], lower[i]), upper[i])


@compiled()
def row_space(J, weight, unit, rows, moves):
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
def which_side(p, arm, goal, mask, work):
    """Whether the target is too far or too near for the posture that comes closest.

    There the line from the tool to the target meets every axis that could turn the tool towards
    it: TOO_NEAR if one of them lies beyond the target, else TOO_FAR.
    """
    sigma, joint, _, _, _, _, path, _, _ = arm
    _, _, axes = goal
    _, e, _, _, _, _, held, z, o = work
    missed = (
        e[0] if mask[0] else 0.0,
        e[1] if mask[1] else 0.0,
        e[2] if mask[2] else 0.0,
    )
    missed = times(axes, missed)
    distance = sqrt(dot(missed, missed))
    ahead = scale(1.0 / distance, missed)
    for s in range(path.shape[0]):
        k = path[s] - 1
        if sigma[k] != 0 or held[joint[k]]:
            continue
        # where the line passes the axis
        axis = vector(z, s)
        normal = cross(axis, cross(ahead, axis))
        slope = dot(normal, ahead)
        if slope > 1e-6 and dot(normal, subtract(vector(o, s), p)) > slope * distance:
            return TOO_NEAR
    return TOO_FAR


@compiled(
    NOTHING(
        STACK, MATRIX, INT, MATRIX, *CHAIN, INTS, MATRIX, VECTOR, VECTOR, VECTOR, INT, INTS, INT,
        FLOAT, FLOAT, VECTOR, INT, INT, OUT2, OUT2, FLAGS, CODES,
    )
)  # fmt: skip
def solve_poses(
    targets: Floats,
    first: Floats,
    given: int,
    starts: Floats,
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
    out: Floats,
    error: Floats,
    family: Ints,
    code: Ints,
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
        Further starts, K >= 1, the same for all poses [rad or m].
    antecedent, ..., base_position
        The `Chain`.
    path, tool_rotation, tool_position
        As for `tip_poses`.
    lower, upper : (n,)
        Joint limits [rad or m]; not looked at unless ``boxed`` is 1.
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
    out, error : (N, n), (N, 6)
        Written: the posture and what it misses.
    family : (N, n) bool
        Written: joints on the path that move in the infinite family the posture belongs to.
    code : (N,) int64
        Written: the outcome.
    """
    n = starts.shape[1]
    k = path.shape[0]
    arm = (
        sigma, joint, rotation, position, whole_matrix(base_rotation),
        whole_vector(base_position), path, whole_matrix(tool_rotation),
        whole_vector(tool_position),
    )  # fmt: skip
    e = np.zeros(6)
    z, o = np.empty((k, 3)), np.empty((k, 3))
    q = np.empty((2, n))
    J = np.zeros((6, n))
    held = np.empty(n, np.bool_)
    work = (q, e, J, np.empty((n, n)), np.empty(n), np.empty(n), held, z, o)
    kept = np.empty((1, n))
    rows, moves = np.empty((6, n)), np.empty(n)

    # weights of the whole task, of its position alone, and of a position that must not be lost
    asked, place, stiff, place_mask = np.empty(6), np.empty(6), np.empty(6), np.zeros(6, np.int64)
    for c in range(6):
        asked[c] = mask[c] / length if c < 3 else mask[c]
        place[c] = asked[c] if c < 3 else 0.0
        stiff[c] = STIFF * asked[c] if c < 3 else asked[c]
        place_mask[c] = mask[c] if c < 3 else 0
    has_place = mask[0] + mask[1] + mask[2] > 0
    has_turn = mask[3] + mask[4] + mask[5] > 0
    unit, turns = np.zeros(n), np.zeros(n, np.bool_)
    for j in range(sigma.shape[0]):
        if sigma[j] == 0:
            turns[joint[j]] = True
    for j in path:
        if sigma[j - 1] != 2:
            unit[joint[j - 1]] = 1.0 if sigma[j - 1] == 0 else 1.0 / length
    free = 0
    for i in range(n):
        if unit[i] > 0.0:
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

    Rs, ps = np.empty((starts.shape[0], 3, 3)), np.empty((starts.shape[0], 3))
    for s in range(starts.shape[0]):
        copy_row(starts, s, q, 0)
        R, p = forward(q, 0, arm, z, o)
        put_matrix(Rs, s, R)
        put_vector(ps, s, p)
    score = np.empty(starts.shape[0])

    generic = -1
    for i in range(targets.shape[0]):
        T = targets[i]
        Rd = (T[0, 0], T[0, 1], T[0, 2], T[1, 0], T[1, 1], T[1, 2], T[2, 0], T[2, 1], T[2, 2])
        pd = (T[0, 3], T[1, 3], T[2, 3])
        goal = (Rd, pd, Rd if tool_axes else IDENTITY)
        if generic < 0:
            # the rank of the task away from singular postures
            for s in range(min(8, starts.shape[0])):
                copy_row(starts, s, q, 0)
                R, p = forward(q, 0, arm, z, o)
                phi = missing(R, p, goal, e)
                error_jacobian(p, phi, goal, arm, z, o, J)
                generic = max(generic, row_space(J, asked, unit, rows, moves))

        # 1. the whole task from every start; 2. without limits, to say that they are the reason
        found, beyond = False, False
        copy_row(first, i, kept, 0)
        least = inf
        out_of_reach = False
        if mask[0] and mask[1] and mask[2]:
            copy_row(first, i, q, 0)
            forward(q, 0, arm, z, o)
            if k == 0:
                centre = add(arm[5], times(arm[4], arm[8]))
            else:
                j = path[0] - 1
                centre = add(arm[5], times(arm[4], vector(position, j)))
            away = subtract(pd, centre)
            out_of_reach = sqrt(dot(away, away)) > reach + tolerance[0]
        for attempt in range(2):
            if out_of_reach or (attempt == 1 and not boxed):
                break
            limits = bounds if attempt == 0 else nowhere
            rate_starts(Rs, ps, goal, asked, SPREAD, score)
            for s in range(1 - given, restarts + 1):
                if s == 0:
                    copy_row(first, i, q, 0)
                else:
                    take_start(starts, score, q)
                    for c in range(n):
                        if unit[c] == 0.0:
                            q[0, c] = first[i, c]
                clip_row(q, limits)
                descend(goal, arm, asked, mask, tolerance, limits, unit, iterations, work)
                settle(q, turns, box, attempt == 0 and boxed == 1, first[i])
                R, p = forward(q, 0, arm, z, o)
                phi = missing(R, p, goal, e)
                cost = cost_of(e, asked)
                if attempt == 0 and cost < least:
                    least = cost
                    copy_row(q, 0, kept, 0)
                if part_of(e, mask, 0) <= tolerance[0] and part_of(e, mask, 3) <= tolerance[1]:
                    found = True
                    break
            if found:
                beyond = attempt == 1
                break
        code[i] = NOTHING_FOUND
        if found:
            code[i] = BEYOND_LIMITS if beyond else FOUND
            copy_row(q, 0, kept, 0)

        # 3. the position alone, and the least orientation error there
        placed = False
        if not found and has_place:
            closest, angle = inf, inf
            rate_starts(Rs, ps, goal, place, SPREAD, score)
            for s in range(min(SIDE_STARTS, restarts) + 2):
                if s == 0:
                    copy_row(kept, 0, q, 0)
                elif s == 1:
                    copy_row(first, i, q, 0)
                else:
                    take_start(starts, score, q)
                    for c in range(n):
                        if unit[c] == 0.0:
                            q[0, c] = first[i, c]
                clip_row(q, bounds)
                away_, _ = descend(
                    goal, arm, place, place_mask, tolerance, bounds, unit, iterations, work
                )
                if away_ <= tolerance[0] and has_turn:
                    descend(goal, arm, stiff, mask, tolerance, bounds, unit, iterations, work)
                    if part_of(e, mask, 0) > tolerance[0] or part_of(e, mask, 3) > tolerance[1]:
                        descend(
                            goal, arm, place, place_mask, tolerance, bounds, unit, iterations, work
                        )
                settle(q, turns, box, boxed == 1, first[i])
                R, p = forward(q, 0, arm, z, o)
                missing(R, p, goal, e)
                away_, off = part_of(e, mask, 0), part_of(e, mask, 3)
                if away_ <= tolerance[0] and off <= tolerance[1]:
                    found = True
                    code[i] = FOUND
                    copy_row(q, 0, kept, 0)
                    break
                if away_ <= tolerance[0]:
                    if off < angle:
                        angle = off
                        copy_row(q, 0, kept, 0)
                    placed = True
                elif not placed and away_ < closest:
                    closest = away_
                    copy_row(q, 0, kept, 0)
            if placed and not found:
                code[i] = NO_ORIENTATION

        # 4. the posture that is kept, what it misses, and on which side the target lies
        copy_row(kept, 0, q, 0)
        if not found and has_place and not placed:
            for _ in range(20):
                descend(goal, arm, place, place_mask, tolerance, bounds, unit, iterations, work)
                R, p = forward(q, 0, arm, z, o)
                phi = missing(R, p, goal, e)
                error_jacobian(p, phi, goal, arm, z, o, J)
                slope = gradient(place, bounds, unit, work)
                if slope <= 1e-3 * sqrt(cost_of(e, place)):
                    code[i] = which_side(p, arm, goal, mask, work)
                    break
            settle(q, turns, box, boxed == 1, first[i])
        R, p = forward(q, 0, arm, z, o)
        phi = missing(R, p, goal, e)
        for c in range(n):
            out[i, c] = q[0, c]
            family[i, c] = False
        for c in range(6):
            error[i, c] = e[c]
        if found and generic < free:
            error_jacobian(p, phi, goal, arm, z, o, J)
            if row_space(J, asked, unit, rows, moves) == generic:
                for c in range(n):
                    family[i, c] = moves[c] > 1e-10
