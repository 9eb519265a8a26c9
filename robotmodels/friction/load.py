"""Dry friction of gears that grows with the torque they carry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Rebuilt, as_floats, as_vector, read_only
from ..errors import ShapeError


@dataclass(frozen=True, slots=True, init=False, eq=False)
class LoadFriction(Rebuilt):
    """``tau = Fl |load| sign(v)``, where the load is the torque that the gears carry.

    It is no `Friction`, which depends on the velocity alone: what a gear carries depends on
    positions and accelerations.

    Parameters
    ----------
    Fl : array_like, shape (n,)
        Part of the load that friction takes, without unit.

    Raises
    ------
    ShapeError, InvalidValueError
        Not one number for each joint; NaN or infinity.

    References
    ----------
    P. Hamon, M. Gautier and P. Garrec, "Dynamic identification of robots with a dry friction model
    depending on load and velocity", IEEE/RSJ IROS 2010, (9).

    Examples
    --------
    >>> LoadFriction([0.1]).under_load([[-2.0], [3.0]], [[50.0], [-40.0]]).ravel()
    array([-5.,  4.])
    """

    Fl: Array

    def __init__(self, Fl: ArrayLike) -> None:
        values = as_floats(Fl, "Fl")
        if values.ndim != 1:
            raise ShapeError(f"Fl: expected one number for each joint, got shape {values.shape}.")
        object.__setattr__(self, "Fl", read_only(values))

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.Fl.size

    def under_load(self, v: ArrayLike, load: ArrayLike) -> Array:
        """Torque that the joints need to overcome friction.

        Parameters
        ----------
        v : array_like, shape (..., n)
            Joint velocities, rad/s or m/s.
        load : array_like, shape (..., n)
            Torque that the gears carry to the links, N m or N.

        Returns
        -------
        ndarray, shape (..., n)
            N m or N.
        """
        carried = np.abs(as_vector(load, self.n, "load"))
        return self.Fl * carried * np.sign(as_vector(v, self.n, "v"))
