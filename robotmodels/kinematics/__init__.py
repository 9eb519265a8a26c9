"""Kinematic models: poses, velocities, Jacobians, and what becomes of them near singular positions.

Seed book sections 1.2.2 and 1.3.
"""

from .jacobians import Reference, jacobian, jacobian_rate
from .poses import dgm, link_poses
from .velocities import dkm

__all__ = ["Reference", "dgm", "dkm", "jacobian", "jacobian_rate", "link_poses"]
