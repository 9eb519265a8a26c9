"""Laws of the joints with constant or adapted gains: PID, PD with gravity, passivity, adaptation.

Passivity-based laws have ``s = e' + slope e = q_r' - q'`` with the reference velocity
``q_r' = q_d' + slope e``.

Parameters
----------
reference, model
    See `robotmodels.control`; adaptive control ignores the inertia of the model.
kp, ki, kd : float or array_like
    Gains of the error, of its integral and of its rate; ki may be 0.
slope, gain : float or array_like
    Rate at which the error vanishes where s is 0, 1/s; torque by s, N m s/rad.
feedforward : RobotModel or array_like (n,), optional
    Constant torques, or a model whose torques of the reference motion are added.
adaptation, start : array_like, shape (p,)
    Gains of the estimates; estimates at the start, default zero.
parameters : {"base", "standard"}
    Estimated parameters. Standard ones drift along combinations that have no effect.
drive : bool or collection of DriveKind or str
    Drive parameters that are estimated, too, as in `torque_regressor`.
inertia, viscous, omega : float
    Of a joint, kg m^2 and N m s/rad (kg and N s/m); bandwidth, rad/s, above
    ``viscous / (3 inertia)``.
q, v, v_r, a_r : array_like, shape (..., n)
    Joint variables, rad or m, their velocities, reference velocities and accelerations.

Returns
-------
PIDGains or ndarray, shape (..., n, p)
    Of `slotine_li_regressor` with columns as `parameter_names`.

References
----------
Book sections 5.2.5 and 5.2.8; M. Takegaki and S. Arimoto, ASME J. Dyn. Syst. Meas. Control
103(2), 1981; B. Paden and R. Panja, Int. J. Control 47(6), 1988; J.-J. Slotine and W. Li, "On the
adaptive control of robot manipulators", Int. J. Robotics Research 6(3), 1987.

Examples
--------
>>> DecentralizedPID([0.5, 0.2], kp=100.0, ki=50.0, kd=20.0).command(0, [0, 0], [0, 0], [0, 0])
array([50., 20.])
>>> gains = pid_gains(inertia=2.0, viscous=1.0, omega=5.0)
>>> gains.kp, gains.kd, gains.ki, gains.margin
(150.0, 29.0, 250.0, 9.0)
>>> from robotmodels.robots import load
>>> AdaptiveSlotineLi([0, 0], 5.0, 10.0, 1.0, model=load("planar_2r"), drive=False).names
('ZZ1', 'ZZ2', 'MX2', 'MY2')
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Value, as_exact, as_number, as_vector, batch_rows
from .._choices import one_of
from ..drive import Drives
from ..dynamics import gravity_torque, idm, mass_matrix
from ..errors import InvalidValueError
from ..minimal_parameters import BaseParameters, base_parameters
from ..model import RobotModel, check_model
from ..regressors import parameter_names, parameter_vector
from ..regressors.columns import LINKS, ChosenColumns, chosen_columns, standard_blocks
from ..regressors.drives import add_torques, friction_terms, rotor_terms
from .law import Desired, Law, started, virtual_torques

_REMAINS = 0.2
"""Part of an error of a parameter that remains where the motion excites it too little."""


@dataclass(frozen=True, slots=True)
class PIDGains(Value):
    """Gains of a PID controller of one joint ``inertia q'' + viscous q' = tau``."""

    kp: float
    ki: float
    kd: float
    inertia: float
    viscous: float = 0.0

    @property
    def poles(self) -> NDArray[Any]:
        """Poles of the controlled joint, 1/s, shape (3,): unstable with a positive real part."""
        return np.roots([self.inertia, self.kd + self.viscous, self.kp, self.ki])

    @property
    def critical_ki(self) -> float:
        """Integral gain at the limit of stability (Routh): ``(kd + viscous) kp / inertia``."""
        inertia = as_number(self.inertia, "inertia", above=0.0)
        return (self.kd + self.viscous) * self.kp / inertia

    @property
    def margin(self) -> float:
        """Routh margin ``critical_ki / ki``: stable above 1."""
        return self.critical_ki / self.ki if self.ki else np.inf


