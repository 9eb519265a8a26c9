"""Simulation of a controlled robot: plant, law, sampling, noise, disturbances and contact."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_floats, as_number, as_vector
from ..errors import InvalidValueError, ShapeError
from ..kinematics import dgm, jacobian
from ..kinematics.singular.task import generator_of
from ..model import RobotModel, check_model
from ..simulation import Integrator, Simulation, SimulationStatus, simulate
from .law import Law
from .result import ControlledMotion, ControlStatus

_SAMPLES = 1000
_WINDOWS = 6  # parts of a run whose largest errors tell whether it diverges
_GROWS = 2.0  # least ratio of the last of them to the first
_STEADY = 1.05  # least ratio of successive ones
_STAYS = 0.85  # least part of the ratio at first that remains at the end
_SMALL = 1e-6  # errors that may grow

Environment = Callable[[float, Array, Array], ArrayLike]
"""Wrench (6,) of the tool on the environment at time t, pose T (4, 4) and twist (6,)."""


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

    Parameters
    ----------
    model : RobotModel
        The plant, n joints; the model that the law believes may differ.
    law : object
        A control law: ``command(t, q, v, x)`` (n,), ``state0`` (k,), ``rate(t, q, v, x)`` (k,).
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
        Sampling period of the law, default continuous; time from a sample to its torque, s.
    noise : float or array_like, optional
        Standard deviation of what is measured at samples: one number for positions and velocities,
        or two, or three with that of wrenches.
    rng : int or Generator, optional
        Seed of the noise.
    **options
        ``method`` (``"Radau"`` for stiff walls), ``max_evaluations``, ``progress`` of `simulate`.

    Returns
    -------
    ControlledMotion
        Motion, errors, torques, wrenches and the status.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments of the wrong shape; a law for another number of joints, or one that switches, in
        continuous time; a delay as long as the run; noise without rng or period.

    References
    ----------
    Seed book sections 5.2.1, 5.2.2, 5.3.1 and 5.3.6.

    Examples
    --------
    >>> from robotmodels.control import ComputedTorque, run
    >>> from robotmodels.robots import load
    >>> arm = load("rx90")
    >>> law = ComputedTorque(np.full(6, 0.1), omega=20.0, model=arm)
    >>> run(arm, law, np.zeros(6), t=0.5, period=1e-3).status
    <ControlStatus.FOLLOWED: 0>
    """
    check_model(model)
    if not (callable(getattr(law, "command", None)) and callable(getattr(law, "rate", None))):
        raise InvalidValueError(
            f"law: expected a control law with command, state0 and rate, got {law!r:.60}."
        )
    if (n := getattr(law, "n", model.n)) not in (None, model.n):
        raise ShapeError(f"law: expected a law for {model.n} joints, got one for {n}.")
    if period is None and getattr(law, "switches", False):
        raise InvalidValueError(
            "law: its torque or its state switches, which stalls a continuous simulation; give a "
            "sampling period, or a boundary layer (layer=)."
        )
    if period is not None:
        period = as_number(period, "period", above=0.0)
    for name, instead in (("wrench", "environment="), ("control", "law=")):
        if name in options:
            raise InvalidValueError(f"{name}: give {instead} of run.")
    times = as_floats(t, "t")
    if times.ndim == 0 and times > 0.0:
        ratio = float(times) / period if period else _SAMPLES
        times = np.linspace(0.0, float(times), max(1, round(min(ratio, _SAMPLES * _SAMPLES))) + 1)
    loop = Loop(model, law, environment, noise, rng, period)
    if disturbance is not None and not callable(disturbance):
        disturbance = as_exact(disturbance, (model.n,), "disturbance")
    # between samples the torque is constant: order 5 is enough
    options.setdefault("method", Integrator.DOP853 if period is None else Integrator.RK45)
    seconds = float(np.ptp(times)) if times.size else 0.0
    options.setdefault(
        "max_evaluations",
        int(min(2e4 * (1.0 + seconds) + 20 * seconds / (period or 1.0), 2**62)),
    )
    wall = loop.wrench if loop.walls else None
    motion = simulate(
        *(model, q0, v0, loop, times, wall),
        **{"period": period, "delay": delay, "disturbance": disturbance, **options},
    )
    rows = list(zip(motion.t, motion.q, motion.v, strict=True))
    wrench = np.array([loop.wrench(*row) for row in rows])
    errors = np.array([loop.error(*row, f) for row, f in zip(rows, wrench, strict=True)])
    lyapunov = None
    if isinstance(law, Law):
        ways = (law.lyapunov(model, *row, x) for row, x in zip(rows, motion.state, strict=True))
        if values := [value for value in ways if value is not None]:
            lyapunov = np.array(values)
    status, notes = _outcome(model, motion, errors, loop)
    if (more := getattr(law, "notes", None)) is not None:
        notes += more(motion.t, motion.q, motion.v)
    return ControlledMotion(law, motion, errors, wrench, lyapunov, status, notes)


