"""Simulation of a robot: the direct dynamic model integrated over time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_each, as_exact, as_floats, as_number
from .._arrays.tasks import Progress
from .._choices import chosen
from ..drive import check_all_or_none
from ..dynamics import ddm, kinetic_energy, potential_energy
from ..errors import InvalidValueError, ShapeError
from ..friction import Friction, check_friction
from ..model import RobotModel, check_model
from .dry_friction import check_dissipates
from .feedback import Feedback, Sampled, StatefulControl, checked, stateful
from .integration import Integration
from .motion import Motion
from .result import Integrator, Simulation

_FINEST = 100 * float(np.finfo(np.float64).eps)


def simulate(
    model: RobotModel,
    q0: ArrayLike,
    v0: ArrayLike | None = None,
    control: Callable[..., ArrayLike] | StatefulControl | ArrayLike | None = None,
    t: ArrayLike = 1.0,
    wrench: Callable[..., ArrayLike] | ArrayLike | None = None,
    *,
    drive: bool = True,
    friction: Friction | None = None,
    smoothing: ArrayLike | None = None,
    stop_at_limits: bool = False,
    breaks: ArrayLike = (),
    method: Integrator | str = Integrator.DOP853,
    rtol: float = 1e-10,
    atol: float = 1e-12,
    max_step: float = np.inf,
    max_evaluations: int | None = None,
    progress: Progress = False,
    period: float | None = None,
    delay: float = 0.0,
    disturbance: Callable[..., ArrayLike] | ArrayLike | None = None,
) -> Simulation:
    """Simulate a robot under torques: integrate the direct dynamic model over time.

    Dry friction (Fc of the drives, Fcm of coupled motors, jumps at rest of a friction model) is
    exact: a part that comes to rest is held as long as the torque on it stays within its breakaway
    torques, and each change is an event at which the integration starts anew. Energies and works
    are integrated along: the drift of their balance measures the error.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints; a payload is part of it (`with_payload`).
    q0, v0 : array_like, shape (n,)
        Positions (rad or m) and velocities at the start; default at rest.
    control : callable, StatefulControl, or array_like of shape (n,) or (N, n), optional
        Torques, N m or N: a function of (t, q, v), a law with a state that is integrated along,
        constant ones, or rows for the N times ``t``, linear between them. Default none: the arm
        falls freely.
    t : array_like
        A duration in seconds, with samples at the steps of the integrator; or ascending times (N,)
        of the samples, the first one the start.
    wrench, disturbance : callable, or array_like of shape (6,) or (N, 6), (n,) or (N, n), optional
        Wrench of the tool on the environment, see `idm`, and torques of the surroundings on the
        joints; given as ``control``.
    drive : bool
        Whether rotor inertia, friction and offsets of the model's drives take part.
    friction : Friction, optional
        A friction model in addition, see `robotmodels.friction`. Each joint's torque depends on its
        own velocity.
    smoothing : array_like, scalar or shape (n,), optional
        Velocities w (rad/s or m/s) of a simpler model without events: ``tanh(v / w)`` instead of
        ``sign(v)``.
    stop_at_limits : bool
        Whether the motion ends where a joint reaches one of its limits.
    breaks : array_like, shape (K,)
        Times at which a law jumps; the value at a break belongs to the time after it.
    method : Integrator or str
        Explicit ``DOP853`` (default) and ``RK45``, implicit ``Radau`` and ``BDF``.
    rtol, atol, max_step : float
        Tolerances of a step, relative and absolute (rad, m, per s, J), and the longest step, s, for
        laws with short pulses that are no ``breaks``.
    max_evaluations : int, optional
        Evaluations of the model after which the simulation ends with a status. Default 100 000, and
        10 000 for each second and 200 for each break or row of ``control``.
    progress : bool or callable, optional
        A function is called with the fraction done; True writes it to the log (`logging`).
    period, delay : float, optional
        Sampling period of the control, s (default: continuous): its torques are held between
        samples, its state advances by Euler steps; time from a sample to its torque, s.

    Returns
    -------
    Simulation
        The motion, its loads and energies, and the status.

    Raises
    ------
    SingularMassMatrixError, InertiaError
        A mass matrix that is singular or not positive definite at the start.
    ShapeError, InvalidValueError
        Arguments, or results of laws, of the wrong shape, with NaN or infinity; a start outside the
        limits, or too fast; negative dry friction; joints that mimic others; a delay without a
        period, or as long as the simulation.

    References
    ----------
    Book section 1.5 (direct dynamic model) and 1.5.1.4 (friction).

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> motion = simulate(load("rx90"), np.zeros(6), np.zeros(6), t=np.linspace(0.0, 0.2, 5))
    >>> motion.q.shape, motion.reason(), bool(abs(motion.drift).max() < 1e-8)
    ((5, 6), 'The motion was followed to its end.', True)
    """
    check_model(model)
    check_all_or_none(drive)
    n = model.n
    q = as_exact(q0, (n,), "q0").copy()
    v = np.zeros(n) if v0 is None else as_exact(v0, (n,), "v0").copy()
    start, end, times = times_of(t)
    if isinstance(control, StatefulControl):
        law, knots = stateful(control, n), np.empty(0)
    else:
        torque, knots = law_of(control, n, times, "control")
        law = Feedback(torque and (lambda t, q, v, x: torque(t, q, v)))
    tool, tool_knots = law_of(wrench, 6, times, "wrench")
    push, push_knots = law_of(disturbance, n, times, "disturbance")
    if friction is not None:
        check_friction(friction, n)
    width = None if smoothing is None else as_each(smoothing, n, "smoothing", above=0.0)
    if (jumps := as_floats(breaks, "breaks")).ndim != 1:
        raise ShapeError(f"breaks: expected times of shape (K,), got {jumps.shape}.")
    wait = as_number(delay, "delay", least=0.0)
    if period is not None:
        given = jumps if times is None else np.concatenate([jumps, times])
        law = Sampled(law, (start, end), as_number(period, "period", above=0.0), wait, given)
        knots = np.empty(0)
    elif wait:
        raise InvalidValueError("delay: only a sampled control is delayed; give period, too.")
    held = {*jumps.tolist(), *law.instants}
    inside = sorted(x for x in {*held, *knots, *tool_knots, *push_knots} if start < x < end)
    cuts = [(float(x), x in held) for x in (start, *inside, end)]
    if max_evaluations is None:  # default: a few seconds of computing time
        max_evaluations = int(min(100_000 + 1e4 * (end - start) + 200 * len(cuts), 2**62))
    budget = int(as_number(max_evaluations, "max_evaluations", least=1.0))
    integrator = chosen(Integrator, method, "method")
    tolerances = {
        "rtol": as_number(rtol, "rtol", least=_FINEST),
        "atol": as_number(atol, "atol", above=0.0),
        "max_step": float(as_each(max_step, 1, "max_step", above=0.0)[0]),
    }
    limits = _limits(model, q) if stop_at_limits else None
    motion = Motion(model, law, tool, drive, friction, width, push)
    check_dissipates(motion.dry)
    _check_start(model, q, v, drive)
    run = Integration(motion, times, limits, integrator, tolerances, budget, progress)
    return followed(run, model, q, v, cuts, drive)


def followed(
    run: Integration,
    model: RobotModel,
    q: Array,
    v: Array,
    cuts: list[tuple[float, bool]],
    drive: bool,
) -> Simulation:
    """The motion of an integration from a state (n,), with its energies."""
    with np.errstate(over="ignore", invalid="ignore"):  # an unbounded motion is a status
        run.follow(q, v, cuts)
    q, v, *loads, works, state = (np.array(x) for x in zip(*run.rows, strict=True))
    energies = kinetic_energy(model, q, v, drive), potential_energy(model, q)
    fields: Any = (
        *(model, np.array(run.t), q, v, *loads, *energies, *works.T.copy(), bool(drive)),
        *(tuple(run.events), run.status, run.motion.evaluations, run.steps, state),
    )
    return Simulation(*fields)


def law_of(law: Any, size: int, t: Array | None, name: str) -> tuple[Any, Array]:
    """Function of time and state -> (size,) of one, of constants or of rows; times of its kinks.

    None for None. The results of a user's function are checked.
    """
    none = np.empty(0)
    if law is None or callable(law):
        return law and checked(law, size, name), none
    values = as_floats(law, name).copy()
    if values.shape == (size,):
        return lambda time, *state: values, none
    if t is None or values.shape != (len(t), size):
        rows = " (rows need the times t)" if t is None else f" or ({len(t)}, {size})"
        raise ShapeError(
            f"{name}: expected a function of time and state -> ({size},), or an array of shape "
            f"({size},){rows}, got shape {values.shape}."
        )
    return lambda time, *state: np.array([np.interp(time, t, x) for x in values.T]), t[1:-1]


def times_of(t: ArrayLike) -> tuple[float, float, Array | None]:
    """Start, end, and the times of the samples if the caller gave them. Shapes: -> times (N,)."""
    times = as_floats(t, "t")
    if times.ndim == 0 and times >= 0.0:
        return 0.0, float(times), None
    if times.ndim != 1 or not times.size:
        raise ShapeError(
            f"t: expected a duration from 0, or times of shape (N,), N from 1, got {t!r:.60}."
        )
    for k in np.flatnonzero(times[1:] <= times[:-1])[:1]:
        raise InvalidValueError(
            f"t: expected ascending times, got {times[k]} s and then {times[k + 1]} s at [{k + 1}]."
        )
    return float(times[0]), float(times[-1]), times.copy()


def _limits(model: RobotModel, q: Array) -> tuple[Array, Array]:
    lower, upper = model.lower, model.upper
    if not (np.isfinite(lower) | np.isfinite(upper)).any():
        raise InvalidValueError(
            f"stop_at_limits: no joint of {model.name!r} has a finite limit; give the table some."
        )
    for j in np.flatnonzero((q < lower) | (q > upper))[:1]:
        raise InvalidValueError(
            f"q0: joint {j + 1} starts at {q[j]:.6g}, outside its limits [{lower[j]:.6g}, "
            f"{upper[j]:.6g}]; start inside, or leave stop_at_limits out."
        )
    return lower, upper


def _check_start(model: RobotModel, q: Array, v: Array, drive: bool) -> None:
    """Raise for a start without unique finite accelerations."""
    with np.errstate(over="ignore", invalid="ignore"):
        # its errors name joints without inertia, unphysical links and singular couplings
        a = ddm(model, q, v, np.zeros(model.n), drive=drive)
        finite = np.isfinite(a).all() and np.isfinite(kinetic_energy(model, q, v, drive))
    if model.transmission is not None and not model.transmission.is_invertible:
        raise InvalidValueError(
            f"model: {model.name!r} has joints that mimic others, which simulate does not support. "
            "Integrate ddm, or take model.with_transmission(None)."
        )
    if not finite:
        raise InvalidValueError(
            f"v0: the accelerations or the energy of velocities up to {np.abs(v).max():.3g} are "
            "not finite; start slower."
        )
