"""Operational coordinates: forms of a pose as numbers, and their rates.

Seed book section 1.2.2, eq. [1.5] to [1.9], and section 1.3.1.1.
"""

from .conversion import continuous_coordinates, operational_coordinates, pose_from_coordinates
from .orientations import OrientationKind
from .rates import (
    coordinate_jacobian,
    coordinate_jacobian_rate,
    coordinate_rates,
    coordinate_rates_rate,
    is_representation_singular,
    twist_from_rates,
)

__all__ = [
    "OrientationKind",
    "continuous_coordinates",
    "coordinate_jacobian",
    "coordinate_jacobian_rate",
    "coordinate_rates",
    "coordinate_rates_rate",
    "is_representation_singular",
    "operational_coordinates",
    "pose_from_coordinates",
    "twist_from_rates",
]
