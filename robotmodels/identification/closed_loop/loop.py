"""Simulated closed loop: controller, dry-friction width, end conditions.

Source: A. Janot, P.-O. Vandanjon and M. Gautier, "A generic instrumental variable approach for
industrial robot identification", IEEE T-CST 22(1), 2014, section III.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, Rebuilt, as_exact, as_floats, read_only
from ...drive import DriveParameters, Transmission, drive_kinds
from ...dynamics import base_model
from ...errors import InvalidValueError, ShapeError
from ...model import RobotModel
from ..equations import EquationForm, Equations
from .controller import Controller, tuned_controller
from .stiffness import least_width as least_width
from .stiffness import stiffness

_FASTER = 10.0
"""Bandwidth of a controller that is not known, in frequencies of the motion."""
_NEAR = 0.5
"""rad or m: errors of position below which no robot has run away."""
_SLOW = 0.05
"""Part of a joint's fast velocities that its width at rest need not fall below."""
MOST = 64
"""Steps of integration of a sample that are chosen at most."""
_LOOKED = 2000
"""Samples of the log at which velocities are looked at."""


@dataclass(frozen=True, slots=True, eq=False)
class ClosedLoop(Rebuilt):
    """How a controlled robot is simulated. Read-only.

    Parameters
    ----------
    controller : Controller
        What moves the robot.
    width : ndarray, shape (n,)
        Velocities around rest, rad/s or m/s, over which dry friction rises linearly; beyond it is
        that of the equations.
    astray : ndarray, shape (n,)
        Distances from the references, rad or m, beyond which the robot has run away.
    hold, substeps : int
        Steps of integration over which a torque is held; steps of a sample of the log.
    referenced : bool
        Whether references are those of the log; otherwise its filtered positions are followed.
    notes : tuple of str
        What to know.
    """

    controller: Controller
    width: Array
    astray: Array
    hold: int
    substeps: int
    referenced: bool
    notes: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in ("width", "astray"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


def closed_loop(
    system: Equations,
    values: ArrayLike,
    controller: Controller | None = None,
    *,
    bandwidth: float | None = None,
    width: ArrayLike | None = None,
    substeps: int | None = None,
) -> ClosedLoop | None:
    """The closed loop of a log: its own controller, or one that is tuned to follow closely."""
    log, n = system.log, system.model.n
    if system.form is not EquationForm.TORQUE:
        raise InvalidValueError(
            f"form: closed loops are simulated for {EquationForm.TORQUE.value}, got "
            f"{system.form.value}."
        )
    if system.base.friction is not None:
        raise InvalidValueError(
            f"friction: the simulated robot has the friction of its drives (Fv, Fc, offset), not "
            f"{type(system.base.friction).__name__}; take least squares for it."
        )
    if system.model.transmission is not None and not system.model.transmission.is_invertible:
        raise InvalidValueError(
            "model: joints that mimic others are not simulated with a controller; take least "
            "squares for this robot."
        )
    robot = robot_of(system, values)
    stiff = stiffness(robot, log.q)
    if stiff is None:
        return None
    given = None if width is None else _checked_width(width, n)
    notes: list[str] = []
    if controller is None:
        asked = _FASTER * system.processing.motion if bandwidth is None else bandwidth
        controller = tuned_controller(robot, log.q, asked, period=log.dt)
        found = float((controller.kp / controller.kd).max() / np.pi)
        notes.append(
            f"The controller is not known: the simulated one has a bandwidth of {found:.3g} Hz and "
            "feeds the torques of the first values forward."
        )
    elif bandwidth is not None:
        raise InvalidValueError("bandwidth: it is for a controller that is not given.")
    if controller.n != n:
        raise ShapeError(f"controller: expected {n} joints, got {controller.n}.")
    referenced = log.q_ref is not None
    if not referenced:
        notes.append(
            "The log has no references: the simulated robot follows the filtered measured "
            "positions, so that what noise the filter leaves is in its references."
        )
    goal = _goal(system) if given is None else given
    needed = stiff.steps(log.dt, goal)
    parts, hold = steps_of(controller, log.dt, min(needed, MOST) if substeps is None else substeps)
    if (parts < needed and substeps is None) or not stiff.stable(log.dt / parts):
        notes.append(stiff.sentence(log.dt, parts, goal))
    if given is None:
        rest = stiff.width(log.dt / parts)
        given = np.where(rest > 0.0, np.maximum(system.processing.dead_band, rest), 0.0)
    targets = log.q if log.q_ref is None else log.q_ref
    reach = np.maximum(np.ptp(targets, axis=0), _NEAR)
    return ClosedLoop(controller, given, reach, hold, parts, referenced, tuple(notes))


def robot_of(system: Equations, values: ArrayLike) -> RobotModel:
    """Robot of the base parameters alone. Shapes: values (b,)."""
    base, model = system.base, system.model
    found = dict(zip(system.names, as_exact(values, (len(system.names),), "values"), strict=True))
    whole = np.array([found.get(name, 0.0) for name in base.names])
    robot = base_model(model, base, whole)
    kinds = drive_kinds(base.drive)
    own = {kind.value: getattr(robot.drive, kind.value) for kind in kinds}
    robot = robot.with_drive(DriveParameters(**{"Ia": np.zeros(model.n), **own}))
    if (K := robot.transmission) is not None:
        names = [kind.coupling for kind in kinds if kind.coupling is not None]
        terms = {name: getattr(K, name) for name in names}
        robot = robot.with_transmission(Transmission(K.matrix, K.offset, **terms))
    return robot


def steps_of(controller: Controller, dt: float, substeps: int) -> tuple[int, int]:
    """Numbers of integration steps per sample and per controller period."""
    if not isinstance(substeps, (int, np.integer)) or substeps < 1:
        raise InvalidValueError(f"substeps: expected a whole number from 1, got {substeps!r}.")
    period = dt if controller.period is None else controller.period
    samples, parts = period / dt, dt / period
    if abs(samples - round(samples)) <= 1e-6 * samples:
        return int(substeps), int(substeps) * round(samples)
    if abs(parts - round(parts)) <= 1e-6 * parts:
        whole = -(-int(substeps) // round(parts)) * round(parts)
        return whole, whole // round(parts)
    raise InvalidValueError(
        f"period: expected a multiple or a whole part of that of the log ({dt:g} s), got "
        f"{period:g} s."
    )


def _checked_width(width: ArrayLike, n: int) -> Array:
    chosen = as_floats(width, "width")
    if chosen.shape not in ((), (n,)) or (chosen < 0.0).any():
        raise ShapeError(f"width: expected one velocity or shape ({n},), none negative.")
    return np.broadcast_to(chosen, (n,))


def _goal(system: Equations) -> Array:
    """Widths of dry friction that lose few equations: the dead band, or a part of the speed."""
    log, motion = system.log, system.processing.motion
    stride = max(1, min(int(0.1 / max(motion * log.dt, 1e-9)), len(log) - 1))
    rows = np.arange(0, len(log) - stride, max(1, len(log) // _LOOKED))
    if not rows.size:
        return system.processing.dead_band
    targets = log.q if log.q_ref is None else log.q_ref
    speeds = np.abs(targets[rows + stride] - targets[rows]) / (stride * log.dt)
    # the few that lie across two recordings do not count
    return np.maximum(system.processing.dead_band, _SLOW * np.percentile(speeds, 95, axis=0))
