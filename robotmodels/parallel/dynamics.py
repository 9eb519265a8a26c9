"""Dynamic models in Khalil's form, and their simulation.

``J^-T tau = F_platform + sum (dq_i/dX)^T H_i + wrench`` with the wrenches of the platform and of
all legs on its coordinates; the motion of the legs follows from that of their anchors.

Parameters
----------
robot, T, V, wrench, mode
    See `robotmodels.parallel`; the robot has masses (`ParallelRobot.with_masses`), V are twists.
A : array_like, shape (..., 6)
    Time derivative of V, m/s^2 and rad/s^2.
tau : array_like, shape (..., m)
    Forces of the actuators, N, or torques, N m.
T0, V0 : array_like, shapes (4, 4) and (6,)
    Pose and twist at the start of a simulation; the latter at rest by default.
control : callable or array_like, shape (m,) or (N, m), optional
    Forces or torques of the actuators: a function of (t, T, V), constant, or rows for the times
    ``t``; default none. The wrench of a simulation is given alike.
t : array_like
    Duration, s, of which 201 samples are given, or ascending times (N,).
rtol, atol : float
    Tolerances of a step.

Returns
-------
ndarray or ParallelMotion
    Forces (..., m), the acceleration (..., 6) of the platform, energies (...); or the motion until
    the end or a singular position: times ``t`` (N,), poses ``T`` (N, 4, 4), twists ``V`` (N, 6),
    lengths or angles ``q`` and forces ``tau`` of the actuators (N, m), and ``energy_drift`` (N,),
    the change of the energy that is not work of actuators or wrench, J. Singular poses are refused.

References
----------
W. Khalil and O. Ibrahim, J. of Intelligent and Robotic Systems 49 (2007) 19-37.

Examples
--------
>>> from robotmodels.parallel import gough_symmetric
>>> robot = gough_symmetric(1.0).with_masses(platform=(6.0, [0, 0, 0], 0.1 * np.eye(3)))
>>> idm(robot, robot.home, np.zeros(6), np.zeros(6)).round(3)
array([11.772, 11.772, 11.772, 11.772, 11.772, 11.772])
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, as_exact, as_number
from .._outcomes import Outcome
from ..errors import InvalidValueError, ShapeError
from ..simulation.simulate import law_of, times_of
from .legs import LegStates, Mode, Robot, is_looped, leg_states, modes_of
from .robot import Masses, ParallelRobot, PlatformResult, only_freedoms
from .velocities import SINGULAR, ikm, rates_of_rows, scales, states

_TOO_NEAR = 1e-6  # determinant and speeds of knees at the end, relative to the start
Load = ArrayLike | None
Law = Callable[[float, Array, Array], ArrayLike]


def idm(
    robot: Robot, T: ArrayLike, V: ArrayLike, A: ArrayLike, wrench: Load = None, mode: Mode = None
) -> Array:
    """Inverse dynamic model: forces or torques of the actuators for a motion of the platform."""
    load = np.zeros(6) if wrench is None else wrench
    if is_looped(robot, mode):
        return robot.idm(T, V, A, load)
    batch, T, legs, (V, A, W) = states(robot, mode, T, V=V, A=A, wrench=load)
    columns, unit = list(robot.columns), scales(robot, robot.length)
    B = np.swapaxes(legs.jacobian[..., columns] * unit, -1, -2)
    total = (_wrench(robot, T, legs, V, A) + W)[:, columns]
    return _solved(B, total * unit).reshape(*batch, robot.m)


def ddm(
    robot: Robot, T: ArrayLike, V: ArrayLike, tau: ArrayLike, wrench: Load = None, mode: Mode = None
) -> Array:
    """Direct dynamic model: acceleration of the platform under forces of the actuators."""
    load = np.zeros(6) if wrench is None else wrench
    if is_looped(robot, mode):
        return robot.ddm(T, V, tau, load)
    batch, T, legs, (V, force, W) = states(robot, mode, T, V=V, tau=tau, wrench=load)
    columns, unit = list(robot.columns), scales(robot, robot.length)
    M, h = _mass_matrix(robot, T, legs, V)
    rest = (np.einsum("nij,ni->nj", legs.jacobian, force) - h - W)[:, columns]
    out = np.zeros((len(T), 6))
    out[:, columns] = _solved(M * unit * unit[:, None], rest * unit) * unit
    return out.reshape(*batch, 6)


def energies(
    robot: ParallelRobot, T: ArrayLike, V: ArrayLike, mode: Mode = None
) -> tuple[Array, Array]:
    """Kinetic and potential energy (...) of platform and legs, J; potential zero at the origin."""
    if is_looped(robot, mode):
        raise InvalidValueError("robot: energies of kinematic loops are those of their tree.")
    batch, T, legs, (V,) = states(robot, mode, T, V=V)
    masses, v = _masses(robot), V[:, list(robot.columns)]
    kinetic = 0.5 * np.einsum("ni,nij,nj->n", v, _mass_matrix(robot, T, legs, V)[0], v)
    (m1, s1, _), (m2, s2, _) = masses.first.T[..., None], masses.second.T[..., None]
    if robot.has_cranks:
        along = (legs.knee - robot.base) / robot.crank[:, None]
        second = legs.knee + s2 * legs.direction
    else:
        along = legs.direction
        second = T[:, None, :3, 3] + legs.arm - s2 * along
    moment = masses.mass * (T[:, :3, 3] + T[:, :3, :3] @ masses.com)
    moment += (m1 * (robot.base + s1 * along) + m2 * second).sum(axis=1)
    return kinetic.reshape(batch), (-moment @ robot.gravity).reshape(batch)


def _masses(robot: ParallelRobot) -> Masses:
    if robot.masses is None:
        raise InvalidValueError(
            "robot: it has no masses; give them by robot.with_masses((mass, com, inertia))."
        )
    return robot.masses


def _mass_matrix(robot: ParallelRobot, T: Array, legs: LegStates, V: Array) -> tuple[Array, Array]:
    """Mass matrix of the platform's freedoms, and wrench (N, 6) at zero acceleration."""
    every: Any = (x[:, None] for x in legs)
    columns, parts = list(robot.columns), LegStates(*every)
    A = np.concatenate((np.zeros((1, 6)), np.eye(6)[columns]))
    F = _wrench(robot, T[:, None], parts, V[:, None], A)
    M = (F[:, 1:] - F[:, :1])[..., columns]
    return 0.5 * (M + np.swapaxes(M, 1, 2)), F[:, 0]


