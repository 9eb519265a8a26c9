"""The command line: ``robotmodels demo | robots | info | igm | view``, each with ``--help``."""

from .main import main

__all__ = ["main"]
