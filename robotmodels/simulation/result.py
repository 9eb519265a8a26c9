"""Result of a simulation: motion, loads, energy balance, events and status.

Examples
--------
>>> print(SimulationEvent(SimulationEventKind.STUCK, 0.25, 1))
0.25 s: joint 2 comes to rest and sticks
>>> Integrator("Radau").name
'RADAU'
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .._outcomes import Outcome, Result
from ..model import RobotModel

_RESTS, _LEAST = 1e-6, 1e-9  # least scale of drifts: relative to the potential energy, and in J


class SimulationStatus(Outcome):
    """Outcome of a simulation; fits int8. The motion until then is given for every status."""

    FINISHED = 0, "The motion was followed to its end."
    LIMIT_REACHED = 1, "A joint reached one of its limits, where the motion was to be stopped."
    NOT_CONVERGED = 2, "The allowed evaluations of the model were used up before the end."
    STEP_TOO_SMALL = 3, "The steps became too small: the motion has no bound, or the torques jump."
    SINGULAR = 4, "The mass matrix became singular: the accelerations are not unique."
    CHATTERING = 5, "Joints stick and slip again at the same instant without end."


class Integrator(Enum):
    """Integrators of SciPy.

    ``DOP853`` and ``RK45`` are explicit Runge-Kutta methods of order 8 and 5; ``RADAU`` (order 5)
    and ``BDF`` (order 1 to 5) are implicit, for stiff models: springs in the control, narrow
    smoothing of dry friction, large viscous friction on small inertia.
    """

    DOP853 = "DOP853"
    RK45 = "RK45"
    RADAU = "Radau"
    BDF = "BDF"


class SimulationEventKind(Outcome):
    """Kinds of events of a simulation."""

    STUCK = 0, "comes to rest and sticks"
    BROKE_AWAY = 1, "breaks away"
    REVERSED = 2, "reverses without sticking"
    LIMIT = 3, "reaches a limit"


@dataclass(frozen=True, slots=True)
class SimulationEvent:
    """Event at t (s) of a joint (from 0), or of the shaft of a motor that several joints turn."""

    kind: SimulationEventKind
    t: float
    joint: int
    motor: bool = False

    def __str__(self) -> str:
        what = "the shaft of motor" if self.motor else "joint"
        return f"{self.t:.6g} s: {what} {self.joint + 1} {self.kind.sentence}"


@dataclass(frozen=True, slots=True, eq=False)
class Simulation(Result):
    """Simulated motion of a robot. Read-only.

    At every sample ``M a + C v + g + offset + friction + J^T wrench = tau``.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    t : ndarray, shape (N,)
        Times, s; they end early if the simulation did.
    q, v, a, tau : ndarray, shape (N, n)
        Positions (rad or m), velocities, accelerations, torques of the control (N m or N).
    friction : ndarray, shape (N, n)
        Torques of viscous and dry friction, without the drives' offsets; for a joint that sticks,
        the reaction that holds it.
    sticking : ndarray of bool, shape (N, n)
        Joints that dry friction holds at rest.
    kinetic, potential, control_work, friction_work, wrench_work : ndarray, shape (N,)
        Energies, J, rotors included; work since the start, J: of the control, on friction and the
        drives' offsets, and of the tool on the environment.
    drive, events, status, evaluations, steps
        Whether drives took part; stick, slip and limits in the order of time; why it ended;
        evaluations of the model and steps of the integrator.
    state : ndarray, shape (N, k)
        State of the control law; k = 0 without one.
    """

    model: RobotModel
    t: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    friction: Array
    sticking: NDArray[np.bool_]
    kinetic: Array
    potential: Array
    control_work: Array
    friction_work: Array
    wrench_work: Array
    drive: bool
    events: tuple[SimulationEvent, ...]
    status: SimulationStatus
    evaluations: int
    steps: int
    state: Array

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.q.shape[1]

    @property
    def duration(self) -> float:
        """Simulated time, s."""
        return float(self.t[-1] - self.t[0])

    @property
    def energy(self) -> Array:
        """Kinetic plus potential energy, J, shape (N,)."""
        return self.kinetic + self.potential

    @property
    def drift(self) -> Array:
        """Error of the energy balance since the start, J, shape (N,): that of the integration."""
        change = (self.kinetic - self.kinetic[0]) + (self.potential - self.potential[0])
        return change - self.control_work + self.friction_work + self.wrench_work

    @property
    def energy_turnover(self) -> float:
        """Largest of kinetic energy, change of potential energy and works at any sample, J."""
        works = self.control_work, self.friction_work, self.wrench_work
        parts = self.kinetic, self.potential - self.potential[0], *works
        return max(float(np.abs(part).max()) for part in parts)

    @property
    def relative_drift(self) -> float:
        """Largest drift, relative to the turnover (at least 1e-6 potential energies and 1e-9 J)."""
        least = max(_RESTS * float(np.abs(self.potential).max()), _LEAST)
        return float(np.abs(self.drift).max()) / max(self.energy_turnover, least)

    def __repr__(self) -> str:
        return f"<Simulation of {self.model.name!r}, {len(self.t)} samples: {self.reason()}>"

    def __str__(self) -> str:
        lines = [
            f"{self.model.name}: {self.duration:.6g} s, steps: {self.steps}, evaluations of the "
            f"model: {self.evaluations}",
            self.reason(),
            f"energy drift {self.drift[-1]:.2g} J, {self.relative_drift:.2g} of the energy "
            "turnover",
            *map(str, self.events[:10]),
        ]
        more = len(self.events) - 10
        return "\n".join([*lines, f"more events: {more}"] if more > 0 else lines)
