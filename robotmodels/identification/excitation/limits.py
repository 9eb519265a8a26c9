"""Limits of an exciting trajectory: joints, torques, and boxes of the workspace."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, Rebuilt, as_reals, read_only
from ...errors import InvalidValueError, ShapeError
from ...geometry import REVOLUTE
from ...model import RobotModel
from ...obstacles import Box
from ...obstacles.clearance import origins
from ...trajectories import MotionLimits

_RISE = 0.25  # s: default time from rest to full velocity


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
    v, v_lower = _bounded(given.velocity, given.velocity_lower, rate)
    rise = np.maximum(v, -v_lower) / _RISE
    a, a_lower = _bounded(given.acceleration, given.acceleration_lower, rise)
    notes = []
    for name, low, high, room, taken in (
        ("position", lower, upper, given.upper - given.lower, 0.5 * (upper - lower)),
        ("velocity", v_lower, v, given.velocity - given.velocity_lower, v),
        ("acceleration", a_lower, a, given.acceleration - given.acceleration_lower, a),
    ):
        missing = np.isinf(room)
        if missing.any():
            joints = ", ".join(str(j + 1) for j in np.flatnonzero(missing))
            values = ", ".join(f"{x:.4g}" for x in np.unique(taken[missing]))
            notes.append(f"No limit of {name} is given for joint {joints}; {values} is taken.")
        if (low >= high).any():
            j = int((low >= high).argmax())
            raise InvalidValueError(
                f"limits: the {name} of joint {j + 1} has no range, {low[j]:g} to {high[j]:g}: "
                "an unmoved joint is not excited. Widen it, or lock the joint in the model."
            )
    finite = {
        "lower": lower,
        "upper": upper,
        "velocity": v,
        "velocity_lower": v_lower,
        "acceleration": a,
        "acceleration_lower": a_lower,
    }
    return replace(given, **finite), tuple(notes)


def _bounded(most: Array, least: Array, size: Array) -> tuple[Array, Array]:
    """Limits with finite values for infinite ones."""
    return np.where(np.isinf(most), size, most), np.where(np.isinf(least), -size, least)


def excitation_torques(
    model: RobotModel, torque_limits: ArrayLike | None
) -> tuple[Array, tuple[str, ...]]:
    """Greatest torques (n,), infinite where there is no limit, and notes."""
    massive = bool(np.any(model.inertia.values))
    if torque_limits is None:
        effort = np.asarray(model.table.effort, dtype=float)
        if np.isfinite(effort).any() and not massive:
            return np.full(model.n, np.inf), (
                f"{model.name} has no inertial parameters, so that its limits of torque are not "
                "tested; give it rough ones with with_inertia.",
            )
        return read_only(effort), ()
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


@dataclass(frozen=True, slots=True, eq=False)
class WorkspaceBox(Rebuilt):
    """A box in the world, its faces along the axes, for the origins of some frames.

    Parameters
    ----------
    lower, upper : array_like, shape (3,)
        Corners, metres; infinite where there is no face. ``lower=(-inf, -inf, 0)`` with an infinite
        ``upper`` is all above a floor.
    frames : sequence of str or int
        Frames (names or numbers) whose origins are bounded; empty for the tool.
    inside : bool
        Whether they stay inside, or else keep out.

    Raises
    ------
    ShapeError, InvalidValueError
        Not three numbers; NaN; ``lower`` not below ``upper``; no finite face.

    Examples
    --------
    >>> floor = WorkspaceBox([-np.inf, -np.inf, 0.0], [np.inf] * 3)
    >>> float(floor.clearance(np.array([1.0, 0.0, 0.2])))
    0.2
    """

    lower: Array
    upper: Array
    frames: Sequence[str | int] = ()
    inside: bool = True

    def __post_init__(self) -> None:
        box = Box(self.lower, self.upper)
        if (box.lower == box.upper).any():
            raise InvalidValueError(
                f"lower, upper: expected lower below upper on each axis, got {box.lower} and "
                f"{box.upper}."
            )
        frames = (self.frames,) if isinstance(self.frames, str | int) else tuple(self.frames)
        for name, value in (("lower", box.lower), ("upper", box.upper), ("frames", frames)):
            object.__setattr__(self, name, value)

    def clearance(self, points: Array) -> Array:
        """Distance of points (..., 3) from the forbidden side, metres; negative within it."""
        return self.signed(points)[0].min(axis=-1)

    def signed(self, points: Array) -> tuple[Array, Array]:
        """Distances from the forbidden side, of each face that bounds, and gradients.

        Shapes: (..., 3) -> (..., K), (..., K, 3); a box that is kept out of has one distance.
        """
        if not self.inside:
            distance, gradient = Box(self.lower, self.upper).signed(points)
            return distance[..., None], gradient[..., None, :]
        offset = np.r_[self.lower, -self.upper]
        faces = np.isfinite(offset)
        normals = np.vstack((np.eye(3), -np.eye(3)))[faces]
        distance = points @ normals.T - offset[faces]
        return distance, np.broadcast_to(normals, (*distance.shape, 3))


def box_distances(model: RobotModel, box: WorkspaceBox, q: Array) -> tuple[Array, Array]:
    """Distances of all frames of a box and their gradients. Shapes: (N, n) -> (N, p), (N, p, n)."""
    P, J = origins(model, q, box.frames or (None,))
    distance, gradient = box.signed(P)
    slope = np.einsum("nfkc,nfcj->nfkj", gradient, J)
    return distance.reshape(len(q), -1), slope.reshape(len(q), -1, model.n)
