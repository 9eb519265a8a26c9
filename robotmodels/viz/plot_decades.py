"""Logarithmic axes with few labels in plain figures."""

from __future__ import annotations

from typing import Any


def plain_decades(axis: Any, most: int) -> None:
    """Powers of ten as numbers, without the ticks between them."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    axis.set_major_locator(LogLocator(numticks=most))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _=None: f"{value:g}"))
