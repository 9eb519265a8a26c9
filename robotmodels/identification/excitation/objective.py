"""The function that is minimised: criterion and penalties of limits, with its gradient.

The criterion is a function of the singular values of the base regressor, stacked over samples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..._arrays import Array
from ...drive import Drives
from ...estimation.factor import triangle
from ...inertia import PARAMETERS
from ...minimal_parameters import BaseParameters, base_parameters
from ...model import RobotModel
from ...regressors import parameter_names, torque_regressor
from ...trajectories import MotionLimits
from .motions import MotionBasis

CRITERIA = ("condition", "log_det")
_LEAST = 1e-12  # least diagonal entry of the factor, relative to the column norm
_BLOCK = 2**18  # largest number of multiplications that OpenBLAS runs in one thread
_SIGN = 0.02  # regularisation velocity of dry friction, relative to the velocity limit
_LENGTH = 0.25  # penalty scale of distances from the workspace's limits and obstacles, m

Distances = Callable[[Array], tuple[Array, Array]]
"""From q (N, n): distances (N, p) that must not be negative, and their gradients (N, p, n)."""


class ExcitationProblem:
    """Criterion and limit penalties as a function of a motion's coefficients."""

    def __init__(
        self,
        model: RobotModel,
        basis: MotionBasis,
        base: BaseParameters,
        criterion: str,
        limits: MotionLimits,
        torque_limits: Array,
        distances: Distances | None,
        samples: int,
        weight: Array,
        margin: float,
    ) -> None:
        self.model, self.basis, self.base, self.criterion = model, basis, base, criterion
        self.limits, self.torque_limits, self.distances = limits, torque_limits, distances
        self.weight, self.margin = weight, margin
        self.t = basis.duration / samples * np.arange(samples, dtype=np.float64)
        orders = 4 if np.isfinite(limits.jerk).any() else 3
        self.functions = [basis.at(self.t, order) for order in range(orders)]
        names, drive, values = tuple(base.names), base.drive, np.zeros(len(base))
        if np.isfinite(torque_limits).any():  # their columns follow those of the base
            full, drive = base_parameters(model, drive=True), True
            known = dict(zip(full.names, full.values(model), strict=True))
            names = (*names, *(name for name in full.names if name not in set(names)))
            values = np.array([known.get(name, 0.0) for name in names])
        self.values = values
        width = _SIGN * np.minimum(limits.velocity, -limits.velocity_lower)
        self.regressor = MotionRegressor(model, names, drive, width)
        self.bounds = [self._bounds(order) for order in range(orders)]
        # coefficients (P, n) of each function by which a joint alone reaches its limits
        self.units = np.full((basis.count, model.n), np.inf)
        for B, (low, high, _) in zip(self.functions, self.bounds, strict=True):
            with np.errstate(divide="ignore"):
                reach = 0.5 * (high - low) / np.abs(B).max(axis=0)[:, None]
            self.units = np.minimum(self.units, reach)

    @property
    def work(self) -> float:
        """Multiplications of an evaluation: of the factor and of its powers."""
        N, n, b = len(self.t), self.model.n, len(self.base)
        return 1e6 + N * n * b**2 + 3.0 * b**3

    def coefficients(self, x: Array) -> Array:
        """Coefficients (P, n) of the basis from those in units, (P n,)."""
        return self.units * x.reshape(self.units.shape)

    def value(self, x: Array, power: float, penalty: float) -> tuple[float, Array]:
        """Smooth criterion and penalties of coefficients. Shapes: x (P n,) -> gradient (P n,)."""
        X = self.coefficients(x)
        motion = [functions @ X for functions in self.functions]
        q, v, a = motion[:3]
        W = self.regressor.matrix(q, v, a)
        b = len(self.base)
        G = np.zeros(W.shape)
        value, G[:, :, :b] = self._criterion(W[:, :, :b], power)
        weight = penalty * 100.0 / len(self.t)
        by_motion = [np.zeros(q.shape) for _ in motion]
        for y, slope, (low, high, half) in zip(motion, by_motion, self.bounds, strict=True):
            over = np.maximum(y - high, 0.0) / half - np.maximum(low - y, 0.0) / half
            value += 0.5 * weight * float((over**2).sum())
            slope += weight * over / half
        if self.values.any():
            torque = W @ self.values
            room = (1.0 - self.margin) * self.torque_limits
            over = np.sign(torque) * np.maximum(np.abs(torque) - room, 0.0) / room
            value += 0.5 * weight * float((over**2).sum())
            G += (weight * over / room)[:, :, None] * self.values
        if self.distances is not None:
            distance, by_q = self.distances(q)
            over = np.maximum(self.margin - distance / _LENGTH, 0.0)
            value += 0.5 * weight * float((over**2).sum())
            by_motion[0] -= (weight / _LENGTH) * np.einsum("ij,ijk->ik", over, by_q)
        for slope, part in zip(by_motion, self.regressor.gradients(q, v, a, G), strict=False):
            slope += part
        total = sum(B.T @ slope for B, slope in zip(self.functions, by_motion, strict=True))
        return value, (self.units * total).ravel()

    def _criterion(self, W: Array, power: float) -> tuple[float, Array]:
        """Criterion of the base columns (N, n, b), and its gradient by them."""
        N, n, b = W.shape
        weight = self.weight / np.sqrt(N)
        # joint by joint: their rows have zeros in the same columns, which the factor skips
        rows = (W * weight).transpose(1, 0, 2).reshape(n * N, b)
        smooth = self.criterion == "condition"
        value, gradient = smooth_condition(rows, power) if smooth else log_volume(rows)
        return value, gradient.reshape(n, N, b).transpose(1, 0, 2) * weight

    def _bounds(self, order: int) -> tuple[Array, Array, Array]:
        """Lower and upper bound of a derivative within the margin, and half its range."""
        name = ("", "velocity", "acceleration", "jerk")[order]
        high = getattr(self.limits, name or "upper")
        low = getattr(self.limits, f"{name}_lower" if name else "lower")
        half = np.where(np.isfinite(high - low), 0.5 * (high - low), 1.0)
        return low + self.margin * half, high - self.margin * half, half


