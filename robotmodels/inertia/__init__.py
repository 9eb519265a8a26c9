"""Inertial parameters of the links, and their physical consistency."""

from .. import _docs
from .consistency import ConsistencyReport, InertiaWarning, LinkFinding
from .parameters import PARAMETERS, InertialParameters

__all__ = [
    "ConsistencyReport",
    "InertiaWarning",
    "InertialParameters",
    "LinkFinding",
    "PARAMETERS",
]

_docs.document(__name__)
