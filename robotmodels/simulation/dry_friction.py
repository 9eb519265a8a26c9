"""Dry friction: which joints and motor shafts slip or stick, and when they break away.

A part is a joint, or the shaft of a motor that several joints turn (`Transmission`). A slipping
part has friction against its velocity; a part at rest takes any torque between its two breakaway
torques. Which parts at rest stick is the solution of a bounded least-squares problem: the
accelerations that differ least from those without friction (P. Loetstedt, "Mechanical systems of
rigid bodies subject to unilateral constraints", SIAM J. Appl. Math. 42(2), 1982).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..drive import DriveMatrices
from ..errors import InvalidValueError
from ..friction import Friction
from ..friction.protocols import torques_at_rest
from ..model import RobotModel

_AT_REST = 1e-12  # rad/s or m/s: rounding of velocities that were set to zero
_ROUNDING = 1e-12  # tolerance of accelerations, relative to those without friction
_RANK = 1e-10  # rank tolerance: relative singular value


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """Directions of the parts between two events, and the accelerations that sticking parts allow.

    Shapes: signs (k,), 0 for sticking parts; stuck (s,); free (n, m), an orthonormal basis; holding
    (s, n), from reactions to the torques on the sticking parts, None where they are not unique.
    """

    signs: Array
    stuck: NDArray[np.int64]
    free: Array
    holding: Array | None

    def acceleration(self, M: Array, rest: Array) -> Array:
        """Accelerations under the torques `rest`; LinAlgError where M is not positive definite."""
        N = self.free
        if not N.shape[1]:
            return np.zeros(len(M))
        inertia = N.T @ M @ N
        np.linalg.cholesky(inertia)
        return N @ np.linalg.solve(inertia, N.T @ rest)


@dataclass(frozen=True, slots=True, eq=False)
class DryFriction:
    """The k parts with dry friction, their breakaway torques, and the drives' share in them.

    Shapes: rates (k, n), velocities of the parts by those of the joints; the others (k,).
    """

    rates: Array
    lower: Array
    upper: Array
    drives: Array
    joint: NDArray[np.int64]
    motor: NDArray[np.bool_]

    def signs(self, v: Array) -> Array:
        """Directions of the parts, 0 for those at rest."""
        speed = self.rates @ v
        rounding = _AT_REST * (1.0 + np.abs(self.rates) @ np.abs(v))
        return np.where(np.abs(speed) <= rounding, 0.0, np.sign(speed))

    def mode(self, signs: Array) -> Mode:
        """The mode in which parts of sign 0 stick."""
        stuck = np.flatnonzero(signs == 0.0)
        D = self.rates[stuck]
        _, size, Vt = np.linalg.svd(D)
        rank = int((size > _RANK * size.max(initial=0.0)).sum())
        free = np.where(np.abs(Vt[rank:]) < 1e-14, 0.0, Vt[rank:]).T.copy()
        unique = rank == stuck.size
        holding = np.asarray(np.linalg.pinv(D.T), np.float64) if unique else None
        return Mode(signs, stuck, free, holding)

    def decided(self, v: Array, M: Array, rest: Array) -> Mode:
        """The mode of velocities v, with parts at rest that stick or slip under torques `rest`."""
        signs = self.signs(v)
        idle = np.flatnonzero(signs == 0.0)
        if idle.size:
            rates = self._slip_rates(idle, M, rest)
            signs[idle] = np.where(np.abs(rates) > _ROUNDING, np.sign(rates), 0.0)
        return self.mode(signs)

    def loosened(self, mode: Mode, M: Array, rest: Array) -> Mode:
        """Mode after the sticking part with the largest excess of torque breaks away."""
        signs = mode.signs.copy()
        over = self._excess(mode, M, rest - M @ mode.acceleration(M, rest))
        first = int(np.argmax(np.abs(over)))
        signs[mode.stuck[first]] = np.sign(over[first])
        return self.mode(signs)

    def margin(self, mode: Mode, reaction: Array) -> float:
        """Distance of the sticking parts from breakaway: 1 in the middle, 0 at breakaway."""
        return 1.0 - float(np.abs(self._excess(mode, np.eye(len(reaction)), reaction)).max())

    def _excess(self, mode: Mode, M: Array, reaction: Array) -> Array:
        """Torques on the sticking parts from the middle of their ranges, relative to the ends.

        Where they are not unique: 0, or beyond +-1 by the slip rates if none are in the ranges.
        """
        if mode.holding is None:
            rates = self._slip_rates(mode.stuck, M, reaction)
            return np.sign(rates) + rates
        low, high = self.lower[mode.stuck], self.upper[mode.stuck]
        return (mode.holding @ reaction - 0.5 * (low + high)) / (0.5 * (high - low))

    def _slip_rates(self, parts: NDArray[np.int64], M: Array, rest: Array) -> Array:
        """Least relative accelerations of parts at rest within the breakaway torques."""
        from scipy.optimize import lsq_linear

        # the norm of L^-1 (M a) is that of the accelerations in the metric of the inertia
        L = np.linalg.cholesky(M)
        A = np.linalg.solve(L, self.rates[parts].T)
        b = np.linalg.solve(L, rest)
        low, high = self.lower[parts], self.upper[parts]
        size, most = np.linalg.norm(A, axis=0), float(np.linalg.norm(b))
        if most == 0.0:
            most = float((size * np.maximum(np.abs(low), np.abs(high))).max())
        columns, scale = A / size, size / most
        bounds = (low * scale, high * scale)
        best = lsq_linear(columns, b / most, bounds, method="bvls", tol=1e-13, max_iter=200)
        return np.asarray(columns.T @ (b / most - columns @ best.x), np.float64)


def dry_friction(
    model: RobotModel, drives: DriveMatrices, friction: Friction | None
) -> DryFriction:
    """Parts with dry friction: joints, and shafts of coupled motors."""
    n, K, coulomb = model.n, model.transmission, drives.coulomb
    extra = torques_at_rest(friction, n)
    lower, upper = extra[0] - coulomb, extra[1] + coulomb
    joints = np.flatnonzero(lower != upper)
    some = drives.coupled_coulomb != 0.0
    rates, levels = drives.coupling[some], drives.coupled_coulomb[some]
    coupled = K.coupled_motors if K is not None and some.size else ()
    motors = np.array(coupled, np.int64)[some] - 1
    return DryFriction(
        rates=np.concatenate([np.eye(n)[joints], rates]),
        lower=np.concatenate([lower[joints], -levels]),
        upper=np.concatenate([upper[joints], levels]),
        drives=np.concatenate([coulomb[joints], levels]),
        joint=np.concatenate([joints, motors]),
        motor=np.arange(joints.size + motors.size) >= joints.size,
    )


def check_dissipates(dry: DryFriction) -> None:
    """Raise for dry friction that adds energy."""
    for k in np.flatnonzero(dry.lower > dry.upper)[:1]:
        part = f"{'coupled motor' if dry.motor[k] else 'joint'} {int(dry.joint[k]) + 1}"
        raise InvalidValueError(
            f"friction: the dry friction of {part} is negative "
            f"({0.5 * (dry.upper[k] - dry.lower[k]):.6g}): it would accelerate the joint out of "
            "rest. Repair Fc (an identified value may be noise about zero), or give smoothing=."
        )
