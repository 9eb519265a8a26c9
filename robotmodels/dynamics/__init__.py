"""Inverse and direct dynamic models and their parts.

Book section 1.5. One sample goes through Pinocchio, a batch through the compiled recursions
in table order; so does every model that Pinocchio does not support (first moments without mass,
negative mass, as in sets of base parameters).
"""

from .. import _docs
from .direct import ddm
from .from_base import base_model, idm_from_base
from .inverse import idm
from .parts import (
    christoffel_blocks,
    coriolis_matrix,
    gravity_torque,
    kinetic_energy,
    mass_matrix,
    potential_energy,
)
from .payload import with_payload, without_payload

__all__ = [
    "base_model",
    "christoffel_blocks",
    "coriolis_matrix",
    "ddm",
    "gravity_torque",
    "idm",
    "idm_from_base",
    "kinetic_energy",
    "mass_matrix",
    "potential_energy",
    "with_payload",
    "without_payload",
]

_docs.document(__name__)
