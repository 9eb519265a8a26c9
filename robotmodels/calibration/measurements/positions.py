"""Measured positions and lengths: points, coordinates along an axis, distances.

Parameters
----------
p : array_like, shape (N, 3)
    Measured positions in the world, metres.
rows : three of 0 or 1
    Which of x, y, z are measured.
value : array_like, shape (N,)
    Readings of a gauge, metres.
axis : array_like, shape (3,)
    Direction in the world in which the reading grows; its length does not matter.
zero : float, optional
    Coordinate at which the gauge reads 0, metres; default: unknown and estimated.
axis_is_known : bool
    False: the axis is estimated, as two rotations of the given one.
length : array_like, shape (N,) or ()
    Measured lengths, metres; one number for a bar that stays the same.
q_other : array_like, shape (N, n), optional
    Readings at the other position.
pivot : array_like of int or str, shape (N,), optional
    Label of the pivot; default: all from the same. Not with ``q_other``.
known : mapping of label to array_like, shape (3,), optional
    Positions of pivots in the world, metres.
offset : bool
    Whether a constant is to be subtracted from the lengths, one for each pivot, unknown and
    estimated: the dead path of an interferometer that counts from where it was set to zero.

The other arguments are those of `Measurement`.

Examples
--------
>>> Position(np.zeros((3, 6)), np.zeros((3, 3)), rows=[1, 1, 0]).axes
('x', 'y')
>>> [fixture.name for fixture in Distance(np.zeros((3, 6)), 0.3).fixtures]
['pivot:0.x', 'pivot:0.y', 'pivot:0.z']
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from ..._arrays import Array, as_exact, read_only
from ...errors import InvalidValueError
from ..extended_table import Frame
from . import fields
from .base import POSITION_ROWS, Evaluation, Fixture, Labelled, Linearised, Measurement
from .fields import Given
from .motions import tilt_of, tilted_axes, unit_vector


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Position(Measurement):
    """Measured positions of the end's origin: laser tracker, camera, measuring machine.

    Where the device stands is the base Z of the robot, and the target's place on the arm is the
    tool E: both are parameters of the robot.
    """

    q: Array = field(metadata=fields.READINGS)
    p: Given = field(metadata=fields.POINTS)
    rows: Given = field(default=(1, 1, 1), metadata=fields.ROWS)
    sigma: Given = field(default=None, metadata=fields.NOISE)
    covariance: Given = field(default=None, metadata=fields.NOISE)
    frame: Frame = None
    name: str = "position"

    all_rows = POSITION_ROWS

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Position difference, world axes."""
        T, psi = evaluations[0]
        return self.split(T[:, :3, 3] - self.p, psi[:, :3], psi.shape[-1])


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class AxisPosition(Measurement):
    """Readings ``axis . p - zero`` of a gauge with a fixed axis: dial gauge, linear encoder, laser.

    One gauge a measurement; give several of them different names. A cable that is drawn from a
    drum measures a `Distance`.
    """

    q: Array = field(metadata=fields.READINGS)
    value: Given = field(metadata=fields.lengths("value"))
    axis: Given = field(metadata={"check": lambda m, name, value: _as_direction(value, name)})
    zero: float | None = None
    axis_is_known: bool = True
    sigma: Given = field(default=None, metadata=fields.NOISE)
    covariance: Given = field(default=None, metadata=fields.NOISE)
    frame: Frame = None
    name: str = "gauge"

    all_rows = (("along", "m"),)

    def _check(self) -> None:
        if self.zero is not None:
            as_exact(self.zero, (), "zero")

    @property
    def fixtures(self) -> tuple[Fixture, ...]:
        """Two rotations of an unknown axis, and an unknown zero."""
        turns = () if self.axis_is_known else (("turn_1", "rad"), ("turn_2", "rad"))
        zero = () if self.zero is not None else (("zero", "m"),)
        return tuple(Fixture(f"{self.name}.{word}", unit) for word, unit in (*turns, *zero))

    @property
    def scale_centres(self) -> tuple[Array, Array]:
        """The coordinate of the end along the axis, if axis and zero are known."""
        if self.zero is None or not self.axis_is_known:
            return np.zeros((0, 3)), np.zeros(0)
        return np.tile(self.axis, (self.blocks, 1)), self.value + self.zero

    @property
    def knows_length(self) -> bool:
        """Readings that differ are lengths; a gauge with equal readings is a touched plane."""
        return bool(np.ptp(self.value) > 0.0)

    @property
    def sees_base(self) -> bool:
        """Unless neither the axis nor the zero is known in the world."""
        return self.axis_is_known or self.zero is not None

    def guess(self, evaluations: Sequence[Evaluation]) -> Array:
        """The given axis, and the mean zero."""
        turns = [] if self.axis_is_known else [0.0, 0.0]
        zero = np.mean(evaluations[0].T[:, :3, 3] @ self.axis - self.value)
        return np.array([*turns, zero] if self.zero is None else turns)

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Coordinate along the axis less the reading."""
        T, psi = evaluations[0]
        p = T[:, :3, 3]
        by_fixtures = np.zeros((len(T), 1, len(fixtures)))
        axis, zero = self.axis, self.zero
        if not self.axis_is_known:
            given = _axes_along(self.axis)
            R, by_turn = tilted_axes(fixtures[None, :2])
            axis = given @ R[0, :, 2]
            by_fixtures[:, 0, :2] = p @ (given @ by_turn[0, :, 2])
        if zero is None:
            zero = fixtures[-1]
            by_fixtures[:, 0, -1] = -1.0
        return Linearised(
            (p @ axis - zero - self.value)[:, None], axis @ psi[:, None, :3], by_fixtures
        )


def _as_direction(value: Any, name: str) -> Array:
    direction = as_exact(value, (3,), name)
    if not direction.any():
        raise InvalidValueError(f"{name}: expected a direction, got zeros.")
    return read_only(unit_vector(direction))


def _axes_along(direction: Array) -> Array:
    """Right-handed axes, z along a direction."""
    if direction[2] < 0.0:  # the rotation is not unique near the opposite of z
        return _axes_along(-direction) @ np.diag([1.0, -1.0, -1.0])
    return tilted_axes(tilt_of(direction)[None])[0][0]


# --- distances ------------------------------------------------------------------------------------

_EITHER = (
    "Give q_other (lengths between two positions) or pivots (lengths from fixed points), not both."
)


def _as_pivots(m: Distance, name: str, value: Any) -> tuple[str, ...] | None:
    if m.q_other is None:
        return fields.as_labels(m, name, value)
    if value is not None:
        raise InvalidValueError(_EITHER)
    return None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Distance(Labelled):
    """Measured lengths between the end and a pivot, or between two positions of the end.

    With ``q_other`` each length is that from the end at ``q`` to the end at ``q_other``. Without,
    it is that from a pivot: the fixed ball of a ball-bar, the drum of a cable, the head of an
    interferometer. Pivots are unknown and estimated, unless they are given. If all positions
    about an unknown pivot lie in a plane, it may be on either side, and the lower side is taken.
    """

    q: Array = field(metadata=fields.READINGS)
    length: Given = field(metadata=fields.lengths("distance", "length"))
    q_other: Given = field(default=None, metadata=fields.READINGS)
    pivot: Given = field(default=None, metadata={**fields.LABELS, "check": _as_pivots})
    known: Given = field(default=None, metadata=fields.targets(fields.as_point))
    offset: bool = False
    sigma: Given = field(default=None, metadata=fields.NOISE)
    covariance: Given = field(default=None, metadata=fields.NOISE)
    frame: Frame = None
    name: str = "pivot"

    all_rows = (("length", "m"),)
    unknowns = POSITION_ROWS

    def _check(self) -> None:
        if not self.offset and not (self.length > 0.0).all():
            raise InvalidValueError(
                f"length: expected positive lengths in metres, got {self.length.min():.6g}. "
                "Lengths measured from an unknown zero need offset=True."
            )
        if self.pivot is None and self.known:
            raise InvalidValueError(_EITHER)

    @property
    def fixtures(self) -> tuple[Fixture, ...]:
        """Coordinates of the unknown pivots, then offsets."""
        names = [f"{self.name}:{label}" for label in self.unknown]
        offsets = [f"{self.name}:{label}.offset" for label in self.labels if self.offset]
        return tuple(
            Fixture(name, "m") for name in (*(f"{n}.{c}" for n in names for c in "xyz"), *offsets)
        )

    @property
    def scale_centres(self) -> tuple[Array, Array]:
        """The known pivots."""
        pivots = np.array(list(self.known.values())).reshape(-1)
        return np.tile(np.eye(3), (len(self.known), 1)), pivots

    @property
    def knows_length(self) -> bool:
        """Lengths are measured; with unknown offsets, if those of a pivot differ."""
        group = self.groups
        return not self.offset or any(np.ptp(self.length[group == g]) > 0.0 for g in set(group))

    def guess(self, evaluations: Sequence[Evaluation]) -> Array:
        """Centres of the spheres on which the nominal positions lie, and mean offsets."""
        p = evaluations[0].T[:, :3, 3]
        points = self.guess_each(lambda mine: pivot_of(p[mine], self.length[mine], self.offset))
        if not self.offset:
            return points
        missing = self.length - np.linalg.norm(self._vectors(evaluations, points)[0], axis=1)
        means = [missing[self.groups == g].mean() for g in range(len(self.labels))]
        return np.concatenate([points, means])

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Predicted length less the measured one."""
        F = 3 * len(self.unknown)
        vector, by_points = self._vectors(evaluations, fixtures[:F])
        length = np.linalg.norm(vector, axis=1)
        # a length of zero has no direction; its derivative is taken as zero
        along = (vector / np.where(length > 0.0, length, 1.0)[:, None])[:, None]
        psi = evaluations[0].psi[:, :3]
        if self.q_other is not None:
            psi = psi - evaluations[1].psi[:, :3]
        by_fixtures = np.zeros((self.blocks, 1, len(fixtures)))
        by_fixtures[..., :F] = -along @ by_points
        residual = length - self.length
        if self.offset:
            residual = residual + fixtures[F + self.groups]
            by_fixtures[np.arange(self.blocks), 0, F + self.groups] = 1.0
        return Linearised(residual[:, None], along @ psi, by_fixtures)

    def _vectors(self, evaluations: Sequence[Evaluation], points: Array) -> tuple[Array, Array]:
        """Vectors from pivots or other positions to the end; derivative of the pivots."""
        p = evaluations[0].T[:, :3, 3]
        if self.q_other is not None:
            return p - evaluations[1].T[:, :3, 3], np.zeros((self.blocks, 3, 0))
        centre, by_points = target_points(self, points)
        return p - centre, by_points


