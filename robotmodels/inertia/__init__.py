"""Inertial parameters of the links, and whether a real body can have them."""

from .consistency import ConsistencyReport, InertiaWarning, LinkFinding
from .parameters import PARAMETERS, InertialParameters

__all__ = [
    "ConsistencyReport",
    "InertiaWarning",
    "InertialParameters",
    "LinkFinding",
    "PARAMETERS",
]
