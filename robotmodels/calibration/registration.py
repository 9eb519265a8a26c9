"""A first place of the robot in the world, where nobody knows it: by the measured positions.

Source: W. Kabsch, "A solution for the best rotation to relate two sets of vectors", Acta
Crystallographica A32, 1976.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .. import se3
from .._arrays import Array
from ..kinematics import dgm
from ..kinematics.lengths import characteristic_length
from ..model import RobotModel
from .measurements import Measurement, Pose, Position
from .robot import with_moved_tool

_NEAR = 0.2
"""Largest mean residual, in lengths of the robot, that a fit is started from as it is."""


def registered(
    model: RobotModel, measurements: Sequence[Measurement], base: bool, tool: bool
) -> RobotModel:
    """Kabsch alignment of base and tool to the measured positions."""
    usable = [m for m in measurements if isinstance(m, Pose | Position) and all(m.rows[:3])]
    usable = [m for m in usable if m.frame is None]
    if not usable or not (base or tool):
        return model
    length = characteristic_length(model)
    measured = np.concatenate([_positions(m) for m in usable])
    computed = np.concatenate([dgm(model, m.q)[:, :3, 3] for m in usable])
    poses = [m for m in usable if isinstance(m, Pose) and all(m.rows)]
    turned = [
        np.trace(dgm(model, m.q)[:, :3, :3].swapaxes(1, 2) @ m.T[:, :3, :3], axis1=1, axis2=2)
        for m in poses
    ]
    near = np.mean(np.linalg.norm(measured - computed, axis=1)) < _NEAR * length
    if near and all(np.mean(trace) > 1.0 + 2.0 * np.cos(0.5) for trace in turned):
        return model
    start = model
    if base:
        world = best_motion(computed, measured)
        start = model.with_base(world @ model.base)
    if tool and poses:
        found = np.concatenate([se3.inverse(dgm(start, m.q)) @ m.T for m in poses])
        offset = np.eye(4)
        offset[:3, :3] = _nearest_rotation(found[:, :3, :3].mean(axis=0))
        offset[:3, 3] = found[:, :3, 3].mean(axis=0)
        start = with_moved_tool(start, start.tool @ offset)
    return start


def _positions(m: Pose | Position) -> Array:
    return m.T[:, :3, 3] if isinstance(m, Pose) else m.p


def best_motion(points: Array, targets: Array) -> Array:
    """Least-squares rigid motion from points to targets (Kabsch).

    Shapes: points, targets (N, 3) -> (4, 4).
    """
    a, b = points.mean(axis=0), targets.mean(axis=0)
    T = np.eye(4)
    T[:3, :3] = _nearest_rotation((targets - b).T @ (points - a))
    T[:3, 3] = b - T[:3, :3] @ a
    return T


def _nearest_rotation(M: Array) -> Array:
    U, _, Vt = np.linalg.svd(M)
    return U @ np.diag([1.0, 1.0, float(np.sign(np.linalg.det(U @ Vt)))]) @ Vt
