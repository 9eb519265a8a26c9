"""Friction models of the joints, in addition to the viscous and Coulomb terms of `DriveParameters`.

Book section 1.5.1.4. A model is a value with ``.torque(v)``; where the torque is linear in
the parameters, ``.basis(v)`` gives the columns that multiply them, for identification. Gravity
compensators have the same interface; their torque depends on positions, ``.torque(v, q)``.
"""

from .. import _docs
from .compensator import GravityCompensator
from .models import (
    AsymmetricFriction,
    CoulombFriction,
    LoadFriction,
    StribeckFriction,
    TorqueOffset,
    ViscousFriction,
)
from .protocols import Friction, FrictionSum, LinearFriction
from .protocols import check_friction as check_friction
from .protocols import check_linear as check_linear

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
]

_docs.document(__name__)
