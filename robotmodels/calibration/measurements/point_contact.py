"""The end touches the same point in several configurations: no measuring device at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array
from ..skeleton import Frame
from .dilations import have_common_place
from .labelled import Labelled, Labels, as_known, as_labels
from .labelled_points import as_point, known_points, labelled_points, point_fixtures
from .measurement import (
    Evaluation,
    Fixture,
    Linearised,
    View,
    as_noise,
    as_readings,
    part_of_noise,
)


@dataclass(frozen=True, slots=True, init=False, eq=False)
class PointContact(Labelled):
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
        set_ = object.__setattr__
        set_(self, "q", as_readings(q))
        labels = as_labels(point, len(self.q), "point")
        set_(self, "point", labels)
        set_(self, "known", as_known(known, labels, "point", as_point))
        noise = as_noise(sigma, covariance, len(self.q), 3)
        set_(self, "sigma", noise[0])
        set_(self, "covariance", noise[1])
        set_(self, "frame", frame)
        set_(self, "name", name)

    @property
    def label(self) -> tuple[str, ...]:
        """Point of each touch."""
        return self.point

    @property
    def blocks(self) -> int:
        """Number of touches."""
        return len(self.q)

    @property
    def axes(self) -> tuple[str, ...]:
        """World axes."""
        return ("x", "y", "z")

    @property
    def units(self) -> tuple[str, ...]:
        """All metres."""
        return ("m", "m", "m")

    @property
    def views(self) -> tuple[View, ...]:
        """The end at every touch."""
        return (View(self.frame, self.q),)

    @property
    def fixtures(self) -> tuple[Fixture, ...]:
        """Coordinates of the unknown points."""
        return point_fixtures(self)

    @property
    def is_constraint(self) -> bool:
        """It is."""
        return True

    @property
    def dilation_centres(self) -> tuple[Array, Array]:
        """The known points."""
        return known_points(self)

    @property
    def knows_length(self) -> bool:
        """Two known points are a known length; about a single one the robot can shrink."""
        return not have_common_place(*self.dilation_centres)

    @property
    def sees_base(self) -> bool:
        """Only through points that are known in the world."""
        return bool(self.known)

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

    def with_configurations(self, configurations: Sequence[Array]) -> Self:
        """The same touches at other readings."""
        (q,) = configurations
        return replace(self, q=q)

    def subset(self, blocks: NDArray[np.int64]) -> Self:
        """Some of the touches."""
        sigma, covariance = part_of_noise(self, blocks)
        point = tuple(self.point[b] for b in blocks)
        return replace(
            self, q=self.q[blocks], point=point, known=self.known_of(point), sigma=sigma,
            covariance=covariance,
        )  # fmt: skip