def _wrench(robot: ParallelRobot, T: Array, legs: LegStates, V: Array, A: Array) -> Array:
    """Wrench that moves platform and legs, at the platform's origin. Shapes: (..., 6)."""
    masses = _masses(robot)
    v, w, a, alpha = V[..., :3], V[..., 3:], A[..., :3], A[..., 3:]
    R = T[..., :3, :3]
    r, inertia = R @ masses.com, R @ masses.inertia @ np.swapaxes(R, -1, -2)
    force = masses.mass * (a + np.cross(alpha, r) + np.cross(w, np.cross(w, r)) - robot.gravity)
    moment = np.einsum("...ij,...j->...i", inertia, alpha) + np.cross(r, force)
    moment = moment + np.cross(w, np.einsum("...ij,...j->...i", inertia, w))
    # anchors on the platform
    w, alpha = w[..., None, :], alpha[..., None, :]
    spin = np.cross(w, legs.arm)
    acceleration = a[..., None, :] + np.cross(alpha, legs.arm) + np.cross(w, spin)
    if robot.has_cranks:
        at_anchor, torque = _crank_forces(robot, masses, legs, V, A, acceleration)
    else:
        torque = np.zeros(legs.q.shape)
        at_anchor = _strut_forces(robot, masses, legs, v[..., None, :] + spin, acceleration)
    force = force + at_anchor.sum(axis=-2)
    moment = moment + np.cross(legs.arm, at_anchor).sum(axis=-2)
    total = only_freedoms(robot, np.concatenate((force, moment), axis=-1))
    return total + np.einsum("...ij,...i->...j", legs.jacobian, torque)


