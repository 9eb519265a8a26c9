"""The command line: ``robotmodels COMMAND``, one file a command, each with ``--help``."""

from .main import main

__all__ = ["main"]
