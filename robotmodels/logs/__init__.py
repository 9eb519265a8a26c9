"""Logs of robots: what was recorded, read from files, checked and brought to SI on the joint side.

Seed book sections 1.6.2.4 and 1.6.2.5.
"""

from .log import Log, LogSource, RefusedRows

__all__ = [
    "Log",
    "LogSource",
    "RefusedRows",
]
