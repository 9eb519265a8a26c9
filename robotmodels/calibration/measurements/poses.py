"""Measured poses: of the end in the world, between two configurations, of boards in a camera.

Parameters
----------
T : array_like, shape (N, 4, 4)
    Measured poses, metres: of the end in the world; of the end at ``q_other`` in the end at ``q``;
    of the board in the camera.
rows : six of 0 or 1
    Which of x, y, z, rx, ry, rz are measured: in axes of the world, of the end at ``q``, or of the
    camera.
q, q_other : array_like, shape (N, n)
    Readings of the joints at the two configurations of each pair, rad or m.
board : array_like of int or str, shape (N,), optional
    Label of the board; default: always the same.
known : mapping of label to array_like, shape (4, 4), optional
    Poses of boards in the world, metres.

The other arguments are those of `Measurement`.

Examples
--------
>>> q, T = np.zeros((4, 6)), np.tile(np.eye(4), (4, 1, 1))
>>> RelativePose.successive(q, T[1:]).blocks
3
>>> boards = CameraPose(q, T)
>>> len(boards.fixtures), boards.sees_base
(6, False)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from ..._arrays import Array, as_core
from ...errors import InvalidValueError, ShapeError
from ..extended_table import Frame
from . import fields
from .base import POSE_ROWS, Evaluation, Labelled, Linearised, Measurement, Row
from .fields import Given
from .motions import difference, left_jacobians, relative, widened


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Pose(Measurement):
    """Measured poses of the end in the world, all six rows or some of them.

    The world is the frame of the measuring device: where the device stands is the base Z of the
    robot, and the target on the arm is the tool E; both are parameters of the robot. A camera
    beside the robot that observes a board on its arm gives this kind.
    """

    q: Array = field(metadata=fields.READINGS)
    T: Given = field(metadata=fields.POSES)
    rows: Given = field(default=(1, 1, 1, 1, 1, 1), metadata=fields.ROWS)
    sigma: Given = field(default=None, metadata=fields.NOISE)
    covariance: Given = field(default=None, metadata=fields.NOISE)
    frame: Frame = None
    name: str = "pose"

    all_rows = POSE_ROWS

    @staticmethod
    def of_orientations(q: Array, R: ArrayLike, *arguments: Any, **options: Any) -> Orientation:
        """Measured orientations alone: an inclinometer with compass, a gyroscope, a level.

        R (N, 3, 3) are rotations from the end's axes to the world's; sigma, covariance, frame and
        name follow.
        """
        rotations = as_core(R, (3, 3), "R")
        if rotations.ndim != 3:
            raise ShapeError(f"R: expected shape (N, 3, 3), got {rotations.shape}.")
        T = np.tile(np.eye(4), (len(rotations), 1, 1))
        T[:, :3, :3] = rotations
        return Orientation(q, T, (0, 0, 0, 1, 1, 1), *arguments, **options)

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Position difference and rotation vector, world axes."""
        end = evaluations[0]
        return self.split(*difference(end, self.T), end.psi.shape[-1])


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Orientation(Pose):
    """Measured orientations of the end: a `Pose` whose default rows are rx, ry, rz."""

    rows: Given = field(default=(0, 0, 0, 1, 1, 1), metadata=fields.ROWS)
    name: str = "orientation"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RelativePose(Measurement):
    """Measured ``T(q)^-1 T(q_other)``, all six rows or some of them.

    The places of the robot and of the measuring device do not matter: increments of an inertial
    unit, of a camera on the arm that observes a scene, of a tracker that is moved between the
    pairs but not within a pair.
    """

    q: Array = field(metadata=fields.READINGS)
    q_other: Array = field(metadata=fields.READINGS)
    T: Given = field(metadata=fields.POSES)
    rows: Given = field(default=(1, 1, 1, 1, 1, 1), metadata=fields.ROWS)
    sigma: Given = field(default=None, metadata=fields.NOISE)
    covariance: Given = field(default=None, metadata=fields.NOISE)
    frame: Frame = None
    name: str = "relative pose"

    all_rows = POSE_ROWS
    in_world = False

    @classmethod
    def successive(cls, q: Any, T: Any, *arguments: Any, **options: Any) -> Self:
        """Each configuration of q (N + 1, n) relative to the previous one: T (N, 4, 4).

        rows, sigma, covariance, frame and name follow.
        """
        q = np.asarray(q)
        if len(q) < 2:
            raise InvalidValueError("q: expected two or more configurations, got one.")
        return cls(q[:-1], q[1:], T, *arguments, **options)

    @property
    def knows_length(self) -> bool:
        """A measured displacement that is not zero is a length."""
        return bool(self.T[:, :3, 3][:, self.rows[:3]].any())

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Position difference and rotation vector, axes of the end at the first configuration."""
        moved = relative(*evaluations)
        return self.split(*difference(moved, self.T), moved.psi.shape[-1])


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CameraPose(Labelled):
    """Poses of fixed boards in a camera on the arm (eye in hand), ``(Z T(q) E)^-1 B``.

    The end is the camera: its place on the arm is the tool E, a parameter of the robot. The pose B
    of a board is unknown and estimated, unless it is given (of a target without orientation, rows
    ``[1, 1, 1, 0, 0, 0]``, three coordinates). Without known boards the base is not identifiable.

    References
    ----------
    R. Y. Tsai, R. K. Lenz, IEEE Transactions on Robotics and Automation 5, 1989 (hand-eye).
    """

    q: Array = field(metadata=fields.READINGS)
    T: Given = field(metadata=fields.POSES)
    board: Given = field(default=None, metadata=fields.LABELS)
    known: Given = field(default=None, metadata=fields.targets(fields.as_known_pose))
    rows: Given = field(default=(1, 1, 1, 1, 1, 1), metadata=fields.ROWS)
    sigma: Given = field(default=None, metadata=fields.NOISE)
    covariance: Given = field(default=None, metadata=fields.NOISE)
    frame: Frame = None
    name: str = "board"

    all_rows = POSE_ROWS

    @property
    def coordinates(self) -> tuple[Row, ...]:
        """Position and rotation vector of a board, as far as the rows depend on them."""
        position = POSE_ROWS[:3] if any(self.rows[:3]) else ()
        return position + (POSE_ROWS[3:] if any(self.rows[3:]) else ())

    @property
    def knows_length(self) -> bool:
        """Positions are lengths."""
        return bool(self.T[:, :3, 3][:, self.rows[:3]].any())

    def guess(self, evaluations: Sequence[Evaluation]) -> Array:
        """Mean of the poses of each board by the nominal robot."""
        return mean_poses(self, evaluations[0].T @ self.T)

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Position difference and rotation vector, axes of the camera."""
        P = evaluations[0].psi.shape[-1]
        camera = widened(evaluations[0], len(fixtures))
        board = target_poses(self, fixtures, P)
        return self.split(*difference(relative(camera, board), self.T), P)


