"""Boxes of the workspace that frames stay in, or keep out of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, Rebuilt, as_reals, read_only
from ...errors import InvalidValueError, ShapeError
from ...kinematics import dgm, jacobian
from ...model import RobotModel

_SOFT = 0.01  # metres; rounds the edges of a box that is kept out of, to its outside


@dataclass(frozen=True, slots=True, init=False, eq=False)
class WorkspaceBox(Rebuilt):
    """A box in the world, its faces along the axes, for the origins of some frames.

    Parameters
    ----------
    lower, upper : array_like, shape (3,)
        Corners, metres; infinite where there is no face. ``lower=(-inf, -inf, 0)`` with an infinite
        ``upper`` is all above a floor.
    frames : sequence of str or int
        Whose origins are meant: names or numbers; empty for the tool.
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
    frames: tuple[str | int, ...]
    inside: bool

    def __init__(
        self,
        lower: ArrayLike,
        upper: ArrayLike,
        frames: tuple[str | int, ...] | list[str | int] | str | int = (),
        inside: bool = True,
    ) -> None:
        low, high = as_reals(lower, "lower"), as_reals(upper, "upper")
        for name, corner in (("lower", low), ("upper", high)):
            if corner.shape != (3,):
                raise ShapeError(f"{name}: expected shape (3,), metres, got {corner.shape}.")
        if np.isnan(low).any() or np.isnan(high).any() or not (low < high).all():
            raise InvalidValueError(
                f"lower, upper: expected lower below upper on each axis, got {low} and {high}."
            )
        if not (np.isfinite(low).any() or np.isfinite(high).any()):
            raise InvalidValueError("lower, upper: a box without any face bounds nothing.")
        names = (frames,) if isinstance(frames, (str, int)) else tuple(frames)
        object.__setattr__(self, "lower", read_only(low))
        object.__setattr__(self, "upper", read_only(high))
        object.__setattr__(self, "frames", names)
        object.__setattr__(self, "inside", bool(inside))

    def clearance(self, points: Array) -> Array:
        """How far points are on the allowed side, metres; negative on the other.

        Parameters
        ----------
        points : ndarray, shape (..., 3)
            In the world, metres.

        Returns
        -------
        ndarray, shape (...)
            Distance to the nearest face from inside; the largest distance along an axis from
            outside.
        """
        depth = np.minimum(points - self.lower, self.upper - points).min(axis=-1)
        return depth if self.inside else -depth

    def slacks(self, points: Array) -> tuple[Array, Array]:
        """Smooth numbers that are positive only on the allowed side, and their gradients.

        Parameters
        ----------
        points : ndarray, shape (N, 3)
            In the world, metres.

        Returns
        -------
        values : ndarray, shape (N, F)
            Metres; of a box to stay in one for each face, else one.
        gradients : ndarray, shape (N, F, 3)
            By the point.
        """
        faces = np.flatnonzero(np.isfinite(np.r_[self.lower, self.upper]))
        normal = np.vstack((np.eye(3), -np.eye(3)))[faces]
        offset = np.r_[self.lower, -self.upper][faces]
        depth = points @ normal.T - offset
        if self.inside:
            return depth, np.broadcast_to(normal, (*depth.shape, 3))
        # the largest of -depth, from below: a point beside an edge counts as nearer than it is
        away = -depth / _SOFT
        top = away.max(axis=1, keepdims=True)
        parts = np.exp(away - top)
        total = parts.sum(axis=1, keepdims=True)
        value = _SOFT * (top + np.log(total / len(faces)))
        return value, (-(parts / total) @ normal)[:, None, :]


def frames_of(box: WorkspaceBox) -> tuple[str | int | None, ...]:
    """The frames as `dgm` takes them."""
    return box.frames or (None,)


def clearances(model: RobotModel, box: WorkspaceBox, q: Array) -> Array:
    """Clearance of every frame of a box. Shapes: q (N, n) -> (N, frames)."""
    values = [box.clearance(dgm(model, q, frame)[..., :3, 3]) for frame in frames_of(box)]
    return np.stack(values, axis=-1)


def box_slacks(model: RobotModel, box: WorkspaceBox, q: Array) -> list[tuple[Array, Array]]:
    """Smooth slacks of every frame of a box, and how they change with the joints.

    Shapes: q (N, n).
    """
    pairs = []
    for frame in frames_of(box):
        values, gradients = box.slacks(dgm(model, q, frame)[..., :3, 3])
        linear = jacobian(model, q, frame)[:, :3]
        pairs.append((values, gradients @ linear))
    return pairs
