"""Robots with kinematic loops: closures, reduced models, dynamics, base parameters.

A robot with loops is the spanning tree that is left when each loop is cut, and the closures of
the cuts. Arguments of the wrong shape or with NaN raise ShapeError or InvalidValueError; open
loops, and actuated joints that do not determine the others, LoopError.

Parameters
----------
robot : LoopedRobot
    The robot: n joints, n_a of them actuated, c constraint rows.
q, v, a : array_like, shape (..., n)
    Variables of all joints of the tree, rad or m, which close the loops, their velocities and
    accelerations.
tau : array_like, shape (..., n_a)
    Torques of the actuated joints, N m or N.
wrench : array_like, shape (..., 6), optional
    Wrench ``[f; m]`` of the tool of the tree on the environment, as for `robotmodels.idm`.
drive : bool
    Whether the drives of all joints take part.
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
