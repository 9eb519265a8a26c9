"""Robots with kinematic loops: closures, reduced models, dynamics, base parameters.

A robot with loops is the spanning tree that is left when each loop is cut, and the closures of
the cuts. Joint variables are those of all joints of the tree.
"""

from ..errors import LoopError
from .closing import ClosedPostures, ClosingStatus, close
from .constraints import Mobility, closure_jacobian, mobility, velocity_map, velocity_map_rate
from .dynamics import closure_forces, ddm, idm
from .parameters import LoopedParameters as LoopedParameters
from .parameters import base_parameters, torque_regressor
from .read import read_mjcf, read_par
from .robot import Closure, LoopedRobot
from .simulation import simulate

__all__ = [
    "Closure",
    "LoopedRobot",
    "LoopError",
    "read_par",
    "read_mjcf",
    "close",
    "ClosedPostures",
    "ClosingStatus",
    "mobility",
    "Mobility",
    "closure_jacobian",
    "velocity_map",
    "velocity_map_rate",
    "idm",
    "ddm",
    "closure_forces",
    "simulate",
    "torque_regressor",
    "base_parameters",
]
