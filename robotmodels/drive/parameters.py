"""Drive parameters of the joints: rotor inertia, friction and offset.

Seed book sections 1.5.1.4 (friction) and 1.5.1.5 (rotor inertia).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import LARGEST, Array, as_bounded, read_only, same_value, value_hash
from ..errors import InertiaError, ShapeError


@dataclass(frozen=True, slots=True, init=False, eq=False)
class DriveParameters:
    """Drive terms of each joint, seen from the joint side.

    ``tau_drive = Ia * a + Fv * v + Fc * sign(v) + offset``. Any real values are legal.

    Parameters
    ----------
    Ia : array_like, shape (n,), optional
        Inertia of rotor and gears on the joint side (gear ratio squared times rotor inertia),
        kg m^2 or kg.
    Fv : array_like, shape (n,), optional
        Viscous friction, N m s/rad or N s/m.
    Fc : array_like, shape (n,), optional
        Coulomb friction, N m or N.
    offset : array_like, shape (n,), optional
        Constant torque or force, N m or N. What is left out is zero; give at least one.

    Raises
    ------
    ShapeError, InvalidValueError
        Lengths that differ; NaN or infinity.

    References
    ----------
    Seed book sections 1.5.1.4 and 1.5.1.5.

    Examples
    --------
    >>> DriveParameters(Fv=[1.0, 2.0]).Ia
    array([0., 0.])
    """

    Ia: Array
    Fv: Array
    Fc: Array
    offset: Array

    def __init__(
        self,
        Ia: ArrayLike | None = None,
        Fv: ArrayLike | None = None,
        Fc: ArrayLike | None = None,
        offset: ArrayLike | None = None,
    ) -> None:
        given = {"Ia": Ia, "Fv": Fv, "Fc": Fc, "offset": offset}
        values = {name: as_bounded(v, name, LARGEST) for name, v in given.items() if v is not None}
        if not values:
            raise InertiaError("Give at least one of Ia, Fv, Fc, offset, each of shape (n,).")
        shape = next(iter(values.values())).shape
        if len(shape) != 1 or any(array.shape != shape for array in values.values()):
            shapes = ", ".join(f"{name} {array.shape}" for name, array in values.items())
            raise ShapeError(f"Drive parameters are all of shape (n,), got {shapes}.")
        for name in given:
            object.__setattr__(self, name, read_only(values.get(name, np.zeros(shape))))

    @classmethod
    def zeros(cls, n: int) -> Self:
        """Drives without inertia, friction or offset.

        Parameters
        ----------
        n : int
            Number of joints.

        Returns
        -------
        DriveParameters
            All zero.

        Examples
        --------
        >>> DriveParameters.zeros(2).n
        2
        """
        return cls(Ia=np.zeros(n))

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.Ia.size

    @property
    def is_zero(self) -> bool:
        """Whether every parameter is zero."""
        return not (self.Ia.any() or self.Fv.any() or self.Fc.any() or self.offset.any())

    def __reduce__(self) -> tuple[Any, ...]:  # rebuilt, so that a copy is read-only as well
        return type(self), tuple(getattr(self, f.name) for f in fields(self))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, DriveParameters):
            return NotImplemented
        return all(same_value(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))

    def __hash__(self) -> int:
        return value_hash(self.Ia, self.Fv, self.Fc, self.offset)
