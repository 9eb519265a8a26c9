"""Ctrl-C that falls where Python cannot raise it, in a callback of compiled code."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from typing import Any


@contextlib.contextmanager
def noticed() -> Iterator[Callable[[], bool]]:
    """Keep interrupts that Python would print and forget, while it lasts.

    The first call of a model compiles for a while, and LLVM calls back into Python meanwhile. An
    interrupt there is lost, and what it cut off fails later as some other error.

    Yields
    ------
    callable
        Whether one has been lost.

    Examples
    --------
    >>> with noticed() as lost:
    ...     lost()
    False
    """
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
