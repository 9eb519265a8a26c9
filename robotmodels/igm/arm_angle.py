"""Seven joints with a spherical shoulder, a revolute elbow and a spherical wrist, by arm angle.

The elbow of such an arm rotates about the line from shoulder to wrist while the tool does not move.
The arm angle is its angle about the line (positive by the right hand from shoulder to wrist) from
the reference plane. That plane contains the line and the z axis of R_0; at 0 the elbow is on the
side to which z points. Where the line is parallel to z (sine below 1e-6) the x axis replaces z.
The elbow is the foot of the shoulder on axis 4. If shoulder, elbow and wrist lie in a plane
perpendicular to axis 4, the elbow is on the line when the arm is stretched or folded; the angle is
then that of an elbow which would bend towards ``axis 4 x line``: it is continuous there.

Source: M. Shimizu et al., "Analytical inverse kinematic computation for 7-DOF redundant
manipulators with joint limits and its application to redundancy resolution", IEEE T-RO 24(5), 2008.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import Array, read_only
from .chain import motion
from .check import checked
from .loop import JointChain
from .motion import cross
from .postures import Postures
from .solver import Tolerances, postures

Flags = NDArray[np.bool_]

MOST = 8
"""Postures at one arm angle."""
MEETING = 1e-6
"""Axes that miss each other by less (m) meet: a URDF's rounded numbers."""
ALONG = 1e-6
"""Sine between the line and base z below which base x takes its place."""
STRAIGHT = 4e-7
"""Bend below which the elbow counts as stretched or folded: 1e-14 m or so."""
NO_LINE = 1e-9
"""Distance from shoulder to wrist below which there is no line [m]."""
ALIGNED = 4e-13
"""Sine between axes below which any first angle is good to 1e-12."""
_APART = 1e-6  # sine between axes below which they are no spherical joint
_FLAT = 1e-9  # difference in height along axis 4 below which shoulder and wrist are level [m]


@dataclass(frozen=True, slots=True, eq=False)
class ArmAngle:
    """A seven-joint arm with spherical shoulder and wrist.

    Shapes: shoulder, wrist (3,); points (2, 3).
    """

    chain: JointChain
    shoulder: Array
    wrist: Array
    points: Array
    flat: bool

    @property
    def method(self) -> str:
        """The family in words."""
        return "spherical shoulder, elbow, spherical wrist: arm angle"


def prepare_arm_angle(chain: JointChain) -> ArmAngle | None:
    """Find shoulder, elbow and wrist of a seven-joint arm."""
    if chain.k != 7 or chain.sigma.any():
        return None
    D = chain.D
    shoulder_height, wrist_height = _centre(D[1], D[2]), _centre(D[5], D[6])
    if shoulder_height is None or wrist_height is None:
        return None
    S, W = np.array([0.0, 0.0, shoulder_height, 1.0]), np.array([0.0, 0.0, wrist_height, 1.0])
    back = se3.inverse(D)
    # a centre seen from its outer joints lies on their axes, whatever their angles: rounding
    # across them is taken off
    on_axis = np.diag([0.0, 0.0, 1.0, 1.0])
    shoulder, before = D[0] @ on_axis @ D[1] @ S, back[3] @ on_axis @ back[2] @ S
    wrist, behind = back[7] @ on_axis @ back[6] @ W, D[4] @ on_axis @ D[5] @ W
    points = np.array([before[:3], behind[:3]])
    if min(np.hypot(points[:, 0], points[:, 1])) < MEETING:
        return None  # the elbow does not change the distance
    return ArmAngle(
        chain=chain,
        shoulder=read_only(shoulder[:3]),
        wrist=read_only(wrist[:3]),
        points=read_only(points),
        flat=bool(abs(points[1, 2] - points[0, 2]) < _FLAT),
    )


def arm_angle_of(solver: ArmAngle, q: ArrayLike) -> Array:
    """Arm angle of configurations. Shapes: q (..., 7)."""
    q = np.asarray(q, dtype=np.float64)
    frame, distance = _upper_arm(solver, q[..., 3])
    line, elbow, _ = np.moveaxis(_rotation_of_the_upper_arm(solver, q) @ frame, -1, 0)
    _, zero, normal = np.moveaxis(_reference_axes(line), -1, 0)
    psi = np.arctan2(np.sum(elbow * normal, axis=-1), np.sum(elbow * zero, axis=-1))
    return np.where((distance < NO_LINE) | (psi == -np.pi), np.abs(psi), psi)


