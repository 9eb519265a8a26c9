"""Control of forces: on a mass and a spring, beside positions (hybrid), around a position loop.

Wrenches ``[f; m]`` are those that the tool exerts on the environment, at the tool, in world axes.
A position error is ``[p_d - p; log(R_d R^T)]``.

Parameters
----------
kp, kv, ke : float or array_like
    Gains of the force error, 1/s^2, and of its rate, 1/s, such as ``omega^2`` and ``2 zeta omega``;
    stiffness of the environment as the controller believes it to be, N/m (N m/rad).
feedforward : {"desired", "measured"}
    The force that is fed forward.
model : RobotModel
    The robot as the controller believes it to be, n joints.
mask : array_like, shape (6,), optional
    Components of the task, at most n.
selection : array_like, shape (6,)
    1 where a force is controlled, 0 where a position is, in the axes of the task.
task_frame, contact_frame : array_like, shape (4, 4) or (3, 3)
    Pose or rotation, whose axes are those of the task; wrenches stay in world axes.
position : ComputedTorque or reference
    A law in task space, or a reference for one with its default gains.
force, reference : ForceTracking or reference
    A wrench (a constant (6,), or a function of t that returns it with its rate and second rate);
    hybrid laws take the gains of a force law, too; of a wrench alone, kp = 400, kv = 40, ke = 2000.
inverse : {"consistent", "jacobian"}
    ``"consistent"``: positions through the dynamically consistent pseudo-inverse of their rows,
    forces in its null space. ``"jacobian"``: joint servos of equal gains through ``J^-1 S``, the
    historical form; it is unstable in some postures of revolute arms (An and Hollerbach).
inner : ComputedTorque or Impedance
    The law in task space whose reference an external loop moves.
stiffness, gain : float or array_like
    Of the environment as the controller believes it to be, N/m (N m/rad); bandwidth of the external
    loop, 1/s.

Raises
------
ShapeError, InvalidValueError
    Gains that are not positive; a selection that is not of zeros and ones; more components than
    joints; no model.

References
----------
Seed book sections 5.3.3 to 5.3.6; J. Craig, "Introduction to Robotics", section 11.4; M. Raibert
and J. Craig, ASME J. Dyn. Syst. Meas. Control 103(2), 1981; O. Khatib, IEEE J. Robotics and
Automation 3(1), 1987; C. An and J. Hollerbach, IEEE ICRA 1987; W. Fisher and M. Mujtaba, Int. J.
Robotics Research 11(4), 1992; J. De Schutter and H. Van Brussel, ibid. 7(4), 1988.

Examples
--------
>>> from robotmodels.kinematics import dgm
>>> from robotmodels.robots import load
>>> arm, q, push = load("rx90"), np.full(6, 0.3), [0.0, 0.0, -20.0, 0.0, 0.0, 0.0]
>>> ForceTracking(400.0, 40.0, 1e4, reference=push, model=arm).error(0.0, q, 0.0 * q)
array([  0.,   0., -20.])
>>> law = ParallelHybrid([0, 0, 1, 0, 0, 0], np.eye(4), dgm(arm, q), push, model=arm)
>>> law.error(0.0, q, 0.0 * q, wrench=[0.0, 0.0, -5.0, 0.0, 0.0, 0.0]).round(9) + 0.0
array([  0.,   0., -15.,   0.,   0.,   0.])
>>> inner = ComputedTorque(dgm(arm, q), omega=50.0, model=arm, space="task")
>>> law = ExternalForceLoop(inner, stiffness=1e4, gain=5.0, force=push)
>>> float(law.rate(0.0, q, 0.0 * q, law.state0)[2])
-0.01
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, as_floats, as_mask, as_vector
from ..dynamics import mass_matrix
from ..errors import InvalidValueError, ShapeError, SingularMassMatrixError
from ..model import RobotModel, check_model
from ..se3 import as_single_pose
from .law import Law, as_gains, as_word, model_torques
from .reference import Desired, as_reference, wrench_reference
from .task import (
    RANK,
    accelerations,
    frozen_mask,
    row_gains,
    singular_notes,
    task_error,
    task_rows,
    tool_motion,
)
from .task_laws import ComputedTorque, Impedance

_ALL = np.arange(6)
_FORCE_GAINS = 400.0, 40.0, 2000.0  # kp, kv, ke of hybrid laws given a wrench alone


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ForceTracking(Law):
    """Force control of a mass against a spring, in the directions of the mask.

    ``x'' = (f_d'' + kv (f_d' - ke x') + kp (f_d - f)) / ke`` with the operational mass of the
    believed model, and a force that is fed forward. A constant disturbance f_dist leaves the error
    ``f_dist / (1 + m kp / ke)`` with the desired force, ``f_dist ke / (m kp)`` with the measured.
    """

    kp: Any
    kv: Any
    ke: Any
    feedforward: str = "desired"
    reference: Any = None
    model: RobotModel = None  # type: ignore[assignment]
    mask: Any = "position"
    rows: NDArray[np.int64] = field(init=False)
    _desired: Desired = field(init=False)

    def __post_init__(self) -> None:
        check_model(self.model)
        as_word(self.feedforward, ("desired", "measured"), "feedforward")
        for name in ("kp", "kv", "ke"):
            self._set(**{name: np.full(6, as_gains(getattr(self, name), name, 6))})
        self._set(rows=np.flatnonzero(as_mask(self.mask)), reference=as_reference(self.reference))
        self._set(_desired=wrench_reference(self.reference), mask=frozen_mask(self.mask))

    def command(self, t: float, q: Any, v: Any, x: Any = (), wrench: Any = None) -> Array:
        """Torques (n,), for the measured wrench (6,)."""
        (q, v, f), rows, ahead = self._measured(q, v, wrench), self.rows, np.zeros(6)
        tool, desired = tool_motion(self.model, q, v), self._desired(t)
        wanted = self.wanted(desired, tool.twist, f) - tool.drift
        a = accelerations(tool.J[rows], wanted[rows], v, self.kv)
        ahead[rows] = (desired[0] if self.feedforward == "desired" else f)[rows]
        return model_torques(self.model, q, v, a, ahead)

    def wanted(self, desired: tuple[Array, ...], twist: Array, f: Array) -> Array:
        """Acceleration of the tool, shape (6,)."""
        f_d, rate, second = desired
        return (second + self.kv * (rate - self.ke * twist) + self.kp * (f_d - f)) / self.ke

    def notes(self, t: Array, q: Array, v: Array) -> tuple[str, ...]:
        """A sentence for singular postures of a motion (N, n)."""
        return singular_notes(self.model, t, q, self.rows)

    def error(self, t: float, q: Any, v: Any, wrench: Any = None) -> Array:
        """Error of the wrench, shape (m,)."""
        return (self._desired(t)[0] - self._measured(q, v, wrench)[2])[self.rows]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Split(Law):
    """Position in some directions of a task, force in the others."""

    rows: NDArray[np.int64] = field(init=False)
    _forced: NDArray[np.bool_] = field(init=False)
    _turn: Array = field(init=False)
    _gains: tuple[Array, Array] = field(init=False)

    def _prepare(self: Any, frame: str) -> None:
        check_model(self.model)
        axes = getattr(self, frame)
        given = as_floats(getattr(axes, "homogeneous", axes), frame)
        if given.shape not in ((3, 3), (4, 4)):
            raise ShapeError(f"{frame}: expected shape (4, 4) or (3, 3), got {given.shape}.")
        T = np.eye(4)
        T[:3, :3] = given[:3, :3]
        turn: Any = np.kron(np.eye(2), as_single_pose(T, frame)[:3, :3].T)
        selection = as_mask(self.selection, name="selection")
        rows = task_rows(self.model, self.mask, turn=turn)
        if not selection[rows].any():
            raise InvalidValueError(
                "selection: expected a force-controlled component of the task, got none."
            )
        position, force = self.position, self.force
        if not isinstance(position, ComputedTorque):
            position = ComputedTorque(position, model=self.model, space="task")
        elif position.space != "task":
            raise InvalidValueError("position: expected a law in task space, space='task'.")
        if not isinstance(force, ForceTracking):
            force = ForceTracking(*_FORCE_GAINS, reference=force, model=self.model)
        self._set(position=position, force=force, rows=rows, _forced=selection[rows], _turn=turn)
        w = np.full(6, np.max(position.omega))
        damping = 2.0 * w * np.max(position.zeta)
        w[position.rows] = position.omega
        damping[position.rows] = 2.0 * position.zeta * position.omega
        self._set(selection=selection.astype(float), _gains=(w, damping), **{frame: given})
        self._set(mask=frozen_mask(self.mask))

    def notes(self: Any, t: Array, q: Array, v: Array) -> tuple[str, ...]:
        """A sentence for singular postures of a motion (N, n)."""
        return singular_notes(self.model, t, q, self.rows)

    def error(self: Any, t: float, q: Any, v: Any, wrench: Any = None) -> Array:
        """Errors of position and force in the axes of the task, shape (m,)."""
        q, v, f = self._measured(q, v, wrench)
        at = task_error(tool_motion(self.model, q, v), self.position._desired(t), _ALL)
        missing = self.force._desired(t)[0] - f
        return np.where(self._forced, *(self._turn[self.rows] @ x for x in (missing, at.e)))

    def _aims(self: Any, t: float, q: Array, v: Array, f: Array) -> tuple[Array, Array]:
        """Jacobian (m, n) of the task's motions, and ``J a`` (m,) that is wanted."""
        turn, rows, tool = self._turn, self.rows, tool_motion(self.model, q, v)
        e, de, J, drift, _ = task_error(tool, self.position._desired(t), _ALL)
        w, damping = self._gains
        place = (turn @ (w * w * e + damping * de + drift))[rows]
        desired = tuple(turn @ x for x in self.force._desired(t))
        push = self.force.wanted(desired, turn @ tool.twist, turn @ f) - turn @ tool.drift
        forced = self._forced
        moved = np.where(forced[:, None], (turn @ tool.J)[rows], -(turn @ J)[rows])
        return moved, np.where(forced, push[rows], place)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ParallelHybrid(_Split):
    """Hybrid control, parallel structure: position and force in complementary directions."""

    selection: Any
    task_frame: Any
    position: Any
    force: Any
    model: RobotModel = None  # type: ignore[assignment]
    mask: Any = None
    inverse: str = "consistent"

    def __post_init__(self) -> None:
        self._prepare("task_frame")
        as_word(self.inverse, ("consistent", "jacobian"), "inverse")
        if self.inverse == "jacobian" and len(self.rows) != self.n:
            raise InvalidValueError(
                f"inverse: 'jacobian' needs as many components as joints, {self.n}, got "
                f"{len(self.rows)}."
            )

    def command(self, t: float, q: Any, v: Any, x: Any = (), wrench: Any = None) -> Array:
        """Torques (n,), for the measured wrench (6,)."""
        q, v, f = self._measured(q, v, wrench)
        J, wanted = self._aims(t, q, v, f)
        forced, M = self._forced, mass_matrix(self.model, q)
        if self.inverse == "consistent":
            tasks = [(J[k], wanted[k]) for k in (~forced, forced)]
            a = prioritised(M, tasks, -2.0 * np.max(self.position.omega) * v)
            return model_torques(self.model, q, v, a, f)
        servo = np.mean(np.diag(M)) * accelerations(J, np.where(forced, 0.0, wanted), v, 0.0)
        mass = np.linalg.pinv(J[forced] @ _inverse(M) @ J[forced].T, RANK)
        f_d = (self._turn @ self.force._desired(t)[0])[self.rows][forced]
        push = J[forced].T @ (mass @ wanted[forced] + f_d)
        return servo + push + model_torques(self.model, q, v, np.zeros(self.n))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ConstrainedDecoupling(_Split):
    """Non-linear decoupling in a contact frame: each of its directions is a double integrator.

    The measured wrench is compensated, and all rows of the task are inverted at once. By default
    the force along z of the contact frame is controlled.
    """

    contact_frame: Any
    position: Any
    force: Any
    model: RobotModel = None  # type: ignore[assignment]
    mask: Any = None
    selection: Any = (0, 0, 1, 0, 0, 0)

    def __post_init__(self) -> None:
        self._prepare("contact_frame")

    def command(self, t: float, q: Any, v: Any, x: Any = (), wrench: Any = None) -> Array:
        """Torques (n,), for the measured wrench (6,)."""
        q, v, f = self._measured(q, v, wrench)
        a = accelerations(*self._aims(t, q, v, f), v, 2.0 * self.position.omega)
        return model_torques(self.model, q, v, a, f)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ExternalForceLoop(Law):
    """Force control by an external loop, which moves the reference of a position control.

    The reference moves by the force error over the stiffness, and by gain times the integral of
    that, the state. With a gain below ``2 zeta omega`` (``B / M``) of the inner law this is stable
    for every stiffness of the environment. An inner `ComputedTorque` compensates the measured
    wrench, and holds the position in directions without a desired force whose wrench is zero; an
    inner `Impedance` also gives way to the wrench.
    """

    inner: ComputedTorque | Impedance
    stiffness: Any
    gain: Any
    force: Any = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    mask: Any = None
    _active: Array = field(init=False)
    _desired: Desired = field(init=False)

    def __post_init__(self) -> None:
        if not (isinstance(self.inner, Impedance) or getattr(self.inner, "space", "") == "task"):
            raise InvalidValueError(
                "inner: expected a law in task space (ComputedTorque with space='task', "
                f"Impedance), got {self.inner!r:.80}."
            )
        rows = self.inner.rows
        for name in ("stiffness", "gain"):
            self._set(**{name: row_gains(as_gains(getattr(self, name), name), rows, name)})
        self._set(_desired=wrench_reference(self.force), force=as_reference(self.force))
        self._set(_active=as_mask(self.mask)[rows].astype(float), mask=frozen_mask(self.mask))

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.inner.n

    @property
    def state0(self) -> Array:
        """Shift of the reference at the start, zero, shape (m,)."""
        return np.zeros(len(self.inner.rows))

    def command(self, t: float, q: Any, v: Any, x: Any = (), wrench: Any = None) -> Array:
        """Torques (n,), for the measured wrench (6,)."""
        x, speed = as_vector(x, len(self.inner.rows), "x"), self.rate(t, q, v, x, wrench)
        return self.inner.shifted(t, q, v, x + speed / self.gain, speed, wrench)

    def rate(self, t: float, q: Any, v: Any, x: Any = (), wrench: Any = None) -> Array:
        """Velocity of the shift, shape (m,)."""
        return self.gain / self.stiffness * self.error(t, q, v, wrench)

    def notes(self, t: Array, q: Array, v: Array) -> tuple[str, ...]:
        """A sentence for singular postures of a motion (N, n)."""
        return self.inner.notes(t, q, v)

    def error(self, t: float, q: Any, v: Any, wrench: Any = None) -> Array:
        """Error of the wrench, shape (m,)."""
        missing = self._desired(t)[0] - self._measured(q, v, wrench)[2]
        return self._active * missing[self.inner.rows]


def _inverse(M: Array) -> Array:
    """Inverse of the mass matrix of the believed model."""
    try:
        inverse: Array = np.linalg.inv(M)  # type: ignore[assignment]
    except np.linalg.LinAlgError:
        raise SingularMassMatrixError(
            "model: the mass matrix is singular; a hybrid law needs a model whose joints all have "
            "inertia."
        ) from None
    return inverse


def prioritised(M: Array, tasks: list[tuple[Array, Array]], free: Array) -> Array:
    """Accelerations a with ``J a = wanted`` for tasks in the order of priority.

    By dynamically consistent pseudo-inverses in the null spaces of the tasks before; what remains
    free has the accelerations `free`.
    """
    inverse, N, a = _inverse(M), np.eye(len(M)), np.zeros(len(M))
    for J, wanted in tasks:
        mobility = N @ inverse @ J.T
        P = mobility @ np.linalg.pinv(J @ mobility, RANK)
        a, N = a + P @ (wanted - J @ a), N - P @ (J @ N)
    return a + N @ free
