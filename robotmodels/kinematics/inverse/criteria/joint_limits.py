"""Distance of the joints from the middle of their ranges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...._arrays import Array, Rebuilt, as_reals, as_vector, read_only
from ....errors import InvalidValueError, ShapeError
from ....model import RobotModel, check_model
from .criterion import checked_positive

__all__ = ["JointLimitCriterion", "ranges"]


@dataclass(frozen=True, slots=True, eq=False)
class JointLimitCriterion(Rebuilt):
    """``sum(((q - middle) / (upper - lower))^2)`` over joints that have limits; small is good.

    Parameters
    ----------
    gain : float
        Factor of the gradient, rad^2/s.
    lower, upper : array_like, shape (n,) or (), optional
        Limits, rad or m; default the robot's. Joints with an infinite limit, or with no range, do
        not count.

    Raises
    ------
    ShapeError, InvalidValueError
        Limits that are no vectors or NaN; a gain that is not positive. Limits that do not fit the
        robot are refused when it is known.

    References
    ----------
    Seed book section 1.3.2.4; A. Fournier 1980, A. Liegeois 1977.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> criterion = JointLimitCriterion(lower=[-1.0, -2.0], upper=[1.0, 2.0])
    >>> criterion.value(load("planar_2r"), [1.0, 0.0])
    array(0.25)
    >>> criterion.gradient(load("planar_2r"), [1.0, 1.0])
    array([-0.5  , -0.125])
    """

    gain: float = 1.0
    lower: Array | None = None
    upper: Array | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "gain", checked_positive(self.gain, "gain"))
        for name in ("lower", "upper"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, checked_limit(getattr(self, name), name))

    def value(self, model: RobotModel, q: ArrayLike) -> Array:
        """Sum of squared relative distances from the middle, see `Criterion.value`."""
        middle, inverse = ranges(model, self.lower, self.upper)
        return np.asarray(((inverse * (as_vector(q, model.n, "q") - middle)) ** 2).sum(axis=-1))

    def gradient(self, model: RobotModel, q: ArrayLike) -> Array:
        """Velocities towards the middle, see `Criterion.gradient`."""
        middle, inverse = ranges(model, self.lower, self.upper)
        return -2.0 * self.gain * inverse**2 * (as_vector(q, model.n, "q") - middle)


def checked_limit(value: ArrayLike, name: str) -> Array:
    """A limit given to a criterion: a number or a vector, maybe infinite."""
    array = as_reals(value, name)
    if array.ndim > 1:
        raise ShapeError(f"{name}: expected shape (n,) or a number, got {array.shape}.")
    if np.isnan(array).any():
        raise InvalidValueError(f"{name}: NaN is no limit; infinity is none at all.")
    return read_only(array)


def ranges(model: RobotModel, lower: Array | None, upper: Array | None) -> tuple[Array, Array]:
    """Middles of the joints' ranges and the inverses of their widths, 0 where there is no range."""
    check_model(model)
    low = model.lower if lower is None else lower
    high = model.upper if upper is None else upper
    for name, limit in (("lower", low), ("upper", high)):
        if limit.shape not in ((), (model.n,)):
            raise ShapeError(
                f"{name}: expected shape ({model.n},), one for each joint of the robot, got "
                f"{limit.shape}."
            )
    low, high = np.broadcast_to(low, (model.n,)), np.broadcast_to(high, (model.n,))
    if (low > high).any():
        j = int(np.argmax(low > high))
        raise InvalidValueError(
            f"lower, upper: expected lower <= upper, got [{low[j]}, {high[j]}] for joint {j} "
            f"({model.table.joint_names[j]!r})."
        )
    counts = np.isfinite(low) & np.isfinite(high) & (low < high)
    middle, inverse = np.zeros(model.n), np.zeros(model.n)
    middle[counts] = 0.5 * (low[counts] + high[counts])
    inverse[counts] = 1.0 / (high[counts] - low[counts])
    return middle, inverse