def arm_angle_postures(
    solver: ArmAngle, U: Array, psi: Array, references: Array, tolerances: Tolerances
) -> Postures:
    """All solutions at one arm angle per pose. Shapes: U (N, 4, 4), psi (N,), references (N, 7)."""
    D, (s, w), N = solver.chain.D, solver.points, len(U)
    turned = U[:, :3, :3]
    line = U[:, :3, 3] + turned @ solver.wrist - solver.shoulder
    length = np.linalg.norm(line, axis=1)
    # the distance from shoulder to wrist gives joint 4
    X, Y = s[1] * w[0] - s[0] * w[1], s[0] * w[0] + s[1] * w[1]
    offset = 0.0 if solver.flat else w[2] - s[2]
    Z = 0.5 * (s[:2] @ s[:2] + w[:2] @ w[:2] + offset**2 - length**2)
    # an overshoot by a length moves Z by that times the distance
    q4, there, _ = _type_2(X, Y, Z, (length + 1e-9) * max(tolerances.position, 1e-9), 0.0)
    # rounding splits the double root of a stretched or folded arm, and would take it out of line
    # with an aligned shoulder or wrist
    close = there.all(axis=1) & (np.abs(np.sin(q4[:, 0] - q4[:, 1])) < 2.0 * STRAIGHT)
    q4[close] = (np.arctan2(X, Y) + np.where(Z > 0.0, 0.0, np.pi))[close, None]
    there[close, 1] = False
    # the arm angle gives the rotation of the upper arm
    no_line = length < NO_LINE
    unit = np.where(no_line[:, None], [0.0, 0.0, 1.0], line / np.maximum(length, 1e-300)[:, None])
    _, zero, normal = np.moveaxis(_reference_axes(unit), -1, 0)
    elbow = np.cos(psi)[:, None] * zero + np.sin(psi)[:, None] * normal
    axes = np.stack([unit, elbow, cross(unit, elbow)], axis=-1)
    upper = axes[:, None] @ np.swapaxes(_upper_arm(solver, q4)[0], -1, -2)
    # without a line it may point anywhere: the shoulder stays at its reference
    upper[no_line] = _rotation_of_the_upper_arm(solver, references[no_line])[:, None]
    rotations, slack = D[:, :3, :3], max(1e-9, tolerances.orientation)
    target = rotations[0].T @ upper @ rotations[3].T
    first, some, free_first = _spherical(D[1], D[2], target, slack, references[:, :1])
    first[no_line] = references[no_line, None, None, :3]
    some[no_line] = [True, False]
    target = np.swapaxes(upper @ _turns(q4) @ rotations[4], -1, -2) @ turned[:, None]
    last, others, free_last = _spherical(
        D[5], D[6], target @ rotations[7].T, slack, references[:, 4:5]
    )
    # either root of joint 4, either shoulder, either wrist
    q = np.empty((N, 2, 2, 2, 7))
    q[..., :3], q[..., 3], q[..., 4:] = first[:, :, :, None], q4[..., None, None], last[:, :, None]
    valid = there[..., None, None] & some[..., None] & others[:, :, None]
    free = np.zeros(q.shape, np.bool_)
    free[..., 0], free[..., 4] = free_first[..., None, None], free_last[..., None, None]
    free[no_line, ..., :3] = True
    valid, free = valid.reshape(N, MOST), free.reshape(N, MOST, 7)
    q = np.where(valid[..., None], q.reshape(N, MOST, 7), 0.0)
    found = checked(solver.chain, U, q, valid, tolerances, free=free & valid[..., None])
    # two solutions in one where the elbow is stretched or folded
    bend = np.where(found.valid, found.q[..., 3], np.arctan2(X, Y) + 1.0) - np.arctan2(X, Y)
    found.double[...] |= np.abs(np.sin(bend)) < STRAIGHT
    found.family[...] = found.valid
    return found


def _upper_arm(solver: ArmAngle, angle: Array) -> tuple[Array, Array]:
    """Line, elbow and their normal as columns (..., 3, 3), in the frame of joint 4; the distance.

    The elbow is the foot of the shoulder on axis 4; where it lies on the line, its side is that of
    ``axis 4 x line``.
    """
    s, w = solver.points
    c, n = np.cos(angle), np.sin(angle)
    line = np.empty((*angle.shape, 3))
    line[..., 0], line[..., 1] = c * w[0] - n * w[1] - s[0], n * w[0] + c * w[1] - s[1]
    line[..., 2] = 0.0 if solver.flat else w[2] - s[2]
    distance = np.linalg.norm(line, axis=-1)
    line /= np.maximum(distance, 1e-300)[..., None]
    foot = np.array([-s[0], -s[1], 0.0])
    if solver.flat:
        side = s[0] * line[..., 1] - s[1] * line[..., 0]
        sign = np.where(side < -STRAIGHT * np.hypot(s[0], s[1]), -1.0, 1.0)
        elbow = np.stack([-sign * line[..., 1], sign * line[..., 0], 0.0 * sign], axis=-1)
    else:
        elbow = foot - (line @ foot)[..., None] * line
        elbow /= np.linalg.norm(elbow, axis=-1)[..., None]
    return np.stack([line, elbow, cross(line, elbow)], axis=-1), distance


