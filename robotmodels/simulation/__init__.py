"""Simulation: the motion under given torques, and the parts of the torques of a motion.

Book sections 1.5 and 1.5.1. `simulate` integrates the direct dynamic model with SciPy's
adaptive integrators; dry friction sticks and slips at events. Nothing of SciPy is imported before
the first call.
"""

from .. import _docs
from .dynamics_map import DynamicsMap, dynamics_map
from .feedback import StatefulControl
from .result import (
    Integrator,
    Simulation,
    SimulationEvent,
    SimulationEventKind,
    SimulationStatus,
)
from .simulate import simulate
from .torque_parts import TorqueParts, simulated_torque_parts, torque_parts

__all__ = [
    "DynamicsMap",
    "Integrator",
    "Simulation",
    "SimulationEvent",
    "SimulationEventKind",
    "SimulationStatus",
    "StatefulControl",
    "TorqueParts",
    "dynamics_map",
    "simulate",
    "simulated_torque_parts",
    "torque_parts",
]

_docs.document(__name__)
