"""Simulation of flexible arms and of free elastic bodies, with their energies and momenta."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Frozen, Value, as_exact, as_floats, as_number
from .._choices import chosen
from .._outcomes import Outcome
from ..errors import ShapeError, SingularMassMatrixError
from ..simulation import Integrator
from .linear import scales
from .models import DIRECT, SpinStatus, ddm, jacobian, solved, states
from .robot import FlexibleRobot, check_arm, damping_matrix

_LAW = Callable[..., ArrayLike]
_LARGEST = 10.0  # deflection, in lengths or rad, at which a motion is given up
_PER_SECOND = 60_000  # default budget of evaluations


class FlexibleMotionStatus(Outcome):
    """Outcome of a simulation; fits int8. The motion until then is given for every status."""

    FINISHED = 0, "The motion was followed to its end."
    NOT_CONVERGED = 1, "The allowed evaluations of the model were used up before the end."
    DIVERGED = 2, "The motion grew without bound."
    SOFTENED = 3, SpinStatus.SOFTENED.sentence


@dataclass(frozen=True, slots=True, eq=False)
class FlexibleMotion(Frozen, Value):
    """Simulated motion of a flexible arm.

    Parameters
    ----------
    arm : FlexibleRobot
        The robot, n joints and m elastic coordinates.
    t : ndarray, shape (N,)
        Times, s; they end early if the simulation did.
    q, v, tau : ndarray, shape (N, n)
        Angles, velocities and torques of the motors.
    e, e_v : ndarray, shape (N, m)
        Elastic coordinates and their velocities.
    kinetic, potential, work : ndarray, shape (N,)
        Energies; work since the start of the torques, less friction, damping and the tool's, J.
    momentum, impulse : ndarray, shape (N, 6)
        Linear and angular momentum about the origin of the world, and the impulse since the start
        of the base, of gravity and of the environment; without rotors.
    status : FlexibleMotionStatus
        Why it ended; SOFTENED if a link ever spun too fast for its linear modes.
    evaluations : int
        Of the direct model.
    """

    arm: FlexibleRobot
    t: Array
    q: Array
    v: Array
    tau: Array
    e: Array
    e_v: Array
    kinetic: Array
    potential: Array
    work: Array
    momentum: Array
    impulse: Array
    status: FlexibleMotionStatus
    evaluations: int

    @property
    def energy(self) -> Array:
        """Kinetic plus potential energy, J, shape (N,)."""
        return self.kinetic + self.potential

    @property
    def energy_drift(self) -> float:
        """Largest error of the energy balance, relative to the energy turned over."""
        parts = self.kinetic, self.potential - self.potential[0], self.work
        turnover = max(float(np.abs(part).max()) for part in parts)
        return float(np.abs(self.energy - self.energy[0] - self.work).max()) / max(turnover, 1e-12)

    @property
    def momentum_drift(self) -> float:
        """Largest error of the momentum balance, relative to the largest momentum and impulse."""
        return relative(
            self.momentum - self.momentum[0] - self.impulse, self.momentum, self.impulse
        )

    def reason(self) -> str:
        """The sentence of the status."""
        return self.status.sentence

    def __repr__(self) -> str:
        return (
            f"<FlexibleMotion: {self.t[-1] - self.t[0]:.6g} s, {len(self.t)} samples, energy drift "
            f"{self.energy_drift:.1g}>"
        )


def simulate(
    arm: FlexibleRobot,
    q0: ArrayLike,
    v0: ArrayLike | None = None,
    control: _LAW | ArrayLike | None = None,
    t: ArrayLike = 1.0,
    wrench: _LAW | ArrayLike | None = None,
    *,
    e0: ArrayLike | None = None,
    e_v0: ArrayLike | None = None,
    method: Integrator | str = Integrator.DOP853,
    rtol: float = 1e-9,
    atol: float = 1e-11,
    max_evaluations: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> FlexibleMotion:
    """Simulate a flexible arm under torques.

    Energy and momenta are integrated along: their drift measures the error of the integration.
    Dry friction is taken with the sign of the velocity, without sticking.

    Parameters
    ----------
    arm : FlexibleRobot
        The robot, n joints and m elastic coordinates.
    q0, v0 : array_like, shape (n,)
        Angles and velocities of the motors at the start; default at rest.
    control : callable or array_like of shape (n,), optional
        Torques: a function of t, of (t, q, v) or of (t, q, v, e, e_v), or constant; default none.
    t : array_like
        A duration, with samples at the steps of the integrator, or ascending times (N,).
    wrench : callable or array_like of shape (6,), optional
        Of the tool on the environment, in world axes, given as ``control``.
    e0, e_v0 : array_like, shape (m,), optional
        Elastic coordinates and velocities at the start; default zero.
    method : Integrator or str
        As for `robotmodels.simulate`; ``"Radau"`` for stiff links.
    rtol, atol : float
        Tolerances of a step.
    max_evaluations : int, optional
        Default 60 000 for each second and as many more.
    progress : callable, optional
        A function of the fraction done.

    Returns
    -------
    FlexibleMotion
        The motion, its energies and momenta, and the status.

    Raises
    ------
    ShapeError, InvalidValueError, SingularMassMatrixError
        Arguments or answers of ``control`` and ``wrench`` of the wrong shape, with NaN or infinity.

    Examples
    --------
    >>> from robotmodels import RobotModel, DHTable, flexible
    >>> model = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> arm = flexible.FlexibleRobot(model, {1: flexible.beam(1.0, EI=(np.inf, 1.0), hub=0.1)})
    >>> motion = simulate(arm, [0.0], control=[0.1], t=0.5)
    >>> motion.status, motion.energy_drift < 1e-8
    (<FlexibleMotionStatus.FINISHED: 0>, True)
    """
    n, m, model = check_arm(arm).n, arm.m, arm.model
    start = [as_exact(np.zeros(k) if x is None else x, (k,), name) for name, x, k in (
        ("q0", q0, n), ("e0", e0, m), ("v0", v0, n), ("e_v0", e_v0, m))]  # fmt: skip
    law, push = _law(control, n, "control"), _law(wrench, 6, "wrench")
    ddm(
        arm, start[0], start[1], start[2], start[3], np.zeros(n)
    )  # its errors name what is singular
    drives, D = model.drive_matrices, damping_matrix(arm)[n:, n:]
    total = float(arm.arrays.pi[:, 9].sum())
    cuts = np.cumsum([n, m, n, m])
    Z = model.base

    def at(time: float, y: Array) -> tuple[list[Array], Array, Array]:
        parts = np.split(y, cuts)[:4]
        return parts, law(time, *parts), push(time, *parts)

    softened = [False]

    def rate(time: float, y: Array) -> Array:
        (q, e, v, ev), tau, w = at(time, y)
        rows = [x.reshape(1, -1) for x in (q, e, v, ev, tau, w)]
        a, ea, base = solved(arm, DIRECT, *rows)
        softened[0] = softened[0] or base[0, 9] > 0.0
        power = tau @ v - ev @ D @ ev - (0.0 if drives is None else drives.torque(v, None) @ v)
        force = Z[:3, :3] @ base[0, :3]
        moment = Z[:3, :3] @ base[0, 3:6] + cross(Z[:3, 3], force)
        force, moment = (
            force + total * model.gravity,
            moment + cross(base[0, 6:9], model.gravity),
        )
        if w.any():
            power -= w @ jacobian(arm, q, e) @ np.concatenate([v, ev])
            place = _tool(arm, q, e)
            force, moment = force - w[:3], moment - w[3:] - cross(place, w[:3])
        return np.concatenate([v, ev, a[0], ea[0], [power], force, moment])

    y0 = np.concatenate([*(start[k] for k in (0, 1, 2, 3)), np.zeros(7)])
    options = (chosen(Integrator, method, "method"), rtol, atol, max_evaluations, progress)
    largest = _LARGEST * scales(arm)[n:]
    times, Y, status, count = followed(
        rate, y0, t, *options, lambda y: bool((np.abs(y[n : n + m]) > largest).any())
    )
    q, e, v, ev, rest = np.split(Y, cuts, axis=1)
    tau = np.array([law(time, *np.split(y, cuts)[:4]) for time, y in zip(times, Y, strict=True)])
    kinetic, potential, momentum = states(arm, *(np.ascontiguousarray(x) for x in (q, e, v, ev)))
    if status != FlexibleMotionStatus.NOT_CONVERGED and softened[0]:
        status = FlexibleMotionStatus.SOFTENED
    return FlexibleMotion(
        arm, times, q, v, tau, e, ev, kinetic, potential, rest[:, 0], momentum, rest[:, 1:], status,
        count,
    )  # fmt: skip


def _tool(arm: FlexibleRobot, q: Array, e: Array) -> Array:
    from .models import dgm

    return dgm(arm, q, e)[:3, 3]


def _law(law: Any, size: int, name: str) -> Callable[..., Array]:
    """Function (t, q, e, v, e_v) -> (size,) of a user's function or of constant values."""
    if not callable(law):
        values = as_exact(np.zeros(size) if law is None else law, (size,), name)
        return lambda t, q, e, v, ev: values
    try:
        count = len(signature(law).parameters)
    except (TypeError, ValueError):
        count = 3

    def value(t: float, q: Array, e: Array, v: Array, ev: Array) -> Array:
        given = (q, v, e, ev) if count >= 5 else (q, v) if count > 1 else ()
        answer: Any = law(t, *(x.copy() for x in given))
        return as_exact(answer, (size,), f"{name} at t = {t:.9g} s")

    return value


