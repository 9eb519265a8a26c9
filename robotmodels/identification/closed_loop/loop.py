"""Controllers of the joints, and settings of a simulated closed loop.

Sources: A. Janot, P.-O. Vandanjon and M. Gautier, "A generic instrumental variable approach for
industrial robot identification", IEEE T-CST 22(1), 2014, section III; E. Hairer and G. Wanner,
"Solving Ordinary Differential Equations II", section IV.2 (stability of explicit integration).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import (
    Array,
    Frozen,
    Rebuilt,
    as_count,
    as_exact,
    as_floats,
    as_number,
    as_reals,
    read_only,
)
from ...drive import DriveParameters, Transmission, drive_kinds
from ...dynamics import base_model, mass_matrix
from ...errors import InertiaError, InvalidValueError, ShapeError
from ...model import RobotModel
from ..equations import EquationForm, Equations

_SAMPLED = 0.25  # largest velocity loop rate relative to the sampling rate
_POSTURES = 200  # largest number of postures for mass matrices


@dataclass(frozen=True, slots=True, eq=False)
class Controller(Rebuilt):
    """A sampled controller of each joint. Read-only.

    ``tau = kp (q_ref - q) + kd (v_ref - v) + ki * integral(q_ref - q) + feed forward``, held over
    each period. The integral stops while the torque is at its limit.

    Parameters
    ----------
    kp, kd, ki : array_like, scalar or shape (n,)
        Gains of position (N m/rad or N/m), velocity, and the integral of the position error (per
        second, default none); at least one of the arrays has shape (n,).
    limit : array_like, scalar or shape (n,), optional
        Largest torque, N m or N; default none.
    feed_forward : RobotModel, optional
        The robot whose torques on the references are added, its drives included.
    period : float, optional
        Seconds from one torque to the next; default that of the log.

    References
    ----------
    Book chapter 5 (position control).

    Examples
    --------
    >>> Controller(kp=[100.0, 50.0], kd=[10.0, 5.0]).n
    2
    """

    kp: Array
    kd: Array
    ki: ArrayLike = 0.0
    limit: ArrayLike = np.inf
    feed_forward: RobotModel | None = None
    period: float | None = None

    def __post_init__(self) -> None:
        gains = {name: as_floats(getattr(self, name), name) for name in ("kp", "kd", "ki")}
        gains["limit"] = as_reals(self.limit, "limit")
        shapes = {array.shape for array in gains.values() if array.ndim}
        if self.feed_forward is not None:
            shapes.add((self.feed_forward.n,))
        if len(shapes) != 1 or len(shape := shapes.pop()) != 1:
            raise ShapeError(
                "kp, kd, ki, limit: expected numbers or arrays of one length (n,), at least one of "
                f"them an array, got shapes {[array.shape for array in gains.values()]}."
            )
        if not (gains["limit"] > 0.0).all():
            raise InvalidValueError(f"limit: expected torques above 0, got {self.limit!r:.60}.")
        for name, array in gains.items():
            object.__setattr__(self, name, read_only(np.broadcast_to(array, shape)))
        if self.period is not None:
            object.__setattr__(self, "period", as_number(self.period, "period", above=0.0))

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(np.asarray(self.kp))


def tuned_controller(
    robot: RobotModel,
    q: ArrayLike,
    bandwidth: float,
    damping: float = 1.0,
    period: float = 1e-3,
    feed_forward: bool = True,
) -> Controller:
    """PD gains for a bandwidth, from the least inertia of each joint over postures.

    Parameters
    ----------
    robot : RobotModel
        The robot, which is also the feed-forward model.
    q : array_like, shape (N, n)
        Postures.
    bandwidth, damping, period : float
        Hz (less where the velocity loop would be too fast for the period), damping ratio, and
        seconds from one torque to the next.
    feed_forward : bool
        Whether the torques of the robot on the references are added.

    Returns
    -------
    Controller
        Without integral and limit.

    Raises
    ------
    InertiaError, InvalidValueError
        A mass matrix that is not positive definite; a number that is not positive.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> tuned_controller(load("rx90"), [[0.0] * 6], bandwidth=8.0).n
    6
    """
    w = 2.0 * np.pi * as_number(bandwidth, "bandwidth", above=0.0)
    damping = as_number(damping, "damping", above=0.0)
    period = as_number(period, "period", above=0.0)
    inverse = inverse_masses(robot, as_floats(q, "q"))
    if inverse is None:
        raise InertiaError(
            f"robot: the mass matrix of {robot.name!r} is not positive definite in these postures; "
            "give parameters of a robot that moves inertia in every joint."
        )
    J = 1.0 / np.diagonal(inverse, axis1=1, axis2=2).max(axis=0)
    # largest coupled velocity loop rate, per unit of 2 damping w
    fastest = float(np.abs(np.linalg.eigvals(inverse * J)).max())
    w = min(w, _SAMPLED / (damping * fastest * period))
    return Controller(J * w**2, 2.0 * damping * w * J, feed_forward=robot if feed_forward else None)


def inverse_masses(robot: RobotModel, q: Array) -> Array | None:
    """Inverses of the mass matrices, or None where one is not positive definite.

    Shapes: q (N, n) -> (k, n, n).
    """
    M = mass_matrix(robot, q[:: max(1, len(q) // _POSTURES)])
    size = np.sqrt(np.maximum(np.abs(np.diagonal(M, axis1=1, axis2=2)), 1e-300))
    scale = size[:, :, None] * size[:, None, :]
    if not (np.linalg.eigvalsh(M / scale)[:, 0] > 1e-12).all():
        return None
    return np.linalg.inv(M / scale) / scale


_FASTER = 10.0  # bandwidth of an assumed controller relative to the motion frequency
_NEAR = 0.5  # least tracking limit, rad or m
_SLOW = 0.05  # target friction regularisation velocity relative to a joint's fast velocities
_STEP, _STABLE = 1.5, 2.78
"""Integration step in time constants of friction: target, and stability bound of RK4. Regularised
dry friction adds 1."""
MOST = 64
"""Largest default number of integration steps per sample."""


@dataclass(frozen=True, slots=True, eq=False)
class ClosedLoop(Frozen):
    """Settings of the simulation of a controlled robot. Read-only.

    Shapes (n,): friction regularisation velocities ``width``; distances from the references beyond
    which the simulation has diverged. Integration steps per held torque and per sample; notes.
    """

    controller: Controller
    width: Array
    tracking_limit: Array
    hold: int
    substeps: int
    notes: tuple[str, ...] = ()


class FrictionRates(NamedTuple):
    """Largest rates of friction: viscous (1/s), its joint, dry (rad/s^2 or m/s^2) (n,)."""

    viscous: float
    joint: int
    dry: Array

    def steps(self, dt: float, goal: Array | float = 0.0) -> int:
        """Integration steps of a sample for stability, and for widths up to the target (0: any)."""
        parts = np.where(np.greater(goal, 0.0), goal, np.inf)
        # tolerance: a width chosen for one step gives one step
        most = max(dt * self.viscous / _STEP, float((dt * self.dry / parts).max(initial=0.0)))
        return max(1, int(np.ceil(most * (1.0 - 1e-9))))

    def stable(self, step: float) -> bool:
        """Whether the integration of viscous friction is stable with this step."""
        return step * self.viscous < _STABLE


def friction_rates(robot: RobotModel, q: Array) -> FrictionRates | None:
    """Largest rates of the drives' friction over some postures (N, n); None without a valid M."""
    inverse = inverse_masses(robot, q)
    if inverse is None:
        return None
    n, drives = robot.n, robot.drive_matrices
    if drives is None:
        return FrictionRates(0.0, 0, np.zeros(n))
    mobility = np.diagonal(inverse, axis1=1, axis2=2).max(axis=0)
    viscous = float(np.abs(np.linalg.eigvals(inverse @ drives.viscous)).max(initial=0.0))
    joint = int(np.argmax(mobility * np.abs(np.diagonal(drives.viscous))))
    dry = np.abs(drives.coulomb) * mobility
    if robot.transmission is not None:
        for k, m in enumerate(robot.transmission.coupled_motors):
            w = drives.coupling[k]
            dry[m - 1] += abs(drives.coupled_coulomb[k]) * float((inverse @ w @ w).max())
    return FrictionRates(viscous, joint, dry)