class Loop:
    """A law in a simulation: it gets measured values, and its torques are limited."""

    def __init__(
        self, model: RobotModel, law: Any, environment: Any, noise: Any, rng: Any, period: Any
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
        self._deviations = _deviations(noise, rng, period)
        self._rng = generator_of(rng)
        self._last: Any = (None,)
        self._sample: Any = None, []

    def command(self, t: float, q: Array, v: Array, x: Array) -> Array:
        """Torques of the law within the efforts, shape (n,)."""
        answer = self.law.command(t, *self._measured(t, q, v, x))
        tau = as_exact(answer, self.effort.shape, "law.command(t, q, v, x)")
        over = np.abs(tau) > self.effort
        if over.any():
            self.saturated |= over
            tau = np.clip(tau, -self.effort, self.effort)
        return tau

    def rate(self, t: float, q: Array, v: Array, x: Array) -> Array:
        """Rate of the state of the law, shape (k,)."""
        return self.law.rate(t, *self._measured(t, q, v, x)) if self.state0.size else self.state0

    def wrench(self, t: float, q: Array, v: Array) -> Array:
        """Wrench of the tool on all environments, shape (6,)."""
        if not self.walls:
            return np.zeros(6)
        key = t, q.tobytes(), v.tobytes()
        if self._last[0] != key:  # the law and the plant ask for the same
            T, twist = dgm(self.model, q), jacobian(self.model, q) @ v
            name = "environment(t, T, twist)"
            parts = [as_exact(wall(t, T, twist), (6,), name) for wall in self.walls]
            self._last = key, np.sum(parts, axis=0)
        return self._last[1]

    def error(self, t: float, q: Array, v: Array, wrench: Array) -> Array:
        """Error of the law, empty for a law without."""
        if not hasattr(self.law, "error"):
            return np.zeros(0)
        e = self.law.error(t, q, v, wrench) if self.feels else self.law.error(t, q, v)
        return as_vector(e, np.size(e), "law.error(t, q, v)")

    def _measured(self, t: float, q: Array, v: Array, x: Array) -> tuple[Array, ...]:
        f = self.wrench(t, q, v) if self.feels and self.walls else None
        if self._deviations is not None:
            if self._sample[0] != t:  # one for the torque and the rate of the state
                sizes = zip(self._deviations, (q.size, q.size, 6), strict=True)
                self._sample = t, [s * self._rng.normal(size=k) for s, k in sizes]
            dq, dv, df = self._sample[1]
            q, v, f = q + dq, v + dv, f if f is None else f + df
        return (q, v, x) if f is None else (q, v, x, f)


def _deviations(noise: Any, rng: Any, period: Any) -> tuple[float, ...] | None:
    """Standard deviations of positions, velocities and wrenches."""
    if noise is None:
        return None
    given = np.atleast_1d(as_floats(noise, "noise"))
    if given.ndim != 1 or not 1 <= given.size <= 3 or (given < 0.0).any():
        raise InvalidValueError(
            "noise: expected one standard deviation of positions and velocities, two, or three "
            f"with that of wrenches, none negative, got {noise!r:.60}."
        )
    for value, name in ((rng, "rng, a seed or a Generator"), (period, "period: it is of samples")):
        if value is None:
            raise InvalidValueError(f"noise: give {name}.")
    return tuple(given) if given.size == 3 else (given[0], given[-1], 0.0)


def _growing(errors: Array) -> Array:
    """Peaks of the error in the windows of a run if they grow exponentially, empty if not.

    Ratios of successive peaks stay then; those of a power of time fall.
    """
    if len(errors) < 2 * _WINDOWS:
        return np.zeros(0)
    peaks = np.array([np.abs(x).max(initial=0.0) for x in np.array_split(errors, _WINDOWS)])
    if peaks[-1] <= max(_GROWS * peaks[0], _GROWS * np.abs(errors[0]).max(initial=0.0), _SMALL):
        return np.zeros(0)
    ratios = peaks[2:] / np.maximum(peaks[1:-1], 1e-300)
    grows = (ratios > _STEADY).all() and ratios[-1] > _STAYS * ratios[0]
    return peaks if grows else np.zeros(0)


def _moved(law: Any, t: Array) -> float:
    """How far the reference of a law moves from its start."""
    if (desired := getattr(law, "_desired", None)) is None:
        return 0.0
    values = np.array([desired(float(x))[0] for x in t])
    return float(np.abs(values - values[0]).max(initial=0.0))


def _outcome(
    model: RobotModel, motion: Simulation, errors: Array, loop: Loop
) -> tuple[ControlStatus, tuple[str, ...]]:
    """Status of a run, and sentences that explain it."""
    if motion.status is not SimulationStatus.FINISHED:
        late = motion.status is SimulationStatus.NOT_CONVERGED
        advice = ("Give method='Radau' for stiff walls, or a period.",) * late
        return ControlStatus.DIVERGED, (f"At t = {motion.t[-1]:.6g} s: {motion.reason}", *advice)
    if (peaks := _growing(errors)).size and peaks[-1] > _moved(loop.law, motion.t):
        shown = ", ".join(f"{x:.3g}" for x in peaks)
        return ControlStatus.DIVERGED, (
            f"The error grows exponentially: its peaks in sixths of the run are {shown}.",
        )
    beyond = (motion.q < model.lower) | (motion.q > model.upper)
    for status, at in (
        (ControlStatus.LEFT_LIMITS, beyond.any(axis=0)), (ControlStatus.SATURATED, loop.saturated)
    ):  # fmt: skip
        if at.any():
            joints = ", ".join(str(j + 1) for j in np.flatnonzero(at))
            return status, (f"This concerns joints {joints}.",)
    return ControlStatus.FOLLOWED, ()