class MotionRegressor:
    """Columns of the torque regressor over samples, dry friction smoothed over a width."""

    def __init__(
        self, model: RobotModel, names: Sequence[str], drive: Drives, width: Array | None = None
    ) -> None:
        self.model, self.width = model, width
        self.drive: Drives = drive
        every, column = parameter_names(model, drive), {name: k for k, name in enumerate(names)}
        self.numbers = [every.index(name) for name in names]
        links = [column.get(f"{p}{j + 1}", -1) for j in range(model.f) for p in PARAMETERS]
        self.links = np.array(links, dtype=np.int64)
        # each drive parameter: its column, and the turns of its motor per joint
        frames, motors = model.table.joint_rows + 1, []
        if (transmission := model.transmission) is not None:
            motors = [(m - 1, transmission.weights[m - 1]) for m in transmission.coupled_motors]
        self.turns = {
            kind: [
                (column[name], row)
                for mark, rows in (("", enumerate(np.eye(model.n))), ("m", motors))
                for j, row in rows
                if (name := f"{kind}{mark}{frames[j]}") in column
            ]
            for kind in ("Ia", "Fv", "Fc")
        }

    def matrix(self, q: Array, v: Array, a: Array) -> Array:
        """The columns, shape (N, n, c)."""
        W = torque_regressor(self.model, q, v, a, self.drive, self.numbers)
        if self.width is not None:
            for column, row in self.turns["Fc"]:
                W[:, :, column] = np.tanh(v @ row / (np.abs(row) @ self.width))[:, None] * row
        return W

    def gradients(self, q: Array, v: Array, a: Array, G: Array) -> tuple[Array, Array, Array]:
        """Gradients of ``sum(G * matrix(q, v, a))`` by q, v and a. Shapes: (N, n); G (N, n, c)."""
        from ...kernels.regressor_gradient import regressor_gradients

        of_q, of_v, of_a = np.zeros(q.shape), np.zeros(q.shape), np.zeros(q.shape)
        chain, gravity = self.model.chain, self.model.gravity
        G = np.ascontiguousarray(G)
        regressor_gradients(q, v, a, chain, gravity, self.links, G, of_q, of_v, of_a)
        for kind, out in (("Ia", of_a), ("Fv", of_v)):
            for column, row in self.turns[kind]:
                # the diagonal terms of a coupled motor are in the columns of its joints
                shared = np.diag(row**2) if np.count_nonzero(row) > 1 else 0.0
                out += G[:, :, column] @ (np.outer(row, row) - shared)
        if self.width is not None:
            for column, row in self.turns["Fc"]:
                width = np.abs(row) @ self.width
                slope = (1.0 - np.tanh(v @ row / width) ** 2) / width
                of_v += ((G[:, :, column] @ row) * slope)[:, None] * row
        return of_q, of_v, of_a


