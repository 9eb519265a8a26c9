"""An ellipsoid of velocities or forces as data: axes, radii, and quantities derived from them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Value, as_core, batch_shape, read_only
from ..errors import InvalidValueError, ShapeError

# sine of an angle that is rounding: a direction so near an axis or a plane lies on it
_ON = 1e-12


class EllipsoidQuantity(Enum):
    """Quantity that an ellipsoid shows: the value names it, ``unit`` is that of the radii."""

    unit: str

    LINEAR_VELOCITY = "linear velocity", "m/s"
    ANGULAR_VELOCITY = "angular velocity", "rad/s"
    FORCE = "force", "N"
    MOMENT = "moment", "N m"

    def __new__(cls, value: str, unit: str = "") -> Self:
        """Attach the unit to the name."""
        quantity = object.__new__(cls)
        quantity._value_ = value
        quantity.unit = unit
        return quantity


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Ellipsoid(Value):
    """Velocities or forces that joints of one size give: ``sum_i (u_i . x / r_i)^2 <= 1``.

    Read-only; leading axes are those of the configurations.

    Parameters
    ----------
    quantity : EllipsoidQuantity
        What it shows, with the unit of the radii.
    centre : ndarray, shape (..., 3)
        Where it is drawn: the origin of the frame in the world, m.
    axes : ndarray, shape (..., 3, 3)
        Columns u_1, u_2, u_3: unit vectors in world axes, right-handed. Where radii are equal they
        are any such vectors of their plane or space.
    radii : ndarray, shape (..., 3)
        r_1 >= r_2 >= r_3. A direction in which nothing moves has the velocity radius 0; it carries
        any force, so that the force radius there is infinite.
    rank : ndarray of int64, shape (...)
        Number of directions that move: of velocity radii above 0, of force radii that are finite.
    """

    quantity: EllipsoidQuantity
    centre: Array
    axes: Array
    radii: Array
    rank: NDArray[np.int64]

    def __post_init__(self) -> None:
        batch = np.shape(self.radii)[:-1]
        shapes = {
            "centre": (np.float64, (*batch, 3)),
            "axes": (np.float64, (*batch, 3, 3)),
            "radii": (np.float64, (*batch, 3)),
            "rank": (np.int64, batch),
        }
        for name, (dtype, shape) in shapes.items():
            array = read_only(getattr(self, name), dtype)
            if array.shape != shape:
                raise ShapeError(f"{name}: expected shape {shape}, got {array.shape}.")
            object.__setattr__(self, name, array)

    @property
    def volume(self) -> Array:
        """``4/3 pi r_1 r_2 r_3``, shape (...): 0 of a flat ellipsoid, infinite of an open one."""
        return np.asarray(4.0 / 3.0 * np.pi * self.radii.prod(axis=-1))

    @property
    def isotropy(self) -> Array:
        """Smallest radius over largest, shape (...): 1 for a sphere, 0 where the rank is below 3.

        Its inverse is the condition number of the half of the Jacobian that is shown.
        """
        whole = self.rank == 3
        largest = np.where(whole, self.radii[..., 0], 1.0)
        return np.where(whole, self.radii[..., 2], 0.0) / largest

    def radius_along(self, direction: ArrayLike) -> Array:
        """Largest velocity or force (...) along directions (..., 3) in world axes, not zero.

        0 where a flat ellipsoid has no such velocity, infinity where an open one has no bound.
        There a direction within 1e-12 rad of an axis or of the plane of two counts as on it. S. L.
        Chiu, "Task compatibility of manipulator postures", International Journal of Robotics
        Research 7(5), 1988.
        """
        c, r = self._components(direction), self.radii
        regular = (r > 0) & np.isfinite(r)
        bend = np.divide(c, r, out=np.zeros(np.broadcast_shapes(c.shape, r.shape)), where=regular)
        curved = np.linalg.norm(bend, axis=-1)
        leaves = np.any((c != 0) & (r == 0), axis=-1)
        bounded = np.any((c != 0) & np.isfinite(r), axis=-1)
        radius = np.divide(1.0, curved, out=np.full(curved.shape, np.inf), where=bounded & ~leaves)
        return np.where(leaves, 0.0, radius)

    def extent_along(self, direction: ArrayLike) -> Array:
        """Largest component (...) of all points along directions (..., 3): half the width.

        At least `radius_along`, and equal to it along the axes; the reciprocal of `radius_along` of
        the dual ellipsoid.
        """
        c, r = self._components(direction), self.radii
        open_ = ~np.isfinite(r)
        extent = np.linalg.norm(c * np.where(open_, 0.0, r), axis=-1)
        return np.where(np.any((c != 0) & open_, axis=-1), np.inf, extent)

    def boundary(self, polar: int = 13, around: int = 24) -> Array:
        """Points of the surface in world axes, from the centre, shape (..., polar, around, 3).

        A grid of ``polar`` angles from 0 to pi and ``around`` meridians from 0 to 2 pi about the
        third axis, at least 3 each, both ends included. NaN for an ellipsoid with an infinite
        radius.
        """
        if polar < 3 or around < 3:
            raise InvalidValueError(
                f"boundary: expected at least 3 polar angles and 3 meridians, got {polar}, {around}"
            )
        angle, turn = np.linspace(0.0, np.pi, polar), np.linspace(0.0, 2.0 * np.pi, around)
        sphere = np.stack(np.broadcast_arrays(
            np.outer(np.sin(angle), np.cos(turn)), np.outer(np.sin(angle), np.sin(turn)),
            np.cos(angle)[:, None],
        ), axis=-1)  # fmt: skip
        closed = np.isfinite(self.radii).all(axis=-1, keepdims=True)
        scaled = self.axes * np.where(closed, self.radii, np.nan)[..., None, :]
        return np.einsum("...ij,pkj->...pki", scaled, sphere)

    def at(self, index: int | slice | tuple[int, ...]) -> Self:
        """Ellipsoids of some rows of a batch; a single one where the index is complete."""
        fields = (self.centre, self.axes, self.radii, self.rank)
        centre, axes, radii, rank = (array[index] for array in fields)
        return replace(self, centre=centre, axes=axes, radii=radii, rank=rank)

    def _components(self, direction: ArrayLike) -> Array:
        """Unit directions in the ellipsoids' axes."""
        d = as_core(direction, (3,), "direction")
        batch_shape((d, self.radii), ("direction", "ellipsoid"))
        size = np.abs(d).max(axis=-1, keepdims=True)
        if (size == 0).any():
            raise InvalidValueError("direction: expected a vector of some length, got zeros.")
        d = d / size
        d = d / np.linalg.norm(d, axis=-1, keepdims=True)
        c = np.einsum("...ji,...j->...i", self.axes, d)
        return np.where((np.abs(c) <= _ON) & (self.rank < 3)[..., None], 0.0, c)
