"""Limits of an exciting trajectory: joints, torques, workspace and obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_reals, read_only
from ...errors import InvalidValueError, ShapeError
from ...geometry import REVOLUTE
from ...model import RobotModel
from ...obstacles import Box
from ...obstacles.clearance import Frame, origins
from ...obstacles.shapes import Obstacle
from ...trajectories import MotionLimits

_RISE = 0.25  # default time from rest to full velocity, s


def excitation_limits(
    model: RobotModel, limits: MotionLimits | None = None
) -> tuple[MotionLimits, tuple[str, ...]]:
    """Finite limits of every joint, and notes on assumed ones.

    Half a turn to each side (0.5 m), half a turn a second (1 m/s), full speed in 0.25 s.
    """
    given = (MotionLimits.of_model(model) if limits is None else limits).for_joints(model.n)
    turns = model.table.sigma[model.table.joint_rows] == REVOLUTE
    span, rate = np.where(turns, 2.0 * np.pi, 1.0), np.where(turns, np.pi, 1.0)
    open_low, open_high = np.isinf(given.lower), np.isinf(given.upper)
    lower = np.where(open_low, np.where(open_high, -0.5 * span, given.upper - span), given.lower)
    upper = np.where(open_high, np.where(open_low, 0.5 * span, given.lower + span), given.upper)
    finite = {"lower": lower, "upper": upper}
    notes = _assumed("position", given.lower, given.upper, lower, upper, 0.5 * (upper - lower))
    for name in ("velocity", "acceleration"):
        least, most = getattr(given, f"{name}_lower"), getattr(given, name)
        low, high = np.where(np.isinf(least), -rate, least), np.where(np.isinf(most), rate, most)
        finite |= {f"{name}_lower": low, name: high}
        notes += _assumed(name, least, most, low, high, high)
        rate = np.maximum(high, -low) / _RISE
    return replace(given, **finite), notes


def _assumed(
    name: str, least: Array, most: Array, low: Array, high: Array, taken: Array
) -> tuple[str, ...]:
    """Note on the joints whose given range is open; raises for finite ranges that are empty."""
    if (low >= high).any():
        j = int((low >= high).argmax())
        raise InvalidValueError(
            f"limits: the {name} of joint {j + 1} has no range, {low[j]:g} to {high[j]:g}: "
            "an unmoved joint is not excited. Widen it, or lock the joint in the model."
        )
    missing = np.isinf(most - least)
    if not missing.any():
        return ()
    joints = ", ".join(str(j + 1) for j in np.flatnonzero(missing))
    values = ", ".join(f"{x:.4g}" for x in np.unique(taken[missing]))
    return (f"No limit of {name} is given for joint {joints}; {values} is taken.",)


def excitation_torques(
    model: RobotModel, torque_limits: ArrayLike | None
) -> tuple[Array, tuple[str, ...]]:
    """Largest torques (n,), infinite where there is no limit, and notes."""
    massive = bool(np.any(model.inertia.values))
    if torque_limits is None:
        effort = np.asarray(model.table.effort, dtype=float)
        if massive or np.isinf(effort).all():
            return read_only(effort), ()
        return np.full(model.n, np.inf), (
            f"{model.name} has no inertial parameters, so that its limits of torque are not "
            "tested; give it rough ones with with_inertia.",
        )
    given = as_reals(torque_limits, "torque_limits")
    if given.shape not in ((), (model.n,)):
        raise ShapeError(f"torque_limits: expected shape ({model.n},), got {given.shape}.")
    if not (given > 0.0).all():
        raise InvalidValueError(f"torque_limits: expected positive numbers, got {given}.")
    if not massive and np.isfinite(given).any():
        raise InvalidValueError(
            f"torque_limits: {model.name} has no inertial parameters, which its torques need; "
            "give it some with with_inertia, or no limits of torque."
        )
    return read_only(np.broadcast_to(given, (model.n,))), ()


def origin_distances(
    model: RobotModel,
    frames: Sequence[Frame],
    workspace: Box | None,
    obstacles: Sequence[Obstacle],
    q: Array,
) -> tuple[Array, Array]:
    """Distances of origins from obstacles and the workspace's outside, and their gradients.

    Shapes: q (N, n) -> (N, p), (N, p, n).
    """
    P, J = origins(model, q, frames)
    distances, normals = [np.zeros((len(q), 0))], [np.zeros((len(q), 0, 3))]
    for body in obstacles:
        distance, _, normal = body.nearest(P, P)
        distances.append(distance)
        normals.append(normal)
    if workspace is not None:
        outside, normal = workspace.signed(P)
        distances.append(-outside)
        normals.append(-normal)
    repeated = np.tile(J, (1, len(distances) - 1, 1, 1))
    slopes = np.einsum("npc,npcj->npj", np.concatenate(normals, axis=1), repeated)
    return np.concatenate(distances, axis=1), slopes