def smooth_condition(W: Array, power: float) -> tuple[float, Array]:
    """Smooth upper bound of the logarithm of a condition number, and its gradient.

    Shapes: W (N, b) -> gradient (N, b).
    """
    R, inverse = _inverted(W)
    half = round(power / 2.0)
    up, rise = _trace_power(_product(R.T, R), half)
    down, fall = _trace_power(inverse, half)
    return 0.5 * (up + down), _product(W, rise - _product(_product(inverse, fall), inverse))


def log_volume(W: Array) -> tuple[float, Array]:
    """Minus the mean logarithm of the singular values of W (N, b), and its gradient (N, b)."""
    R, inverse = _inverted(W)
    b = W.shape[1]
    return float(-np.log(np.abs(np.diagonal(R))).mean()), _product(W, inverse / -b)


def triangular_factor(W: Array) -> Array:
    """Triangular factor (b, b) of rows (N, b)."""
    R = np.zeros((W.shape[1], W.shape[1]))
    factor = triangle(W)
    R[: len(factor)] = factor
    return R


def _inverted(W: Array) -> tuple[Array, Array]:
    """Triangular factor R of rows, and the inverse of ``R^T R``, shapes (b, b)."""
    R = triangular_factor(W)
    # scaled columns: accurate inverse where some columns are short
    lengths = np.linalg.norm(R, axis=0)
    lengths = np.maximum(lengths, _LEAST * lengths.max()) + np.finfo(float).tiny
    R /= lengths
    corner = np.diagonal(R)
    R[np.diag_indices_from(R)] = np.copysign(np.maximum(np.abs(corner), _LEAST), corner)
    inverse = np.linalg.inv(R) / lengths[:, None]
    return R * lengths, _product(inverse, inverse.T)


def _trace_power(S: Array, power: int) -> tuple[float, Array]:
    """``log(tr(S^m)) / m`` and its derivative ``S^(m - 1) / tr(S^m)``, m the power."""
    size = float(np.trace(S))
    raised = np.linalg.matrix_power(S / size, power - 1)
    total = float((raised * S).sum()) / size
    return np.log(size) + np.log(total) / power, raised / (total * size)


def _product(W: Array, M: Array) -> Array:
    """``W @ M``, shape (N, b), in blocks of rows of one thread.

    For such products the synchronisation of threads takes longer than the product.
    """
    N, b = W.shape
    size = max(1, _BLOCK // b**2)
    whole = N - N % size
    blocks = W[:whole].reshape(-1, size, b) @ M
    return np.concatenate((blocks.reshape(whole, M.shape[1]), W[whole:] @ M))
