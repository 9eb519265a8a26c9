"""The interface of friction models, the sum of several models, and checks of arguments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..errors import InvalidValueError, ShapeError

SLOWEST = 5e-324  # rad/s or m/s: smallest positive velocity
_ROUNDING = 1e-300  # viscous torque at this velocity


@runtime_checkable
class Friction(Protocol):
    """A friction model for `idm` and `ddm`; a user's model needs only these members.

    ``n`` joints, and ``torque(v)``, the torque (..., n) that they need to overcome friction at
    velocities (..., n). A model whose torque depends on positions too has ``needs_position = True``
    beside, and takes them as a second argument: ``torque(v, q)``, ``basis(v, q)``.
    """

    @property
    def n(self) -> int: ...  # noqa: D102
    def torque(self, v: ArrayLike) -> Array: ...  # noqa: D102


@runtime_checkable
class LinearFriction(Friction, Protocol):
    """A friction model that is linear in its parameters, for regressors.

    ``kinds`` names the k parameters of a joint, ``parameters`` (k, n) are their values, and
    ``basis(v)`` is the torque per unit of each, (..., k, n).
    """

    @property
    def kinds(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def parameters(self) -> Array: ...  # noqa: D102
    def basis(self, v: ArrayLike) -> Array: ...  # noqa: D102


class Summable:
    """Base of friction models whose sum with another one is a `FrictionSum`, without nesting."""

    __slots__ = ()

    def __add__(self, other: object) -> FrictionSum:
        return _together(self, other)

    def __radd__(self, other: object) -> FrictionSum:
        return _together(other, self)

    @property
    def breakaway(self) -> Array:
        """Torques between which a joint at rest sticks, shape (2, n): lower, upper."""
        model: Any = self
        return np.sort(torques_at_rest(model, model.n), axis=0)


@dataclass(frozen=True, slots=True)
class FrictionSum(Summable):
    """Several friction models that act together; ``a + b`` of two friction models is one.

    Parameters
    ----------
    parts : tuple of Friction
        Models of the same joints, at least one.
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
    def needs_position(self) -> bool:
        """Whether a part of it depends on positions."""
        return any(needs_position(part) for part in self.parts)

    def basis(self, v: ArrayLike, q: ArrayLike | None = None) -> Array:
        """Torque per unit of each parameter, see `LinearFriction`."""
        return np.concatenate([basis_at(part, v, q) for part in self._linear], axis=-2)

    def torque(self, v: ArrayLike, q: ArrayLike | None = None) -> Array:
        """Torque that the joints need to overcome friction, shape (..., n)."""
        return np.sum([torque_at(part, v, q) for part in self.parts], axis=0)

    @property
    def _linear(self) -> tuple[LinearFriction, ...]:
        return tuple(check_linear(part) for part in self.parts)


def _together(*models: object) -> FrictionSum:
    parts: list[Friction] = []
    for model in models:
        if isinstance(model, type) or not isinstance(model, Friction):
            return NotImplemented
        parts += model.parts if isinstance(model, FrictionSum) else (model,)
    return FrictionSum(tuple(parts))


def by_dependence(friction: Friction | None) -> tuple[Friction | None, Friction | None]:
    """The parts of a model that depend on velocities alone, and those that need positions."""
    single = () if friction is None else (friction,)
    parts = friction.parts if isinstance(friction, FrictionSum) else single
    groups = [tuple(p for p in parts if needs_position(p) is placed) for placed in (False, True)]
    first, second = (FrictionSum(g) if len(g) > 1 else next(iter(g), None) for g in groups)
    return first, second


def needs_position(friction: Friction) -> bool:
    """Whether the torque depends on positions."""
    return bool(getattr(friction, "needs_position", False))


def torque_at(friction: Friction, v: ArrayLike, q: ArrayLike | None) -> Array:
    """Torque of any friction model at velocities and positions (..., n)."""
    torque: Any = friction.torque
    return torque(v, q) if needs_position(friction) else torque(v)


def basis_at(friction: LinearFriction, v: ArrayLike, q: ArrayLike | None) -> Array:
    """Torque per unit of each parameter (..., k, n) of any model at velocities and positions."""
    basis: Any = friction.basis
    return basis(v, q) if needs_position(friction) else basis(v)


def torques_at_rest(friction: Friction | None, n: int) -> Array:
    """Torques just below and above zero velocity, shape (2, n), without models that need q."""
    moving, _ = by_dependence(friction)
    if moving is None:
        return np.zeros((2, n))
    limits = np.stack([moving.torque(np.full(n, s * SLOWEST)) for s in (-1.0, 1.0)])
    return np.where(np.abs(limits) < _ROUNDING, 0.0, limits)


def check_friction(friction: object, n: int, name: str = "friction") -> Friction:
    """Raise unless the object is a friction model of n joints."""
    if isinstance(friction, type) or not isinstance(friction, Friction):
        got = friction.__name__ if isinstance(friction, type) else type(friction).__name__
        raise InvalidValueError(
            f"{name}: expected a friction model such as CoulombFriction(Fc), or an object with "
            f"n and torque(v), got {got}. Several act together as a FrictionSum."
        )
    if friction.n != n:
        raise ShapeError(f"{name}: expected friction of {n} joints, got {friction.n}.")
    return friction


def check_linear(friction: Friction) -> LinearFriction:
    """Raise for a friction model without regressor columns."""
    if not isinstance(friction, LinearFriction):
        raise InvalidValueError(
            f"friction: {type(friction).__name__} is not linear in parameters (no kinds, "
            "parameters and basis), so that a regressor has no columns of it."
        )
    return friction
