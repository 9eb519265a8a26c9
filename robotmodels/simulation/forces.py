"""The right-hand side of the equations of motion, without checks and with as few calls as can be.

A call of `ddm` with its checks takes 65 us for six joints; the kernel behind it, called with arrays
that were laid out once, 4 us. Everything that does not change on the way is laid out here.
"""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np

from .._arrays import Array
from ..friction import Friction
from ..friction.combined import by_dependence
from ..friction.protocols import torque_at
from ..model import RobotModel
from .dry_friction import DryFriction, Mode

_WORLD_ALIGNED = 0  # the kernels' number of that reference
_SLOWEST = 5e-324  # the smallest velocity that has a sign
_EPSILON = float(np.finfo(np.float64).eps)


class Forces:
    """Accelerations and works of a robot under given laws; scratch for one simulation."""

    def __init__(
        self,
        model: RobotModel,
        control: Any,
        wrench: Any,
        drive: bool,
        friction: Friction | None,
        dry: DryFriction,
        width: Array | None,
    ) -> None:
        from ..kernels.direct_dynamics import joint_accelerations
        from ..kernels.jacobians import jacobians
        from ..kernels.mass_matrix import mass_matrices
        from ..kernels.newton_euler import joint_torques

        n = model.n
        self.n, self.control, self.wrench = n, control, wrench
        self.extra, self.placed = by_dependence(friction)
        self.dry, self.width = dry, width
        drives = model.drive_matrices if drive else None
        self.rotor = np.zeros((n, n)) if drives is None else np.ascontiguousarray(drives.rotor)
        self.viscous = None if drives is None or not drives.viscous.any() else drives.viscous
        self.offset = np.zeros(n) if drives is None else drives.offset
        self._accelerations, self._torques = joint_accelerations, joint_torques
        self._masses, self._jacobians = mass_matrices, jacobians
        self._links = (*model.chain, model.inertia.values, model.gravity)
        self._bodies = (*model.chain, model.inertia.values)
        self._tool = (*model.chain, *model.twin.frame(None).kernel_arguments, _WORLD_ALIGNED)
        self._a, self._h = np.empty((1, n)), np.empty((1, n))
        self._M, self._J = np.empty((1, n, n)), np.empty((1, 6, n))
        self._still = np.zeros((1, n))
        level = np.abs(dry.rates.T) @ (0.5 * np.abs(dry.upper - dry.lower))
        self._weights = np.divide(1.0, level, out=np.zeros(n), where=level > 0.0)
        self.evaluations = 0
        self.met_singular = False
        self.latest = np.inf  # laws are asked for times before this one only
        self.set_mode(dry.slipping(np.zeros(n)))  # nothing dry until a mode is decided

    def set_mode(self, mode: Mode) -> None:
        """Which parts slip, in which direction, and which stick."""
        self.mode = mode
        self._dry_torque = self.dry.torque(mode.signs)
        stuck = self.dry.joint_signs(mode.signs)
        self._held = np.isfinite(stuck) & (stuck == 0.0)
        # a joint that slips keeps the friction of its direction until the next event, also where
        # a trial step has gone past rest
        self._forth, self._back = stuck > 0.0, stuck < 0.0

    def derivative(self, t: float, y: Array) -> Array:
        """Time derivative of the state: positions, velocities, works, dry-friction reaction."""
        n = self.n
        y = np.ascontiguousarray(y)
        out = np.empty(2 * n + 4)
        if not isfinite(y @ y):  # also where squares overflow: no motion gets so far
            self.evaluations += 1
            out.fill(np.nan)
            return out
        v = y[n : 2 * n]
        a, tau, friction, tool, reaction = self.at(t, y[:n], v)
        out[:n] = v
        out[n : 2 * n] = a
        out[2 * n] = tau @ v
        out[2 * n + 1] = (friction + self.offset) @ v
        out[2 * n + 2] = tool @ v
        out[2 * n + 3] = reaction @ self._weights
        return out

    def at(self, t: float, q: Array, v: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Accelerations and torques at one time."""
        self.evaluations += 1
        n, mode = self.n, self.mode
        load, tau, friction, tool = self.load(t, q, v)
        if not mode.sticks:
            found = self._accelerations(
                q.reshape(1, n), v.reshape(1, n), load.reshape(1, n), *self._links, self.rotor,
                self._a,
            )  # fmt: skip
            if found != -1:  # singular, or past a singularity: it was definite at the start
                self.met_singular = True
                self._a[0] = np.nan
            return self._a[0].copy(), tau, friction, tool, self._still[0]
        M, h = self.bodies(q, v)
        rest = load - h
        N = mode.free
        a = np.zeros(n)
        if N.shape[1]:
            try:
                inertia = N.T @ M @ N
                np.linalg.cholesky(inertia)  # refuses what is singular or past a singularity
                a = N @ np.linalg.solve(inertia, N.T @ rest)
            except np.linalg.LinAlgError:
                self.met_singular = True
                return np.full(n, np.nan), tau, friction, tool, self._still[0]
        reaction = rest - M @ a
        reaction[mode.loose] = 0.0  # rounding of the elimination
        return a, tau, friction + reaction, tool, reaction

    def bodies(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Mass matrix with rotors (n, n), and torques without acceleration (n,)."""
        n = self.n
        row, rate = q.reshape(1, n), v.reshape(1, n)
        self._torques(row, rate, self._still, *self._links, self._h)
        self._masses(row, *self._bodies, self._M)
        return self._M[0] + self.rotor, self._h[0].copy()

    def load(self, t: float, q: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        """Torque that is left for the bodies, of the control, of friction, and for the wrench."""
        n = self.n
        time = min(t, self.latest)
        tau = self._still[0] if self.control is None else self.control(time, q, v)
        friction = self.friction(v)
        if self.placed is not None:
            friction = friction + torque_at(self.placed, v, q)
        tool = self._still[0]
        if self.wrench is not None:
            self._jacobians(q.reshape(1, n), *self._tool, self._J)
            tool = np.asarray(self.wrench(time, q, v)) @ self._J[0]
        return tau - friction - self.offset - tool, tau, friction, tool

    def friction(self, v: Array) -> Array:
        """Torque of friction that depends on velocities, without what holds parts that stick."""
        torque = self._dry_torque
        if self.viscous is not None:
            torque = torque + v @ self.viscous
        if self.width is not None:
            torque = torque + self._smoothed(v, self.width)
        elif self.extra is not None:
            w = np.where(self._forth, np.maximum(v, _SLOWEST), v)
            w = np.where(self._back, np.minimum(w, -_SLOWEST), w)
            torque = torque + np.where(self._held, 0.0, self.extra.torque(w))
        return torque

    def _smoothed(self, v: Array, width: Array) -> Array:
        """Dry friction with ``tanh(v / width)`` in the place of the sign."""
        dry = self.dry
        s = dry.rates @ v
        torque = (dry.drives * np.tanh(s / width[dry.joint])) @ dry.rates
        if self.extra is not None:
            low, high = dry.extra
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            jump = np.where(v > 0.0, high, np.where(v < 0.0, low, self.extra.torque(0.0 * v)))
            smooth = self.extra.torque(v) - jump + middle + half * np.tanh(v / width)
            torque = torque + smooth
        return torque
