"""Base inertial parameters: the fewest that give the same torques, by rules and by numbers.

Seed book section 1.5.3.
"""

from .find import base_parameters
from .result import BaseMethod, BaseParameters

__all__ = ["BaseMethod", "BaseParameters", "base_parameters"]
