"""Methods that simulate the controlled robot: instruments, DIDIM, output error, and a test."""

from .controller import Controller, tuned_controller
from .estimate import SimulatedEstimate
from .instrumental import instrumental
from .loop import ClosedLoop, closed_loop
from .simulated import simulated_log

__all__ = [
    "ClosedLoop",
    "Controller",
    "SimulatedEstimate",
    "closed_loop",
    "instrumental",
    "simulated_log",
    "tuned_controller",
]