def target_points(kind: Labelled, fixtures: Array) -> tuple[Array, Array]:
    """Position of the target of each block. Shapes: fixtures (F,) -> (B, 3), (B, 3, F)."""
    points = fixtures.reshape(-1, 3)
    return kind.targets(points, np.tile(np.eye(3), (len(points), 1, 1)), kind.known)


def pivot_of(p: Array, length: Array, offset: bool) -> Array:
    """Least-squares centre of positions at measured distances: p (N, 3), length (N,) -> (3,)."""
    mean = p.mean(axis=0)
    x = p - mean
    size = float(np.abs(x).max()) or 1.0
    # |x - c|^2 = (length - o)^2 is linear in c, o and o^2 - c.c
    square = (x**2).sum(axis=1) - length**2
    A = np.column_stack([2.0 * x / size, np.ones(len(x)), -2.0 * offset * length / size])
    _, spread, axes = np.linalg.svd(x, full_matrices=True)
    # positions across whose plane the spread is below 1 % of that in it count as coplanar
    flat = np.append(spread, np.zeros(3))[2] < 1e-2 * spread[0]
    c = np.linalg.lstsq(A, square / size**2, rcond=1e-2 if flat else 1e-9)[0][:3] * size
    if flat:
        c -= axes[2] * (axes[2] @ c)
        if not offset:
            height = float(np.mean(length**2 - ((x - c) ** 2).sum(axis=1)))
            down = axes[2] if axes[2, 2] <= 0.0 else -axes[2]
            c += np.sqrt(max(height, 0.0)) * down

    def error(centre: Array) -> Array:
        far = np.linalg.norm(x - centre, axis=1) - length
        return far - far.mean() if offset else far

    return mean + least_squares(error, c, "3-point", x_scale=size, xtol=1e-12, ftol=1e-12).x
