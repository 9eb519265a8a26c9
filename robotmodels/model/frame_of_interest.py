"""A frame whose pose or Jacobian can be asked for, as the fast paths take it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array


@dataclass(frozen=True, slots=True)
class FrameOfInterest:
    """A frame whose pose or Jacobian can be asked for.

    Parameters
    ----------
    parent : int
        Number of the table's frame it is fixed to; 0 is R_0.
    path : ndarray of int, shape (k,)
        Numbers of the table's frames from the base to the parent.
    rotation : ndarray, shape (3, 3)
        Axes in the parent frame.
    position : ndarray, shape (3,)
        Origin in the parent frame, metres.
    pin_id : int
        Number of the same frame in the Pinocchio model.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.model import RobotModel
    >>> RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0])).twin.frame(2).path
    array([1, 2])
    """

    parent: int
    path: NDArray[np.int64]
    rotation: Array
    position: Array
    pin_id: int

    @property
    def kernel_arguments(self) -> tuple[NDArray[np.int64], Array, Array]:
        """What compiled kernels take: path, rotation, position."""
        return self.path, self.rotation, self.position
