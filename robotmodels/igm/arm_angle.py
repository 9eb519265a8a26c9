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
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, read_only
from .check import checked
from .loop import JointChain
from .postures import Postures, no_postures
from .solver import Tolerances, postures

MOST = 8
"""Postures at one arm angle."""
MEETING = 1e-6
"""Axes that miss each other by less (m) meet: a URDF's rounded numbers. Postures are then brought
home on the chain itself."""
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
    # a centre seen from its outer joints lies on their axes, whatever their angles
    S = np.array([0.0, 0.0, shoulder_height, 1.0])
    W = np.array([0.0, 0.0, wrist_height, 1.0])
    shoulder = D[0] @ _on_axis(D[1] @ S)
    wrist = se3.inverse(D[7]) @ _on_axis(se3.inverse(D[6]) @ W)
    before = se3.inverse(D[3]) @ _on_axis(se3.inverse(D[2]) @ S)
    behind = D[4] @ _on_axis(D[5] @ W)
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
    from .kernels.arm_angle import arm_angles

    q = np.asarray(q, dtype=np.float64)
    psi = np.zeros(q.size // 7)
    flat = np.ascontiguousarray(q.reshape(-1, 7))
    arm_angles(flat, solver.chain.D, solver.shoulder, solver.points, solver.flat, psi)
    return psi.reshape(q.shape[:-1])


def arm_angle_postures(
    solver: ArmAngle, U: Array, psi: Array, references: Array, tolerances: Tolerances
) -> Postures:
    """All solutions at one arm angle per pose. Shapes: U (N, 4, 4), psi (N,), references (N, 7)."""
    from .kernels.arm_angle import STRAIGHT, arm_angle_candidates

    candidates = no_postures(len(U), MOST, 7)
    arm_angle_candidates(
        np.ascontiguousarray(U),
        np.ascontiguousarray(psi),
        np.ascontiguousarray(references),
        solver.chain.D,
        solver.shoulder,
        solver.wrist,
        solver.points,
        solver.flat,
        np.array(tolerances),
        candidates.q,
        candidates.valid,
        candidates.free,
    )
    found = checked(
        solver.chain, U, candidates.q, candidates.valid, tolerances, free=candidates.free
    )
    # two solutions in one where the elbow is stretched or folded
    s, w = solver.points
    straight = np.arctan2(s[1] * w[0] - s[0] * w[1], s[0] * w[0] + s[1] * w[1])
    bend = np.where(found.valid, found.q[..., 3], straight + 1.0) - straight
    found.double[...] |= np.abs(np.sin(bend)) < STRAIGHT
    found.family[...] = found.valid
    return found


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


def _on_axis(point: Array) -> Array:
    """The point with its rounding across the z axis taken off."""
    return np.array([0.0, 0.0, point[2], 1.0])
