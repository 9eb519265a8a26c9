"""A pose of the end, or its orientation alone, measured from outside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, as_core
from ...errors import ShapeError
from ..extended_table import Frame
from .measurement import POSE_AXES, POSE_UNITS, Evaluation, Linearised, Measurement, View, remade
from .noise import as_noise, part_of_noise
from .readings import as_measured_poses, as_readings, as_rows
from .rotation_vectors import inverse_left_jacobians, rotation_errors


@dataclass(frozen=True, slots=True, init=False, eq=False)
class Pose(Measurement):
    """Measured poses of the end, all six rows or some of them.

    Where the measuring device stands is the base Z of the robot (the world is the device's
    frame), and the target on the arm is the tool E: both are parameters of the robot. So a camera
    that stands beside the robot and sees a board on its arm is this kind, with the camera's frame
    as world; one that the robot carries is `CameraPose`.

    Parameters
    ----------
    q : array_like, shape (N, n)
        Readings of the joints, rad or m.
    T : array_like, shape (N, 4, 4)
        Measured poses, metres.
    rows : six of 0 or 1
        Which of x, y, z, rx, ry, rz (world axes) are measured; ``[0, 0, 0, 1, 1, 1]`` is
        orientation only.
    sigma : array_like, shape (), (k,) or (N, k), optional
        Standard deviations, m and rad; default: estimated from the data.
    covariance : array_like, shape (k, k) or (N, k, k), optional
        Instead of sigma.
    frame : str, int or None
        The end; None is the tool.
    name : str
        In reports.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        Shapes that do not fit, NaN, poses that are none, no row asked.

    References
    ----------
    Seed book section 1.4.4.

    Examples
    --------
    >>> Pose(np.zeros((2, 6)), np.tile(np.eye(4), (2, 1, 1))).axes
    ('x', 'y', 'z', 'rx', 'ry', 'rz')
    """

    q: Array
    T: Array
    rows: tuple[bool, ...]
    sigma: Array | None
    covariance: Array | None
    frame: Frame
    name: str

    def __init__(
        self,
        q: ArrayLike,
        T: Any,
        rows: Sequence[int | bool] = (1, 1, 1, 1, 1, 1),
        sigma: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        frame: Frame = None,
        name: str = "pose",
    ) -> None:
        set_ = object.__setattr__
        set_(self, "q", as_readings(q))
        set_(self, "T", as_measured_poses(T, len(self.q)))
        asked = as_rows(rows, 6)
        set_(self, "rows", asked)
        noise = as_noise(sigma, covariance, len(self.q), sum(asked))
        set_(self, "sigma", noise[0])
        set_(self, "covariance", noise[1])
        set_(self, "frame", frame)
        set_(self, "name", name)

    @classmethod
    def of_orientations(
        cls,
        q: ArrayLike,
        R: ArrayLike,
        sigma: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        frame: Frame = None,
        name: str = "orientation",
    ) -> Self:
        """Measured orientations alone: an inclinometer with compass, a gyroscope, a level.

        Parameters
        ----------
        q : array_like, shape (N, n)
            Readings of the joints, rad or m.
        R : array_like, shape (N, 3, 3)
            Measured rotations from the end's axes to the world's.
        sigma, covariance, frame, name
            As for the class; rows of a block are rx, ry, rz.

        Returns
        -------
        Pose
            With ``rows=[0, 0, 0, 1, 1, 1]``.

        Raises
        ------
        ShapeError, InvalidValueError, NotARotationError
            Shapes that do not fit, NaN, no rotations.

        Examples
        --------
        >>> Pose.of_orientations(np.zeros((2, 6)), np.tile(np.eye(3), (2, 1, 1))).axes
        ('rx', 'ry', 'rz')
        """
        rotations = as_core(R, (3, 3), "R")
        if rotations.ndim != 3:
            raise ShapeError(f"R: expected shape (N, 3, 3), got {rotations.shape}.")
        T = np.tile(np.eye(4), (len(rotations), 1, 1))
        T[:, :3, :3] = rotations
        return cls(q, T, (0, 0, 0, 1, 1, 1), sigma, covariance, frame, name)

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
        """The end at every configuration."""
        return (View(self.frame, self.q),)

    @property
    def knows_length(self) -> bool:
        """Positions are lengths; orientation alone is not."""
        return any(self.rows[:3])

    @property
    def sees_base(self) -> bool:
        """The pose is measured in the world."""
        return True

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Position difference and rotation vector, world axes."""
        T, psi = evaluations[0]
        u = rotation_errors(T[:, :3, :3], self.T[:, :3, :3])
        residual = np.hstack([T[:, :3, 3] - self.T[:, :3, 3], u])
        J = psi.copy()
        J[:, 3:] = inverse_left_jacobians(u) @ psi[:, 3:]
        asked = np.flatnonzero(self.rows)
        return Linearised(residual[:, asked], J[:, asked], np.zeros((self.blocks, len(asked), 0)))

    def with_configurations(self, configurations: Sequence[Array]) -> Self:
        """The same poses at other readings."""
        (q,) = configurations
        return remade(self, q=q)

    def subset(self, blocks: NDArray[np.int64]) -> Self:
        """Some of the poses."""
        sigma, covariance = part_of_noise(self, blocks)
        return remade(
            self, blocks, q=self.q[blocks], T=self.T[blocks], sigma=sigma, covariance=covariance
        )
