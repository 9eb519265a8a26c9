"""Laws that linearise the robot: computed torque, impedance and admittance.

Parameters
----------
reference, model
    See `robotmodels.control`; friction of the model's drives is compensated.
mask : array_like, shape (6,), optional
    Components of the task, m <= n; default the first that the robot moves independently. Joint
    motions of no effect on them are damped.
M, B, K : float or array_like
    Mass (kg, kg m^2), damping (N s/m, N m s/rad) and stiffness (N/m, N m/rad) of the tool.
frame : str or int, optional
    The frame that is moved; default the tool.

References
----------
Book sections 5.2.3, 5.2.4 and 5.3.2; N. Hogan, "Impedance control", ASME J. Dyn. Syst. Meas.
Control 107, 1985.

Examples
--------
>>> from robotmodels.kinematics import dgm
>>> from robotmodels.robots import load
>>> arm, q = load("rx90"), np.full(6, 0.3)
>>> law = Impedance(dgm(arm, q), M=2.0, B=40.0, K=800.0, model=arm)
>>> float(law.frequency[0]), float(law.damping[0])
(20.0, 0.5)
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, as_mask, read_only
from .._choices import one_of
from ..errors import InvalidValueError, SingularMassMatrixError
from ..kinematics import dgm, jacobian
from ..model import RobotModel, check_model
from .law import NO_WRENCH, POSE, Desired, Law, model_torques

_RANK = 1e-9  # relative singular value of rows that depend
_FIRST = np.zeros(6, dtype=np.int64)
_UNWEIGHTED = read_only(np.empty((0, 0)))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TaskLaw(Law):
    """Parts of laws of the tool: the components of their task, their error and their notes."""

    rows: NDArray[np.int64] = field(init=False)
    _desired: Desired = field(init=False)
    _axes: Array | None = field(init=False)
    _linear: Array = field(init=False)  # factors (3, m) of rate, error and force
    _free: float = field(init=False)  # damping of motions of no effect

    space = "task"
    frame = None

    def _prepare(self: Any, gains: tuple[str, ...]) -> None:
        check_model(self.model)
        self._set_rows()
        self._keep_reference(POSE)
        self._keep_gains(gains, len(self.rows), rows=self.rows)

    def _set_rows(self: Any, turn: Array | None = None) -> None:
        """Rows of the task, m <= n: of the mask, or the first that the robot moves alone."""
        n, turn, mask = self.model.n, np.eye(6) if turn is None else turn, self.mask
        rows = [] if mask is None else np.flatnonzero(as_mask(mask)).tolist()
        if len(rows) > n:
            raise InvalidValueError(
                f"mask: {len(rows)} components are more than the {n} joints; choose fewer."
            )
        postures = np.random.default_rng(0).uniform(-2.0, 2.0, (4, n))
        J = turn @ jacobian(self.model, postures, self.frame)
        for row in range(6) if mask is None else ():
            ranks = np.linalg.matrix_rank(J[:, [*rows, row]], rtol=_RANK)
            if len(rows) < n and (ranks > len(rows)).any():
                rows.append(row)
        axes = None if rows == [*range(6)] and np.array_equal(turn, np.eye(6)) else turn[rows]
        self._set(rows=np.array(rows, dtype=np.int64), mask=as_flags(mask), _axes=axes)

    def _tool(
        self: Any, q: Array, v: Array, desired: tuple[Array, ...], wrench: Array, *more: Array
    ) -> tuple[Array, Array, Array]:
        """Rows of `tool_errors`, and more ones, in components (.., m) of the task; J (2, m, n).

        Also the joint torques of the wrench.
        """
        model, J, rows = self.model, np.empty((2, 6, len(q))), np.empty((6 + len(more), 6))
        frame = model.twin.frame(self.frame).kernel_arguments
        _kernels().tool_errors(q[None], v[None], model.chain, *frame, *desired, wrench, J, rows)
        load, axes = wrench @ J[0], self._axes
        if more:
            rows[6:] = more
        return (rows, J, load) if axes is None else (rows @ axes.T, axes @ J, load)

    def _task(self: Any, t: float, q: Array, v: Array, wrench: Array = NO_WRENCH) -> Any:
        """As `_tool` for the reference; the wrench acts at the tool."""
        if self.frame is None or not wrench.any():
            return self._tool(q, v, self._desired(t), wrench)
        lever = dgm(self.model, q)[:3, 3] - dgm(self.model, q, self.frame)[:3, 3]
        at = np.concatenate([wrench[:3], wrench[3:] + np.cross(lever, wrench[:3])])
        return *self._tool(q, v, self._desired(t), at)[:2], wrench @ jacobian(self.model, q)

    def _error(self: Any, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        return self._task(t, q, v)[0][0]

    def _obey(self: Any, damping: Array, stiffness: Array, softness: Array) -> None:
        """Keep factors of ``e'' + damping e' + stiffness e = softness force``, each (m,)."""
        self._set(_linear=np.stack([damping, stiffness, softness]), _free=float(np.max(damping)))

    def _torques(self: Any, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        return self.shifted(t, q, v, 0.0, 0.0, f)

    def shifted(
        self: Any, t: float, q: Array, v: Array, by: Any, speed: Any, wrench: Array = NO_WRENCH
    ) -> Array:
        """Torques with the error shifted at this speed (m,); the wrench (6,) is compensated."""
        (e, de, drift, force, *_), J, load = self._task(t, q, v, wrench)
        damping, stiffness, softness = self._linear
        pull = damping * (de + speed) + stiffness * (e + by) + drift - softness * force
        a = pull if J is None else self._resolved(J[1], -pull, v)
        return model_torques(self.model, q, v, a) + load

    def _resolved(
        self: Any, J: Array, wanted: Array, v: Array, order: Any = _FIRST, M: Array = _UNWEIGHTED
    ) -> Array:
        """Joint accelerations with ``J a = wanted``; see the kernel."""
        a = np.empty(self.n)
        if _kernels().resolved(J, wanted, order[: len(J)], M, -self._free * v, a) < 0:
            raise SingularMassMatrixError(
                "model: the mass matrix is singular; give all joints inertia."
            )
        return a

    def notes(self: Any, t: Array, q: Array, v: Array) -> tuple[str, ...]:
        """A sentence for postures of a motion (N, n) that are singular for the task, or nearly."""
        if self.space == "joint":
            return ()
        J = jacobian(self.model, q, self.frame)
        J = J if self._axes is None else self._axes @ J
        longest = np.linalg.norm(J, axis=2).max(axis=1)
        near = np.linalg.svd(J, compute_uv=False)[:, -1] < _kernels().NEAR * longest
        return (
            f"At t = {t[np.argmax(near)]:.6g} s the posture is singular for the task, or nearly: "
            "motions of the tool that the joints can hardly make there are damped.",
        ) * bool(near.any())


@cache
def _kernels() -> Any:
    from . import kernels

    return kernels


def as_flags(mask: Any) -> Array | None:
    """A mask as zeros and ones (6,)."""
    return None if mask is None else as_mask(mask).astype(np.float64)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ComputedTorque(TaskLaw):
    """Ideal dynamic control, also called computed torque or inverse dynamics control.

    The torque is that of the model of the law for the acceleration at which the error of the joints
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
        one_of(self.space, ("joint", "task"), "space")
        if self.space == "task":
            self._prepare(("omega", "zeta"))
        elif self.mask is not None:
            raise InvalidValueError("mask: space='joint' has no mask; give space='task' with it.")
        else:
            self._set(rows=np.arange(self._keep_reference(n=self.n)))
            self._keep_gains(("omega", "zeta"), self.n, rows=self.rows)
        self._obey(2.0 * self.zeta * self.omega, self.omega**2, 0.0 * self.omega)

    def _torques(self, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        return self.shifted(t, q, v, 0.0, 0.0)

    def lyapunov(self, plant: RobotModel, t: float, q: Array, v: Array, x: Array) -> float:
        """``(e'^T e' + e^T omega^2 e) / 2``, that of the linear error."""
        e, de, *_ = self._task(t, q, v)[0]
        return 0.5 * float(de @ de + e @ (self.omega**2 * e))

    def _task(self, t: float, q: Array, v: Array, wrench: Array = NO_WRENCH) -> Any:
        if self.space == "task":
            return TaskLaw._task(self, t, q, v, wrench)
        q_d, v_d, a_d = self._desired(t)
        return (q_d - q, v_d - v, a_d, 0.0), None, 0.0


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
        self._prepare(("M", "B", "K"))
        self._obey(self.B / self.M, self.K / self.M, 1.0 / self.M)


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
    state0: Array = field(init=False)

    def __post_init__(self) -> None:
        self._prepare(("M", "B", "K", "omega", "zeta"))
        self._obey(2.0 * self.zeta * self.omega, self.omega**2, 1.0 / self.M)
        self._set(state0=np.zeros(2 * len(self.rows)))

    def _torques(self, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        damping, stiffness, _ = self._linear
        xi, rate = x.reshape(2, -1)
        pull = (damping - self.B / self.M) * rate + (stiffness - self.K / self.M) * xi
        return self.shifted(t, q, v, pull / stiffness, 0.0, f)

    def _rate(self, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        xi, rate = x.reshape(2, -1)
        force = self._task(t, q, v, f)[0][3]
        return np.concatenate([rate, -(force + self.B * rate + self.K * xi) / self.M])
