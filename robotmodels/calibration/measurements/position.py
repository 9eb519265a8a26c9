"""A position of the end, or of a target on it, measured from outside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, as_exact, read_only
from ..extended_table import Frame
from .measurement import Evaluation, Linearised, Measurement, View, remade
from .noise import as_noise, part_of_noise
from .readings import as_readings, as_rows

_AXES = ("x", "y", "z")


@dataclass(frozen=True, slots=True, init=False, eq=False)
class Position(Measurement):
    """Measured positions of the end's origin: laser tracker, camera, measuring machine.

    Where the device stands is the base Z of the robot, and the target's place on the arm is the
    tool E: both are parameters of the robot.

    Parameters
    ----------
    q : array_like, shape (N, n)
        Readings of the joints, rad or m.
    p : array_like, shape (N, 3)
        Measured positions in the world, metres.
    rows : three of 0 or 1
        Which of x, y, z are measured.
    sigma : array_like, shape (), (k,) or (N, k), optional
        Standard deviations, m; default: estimated from the data.
    covariance : array_like, shape (k, k) or (N, k, k), optional
        Instead of sigma.
    frame : str, int or None
        The end; None is the tool.
    name : str
        In reports.

    Raises
    ------
    ShapeError, InvalidValueError
        Shapes that do not fit, NaN, no row asked.

    References
    ----------
    Seed book section 1.4.4.

    Examples
    --------
    >>> Position(np.zeros((2, 6)), np.zeros((2, 3)), rows=[1, 1, 0]).axes
    ('x', 'y')
    """

    q: Array
    p: Array
    rows: tuple[bool, ...]
    sigma: Array | None
    covariance: Array | None
    frame: Frame
    name: str

    def __init__(
        self,
        q: ArrayLike,
        p: ArrayLike,
        rows: Sequence[int | bool] = (1, 1, 1),
        sigma: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        frame: Frame = None,
        name: str = "position",
    ) -> None:
        set_ = object.__setattr__
        set_(self, "q", as_readings(q))
        set_(self, "p", read_only(as_exact(p, (len(self.q), 3), "p")))
        asked = as_rows(rows, 3)
        set_(self, "rows", asked)
        noise = as_noise(sigma, covariance, len(self.q), sum(asked))
        set_(self, "sigma", noise[0])
        set_(self, "covariance", noise[1])
        set_(self, "frame", frame)
        set_(self, "name", name)

    @property
    def blocks(self) -> int:
        """Number of measured positions."""
        return len(self.q)

    @property
    def axes(self) -> tuple[str, ...]:
        """Labels of the rows that are measured."""
        return tuple(a for a, asked in zip(_AXES, self.rows, strict=True) if asked)

    @property
    def units(self) -> tuple[str, ...]:
        """All metres."""
        return ("m",) * sum(self.rows)

    @property
    def views(self) -> tuple[View, ...]:
        """The end at every configuration."""
        return (View(self.frame, self.q),)

    @property
    def knows_length(self) -> bool:
        """Positions are lengths."""
        return True

    @property
    def sees_base(self) -> bool:
        """The position is measured in the world."""
        return True

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Position difference, world axes."""
        T, psi = evaluations[0]
        asked = np.flatnonzero(self.rows)
        return Linearised(
            (T[:, :3, 3] - self.p)[:, asked], psi[:, asked], np.zeros((len(T), len(asked), 0))
        )

    def with_configurations(self, configurations: Sequence[Array]) -> Self:
        """The same positions at other readings."""
        (q,) = configurations
        return remade(self, q=q)

    def subset(self, blocks: NDArray[np.int64]) -> Self:
        """Some of the positions."""
        sigma, covariance = part_of_noise(self, blocks)
        return remade(
            self, blocks, q=self.q[blocks], p=self.p[blocks], sigma=sigma, covariance=covariance
        )
