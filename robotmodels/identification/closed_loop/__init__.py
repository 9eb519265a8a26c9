"""Methods that simulate the controlled robot: instruments, DIDIM, output error, and a test."""

from .loop import Controller, tuned_controller
from .methods import Didim, Instrumental, OutputError, hausman_test
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
