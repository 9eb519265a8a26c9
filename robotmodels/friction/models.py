"""Friction models whose parameters are arrays of one number for each joint.

``torque(v)`` is the torque that the joints need to overcome friction; dry friction is zero at
rest. ``basis(v)`` is the torque per unit of each parameter, in the order of ``kinds``;
``breakaway`` the torques (2, n) between which a joint at rest sticks.

Parameters
----------
Fv, Fc, ... : array_like, shape (n,)
    Viscous friction in N m s/rad (N s/m for prismatic joints), dry friction and offsets in N m (N).
v : array_like, shape (..., n)
    Joint velocities, rad/s or m/s.

Returns
-------
ndarray, shape (..., n) or (..., k, n)
    Torques in N m or N, or torques per unit of each of the k parameters.

Raises
------
ShapeError, InvalidValueError
    Lengths that differ; NaN or infinity.

References
----------
Book section 1.5.1.4; B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, "A survey of
models, analysis tools and compensation methods for the control of machines with friction",
Automatica 30(7), 1994, section 2.

Examples
--------
>>> gears = AsymmetricFriction(Fvp=[1.0], Fcp=[2.0], Fvn=[3.0], Fcn=[4.0])
>>> gears.torque([[1.0], [0.0], [-1.0]]).ravel()
array([ 3.,  0., -7.])
>>> (StribeckFriction([0.0], [1.0], [1.5], vs=[0.01]) + TorqueOffset([0.5])).torque([1e-9])
array([2.])
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Value, as_floats, as_vector, check_same_length, read_only
from ..errors import InvalidValueError
from .protocols import Summable


@dataclass(frozen=True, slots=True, eq=False)
class OfJoints(Value):
    """Base: parameters of shape (n,) that the fields name."""

    def __post_init__(self) -> None:
        names = [field.name for field in fields(self)]
        values = {name: as_floats(getattr(self, name), name) for name in names}
        check_same_length(values, "Friction")
        for name, array in values.items():
            object.__setattr__(self, name, read_only(array))

    @property
    def n(self) -> int:
        """Number of joints."""
        return getattr(self, fields(self)[0].name).size


@dataclass(frozen=True, slots=True, eq=False)
class JointFriction(Summable, OfJoints, ABC):
    """Base: friction that is linear in the parameters `kinds`; a subclass defines `_columns`."""

    kinds: ClassVar[tuple[str, ...]] = ()

    @property
    def parameters(self) -> Array:
        """Values of the parameters that the torque is linear in, shape (k, n)."""
        return np.stack([getattr(self, kind) for kind in self.kinds])

    @abstractmethod
    def _columns(self, v: Array) -> tuple[Array, ...]:
        """Torque per unit of each parameter at velocities, each (..., n)."""

    def basis(self, v: ArrayLike) -> Array:
        """Torque per unit of each parameter of its joint, shape (..., k, n)."""
        return np.stack(self._columns(as_vector(v, self.n, "v")), axis=-2)

    def torque(self, v: ArrayLike) -> Array:
        """Torque that the joints need to overcome friction, shape (..., n)."""
        return (self.basis(v) * self.parameters).sum(axis=-2)


@dataclass(frozen=True, slots=True, eq=False)
class ViscousFriction(JointFriction):
    """Viscous friction, ``tau = Fv v``."""

    kinds: ClassVar[tuple[str, ...]] = ("Fv",)
    Fv: Any

    def _columns(self, v: Array) -> tuple[Array, ...]:
        return (v,)


@dataclass(frozen=True, slots=True, eq=False)
class CoulombFriction(JointFriction):
    """Coulomb (dry) friction, ``tau = Fc sign(v)``."""

    kinds: ClassVar[tuple[str, ...]] = ("Fc",)
    Fc: Any

    def _columns(self, v: Array) -> tuple[Array, ...]:
        return (np.sign(v),)


@dataclass(frozen=True, slots=True, eq=False)
class TorqueOffset(JointFriction):
    """Constant torque, as of friction that differs by direction or of an amplifier."""

    kinds: ClassVar[tuple[str, ...]] = ("offset",)
    offset: Any

    def _columns(self, v: Array) -> tuple[Array, ...]:
        return (np.ones_like(v),)


@dataclass(frozen=True, slots=True, eq=False)
class AsymmetricFriction(JointFriction):
    """Coulomb and viscous friction that differ by direction.

    ``tau = Fvp v + Fcp`` for v > 0, ``tau = Fvn v - Fcn`` for v < 0: positive numbers dissipate in
    both directions.
    """

    kinds: ClassVar[tuple[str, ...]] = ("Fvp", "Fcp", "Fvn", "Fcn")
    Fvp: Any
    Fcp: Any
    Fvn: Any
    Fcn: Any

    def _columns(self, v: Array) -> tuple[Array, ...]:
        forth, back = np.maximum(v, 0.0), np.minimum(v, 0.0)
        return forth, np.sign(forth), back, np.sign(back)


@dataclass(frozen=True, slots=True, eq=False)
class StribeckFriction(JointFriction):
    """Stribeck friction: decreases from the static value with the velocity.

    ``tau = Fv v + (Fc + (Fs - Fc) exp(-|v / vs|^exponent)) sign(v)``, linear in Fv, Fc and Fs for
    given Stribeck velocity ``vs`` and ``exponent`` (default 2), both (n,) and positive; static
    friction is ``Fs >= Fc >= 0``, and ``Fv >= 0``.
    """

    kinds: ClassVar[tuple[str, ...]] = ("Fv", "Fc", "Fs")
    Fv: Any
    Fc: Any
    Fs: Any
    vs: Any
    exponent: Any = None

    def __post_init__(self) -> None:
        if self.exponent is None:
            object.__setattr__(self, "exponent", np.full(np.shape(self.vs), 2.0))
        OfJoints.__post_init__(self)
        for name in ("vs", "exponent"):
            if ((values := getattr(self, name)) <= 0.0).any():
                raise InvalidValueError(f"{name}: expected positive numbers, got {values.min()}.")
        for name, least in (("Fv", 0.0 * self.Fv), ("Fc", 0.0 * self.Fv), ("Fs", self.Fc)):
            values = getattr(self, name)
            for j in np.flatnonzero(values < least)[:1]:
                raise InvalidValueError(
                    f"{name}: friction of joint {j + 1} ({values[j]:g}) is less than its bound "
                    f"({least[j]:g}); expected Fv >= 0 and Fs >= Fc >= 0."
                )

    def _columns(self, v: Array) -> tuple[Array, ...]:
        with np.errstate(over="ignore", under="ignore"):  # zero far above vs
            fallen = np.exp(-((np.abs(v) / self.vs) ** self.exponent))
        sign = np.sign(v)
        return v, (1.0 - fallen) * sign, fallen * sign


@dataclass(frozen=True, slots=True, eq=False)
class LoadFriction(OfJoints):
    """Load-dependent dry friction of gears, ``tau = Fl |load| sign(v)``.

    The load is the torque that the gears carry. It depends on positions and accelerations, so that
    this is not a `Friction`. P. Hamon, M. Gautier and P. Garrec, "Dynamic identification of robots
    with a dry friction model depending on load and velocity", IEEE/RSJ IROS 2010, (9).
    """

    Fl: Any

    def under_load(self, v: ArrayLike, load: ArrayLike) -> Array:
        """Torque that the joints need to overcome friction at velocities and loads (..., n)."""
        carried = np.abs(as_vector(load, self.n, "load"))
        return self.Fl * carried * np.sign(as_vector(v, self.n, "v"))
