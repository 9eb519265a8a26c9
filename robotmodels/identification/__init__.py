"""Dynamic identification: from a log file to a robot that predicts its torques.

Seed book section 1.6.
"""

from ..logs import Log, LogSource, RefusedRows

__all__ = [
    "Log",
    "LogSource",
    "RefusedRows",
]