# --- poses as targets -----------------------------------------------------------------------------


def target_poses(kind: Labelled, fixtures: Array, parameters: int) -> Evaluation:
    """Pose of the target of each block, by parameters and fixtures. Shapes: fixtures (F,)."""
    at = [POSE_ROWS.index(row) for row in kind.coordinates]
    six = np.zeros((len(kind.unknown), 6))
    six[:, at] = fixtures.reshape(len(six), len(at))
    poses = np.tile(np.eye(4), (len(six), 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(six[:, 3:]).as_matrix()
    poses[:, :3, 3] = six[:, :3]
    by_six = np.tile(np.eye(6), (len(six), 1, 1))
    by_six[:, 3:, 3:] = left_jacobians(six[:, 3:])
    T, by_fixtures = kind.targets(poses, by_six[:, :, at], kind.known)
    return Evaluation(T, np.concatenate([np.zeros((len(T), 6, parameters)), by_fixtures], axis=-1))


def mean_poses(kind: Labelled, T: Array) -> Array:
    """Mean pose of each unknown target. Shapes: T (B, 4, 4) -> (F,)."""
    at = [POSE_ROWS.index(row) for row in kind.coordinates]

    def mean(blocks: Any) -> Array:
        turn = Rotation.from_matrix(T[blocks, :3, :3]).mean().as_rotvec()
        return np.concatenate([T[blocks, :3, 3].mean(axis=0), turn])[at]

    return kind.guess_each(mean)
