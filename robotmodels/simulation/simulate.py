"""Simulation of a robot: the direct dynamic model integrated over time."""

from __future__ import annotations

import logging
from collections.abc import Callable
from operator import index
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_floats
from ..drive import check_all_or_none
from ..dynamics import ddm, kinetic_energy, mass_matrix, potential_energy
from ..errors import InertiaError, InvalidValueError, ShapeError
from ..friction import Friction, check_friction
from ..model import RobotModel, check_model
from .dry_friction import DryFriction, check_dissipates, dry_friction
from .forces import Forces
from .inputs import Law, as_law, as_positive, as_state, as_times
from .loop import Options, follow
from .result import Simulation
from .status import Integrator

_LOG = logging.getLogger(__name__)
_FINEST = 100 * float(np.finfo(np.float64).eps)


def simulate(
    model: RobotModel,
    q0: ArrayLike,
    v0: ArrayLike,
    control: Law | ArrayLike | None = None,
    t: ArrayLike = 1.0,
    wrench: Law | ArrayLike | None = None,
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
    progress: bool | Callable[[float], None] = False,
) -> Simulation:
    """Motion of a robot under torques: the direct dynamic model integrated over time.

    The integrator takes steps as large as the tolerances allow. Dry friction (Fc of the drives, Fcm
    of coupled motors, jumps at rest of a friction model) is exact: a part that comes to rest is
    held as long as the torque on it stays within its breakaway torques (by 1e-9 of them), and each
    change is an event at which the integration starts anew. Energies and works are integrated
    along, so that the drift of their balance tells the error of the integration.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints; a payload is part of it (`with_payload`).
    q0, v0 : array_like, shape (n,)
        Positions (rad or m) and velocities at the start.
    control : callable, or array_like of shape (n,) or (N, n), optional
        Torques, N m or N: a function of (t, q, v), constant ones, or rows for the N times ``t``,
        linear between them. Default none: the arm falls freely.
    t : array_like
        A duration in seconds, the samples then being the steps of the integrator; or ascending
        times (N,) of the samples, the first one the start.
    wrench : callable, or array_like of shape (6,) or (N, 6), optional
        What the tool exerts on the environment, see `idm`; given as ``control``.
    drive : bool
        Whether rotor inertia, friction and offsets of the model's drives take part.
    friction : Friction, optional
        A friction model that acts besides them, see `robotmodels.friction`. Each joint's torque
        depends on its own velocity.
    smoothing : array_like, scalar or shape (n,), optional
        Velocities w (rad/s or m/s) of a simpler model without events: ``tanh(v / w)`` in the place
        of ``sign(v)``. Joints then creep where they should stick, and narrow widths are stiff
        (take ``method="Radau"``).
    stop_at_limits : bool
        Whether the simulation ends where a joint reaches a limit of its table; joints with infinite
        limits go on. Otherwise limits are not looked at.
    breaks : array_like, shape (K,)
        Times at which ``control`` or ``wrench`` jump, such as the instants of a sampled controller:
        the integration starts anew there. A law's value at a break belongs to the time after it;
        breaks before the start and after the end do not matter.
    method : Integrator or str
        Explicit ``DOP853`` (default) and ``RK45``, implicit ``Radau`` and ``BDF``.
    rtol, atol : float
        Tolerances of a step, relative and absolute (rad, m, per s, J).
    max_step : float
        Longest step, s, for laws with short pulses that are no ``breaks``.
    max_evaluations : int, optional
        The simulation ends, with a status that says so, when the model has been evaluated so often.
        Default 100 000, and 10 000 for each second and 200 for each break or row of ``control``:
        free motion of an arm needs about 1000 a second, torques in a wrong unit (joints at
        thousands of turns a second) end within seconds instead of hours.
    progress : bool or callable
        A function of the fraction done, called for about every hundredth; True logs it.

    Returns
    -------
    Simulation
        The motion, its loads and energies, and a status that says how it ended.

    Raises
    ------
    SingularMassMatrixError
        A joint moves no inertia at the start.
    InertiaError
        The mass matrix is not positive definite at the start; the links that no body is are named.
    ShapeError, InvalidValueError
        Arguments or answers of ``control`` and ``wrench`` of the wrong shape, with NaN or infinity;
        laws that do not take (t, q, v); a start outside the limits, or limits asked for that no
        joint has; a start so fast that its energy is
        no finite number; dry friction that is negative; joints that mimic others.

    References
    ----------
    Seed book section 1.5 (direct dynamic model) and 1.5.1.4 (friction); E. Hairer, S. Noersett and
    G. Wanner, "Solving ordinary differential equations I", 2nd ed., II.5 and II.6.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> fall = simulate(load("rx90"), np.zeros(6), np.zeros(6), t=np.linspace(0.0, 0.2, 5))
    >>> fall.q.shape, fall.reason, bool(abs(fall.drift).max() < 1e-8)
    ((5, 6), 'The motion was followed to its end.', True)
    """
    check_model(model)
    check_all_or_none(drive)
    n = model.n
    q, v = as_state(q0, n, "q0"), as_state(v0, n, "v0")
    start, end, times = as_times(t)
    law, knots = as_law(control, n, times, "control")
    tool, tool_knots = as_law(wrench, 6, times, "wrench")
    if friction is not None:
        check_friction(friction, n)
    width = _width(smoothing, n)
    cuts = _cuts(start, end, as_floats(breaks, "breaks"), np.r_[knots, tool_knots])
    options = Options(
        _method(method),
        _tolerance(rtol),
        as_positive(atol, "atol"),
        as_positive(max_step, "max_step", infinite=True),
        _usual_count(end - start, len(cuts))
        if max_evaluations is None
        else _count(max_evaluations),
        _progress(progress),
    )
    limits = _limits(model, q) if stop_at_limits else None
    _check_start(model, q, v, drive)
    dry = dry_friction(model, drive, friction)
    if width is None:
        check_dissipates(dry)
        _check_definite(model, q, drive, dry)
    forces = Forces(model, law, tool, drive, friction, dry, width)
    with np.errstate(over="ignore", invalid="ignore"):  # a motion without bound ends as a status
        path = follow(forces, q, v, cuts, times, limits, options)
    columns = [np.array(column) for column in zip(*path.rows, strict=True)]
    positions, velocities, accelerations, torques, taken, held, works = columns
    return Simulation(
        model=model,
        t=np.array(path.t),
        q=positions,
        v=velocities,
        a=accelerations,
        tau=torques,
        friction=taken,
        sticking=held,
        kinetic=kinetic_energy(model, positions, velocities, drive),
        potential=potential_energy(model, positions),
        control_work=works[:, 0].copy(),
        friction_work=works[:, 1].copy(),
        wrench_work=works[:, 2].copy(),
        drive=bool(drive),
        events=tuple(path.events),
        status=path.status,
        evaluations=forces.evaluations,
        steps=path.steps,
    )


