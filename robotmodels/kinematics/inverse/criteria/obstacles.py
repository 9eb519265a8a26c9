"""Clearance of the links from obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...._arrays import Array
from ....errors import InvalidValueError
from ....model import RobotModel
from ....obstacles import Plane, clearance
from ....obstacles.clearance import (
    Segment,
    checked_obstacles,
    checked_segments,
    link_distances,
    links,
)
from ....obstacles.shapes import Obstacle, checked_length
from ..tasks import rows_of
from .criterion import checked_positive


@dataclass(frozen=True, slots=True, eq=False)
class ObstacleCriterion:
    """Half the sum of squares of how near links are to obstacles; small is good.

    Links are straight segments between the origins of frames, with a radius. For a distance d
    between a segment and an obstacle, ``h = (influence - d) / influence`` where positive: 0 at the
    border of the neighbourhood, 1 in contact, more inside. A plane acts on the ends of the
    segments, a body on the nearest point of each. What no joint moves does not count.

    Parameters
    ----------
    obstacles : Sphere, Box, Plane, Capsule of `obstacles`, or sequence of these
        At least one.
    influence : float
        Distance at which obstacles begin to matter, m.
    gain : float
        Factor of the gradient.
    radius : float
        Of the links, m.
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
    >>> from robotmodels.obstacles import Sphere
    >>> from robotmodels.robots import load
    >>> criterion = ObstacleCriterion([Sphere([0.5, 0.3, 0.0], 0.1)], influence=0.4)
    >>> criterion.clearance(load("planar_2r"), [0.0, 0.0])
    array(0.2)
    >>> criterion.gradient(load("planar_2r"), [0.0, 0.0]).round(6)
    array([-0.625,  0.   ])
    """

    obstacles: Sequence[Obstacle]
    influence: float = 0.1
    gain: float = 1.0
    radius: float = 0.0
    segments: Sequence[Segment] | None = None

    def __post_init__(self) -> None:
        bodies = checked_obstacles(self.obstacles)
        if not bodies:
            raise InvalidValueError("obstacles: expected at least one, got none.")
        for name, value in (
            ("obstacles", bodies),
            ("influence", checked_positive(self.influence, "influence")),
            ("gain", checked_positive(self.gain, "gain")),
            ("radius", checked_length(self.radius, "radius")),
            ("segments", checked_segments(self.segments)),
        ):
            object.__setattr__(self, name, value)

    def value(self, model: RobotModel, q: ArrayLike) -> Array:
        """Half the sum of the squared depths, see `Criterion.value`."""
        batch, q, _ = rows_of(model, q)
        depth, _ = self._depths(model, q)
        return np.asarray(0.5 * (depth**2).sum(axis=-1)).reshape(batch)

    def gradient(self, model: RobotModel, q: ArrayLike) -> Array:
        """Velocities away from obstacles that are near, see `Criterion.gradient`."""
        batch, q, _ = rows_of(model, q)
        depth, slope = self._depths(model, q)
        push = depth * (self.gain / self.influence)
        return np.einsum("kp,kpj->kj", push, slope).reshape(*batch, model.n)

    def clearance(self, model: RobotModel, q: ArrayLike) -> Array:
        """Least distance between links and obstacles, see `obstacles.clearance`.

        Parameters
        ----------
        model : RobotModel
            The robot, n joints.
        q : array_like, shape (..., n)
            Joint variables, rad or m.

        Returns
        -------
        ndarray, shape (...)
            Metres, negative inside; infinite if no joint moves any segment.
        """
        return clearance(model, q, self.obstacles, self.radius, segments=self.segments)

    def _depths(self, model: RobotModel, q: Array) -> tuple[Array, Array]:
        """Depths in the neighbourhood and gradients of the distances, of points for planes."""
        segments = links(model) if self.segments is None else self.segments
        points = [(frame, frame) for frame in dict.fromkeys(f for pair in segments for f in pair)]
        planes = [body for body in self.obstacles if isinstance(body, Plane)]
        bodies = [body for body in self.obstacles if not isinstance(body, Plane)]
        found = [
            link_distances(model, q, part, self.radius, pairs)
            for part, pairs in ((planes, points), (bodies, segments))
            if part
        ]
        distance, slope = (np.concatenate(part, axis=1) for part in zip(*found, strict=True))
        return np.maximum(0.0, (self.influence - distance) / self.influence), slope
