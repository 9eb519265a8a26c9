"""Control in free and constrained space (chapter 5): laws as values, and their simulation.

A law is a frozen value with ``command(t, q, v, x) -> tau``, its state ``state0``, and ``rate(t, q,
v, x)``, the derivative of the state; laws that use forces take the measured ``wrench`` last.

Throughout, ``model`` is the model of the robot of n joints that the controller uses. ``reference``
are positions (n,), or in task space a world pose (4, 4): a motion (`Trajectory`, `PoseTrajectory`),
a constant, or a function of t that returns (q, v, a) or (T, twist, acceleration). Gains are one
number, or one for each joint or component of the task (six are those of all components). Errors are
``e = q_d - q`` of the joints, or ``e = [p_d - p; log(R_d R^T)]`` of the tool in world axes;
wrenches ``[f; m]`` are those that the tool exerts on the environment, at the tool, in world axes.
Gains that are not positive, references for another number of joints and arguments of the wrong
shape raise InvalidValueError or ShapeError.
"""

from .. import _docs
from .force import (
    ConstrainedDecoupling,
    ExternalForceLoop,
    ForceTracking,
    ParallelHybrid,
    SpringWall,
)
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

__all__ = ["AdaptiveSlotineLi", "Admittance", "ComputedTorque", "ConstrainedDecoupling"]
__all__ += ["ControlStatus", "ControlledMotion", "DecentralizedPID", "ExternalForceLoop"]
__all__ += ["ForceTracking", "Impedance", "PDGravity", "PIDGains", "ParallelHybrid", "Passivity"]
__all__ += ["SlidingMode", "SpringWall", "SuperTwisting", "first_order", "pid_gains", "run"]
__all__ += ["slotine_li_regressor"]

_docs.document(__name__)
