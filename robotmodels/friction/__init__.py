"""Friction models of the joints, beside the viscous and Coulomb terms of `DriveParameters`.

Seed book section 1.5.1.4. A model is a value with ``.torque(v)``; where the torque is linear in
the parameters, ``.basis(v)`` gives the columns that multiply them, for identification. Gravity
compensators join them: their torque depends on positions, ``.torque(v, q)``.
"""

from .asymmetric import AsymmetricFriction
from .combined import FrictionSum
from .compensator import GravityCompensator
from .load import LoadFriction
from .plain import CoulombFriction, TorqueOffset, ViscousFriction
from .protocols import Friction, LinearFriction, check_friction, check_linear
from .stribeck import StribeckFriction

__all__ = [
    "AsymmetricFriction",
    "CoulombFriction",
    "Friction",
    "FrictionSum",
    "GravityCompensator",
    "LinearFriction",
    "LoadFriction",
    "StribeckFriction",
    "TorqueOffset",
    "ViscousFriction",
    "check_friction",
    "check_linear",
]
