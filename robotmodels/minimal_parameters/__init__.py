"""Base inertial parameters: the fewest that give the same torques, by rules and by numbers.

Seed book section 1.5.3.
"""

from .find import base_parameters
from .prior import uniform_bodies
from .result import BaseMethod, BaseParameters
from .standard import PhysicalStatus, StandardParameters, standard_parameters
from .values_table import BaseValues

__all__ = [
    "BaseMethod",
    "BaseParameters",
    "BaseValues",
    "PhysicalStatus",
    "StandardParameters",
    "base_parameters",
    "standard_parameters",
    "uniform_bodies",
]
