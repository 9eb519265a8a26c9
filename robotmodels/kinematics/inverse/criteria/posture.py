"""Nearness to a preferred posture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...._arrays import Array, Rebuilt, as_exact, as_floats, as_vector, read_only
from ....errors import InvalidValueError, ShapeError
from ....model import RobotModel, check_model
from .criterion import checked_positive


@dataclass(frozen=True, slots=True, eq=False)
class PostureCriterion(Rebuilt):
    """Weighted distance from a posture, ``sum(weights (q - q_ref)^2) / 2``; small is good.

    Angles are compared as they stand, without whole turns: a joint returns the way it came.

    Parameters
    ----------
    q_ref : array_like, shape (n,)
        The posture, rad or m.
    weights : array_like, shape (n,), optional
        Not negative; default ones. Zero leaves a joint out.
    gain : float
        Rate at which a joint of weight 1 that nothing else moves returns, 1/s.

    Raises
    ------
    ShapeError, InvalidValueError
        Not vectors of one length; weights that are negative, a gain that is not positive.

    References
    ----------
    Seed book section 1.3.2.4; A. Liegeois 1977.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> home = PostureCriterion([0.0, 1.0], gain=2.0)
    >>> home.value(load("planar_2r"), [0.5, 1.0]), home.gradient(load("planar_2r"), [0.5, 1.0])
    (array(0.125), array([-1., -0.]))
    """

    q_ref: Array
    weights: Array | None = None
    gain: float = 1.0

    def __post_init__(self) -> None:
        q_ref = as_floats(self.q_ref, "q_ref")
        if q_ref.ndim != 1:
            raise ShapeError(f"q_ref: expected shape (n,), got {q_ref.shape}.")
        weights = np.ones(q_ref.size)
        if self.weights is not None:
            weights = as_exact(self.weights, q_ref.shape, "weights")
        if (weights < 0.0).any():
            raise InvalidValueError(f"weights: expected none below zero, got {weights}.")
        object.__setattr__(self, "q_ref", read_only(q_ref))
        object.__setattr__(self, "weights", read_only(weights))
        object.__setattr__(self, "gain", checked_positive(self.gain, "gain"))

    def value(self, model: RobotModel, q: ArrayLike) -> Array:
        """Half the weighted squared distance, see `Criterion.value`."""
        away = self._away(model, q)
        return np.asarray(0.5 * (np.asarray(self.weights) * away**2).sum(axis=-1))

    def gradient(self, model: RobotModel, q: ArrayLike) -> Array:
        """Velocities towards the posture, see `Criterion.gradient`."""
        return -self.gain * np.asarray(self.weights) * self._away(model, q)

    def _away(self, model: RobotModel, q: ArrayLike) -> Array:
        check_model(model)
        if self.q_ref.shape != (model.n,):
            raise ShapeError(
                f"q_ref: expected shape ({model.n},), one value for each joint of the robot, got "
                f"{self.q_ref.shape}."
            )
        return as_vector(q, model.n, "q") - self.q_ref
