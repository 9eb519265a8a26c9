"""Robots with kinematic loops: closures, reduced models, dynamics, base parameters.

A robot with loops is the spanning tree that is left when each loop is cut, and the closures of
the cuts. Joint variables are those of all joints of the tree.
"""

from ..errors import LoopError
from .closing import ClosedPostures, ClosingStatus, close
from .constraints import Mobility, closure_jacobian, mobility, velocity_map, velocity_map_rate
from .robot import Closure, LoopedRobot

__all__ = [
    "Closure",
    "LoopedRobot",
    "LoopError",
    "close",
    "ClosedPostures",
    "ClosingStatus",
    "mobility",
    "Mobility",
    "closure_jacobian",
    "velocity_map",
    "velocity_map_rate",
]
