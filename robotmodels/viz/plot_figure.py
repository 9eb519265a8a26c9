"""A Matplotlib figure that shows itself. Imported on demand: Matplotlib is an optional extra."""

from __future__ import annotations

from io import BytesIO

from matplotlib.figure import Figure


class PlotFigure(Figure):
    """A figure that a notebook shows, made without pyplot and without a display.

    IPython knows how to show a plain `matplotlib.figure.Figure` only once pyplot was imported.
    """

    def _repr_png_(self) -> bytes:
        buffer = BytesIO()
        self.savefig(buffer, format="png")
        return buffer.getvalue()