def closed_loop(
    system: Equations,
    values: ArrayLike,
    controller: Controller | None = None,
    width: ArrayLike | None = None,
    substeps: int | None = None,
) -> ClosedLoop | None:
    """Closed loop of a log, with its controller or a tuned one; None without a valid mass matrix.

    Shapes: values (b,), width scalar or (n,).
    """
    log, n, processing = system.log, system.model.n, system.processing
    _check_supported(system)
    robot = robot_of(system, values)
    rates = friction_rates(robot, log.q)
    if rates is None:
        return None
    notes: list[str] = []
    if controller is None:
        bandwidth = _FASTER * processing.motion
        controller = tuned_controller(robot, log.q, bandwidth, period=log.dt)
        bandwidth = float((controller.kp / controller.kd).max() / np.pi)
        notes.append(
            f"The controller is unknown: the assumed one has a bandwidth of {bandwidth:.3g} Hz "
            "and feeds the torques of the first values forward."
        )
    if controller.n != n:
        raise ShapeError(f"controller: expected {n} joints, got {controller.n}.")
    references = log.q if log.q_ref is None else log.q_ref
    if log.q_ref is None:
        notes.append(
            "The log has no references: the simulated robot follows the filtered measured "
            "positions, so that the noise that passes the filter is in its references."
        )
    given = None if width is None else as_floats(width, "width")
    if given is not None and (given.shape not in ((), (n,)) or (given < 0.0).any()):
        raise ShapeError(f"width: expected one velocity or shape ({n},), none negative.")
    goal = _goal(system, references) if given is None else np.broadcast_to(given, (n,))
    needed = rates.steps(log.dt, goal)
    parts, hold = steps_of(controller, log.dt, min(needed, MOST) if substeps is None else substeps)
    rest, stable = log.dt / parts * rates.dry, rates.stable(log.dt / parts)
    if (parts < needed and substeps is None) or not stable:
        joint = int(np.argmax(rest / np.where(goal > 0.0, goal, np.inf))) if stable else rates.joint
        notes.append(
            f"{robot.table.joint_names[joint]} is stiff: friction stops it too fast for {parts} "
            f"steps, so that dry friction is linear up to {rest[joint]:.2g} rad/s or m/s"
            f"{'' if stable else ' and the simulation unstable'}; give the method more substeps=."
        )
    if given is None:
        given = np.where(rest > 0.0, np.maximum(processing.dead_band, rest), 0.0)
    limit = np.maximum(np.ptp(references, axis=0), _NEAR)
    return ClosedLoop(controller, np.broadcast_to(given, (n,)), limit, hold, parts, tuple(notes))


