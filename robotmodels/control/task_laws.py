"""Laws that linearise the robot: computed torque, impedance and admittance.

Errors are ``e = q_d - q`` of the joints, or ``e = [p_d - p; log(R_d R^T)]`` of the tool in world
axes; f is the wrench that the tool exerts on the environment. Gains are one number, or one for each
joint or component (six are those of all components).

Parameters
----------
reference : Trajectory, PoseTrajectory, array_like or callable
    Positions (n,), or in task space a world pose (4, 4): a motion, a constant, or a function of t
    that returns (q, v, a) or (T, twist, acceleration), evaluated at t = 0 when the law is made.
model : RobotModel
    The robot as the controller believes it to be, n joints; friction of its drives is compensated.
mask : array_like, shape (6,), optional
    Components of the task, m <= n; default the first that the robot moves independently. Joint
    motions of no effect on them are damped.
M, B, K : float or array_like
    Mass (kg, kg m^2), damping (N s/m, N m s/rad) and stiffness (N/m, N m/rad) of the tool.
frame : str or int, optional
    The frame that is moved; default the tool.

Raises
------
ShapeError, InvalidValueError
    Gains that are not positive; a reference for another number of joints; more components than
    joints; no model.

References
----------
Seed book sections 5.2.3, 5.2.4 and 5.3.2; N. Hogan, "Impedance control", ASME J. Dyn. Syst. Meas.
Control 107, 1985.

Examples
--------
>>> from robotmodels.kinematics import dgm
>>> from robotmodels.robots import load
>>> arm, q, rest = load("rx90"), np.full(6, 0.3), np.zeros(6)
>>> ComputedTorque(q + 0.1, omega=5.0, model=arm).error(0.0, q, rest).round(9)
array([0.1, 0.1, 0.1, 0.1, 0.1, 0.1])
>>> law = Impedance(dgm(arm, q), M=2.0, B=40.0, K=800.0, model=arm)
>>> float(law.frequency[0]), float(law.damping[0])
(20.0, 0.5)
>>> law.command(0.0, q, rest, wrench=[5.0, 0, 0, 0, 0, 0]).shape
(6,)
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_vector
from ..model import RobotModel, check_model
from .law import NO_WRENCH, Law, as_gains, as_word, model_torques
from .reference import Desired, as_reference, joint_reference, pose_reference
from .task import (
    TaskError,
    accelerations,
    frozen_mask,
    row_gains,
    singular_notes,
    task_error,
    task_rows,
    tool_motion,
)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TaskLaw(Law):
    """Parts of laws of the tool: the rows of their task, and its error."""

    rows: NDArray[np.int64] = field(init=False)
    _desired: Desired = field(init=False)

    def _prepare(self: Any, gains: tuple[str, ...], frame: str | int | None = None) -> None:
        check_model(self.model)
        rows, desired = task_rows(self.model, self.mask, frame), pose_reference(self.reference)
        self._set(reference=as_reference(self.reference), rows=rows, _desired=desired)
        self._set(mask=frozen_mask(self.mask))
        for name in gains:
            self._set(**{name: row_gains(as_gains(getattr(self, name), name), rows, name)})

    def error(self: Any, t: float, q: Any, v: Any, wrench: Any = None) -> Array:
        """Error of the task, shape (m,), or of the joints."""
        q, v, _ = self._measured(q, v)
        return self._task(t, q, v).e

    def notes(self: Any, t: Array, q: Array, v: Array) -> tuple[str, ...]:
        """A sentence for singular postures of a motion (N, n)."""
        if getattr(self, "space", "task") == "joint":
            return ()
        return singular_notes(self.model, t, q, self.rows, getattr(self, "frame", None))

    def _task(self: Any, t: float, q: Array, v: Array, wrench: Array = NO_WRENCH) -> TaskError:
        frame = getattr(self, "frame", None)
        at = tool_motion(self.model, q, v, frame)
        if frame is not None and wrench.any():  # the same wrench at the frame's origin
            lever = tool_motion(self.model, q, v).T[:3, 3] - at.T[:3, 3]
            wrench = np.concatenate([wrench[:3], wrench[3:] + np.cross(lever, wrench[:3])])
        return task_error(at, self._desired(t), self.rows, wrench)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ComputedTorque(TaskLaw):
    """Ideal dynamic control, also called computed torque or inverse dynamics control.

    The torque is that of the believed model for the acceleration at which the error of the joints
    (``space="joint"``) or of the tool (``"task"``) obeys ``e'' + 2 zeta omega e' + omega^2 e = 0``.
    """

    reference: Any
    omega: Any = 10.0
    zeta: Any = 1.0
    model: RobotModel = None  # type: ignore[assignment]
    space: str = "joint"
    mask: Any = None

    def __post_init__(self) -> None:
        check_model(self.model)
        as_word(self.space, ("joint", "task"), "space")
        if self.space == "task":
            self._prepare(("omega", "zeta"))
            return
        desired, n = joint_reference(self.reference, self.model.n)
        omega, zeta = as_gains(self.omega, "omega", n), as_gains(self.zeta, "zeta", n)
        self._set(reference=as_reference(self.reference), rows=np.arange(n), _desired=desired)
        self._set(omega=np.full(n, omega), zeta=np.full(n, zeta))

    def command(self, t: float, q: Any, v: Any, x: Any = (), wrench: Any = None) -> Array:
        """Torques, shape (n,), at positions q and velocities v (n,)."""
        return self.shifted(t, q, v, 0.0, 0.0)

    def shifted(self, t: float, q: Any, v: Any, by: Any, speed: Any, wrench: Any = None) -> Array:
        """Torques with the error shifted at this speed (m,); a wrench (6,) is compensated."""
        q, v, _ = self._measured(q, v)
        w, damping = self.omega, 2.0 * self.zeta * self.omega
        if self.space == "joint":
            q_d, v_d, a_d = self._desired(t)
            a = a_d + damping * (v_d - v + speed) + w * w * (q_d - q + by)
        else:
            at = self._task(t, q, v)
            wanted = -damping * (at.de + speed) - w * w * (at.e + by) - at.drift
            a = accelerations(at.J, wanted, v, damping)
        return model_torques(self.model, q, v, a, wrench)

    def lyapunov(self, plant: RobotModel, t: float, q: Array, v: Array, x: Array) -> float:
        """``(e'^T e' + e^T omega^2 e) / 2``, that of the linear error."""
        e, de, *_ = self._task(t, q, v)
        return 0.5 * float(de @ de + e @ (self.omega**2 * e))

    def _task(self, t: float, q: Array, v: Array, wrench: Array = NO_WRENCH) -> TaskError:
        if self.space == "task":
            return TaskLaw._task(self, t, q, v)
        q_d, v_d, a_d = self._desired(t)
        return TaskError(q_d - q, v_d - v, -np.eye(self.n), a_d, wrench)


class _Compliant(TaskLaw):
    """Impedance ``M e'' + B e' + K e = f``: the error at rest is ``f / K``."""

    __slots__ = ()

    @property
    def frequency(self: Any) -> Array:
        """Natural frequencies ``sqrt(K / M)``, rad/s, shape (m,)."""
        return np.sqrt(self.K / self.M)

    @property
    def damping(self: Any) -> Array:
        """Damping ratios ``B / (2 sqrt(K M))``, shape (m,)."""
        return self.B / (2.0 * np.sqrt(self.K * self.M))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Impedance(_Compliant):
    """Impedance control: ``M e'' + B e' + K e = f`` by torques, with the measured wrench f."""

    reference: Any
    M: Any
    B: Any
    K: Any
    model: RobotModel = None  # type: ignore[assignment]
    mask: Any = None
    frame: str | int | None = None

    def __post_init__(self) -> None:
        self._prepare(("M", "B", "K"), self.frame)

    def command(self, t: float, q: Any, v: Any, x: Any = (), wrench: Any = None) -> Array:
        """Torques (n,), for the measured wrench (6,)."""
        return self.shifted(t, q, v, 0.0, 0.0, wrench)

    def shifted(self, t: float, q: Any, v: Any, by: Any, speed: Any, wrench: Any = None) -> Array:
        """Torques with the error shifted at this speed (m,)."""
        q, v, f = self._measured(q, v, wrench)
        at = self._task(t, q, v, f)
        pull = at.force - self.B * (at.de + speed) - self.K * (at.e + by)
        a = accelerations(at.J, pull / self.M - at.drift, v, self.B / self.M)
        return model_torques(self.model, q, v, a, wrench)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Admittance(_Compliant):
    """Admittance control: the measured wrench moves the reference of a position control.

    The error follows ``-xi`` with ``M xi'' + B xi' + K xi = -f``, by a position loop of bandwidth
    omega (rad/s) and damping ratio zeta. The state is (xi, xi').
    """

    reference: Any
    M: Any
    B: Any
    K: Any
    model: RobotModel = None  # type: ignore[assignment]
    omega: Any = 50.0
    zeta: Any = 1.0
    mask: Any = None
    frame: str | int | None = None

    def __post_init__(self) -> None:
        self._prepare(("M", "B", "K", "omega", "zeta"), self.frame)

    @property
    def state0(self) -> Array:
        """The state at the start, zero, shape (2 m,)."""
        return np.zeros(2 * len(self.rows))

    def command(self, t: float, q: Any, v: Any, x: Any = (), wrench: Any = None) -> Array:
        """Torques (n,), for the measured wrench (6,)."""
        q, v, f = self._measured(q, v, wrench)
        at, w, damping = self._task(t, q, v, f), self.omega, 2.0 * self.zeta * self.omega
        xi, rate, second = self._motion(x, at.force)
        wanted = -second - damping * (at.de + rate) - w * w * (at.e + xi) - at.drift
        return model_torques(self.model, q, v, accelerations(at.J, wanted, v, damping), wrench)

    def rate(self, t: float, q: Any, v: Any, x: Any = (), wrench: Any = None) -> Array:
        """Rates of xi and xi', shape (2 m,)."""
        return np.concatenate(
            self._motion(x, self._task(t, *self._measured(q, v, wrench)).force)[1:]
        )

    def _motion(self, x: ArrayLike, force: Array) -> tuple[Array, Array, Array]:
        xi, rate = as_vector(x, 2 * len(self.rows), "x").reshape(2, -1)
        return xi, rate, -(force + self.B * rate + self.K * xi) / self.M