def followed(
    rate: Callable[[float, Array], Array],
    y: Array,
    t: ArrayLike,
    method: Integrator,
    rtol: float,
    atol: float,
    budget: int | None,
    progress: Callable[[float], None] | None,
    beyond: Callable[[Array], bool] = lambda y: False,
) -> tuple[Array, Array, FlexibleMotionStatus, int]:
    """Times, states, status and evaluations of an initial value problem."""
    import scipy.integrate

    times = as_floats(t, "t")
    if times.ndim == 0 and times > 0.0:
        start, end, wanted = 0.0, float(times), None
    elif times.ndim == 1 and times.size > 1 and (np.diff(times) > 0.0).all():
        start, end, wanted = float(times[0]), float(times[-1]), times
    else:
        raise ShapeError(f"t: expected a duration above 0 or ascending times, got {t!r:.60}.")
    rtol, atol = as_number(rtol, "rtol", above=0.0), as_number(atol, "atol", above=0.0)
    most = int(_PER_SECOND * (1.0 + end - start)) if budget is None else budget
    kind: Any = getattr(scipy.integrate, method.value)

    def finite(t: float, y: Array) -> Array:
        dy = rate(t, y)
        if not np.isfinite(dy).all():  # SciPy's integrators would reduce their step for ever
            raise SingularMassMatrixError(f"The accelerations at t = {t:.6g} s are not finite.")
        return dy

    status, found = FlexibleMotionStatus.FINISHED, [(start, y)]
    with np.errstate(over="ignore", invalid="ignore"):
        solver = kind(finite, start, y, end, rtol=max(rtol, 3e-14), atol=atol)
        while solver.status == "running":
            if solver.nfev >= most:
                status = FlexibleMotionStatus.NOT_CONVERGED
                break
            try:
                solver.step()
            except SingularMassMatrixError:  # accelerations that are not finite
                solver.status = "failed"
            if solver.status == "failed" or beyond(solver.y):
                status = FlexibleMotionStatus.DIVERGED
                break
            if wanted is None:
                found.append((float(solver.t), solver.y.copy()))
            else:
                inside = wanted[(wanted > found[-1][0]) & (wanted <= solver.t)]
                if inside.size:
                    dense = solver.dense_output()
                    found += [(float(x), dense(x)) for x in inside]
            if progress is not None:
                progress((float(solver.t) - start) / (end - start))
    return (
        np.array([x for x, _ in found]),
        np.array([x for _, x in found]),
        status,
        int(solver.nfev),
    )


def relative(error: Array, *sizes: Array) -> float:
    """Largest error of linear and of angular momenta (N, 6), relative to their sizes."""
    found = 0.0
    for part in (slice(0, 3), slice(3, 6)):
        size = max(float(np.linalg.norm(x[:, part], axis=1).max()) for x in sizes)
        found = max(found, float(np.abs(error[:, part]).max()) / max(size, 1e-9))
    return found


def cross(a: Any, b: Any) -> list[float]:
    """Vector product of short sequences, quicker than NumPy's."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
