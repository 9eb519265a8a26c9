"""Links: two ends of one robot with a common object, and known distances of touched points.

Parameters
----------
frame, frame_other : str, int or None
    The two ends; None is the tool.
link : array_like of int or str, shape (N,), optional
    Label of the object; default: always the same.
known : mapping of label to array_like, shape (4, 4), optional
    Poses of the other end in the first one, metres.
orientation : bool
    Whether the object holds the orientation as well: 6 rows, else 3.
point, other : str
    Points of `PointContact` as ``name:label``, such as ``"point:0"`` and ``"point:1"``.
length : float
    Their distance, metres.
sigma : float
    Standard deviation of the length, m; default 0.1 mm, which a calliper or a drilled plate
    reaches.

The other arguments are those of `Measurement`.

Examples
--------
>>> KnownDistance("point:0", "point:1", 0.05).fixtures[0].name
'point:0.x'
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..._arrays import Array, as_floats
from ...errors import InvalidValueError
from ..extended_table import Frame
from . import fields
from .base import POSE_ROWS, Evaluation, Fixture, Labelled, Linearised, Measurement, Row, View
from .fields import Given
from .motions import difference, product, relative, widened
from .poses import mean_poses, target_poses


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LinkedFrames(Labelled):
    """Two ends of a tree hold the same object: ``T(q) X = T_other(q)`` with a constant X.

    X, the pose of the other end in this one, is estimated unless it is given. With
    ``orientation=False`` they share a point only. Two robots become one tree by `combine_arms`.
    """

    q: Array = field(metadata=fields.READINGS)
    frame: Frame
    frame_other: Frame
    link: Given = field(default=None, metadata=fields.LABELS)
    known: Given = field(default=None, metadata=fields.targets(fields.as_known_pose))
    orientation: bool = True
    sigma: Given = field(default=None, metadata=fields.NOISE)
    covariance: Given = field(default=None, metadata=fields.NOISE)
    name: str = "link"

    all_rows = POSE_ROWS
    is_constraint = True
    in_world = False

    def _check(self) -> None:
        if self.frame == self.frame_other:
            raise InvalidValueError(f"frame_other: expected an end other than {self.frame!r}.")

    @property
    def row_numbers(self) -> tuple[int, ...]:
        """All six, or those of the position."""
        return tuple(range(6 if self.orientation else 3))

    @property
    def coordinates(self) -> tuple[Row, ...]:
        """Position of X, and rotation vector if the orientation is held."""
        return POSE_ROWS[: len(self.row_numbers)]

    @property
    def views(self) -> tuple[View, ...]:
        """Both ends at the same configurations."""
        return (View(self.frame, self.q), View(self.frame_other, self.q))

    @property
    def knows_length(self) -> bool:
        """A known X whose origin is not that of the end is a length."""
        return any(bool(X[:3, 3].any()) for X in self.known.values())

    def guess(self, evaluations: Sequence[Evaluation]) -> Array:
        """Mean pose of the other end in this one."""
        return mean_poses(self, relative(*evaluations).T)

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Position difference and rotation vector of the other end, world axes."""
        P = evaluations[0].psi.shape[-1]
        end, other = (widened(e, len(fixtures)) for e in evaluations)
        return self.split(*difference(other, *product(end, target_poses(self, fixtures, P))), P)


@dataclass(frozen=True, slots=True, eq=False)
class KnownDistance(Measurement):
    """The distance between two unknown points of `PointContact`, known from elsewhere.

    Contacts alone do not determine the scale of a robot; this is the missing length.
    """

    point: str
    other: str
    length: float
    sigma: Given = field(default=1e-4, metadata=fields.NOISE)
    covariance: Given = field(default=None, metadata=fields.NOISE)
    name: str = "known distance"

    all_rows = (("length", "m"),)
    in_world = False

    def _check(self) -> None:
        if self.point == self.other:
            raise InvalidValueError(f"other: expected a point other than {self.point!r}.")
        length = float(as_floats(self.length, "length"))
        if length <= 0.0:
            raise InvalidValueError(f"length: expected a positive length in metres, got {length}.")

    @property
    def fixtures(self) -> tuple[Fixture, ...]:
        """Coordinates of the two points."""
        return tuple(Fixture(f"{p}.{c}", "m") for p in (self.point, self.other) for c in "xyz")

    def guess(self, evaluations: Sequence[Evaluation]) -> None:
        """The contacts determine the points."""

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Distance of the two points less the known length."""
        vector = fixtures[:3] - fixtures[3:]
        length = float(np.linalg.norm(vector))
        along = vector / length if length > 0.0 else np.zeros(3)
        row = np.concatenate([along, -along])[None, None]
        return Linearised(np.array([[length - self.length]]), np.zeros((1, 1, 0)), row)
