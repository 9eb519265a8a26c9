"""Dry friction as a set of parts that slip or stick.

A part is a joint, or the shaft of a motor that several joints turn (`Transmission`). While it
slips, its friction opposes its velocity; at rest, it takes any torque between its two breakaway
torques. Which parts at rest stick is the solution of a least-squares problem with bounds: the
accelerations deviate least from those without friction (P. Loetstedt, "Mechanical systems of rigid
bodies subject to unilateral constraints", SIAM J. Appl. Math. 42(2), 1982).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..errors import InvalidValueError
from ..friction import Friction
from ..friction.combined import by_dependence
from ..model import RobotModel

_SLOWEST = 5e-324  # the smallest velocity that has a sign
_AT_REST = 1e-12  # rad/s or m/s: rounding of velocities that were brought to zero
_ROUNDING = 1e-12  # of accelerations, against those without friction


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """Which parts stick and which slip: between two events it does not change.

    Shapes: signs (k,), free (n, m), stuck (s,), loose (n,).
    """

    signs: Array
    free: Array
    stuck: NDArray[np.int64]
    loose: NDArray[np.bool_]
    independent: bool

    @property
    def sticks(self) -> bool:
        """Whether any part sticks."""
        return bool(self.stuck.size)


@dataclass(frozen=True, slots=True, eq=False)
class DryFriction:
    """The k parts that dry friction can hold.

    Shapes: rates (k, n); lower, upper, drives, joint, motor (k,); extra (2, n).
    """

    rates: Array
    lower: Array
    upper: Array
    drives: Array
    joint: NDArray[np.int64]
    motor: NDArray[np.bool_]
    extra: Array

    @classmethod
    def none(cls, n: int) -> DryFriction:
        """No dry friction at all."""
        no = np.empty(0)
        return cls(
            np.empty((0, n)), no, no, no, np.empty(0, np.int64), np.empty(0, bool), np.zeros((2, n))
        )

    @property
    def count(self) -> int:
        """Number of parts."""
        return self.lower.size

    def torque(self, signs: Array) -> Array:
        """Joint torques of the drives' share in the parts that slip, shape (n,)."""
        return (self.drives * signs) @ self.rates

    def joint_signs(self, signs: Array) -> Array:
        """Sign of each joint that is a part, NaN of the others, shape (n,)."""
        out = np.full(self.rates.shape[1], np.nan)
        out[self.joint[~self.motor]] = signs[~self.motor]
        return out

    def slipping(self, v: Array) -> Mode:
        """The mode of given velocities if nothing sticks; parts at rest have no friction in it."""
        n = self.rates.shape[1]
        signs = np.sign(self.rates @ v)
        signs[self.at_rest(v)] = 0.0
        no = np.empty(0, np.int64)
        return Mode(signs, np.eye(n), no, np.ones(n, dtype=bool), True)

    def mode(self, signs: Array) -> Mode:
        """The mode in which parts of sign 0 stick."""
        n = self.rates.shape[1]
        stuck = np.flatnonzero(signs == 0.0)
        D = self.rates[stuck]
        loose = ~(D != 0.0).any(axis=0)
        if not self.motor[stuck].any():
            return Mode(signs, np.eye(n)[:, loose], stuck, loose, True)
        _, size, Vt = np.linalg.svd(D)
        rank = int((size > 1e-10 * size.max()).sum())
        free = Vt[rank:].T.copy()
        free[np.abs(free) < 1e-14] = 0.0
        return Mode(signs, free, stuck, loose, rank == stuck.size)

    def at_rest(self, v: Array) -> NDArray[np.bool_]:
        """Which parts are at rest, shape (k,)."""
        return np.abs(self.rates @ v) <= _AT_REST * (1.0 + np.abs(self.rates) @ np.abs(v))

    def decided(self, v: Array, M: Array, rest: Array) -> Mode:
        """Stick or slip mode of the parts at rest. Shapes: v, rest (n,); M (n, n)."""
        signs = self.slipping(v).signs.copy()
        idle = np.flatnonzero(signs == 0.0)
        if idle.size:
            rates = self._held(idle, M, rest)
            signs[idle] = np.where(np.abs(rates) > _ROUNDING, np.sign(rates), 0.0)
        return self.mode(signs)

    def loosened(self, mode: Mode, M: Array, rest: Array) -> Mode:
        """Mode after a sticking part breaks away. Shapes: M (n, n), rest (n,)."""
        signs = mode.signs.copy()
        if mode.independent:
            torques = self._torques_of(mode, rest - M @ _acceleration(mode, M, rest))
            middle, half = self._box(mode.stuck)
            over = (torques - middle) / half
        else:
            over = self._held(mode.stuck, M, rest)
        first = int(np.argmax(np.abs(over)))
        signs[mode.stuck[first]] = np.sign(over[first])
        return self.mode(signs)

    def margin(self, mode: Mode, reaction: Array) -> float:
        """Distance of the sticking parts from breakaway: 1 in the middle, 0 at breakaway."""
        middle, half = self._box(mode.stuck)
        if mode.independent:
            torques = self._torques_of(mode, reaction)
            return float(np.min(1.0 - np.abs(torques - middle) / half))
        # torques that balance inside: the choice that leaves most room
        from scipy.optimize import linprog

        D = self.rates[mode.stuck].T * half
        level = reaction - self.rates[mode.stuck].T @ middle
        scale = max(float(np.abs(level).max()), float(np.abs(D).max()))
        k = mode.stuck.size
        found = linprog(
            np.r_[np.zeros(k), 1.0],
            A_ub=np.block([[np.eye(k), -np.ones((k, 1))], [-np.eye(k), -np.ones((k, 1))]]),
            b_ub=np.zeros(2 * k),
            A_eq=np.c_[D, np.zeros(len(D))] / scale,
            b_eq=level / scale,
            bounds=[(None, None)] * k + [(0.0, None)],
        )
        return 1.0 - float(found.fun) if found.status == 0 else -np.inf

    def settled(self, mode: Mode, v: Array) -> Array:
        """Velocities whose parts that stick are exactly at rest, shape (n,)."""
        if not mode.sticks:
            return v
        held = v.copy()
        if self.motor[mode.stuck].any():
            D = self.rates[mode.stuck]
            held = held - np.linalg.pinv(D) @ (D @ held)
        joints = mode.stuck[~self.motor[mode.stuck]]
        held[self.joint[joints]] = 0.0
        return held

    def _box(self, parts: NDArray[np.int64]) -> tuple[Array, Array]:
        low, high = self.lower[parts], self.upper[parts]
        return 0.5 * (low + high), 0.5 * (high - low)

    def _torques_of(self, mode: Mode, reaction: Array) -> Array:
        """Torques on the parts that stick, which are independent."""
        if not self.motor[mode.stuck].any():
            return reaction[self.joint[mode.stuck]]
        torques = np.linalg.lstsq(self.rates[mode.stuck].T, reaction, rcond=1e-10)[0]
        return np.asarray(torques, np.float64)

    def _held(self, parts: NDArray[np.int64], M: Array, rest: Array) -> Array:
        """Accelerations of parts at rest under the best friction, against those without any."""
        from scipy.optimize import lsq_linear

        # the length of L^-1 (M a) is that of the accelerations in the metric of the inertia
        L = np.linalg.cholesky(M)
        A = np.linalg.solve(L, self.rates[parts].T)
        b = np.linalg.solve(L, rest)
        low, high = self.lower[parts], self.upper[parts]
        size, most = np.linalg.norm(A, axis=0), float(np.linalg.norm(b))
        if most == 0.0:
            most = float((size * np.maximum(np.abs(low), np.abs(high))).max())
        columns = A / size
        scale = size / most
        found = lsq_linear(
            columns, b / most, (low * scale, high * scale), method="bvls", tol=1e-13, max_iter=200
        )
        rates = columns.T @ (b / most - columns @ found.x)
        return np.asarray(rates, np.float64)


