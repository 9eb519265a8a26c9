"""Friction models that act together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..errors import InvalidValueError
from .protocols import (
    Friction,
    LinearFriction,
    basis_at,
    breakaway_torques,
    check_friction,
    check_linear,
    needs_position,
    torque_at,
)


@dataclass(frozen=True, slots=True)
class FrictionSum:
    """Several friction models that act together; ``a + b`` of two friction models is one.

    Parameters
    ----------
    parts : tuple of Friction
        Models of the same joints, at least one.

    Raises
    ------
    ShapeError, InvalidValueError
        Numbers of joints that differ; no part; something that is no friction model.

    Examples
    --------
    >>> from robotmodels.friction import CoulombFriction, ViscousFriction
    >>> both = FrictionSum((ViscousFriction([1.0]), CoulombFriction([2.0])))
    >>> both.torque([3.0]), both.kinds
    (array([5.]), ('Fv', 'Fc'))
    >>> ViscousFriction([1.0]) + CoulombFriction([2.0]) == both
    True
    """

    parts: tuple[Friction, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "parts", tuple(self.parts))
        if not self.parts:
            raise InvalidValueError("parts: expected at least one friction model.")
        for part in self.parts:
            check_friction(part, getattr(self.parts[0], "n", 0), "parts")

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.parts[0].n

    @property
    def kinds(self) -> tuple[str, ...]:
        """Names of a joint's parameters."""
        return tuple(kind for part in self._linear for kind in part.kinds)

    @property
    def parameters(self) -> Array:
        """Their values, shape (k, n)."""
        return np.concatenate([part.parameters for part in self._linear])

    @property
    def breakaway(self) -> Array:
        """Torques between which a joint at rest sticks, shape (2, n): lower, upper."""
        moving, _ = by_dependence(self)
        return np.zeros((2, self.n)) if moving is None else breakaway_torques(moving)

    @property
    def needs_position(self) -> bool:
        """Whether a part of it depends on positions."""
        return any(needs_position(part) for part in self.parts)

    def basis(self, v: ArrayLike, q: ArrayLike | None = None) -> Array:
        """Torque per unit of each parameter, see `LinearFriction`."""
        return np.concatenate([basis_at(part, v, q) for part in self._linear], axis=-2)

    def torque(self, v: ArrayLike, q: ArrayLike | None = None) -> Array:
        """Torque that the joints need to overcome friction, shape (..., n)."""
        return np.sum([torque_at(part, v, q) for part in self.parts], axis=0)

    def __add__(self, other: object) -> FrictionSum:
        return together(self, other)

    def __radd__(self, other: object) -> FrictionSum:
        return together(other, self)

    @property
    def _linear(self) -> tuple[LinearFriction, ...]:
        return tuple(check_linear(part) for part in self.parts)


def by_dependence(friction: Friction | None) -> tuple[Friction | None, Friction | None]:
    """The parts of a model that depend on velocities alone, and those that need positions."""
    if friction is None:
        return None, None
    parts = friction.parts if isinstance(friction, FrictionSum) else (friction,)
    moving = tuple(part for part in parts if not needs_position(part))
    placed = tuple(part for part in parts if needs_position(part))
    return _one(moving), _one(placed)


def _one(parts: tuple[Friction, ...]) -> Friction | None:
    return FrictionSum(parts) if len(parts) > 1 else next(iter(parts), None)


def together(first: object, second: object) -> FrictionSum:
    """Sum of two friction models; nested sums are flattened."""
    parts: list[Friction] = []
    for each in (first, second):
        if isinstance(each, type) or not isinstance(each, Friction):
            return NotImplemented
        parts += each.parts if isinstance(each, FrictionSum) else (each,)
    return FrictionSum(tuple(parts))