def _check_supported(system: Equations) -> None:
    """Raise for equations whose robot cannot be simulated with a controller."""
    K, friction = system.model.transmission, system.base.friction
    problem = ""
    if system.form is not EquationForm.TORQUE:
        problem = f"form: expected {EquationForm.TORQUE.value}, got {system.form.value}"
    elif friction is not None:
        problem = f"friction: expected that of the drives alone, got {type(friction).__name__}"
    elif K is not None and not K.is_invertible:
        problem = "model: expected independent joints, got joints that mimic others"
    if problem:
        raise InvalidValueError(
            f"{problem}. Other closed loops are not simulated; use least squares."
        )


def robot_of(system: Equations, values: ArrayLike) -> RobotModel:
    """Robot model with base parameters as standard parameters. Shapes: values (b,)."""
    base, model = system.base, system.model
    known = dict(zip(system.names, as_exact(values, (len(system.names),), "values"), strict=True))
    robot = base_model(model, base, np.array([known.get(name, 0.0) for name in base.names]))
    kinds = drive_kinds(base.drive)
    terms = {kind.value: getattr(robot.drive, kind.value) for kind in kinds}
    robot = robot.with_drive(DriveParameters(**{"Ia": np.zeros(model.n), **terms}))
    if (K := robot.transmission) is not None:
        names = [kind.coupling for kind in kinds if kind.coupling is not None]
        coupled = {name: getattr(K, name) for name in names}
        robot = robot.with_transmission(Transmission(K.matrix, K.offset, **coupled))
    return robot


def steps_of(controller: Controller, dt: float, substeps: int) -> tuple[int, int]:
    """Numbers of integration steps per sample and per controller period."""
    substeps = as_count(substeps, "substeps")
    period = dt if controller.period is None else controller.period
    samples, parts = period / dt, dt / period
    if abs(samples - round(samples)) <= 1e-6 * samples:
        return substeps, substeps * round(samples)
    if abs(parts - round(parts)) <= 1e-6 * parts:
        whole = -(-substeps // round(parts)) * round(parts)
        return whole, whole // round(parts)
    raise InvalidValueError(
        f"period: expected a multiple or a whole part of that of the log ({dt:g} s), got "
        f"{period:g} s."
    )


def _goal(system: Equations, references: Array) -> Array:
    """Default friction regularisation velocities: dead band, or a part of the speed."""
    log, motion = system.log, system.processing.motion
    stride = max(1, min(int(0.1 / max(motion * log.dt, 1e-9)), len(log) - 1))
    speeds = np.abs(references[stride:] - references[:-stride]) / (stride * log.dt)
    # differences across two recordings are negligible
    fast = np.percentile(speeds[:: max(1, len(log) // 2000)], 95, axis=0)
    return np.maximum(system.processing.dead_band, _SLOW * fast)
