"""``robotmodels identify``: options, logs, choices for the fit, report."""

from .command import add_command, run

__all__ = ["add_command", "run"]
