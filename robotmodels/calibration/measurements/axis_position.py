"""A coordinate of the end along one axis: dial gauge, linear encoder, laser displacement sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, as_exact, read_only
from ...errors import InvalidValueError
from ..extended_table import Frame
from .measurement import Evaluation, Fixture, Linearised, Measurement, View, remade
from .noise import as_noise, part_of_noise
from .readings import as_readings, as_values
from .rotation_vectors import rotations_of, tilt_of, tilted_axes, unit_vector


@dataclass(frozen=True, slots=True, init=False, eq=False)
class AxisPosition(Measurement):
    """Readings ``axis . p - zero`` of a gauge with a fixed axis.

    One gauge a measurement; give several of them different names. A cable that is drawn from a
    drum measures a `Distance`.

    Parameters
    ----------
    q : array_like, shape (N, n)
        Readings of the joints, rad or m.
    value : array_like, shape (N,)
        Readings of the gauge, metres.
    axis : array_like, shape (3,)
        Direction in the world in which the reading grows; its length does not matter.
    zero : float, optional
        Coordinate at which the gauge reads 0, metres; default: unknown and estimated along.
    axis_is_known : bool
        False: the axis is estimated along, as two turns away from the given one.
    sigma : array_like, shape (), (1,) or (N, 1), optional
        Standard deviations, m; default: estimated from the data.
    covariance : array_like, shape (1, 1) or (N, 1, 1), optional
        Instead of sigma.
    frame : str, int or None
        The end; None is the tool.
    name : str
        In reports, and in front of the names of the unknowns.

    Raises
    ------
    ShapeError, InvalidValueError
        Shapes that do not fit, NaN, an axis of length 0.

    References
    ----------
    Seed book section 1.4.4.

    Examples
    --------
    >>> gauge = AxisPosition(np.zeros((3, 6)), [0.0, 1e-3, 2e-3], [0, 0, 1], axis_is_known=False)
    >>> [fixture.name for fixture in gauge.fixtures]
    ['gauge.turn_1', 'gauge.turn_2', 'gauge.zero']
    """

    q: Array
    value: Array
    axis: Array
    zero: float | None
    axis_is_known: bool
    sigma: Array | None
    covariance: Array | None
    frame: Frame
    name: str

    def __init__(
        self,
        q: ArrayLike,
        value: ArrayLike,
        axis: ArrayLike,
        zero: float | None = None,
        axis_is_known: bool = True,
        sigma: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        frame: Frame = None,
        name: str = "gauge",
    ) -> None:
        set_ = object.__setattr__
        set_(self, "q", as_readings(q))
        set_(self, "value", as_values(value, len(self.q), "value"))
        direction = as_exact(axis, (3,), "axis")
        if not direction.any():
            raise InvalidValueError("axis: expected a direction, got zeros.")
        set_(self, "axis", read_only(unit_vector(direction)))
        set_(self, "zero", None if zero is None else float(as_exact(zero, (), "zero")))
        set_(self, "axis_is_known", bool(axis_is_known))
        noise = as_noise(sigma, covariance, len(self.q), 1)
        set_(self, "sigma", noise[0])
        set_(self, "covariance", noise[1])
        set_(self, "frame", frame)
        set_(self, "name", name)

    @property
    def blocks(self) -> int:
        """Number of readings."""
        return len(self.q)

    @property
    def axes(self) -> tuple[str, ...]:
        """Along the axis."""
        return ("along",)

    @property
    def units(self) -> tuple[str, ...]:
        """Metres."""
        return ("m",)

    @property
    def views(self) -> tuple[View, ...]:
        """The end at every configuration."""
        return (View(self.frame, self.q),)

    @property
    def fixtures(self) -> tuple[Fixture, ...]:
        """Two turns of an unknown axis, and an unknown zero."""
        turns = (
            [] if self.axis_is_known else [Fixture(f"{self.name}.turn_{k}", "rad") for k in (1, 2)]
        )
        zero = [] if self.zero is not None else [Fixture(f"{self.name}.zero", "m")]
        return (*turns, *zero)

    @property
    def dilation_centres(self) -> tuple[Array, Array]:
        """Where the end always is, along the axis, if both are known."""
        if self.zero is None or not self.axis_is_known:
            return np.zeros((0, 3)), np.zeros(0)
        return np.tile(self.axis, (self.blocks, 1)), self.value + self.zero

    @property
    def knows_length(self) -> bool:
        """Readings that differ are lengths; a gauge that always reads the same is touched."""
        return bool(np.ptp(self.value) > 0.0)

    @property
    def sees_base(self) -> bool:
        """Unless neither the axis nor the zero is known in the world."""
        return self.axis_is_known or self.zero is not None

    def guess(self, evaluations: Sequence[Evaluation]) -> Array | None:
        """The given axis, and the zero that suits it."""
        turns = np.zeros(0 if self.axis_is_known else 2)
        if self.zero is not None:
            return turns
        zero = float(np.mean(evaluations[0].T[:, :3, 3] @ self.axis - self.value))
        return np.array([*turns, zero])

    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Coordinate along the axis less the reading."""
        T, psi = evaluations[0]
        p = T[:, :3, 3]
        by_fixtures = np.zeros((len(T), 1, len(fixtures)))
        axis, zero = self.axis, self.zero
        if not self.axis_is_known:
            given = _axes_along(self.axis)
            R, by_turn = tilted_axes(fixtures[None, :2])
            axis = given @ R[0, :, 2]
            by_fixtures[:, 0, :2] = p @ (given @ by_turn[0, :, 2])
        if zero is None:
            zero = float(fixtures[-1])
            by_fixtures[:, 0, -1] = -1.0
        return Linearised(
            (p @ axis - zero - self.value)[:, None], axis @ psi[:, None, :3], by_fixtures
        )

    def with_configurations(self, configurations: Sequence[Array]) -> Self:
        """The same readings of the gauge at others of the joints."""
        (q,) = configurations
        return remade(self, q=q)

    def subset(self, blocks: NDArray[np.int64]) -> Self:
        """Some of the readings."""
        sigma, covariance = part_of_noise(self, blocks)
        return remade(
            self,
            blocks,
            q=self.q[blocks],
            value=self.value[blocks],
            sigma=sigma,
            covariance=covariance,
        )


def _axes_along(direction: Array) -> Array:
    """Right-handed axes, z along a direction."""
    if direction[2] < 0.0:  # not through the opposite of z
        return _axes_along(-direction) @ np.diag([1.0, -1.0, -1.0])
    return rotations_of(np.append(tilt_of(direction), 0.0)[None])[0]
