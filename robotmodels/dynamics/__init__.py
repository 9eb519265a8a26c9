"""Inverse and direct dynamic models and their parts.

Seed book section 1.5. One sample goes through Pinocchio, a batch through the compiled recursions
in table order; so does every model that Pinocchio cannot hold (first moments without mass,
negative mass, as in sets of base parameters).
"""

from .coriolis import christoffel_blocks, coriolis_matrix
from .direct import ddm
from .energies import kinetic_energy, potential_energy
from .from_base import base_model, idm_from_base
from .gravity import gravity_torque
from .inverse import idm
from .mass import mass_matrix
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
