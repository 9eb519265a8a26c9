"""Inverse geometric models: poses to joint variables, with a status for every pose."""

from .inverse import igm
from .numeric import igm_numeric
from .solutions import IGMSolutions
from .status import IGMStatus

__all__ = [
    "IGMSolutions",
    "IGMStatus",
    "igm",
    "igm_numeric",
]
