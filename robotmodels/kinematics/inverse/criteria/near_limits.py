"""Nearness to joint limits, which does not matter in the middle of the ranges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...._arrays import Array, as_vector
from ....errors import InvalidValueError
from ....model import RobotModel
from .criterion import checked_positive
from .joint_limits import checked_limit, ranges


@dataclass(frozen=True, slots=True, eq=False)
class NearLimitCriterion:
    """Half the sum of squares of how deep joints are in the margins of their ranges; small is good.

    ``h = (|x| - 1 + margin) / margin`` where positive, with x = -1 and 1 at the limits: 0 at the
    border of the margin, 1 at the limit, more beyond. Joints outside the margins are left alone.

    Parameters
    ----------
    margin : float
        Part of half the range, in (0, 1], that counts as near the limit.
    gain : float
        Factor of the gradient, rad^2/s.
    lower, upper : array_like, shape (n,) or (), optional
        Limits, rad or m; default the robot's. Joints with an infinite limit, or with no range, do
        not count.

    Raises
    ------
    ShapeError, InvalidValueError
        Limits that are no vectors or NaN; a margin outside (0, 1], a gain that is not positive.

    References
    ----------
    Seed book section 1.3.2.4.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> criterion = NearLimitCriterion(margin=0.5, lower=-1.0, upper=1.0)
    >>> criterion.gradient(load("planar_2r"), [0.4, 1.0])
    array([-0., -2.])
    """

    margin: float = 0.3
    gain: float = 1.0
    lower: Array | None = None
    upper: Array | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "gain", checked_positive(self.gain, "gain"))
        object.__setattr__(self, "margin", checked_positive(self.margin, "margin"))
        if self.margin > 1.0:
            raise InvalidValueError(f"margin: expected at most 1, got {self.margin!r}.")
        for name in ("lower", "upper"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, checked_limit(getattr(self, name), name))

    def value(self, model: RobotModel, q: ArrayLike) -> Array:
        """Half the sum of the squared depths, see `Criterion.value`."""
        _, _, depth = self._depths(model, q)
        return np.asarray(0.5 * (depth**2).sum(axis=-1))

    def gradient(self, model: RobotModel, q: ArrayLike) -> Array:
        """Velocities away from near limits, see `Criterion.gradient`."""
        x, inverse, depth = self._depths(model, q)
        return -self.gain * depth * np.sign(x) * (2.0 * inverse / self.margin)

    def _depths(self, model: RobotModel, q: ArrayLike) -> tuple[Array, Array, Array]:
        middle, inverse = ranges(model, self.lower, self.upper)
        x = 2.0 * inverse * (as_vector(q, model.n, "q") - middle)
        return x, inverse, np.maximum(0.0, (np.abs(x) - 1.0 + self.margin) / self.margin)
