"""Base inertial parameters (the minimal set), by symbolic rules and numerically.

Book section 1.5.3.
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
