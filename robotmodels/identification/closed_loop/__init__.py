"""Methods that simulate the controlled robot: instruments, DIDIM, output error, and a test."""

from .controller import Controller, tuned_controller
from .hausman import HausmanResult, hausman_test
from .method import SimulationDetails
from .methods import Didim, Instrumental, OutputError
from .simulation import simulated_log

__all__ = [
    "Controller",
    "Didim",
    "HausmanResult",
    "Instrumental",
    "OutputError",
    "SimulationDetails",
    "hausman_test",
    "simulated_log",
    "tuned_controller",
]
