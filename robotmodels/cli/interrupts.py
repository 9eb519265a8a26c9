"""Ctrl-C that falls where Python cannot raise it, in a callback of compiled code."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from typing import Any


@contextlib.contextmanager
def noticed() -> Iterator[Callable[[], bool]]:
    """Context that raises interrupts which Python would only print."""
    lost = False
    before = sys.unraisablehook

    def hook(unraisable: Any) -> None:
        nonlocal lost
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            lost = True
        else:
            before(unraisable)

    sys.unraisablehook = hook
    try:
        yield lambda: lost
    finally:
        sys.unraisablehook = before
