"""Viscous friction, Coulomb friction, and a constant torque."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector
from .joint import JointFriction


@dataclass(frozen=True, slots=True, init=False, eq=False)
class ViscousFriction(JointFriction):
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
class CoulombFriction(JointFriction):
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
class TorqueOffset(JointFriction):
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