def _strut_forces(
    robot: ParallelRobot, masses: Masses, legs: LegStates, velocity: Array, acceleration: Array
) -> Array:
    """Forces on the anchors that move legs of variable length. Shapes: (..., m, 3)."""
    u, size = legs.direction, legs.q[..., None]
    (m1, s1, i1), (m2, s2, i2) = (part.T[:, :, None] for part in (masses.first, masses.second))
    rate = (u * velocity).sum(axis=-1, keepdims=True)
    turn = (velocity - rate * u) / size
    second = (u * acceleration + size * turn**2).sum(axis=-1, keepdims=True)
    bend = (acceleration - second * u - 2.0 * rate * turn) / size  # u''
    first = m1 * (s1 * bend - robot.gravity)
    last = m2 * (acceleration - s2 * bend - robot.gravity)
    across = (s1 * first - s2 * last + (i1 + i2) * bend) / size
    return last + across - (u * across).sum(axis=-1, keepdims=True) * u


def _crank_forces(
    robot: ParallelRobot, masses: Masses, legs: LegStates, V: Array, A: Array, acceleration: Array
) -> tuple[Array, Array]:
    """Forces on the anchors, torques that move cranks and rods. Shapes: (..., m, 3), (..., m)."""
    m1, s1, i1 = masses.first.T
    m2, s2, i2 = (x[:, None] for x in masses.second.T)
    rate = np.einsum("...ij,...j->...i", legs.jacobian, V)
    second = np.einsum("...ij,...j->...i", legs.jacobian, A)
    second += np.einsum("...ij,...j->...i", rates_of_rows(robot, legs, V), V)
    swing, rod, turning = legs.knee - robot.base, robot.rod[:, None], legs.turning
    knee = second[..., None] * turning - (rate**2)[..., None] * swing
    bend = (acceleration - knee) / rod  # u''
    force, couple = m2 * (knee + s2 * bend - robot.gravity), i2 * bend / rod
    torque = (i1 + m1 * s1**2) * second - m1 * s1 / robot.crank * (turning @ robot.gravity)
    at_knee = (1.0 - s2 / rod) * force - couple
    return s2 / rod * force + couple, torque + (turning * at_knee).sum(axis=-1)


def _solved(B: Array, x: Array) -> Array:
    """Solutions of B y = x; raises for singular matrices. Shapes: (N, m, m), (N, m) -> (N, m)."""
    s = np.linalg.svd(B, compute_uv=False)
    for n in np.flatnonzero(~(s[:, -1] > SINGULAR * s[:, 0]))[:1]:
        raise InvalidValueError(
            f"T: the pose of row {n} is singular (see classify_singularity), or the mass matrix of "
            "the platform is (see with_masses)."
        )
    y: Array = np.linalg.solve(B, x[..., None])[..., 0]  # type: ignore[assignment]
    return y


class MotionStatus(Outcome):
    """Outcome of a simulation; the motion until then is given for every status."""

    FINISHED = 0, "The motion was followed to its end."
    SINGULAR = 1, "The robot came to a singular position, where its motion is not determined."
    STEP_TOO_SMALL = 2, "The steps became too small to go on."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ParallelMotion(PlatformResult):
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
    rtol, atol = as_number(rtol, "rtol", least=1e-13), as_number(atol, "atol", above=0.0)
    drive, load = (
        law_of(np.zeros(size) if law is None else law, size, times, name)[0]
        for law, size, name in ((control, robot.m, "control"), (wrench, 6, "wrench"))
    )
    for model, x in ((idm, np.zeros(6)), (ddm, np.zeros(robot.m))):
        model(robot, T0, V, x, mode=mode)  # raises for what cannot start
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
