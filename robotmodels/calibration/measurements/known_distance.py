"""The known distance of two touched points: the length that contacts alone do not give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, as_floats
from ...errors import InvalidValueError
from .measurement import Evaluation, Fixture, Linearised, Measurement, View, remade
from .noise import as_noise, part_of_noise


@dataclass(frozen=True, slots=True, init=False, eq=False)
class KnownDistance(Measurement):
    """The distance between two unknown points of `PointContact`, known from elsewhere.

    Parameters
    ----------
    point, other : str
        Points as ``name:label``, such as ``"point:0"`` and ``"point:1"``.
    length : float
        Their distance, metres.
    sigma : float
        Standard deviation of the length, m; default 0.1 mm, which a calliper or a drilled plate
        reaches.
    name : str
        In reports.

    Raises
    ------
    InvalidValueError
        The same point twice, a length that is not positive.

    References
    ----------
    Seed book section 1.4.5.

    Examples
    --------
    >>> KnownDistance("point:0", "point:1", 0.05).fixtures[0].name
    'point:0.x'
    """

    point: str
    other: str
    length: float
    sigma: Array | None
    covariance: Array | None
    name: str

    def __init__(
        self,
        point: str,
        other: str,
        length: float,
        sigma: ArrayLike | None = 1e-4,
        covariance: ArrayLike | None = None,
        name: str = "known distance",
    ) -> None:
        set_ = object.__setattr__
        if point == other:
            raise InvalidValueError(f"other: expected another point than {point!r}.")
        value = float(as_floats(length, "length"))
        if value <= 0.0:
            raise InvalidValueError(f"length: expected a positive length in metres, got {length}.")
        set_(self, "point", str(point))
        set_(self, "other", str(other))
        set_(self, "length", value)
        noise = as_noise(sigma, covariance, 1, 1)
        set_(self, "sigma", noise[0])
        set_(self, "covariance", noise[1])
        set_(self, "name", name)

    @property
    def blocks(self) -> int:
        """One."""
        return 1

    @property
    def axes(self) -> tuple[str, ...]:
        """The length."""
        return ("length",)

    @property
    def units(self) -> tuple[str, ...]:
        """Metres."""
        return ("m",)

    @property
    def views(self) -> tuple[View, ...]:
        """None: only the points matter."""
        return ()

    @property
    def fixtures(self) -> tuple[Fixture, ...]:
        """Coordinates of the two points."""
        return tuple(
            Fixture(f"{p}.{axis}", "m") for p in (self.point, self.other) for axis in "xyz"
        )

    @property
    def knows_length(self) -> bool:
        """It is one."""
        return True

    @property
    def sees_base(self) -> bool:
        """A distance does not."""
        return False

    def guess(self, evaluations: Sequence[Evaluation]) -> Array | None:
        """The contacts say where the points are."""
        return None

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Distance of the two points less the known length."""
        apart = fixtures[:3] - fixtures[3:]
        length = float(np.linalg.norm(apart))
        along = apart / length if length > 0.0 else np.zeros(3)
        row = np.concatenate([along, -along])[None, None]
        return Linearised(np.array([[length - self.length]]), np.zeros((1, 1, 0)), row)

    def with_configurations(self, configurations: Sequence[Array]) -> Self:
        """Itself: it has no configurations."""
        return self

    def subset(self, blocks: NDArray[np.int64]) -> Self:
        """Itself."""
        sigma, covariance = part_of_noise(self, blocks)
        return remade(self, blocks, sigma=sigma, covariance=covariance)
