"""Exciting trajectories: motions for the identification of base parameters.

Book section 1.6.2.3.
"""

from .exciting import exciting_trajectory
from .result import ExcitingTrajectory, write_trajectory

__all__ = ["ExcitingTrajectory", "exciting_trajectory", "write_trajectory"]