def pid_gains(inertia: float, viscous: float, omega: float) -> PIDGains:
    """Gains of a PID controller that give a joint a triple pole at -omega.

    ``kp = 3 inertia omega^2``, ``kd = 3 inertia omega - viscous``, ``ki = inertia omega^3``.
    """
    a, w = as_number(inertia, "inertia", above=0.0), as_number(omega, "omega", above=0.0)
    f = as_number(viscous, "viscous", least=0.0)
    if (kd := 3.0 * a * w - f) <= 0.0:
        raise InvalidValueError(
            f"omega: expected more than the bandwidth of friction alone, {f / (3.0 * a):.6g} rad/s."
        )
    return PIDGains(3.0 * a * w * w, a * w**3, kd, a, f)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class JointLaw(Law):
    """Base of the laws of the joints: number of joints, reference and error."""

    n: int = field(init=False)
    _desired: Desired = field(init=False)

    def _prepare(self: Any, gains: tuple[str, ...], model: Any, zero: str = "") -> None:
        """Check the model, the reference and the gains."""
        if model is not None:
            check_model(model)
        self._set(n=self._keep_reference(n=model and model.n))
        self._keep_gains(gains, self.n, zero)

    def _error(self: Any, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        return self._desired(t)[0] - q


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SurfaceLaw(JointLaw):
    """Parts of laws of ``s = e' + slope e``."""

    def surface(self, t: float, q: Any, v: Any) -> Array:
        """``s = e' + slope e``, shape (n,)."""
        t, q, v, *_ = self._measured(t, q, v, self.state0, None)
        return self._rates(t, q, v)[0] - v

    def lyapunov(self, plant: RobotModel, t: float, q: Array, v: Array, x: Array) -> float:
        """``s^T A s / 2``."""
        s = self.surface(t, q, v)
        return 0.5 * float(s @ mass_matrix(plant, q) @ s)

    def _rates(self: Any, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Velocity ``q_d' + slope e`` and acceleration that reduce the error."""
        q_d, v_d, a_d = self._desired(t)
        return v_d + self.slope * (q_d - q), a_d + self.slope * (v_d - v)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class DecentralizedPID(JointLaw):
    """PID control of each joint alone: ``kp e + kd e' + ki (integral of e) + feedforward``."""

    reference: Any
    kp: Any
    ki: Any
    kd: Any
    feedforward: Any = None
    state0: Array = field(init=False)

    def __post_init__(self) -> None:
        given, is_model = self.feedforward, isinstance(self.feedforward, RobotModel)
        self._prepare(("kp", "ki", "kd"), given if is_model else None, zero="ki")
        given = given if is_model or given is None else as_exact(given, (self.n,), "feedforward")
        self._set(state0=np.zeros(self.n), feedforward=given)

    def _torques(self, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        q_d, v_d, a_d = self._desired(t)
        tau = self.kp * (q_d - q) + self.kd * (v_d - v) + self.ki * x
        if isinstance(self.feedforward, RobotModel):
            return tau + idm(self.feedforward, q_d, v_d, a_d)
        return tau if self.feedforward is None else tau + self.feedforward

    def _rate(self, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        return self._desired(t)[0] - q


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PDGravity(JointLaw):
    """PD control with gravity compensation (Takegaki and Arimoto), PD+ for motions (Paden, Panja).

    ``tau = A(q) q_d'' + C(q, q') q_d' + Q(q) + kp e + kd e'``. Friction of the drives is not
    compensated. Without a model nothing is, and there is no Lyapunov function.
    """

    reference: Any
    kp: Any
    kd: Any
    model: RobotModel | None = None

    def __post_init__(self) -> None:
        self._prepare(("kp", "kd"), self.model)

    def _torques(self, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        q_d, v_d, a_d = self._desired(t)
        tau = self.kp * (q_d - q) + self.kd * (v_d - v)
        if (model := self.model) is None:
            return tau
        if not (v_d.any() or a_d.any()):
            return tau + gravity_torque(model, q) + model.drive.offset
        tau = tau + virtual_torques(model, q, v, v_d, a_d) + model.drive.offset
        return tau if model.drive_matrices is None else tau + model.drive_matrices.rotor @ a_d

    def lyapunov(self, plant: RobotModel, t: float, q: Array, v: Array, x: Array) -> float | None:
        """``(e'^T A e' + e^T kp e) / 2``, with the rate ``-e'^T kd e'`` without friction."""
        q_d, v_d, _ = self._desired(t)
        e, de = q_d - q, v_d - v
        V = 0.5 * float(de @ mass_matrix(plant, q) @ de + e @ (self.kp * e))
        return None if self.model is None else V


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Passivity(SurfaceLaw):
    """Passivity-based control: ``tau = A(q) q_r'' + C(q, q') q_r' + Q(q) + friction + gain s``."""

    reference: Any
    slope: Any
    gain: Any
    model: RobotModel = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        check_model(self.model)
        self._prepare(("slope", "gain"), self.model)

    def _torques(self, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        v_r, a_r = self._rates(t, q, v)
        tau = virtual_torques(self.model, q, v, v_r, a_r) + self.gain * (v_r - v)
        drives = self.model.drive_matrices
        return tau if drives is None else tau + drives.torque(started(v, v_r), a_r)


def slotine_li_regressor(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    v_r: ArrayLike,
    a_r: ArrayLike,
    drive: Drives = True,
) -> Array:
    """Regressor of ``A a_r + C(q, v) v_r + Q``, with the friction of the drives at v."""
    check_model(model)
    given = {"q": q, "v": v, "v_r": v_r, "a_r": a_r}
    vectors = tuple(as_vector(x, model.n, name) for name, x in given.items())
    batch, rows = batch_rows(vectors, tuple(given))
    chosen = chosen_columns(standard_blocks(model, drive, None), None, model)
    return _regressors(model, chosen, *rows).reshape(*batch, model.n, chosen.count)


def _regressors(
    model: RobotModel, chosen: ChosenColumns, q: Array, v: Array, v_r: Array, a_r: Array
) -> Array:
    """The regressor of rows (N, n), shape (N, n, c): a difference of squares of half sums."""
    from ..kernels.regressors import torque_regressors

    W, squares = np.empty((2, len(q), model.n, chosen.count))
    links, zero = chosen.places[LINKS], np.zeros(3)
    torque_regressors(q, 0.5 * (v + v_r), a_r, model.chain, model.gravity, links, W)
    torque_regressors(q, 0.5 * (v - v_r), 0.0 * a_r, model.chain, zero, links, squares)
    W -= squares
    if len(chosen.places) > 1:
        add_torques(chosen, rotor_terms(model, a_r), W)
        add_torques(chosen, friction_terms(model, q, v, None), W)
    return W


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class AdaptiveSlotineLi(SurfaceLaw):
    """Adaptive control of Slotine and Li: ``tau = Y theta + gain s``, the state is theta.

    With the regressor Y of `slotine_li_regressor`, ``theta' = adaptation Y^T s``. Errors of
    tracking vanish whatever theta; theta itself converges where the motion excites it.
    """

    reference: Any
    slope: Any
    gain: Any
    adaptation: Any
    parameters: str = "base"
    start: Any = None
    model: RobotModel = None  # type: ignore[assignment]
    drive: Drives = True
    names: tuple[str, ...] = field(init=False)
    state0: Array = field(init=False)
    base: BaseParameters | None = field(init=False)
    _chosen: ChosenColumns = field(init=False)

    def __post_init__(self) -> None:
        check_model(self.model)
        self._prepare(("slope", "gain"), self.model)
        one_of(self.parameters, ("base", "standard"), "parameters")
        base = base_parameters(self.model, drive=self.drive) if self.parameters == "base" else None
        names = tuple(base.names if base else parameter_names(self.model, self.drive))
        blocks, p = standard_blocks(self.model, self.drive, None), len(names)
        start = np.zeros(p) if self.start is None else as_exact(self.start, (p,), "start")
        self._keep_gains(("adaptation",), p)
        self._set(start=start, state0=start)
        self._set(base=base, names=names, _chosen=chosen_columns(blocks, names, self.model))

    def true_values(self, plant: RobotModel) -> Array:
        """Parameters (p,) of a robot of the same structure, to which the estimates converge."""
        return self.base.values(plant) if self.base else parameter_vector(plant, self.drive)

    def regressor(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Y, shape (n, p), and s, shape (n,)."""
        q, v = as_exact(q, (self.n,), "q"), as_exact(v, (self.n,), "v")
        v_r, a_r = self._rates(t, q, v)
        rows = (x.reshape(1, -1) for x in (q, started(v, v_r), v_r, a_r))
        return _regressors(self.model, self._chosen, *rows)[0], v_r - v

    def _torques(self, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        Y, s = self.regressor(t, q, v)
        return Y @ x + self.gain * s

    def _rate(self, t: float, q: Array, v: Array, x: Array, f: Array) -> Array:
        Y, s = self.regressor(t, q, v)
        return self.adaptation * (s @ Y)

    def lyapunov(self, plant: RobotModel, t: float, q: Array, v: Array, x: Array) -> float:
        """``(s^T A s + sum of squared errors of the estimates / adaptation) / 2``."""
        missing = self.true_values(plant) - x
        kinetic = SurfaceLaw.lyapunov(self, plant, t, q, v, x)
        return kinetic + 0.5 * float(missing @ (missing / self.adaptation))

    def notes(self, t: Array, q: Array, v: Array) -> tuple[str, ...]:
        """A sentence that names the parameters that a motion (N, n) excites too little."""
        if len(t) < 2:
            return ()
        # errors of estimates decrease as theta' = -adaptation Y^T Y / gain theta, on average
        root = np.sqrt(np.broadcast_to(self.adaptation, (len(self.names),)))
        Y = np.array([self.regressor(*row)[0] for row in zip(t, q, v, strict=True)])
        Y = Y * root / np.sqrt(np.broadcast_to(self.gain, (self.n,)))[:, None]
        # persistent excitation: the second half, as if all of the run were like it
        weights = 2.0 * np.convolve(np.diff(t), [0.5, 0.5]) * (t > 0.5 * (t[0] + t[-1]))
        size, axes = np.linalg.eigh(np.einsum("k,kij,kil->jl", weights, Y, Y))
        remains = (axes * axes) @ np.exp(-np.maximum(size, 0.0))
        few = [name for name, part in zip(self.names, remains, strict=True) if part > _REMAINS]
        words = "The motion excites these parameters too little to estimate"
        return (f"{words}: {', '.join(few)}.",) if few else ()
