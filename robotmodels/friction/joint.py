"""Friction models whose parameters are fields of shape (n,)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_floats, read_only, same_value, value_hash
from ..errors import ShapeError
from .combined import FrictionSum, together
from .protocols import breakaway_torques


@dataclass(frozen=True, slots=True, init=False, eq=False)
class JointFriction(ABC):
    """Parameters of shape (n,) that the fields name; a subclass adds `basis`."""

    kinds: ClassVar[tuple[str, ...]] = ()

    def _set(self, **given: ArrayLike) -> None:
        values = {name: as_floats(value, name) for name, value in given.items()}
        shape = next(iter(values.values())).shape
        if len(shape) != 1 or any(array.shape != shape for array in values.values()):
            shapes = ", ".join(f"{name} {array.shape}" for name, array in values.items())
            raise ShapeError(f"Friction parameters are all of shape (n,), got {shapes}.")
        for name, array in values.items():
            object.__setattr__(self, name, read_only(array))

    @property
    def parameters(self) -> Array:
        """Values of the parameters that the torque is linear in, shape (k, n)."""
        return np.stack([getattr(self, kind) for kind in self.kinds])

    @property
    def n(self) -> int:
        """Number of joints."""
        return getattr(self, fields(self)[0].name).size

    @property
    def breakaway(self) -> Array:
        """Torques between which a joint at rest sticks, shape (2, n): lower, upper."""
        return breakaway_torques(self)

    @abstractmethod
    def basis(self, v: ArrayLike) -> Array:
        """Torque per unit of each parameter of its joint.

        Parameters
        ----------
        v : array_like, shape (..., n)
            Joint velocities.

        Returns
        -------
        ndarray, shape (..., k, n)
            In the order of ``kinds``.
        """

    def torque(self, v: ArrayLike) -> Array:
        """Torque that the joints need to overcome friction; dry friction is zero at rest.

        Parameters
        ----------
        v : array_like, shape (..., n)
            Joint velocities, rad/s or m/s.

        Returns
        -------
        ndarray, shape (..., n)
            N m or N.

        Raises
        ------
        ShapeError, InvalidValueError
            Wrong length; NaN or infinity.
        """
        return (self.basis(v) * self.parameters).sum(axis=-2)

    def __add__(self, other: object) -> FrictionSum:
        return together(self, other)

    def __radd__(self, other: object) -> FrictionSum:
        return together(other, self)

    def __reduce__(self) -> tuple[Any, ...]:  # rebuilt, so that a copy is read-only as well
        return type(self), tuple(getattr(self, f.name) for f in fields(self))

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(same_value(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))

    def __hash__(self) -> int:
        return value_hash(type(self).__name__, *(getattr(self, f.name) for f in fields(self)))
