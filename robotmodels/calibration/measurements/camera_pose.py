"""A board that stands still, seen by a camera that the arm carries (eye in hand)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array
from ..extended_table import Frame
from .labelled import Labelled, Labels, as_known, as_labels
from .labelled_poses import as_known_pose, guessed_poses, labelled_poses, pose_fixtures
from .measurement import POSE_AXES, POSE_UNITS, Evaluation, Fixture, Linearised, View, remade
from .moving_poses import difference, motionless, relative, widened
from .noise import as_noise, part_of_noise
from .readings import as_measured_poses, as_readings, as_rows


@dataclass(frozen=True, slots=True, init=False, eq=False)
class CameraPose(Labelled):
    """Poses of boards in the frame of the end, ``(Z T(q) E)^-1 B``.

    The end is the camera: where it sits on the arm is the tool E, a parameter of the robot. Where
    a board stands, B, is unknown and estimated along, unless it is given. Without known boards
    nothing tells where the robot stands. A camera beside the robot that sees a board on the arm
    measures a `Pose` instead.

    Parameters
    ----------
    q : array_like, shape (N, n)
        Readings of the joints, rad or m.
    T : array_like, shape (N, 4, 4)
        Measured poses of the board in the camera, metres.
    board : array_like of int or str, shape (N,), optional
        Which board is seen; default: always the same.
    known : mapping of label to pose, shape (4, 4), optional
        Boards whose poses in the world are known, metres.
    rows : six of 0 or 1
        Which of x, y, z, rx, ry, rz (axes of the camera) are measured; ``[1, 1, 1, 0, 0, 0]`` is
        a target without orientation, of which three coordinates are estimated.
    sigma : array_like, shape (), (k,) or (N, k), optional
        Standard deviations, m and rad; default: estimated from the data.
    covariance : array_like, shape (k, k) or (N, k, k), optional
        Instead of sigma: a camera is worse along its axis.
    frame : str, int or None
        The camera; None is the tool.
    name : str
        In reports, and in front of the labels: the same name and label in two measurements is the
        same board.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        Shapes that do not fit, NaN, poses that are none, no row asked, a known board that is not
        seen.

    References
    ----------
    Seed book section 1.4.4; R. Y. Tsai, R. K. Lenz, "A new technique for fully autonomous and
    efficient 3D robotics hand/eye calibration", IEEE Transactions on Robotics and Automation 5,
    1989.

    Examples
    --------
    >>> seen = CameraPose(np.zeros((5, 6)), np.tile(np.eye(4), (5, 1, 1)))
    >>> len(seen.fixtures), seen.sees_base
    (6, False)
    """

    q: Array
    T: Array
    board: tuple[str, ...]
    known: Mapping[str, Array]
    rows: tuple[bool, ...]
    sigma: Array | None
    covariance: Array | None
    frame: Frame
    name: str

    def __init__(
        self,
        q: ArrayLike,
        T: Any,
        board: Labels | None = None,
        known: Mapping[int | str, Any] | None = None,
        rows: Sequence[int | bool] = (1, 1, 1, 1, 1, 1),
        sigma: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        frame: Frame = None,
        name: str = "board",
    ) -> None:
        set_ = object.__setattr__
        set_(self, "q", as_readings(q))
        set_(self, "T", as_measured_poses(T, len(self.q)))
        labels = as_labels(board, len(self.q), "board")
        set_(self, "board", labels)
        set_(self, "known", as_known(known, labels, "board", as_known_pose))
        asked = as_rows(rows, 6)
        set_(self, "rows", asked)
        noise = as_noise(sigma, covariance, len(self.q), sum(asked))
        set_(self, "sigma", noise[0])
        set_(self, "covariance", noise[1])
        set_(self, "frame", frame)
        set_(self, "name", name)

    @property
    def label(self) -> tuple[str, ...]:
        """Board that is seen in each block."""
        return self.board

    @property
    def blocks(self) -> int:
        """Number of measured poses."""
        return len(self.q)

    @property
    def axes(self) -> tuple[str, ...]:
        """Labels of the rows that are measured."""
        return tuple(a for a, asked in zip(POSE_AXES, self.rows, strict=True) if asked)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the rows that are measured."""
        return tuple(u for u, asked in zip(POSE_UNITS, self.rows, strict=True) if asked)

    @property
    def views(self) -> tuple[View, ...]:
        """The camera at every configuration."""
        return (View(self.frame, self.q),)

    @property
    def _unknown_numbers(self) -> tuple[int, ...]:
        """Which of the six numbers of a board are seen at all."""
        position = (0, 1, 2) if any(self.rows[:3]) else ()
        return position + ((3, 4, 5) if any(self.rows[3:]) else ())

    @property
    def fixtures(self) -> tuple[Fixture, ...]:
        """Position and rotation vector of each unknown board, as far as they are seen."""
        return pose_fixtures(self, self._unknown_numbers)

    @property
    def knows_length(self) -> bool:
        """Positions are lengths."""
        return bool(self.T[:, :3, 3][:, self.rows[:3]].any())

    @property
    def sees_base(self) -> bool:
        """Only through boards that are known in the world."""
        return bool(self.known)

    def guess(self, evaluations: Sequence[Evaluation]) -> Array | None:
        """Mean of the poses at which the nominal robot sees each board."""
        return guessed_poses(self, self._unknown_numbers, evaluations[0].T @ self.T)

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Position difference and rotation vector, axes of the camera."""
        P = evaluations[0].psi.shape[-1]
        camera = widened(evaluations[0], len(fixtures))
        board = labelled_poses(self, self._unknown_numbers, fixtures, P)
        columns = P + len(fixtures)
        residual, J = difference(relative(camera, board), motionless(self.T, columns))
        asked = np.flatnonzero(self.rows)
        return Linearised(residual[:, asked], J[:, asked, :P], J[:, asked, P:])

    def with_configurations(self, configurations: Sequence[Array]) -> Self:
        """The same poses at other readings."""
        (q,) = configurations
        return remade(self, q=q)

    def subset(self, blocks: NDArray[np.int64]) -> Self:
        """Some of the poses."""
        sigma, covariance = part_of_noise(self, blocks)
        board = tuple(self.board[b] for b in blocks)
        return remade(
            self, blocks, q=self.q[blocks], T=self.T[blocks], board=board,
            known=self.known_of(board), sigma=sigma, covariance=covariance,
        )  # fmt: skip
