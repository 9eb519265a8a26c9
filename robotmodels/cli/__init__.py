"""The command line: ``robotmodels COMMAND``, one file for each command, each with ``--help``."""

from .program import main

__all__ = ["main"]
