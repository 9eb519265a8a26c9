"""Friction models of the joints, beside the viscous and Coulomb terms of `DriveParameters`.

Seed book section 1.5.1.4. A model is a value with ``.torque(v)``; where the torque is linear in
the parameters, ``.basis(v)`` gives the columns that multiply them, for identification.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import Array, as_floats, as_vector, read_only, same_value, value_hash
from .errors import InvalidValueError, ShapeError

_SLOWEST = 5e-324  # the smallest velocity that has a sign
_NOTHING = 1e-300  # what viscous friction takes at it


@runtime_checkable
class Friction(Protocol):
    """What `idm` and `ddm` need of a friction model; models of your own may have just this."""

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


@dataclass(frozen=True, slots=True, init=False, eq=False)
class _JointFriction:
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
        return _breakaway(self)

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
        raise NotImplementedError

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

    def __reduce__(self) -> tuple[Any, ...]:  # rebuilt, so that a copy is read-only as well
        return type(self), tuple(getattr(self, f.name) for f in fields(self))

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(same_value(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))

    def __hash__(self) -> int:
        return value_hash(type(self).__name__, *(getattr(self, f.name) for f in fields(self)))


@dataclass(frozen=True, slots=True, init=False, eq=False)
class ViscousFriction(_JointFriction):
    """``tau = Fv v``.

    Parameters
    ----------
    Fv : array_like, shape (n,)
        N m s/rad or N s/m.

    Raises
    ------
    ShapeError, InvalidValueError
        Not one number for each joint; NaN or infinity.

    References
    ----------
    Seed book section 1.5.1.4.

    Examples
    --------
    >>> ViscousFriction([2.0]).torque([-0.5])
    array([-1.])
    """

    kinds: ClassVar[tuple[str, ...]] = ("Fv",)
    Fv: Array

    def __init__(self, Fv: ArrayLike) -> None:
        self._set(Fv=Fv)

    def basis(self, v: ArrayLike) -> Array:
        """Torque per unit of each parameter, see `LinearFriction`."""
        return as_vector(v, self.n, "v")[..., None, :] + 0.0


@dataclass(frozen=True, slots=True, init=False, eq=False)
class CoulombFriction(_JointFriction):
    """``tau = Fc sign(v)``.

    Parameters
    ----------
    Fc : array_like, shape (n,)
        N m or N.

    Raises
    ------
    ShapeError, InvalidValueError
        Not one number for each joint; NaN or infinity.

    References
    ----------
    Seed book section 1.5.1.4.

    Examples
    --------
    >>> CoulombFriction([2.0]).torque([[-0.5], [0.0], [3.0]]).ravel()
    array([-2.,  0.,  2.])
    """

    kinds: ClassVar[tuple[str, ...]] = ("Fc",)
    Fc: Array

    def __init__(self, Fc: ArrayLike) -> None:
        self._set(Fc=Fc)

    def basis(self, v: ArrayLike) -> Array:
        """Torque per unit of each parameter, see `LinearFriction`."""
        return np.sign(as_vector(v, self.n, "v"))[..., None, :]


@dataclass(frozen=True, slots=True, init=False, eq=False)
class TorqueOffset(_JointFriction):
    """A constant torque: what friction that differs by direction, or an amplifier, leaves.

    Parameters
    ----------
    offset : array_like, shape (n,)
        N m or N.

    Raises
    ------
    ShapeError, InvalidValueError
        Not one number for each joint; NaN or infinity.

    References
    ----------
    Seed book section 1.5.1.4.

    Examples
    --------
    >>> TorqueOffset([2.0]).torque([-0.5])
    array([2.])
    """

    kinds: ClassVar[tuple[str, ...]] = ("offset",)
    offset: Array

    def __init__(self, offset: ArrayLike) -> None:
        self._set(offset=offset)

    def basis(self, v: ArrayLike) -> Array:
        """Torque per unit of each parameter, see `LinearFriction`."""
        return np.ones_like(as_vector(v, self.n, "v"))[..., None, :]


@dataclass(frozen=True, slots=True, init=False, eq=False)
class AsymmetricFriction(_JointFriction):
    """Coulomb and viscous friction that differ by direction.

    ``tau = Fvp v + Fcp`` for v > 0, ``tau = Fvn v - Fcn`` for v < 0.

    Parameters
    ----------
    Fvp, Fcp : array_like, shape (n,)
        Viscous and Coulomb friction of positive velocities.
    Fvn, Fcn : array_like, shape (n,)
        The same of negative velocities; positive numbers dissipate in both directions.

    Raises
    ------
    ShapeError, InvalidValueError
        Lengths that differ; NaN or infinity.

    References
    ----------
    Seed book section 1.5.1.4; B. Armstrong, "Control of machines with friction", 1991.

    Examples
    --------
    >>> gears = AsymmetricFriction(Fvp=[1.0], Fcp=[2.0], Fvn=[3.0], Fcn=[4.0])
    >>> gears.torque([[1.0], [-1.0]]).ravel()
    array([ 3., -7.])
    """

    kinds: ClassVar[tuple[str, ...]] = ("Fvp", "Fcp", "Fvn", "Fcn")
    Fvp: Array
    Fcp: Array
    Fvn: Array
    Fcn: Array

    def __init__(self, Fvp: ArrayLike, Fcp: ArrayLike, Fvn: ArrayLike, Fcn: ArrayLike) -> None:
        self._set(Fvp=Fvp, Fcp=Fcp, Fvn=Fvn, Fcn=Fcn)

    def basis(self, v: ArrayLike) -> Array:
        """Torque per unit of each parameter, see `LinearFriction`."""
        v = as_vector(v, self.n, "v")
        forth, back = np.maximum(v, 0.0), np.minimum(v, 0.0)
        return np.stack([forth, np.sign(forth), back, np.sign(back)], axis=-2)


@dataclass(frozen=True, slots=True, init=False, eq=False)
class StribeckFriction(_JointFriction):
    """Friction that falls from its static value as the joint starts to move.

    ``tau = Fv v + (Fc + (Fs - Fc) exp(-|v / vs|^exponent)) sign(v)``, linear in Fv, Fc and Fs for
    given ``vs`` and ``exponent``.

    Parameters
    ----------
    Fv, Fc, Fs : array_like, shape (n,)
        Viscous, Coulomb and static friction.
    vs : array_like, shape (n,)
        Stribeck velocity, positive, rad/s or m/s.
    exponent : array_like, shape (n,), optional
        Positive, default 2 for every joint.

    Raises
    ------
    ShapeError, InvalidValueError
        Lengths that differ; NaN or infinity; a velocity or exponent that is not positive.

    References
    ----------
    Seed book section 1.5.1.4; B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, "A survey of
    models, analysis tools and compensation methods for the control of machines with friction",
    Automatica 30(7), 1994, section 2.

    Examples
    --------
    >>> slide = StribeckFriction(Fv=[0.0], Fc=[1.0], Fs=[1.5], vs=[0.01])
    >>> slide.torque([[1e-9], [1.0]]).ravel()
    array([1.5, 1. ])
    """

    kinds: ClassVar[tuple[str, ...]] = ("Fv", "Fc", "Fs")
    Fv: Array
    Fc: Array
    Fs: Array
    vs: Array
    exponent: Array

    def __init__(
        self,
        Fv: ArrayLike,
        Fc: ArrayLike,
        Fs: ArrayLike,
        vs: ArrayLike,
        exponent: ArrayLike | None = None,
    ) -> None:
        power = np.full(np.shape(vs), 2.0) if exponent is None else exponent
        self._set(Fv=Fv, Fc=Fc, Fs=Fs, vs=vs, exponent=power)
        for name in ("vs", "exponent"):
            values = getattr(self, name)
            if (values <= 0.0).any():
                raise InvalidValueError(f"{name}: expected positive numbers, got {values.min()}.")

    def basis(self, v: ArrayLike) -> Array:
        """Torque per unit of each parameter, see `LinearFriction`."""
        v = as_vector(v, self.n, "v")
        with np.errstate(over="ignore", under="ignore"):  # far from vs nothing of it is left
            fallen = np.exp(-((np.abs(v) / self.vs) ** self.exponent))
        sign = np.sign(v)
        return np.stack([v, (1.0 - fallen) * sign, fallen * sign], axis=-2)


@dataclass(frozen=True, slots=True)
class FrictionSum:
    """Several friction models that act together.

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
    >>> both = FrictionSum((ViscousFriction([1.0]), CoulombFriction([2.0])))
    >>> both.torque([3.0]), both.kinds
    (array([5.]), ('Fv', 'Fc'))
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
        return _breakaway(self)

    def basis(self, v: ArrayLike) -> Array:
        """Torque per unit of each parameter, see `LinearFriction`."""
        return np.concatenate([part.basis(v) for part in self._linear], axis=-2)

    def torque(self, v: ArrayLike) -> Array:
        """Torque that the joints need to overcome friction, shape (..., n)."""
        return np.sum([part.torque(v) for part in self.parts], axis=0)

    @property
    def _linear(self) -> tuple[LinearFriction, ...]:
        return tuple(check_linear(part) for part in self.parts)


def _breakaway(friction: Friction) -> Array:
    """Limits of the torque from below and above zero velocity, sorted."""
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
    >>> check_linear(ViscousFriction([1.0])).kinds
    ('Fv',)
    """
    if not isinstance(friction, LinearFriction):
        raise InvalidValueError(
            f"friction: {type(friction).__name__} is not linear in parameters (no kinds, "
            "parameters and basis), so that a regressor has no columns of it."
        )
    return friction