def _cuts(start: float, end: float, breaks: Array, knots: Array) -> list[tuple[float, bool]]:
    """Start, jumps and kinks inside, end; and whether laws jump there."""
    if breaks.ndim != 1:
        raise ShapeError(f"breaks: expected times of shape (K,), got {breaks.shape}.")
    jumps = set(breaks.tolist())
    inside = sorted(x for x in jumps | set(knots.tolist()) if start < x < end)
    return [(x, x in jumps) for x in (start, *inside, end)]


def _limits(model: RobotModel, q: Array) -> tuple[Array, Array]:
    lower, upper = model.lower, model.upper
    if lower.size and not (np.isfinite(lower) | np.isfinite(upper)).any():
        raise InvalidValueError(
            f"stop_at_limits: no joint of {model.name!r} has a finite limit, so that nothing would "
            "stop; give the table lower= and upper=, or leave stop_at_limits out."
        )
    out = np.flatnonzero((q < lower) | (q > upper))
    if out.size:
        j = int(out[0])
        raise InvalidValueError(
            f"q0: joint {j + 1} starts at {q[j]:.6g}, outside its limits [{lower[j]:.6g}, "
            f"{upper[j]:.6g}]; start inside, or leave stop_at_limits out."
        )
    return lower, upper


def _check_start(model: RobotModel, q: Array, v: Array, drive: bool) -> None:
    """Refuse what has no one finite acceleration to begin with."""
    with np.errstate(over="ignore", invalid="ignore"):
        # names joints without inertia, links of no body and singular couplings
        a = ddm(model, q, v, np.zeros(model.n), drive=drive)
        finite = np.isfinite(a).all() and np.isfinite(kinetic_energy(model, q, v, drive))
    if model.transmission is not None and not model.transmission.is_invertible:
        raise InvalidValueError(
            f"model: {model.name!r} has joints that mimic others, which simulate does not follow: "
            "its joints would come apart. Integrate ddm, which keeps them together, or simulate "
            "independent joints with model.with_transmission(None)."
        )
    if not finite:
        raise InvalidValueError(
            f"v0: the accelerations or the energy of velocities up to {np.abs(v).max():.3g} are no "
            "finite numbers; start slower."
        )


def _width(smoothing: ArrayLike | None, n: int) -> Array | None:
    if smoothing is None:
        return None
    width = as_floats(smoothing, "smoothing")
    if width.shape not in ((), (n,)):
        raise ShapeError(f"smoothing: expected one velocity, or shape ({n},), got {width.shape}.")
    if (width <= 0.0).any():
        raise InvalidValueError(
            f"smoothing: expected positive velocities, got {width.min()}; leave it out for dry "
            "friction that sticks."
        )
    return np.broadcast_to(width, (n,)).copy()


def _check_definite(model: RobotModel, q: Array, drive: bool, dry: DryFriction) -> None:
    if not dry.count:
        return
    try:
        np.linalg.cholesky(mass_matrix(model, q, drive))
    except np.linalg.LinAlgError:
        raise InertiaError(
            f"the mass matrix of {model.name!r} is not positive definite at q0, so that it is not "
            "defined which joints dry friction holds. Repair the inertial parameters "
            "(InertialParameters.consistency()), or give a smoothing width."
        ) from None


def _method(method: Any) -> Integrator:
    try:
        return Integrator(method)
    except ValueError:
        known = ", ".join(repr(each.value) for each in Integrator)
        raise InvalidValueError(f"method: expected one of {known}, got {method!r:.60}.") from None


def _tolerance(rtol: Any) -> float:
    value = as_positive(rtol, "rtol")
    if value < _FINEST:
        raise InvalidValueError(
            f"rtol: steps cannot be told to be better than {_FINEST:.2g} (rounding), got {value}."
        )
    return value


def _usual_count(duration: float, cuts: int) -> int:
    """Evaluations that ordinary motion does not need, of a few seconds of computing time."""
    return int(min(100_000 + 1e4 * duration + 200 * cuts, 2**62))


def _count(value: Any) -> int:
    try:
        number = index(value)
    except TypeError:
        number = 0
    if isinstance(value, bool) or number < 1:
        raise InvalidValueError(
            f"max_evaluations: expected a whole number from 1, got {value!r:.60}."
        )
    return number


def _progress(progress: Any) -> Any:
    if progress is False or progress is None:
        return None
    if progress is True:
        return lambda done: _LOG.info("simulated %.0f %%", 100.0 * done)
    if callable(progress):
        return progress
    raise InvalidValueError(
        f"progress: expected a flag or a function of the fraction done, got {progress!r:.60}."
    )