def _reference_axes(line: Array) -> Array:
    """Lines (..., 3), the direction of arm angle 0, their normal, as columns (..., 3, 3)."""
    x, y, z = np.moveaxis(line, -1, 0)
    above = np.stack([-z * x, -z * y, x * x + y * y], axis=-1)
    ahead = np.stack([y * y + z * z, -x * y, -x * z], axis=-1)
    zero = np.where((np.hypot(x, y) > ALONG)[..., None], above, ahead)
    zero /= np.maximum(np.linalg.norm(zero, axis=-1), 1e-300)[..., None]
    return np.stack([line, zero, cross(line, zero)], axis=-1)


def _rotation_of_the_upper_arm(solver: ArmAngle, q: Array) -> Array:
    """Rotation (..., 3, 3) of the frame of joint 4 before the joint turns."""
    R = solver.chain.D[:, :3, :3]
    return R[0] @ _turns(q[..., 0]) @ R[1] @ _turns(q[..., 1]) @ R[2] @ _turns(q[..., 2]) @ R[3]


def _turns(angle: Array) -> Array:
    """Rotations (..., 3, 3) about z."""
    return motion(0, angle)[..., :3, :3]


def _type_2(X: Array, Y: Array, Z: Array, slack: Array, zero: float) -> tuple[Array, Flags, Flags]:
    """Roots (..., 2) of ``X sin + Y cos = Z``, which of them exist, and whether any angle does."""
    rho, middle = np.hypot(X, Y), np.arctan2(X, Y)
    square = (rho - Z) * (rho + Z)
    half = np.arctan2(np.sqrt(np.maximum(square, 0.0)), Z)
    free = rho <= zero
    exists = np.abs(Z) <= np.where(free, np.maximum(zero, slack), rho + slack)
    both = exists & ~free & (square > 0.0)
    return np.stack([middle + half, middle - half], -1), np.stack([exists, both], -1), free & exists


def _spherical(
    A: Array, B: Array, M: Array, slack: float, reference: Array
) -> tuple[Array, Flags, Flags]:
    """The (at most two) ``x (..., 2, 3)`` with ``Rz(x_0) A Rz(x_1) B Rz(x_2) = M (..., 3, 3)``.

    Where first and last axis are aligned, the first angle is free and takes its reference.
    """
    A, B, m = A[:3, :3], B[:3, :3], M[..., 2]
    X, Y = A[0, 2] * m[..., 1] - A[1, 2] * m[..., 0], A[0, 2] * m[..., 0] + A[1, 2] * m[..., 1]
    x = np.empty((*X.shape, 2, 3))
    a, there, free = _type_2(X, Y, B[2, 2] - A[2, 2] * m[..., 2], np.array(slack), ALIGNED)
    x[..., 0] = np.where(free[..., None], reference[..., None], a)
    R = A.T @ _turns(-x[..., 0]) @ M[..., None, :, :]
    x[..., 1] = np.arctan2(R[..., 1, 2], R[..., 0, 2]) - np.arctan2(B[1, 2], B[0, 2])
    # the first column of B^T Rz(-b) R = Rz(c) is enough
    c = (_turns(-x[..., 1]) @ R[..., :1])[..., 0] @ B
    x[..., 2] = np.arctan2(c[..., 1], c[..., 0])
    return x, there, free


@postures.register
def _(solver: ArmAngle, U: Array, references: Array, tolerances: Tolerances) -> Postures:
    psi = arm_angle_of(solver, references)
    return arm_angle_postures(solver, U, psi, references, tolerances)


def _centre(E: Array, G: Array) -> float | None:
    """Height on the middle axis of the point where three axes meet, None if they do not.

    ``E`` and ``G`` are the constants before and behind the middle joint.
    """
    into = se3.inverse(E)
    heights = []
    for line in (into, G):
        point, direction = line[:3, 3], line[:3, 2]
        across = np.hypot(direction[0], direction[1])
        if across < _APART:
            return None
        way = -(point[0] * direction[0] + point[1] * direction[1]) / across**2
        nearest = point + way * direction
        if np.hypot(nearest[0], nearest[1]) > MEETING:
            return None
        heights.append(float(nearest[2]))
    return None if abs(heights[0] - heights[1]) > MEETING else 0.5 * sum(heights)
