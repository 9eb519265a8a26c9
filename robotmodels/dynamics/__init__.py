"""Inverse and direct dynamic models and their parts.

Book section 1.5. One sample goes through Pinocchio, a batch through the compiled recursions
in table order; so does every model that Pinocchio does not support (first moments without mass,
negative mass, as in sets of base parameters).

Parameters
----------
model : RobotModel
    The robot, n joints, f frames.
q, v, a, tau : array_like, shape (..., n)
    Joint variables (rad or m), velocities, accelerations and torques; the leading axes broadcast.
wrench : array_like, shape (..., 6), optional
    Force and moment ``[f; m]`` (N, N m) that the tool exerts on the environment, at the tool
    point, in world axes.
drive : bool
    Whether rotor inertia (that of coupled motors too), friction and offsets of the model's drives
    take part, as far as the quantity has them.
friction : Friction, optional
    A friction model that acts besides the Fv, Fc and offset of the drives, see
    `robotmodels.friction`; ``model.with_drive(...)`` removes those.
base : BaseParameters
    The b base parameters; drive parameters of the kinds that are not among them are the model's,
    and friction acts besides the one whose parameters are among them.
values : array_like, shape (b,)
    Their values, such as identified ones or ``base.values(model)``.
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
