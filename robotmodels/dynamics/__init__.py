"""Inverse and direct dynamic models and their parts.

Seed book section 1.5. One sample goes through Pinocchio, a batch through the compiled recursions
in table order; so does every model that Pinocchio cannot hold (first moments without mass,
negative mass, as in sets of base parameters).
"""

from .coriolis import christoffel_blocks, coriolis_matrix
from .direct import ddm
from .energies import kinetic_energy, potential_energy
from .gravity import gravity_torque
from .inverse import idm
from .mass import mass_matrix

__all__ = [
    "christoffel_blocks",
    "coriolis_matrix",
    "ddm",
    "gravity_torque",
    "idm",
    "kinetic_energy",
    "mass_matrix",
    "potential_energy",
]
