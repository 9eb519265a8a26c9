"""Logs of robots: what was recorded, read from files, checked and brought to SI on the joint side.

Seed book sections 1.6.2.4 and 1.6.2.5.
"""

from .checks import check_log
from .findings import FindingKind, LogFinding, Severity
from .joining import join_logs, with_delay
from .log import Log, LogSource, RefusedRows
from .read import read_log
from .table import LogFormat

__all__ = [
    "FindingKind",
    "Log",
    "LogFinding",
    "LogFormat",
    "LogSource",
    "RefusedRows",
    "Severity",
    "check_log",
    "join_logs",
    "read_log",
    "with_delay",
]
