"""The command line: ``robotmodels COMMAND``, one file a command, each with ``--help``."""

from .program import main

__all__ = ["main"]
