"""Simulation of a parallel robot: the direct dynamic model integrated over time.

Parameters
----------
robot : ParallelRobot
    The robot with masses.
T0 : array_like, shape (4, 4)
    Pose at the start.
V0 : array_like, shape (6,), optional
    Twist at the start; default at rest.
control : callable or array_like, shape (m,) or (N, m), optional
    Forces or torques of the actuators: a function of (t, T, V), constant, or rows for the times
    ``t``; default none.
t : array_like
    Duration, s, of which 201 samples are given, or ascending times (N,).
wrench : callable or array_like, shape (6,) or (N, 6), optional
    Wrench of the platform on the environment, as ``control``.
mode : int, optional
    Working mode of robots with cranks; default 0.
rtol, atol : float
    Tolerances of a step.

Returns
-------
ParallelMotion
    The motion until the end or a singular position: times ``t`` (N,), poses ``T`` (N, 4, 4), twists
    ``V`` (N, 6), lengths or angles ``q`` and forces ``tau`` of the actuators (N, m), and
    ``energy_drift`` (N,), the change of the energy that is not work of actuators or wrench, J:
    errors of the integration.

Raises
------
ShapeError, InvalidValueError, NotARotationError
    Arguments of the wrong shape, a robot without masses, a start out of reach or singular.

References
----------
Seed book section 2.3.3.5 (singular positions in practice).

Examples
--------
>>> from robotmodels.parallel import gough_symmetric
>>> robot = gough_symmetric(1.0).with_masses(platform=(6.0, [0, 0, 0], 0.1 * np.eye(3)))
>>> motion = simulate(robot, robot.home, t=0.1)
>>> motion.status.name, bool(abs(motion.energy_drift).max() < 1e-7)
('FINISHED', True)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, as_exact
from .._outcomes import Outcome
from ..errors import InvalidValueError, ShapeError
from ..simulation.simulate import law_of, times_of
from .dynamics import ddm, energies
from .legs import Mode, is_looped, leg_states, modes_of
from .results import Result
from .robot import ParallelRobot, only_freedoms
from .velocities import ikm, scales

_TOO_NEAR = 1e-6  # least singular value, relative, and sine of an elbow
Law = Callable[[float, Array, Array], ArrayLike]


class MotionStatus(Outcome):
    """Outcome of a simulation; the motion until then is given for every status."""

    FINISHED = 0, "The motion was followed to its end."
    SINGULAR = 1, "The robot came to a singular position, where its motion is not determined."
    STEP_TOO_SMALL = 2, "The steps became too small to go on."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ParallelMotion(Result):
    """Simulated motion of a parallel robot, see the head of the file. Read-only."""

    outcomes: ClassVar = MotionStatus
    t: Array
    T: Array
    V: Array
    q: Array
    tau: Array
    energy_drift: Array
    status: MotionStatus


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
    """Simulate a parallel robot under forces of its actuators."""
    from scipy.integrate import solve_ivp
    from scipy.spatial.transform import Rotation

    if is_looped(robot, mode):
        raise InvalidValueError("robot: simulate kinematic loops by loops.simulate.")
    T0 = robot.checked(se3.as_single_pose(T0, "T0"), "T0")
    V = only_freedoms(robot, np.zeros(6) if V0 is None else as_exact(V0, (6,), "V0"))
    first, last, times = times_of(t)
    if not last > first:
        raise ShapeError(f"t: expected a duration above 0, or ascending times (N,), got {t!r:.60}.")
    times = np.linspace(first, last, 201) if times is None else times
    drive, load = _law(control, robot.m, times, "control"), _law(wrench, 6, times, "wrench")
    ddm(robot, T0, V, np.zeros(robot.m), mode=mode)  # raises for what cannot start
    columns, unit = list(robot.columns), scales(robot, robot.length)

    def poses(x: Array) -> Array:
        """Poses of states: position, quaternion with the real part last, twist, work."""
        T = np.tile(np.eye(4), (len(x), 1, 1))
        T[:, :3, :3], T[:, :3, 3] = Rotation.from_quat(x[:, 3:7]).as_matrix(), x[:, :3]
        return T

    def rates(time: float, x: Array) -> Array:
        if not np.isfinite(x).all():  # a later stage of such a step
            return np.full(14, np.nan)
        T, V = poses(x[None])[0], x[7:13]
        tau, W = drive(time, T, V), load(time, T, V)  # errors of the laws are the caller's
        try:
            a = ddm(robot, T, V, tau, W, mode)
            power = tau @ ikm(robot, T, V, mode) - W @ V
        except InvalidValueError:  # beyond a straight leg: a shorter step is tried
            return np.full(14, np.nan)
        w, e, real = V[3:], x[3:6], x[6]
        return np.concatenate((
            V[:3], 0.5 * (real * w + np.cross(w, e)), [-0.5 * (w @ e)], a, [power],
        ))  # fmt: skip

    def sides(x: Array) -> Array:
        """Determinant of the lines and speeds of the knees, zero at singular positions."""
        legs = leg_states(robot, poses(x[None]), modes_of(robot, mode, (1,)))
        det = np.linalg.det(legs.rows[0][:, columns] * unit)
        return np.append(det, legs.speed[0]) * legs.reached[0]

    x0 = np.concatenate((T0[:3, 3], Rotation.from_matrix(T0[:3, :3]).as_quat(), V, [0.0]))
    start = sides(x0)

    def margin(time: float, x: Array) -> float:
        return float((sides(x) / start).min()) - _TOO_NEAR

    margin.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(
        rates, (first, last), x0, "DOP853", times, events=margin, rtol=rtol, atol=atol
    )
    status = MotionStatus.FINISHED
    if found.status != 0:
        stuck = found.status < 0 and margin(0.0, found.y[:, -1]) > 0.05
        status = MotionStatus.STEP_TOO_SMALL if stuck else MotionStatus.SINGULAR
    T, V = poses(found.y.T), found.y[7:13].T
    energy = np.add(*energies(robot, T, V, mode))
    tau = np.array([drive(*row) for row in zip(found.t, T, V, strict=True)])
    q = leg_states(robot, T, modes_of(robot, mode, (len(T),))).q
    return ParallelMotion(found.t, T, V, q, tau, energy - energy[0] - found.y[13], status)


def _law(law: Any, size: int, t: Array, name: str) -> Callable[[float, Array, Array], Array]:
    """A function of (t, T, V) from one, a constant, rows or nothing."""
    function = law_of(np.zeros(size) if law is None else law, size, t, name)[0]
    assert function is not None
    return lambda time, T, V: function(time, T.copy(), V.copy())
