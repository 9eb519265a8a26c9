"""Robots with kinematic loops: closures, reduced models, dynamics, base parameters.

A robot with loops is the spanning tree that is left when each loop is cut, and the closures of
the cuts. Throughout, ``robot`` is a `LoopedRobot` of n joints, n_a of them actuated, with c
constraint rows; ``q, v, a`` (..., n) are variables of all joints of the tree, rad or m, which close
the loops, their velocities and accelerations; ``tau`` (..., n_a) are torques of the actuated
joints, N m or N. Arguments of the wrong shape or with NaN raise ShapeError or InvalidValueError;
open loops, and actuated joints that do not determine the others, LoopError.
"""

from .. import _docs
from ..errors import LoopError
from .closing import ClosedPostures, ClosingStatus, close
from .constraints import Mobility, closure_jacobian, mobility, velocity_map, velocity_map_rate
from .dynamics import closure_forces, ddm, idm
from .parameters import LoopedParameters as LoopedParameters
from .parameters import base_parameters, torque_regressor
from .read import read_mjcf, read_par
from .robot import Closure, LoopedRobot
from .simulation import simulate

__all__ = ["Closure", "LoopedRobot", "LoopError", "read_par", "read_mjcf", "close"]
__all__ += ["ClosedPostures", "ClosingStatus", "mobility", "Mobility", "closure_jacobian"]
__all__ += ["velocity_map", "velocity_map_rate", "idm", "ddm", "closure_forces", "simulate"]
__all__ += ["torque_regressor", "base_parameters"]

_docs.document(__name__)
