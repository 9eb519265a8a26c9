"""Friction that differs by direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector
from .joint import JointFriction


@dataclass(frozen=True, slots=True, init=False, eq=False)
class AsymmetricFriction(JointFriction):
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
