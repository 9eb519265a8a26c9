"""Control in free and constrained space (chapter 5): laws as values, and their simulation.

A law is a frozen value with ``command(t, q, v, x) -> tau``, its state ``state0``, and ``rate(t, q,
v, x)``, the derivative of the state; laws that use forces take the measured ``wrench`` last.
"""

from .force import ConstrainedDecoupling, ExternalForceLoop, ForceTracking, ParallelHybrid
from .joint_laws import (
    AdaptiveSlotineLi,
    DecentralizedPID,
    Passivity,
    PDGravity,
    PIDGains,
    pid_gains,
    slotine_li_regressor,
)
from .run import ControlledMotion, ControlStatus, run
from .sliding import SlidingMode, SuperTwisting, first_order
from .task_laws import Admittance, ComputedTorque, Impedance
from .walls import SpringWall

__all__ = [
    "AdaptiveSlotineLi",
    "Admittance",
    "ComputedTorque",
    "ConstrainedDecoupling",
    "ControlStatus",
    "ControlledMotion",
    "DecentralizedPID",
    "ExternalForceLoop",
    "ForceTracking",
    "Impedance",
    "PDGravity",
    "PIDGains",
    "ParallelHybrid",
    "Passivity",
    "SlidingMode",
    "SpringWall",
    "SuperTwisting",
    "first_order",
    "pid_gains",
    "run",
    "slotine_li_regressor",
]
