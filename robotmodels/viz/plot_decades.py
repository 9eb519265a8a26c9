"""Logarithmic axes with few labels in plain figures."""

from __future__ import annotations

from typing import Any


def plain_decades(axis: Any, most: int) -> None:
    """Powers of ten as numbers, without the ticks between them.

    Parameters
    ----------
    axis : matplotlib.axis.Axis
        A logarithmic one.
    most : int
        Labels.

    Examples
    --------
    >>> from robotmodels.viz.figures import new_figure, panels
    >>> axes = panels(new_figure(3.5, 2.0), 1)[0, 0]
    >>> _ = axes.semilogy([0.01, 1.0, 100.0])
    >>> plain_decades(axes.yaxis, 4)
    >>> axes.yaxis.get_major_formatter()(0.01)
    '0.01'
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    axis.set_major_locator(LogLocator(numticks=most))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _=None: f"{value:g}"))
