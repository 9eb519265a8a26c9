"""Control of forces: on a mass and a spring, beside positions, around a position loop; walls.

Parameters
----------
kp, kv, ke : float or array_like
    Gains of the force error, 1/s^2, and of its rate, 1/s, such as ``omega^2`` and ``2 zeta omega``;
    stiffness of the environment that the controller assumes, N/m (N m/rad).
feedforward : {"desired", "measured"}
    The force that is fed forward.
model, mask
    As for the laws in task space.
selection : array_like, shape (6,)
    1 where a force is controlled, 0 where a position is, in the axes of the task.
task_frame, contact_frame : array_like, shape (4, 4) or (3, 3)
    Pose or rotation, whose axes are those of the task and of the gains; wrenches stay in world
    axes.
position, inner : ComputedTorque (``position`` also a reference) or Impedance
    A law in task space: that of the directions without force, and that whose reference an external
    loop moves.
force, reference : ForceTracking or reference
    A wrench (a constant (6,), or a function of t that returns it with its rate and second rate);
    hybrid laws take the gains of a force law, too; of a wrench alone, kp = 400, kv = 40, ke = 2000.
inverse : {"consistent", "jacobian"}
    ``"consistent"``: positions through the dynamically consistent pseudo-inverse of their rows,
    forces in its null space. ``"jacobian"``: joint servos of equal gains through ``J^-1 S``, the
    historical form; it is unstable in some postures of revolute arms (An and Hollerbach).
stiffness, gain : float or array_like
    Of the environment that the controller assumes, N/m (N m/rad), or of the wall; bandwidth of the
    external loop, 1/s.
point, normal : array_like, shape (3,)
    Point of the undeformed wall in the world, m; direction to the free side, of any length.
damping, friction, slip : float
    Of the wall, N s/m; coefficient of its dry friction, and velocity below which that is smoothed,
    m/s.
bilateral : bool
    Whether the wall holds the tool on both sides: a spring.

References
----------
Book sections 5.3.1 and 5.3.3 to 5.3.6; J. Craig, "Introduction to Robotics", section 11.4;
M. Raibert and J. Craig, ASME J. Dyn. Syst. Meas. Control 103(2), 1981; O. Khatib, IEEE J. Robotics
and Automation 3(1), 1987; C. An and J. Hollerbach, ICRA 1987; W. Fisher and M. Mujtaba, Int. J.
Robotics Research 11(4), 1992; J. De Schutter and H. Van Brussel, ibid. 7(4), 1988.

Examples
--------
>>> from robotmodels.kinematics import dgm
>>> from robotmodels.robots import load
>>> arm, q, push = load("rx90"), np.full(6, 0.3), [0.0, 0.0, -20.0, 0.0, 0.0, 0.0]
>>> law = ParallelHybrid([0, 0, 1, 0, 0, 0], np.eye(4), dgm(arm, q), push, model=arm)
>>> law.error(0.0, q, 0.0 * q, wrench=[0.0, 0.0, -5.0, 0.0, 0.0, 0.0]).round(9) + 0.0
array([  0.,   0., -15.,   0.,   0.,   0.])
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import (
    Array,
    Frozen,
    Value,
    as_core,
    as_exact,
    as_flag,
    as_floats,
    as_mask,
    as_number,
    batch_shape,
)
from .._choices import one_of
from ..dynamics import mass_matrix
from ..errors import InvalidValueError, ShapeError
from ..model import RobotModel, check_model
from ..se3 import as_single_pose
from .law import NO_WRENCH, WRENCH, model_torques
from .task_laws import ComputedTorque, Impedance, TaskLaw, as_flags

_NOWHERE = np.eye(4), np.zeros(6), np.zeros(6)
_FED = {"measured": 6, "desired": 7}
_OF_WALLS = {"stiffness": "above", "slip": "above", "damping": "least", "friction": "least"}
_FORCE_GAINS = 400.0, 40.0, 2000.0  # kp, kv, ke of hybrid laws given a wrench alone


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ForceTracking(TaskLaw):
    """Force control of a mass against a spring, in the directions of the mask.

    ``x'' = (f_d'' + kv (f_d' - ke x') + kp (f_d - f)) / ke`` with the operational mass of the
    model of the law, and force feedforward. A constant disturbance f_dist leaves the error
    ``f_dist / (1 + m kp / ke)`` with the desired force, ``f_dist ke / (m kp)`` with the measured.
    """

    kp: Any
    kv: Any
    ke: Any
    feedforward: str = "desired"
    reference: Any = None
    model: RobotModel = None  # type: ignore[assignment]
    mask: Any = "position"
    _gains: Array = field(init=False)

    def __post_init__(self) -> None:
        check_model(self.model)
        one_of(self.feedforward, ("desired", "measured"), "feedforward")
        self._keep_gains(("kp", "kv", "ke"), 6, rows=range(6))
        self._keep_reference(WRENCH)
        rows = np.flatnonzero(as_mask(self.mask))
        self._set(rows=rows, _axes=np.eye(6)[rows], _free=float(np.max(self.kv)))
        self._set(mask=as_flags(self.mask), _gains=pushes(self)[:, rows])

    def _torques(self, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        rows, J, _ = self._tool(q, v, _NOWHERE, NO_WRENCH, f, *self._desired(t))
        a = self._resolved(J[0], np.einsum("kj,kj->j", self._gains, rows), v)
        return model_torques(self.model, q, v, a) + rows[_FED[self.feedforward]] @ J[0]

    def _error(self, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        return (self._desired(t)[0] - f)[self.rows]


def pushes(law: ForceTracking) -> Array:
    """Factors (10, 6) of error, rate, drift, wrench, twist, its drift, force and its reference.

    Their sum is the acceleration ``(f_d'' + kv (f_d' - ke x') + kp (f_d - f)) / ke`` that is
    wanted, less the drift of the twist.
    """
    kp, kv, ke = law.kp, law.kv, law.ke
    ones = np.ones(6)
    return np.stack([*np.zeros((4, 6)), -kv, -ones, -kp / ke, kp / ke, kv / ke, ones / ke])


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Split(TaskLaw):
    """Position in some directions of a task, force in the others."""

    _order: NDArray[np.int64] = field(init=False)  # 1 where a force is controlled
    _chosen: tuple[Array, Array] = field(init=False)  # rows of both Jacobians
    _gains: Array = field(init=False)

    def _prepare(self: Any, frame: str) -> None:
        check_model(self.model)
        axes = getattr(self, frame)
        given = as_floats(getattr(axes, "homogeneous", axes), frame)
        if given.shape not in ((3, 3), (4, 4)):
            raise ShapeError(f"{frame}: expected shape (4, 4) or (3, 3), got {given.shape}.")
        T = np.eye(4)
        T[:3, :3] = given[:3, :3]
        selection = as_mask(self.selection, name="selection")
        self._set_rows(np.kron(np.eye(2), as_single_pose(T, frame)[:3, :3].T))
        if not selection[self.rows].any():
            raise InvalidValueError("selection: expected a force-controlled component, got none.")
        position, force = self.position, self.force
        if not isinstance(position, ComputedTorque):
            position = ComputedTorque(position, model=self.model, space="task")
        elif position.space != "task":
            raise InvalidValueError("position: expected a law in task space, space='task'.")
        if not isinstance(force, ForceTracking):
            force = ForceTracking(*_FORCE_GAINS, reference=force, model=self.model)
        w, z = np.full((2, 6), [[np.max(position.omega)], [np.max(position.zeta)]])
        w[position.rows], z[position.rows] = position.omega, position.zeta
        gains = np.where(selection, pushes(force), 0.0)
        gains[:3] -= np.where(selection, 0.0, [w * w, 2.0 * z * w, np.ones(6)])
        order = selection[self.rows].astype(np.int64)
        self._set(
            _gains=gains[:, self.rows], _order=order, _chosen=(1 - order, np.arange(len(order)))
        )
        self._set(position=position, force=force, selection=selection.astype(float))
        self._set(_free=2.0 * np.max(position.omega), **{frame: given})

    def _aims(self: Any, t: float, q: Array, v: Array, f: Array) -> tuple[Array, ...]:
        """Rows of `_tool`, Jacobian (m, n), wanted ``J a`` (m,) and torques (n,) of the wrench."""
        pose, force = self.position._desired(t), self.force._desired(t)
        rows, J, load = self._tool(q, v, pose, f, f, *force)
        wanted = np.einsum("kj,kj->j", self._gains, rows)
        return rows, J[self._chosen], wanted, load

    def _error(self: Any, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        rows = self._aims(t, q, v, f)[0]
        return np.where(self._order, rows[7] - rows[6], rows[0])


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
        one_of(self.inverse, ("consistent", "jacobian"), "inverse")
        if self.inverse == "jacobian" and len(self.rows) != self.n:
            raise InvalidValueError(
                f"inverse: 'jacobian' needs as many components as joints, got {len(self.rows)}."
            )

    def _torques(self, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        rows, J, wanted, load = self._aims(t, q, v, f)
        M = mass_matrix(self.model, q)
        if self.inverse == "consistent":
            a = self._resolved(J, wanted, v, self._order, M)
            return model_torques(self.model, q, v, a) + load
        rest, forced = np.zeros(self.n), self._order == 1
        J_f = J[forced]
        servo = np.mean(np.diag(M)) * self._resolved(J, np.where(forced, 0.0, wanted), rest)
        push = M @ self._resolved(J_f, wanted[forced], rest, M=M) + J_f.T @ rows[7, forced]
        return servo + push + model_torques(self.model, q, v, rest)


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

    def _torques(self, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        _, J, wanted, load = self._aims(t, q, v, f)
        return model_torques(self.model, q, v, self._resolved(J, wanted, v)) + load


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ExternalForceLoop(TaskLaw):
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
    model: RobotModel = field(init=False)
    state0: Array = field(init=False)
    _active: Array = field(init=False)

    def __post_init__(self) -> None:
        inner: Any = self.inner
        if not isinstance(inner, (ComputedTorque, Impedance)) or inner.space != "task":
            raise InvalidValueError(
                f"inner: expected a law in task space (or Impedance), got {inner!r:.30}."
            )
        rows = inner.rows
        self._keep_gains(("stiffness", "gain"), len(rows), rows=rows)
        self._keep_reference(WRENCH, name="force")
        self._set(_active=as_mask(self.mask)[rows].astype(float), mask=as_flags(self.mask))
        self._set(model=inner.model, rows=rows, state0=np.zeros(len(rows)))

    def _torques(self, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        speed = self._rate(t, q, v, x, f)
        return self.inner.shifted(t, q, v, x + speed / self.gain, speed, f)

    def _rate(self, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        return self.gain / self.stiffness * self._error(t, q, v, x, f)

    def _error(self, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        return self._active * (self._desired(t)[0] - f)[self.rows]

    def notes(self, t: Array, q: Array, v: Array) -> tuple[str, ...]:
        """Sentences of the inner law."""
        return self.inner.notes(t, q, v)


@dataclass(frozen=True, slots=True, eq=False)
class SpringWall(Frozen, Value):
    """An elastic wall: the wrench that a tool exerts on it, as a function of its motion.

    The tool point pushes with ``stiffness depth + damping depth'``, never pulls unless the wall is
    bilateral, and rubs with Coulomb friction ``friction |push|`` along its sliding velocity. A
    tool is a point: there are no moments.

    Examples
    --------
    >>> wall = SpringWall([0.5, 0.0, 0.0], normal=[-1.0, 0.0, 0.0], stiffness=1e4)
    >>> tool = np.eye(4)
    >>> tool[0, 3] = 0.501
    >>> wall(0.0, tool, np.zeros(6)).round(9)[:3]
    array([10.,  0.,  0.])
    """

    point: Array
    normal: Array
    stiffness: float
    damping: float = 0.0
    friction: float = 0.0
    bilateral: bool = False
    slip: float = 1e-3

    def __post_init__(self) -> None:
        normal = as_exact(self.normal, (3,), "normal")
        if not normal.any():
            raise InvalidValueError("normal: expected a vector that is not zero.")
        normal = normal / np.abs(normal).max()
        given: dict[str, Any] = {"normal": normal / np.linalg.norm(normal)}
        given["bilateral"] = as_flag(self.bilateral, "bilateral")
        for name, bound in _OF_WALLS.items():
            given[name] = as_number(getattr(self, name), name, **{bound: 0.0})
        for name, value in (given | {"point": as_exact(self.point, (3,), "point")}).items():
            object.__setattr__(self, name, value)
        Frozen.__post_init__(self)

    def __call__(self, t: float, T: ArrayLike, twist: ArrayLike) -> Array:
        """Wrench (..., 6) on the wall, world axes, for poses (..., 4, 4) and twists (..., 6)."""
        T, twist = as_core(T, (4, 4), "T"), as_core(twist, (6,), "twist")
        wrench = np.zeros((*batch_shape((T[..., 0], twist), ("T", "twist")), 6))
        depth, v = self.depth(T), twist[..., :3]
        away = v @ self.normal
        push = self.stiffness * depth - self.damping * away
        if not self.bilateral:
            push = np.where(depth > 0.0, np.maximum(push, 0.0), 0.0)
        wrench[..., :3] = -push[..., None] * self.normal
        if self.friction:
            sliding = v - away[..., None] * self.normal
            speed = np.sqrt((sliding * sliding).sum(axis=-1) + self.slip**2)
            drag = self.friction * np.abs(push) / speed
            wrench[..., :3] += drag[..., None] * sliding
        return wrench

    def depth(self, T: ArrayLike) -> Array:
        """Depth of the tool point in the wall, m, negative on the free side, shape (...)."""
        return -(as_core(T, (4, 4), "T")[..., :3, 3] - self.point) @ self.normal
