"""Clearance of the links from obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...._arrays import Array, as_reals
from ....errors import InvalidValueError
from ....model import RobotModel
from ...jacobians import jacobian
from ...poses import dgm
from ..tasks import rows_of
from .criterion import checked_positive
from .shapes import Plane, Sphere

Frame = str | int | None
Segment = tuple[Frame, Frame]

_SAMPLES = 4
_STILL = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class ObstacleCriterion:
    """Half the sum of squares of how near links are to obstacles; small is good.

    Links are straight segments between the origins of frames, with a thickness. For a distance d
    between a segment and an obstacle, ``h = (influence - d) / influence`` where positive: 0 at the
    border of the neighbourhood, 1 in contact, more inside. A plane acts on the ends of the
    segments, a sphere on the nearest point of each. Segments that no joint moves do not count.

    Parameters
    ----------
    obstacles : sequence of Sphere or Plane
        At least one.
    influence : float
        Distance at which obstacles begin to matter, m.
    gain : float
        Factor of the gradient.
    radius : float
        Thickness of the links, from their segments, m.
    segments : sequence of pairs of frames, optional
        Names or numbers of frames (None is the tool) whose origins the segments join; twice the
        same frame is a point. Default every frame with its antecedent, and the tip with the tool.

    Raises
    ------
    InvalidValueError
        Something else as an obstacle, numbers out of range, segments that are no pairs.

    References
    ----------
    Seed book section 1.3.2.4; O. Khatib 1986, A. A. Maciejewski and C. A. Klein 1985.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> criterion = ObstacleCriterion([Sphere([0.5, 0.3, 0.0], 0.1)], influence=0.4)
    >>> criterion.clearance(load("planar_2r"), [0.0, 0.0])
    array(0.2)
    >>> criterion.gradient(load("planar_2r"), [0.0, 0.0]).round(6)
    array([-0.625,  0.   ])
    """

    obstacles: Sequence[Sphere | Plane]
    influence: float = 0.1
    gain: float = 1.0
    radius: float = 0.0
    segments: Sequence[Segment] | None = None

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        single = isinstance(self.obstacles, (Sphere, Plane))
        obstacles = (self.obstacles,) if single else tuple(self.obstacles)  # type: ignore[arg-type]
        if not obstacles or not all(isinstance(one, (Sphere, Plane)) for one in obstacles):
            raise InvalidValueError(
                f"obstacles: expected Sphere or Plane values, at least one, got {obstacles!r:.80}."
            )
        set_(self, "obstacles", obstacles)
        set_(self, "influence", checked_positive(self.influence, "influence"))
        set_(self, "gain", checked_positive(self.gain, "gain"))
        radius = as_reals(self.radius, "radius")
        if radius.ndim or not 0.0 <= radius < np.inf:
            raise InvalidValueError(
                f"radius: expected a number of metres that is not negative, got {self.radius!r}."
            )
        set_(self, "radius", float(radius))
        if self.segments is not None:
            pairs = tuple(
                (pair,) if pair is None or isinstance(pair, (str, int)) else tuple(pair)
                for pair in self.segments
            )
            if not pairs or any(len(pair) != 2 for pair in pairs):
                raise InvalidValueError(
                    f"segments: expected pairs of frames, at least one, got {self.segments!r:.80}; "
                    "a point is twice the same frame."
                )
            set_(self, "segments", pairs)

    def value(self, model: RobotModel, q: ArrayLike) -> Array:
        """Half the sum of the squared depths, see `Criterion.value`."""
        batch, q, _ = rows_of(model, q)
        distance, _ = self._distances(model, q)
        return np.asarray(0.5 * (self._depth(distance) ** 2).sum(axis=-1)).reshape(batch)

    def gradient(self, model: RobotModel, q: ArrayLike) -> Array:
        """Velocities away from obstacles that are near, see `Criterion.gradient`."""
        batch, q, _ = rows_of(model, q)
        distance, slope = self._distances(model, q)
        push = self._depth(distance) * (self.gain / self.influence)
        return np.einsum("kp,kpj->kj", push, slope).reshape(*batch, model.n)

    def clearance(self, model: RobotModel, q: ArrayLike) -> Array:
        """Least distance between links and obstacles, negative inside.

        Parameters
        ----------
        model : RobotModel
            The robot, n joints.
        q : array_like, shape (..., n)
            Joint variables, rad or m.

        Returns
        -------
        ndarray, shape (...)
            Metres; infinite if no joint moves any segment.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> wall = ObstacleCriterion([Plane([1.8, 0.0, 0.0], [-1.0, 0.0, 0.0])])
        >>> wall.clearance(load("planar_2r"), [[0.0, 0.0], [np.pi / 2, 0.0]]).round(12)
        array([-0.2,  1.8])
        """
        batch, q, _ = rows_of(model, q)
        distance, _ = self._distances(model, q)
        return distance.min(axis=-1, initial=np.inf).reshape(batch)

    def _depth(self, distance: Array) -> Array:
        return np.maximum(0.0, (self.influence - distance) / self.influence)

    def _distances(self, model: RobotModel, q: Array) -> tuple[Array, Array]:
        """Distances (N, p) of all pairs of link and obstacle, and their gradients (N, p, n)."""
        N = len(q)
        segments = _links(model) if self.segments is None else self.segments
        frames = list(dict.fromkeys(frame for pair in segments for frame in pair))
        # a few more configurations tell which frames any joint moves
        samples = np.random.default_rng(0).uniform(-1.0, 1.0, (_SAMPLES, model.n))
        everywhere = np.concatenate([q, samples])
        places: dict[Frame, Array] = {}
        moves: dict[Frame, Array] = {}
        moving: dict[Frame, bool] = {}
        for frame in frames:
            places[frame] = dgm(model, q, frame)[:, :3, 3]
            J = jacobian(model, everywhere, frame)[:, :3]
            moves[frame] = J[:N]
            moving[frame] = bool(np.abs(J[N:]).max(initial=0.0) > _STILL)
        segments = [pair for pair in segments if moving[pair[0]] or moving[pair[1]]]
        distances, slopes = [np.empty((N, 0))], [np.empty((N, 0, model.n))]
        for obstacle in self.obstacles:
            if isinstance(obstacle, Plane):
                near = [_from_plane(obstacle, places[frame], moves[frame])
                        for frame in frames if moving[frame]]  # fmt: skip
            else:
                near = [_from_sphere(obstacle, places[a], places[b], moves[a], moves[b])
                        for a, b in segments]  # fmt: skip
            distances += [distance[:, None] - self.radius for distance, _ in near]
            slopes += [slope[:, None] for _, slope in near]
        return np.concatenate(distances, axis=1), np.concatenate(slopes, axis=1)


def _links(model: RobotModel) -> list[Segment]:
    pairs: list[Segment] = [(int(a), j + 1) for j, a in enumerate(model.table.antecedent)]
    return [*pairs, (model.tip, None)]


def _from_plane(plane: Plane, place: Array, move: Array) -> tuple[Array, Array]:
    """Distance of a point from a plane and its gradient."""
    return (place - plane.point) @ plane.normal, plane.normal @ move


def _from_sphere(
    sphere: Sphere, a: Array, b: Array, move_a: Array, move_b: Array
) -> tuple[Array, Array]:
    """Distance of a segment from a sphere and its gradient.

    Sliding the nearest point along the segment does not change the distance, to first order.
    """
    along = b - a
    square = np.einsum("ki,ki->k", along, along)
    part = np.einsum("ki,ki->k", sphere.center - a, along)
    t = np.clip(np.divide(part, square, out=np.zeros_like(part), where=square > 0.0), 0.0, 1.0)
    apart = a + t[:, None] * along - sphere.center
    distance = np.linalg.norm(apart, axis=-1)
    # a segment through the centre: any direction across it leads out
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along), axis=-1)])
    across[square == 0.0] = (0.0, 0.0, 1.0)
    apart = np.where(distance[:, None] > 0.0, apart, across)
    unit = apart / np.linalg.norm(apart, axis=-1, keepdims=True)
    move = (1.0 - t)[:, None, None] * move_a + t[:, None, None] * move_b
    return distance - sphere.radius, np.einsum("ki,kij->kj", unit, move)
