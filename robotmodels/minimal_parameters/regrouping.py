"""The standard parameters that stay, and what has been regrouped into each, while rules run."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..model import RobotModel

Combination = dict[int, Any]
"""Coefficients of standard parameters by their number; numbers or formulas."""

_J = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
XX, YY, ZZ, MX, MY, MZ, M = 0, 3, 5, 6, 7, 8, 9


class Regrouping:
    """The standard parameters that stay, and what has been regrouped into each, while rules run."""

    def __init__(self, model: RobotModel, columns: int) -> None:
        self.antecedent = [int(a) for a in model.chain.antecedent]
        self.stays: dict[int, Combination] = {k: {k: 1} for k in range(columns)}

    def take(self, parameter: int) -> Combination:
        """Remove a parameter; what stood for it."""
        return self.stays.pop(parameter)

    def add(self, parameter: int, factor: Any, combination: Combination) -> None:
        """Regroup a combination into a parameter; one without effect takes nothing."""
        place = self.stays.get(parameter)
        if place is None or _is_zero(factor):
            return
        for k, coefficient in combination.items():
            total = place.get(k, 0) + factor * coefficient
            if _is_zero(total):
                place.pop(k, None)
            else:
                place[k] = total

    def add_tensor(self, frame: int, tensor: Array, combination: Combination) -> None:
        """Regroup into the inertia tensor of a frame; frame 0 does not move."""
        if frame:
            for place, (i, k) in enumerate(_J):
                self.add(10 * (frame - 1) + place, tensor[i, k], combination)

    def add_moment(self, frame: int, moment: Array, P: Array, combination: Combination) -> None:
        """Regroup a first moment at P into a frame."""
        if frame:
            for i in range(3):
                self.add(10 * (frame - 1) + MX + i, moment[i], combination)
            crossed = _skew(P).T @ _skew(moment)
            self.add_tensor(frame, crossed + crossed.T, combination)

    def add_mass(self, frame: int, P: Array, combination: Combination) -> None:
        """Regroup a mass at P into a frame."""
        if frame:
            self.add(10 * (frame - 1) + M, 1, combination)
            for i in range(3):
                self.add(10 * (frame - 1) + MX + i, P[i], combination)
            self.add_tensor(frame, _skew(P).T @ _skew(P), combination)


def unit_tensor(place: int) -> NDArray[np.int64]:
    """The inertia tensor whose parameter at a place, XX to ZZ, is 1 and whose others are 0."""
    tensor = np.zeros((3, 3), dtype=np.int64)
    i, k = _J[place]
    tensor[i, k] = tensor[k, i] = 1
    return tensor


def _skew(p: Array) -> Array:
    return np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0]])


def _is_zero(value: Any) -> bool:
    return bool(value == 0) or (isinstance(value, float) and abs(value) < 1e-14)
