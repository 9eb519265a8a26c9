"""What a simulation returns: the motion, what loads it, and its balance of energy."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..model import RobotModel
from .status import SimulationEvent, SimulationStatus

_RESTS = 1e-6  # of the potential energy: an arm that moves less of it is taken to be at rest
_LEAST = 1e-9  # J: drifts are measured against no less


@dataclass(frozen=True, slots=True, eq=False)
class Simulation:
    """A motion that follows from torques, with everything that is needed to check it.

    At every sample ``M a + C v + g + offset + friction + J^T wrench = tau``.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    t : ndarray, shape (N,)
        Times, s; they end early if the simulation did.
    q, v, a : ndarray, shape (N, n)
        Positions (rad or m), velocities, accelerations.
    tau : ndarray, shape (N, n)
        Torques of the control, N m or N.
    friction : ndarray, shape (N, n)
        Torques that friction takes up, viscous and dry together, without the drives' offsets. Of a
        joint that sticks it is what holds it.
    sticking : ndarray of bool, shape (N, n)
        Joints that dry friction holds at rest.
    kinetic, potential : ndarray, shape (N,)
        Energies, J; rotors included.
    control_work, friction_work, wrench_work : ndarray, shape (N,)
        Work since the start that the control did, that friction and the drives' offsets took, and
        that the tool did on the environment, J.
    drive : bool
        Whether the model's drives took part.
    events : tuple of SimulationEvent
        Stick, slip and limits, in the order of time.
    status : SimulationStatus
        How it ended.
    evaluations : int
        How often the model was evaluated.
    steps : int
        Steps of the integrator.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.simulation import simulate
    >>> fall = simulate(load("rx90"), np.zeros(6), np.zeros(6), t=0.2)
    >>> fall.status, bool(fall.relative_drift < 1e-9)
    (<SimulationStatus.FINISHED: 0>, True)
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

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.q.shape[1]

    @property
    def duration(self) -> float:
        """Simulated time, s."""
        return float(self.t[-1] - self.t[0])

    @property
    def reason(self) -> str:
        """The sentence of the status."""
        return self.status.sentence

    @property
    def energy(self) -> Array:
        """Kinetic and potential energy together, J, shape (N,)."""
        return self.kinetic + self.potential

    @property
    def drift(self) -> Array:
        """What the balance of energy has lost (-) or won (+) since the start, J, shape (N,).

        ``kinetic + potential - control work + friction work + wrench work``, less its value at
        the start: zero but for the errors of the integration.
        """
        change = (self.kinetic - self.kinetic[0]) + (self.potential - self.potential[0])
        return change - self.control_work + self.friction_work + self.wrench_work

    @property
    def energy_turnover(self) -> float:
        """Largest amount of energy that was moved, J.

        The largest of the kinetic energy, the change of the potential energy and the works of
        control, friction and tool, at any sample.
        """
        parts = (
            np.abs(self.kinetic), np.abs(self.potential - self.potential[0]),
            np.abs(self.control_work), np.abs(self.friction_work), np.abs(self.wrench_work),
        )  # fmt: skip
        return max(float(part.max()) for part in parts)

    @property
    def relative_drift(self) -> float:
        """Largest drift, relative to the energy that was moved.

        Its scale is `energy_turnover`, but at least a millionth of the largest potential energy
        (where the arm hardly moves, the drift is a rounding error of that energy) and at least
        1e-9 J (a thousand times the default absolute tolerance of a step). An arm that stays at
        rest has so a relative drift of zero, or next to it, and not the ratio of two rounding
        errors.
        """
        floor = max(_RESTS * float(np.abs(self.potential).max()), _LEAST)
        return float(np.abs(self.drift).max()) / max(self.energy_turnover, floor)

    @property
    def drift_rate(self) -> float:
        """Total drift per second of simulated time, W."""
        return float(self.drift[-1]) / self.duration if self.duration > 0.0 else 0.0

    def __reduce__(self) -> tuple[Any, ...]:  # rebuilt, so that a copy is read-only as well
        return type(self), tuple(getattr(self, field.name) for field in fields(self))

    def __str__(self) -> str:
        lines = [
            f"{self.model.name}: {self.duration:.6g} s in {_counted(self.steps, 'step')}, "
            f"{_counted(self.evaluations, 'evaluation')} of the model",
            self.reason,
            f"energy drift {self.drift[-1]:.2g} J, {self.drift_rate:.2g} W, "
            f"{self.relative_drift:.2g} of the energy moved",
        ]
        shown = self.events[:10]
        lines += [str(event) for event in shown]
        if len(self.events) > len(shown):
            lines.append(f"and {_counted(len(self.events) - len(shown), 'more event')}")
        return "\n".join(lines)


def _counted(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
