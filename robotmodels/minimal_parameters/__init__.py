"""Base inertial parameters (the minimal set), by symbolic rules and numerically.

Book section 1.5.3.

Parameters
----------
model : RobotModel
    The robot, f frames and n joints; serial or tree, any base and gravity.
drive : bool or collection of DriveKind or str
    Drive parameters among the p standard ones: kinds such as ``"Ia"``, True for all (the offsets
    too), False for none; stored as a tuple of `DriveKind`. Couplings of motors belong to their
    kinds.
friction : Friction, optional
    A friction model that is linear in its parameters (`robotmodels.friction`), whose columns come
    after those of the drives.
base : BaseParameters
    b base parameters of p standard ones, with the drives and friction of the values or the factor.
"""

from .. import _docs
from .bodies import uniform_bodies
from .consistent import fit_consistent, standard_parameters
from .constraints import CenterOfMassBox, CenterOfMassEllipsoid
from .find import base_parameters
from .physical import PhysicalStatus
from .result import BaseMethod, BaseParameters
from .standard import StandardParameters
from .tables import BaseValues

__all__ = [
    "BaseMethod",
    "BaseParameters",
    "BaseValues",
    "CenterOfMassBox",
    "CenterOfMassEllipsoid",
    "PhysicalStatus",
    "StandardParameters",
    "base_parameters",
    "fit_consistent",
    "standard_parameters",
    "uniform_bodies",
]

_docs.document(__name__)
