"""The function that is made small: criterion and penalties of limits, with its gradient."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..._arrays import Array
from ...minimal_parameters import BaseParameters, base_parameters
from ...model import RobotModel
from ...trajectories import MotionLimits
from .basis import MotionBasis
from .boxes import WorkspaceBox, box_slacks
from .criterion import ExcitationCriterion, log_volume, smooth_condition
from .stacked import StackedRegressor

_STILL = 0.02  # of the limit of velocity: where the smooth sign of dry friction turns
_BOX = 0.25  # metres that count in a box like half the range of a joint


@dataclass(frozen=True, slots=True)
class Stage:
    """Smoothing and penalty of one stage of the search."""

    power: float
    penalty: float


class ExcitationProblem:
    """Criterion and limit penalties as a function of a motion's coefficients."""

    def __init__(
        self,
        model: RobotModel,
        basis: MotionBasis,
        base: BaseParameters,
        criterion: ExcitationCriterion,
        limits: MotionLimits,
        torque_limits: Array,
        boxes: Sequence[WorkspaceBox],
        samples: int,
        sigma: Array,
        scale: Array,
        margin: float,
    ) -> None:
        self.model, self.basis, self.base, self.criterion = model, basis, base, criterion
        self.limits, self.torque_limits, self.boxes = limits, torque_limits, tuple(boxes)
        self.margin = margin
        self.t = basis.duration / samples * np.arange(samples, dtype=np.float64)
        self.orders = 4 if np.isfinite(limits.jerk).any() else 3
        self.functions = [basis.at(self.t, order) for order in range(self.orders)]
        names, drive, values = tuple(base.names), base.drive, np.zeros(len(base))
        if np.isfinite(torque_limits).any():
            names, drive, values = _with_torques(base, model)
        self.values = values
        width = _STILL * np.minimum(limits.velocity, -limits.velocity_lower)
        self.regressor = StackedRegressor(model, names, drive, width)
        self.weight = scale / sigma[:, None]
        self.bounds = [self._bounds(order) for order in range(self.orders)]
        self.units = self._units()

    @property
    def work(self) -> float:
        """Cost of an evaluation, in multiplications of the factor and of its powers."""
        N, n, b = len(self.t), self.model.n, len(self.base)
        return 1e6 + N * n * b**2 + 3.0 * b**3

    def motion(self, x: Array) -> list[Array]:
        """Positions and derivatives (N, n) at the samples, of coefficients x (P n,) in units."""
        X = self.coefficients(x)
        return [functions @ X for functions in self.functions]

    def coefficients(self, x: Array) -> Array:
        """Coefficients (P, n) of the basis."""
        return self.units * x.reshape(self.units.shape)

    def judged(self, W: Array, power: float) -> tuple[float, Array]:
        """Criterion of the base columns (N, n, b), and its gradient by them."""
        N, n, b = W.shape
        # joint by joint: their rows have zeros in the same columns, which the factor skips
        rows = (W * (self.weight / np.sqrt(N))).transpose(1, 0, 2).reshape(n * N, b)
        if self.criterion is ExcitationCriterion.LOG_DET:
            value, gradient = log_volume(rows)
        else:
            value, gradient = smooth_condition(rows, power)
        return value, gradient.reshape(n, N, b).transpose(1, 0, 2) * (self.weight / np.sqrt(N))

    def value(self, x: Array, stage: Stage) -> tuple[float, Array]:
        """Criterion and penalties of coefficients. Shapes: x (P n,) -> gradient (P n,)."""
        motion = self.motion(x)
        q, v, a = motion[:3]
        W = self.regressor.matrix(q, v, a)
        b = len(self.base)
        value, by_base = self.judged(W[:, :, :b], stage.power)
        G = np.zeros(W.shape)
        G[:, :, :b] = by_base
        weight = stage.penalty * 100.0 / len(self.t)
        pulls = [np.zeros(q.shape) for _ in motion]
        for y, pull, (low, high, half) in zip(motion, pulls, self.bounds, strict=True):
            over = np.maximum(y - high, 0.0) / half - np.maximum(low - y, 0.0) / half
            value += 0.5 * weight * float((over**2).sum())
            pull += weight * over / half
        if self.values.any():
            torque = W @ self.values
            room = (1.0 - self.margin) * self.torque_limits
            over = np.sign(torque) * np.maximum(np.abs(torque) - room, 0.0) / room
            value += 0.5 * weight * float((over**2).sum())
            G += (weight * over / room)[:, :, None] * self.values
        for box in self.boxes:
            for slack, by_q in box_slacks(self.model, box, q):
                over = np.maximum(self.margin - slack / _BOX, 0.0)
                value += 0.5 * weight * float((over**2).sum())
                pulls[0] -= (weight / _BOX) * np.einsum("ij,ijk->ik", over, by_q)
        for pull, part in zip(pulls, self.regressor.pulled_back(q, v, a, G), strict=False):
            pull += part
        total = sum(B.T @ pull for B, pull in zip(self.functions, pulls, strict=True))
        return value, (self.units * total).ravel()

    def _bounds(self, order: int) -> tuple[Array, Array, Array]:
        of = self.limits
        low, high = (
            (of.lower, of.upper),
            (of.velocity_lower, of.velocity),
            (of.acceleration_lower, of.acceleration),
            (of.jerk_lower, of.jerk),
        )[order]
        half = np.where(np.isfinite(high - low), 0.5 * (high - low), 1.0)
        return low + self.margin * half, high - self.margin * half, half

    def _units(self) -> Array:
        """What takes a joint alone to its limits, of each function, shape (P, n)."""
        units = np.full((self.basis.count, self.model.n), np.inf)
        for B, (low, high, _) in zip(self.functions, self.bounds, strict=True):
            peak = np.abs(B).max(axis=0)[:, None]
            with np.errstate(divide="ignore"):
                units = np.minimum(units, np.where(peak > 0.0, 0.5 * (high - low) / peak, np.inf))
        return units


def _with_torques(base: BaseParameters, model: RobotModel) -> tuple[tuple[str, ...], bool, Array]:
    """Columns of the base followed by those that torques need besides, and the values of all."""
    full = base_parameters(model, drive=True)
    own = dict(zip(full.names, full.values(model), strict=True))
    names = (*base.names, *(name for name in full.names if name not in set(base.names)))
    return names, True, np.array([own.get(name, 0.0) for name in names])
