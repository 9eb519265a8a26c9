"""Methods that simulate the controlled robot: instruments, DIDIM, output error, and a test."""

from .controller import Controller, tuned_controller
from .didim import didim
from .estimate import SimulatedEstimate
from .hausman import HausmanResult, hausman_test
from .instrumental import instrumental
from .loop import ClosedLoop, closed_loop
from .output_error import Output, output_error
from .simulated import simulated_log

__all__ = [
    "ClosedLoop",
    "Controller",
    "HausmanResult",
    "Output",
    "SimulatedEstimate",
    "closed_loop",
    "didim",
    "hausman_test",
    "instrumental",
    "output_error",
    "simulated_log",
    "tuned_controller",
]
