"""What a criterion is: a number for each configuration, and joint velocities that improve it."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from ...._arrays import Array, as_reals
from ....errors import InvalidValueError
from ....model import RobotModel


@runtime_checkable
class Criterion(Protocol):
    """Anything with a value and a gradient; `ikm` takes it as ``secondary``.

    Examples
    --------
    >>> from robotmodels.kinematics.inverse.criteria.posture import PostureCriterion
    >>> isinstance(PostureCriterion([0.0, 0.0]), Criterion)
    True
    """

    def value(self, model: RobotModel, q: ArrayLike) -> Array:
        """What the criterion measures.

        Parameters
        ----------
        model : RobotModel
            The robot, n joints.
        q : array_like, shape (..., n)
            Joint variables, rad or m.

        Returns
        -------
        ndarray, shape (...)
            Values; whether large or small ones are good is the criterion's.
        """
        ...

    def gradient(self, model: RobotModel, q: ArrayLike) -> Array:
        """Joint velocities that improve the value: its gradient with the right sign, times a gain.

        Parameters
        ----------
        model : RobotModel
            The robot, n joints.
        q : array_like, shape (..., n)
            Joint variables, rad or m.

        Returns
        -------
        ndarray, shape (..., n)
            The z of ``v = J^+ x + (I - J^+ J) z``, rad/s or m/s.
        """
        ...


def checked_positive(value: ArrayLike, name: str) -> float:
    """A positive finite number."""
    number = as_reals(value, name)
    if number.ndim or not 0.0 < number < np.inf:
        raise InvalidValueError(f"{name}: expected a positive number, got {value!r}.")
    return float(number)
