"""Methods that simulate the controlled robot: instruments, DIDIM, output error, and a test."""

from .controller import Controller, tuned_controller
from .hausman import hausman_test
from .methods import Didim, Instrumental, OutputError
from .simulation import simulated_log

__all__ = [
    "Controller",
    "Didim",
    "Instrumental",
    "OutputError",
    "hausman_test",
    "simulated_log",
    "tuned_controller",
]
