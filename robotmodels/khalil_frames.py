"""Khalil-Kleinfinger frames for a tree of joint axes given any other way (a URDF, say).

Book section 1.2.1: z_j along the axis of joint j, x_j along the common perpendicular of z_j
and the next axis, and the free choices made so that as many parameters as possible are zero.

Parameters
----------
joints : sequence of JointAxis
    Antecedents come first; joint number j is the j-th, from 1.

Returns
-------
KhalilFrames
    Columns of the table, base and link poses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, hypot, pi, sin

import numpy as np

from . import se3
from ._arrays import Array
from .geometry import PRISMATIC

PARALLEL = 1e-13
"""Axes whose directions differ by less than this (rad) are parallel: rounding of the input."""
NEARLY_PARALLEL = 0.02
"""Below this angle (rad) a row takes beta: the common perpendicular would run far away."""
_LENGTH_ZERO = 1e-13  # for a robot of a metre or more
_ANGLE_ZERO = 1e-13
_TIE = 1e-9


@dataclass(frozen=True, slots=True)
class JointAxis:
    """A joint: the link it stands on (0 the root, else an earlier joint's number) and its kind.

    Its pose at ``q = 0`` in that link's frame, shape (4, 4); unit vector of q in its own, (3,).
    """

    antecedent: int
    sigma: int
    origin: Array
    axis: Array


@dataclass(frozen=True, slots=True)
class KhalilFrames:
    """Columns (f,) of the table, pose (4, 4) of R_0 in the root link, and poses (f, 4, 4).

    The latter are the constant poses of each source link's frame in its R_j.
    """

    gamma: Array
    b: Array
    beta: Array
    alpha: Array
    d: Array
    theta: Array
    r: Array
    base: Array
    link_poses: Array


def khalil_frames(joints: Sequence[JointAxis]) -> KhalilFrames:
    """Place the frames of a tree of joints by the rules of the book.

    The sense and zero of every joint variable are kept: z_j has the sense of the given axis, and
    ``q = 0`` is the given posture, so offsets appear in the theta and r columns. Of the signs that
    the rules leave free the one with theta in (-pi/2, pi/2] is taken. R_0 coincides with R_1 at
    ``q_1 = 0``; a last frame has theta = r = 0. Axes that are parallel to rounding are made so;
    axes less than `NEARLY_PARALLEL` apart get beta, so that no length exceeds the robot's size by
    more than the inverse of that angle.

    """
    f = len(joints)
    columns = np.zeros((7, f))
    gamma, b, beta, alpha, d, theta, r = columns
    children: list[list[int]] = [[] for _ in range(f + 1)]
    for j, joint in enumerate(joints, start=1):
        children[joint.antecedent].append(j)
    frames = np.empty((f + 1, 4, 4))  # pose of R_i in the frame of link i, at q = 0
    longest = max((float(np.abs(joint.origin[:3, 3]).max()) for joint in joints), default=1.0)
    tiny = _LENGTH_ZERO * min(1.0, longest)
    if f:
        frames[0] = _base_frame(joints, children, tiny)
    for j, joint in enumerate(joints, start=1):
        i, k = joint.antecedent, j - 1
        point, direction = _axis_in(frames[i], joint)
        is_main = children[i][0] == j
        if i == 0 and is_main:
            row = (0.0, 0.0, 0.0, 0.0, 0.0)
        else:
            row = _place(point, direction, joint.sigma, tiny)
        # for the main child theta_i and r_i have already been chosen so that these two vanish
        gamma[k], b[k] = (0.0, 0.0) if is_main and i else row[:2]
        beta[k], alpha[k], d[k] = row[2:]
        anchor = frames[i] @ _factor(gamma[k], b[k], beta[k], alpha[k], d[k])
        anchor = se3.inverse(joint.origin) @ anchor
        if children[j] and not (i == 0 and is_main):
            main = joints[children[j][0] - 1]
            theta[k], r[k] = _place(*_axis_in(anchor, main), main.sigma, tiny)[:2]
        frames[j] = anchor @ se3.rotation("z", theta[k]) @ se3.translation(0.0, 0.0, r[k])
    return KhalilFrames(*columns.copy(), base=frames[0], link_poses=se3.inverse(frames[1:]))


def _base_frame(joints: Sequence[JointAxis], children: list[list[int]], tiny: float) -> Array:
    """R_0 = R_1 at q_1 = 0: on the first axis, x along the perpendicular to the second."""
    first = joints[children[0][0] - 1]
    frame = np.eye(4)
    z = first.origin[:3, :3] @ first.axis
    x = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    frame[:3, :3] = np.column_stack((x, np.cross(z, x), z))
    frame[:3, :3][np.abs(frame[:3, :3]) < 1e-16] = 0.0
    frame[:3, 3] = first.origin[:3, 3]
    following = children[children[0][0]]
    if following:
        second = joints[following[0] - 1]
        in_first = se3.inverse(first.origin) @ frame
        angle, shift = _place(*_axis_in(in_first, second), second.sigma, tiny)[:2]
        frame = frame @ se3.rotation("z", angle) @ se3.translation(0.0, 0.0, shift)
    return frame


def _axis_in(frame: Array, joint: JointAxis) -> tuple[Array, Array]:
    """A point and the direction of a joint's axis, seen from a frame of its antecedent's link."""
    X = se3.inverse(frame) @ joint.origin
    return X[:3, 3], X[:3, :3] @ joint.axis


def _factor(gamma: float, b: float, beta: float, alpha: float, d: float) -> Array:
    return (
        se3.rotation("z", gamma)
        @ se3.translation(0.0, 0.0, b)
        @ se3.rotation("y", beta)
        @ se3.rotation("x", alpha)
        @ se3.translation(d, 0.0, 0.0)
    )


def _place(
    point: Array, u: Array, sigma: int, tiny: float
) -> tuple[float, float, float, float, float]:
    """Angle and shift along z, then beta, alpha and d that lead from a frame to an axis.

    Lengths below ``tiny`` are zero. The first two become theta and r of the frame's own row (or
    gamma and b of a side branch).
    """
    s = hypot(u[0], u[1])
    if s >= NEARLY_PARALLEL:
        return _place_skew(point, u, s, sigma, tiny)
    if s < PARALLEL:
        u = np.array([0.0, 0.0, 1.0 if u[2] > 0 else -1.0])
    # x through the foot of the perpendicular from the origin onto the axis (Hayati's choice);
    # the position of a prismatic axis is free, so it is drawn through the origin
    foot = np.zeros(3) if sigma == PRISMATIC else point - (point @ u) * u
    d = float(np.linalg.norm(foot))
    angle = 0.0
    if d < tiny:
        d = 0.0
    else:
        angle = atan2(foot[1], foot[0])
        if abs(angle) > pi / 2 + _TIE:
            d, angle = -d, atan2(-foot[1], -foot[0])
        angle = _tidy_angle(angle)
    # beta from the direction of the axis, not from the foot, whose direction is rounded when it
    # is short: what is left of u after Rot(z, angle) Rot(y, beta) is (0, -sin alpha, cos alpha)
    outward = cos(angle) * u[0] + sin(angle) * u[1]
    across = cos(angle) * u[1] - sin(angle) * u[0]
    sense = 1.0 if u[2] > 0 else -1.0
    beta = _tidy_angle(atan2(sense * outward, sense * u[2]))
    along = sin(beta) * outward + cos(beta) * u[2]
    return angle, 0.0, beta, _tidy_angle(atan2(-across, along)), d


def _place_skew(
    point: Array, u: Array, s: float, sigma: int, tiny: float
) -> tuple[float, float, float, float, float]:
    """The regular case: x along the common perpendicular of z and the axis."""
    angle, alpha = atan2(u[0], -u[1]), atan2(s, u[2])  # x = z x u / |z x u|
    if abs(angle) > pi / 2 + _TIE:
        angle, alpha = atan2(-u[0], u[1]), -alpha
    angle, alpha = _tidy_angle(angle), _tidy_angle(alpha)
    if sigma == PRISMATIC:
        return angle, 0.0, 0.0, alpha, 0.0
    c, sn = cos(angle), sin(angle)
    d = c * point[0] + sn * point[1]
    across = c * point[1] - sn * point[0]
    shift = point[2] + across * u[2] / (sin(alpha) or s)
    return angle, _tidy_length(shift, tiny), 0.0, alpha, _tidy_length(d, tiny)


def _tidy_angle(angle: float) -> float:
    """Snap to multiples of a right angle within rounding, so that tables show zeros."""
    nearest = round(angle / (pi / 2)) * (pi / 2)
    return nearest + 0.0 if abs(angle - nearest) < _ANGLE_ZERO else angle


def _tidy_length(length: float, tiny: float) -> float:
    return 0.0 if abs(length) < tiny else float(length)
