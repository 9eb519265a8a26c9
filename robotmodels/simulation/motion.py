"""The equations of motion on plain arrays, without checks: the right-hand side of an integrator.

A call of `ddm` with its checks takes 65 us for six joints, the kernel behind it 4 us; constant data
are prepared once.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import NamedTuple

import numpy as np

from .._arrays import Array
from ..drive import DriveParameters, drive_matrices
from ..friction import Friction
from ..friction.protocols import SLOWEST, by_dependence, torque_at, torques_at_rest
from ..model import RobotModel
from .dry_friction import Mode, dry_friction
from .feedback import Feedback

_WORLD_ALIGNED = 0  # frame code of the kernels


class Loads(NamedTuple):
    """Accelerations and joint torques of one instant, each (n,)."""

    a: Array
    tau: Array
    friction: Array
    tool: Array
    reaction: Array


class Motion:
    """Accelerations and powers of a robot under given laws, with the scratch of one simulation."""

    def __init__(
        self,
        model: RobotModel,
        control: Feedback,
        wrench: Callable[..., Array] | None,
        drive: bool,
        friction: Friction | None,
        width: Array | None = None,
        disturbance: Callable[..., Array] | None = None,
    ) -> None:
        from ..kernels.mass import joint_accelerations, mass_matrices
        from ..kernels.poses import jacobians
        from ..kernels.torques import joint_torques

        n = model.n
        self.n, self.control, self.wrench, self.width = n, control, wrench, width
        self.disturbance = disturbance
        self.extra, self.placed = by_dependence(friction)
        self.jump = torques_at_rest(friction, n)
        none = drive_matrices(DriveParameters.zeros(n), None)
        drives = (model.drive_matrices if drive else None) or none
        self.rotor = np.ascontiguousarray(drives.rotor)
        self.viscous, self.offset = drives.viscous, drives.offset
        self.smooth = dry_friction(model, drives, friction)
        self.dry = self.smooth if width is None else dry_friction(model, none, None)
        self._accelerations, self._torques = joint_accelerations, joint_torques
        self._masses, self._jacobians = mass_matrices, jacobians
        self._bodies = (model.chain, model.inertia.values)
        self._tool = (model.chain, *model.twin.frame(None).kernel_arguments, _WORLD_ALIGNED)
        self._gravity, self._zero = model.gravity, np.zeros((1, n))
        level = np.abs(self.smooth.rates.T) @ (0.5 * np.abs(self.smooth.upper - self.smooth.lower))
        self._weights = np.divide(1.0, level, out=np.zeros(n), where=level > 0.0)
        self.evaluations = 0
        self.singular = False
        self.latest = np.inf  # laws are evaluated at this time at most
        self.set_mode(self.dry.mode(np.zeros(self.dry.lower.size)))

    def set_mode(self, mode: Mode) -> None:
        """Mode: directions of slipping parts, and sticking parts."""
        self.mode = mode
        self._dry_torque = (self.dry.drives * mode.signs) @ self.dry.rates
        joints = ~self.dry.motor
        self.joint_signs = np.full(self.n, np.nan)  # of joints that are no parts
        self.joint_signs[self.dry.joint[joints]] = mode.signs[joints]

    def derivative(self, t: float, y: Array) -> Array:
        """Time derivative of positions, velocities, three works, reaction of friction, and control.

        The integral of the reaction includes torques at rest in the step control.
        """
        n, y = self.n, np.ascontiguousarray(y)
        if not isfinite(y @ y):  # guard: squares overflow
            self.evaluations += 1
            return np.full(y.size, np.nan)
        q, v, x = y[:n], y[n : 2 * n], y[2 * n + 4 :]
        at = self.at(t, q, v, x)
        control, friction = at.tau @ v, (at.friction + self.offset) @ v
        powers = control, friction, at.tool @ v, at.reaction @ self._weights
        rate = self.control.rate(min(t, self.latest), q, v, x) if x.size else x  # type: ignore[misc]
        return np.concatenate([v, at.a, powers, rate])

    def at(self, t: float, q: Array, v: Array, x: Array) -> Loads:
        """Accelerations and torques at one time; NaN accelerations where M is singular."""
        self.evaluations += 1
        n, reaction = self.n, self._zero[0]
        load, tau, friction, tool = self.load(t, q, v, x)
        if self.mode.stuck.size:
            M, h = self.bodies(q, v)
            try:
                a = self.mode.acceleration(M, load - h)
                reaction = load - h - M @ a
            except np.linalg.LinAlgError:
                a, self.singular = np.full(n, np.nan), True
            return Loads(a, tau, friction + reaction, tool, reaction)
        a, rows = np.empty((1, n)), (x.reshape(1, n) for x in (q, v, load))
        # a mass matrix that is not positive definite was so at the start: singular in between
        if self._accelerations(*rows, *self._bodies, self._gravity, self.rotor, a) != -1:
            a[0], self.singular = np.nan, True
        return Loads(a[0], tau, friction, tool, reaction)

    def bodies(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Mass matrix with rotors (n, n), and torques without acceleration (n,)."""
        n = self.n
        row, h, M = q.reshape(1, n), np.empty((1, n)), np.empty((1, n, n))
        self._torques(row, v.reshape(1, n), self._zero, *self._bodies, self._gravity, h)
        self._masses(row, *self._bodies, M)
        return M[0] + self.rotor, h[0]

    def load(self, t: float, q: Array, v: Array, x: Array) -> tuple[Array, Array, Array, Array]:
        """Torque on the bodies, of the control, of friction, and for the wrench; each (n,)."""
        time, tool = min(t, self.latest), self._zero[0]
        law = self.control.torque
        tau = self._zero[0] if law is None else law(time, q, v, x)
        friction = self.friction(v)
        if self.placed is not None:
            friction = friction + torque_at(self.placed, v, q)
        if self.wrench is not None:
            J = np.empty((1, 6, self.n))
            self._jacobians(q.reshape(1, self.n), *self._tool, J)
            tool = self.wrench(time, q, v) @ J[0]
        if self.disturbance is not None:
            tool = tool - self.disturbance(time, q, v)
        return tau - friction - self.offset - tool, tau, friction, tool

    def balance(self, t: float, y: Array) -> tuple[Array, Array]:
        """Mass matrix, and the torques without reactions at rest, in a state."""
        self.evaluations += 1
        n = self.n
        q, v, x = y[:n].copy(), y[n : 2 * n].copy(), y[2 * n + 4 :].copy()
        M, h = self.bodies(q, v)
        return M, self.load(t, q, v, x)[0] - h

    def friction(self, v: Array) -> Array:
        """Torque of friction that depends on velocities, without the reactions at rest."""
        torque = self._dry_torque + v @ self.viscous
        if self.width is not None:
            return torque + self._smoothed(v, self.width)
        if self.extra is None:
            return torque
        # a slipping joint keeps its direction until the next event, also in trial steps past rest
        s = self.joint_signs
        w = np.where(s > 0.0, np.maximum(v, SLOWEST), np.where(s < 0.0, np.minimum(v, -SLOWEST), v))
        return torque + np.where(s == 0.0, 0.0, self.extra.torque(w))

    def _smoothed(self, v: Array, width: Array) -> Array:
        """Dry friction with ``tanh(v / width)`` instead of the sign."""
        dry, (low, high) = self.smooth, self.jump
        torque = (dry.drives * np.tanh(dry.rates @ v / width[dry.joint])) @ dry.rates
        if self.extra is None:
            return torque
        jump = np.where(v > 0.0, high, np.where(v < 0.0, low, self.extra.torque(0.0 * v)))
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        return torque + self.extra.torque(v) - jump + middle + half * np.tanh(v / width)
