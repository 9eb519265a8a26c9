"""The end touches the same point in several configurations: no measuring device at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, as_exact, read_only
from ...errors import InvalidValueError, ShapeError
from ..skeleton import Frame
from .measurement import (
    Evaluation,
    Fixture,
    Linearised,
    Measurement,
    View,
    as_noise,
    as_readings,
    part_of_noise,
)


@dataclass(frozen=True, slots=True, init=False, eq=False)
class PointContact(Measurement):
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
    >>> PointContact(np.zeros((3, 6)), [0, 0, 1]).points
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
        point: Sequence[int | str] | NDArray[np.int64] | None = None,
        known: Mapping[int | str, ArrayLike] | None = None,
        sigma: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        frame: Frame = None,
        name: str = "point",
    ) -> None:
        set_ = object.__setattr__
        set_(self, "q", as_readings(q))
        labels = ("0",) * len(self.q) if point is None else tuple(str(label) for label in point)
        if len(labels) != len(self.q):
            raise ShapeError(
                f"point: expected a label for each of the {len(self.q)} rows of q, got "
                f"{len(labels)}."
            )
        set_(self, "point", labels)
        places = {
            str(k): read_only(as_exact(v, (3,), f"known[{k!r}]")) for k, v in (known or {}).items()
        }
        for label in places:
            if label not in labels:
                raise InvalidValueError(
                    f"known: point {label!r} is not touched; touched are {self.points}."
                )
        set_(self, "known", MappingProxyType(places))
        noise = as_noise(sigma, covariance, len(self.q), 3)
        set_(self, "sigma", noise[0])
        set_(self, "covariance", noise[1])
        set_(self, "frame", frame)
        set_(self, "name", name)

    def __reduce__(self) -> tuple[object, ...]:  # a mapping proxy does not pickle
        return type(self), (
            self.q, self.point, dict(self.known), self.sigma, self.covariance, self.frame,
            self.name,
        )  # fmt: skip

    @property
    def points(self) -> tuple[str, ...]:
        """Labels of the touched points, each once."""
        return tuple(dict.fromkeys(self.point))

    @property
    def unknown_points(self) -> tuple[str, ...]:
        """Labels of the points whose places are estimated."""
        return tuple(label for label in self.points if label not in self.known)

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
        return tuple(
            Fixture(f"{self.name}:{label}.{axis}", "m")
            for label in self.unknown_points
            for axis in self.axes
        )

    @property
    def is_constraint(self) -> bool:
        """It is."""
        return True

    @property
    def knows_length(self) -> bool:
        """Two known points are a known length; one is, if it is not at the base's origin."""
        return any(np.any(place) for place in self.known.values())

    @property
    def sees_base(self) -> bool:
        """Only through points that are known in the world."""
        return bool(self.known)

    @property
    def groups(self) -> NDArray[np.int64]:
        """Number of the point of each touch."""
        number = {label: k for k, label in enumerate(self.points)}
        return np.array([number[label] for label in self.point], dtype=np.int64)

    def guess(self, evaluations: Sequence[Evaluation]) -> Array | None:
        """Mean position of the touches of each point."""
        p = evaluations[0].T[:, :3, 3]
        labels = np.array(self.point)
        means = [p[labels == label].mean(axis=0) for label in self.unknown_points]
        return np.concatenate(means) if means else np.zeros(0)

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Position of the end less that of the point, world axes."""
        T, psi = evaluations[0]
        places = dict(zip(self.unknown_points, fixtures.reshape(-1, 3), strict=True))
        target = np.array([{**places, **self.known}[label] for label in self.point])
        by_fixtures = np.zeros((len(T), 3, len(fixtures)))
        number = {label: k for k, label in enumerate(self.unknown_points)}
        for i, label in enumerate(self.point):
            if label in number:
                k = 3 * number[label]
                by_fixtures[i, :, k : k + 3] = -np.eye(3)
        return Linearised(T[:, :3, 3] - target, psi[:, :3], by_fixtures)

    def with_configurations(self, configurations: Sequence[Array]) -> Self:
        """The same touches at other readings."""
        (q,) = configurations
        return replace(self, q=q)

    def subset(self, blocks: NDArray[np.int64]) -> Self:
        """Some of the touches."""
        sigma, covariance = part_of_noise(self, blocks)
        point = tuple(self.point[b] for b in blocks)
        known = {label: place for label, place in self.known.items() if label in point}
        return replace(
            self, q=self.q[blocks], point=point, known=known, sigma=sigma, covariance=covariance
        )
