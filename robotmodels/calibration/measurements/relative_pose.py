"""The pose of the end at one configuration as seen from the end at another one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array
from ...errors import InvalidValueError
from ..extended_table import Frame
from .measurement import POSE_AXES, POSE_UNITS, Evaluation, Linearised, Measurement, View, remade
from .moving_poses import difference, motionless, relative
from .noise import as_noise, part_of_noise
from .readings import as_measured_poses, as_readings, as_rows, same_number_of_readings


@dataclass(frozen=True, slots=True, init=False, eq=False)
class RelativePose(Measurement):
    """Measured ``T(q)^-1 T(q_other)``, all six rows or some of them.

    Where the robot and the measuring device stand does not matter: increments of an inertial
    unit, of a camera on the arm that looks at a scene, of a tracker that was moved in between
    but not within a pair.

    Parameters
    ----------
    q, q_other : array_like, shape (N, n)
        Readings of the joints at the two configurations of each pair, rad or m.
    T : array_like, shape (N, 4, 4)
        Measured pose of the end at ``q_other`` in the end at ``q``, metres.
    rows : six of 0 or 1
        Which of x, y, z, rx, ry, rz (axes of the end at ``q``) are measured:
        ``[1, 1, 1, 0, 0, 0]`` is the position of the second seen from the first.
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
    Seed book section 1.4.5.

    Examples
    --------
    >>> q = np.zeros((4, 6))
    >>> RelativePose.successive(q, np.tile(np.eye(4), (3, 1, 1))).blocks
    3
    """

    q: Array
    q_other: Array
    T: Array
    rows: tuple[bool, ...]
    sigma: Array | None
    covariance: Array | None
    frame: Frame
    name: str

    def __init__(
        self,
        q: ArrayLike,
        q_other: ArrayLike,
        T: Any,
        rows: Sequence[int | bool] = (1, 1, 1, 1, 1, 1),
        sigma: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        frame: Frame = None,
        name: str = "relative pose",
    ) -> None:
        set_ = object.__setattr__
        set_(self, "q", as_readings(q))
        set_(self, "q_other", same_number_of_readings(self.q, q_other))
        set_(self, "T", as_measured_poses(T, len(self.q)))
        asked = as_rows(rows, 6)
        set_(self, "rows", asked)
        noise = as_noise(sigma, covariance, len(self.q), sum(asked))
        set_(self, "sigma", noise[0])
        set_(self, "covariance", noise[1])
        set_(self, "frame", frame)
        set_(self, "name", name)

    @classmethod
    def successive(
        cls,
        q: ArrayLike,
        T: Any,
        rows: Sequence[int | bool] = (1, 1, 1, 1, 1, 1),
        sigma: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        frame: Frame = None,
        name: str = "relative pose",
    ) -> Self:
        """Each configuration relative to the one before.

        Parameters
        ----------
        q : array_like, shape (N + 1, n)
            Readings of the joints one after the other, rad or m.
        T : array_like, shape (N, 4, 4)
            ``T(q_k)^-1 T(q_k+1)`` as measured, metres.
        rows, sigma, covariance, frame, name
            As for the class.

        Returns
        -------
        RelativePose
            N pairs.

        Raises
        ------
        ShapeError, InvalidValueError, NotARotationError
            Fewer than two configurations, and as the class.

        Examples
        --------
        >>> q = np.zeros((3, 6))
        >>> RelativePose.successive(q, np.tile(np.eye(4), (2, 1, 1)), [1, 1, 1, 0, 0, 0]).axes
        ('x', 'y', 'z')
        """
        readings = as_readings(q)
        if len(readings) < 2:
            raise InvalidValueError("q: expected two or more configurations, got one.")
        return cls(readings[:-1], readings[1:], T, rows, sigma, covariance, frame, name)

    @property
    def blocks(self) -> int:
        """Number of pairs."""
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
        """The end at both configurations of every pair."""
        return (View(self.frame, self.q), View(self.frame, self.q_other))

    @property
    def knows_length(self) -> bool:
        """A measured displacement that is not zero is a length."""
        return bool(self.T[:, :3, 3][:, self.rows[:3]].any())

    @property
    def sees_base(self) -> bool:
        """It does not."""
        return False

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Position difference and rotation vector, axes of the end at the first configuration."""
        seen = relative(*evaluations)
        residual, J = difference(seen, motionless(self.T, seen.psi.shape[-1]))
        asked = np.flatnonzero(self.rows)
        return Linearised(residual[:, asked], J[:, asked], np.zeros((self.blocks, len(asked), 0)))

    def with_configurations(self, configurations: Sequence[Array]) -> Self:
        """The same pairs at other readings."""
        q, q_other = configurations
        return remade(self, q=q, q_other=q_other)

    def subset(self, blocks: NDArray[np.int64]) -> Self:
        """Some of the pairs."""
        sigma, covariance = part_of_noise(self, blocks)
        return remade(
            self, blocks, q=self.q[blocks], q_other=self.q_other[blocks], T=self.T[blocks],
            sigma=sigma, covariance=covariance,
        )  # fmt: skip
