"""Simulation of a parallel robot: the direct dynamic model integrated over time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, as_exact, as_floats
from .._outcomes import Outcome
from ..errors import InvalidValueError, ShapeError
from .dynamics import ddm, energies
from .legs import check_robot, leg_states
from .looped import LoopedPlatform
from .results import Result
from .robot import ParallelRobot, pose_at
from .velocities import Mode, ikm, modes_of, only_freedoms, scales

_TOO_NEAR = 1e-6  # least singular value, relative, and sine of an elbow


class MotionStatus(Outcome):
    """Outcome of a simulation; the motion until then is given for every status."""

    FINISHED = 0, "The motion was followed to its end."
    SINGULAR = 1, "The robot came to a singular position, where its motion is not determined."
    STEP_TOO_SMALL = 2, "The steps became too small to go on."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ParallelMotion(Result):
    """Simulated motion of a parallel robot. Read-only.

    Parameters
    ----------
    t : ndarray, shape (N,)
        Times, s; they end early if the simulation did.
    T : ndarray, shape (N, 4, 4)
        Poses of the platform.
    V : ndarray, shape (N, 6)
        Twists [v; w], world axes, m/s and rad/s.
    q, tau : ndarray, shape (N, m)
        Actuated lengths or angles, and forces or torques of the actuators.
    energy_drift : ndarray, shape (N,)
        Change of the energy that is not work of actuators or wrench, J: errors of the integration.
    status : MotionStatus
        Outcome.
    """

    outcomes: ClassVar = MotionStatus
    t: Array
    T: Array
    V: Array
    q: Array
    tau: Array
    energy_drift: Array
    status: MotionStatus


Law = Callable[[float, Array, Array], ArrayLike]


def simulate(
    robot: ParallelRobot,
    T0: ArrayLike,
    V0: ArrayLike | None = None,
    control: Law | ArrayLike | None = None,
    t: ArrayLike = 1.0,
    wrench: Law | ArrayLike | None = None,
    mode: Mode = None,
    *,
    rtol: float = 1e-9,
    atol: float = 1e-11,
) -> ParallelMotion:
    """Simulate a parallel robot under forces of its actuators.

    Parameters
    ----------
    robot : ParallelRobot
        The robot with masses.
    T0 : array_like, shape (4, 4)
        Pose at the start.
    V0 : array_like, shape (6,), optional
        Twist at the start; default at rest.
    control : callable or array_like, shape (m,), optional
        Forces or torques of the actuators, constant or a function of (t, T, V); default none.
    t : array_like
        Duration, s, of which 201 samples are given, or ascending times (N,).
    wrench : callable or array_like, shape (6,), optional
        Wrench of the platform on the environment, as ``control``.
    mode : int, optional
        Working mode of robots with cranks; default 0.
    rtol, atol : float
        Tolerances of a step.

    Returns
    -------
    ParallelMotion
        The motion until the end or a singular position.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        Arguments of the wrong shape, a robot without masses, a start out of reach or singular.

    References
    ----------
    Seed book section 2.3.3.5 (singular positions in practice).

    Examples
    --------
    >>> from robotmodels.parallel import gough_symmetric, simulate
    >>> robot = gough_symmetric(1.0).with_masses(platform=(6.0, [0, 0, 0], 0.1 * np.eye(3)))
    >>> motion = simulate(robot, robot.home, t=0.1)
    >>> motion.status.name, bool(abs(motion.energy_drift).max() < 1e-7)
    ('FINISHED', True)
    """
    from scipy.integrate import solve_ivp

    check_robot(robot)
    if isinstance(robot, LoopedPlatform):
        raise InvalidValueError("robot: simulate kinematic loops by loops.simulate.")
    start = robot.checked(se3.as_single_pose(T0, "T0"), "T0")
    V = only_freedoms(robot, np.zeros(6) if V0 is None else as_exact(V0, (6,), "V0"))
    times = as_floats(t, "t")
    if times.ndim == 0 and times > 0.0:
        times = np.linspace(0.0, float(times), 201)
    if times.ndim != 1 or times.size < 2 or not (np.diff(times) > 0.0).all():
        raise ShapeError(f"t: expected a duration above 0, or ascending times (N,), got {t!r:.60}.")
    drive, load = _law(control, robot.m, "control"), _law(wrench, 6, "wrench")
    ddm(robot, start, V, np.zeros(robot.m), mode=mode)  # raises for what cannot start
    columns, unit = list(robot.columns), scales(robot, robot.length)

    def pose(x: Array) -> Array:
        T = pose_at(x[:6])
        T[:3, :3] = T[:3, :3] @ start[:3, :3]
        return T

    def rates(time: float, x: Array) -> Array:
        if not np.isfinite(x).all():  # a later stage of such a step
            return np.full(13, np.nan)
        T, V = pose(x), x[6:12]
        tau, W = drive(time, T, V), load(time, T, V)  # errors of the laws are the caller's
        try:
            a = ddm(robot, T, V, tau, W, mode)
            power = tau @ ikm(robot, T, V, mode) - W @ V
        except InvalidValueError:  # beyond a straight leg: a shorter step is tried
            return np.full(13, np.nan)
        return np.concatenate((V[:3], _vector_rate(x[3:6], V[3:]), a, [power]))

    def sides(x: Array) -> Array:
        """Determinant of the lines and speeds of the knees, zero at singular positions."""
        legs = leg_states(robot, pose(x)[None], modes_of(robot, mode, (1,)))
        det = np.linalg.det(legs.rows[0][:, columns] * unit)
        return np.append(det, legs.speed[0]) * legs.reached[0]

    x0 = np.concatenate((start[:3, 3], np.zeros(3), V, [0.0]))
    first = sides(x0)

    def margin(time: float, x: Array) -> float:
        return float((sides(x) / first).min()) - _TOO_NEAR

    margin.terminal = True  # type: ignore[attr-defined]
    span = (float(times[0]), float(times[-1]))
    found = solve_ivp(rates, span, x0, "DOP853", times, events=margin, rtol=rtol, atol=atol)
    status = MotionStatus.FINISHED
    if found.status != 0:
        stuck = found.status < 0 and margin(0.0, found.y[:, -1]) > 0.05
        status = MotionStatus.STEP_TOO_SMALL if stuck else MotionStatus.SINGULAR
    x = found.y.T
    T, V = np.array([pose(row) for row in x]), x[:, 6:12]
    energy = np.add(*energies(robot, T, V, mode))
    tau = np.array([drive(*row) for row in zip(found.t, T, V, strict=True)])
    q = leg_states(robot, T, modes_of(robot, mode, (len(T),))).q
    return ParallelMotion(found.t, T, V, q, tau, energy - energy[0] - x[:, 12], status)


def _law(law: Any, size: int, name: str) -> Callable[[float, Array, Array], Array]:
    """A function of (t, T, V) from one, a constant or nothing."""
    if law is None or not callable(law):
        given: Any = np.zeros(size) if law is None else law
        constant = as_exact(given, (size,), name).copy()
        return lambda t, T, V: constant
    function: Callable[..., Any] = law
    return lambda t, T, V: as_exact(function(t, T.copy(), V.copy()), (size,), f"{name}(t, T, V)")


def _vector_rate(r: Array, w: Array) -> Array:
    """Rate of a rotation vector from the angular velocity in world axes."""
    angle = float(np.linalg.norm(r))
    if angle < 1e-4:
        share = 1.0 / 12.0 + angle**2 / 720.0
    else:
        share = (1.0 - 0.5 * angle / np.tan(0.5 * angle)) / angle**2
    return w - 0.5 * np.cross(r, w) + share * np.cross(r, np.cross(r, w))
