"""Contacts: the end meets points, poses, planes or lines, one in each configuration.

Contacts need no measuring device. Their targets are unknown and estimated, unless they are given.

Parameters
----------
point, pose, plane, line : array_like of int or str, shape (N,), optional
    Label of the target of each configuration; default: all the same.
known : mapping of label to array_like, optional
    Targets in the world: points, shape (3,), m; poses, shape (4, 4), m; planes, shape (4,), a
    normal of length 1 and an offset in m; lines, shape (2, 3), a point (m) and a direction.

The other arguments are those of `Measurement`.

Examples
--------
>>> PointContact(np.zeros((3, 6)), [0, 0, 1]).labels
('0', '1')
>>> [fixture.name for fixture in PlaneContact(np.zeros((3, 6)), name="table").fixtures]
['table:0.rx', 'table:0.ry', 'table:0.offset']
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..._arrays import Array, as_exact, read_only
from ...errors import InvalidValueError
from ..extended_table import Frame
from . import fields
from .base import POSE_ROWS, POSITION_ROWS, Contact, Evaluation, Linearised
from .fields import Given
from .motions import difference, tilt_of, tilted_axes, unit_vector, widened
from .poses import mean_poses, target_poses
from .positions import target_points


def _as_plane(value: Any, name: str) -> Array:
    plane = as_exact(value, (4,), name)
    length = float(np.linalg.norm(plane[:3]))
    if abs(length - 1.0) > 1e-6:
        raise InvalidValueError(
            f"{name}: expected a normal of length 1 and an offset in metres, got a normal of "
            f"length {length:.6g}. Divide all four numbers by it."
        )
    return read_only(np.append(unit_vector(plane[:3]), plane[3]))


def _as_line(value: Any, name: str) -> Array:
    line = as_exact(value, (2, 3), name)
    if not line[1].any():
        raise InvalidValueError(f"{name}: expected a direction in the second row, got zeros.")
    return read_only(np.array([line[0], unit_vector(line[1])]))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PointContact(Contact):
    """Touches of points by the end's origin: a ball in a socket, a tip in a centre hole."""

    q: Array = field(metadata=fields.READINGS)
    point: Given = field(default=None, metadata=fields.LABELS)
    known: Given = field(default=None, metadata=fields.targets(fields.as_point))
    sigma: Given = field(default=None, metadata=fields.NOISE)
    covariance: Given = field(default=None, metadata=fields.NOISE)
    frame: Frame = None
    name: str = "point"

    all_rows = unknowns = POSITION_ROWS
    postures = 4

    def guess(self, evaluations: Sequence[Evaluation]) -> Array:
        """Mean position of the touches of each point."""
        p = evaluations[0].T[:, :3, 3]
        return self.guess_each(lambda mine: p[mine].mean(axis=0))

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Position of the end less that of the point, world axes."""
        T, psi = evaluations[0]
        point, by_fixtures = target_points(self, fixtures)
        return Linearised(T[:, :3, 3] - point, psi[:, :3], -by_fixtures)

    @staticmethod
    def target_at(T: Array, rng: np.random.Generator) -> Array:
        """The end's origin."""
        return T[:3, 3]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FrameContact(Contact):
    """The same pose in several postures of the arm: a key in a lock, a plug in a socket.

    Unknown poses are estimated as position and rotation vector. Two postures of a pose give six
    rows more than unknowns.
    """

    q: Array = field(metadata=fields.READINGS)
    pose: Given = field(default=None, metadata=fields.LABELS)
    known: Given = field(default=None, metadata=fields.targets(fields.as_known_pose))
    sigma: Given = field(default=None, metadata=fields.NOISE)
    covariance: Given = field(default=None, metadata=fields.NOISE)
    frame: Frame = None
    name: str = "frame"

    all_rows = unknowns = POSE_ROWS
    postures = 2

    def guess(self, evaluations: Sequence[Evaluation]) -> Array:
        """Mean of the poses that the nominal robot reaches."""
        return mean_poses(self, evaluations[0].T)

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Position difference and rotation vector, world axes."""
        P = evaluations[0].psi.shape[-1]
        end = widened(evaluations[0], len(fixtures))
        return self.split(*difference(end, *target_poses(self, fixtures, P)), P)

    @staticmethod
    def target_at(T: Array, rng: np.random.Generator) -> Array:
        """The end's pose."""
        return T


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PlaneContact(Contact):
    """Touches of planes by the end's origin: a probe on a table, on the faces of a block.

    A plane is ``normal . p = offset``; the unknown normal is the world's z turned about x and y.
    Sigma includes the flatness. The offset includes the radius of a ball that touches it.

    One inclined plane touched in many postures identifies as much as touched points do; of one at
    right angles to the axis of the first joint, touch a second one that is not parallel to it.
    """

    q: Array = field(metadata=fields.READINGS)
    plane: Given = field(default=None, metadata=fields.LABELS)
    known: Given = field(default=None, metadata=fields.targets(_as_plane))
    sigma: Given = field(default=None, metadata=fields.NOISE)
    covariance: Given = field(default=None, metadata=fields.NOISE)
    frame: Frame = None
    name: str = "plane"

    all_rows = (("normal", "m"),)
    unknowns = (("rx", "rad"), ("ry", "rad"), ("offset", "m"))
    postures = 6

    def guess(self, evaluations: Sequence[Evaluation]) -> Array:
        """Mean plane of the touches of each: normal where they spread least."""
        p = evaluations[0].T[:, :3, 3]

        def plane(mine: Any) -> Array:
            mean = p[mine].mean(axis=0)
            normal = np.linalg.svd(p[mine] - mean, full_matrices=True)[2][-1]
            # the upper one of two normals: the rotation of z to the opposite is not unique
            normal = normal if normal[2] >= 0.0 else -normal
            return np.array([*tilt_of(normal), normal @ mean])

        return self.guess_each(plane)

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Distance of the end from the plane."""
        T, psi = evaluations[0]
        values = fixtures.reshape(-1, 3)
        R, by_tilt = tilted_axes(values[:, :2])
        slope = np.zeros((len(values), 4, 3))
        slope[:, :3, :2], slope[:, 3, 2] = by_tilt[:, :, 2], 1.0
        planes, by_fixtures = self.targets(
            np.column_stack([R[:, :, 2], values[:, 2]]), slope, self.known
        )
        p = np.column_stack([T[:, :3, 3], -np.ones(len(T))])
        residual = (planes * p).sum(axis=1)[:, None]
        return Linearised(residual, planes[:, None, :3] @ psi[:, :3], p[:, None] @ by_fixtures)

    @staticmethod
    def target_at(T: Array, rng: np.random.Generator) -> Array:
        """A plane with a random normal through the end's origin."""
        normal = unit_vector(rng.normal(size=3))
        return np.append(normal, normal @ T[:3, 3])


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LaserLine(Contact):
    """The end's origin on straight lines: a reflector in a laser beam, a tip on a stretched wire.

    A line is the axis z of the world rotated about x and y (rx, ry, rad) and moved along the
    rotated x and y axes (x, y, m): four coordinates of an unknown line.

    References
    ----------
    W. S. Newman et al., "Calibration of a Motoman P8 robot based on laser tracking", ICRA 2000.
    """

    q: Array = field(metadata=fields.READINGS)
    line: Given = field(default=None, metadata=fields.LABELS)
    known: Given = field(default=None, metadata=fields.targets(_as_line))
    sigma: Given = field(default=None, metadata=fields.NOISE)
    covariance: Given = field(default=None, metadata=fields.NOISE)
    frame: Frame = None
    name: str = "line"

    all_rows = (("x", "m"), ("y", "m"))
    unknowns = (("rx", "rad"), ("ry", "rad"), ("x", "m"), ("y", "m"))
    postures = 6

    def guess(self, evaluations: Sequence[Evaluation]) -> Array:
        """Mean line of the positions on each: direction where they spread most."""
        p = evaluations[0].T[:, :3, 3]

        def line(mine: Any) -> Array:
            mean = p[mine].mean(axis=0)
            direction = np.linalg.svd(p[mine] - mean, full_matrices=True)[2][0]
            return _coordinates(np.array([mean, direction]))

        return self.guess_each(line)

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Distance of the end from the line, in two directions across it."""
        T, psi = evaluations[0]
        values = fixtures.reshape(-1, 4)
        known = {label: _coordinates(line) for label, line in self.known.items()}
        four, by_values = self.targets(values, np.tile(np.eye(4), (len(values), 1, 1)), known)
        R, by_tilt = tilted_axes(four[:, :2])
        across = R[:, :, :2].swapaxes(1, 2)
        p = T[:, :3, 3]
        by_four = np.zeros((len(T), 2, 4))
        by_four[:, :, :2] = np.einsum("ni,nikt->nkt", p, by_tilt[:, :, :2])
        by_four[:, :, 2:] = -np.eye(2)
        residual = (across @ p[..., None])[..., 0] - four[:, 2:]
        return Linearised(residual, across @ psi[:, :3], by_four @ by_values)

    @staticmethod
    def target_at(T: Array, rng: np.random.Generator) -> Array:
        """A line with a random direction through the end's origin."""
        return np.array([T[:3, 3], rng.normal(size=3)])


def _coordinates(line: Array) -> Array:
    """Rotations and coordinates of a line through a point; of two directions the upper one."""
    direction = line[1] if line[1, 2] >= 0.0 else -line[1]
    tilt = tilt_of(direction)
    return np.concatenate([tilt, line[0] @ tilted_axes(tilt[None])[0][0, :, :2]])
