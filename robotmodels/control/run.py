"""Simulation of a controlled robot: plant, law, sampling, noise, contact; and its result.

Parameters
----------
model, law : RobotModel and object
    The plant, which may differ from the model of the law; a law: ``command(t, q, v, x)`` (n,),
    ``state0`` (k,), ``rate(t, q, v, x)`` (k,).
q0, v0 : array_like, shape (n,)
    Positions and velocities at the start; default at rest.
t : array_like
    A duration in seconds, or ascending times (N,) of the samples of the result.
environment : callable or sequence of callables, optional
    Walls (`SpringWall`) or other functions of (t, T, twist) that return the wrench (6,) of the
    tool on the environment. Default: free space.
disturbance : callable or array_like (n,), optional
    Torques that act on the joints, a function of (t, q, v) or constant.
period, delay : float, optional
    Sampling period, which laws that switch need, default continuous; time from a sample to its
    torque, s.
noise, rng : float or array_like; int or Generator, optional
    Standard deviations of the measured values at samples: one number for positions and velocities,
    or two, or three with that of wrenches; seed.
**options
    ``method`` (``"Radau"`` for stiff walls), ``max_evaluations``, ``progress`` of `simulate`.

References
----------
Book sections 5.2.1, 5.2.2, 5.3.1 and 5.3.6.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_floats, as_number
from .._outcomes import Outcome, Result
from ..errors import InvalidValueError, ShapeError
from ..kinematics import dgm, jacobian
from ..kinematics.singular.task import generator_of
from ..model import RobotModel, check_model
from ..simulation import Integrator, Simulation, SimulationStatus, simulate
from .law import Law

_SAMPLES = 1000
_WINDOWS = 6  # parts of a run whose largest errors show whether it diverges
_GROWS = 2.0  # least ratio of the last of them to the first
_STEADY = 1.05  # least ratio of successive ones
_STAYS = 0.85  # least part of the ratio at first that remains at the end
_SMALL = 1e-6  # errors that may grow

Environment = Callable[[float, Array, Array], ArrayLike]
"""Wrench (6,) of the tool on the environment at time t, pose T (4, 4) and twist (6,)."""


class ControlStatus(Outcome):
    """Outcome of a run; fits int8. The motion until then is given for every status."""

    FOLLOWED = 0, "The law was followed to the end, within all limits: no proof of stability."
    SATURATED = 1, "Torques were limited to the efforts of the joints."
    LEFT_LIMITS = 2, "Joints left their limits."
    DIVERGED = 3, "The law was not followed to the end."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ControlledMotion(Result):
    """Motion of a controlled robot. Read-only.

    ``simulation`` is that of the plant, N samples; ``error`` (N, k) of the law: desired less actual
    joints, components of the task, or forces; ``wrench`` (N, 6) ``[f; m]`` of the tool on the
    environment, world axes; ``lyapunov`` (N,) the Lyapunov function of the law, None if it has
    none; ``status`` and ``notes`` the outcome, and sentences that explain it.
    """

    law: Any
    simulation: Simulation
    error: Array
    wrench: Array
    lyapunov: Array | None
    status: ControlStatus
    notes: tuple[str, ...] = ()

    t = property(attrgetter("simulation.t"), doc="Times, s, shape (N,).")
    q = property(attrgetter("simulation.q"), doc="Positions, rad or m, shape (N, n).")
    v = property(attrgetter("simulation.v"), doc="Velocities, shape (N, n).")
    tau = property(attrgetter("simulation.tau"), doc="Torques of the control, shape (N, n).")
    state = property(attrgetter("simulation.state"), doc="State of the law, shape (N, k).")

    @property
    def _values(self) -> tuple[Any, ...]:
        motion = self.simulation.model, self.t, self.q, self.v, self.tau, self.state
        return self.law, *motion, self.error, self.wrench, self.lyapunov, self.status, self.notes

    @property
    def surface(self) -> Array | None:
        """Values (N, n) of s of laws that have one: sliding modes, passivity, adaptive control."""
        if not hasattr(self.law, "slope"):
            return None
        return np.array([self.law.surface(*x) for x in zip(self.t, self.q, self.v, strict=True)])

    def rms(self, after: float = 0.0) -> Array:
        """Root mean square of the error from a time on, shape (k,)."""
        late = self.t >= as_number(after, "after")
        if not late.any():
            raise InvalidValueError(f"after: expected a time up to {self.t[-1]:.6g} s.")
        weights = np.convolve(np.diff(self.t[late]), [0.5, 0.5]) if late.sum() > 1 else np.ones(1)
        return np.sqrt(weights @ self.error[late] ** 2 / weights.sum())

    def reason(self, i: Any = ()) -> str:
        """The sentence of the status, and what explains it."""
        return " ".join([self.status.sentence, *self.notes])


def run(
    model: RobotModel,
    law: Any,
    q0: ArrayLike,
    v0: ArrayLike | None = None,
    t: ArrayLike = 1.0,
    environment: Environment | Sequence[Environment] | None = None,
    disturbance: Callable[..., ArrayLike] | ArrayLike | None = None,
    period: float | None = None,
    delay: float = 0.0,
    noise: ArrayLike | None = None,
    rng: int | np.random.Generator | None = None,
    **options: Any,
) -> ControlledMotion:
    """Simulate a robot under a control law.

    Dry friction of the drives sticks; torques are limited to the efforts of the table's joints. A
    continuous law is integrated with the plant, a sampled one is held between samples.

    Examples
    --------
    >>> from robotmodels.control import ComputedTorque, run
    >>> from robotmodels.robots import load
    >>> arm = load("rx90")
    >>> motion = run(arm, ComputedTorque(np.full(6, 0.1), model=arm), np.zeros(6), t=1.0)
    >>> motion.status, bool(motion.rms(after=0.9).max() < 1e-3)
    (<ControlStatus.FOLLOWED: 0>, True)
    """
    check_model(model)
    if not all(callable(getattr(law, name, None)) for name in ("command", "rate")):
        raise InvalidValueError(
            f"law: expected a control law with command, state0 and rate, got {law!r:.60}."
        )
    if (n := getattr(law, "n", model.n)) not in (None, model.n):
        raise ShapeError(f"law: expected a law for {model.n} joints, got one for {n}.")
    if period is not None:
        period = as_number(period, "period", above=0.0)
    elif getattr(law, "switches", False):
        raise InvalidValueError(
            "law: it switches, which takes time steps: give a sampling period, or a boundary layer."
        )
    times = as_floats(t, "t")
    if times.ndim == 0 and times > 0.0:
        ratio = float(times) / period if period else _SAMPLES
        times = np.linspace(0.0, float(times), max(1, round(min(ratio, _SAMPLES * _SAMPLES))) + 1)
    loop = Loop(model, law, environment, _deviations(noise, rng, period), generator_of(rng))
    if disturbance is not None and not callable(disturbance):
        disturbance = as_exact(disturbance, (model.n,), "disturbance")
    seconds = float(np.ptp(times)) if times.size else 0.0
    evaluations = min(2e4 * (1.0 + seconds) + 20 * seconds / (period or 1.0), 2**62)
    # between samples the torque is constant: order 5 is enough
    method = Integrator.DOP853 if period is None else Integrator.RK45
    options = {"method": method, "max_evaluations": int(evaluations)} | options
    options |= {"period": period, "delay": delay, "disturbance": disturbance}
    motion = simulate(model, q0, v0, loop, times, loop.wrench if loop.walls else None, **options)
    rows = list(zip(motion.t, motion.q, motion.v, strict=True))
    wrench = np.array([loop.wrench(*row) for row in rows])
    errors = np.array([loop.error(*row, f) for row, f in zip(rows, wrench, strict=True)])
    lyapunov = None
    if isinstance(law, Law):
        ways = (law.lyapunov(model, *row, x) for row, x in zip(rows, motion.state, strict=True))
        if values := [value for value in ways if value is not None]:
            lyapunov = np.array(values)
    status, notes = _outcome(model, motion, errors, loop)
    notes += law.notes(motion.t, motion.q, motion.v) if isinstance(law, Law) else ()
    return ControlledMotion(law, motion, errors, wrench, lyapunov, status, notes)


class Loop:
    """A law in a simulation: it gets measured values, and its torques are limited."""

    def __init__(
        self, model: RobotModel, law: Any, environment: Any, noise: Any, rng: np.random.Generator
    ) -> None:
        walls = () if environment is None else environment
        self.walls = tuple(walls) if isinstance(walls, (tuple, list)) else (walls,)
        if not all(map(callable, self.walls)):
            raise InvalidValueError(
                "environment: expected a wall or a function of (t, T, twist), or several of them."
            )
        self.model, self.law, self.feels = model, law, isinstance(law, Law)
        self.state0 = as_floats(getattr(law, "state0", ()), "law.state0")
        self.effort = np.where(np.isnan(model.table.effort), np.inf, model.table.effort)
        self.saturated = np.zeros(model.n, dtype=np.bool_)
        self._noise, self._rng = noise, rng
        self._last: Any = (None,)
        self._sample: Any = None, []

    def command(self, t: float, q: Array, v: Array, x: Array) -> Array:
        """Torques of the law within the efforts, shape (n,)."""
        answer = self.law.command(t, *self._measured(t, q, v, x))
        tau = as_exact(answer, self.effort.shape, "law.command(t, q, v, x)")
        self.saturated |= np.abs(tau) > self.effort
        return np.clip(tau, -self.effort, self.effort)

    def rate(self, t: float, q: Array, v: Array, x: Array) -> Array:
        """Rate of the state of the law, shape (k,)."""
        return self.law.rate(t, *self._measured(t, q, v, x)) if self.state0.size else self.state0

    def wrench(self, t: float, q: Array, v: Array) -> Array:
        """Wrench of the tool on all environments, shape (6,)."""
        if not self.walls:
            return np.zeros(6)
        key = t, q.tobytes(), v.tobytes()
        if self._last[0] != key:  # the law and the plant need the same
            T, twist = dgm(self.model, q), jacobian(self.model, q) @ v
            name = "environment(t, T, twist)"
            parts = [as_exact(wall(t, T, twist), (6,), name) for wall in self.walls]
            self._last = key, np.sum(parts, axis=0)
        return self._last[1]

    def error(self, t: float, q: Array, v: Array, wrench: Array) -> Array:
        """Error of the law, empty for a law without."""
        error = getattr(self.law, "error", lambda *_: np.zeros(0))
        return as_floats(error(t, q, v, *(wrench,) * self.feels), "law.error(t, q, v)")

    def _measured(self, t: float, q: Array, v: Array, x: Array) -> tuple[Array, ...]:
        f = self.wrench(t, q, v) if self.feels and self.walls else None
        if self._noise is not None:
            if self._sample[0] != t:  # one for the torque and the rate of the state
                sizes = zip(self._noise, (q.size, q.size, 6), strict=True)
                self._sample = t, [s * self._rng.normal(size=k) for s, k in sizes]
            dq, dv, df = self._sample[1]
            q, v, f = q + dq, v + dv, f if f is None else f + df
        return (q, v, x) if f is None else (q, v, x, f)


def _deviations(noise: Any, rng: Any, period: Any) -> tuple[float, ...] | None:
    """Standard deviations of positions, velocities and wrenches."""
    if noise is None:
        return None
    given = np.atleast_1d(as_floats(noise, "noise"))
    if given.shape not in ((1,), (2,), (3,)) or (given < 0.0).any():
        raise InvalidValueError(
            f"noise: expected one to three standard deviations, none negative, got {noise!r:.40}."
        )
    if rng is None or period is None:
        raise InvalidValueError("noise: give rng, a seed or a Generator, and a sampling period.")
    return tuple(given) if given.size == 3 else (given[0], given[-1], 0.0)


def _growing(errors: Array) -> Array:
    """Peaks of the error in the windows of a run if they grow exponentially, empty if not.

    Ratios of successive peaks stay then; those of a power of time decrease.
    """
    if len(errors) < 2 * _WINDOWS:
        return np.zeros(0)
    peaks = np.array([np.abs(x).max(initial=0.0) for x in np.array_split(errors, _WINDOWS)])
    first = max(peaks[0], np.abs(errors[0]).max(initial=0.0))
    ratios = peaks[2:] / np.maximum(peaks[1:-1], 1e-300)
    grows = (ratios > _STEADY).all() and ratios[-1] > _STAYS * ratios[0]
    return peaks if grows and peaks[-1] > max(_GROWS * first, _SMALL) else np.zeros(0)


def _outcome(
    model: RobotModel, motion: Simulation, errors: Array, loop: Loop
) -> tuple[ControlStatus, tuple[str, ...]]:
    """Status of a run, and sentences that explain it."""
    if motion.status is not SimulationStatus.FINISHED:
        late = motion.status is SimulationStatus.NOT_CONVERGED
        advice = ("Give method='Radau' for stiff walls, or a period.",) * late
        return ControlStatus.DIVERGED, (f"At t = {motion.t[-1]:.6g} s: {motion.reason()}", *advice)
    if (peaks := _growing(errors)).size:
        desired = getattr(loop.law, "_desired", None)  # an error may grow with the reference
        values = np.array([desired(float(t))[0] if desired else 0.0 for t in motion.t])
        if peaks[-1] > np.abs(values - values[0]).max():
            shown = ", ".join(f"{x:.3g}" for x in peaks)
            return ControlStatus.DIVERGED, (
                f"The error grows exponentially: its peaks in sixths of the run are {shown}.",
            )
    beyond = ((motion.q < model.lower) | (motion.q > model.upper)).any(axis=0)
    left, saturated = ControlStatus.LEFT_LIMITS, ControlStatus.SATURATED
    for status, at in ((left, beyond), (saturated, loop.saturated)):
        if at.any():
            joints = ", ".join(str(j + 1) for j in np.flatnonzero(at))
            return status, (f"This concerns joints {joints}.",)
    return ControlStatus.FOLLOWED, ()
