"""How a simulation ended, which integrator made it, and what happened on its way."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from .._outcomes import Outcome


class SimulationStatus(Outcome):
    """Why a simulation ended; fits int8. What was reached comes with every status.

    Attributes
    ----------
    sentence : str
        What a person reads.

    Examples
    --------
    >>> SimulationStatus.FINISHED.sentence
    'The motion was followed to its end.'
    """

    FINISHED = 0, "The motion was followed to its end."
    LIMIT_REACHED = 1, "A joint reached one of its limits, where the motion was to be stopped."
    NOT_CONVERGED = 2, "The allowed evaluations of the model were used up before the end."
    STEP_TOO_SMALL = (
        3,
        "The steps became too small to go on: the motion grows without bound, or the torques jump.",
    )
    SINGULAR = 4, "The mass matrix became singular: there is no one acceleration to go on with."
    CHATTERING = 5, "Joints stick and slip again at the same instant without end."


class Integrator(Enum):
    """SciPy's integrators, by their names there.

    ``DOP853`` and ``RK45`` are explicit Runge-Kutta methods of order 8 and 5; ``RADAU`` (order 5)
    and ``BDF`` (order 1 to 5) are implicit, for stiff models: springs in the control, narrow
    smoothing of dry friction, large viscous friction on small inertia.

    Examples
    --------
    >>> Integrator("Radau")
    <Integrator.RADAU: 'Radau'>
    """

    DOP853 = "DOP853"
    RK45 = "RK45"
    RADAU = "Radau"
    BDF = "BDF"


class SimulationEventKind(Outcome):
    """What happened at an instant of a simulation.

    Attributes
    ----------
    sentence : str
        What a person reads.

    Examples
    --------
    >>> SimulationEventKind.STUCK.sentence
    'comes to rest and sticks'
    """

    STUCK = 0, "comes to rest and sticks"
    BROKE_AWAY = 1, "breaks away"
    REVERSED = 2, "reverses without sticking"
    LIMIT = 3, "reaches a limit"


@dataclass(frozen=True, slots=True)
class SimulationEvent:
    """Something that happened at an instant.

    Parameters
    ----------
    kind : SimulationEventKind
        What.
    t : float
        When, s.
    joint : int
        Column of q, from 0; of a coupled motor, the motor's own joint.
    motor : bool
        Whether it happened to the shaft of a motor that several joints turn, see `Transmission`.

    Examples
    --------
    >>> print(SimulationEvent(SimulationEventKind.STUCK, 0.25, 1))
    0.25 s: joint 2 comes to rest and sticks
    """

    kind: SimulationEventKind
    t: float
    joint: int
    motor: bool = False

    def __str__(self) -> str:
        what = "the shaft of motor" if self.motor else "joint"
        return f"{self.t:.6g} s: {what} {self.joint + 1} {self.kind.sentence}"
