"""Inertial parameters of the links, and their physical consistency."""

from .consistency import ConsistencyReport, InertiaWarning, LinkFinding
from .parameters import PARAMETERS, InertialParameters

__all__ = [
    "ConsistencyReport",
    "InertiaWarning",
    "InertialParameters",
    "LinkFinding",
    "PARAMETERS",
]
