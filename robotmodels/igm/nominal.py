"""Six-joint arms that have a closed form but for calibration errors or rounded numbers.

The axes of a calibrated wrist miss each other by a tenth of a millimetre, a URDF has 1.5708: the
closed forms do not hold for such an arm, and the elimination for general arms is ill-conditioned.
The nominal arm next to it is solved in closed form, and its solutions are refined to those of the
arm, by Newton's method and, where the arm is nearly singular, by continuation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from .. import se3
from .._arrays import Array, read_only
from .chain import canonical_frames
from .check import checked
from .closed_form import closed_form_postures
from .loop import JointChain
from .motion import random_postures, tool_poses
from .postures import Postures
from .solver import Tolerances, postures
from .structure import LoopPlan, plan_loop

OFFSET_TOLERANCE = 8e-3
"""Farthest that an axis may be moved (m) to meet another. Parameters that are each off by up to
5 mm make 7 mm where a distance between axes and a length along one come together."""
TILT_TOLERANCE = 0.014
"""Largest angle (rad) by which an axis may be turned. Two parameters (alpha, beta) that are each
off by 0.5 deg make 0.0123."""
SHARE = 0.04  # largest offset over half the length of the arm that counts as an error

REACH = 6.0  # largest error of the closest posture of the nominal arm, in deviations
NEARLY_SINGULAR = 3.0  # deviations up to which a singular value may hide more solutions
JUMP = 6.0  # deviations by which a joint of a regular solution may move
WIDE, WIDEST = 1.5, 0.4  # a curve ends where the singular value exceeds WIDE sqrt(deviation)
FAR = 6.0  # deviations in the pose beyond which a curve is left
PERTURBED = 24  # poses nearby whose solutions are starts where some may be missing
MOST = 16  # solutions of one pose
CHUNK = 1024


@dataclass(frozen=True, slots=True, eq=False)
class NominalArm:
    """Six-joint arm and the nominal arm next to it, both with lengths in units of the arm."""

    chain: JointChain
    exact: JointChain
    near: JointChain
    plan: LoopPlan
    offset: float
    tilt: float
    unit: float
    deviation: float

    @property
    def method(self) -> str:
        """The family in words."""
        return (
            f"{self.plan.family.value}, to within {1e3 * self.offset:.2g} mm and "
            f"{np.rad2deg(self.tilt):.2g} deg; solved on that arm and refined by Newton steps"
        )


def prepare_nominal(chain: JointChain) -> NominalArm | None:
    """Nominal arm with a closed form next to a six-joint arm."""
    if chain.k != 6:
        return None
    D, unit = canonical_frames(chain)
    exact = replace(chain, D=read_only(D))
    half = 0.5 * float(np.linalg.norm(D[1:, :3, 3], axis=1).sum())
    changed, offset, tilt = structured(D, chain.sigma, min(OFFSET_TOLERANCE / unit, SHARE * half))
    near = replace(chain, D=read_only(changed))
    plan = plan_loop(near) if offset or tilt else None
    if plan is None:
        return None
    q = random_postures(exact, 256, np.random.default_rng(0))
    A, B = tool_poses(near, q), tool_poses(exact, q)
    shift = np.linalg.norm(A[:, :3, 3] - B[:, :3, 3], axis=1).max()
    # |R_a - R_b| is sqrt(2) times the angle, while that is small
    turn = np.linalg.norm(A[:, :3, :3] - B[:, :3, :3], axis=(1, 2)).max() / np.sqrt(2.0)
    deviation = float(max(shift, turn))
    return NominalArm(chain, exact, near, plan, unit * offset, tilt, unit, deviation)


def structured(D: Array, sigma: NDArray[np.int64], most: float) -> tuple[Array, float, float]:
    """Constants with axes that are nearly parallel, square or meeting made so; offset and tilt.

    Shapes: D (7, 4, 4) -> (7, 4, 4). Offsets are lengths of the arm, up to ``most``.
    """
    D = np.array(D)
    offset = tilt = 0.0
    for i in range(1, 6):
        E, turning = D[i], not sigma[i - 1 : i + 1].any()
        x, y, z = E[:3, 2]
        across, apart = np.hypot(x, y), np.hypot(E[0, 3], E[1, 3])
        angle = np.arctan2(across, z)
        quarter = round(2.0 * angle / np.pi)
        turn = 0.5 * np.pi * quarter - angle
        coinciding = turning and quarter != 1 and apart <= 2.0 * most
        if across > 0.0 and turn != 0.0 and abs(turn) <= TILT_TOLERANCE and not coinciding:
            K = se3.skew(np.array([-y, x, 0.0]) / across)
            E[:3, :3] = (np.eye(3) + np.sin(turn) * K + (1.0 - np.cos(turn)) * K @ K) @ E[:3, :3]
            # rounding is removed, so that the structure is exact
            if quarter == 1:
                E[2, 2] = 0.0
            else:
                E[:2, 2], E[2, :2], E[2, 2] = 0.0, 0.0, np.sign(z)
            tilt = max(tilt, abs(turn))
        x, y, _ = E[:3, 2]
        if turning and np.hypot(x, y) > TILT_TOLERANCE:
            normal = np.array([-y, x, 0.0]) / np.hypot(x, y)
            way = float(normal @ E[:3, 3])
            if abs(way) <= most:
                E[:3, 3] -= way * normal
                offset = max(offset, abs(way))
    for i in range(1, 5):
        before, after = _height(se3.inverse(D[i])), _height(D[i + 1])
        if before is not None and after is not None and abs(after - before) <= most:
            D[i + 1][2, 3] += before - after
            offset = max(offset, abs(after - before))
    return D, offset, tilt


def _height(T: Array) -> float | None:
    """Height on the axis of a frame where the axis of the next frame meets it; None if nowhere."""
    p, z = T[:3, 3], T[:3, 2]
    across = z[0] ** 2 + z[1] ** 2
    if across < TILT_TOLERANCE**2:
        return None
    point = p - (p[0] * z[0] + p[1] * z[1]) / across * z
    return float(point[2]) if np.hypot(point[0], point[1]) < 1e-9 else None


@postures.register
def _(solver: NominalArm, U: Array, references: Array, tolerances: Tolerances) -> Postures:
    N = len(U)
    lengths = np.where(solver.chain.sigma == 1, solver.unit, 1.0)
    goals, scaled = np.array(U), np.broadcast_to(references / lengths, (N, 6))
    goals[:, :3, 3] /= solver.unit
    limits = Tolerances(tolerances.position / solver.unit, tolerances.orientation)
    q, valid = np.zeros((N, MOST, 6)), np.zeros((N, MOST), np.bool_)
    double, free = np.zeros_like(valid), np.zeros((N, MOST), np.int64)
    finite = np.flatnonzero(np.isfinite(goals).all(axis=(1, 2)))
    for start in range(0, len(finite), CHUNK):
        rows = finite[start : start + CHUNK]
        parts = _solutions(solver, goals[rows], np.ascontiguousarray(scaled[rows]), limits)
        q[rows], valid[rows], double[rows], free[rows] = parts
    joints = free[:, :, None] == np.arange(1, 7)
    return checked(solver.chain, U, lengths * q, valid, tolerances, free=joints, double=double)


def _solutions(
    solver: NominalArm, goals: Array, references: Array, tolerances: Tolerances
) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_], NDArray[np.int64]]:
    """Solutions (N, 16, 6), which rows hold one, which are double, and the free joint."""
    from . import _nominal as kernels

    N, deviation = len(goals), solver.deviation
    sigma, near, D = np.ascontiguousarray(solver.chain.sigma), solver.near.D, solver.exact.D
    candidates, there = _candidates(solver, goals, references)
    found, count, exact = np.zeros((N, MOST, 6)), np.zeros(N, np.int64), np.zeros(N, np.int64)
    double, free = np.zeros((N, MOST), np.bool_), np.zeros((N, MOST), np.int64)
    arrived, doubt = np.zeros_like(there), np.zeros(N, np.bool_)
    touch = 0.5 * min(tolerances)
    small = min(max(NEARLY_SINGULAR * deviation, 4.0 * touch, 1e-6), 0.3)
    limits = np.array([max(REACH * deviation, 1e-7), min(JUMP * deviation, 0.2), small])
    kernels.refined(
        sigma, near, D, goals, candidates, there, limits, found, count, exact, arrived, doubt
    )
    most = max(FAR * deviation, 2.0 * touch)
    widest = min(max(WIDE * np.sqrt(deviation), 1e-3), WIDEST)
    limits = np.array([small, widest, most, touch])

    def complete(rows: NDArray[np.int64], starts: Array, usable: NDArray[np.bool_]) -> None:
        part = [np.ascontiguousarray(a[rows]) for a in (references, found, count, double, free)]
        kernels.continued(sigma, D, goals[rows], starts, usable, part[0], limits, *part[1:])
        found[rows], count[rows], double[rows], free[rows] = part[1:]

    own = there.sum(axis=1)
    doubt |= own < MOST // 2
    rows = np.flatnonzero(doubt)
    if rows.size:
        starts = np.concatenate([candidates[rows], references[rows, None]], axis=1)
        usable = np.concatenate([(there & ~arrived)[rows], np.ones((rows.size, 1), np.bool_)], 1)
        complete(rows, starts, usable)
    odd = (count + double.sum(axis=1)) % 2 == 1
    unsure = doubt & (odd | (np.minimum(count, exact) < own) | (own < 8)) & ~free.any(axis=1)
    rows = np.flatnonzero(unsure)
    if rows.size:
        shifts = _shifts(deviation)
        perturbed = (goals[rows, None] @ shifts).reshape(-1, 4, 4)
        starts, usable = _candidates(solver, perturbed, np.repeat(references[rows], PERTURBED, 0))
        usable = usable.reshape(rows.size, PERTURBED, -1)
        # at the edge of the nominal arm's reach, poses beyond it have another number of solutions
        edge = ~(odd | (np.minimum(count, exact) < own))[rows]
        usable[edge[:, None] & (usable.sum(axis=2) == own[rows, None])] = False
        complete(rows, starts.reshape(rows.size, -1, 6), usable.reshape(rows.size, -1))
    return found, np.arange(MOST) < count[:, None], double, free


def _candidates(
    solver: NominalArm, goals: Array, references: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Solutions of the nominal arm (N, 8, 6), or its best approach, and which rows hold one."""
    slack = max(3.0 * solver.deviation, 1e-9)
    return closed_form_postures(solver.plan, solver.near, goals, references, slack, np.inf)[:2]


def _shifts(deviation: float) -> Array:
    """Small motions of the tool, some of which bring it into the reach of the nominal arm."""
    size = deviation * np.where(np.arange(PERTURBED) % 2 == 0, 1.0, 2.0)[:, None]
    rng = np.random.default_rng(0)
    shifts = np.tile(np.eye(4), (PERTURBED, 1, 1))
    shifts[:, :3, :3] = Rotation.from_rotvec(size * rng.normal(size=(PERTURBED, 3))).as_matrix()
    shifts[:, :3, 3] = size * rng.normal(size=(PERTURBED, 3))
    return shifts