def _acceleration(mode: Mode, M: Array, rest: Array) -> Array:
    N = mode.free
    if not N.shape[1]:
        return np.zeros(len(M))
    return N @ np.linalg.solve(N.T @ M @ N, N.T @ rest)


def dry_friction(model: RobotModel, drive: bool, friction: Friction | None) -> DryFriction:
    """Parts with dry friction: joints, and shafts of coupled motors."""
    n = model.n
    drives = model.drive_matrices if drive else None
    own = np.zeros(n) if drives is None else drives.coulomb
    extra = np.zeros((2, n))
    moving, _ = by_dependence(friction)
    if moving is not None:
        extra = np.stack([moving.torque(np.full(n, s * _SLOWEST)) for s in (-1.0, 1.0)])
    lower, upper = extra[0] - own, extra[1] + own
    joints = np.flatnonzero(lower != upper)
    rates, levels, motors = np.zeros((0, n)), np.empty(0), np.empty(0, np.int64)
    if drives is not None and drives.coupling.size and model.transmission is not None:
        some = drives.coupled_coulomb != 0.0
        rates, levels = drives.coupling[some], drives.coupled_coulomb[some]
        motors = (np.array(model.transmission.coupled_motors) - 1)[some]
    return DryFriction(
        rates=np.concatenate([np.eye(n)[joints], rates]),
        lower=np.concatenate([lower[joints], -levels]),
        upper=np.concatenate([upper[joints], levels]),
        drives=np.concatenate([own[joints], levels]),
        joint=np.concatenate([joints, motors]).astype(np.int64),
        motor=np.arange(joints.size + motors.size) >= joints.size,
        extra=extra,
    )


def check_dissipates(dry: DryFriction) -> None:
    """Raise for dry friction that adds energy."""
    wrong = np.flatnonzero(dry.lower > dry.upper)
    if wrong.size:
        k = int(wrong[0])
        what = "coupled motor" if dry.motor[k] else "joint"
        raise InvalidValueError(
            f"friction: the dry friction of {what} {int(dry.joint[k]) + 1} is negative "
            f"({0.5 * (dry.upper[k] - dry.lower[k]):.6g}): it would push the joint out of rest in "
            "both directions. Repair Fc (an identified value may be noise about zero), or give a "
            "smoothing width."
        )
