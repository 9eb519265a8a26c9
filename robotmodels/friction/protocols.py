"""What a friction model is, and the checks at the border."""

from __future__ import annotations

from typing import Protocol, cast, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..errors import InvalidValueError, ShapeError

_SLOWEST = 5e-324  # the smallest velocity that has a sign
_NOTHING = 1e-300  # what viscous friction takes at it


@runtime_checkable
class Friction(Protocol):
    """What `idm` and `ddm` need of a friction model; models of your own may have just this.

    A model whose torque depends on positions too has ``needs_position = True`` beside, and takes
    them as a second argument: ``torque(v, q)``, ``basis(v, q)``.
    """

    @property
    def n(self) -> int:
        """Number of joints."""
        ...

    def torque(self, v: ArrayLike) -> Array:
        """Torque that the joints need to overcome friction at velocities ``(..., n)``."""
        ...


@runtime_checkable
class LinearFriction(Friction, Protocol):
    """A friction model that is linear in its parameters: what regressors need."""

    @property
    def kinds(self) -> tuple[str, ...]:
        """Names of a joint's k parameters."""
        ...

    @property
    def parameters(self) -> Array:
        """Values, shape (k, n)."""
        ...

    def basis(self, v: ArrayLike) -> Array:
        """Torque per unit of each parameter of its joint, shape (..., k, n)."""
        ...


class _AtPosition(Protocol):
    """What a model with ``needs_position`` has."""

    def torque(self, v: ArrayLike, q: ArrayLike | None) -> Array: ...

    def basis(self, v: ArrayLike, q: ArrayLike | None) -> Array: ...


def needs_position(friction: Friction) -> bool:
    """Whether the torque depends on positions."""
    return bool(getattr(friction, "needs_position", False))


def torque_at(friction: Friction, v: ArrayLike, q: ArrayLike | None) -> Array:
    """Torque of any friction model at velocities and positions (..., n)."""
    if needs_position(friction):
        return cast(_AtPosition, friction).torque(v, q)
    return friction.torque(v)


def basis_at(friction: LinearFriction, v: ArrayLike, q: ArrayLike | None) -> Array:
    """Torque per unit of each parameter (..., k, n) of any model at velocities and positions."""
    if needs_position(friction):
        return cast(_AtPosition, friction).basis(v, q)
    return friction.basis(v)


def breakaway_torques(friction: Friction) -> Array:
    """Limits of the torque from below and above zero velocity, sorted; what needs q has none."""
    if needs_position(friction):
        return np.zeros((2, friction.n))
    limits = [friction.torque(np.full(friction.n, s * _SLOWEST)) for s in (-1.0, 1.0)]
    return np.sort(np.where(np.abs(limits) < _NOTHING, 0.0, limits), axis=0)


def check_friction(friction: object, n: int, name: str = "friction") -> Friction:
    """Refuse what is no friction model of n joints.

    Parameters
    ----------
    friction : object
        A friction model.
    n : int
        Number of joints.
    name : str
        Used in error messages.

    Returns
    -------
    Friction
        The same.

    Raises
    ------
    InvalidValueError, ShapeError
        No friction model; one of another number of joints.

    Examples
    --------
    >>> from robotmodels.friction import ViscousFriction
    >>> check_friction(ViscousFriction([1.0]), 1).n
    1
    """
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
    """Refuse a friction model that regressors have no columns of.

    Parameters
    ----------
    friction : Friction
        A friction model.

    Returns
    -------
    LinearFriction
        The same.

    Raises
    ------
    InvalidValueError
        It is not linear in parameters.

    Examples
    --------
    >>> from robotmodels.friction import ViscousFriction
    >>> check_linear(ViscousFriction([1.0])).kinds
    ('Fv',)
    """
    if not isinstance(friction, LinearFriction):
        raise InvalidValueError(
            f"friction: {type(friction).__name__} is not linear in parameters (no kinds, "
            "parameters and basis), so that a regressor has no columns of it."
        )
    return friction
