"""Logs of robots: read from files, converted to SI on the joint side, and checked.

Book sections 1.6.2.4 and 1.6.2.5.
"""

from .. import _docs
from .checks import FindingKind, LogFinding, Severity, check_log
from .log import Log, join_logs, with_delay
from .read import read_log

__all__ = [
    "FindingKind",
    "Log",
    "LogFinding",
    "Severity",
    "check_log",
    "join_logs",
    "read_log",
    "with_delay",
]

_docs.document(__name__)
