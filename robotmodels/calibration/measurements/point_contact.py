"""The end touches the same point in several configurations: no measuring device at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array
from ..extended_table import Frame
from .contact import Contact
from .labelled import Labels
from .labelled_points import as_point, known_points, labelled_points, point_fixtures
from .measurement import Evaluation, Fixture, Linearised


@dataclass(frozen=True, slots=True, init=False, eq=False)
class PointContact(Contact):
    """Touches of points by the end's origin: a ball in a socket, a tip in a centre hole.

    The places of the points are unknown and estimated along, unless they are given.

    Parameters
    ----------
    q : array_like, shape (N, n)
        Readings of the joints at each touch, rad or m.
    point : array_like of int or str, shape (N,), optional
        Which point each touch is of; default: all of the same.
    known : mapping of label to array_like, shape (3,), optional
        Places of points that are known in the world, metres.
    sigma : array_like, shape (), (3,) or (N, 3), optional
        Standard deviations, m; default: estimated from the data.
    covariance : array_like, shape (3, 3) or (N, 3, 3), optional
        Instead of sigma.
    frame : str, int or None
        The end; None is the tool.
    name : str
        In reports, and in front of the labels of the points: the same name and label in two
        measurements is the same point.

    Raises
    ------
    ShapeError, InvalidValueError
        Shapes that do not fit, NaN, a known point that nobody touches.

    References
    ----------
    Seed book section 1.4.5.

    Examples
    --------
    >>> PointContact(np.zeros((3, 6)), [0, 0, 1]).labels
    ('0', '1')
    """

    _met: ClassVar[str] = "point"

    q: Array
    point: tuple[str, ...]
    known: Mapping[str, Array]
    sigma: Array | None
    covariance: Array | None
    frame: Frame
    name: str

    def __init__(
        self,
        q: ArrayLike,
        point: Labels | None = None,
        known: Mapping[int | str, ArrayLike] | None = None,
        sigma: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        frame: Frame = None,
        name: str = "point",
    ) -> None:
        self._settle(q, point, known, as_point, sigma, covariance, frame, name)

    @property
    def axes(self) -> tuple[str, ...]:
        """World axes."""
        return ("x", "y", "z")

    @property
    def units(self) -> tuple[str, ...]:
        """All metres."""
        return ("m", "m", "m")

    @property
    def fixtures(self) -> tuple[Fixture, ...]:
        """Coordinates of the unknown points."""
        return point_fixtures(self)

    @property
    def dilation_centres(self) -> tuple[Array, Array]:
        """The known points."""
        return known_points(self)

    def guess(self, evaluations: Sequence[Evaluation]) -> Array | None:
        """Mean position of the touches of each point."""
        p = evaluations[0].T[:, :3, 3]
        group = self.unknown_groups
        means = [p[group == g].mean(axis=0) for g in range(len(self.unknown))]
        return np.concatenate([np.zeros(0), *means])

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Position of the end less that of the point, world axes."""
        T, psi = evaluations[0]
        target, by_fixtures = labelled_points(self, fixtures)
        return Linearised(T[:, :3, 3] - target, psi[:, :3], -by_fixtures)
