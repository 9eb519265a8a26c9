"""Exciting trajectories: motions for the identification of base parameters.

Book section 1.6.2.3.
"""

from .exciting import exciting_trajectory
from .files import write_trajectory
from .result import ExcitingTrajectory

__all__ = ["ExcitingTrajectory", "exciting_trajectory", "write_trajectory"]
