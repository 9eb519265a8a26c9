"""All colours, of scenes and of figures, and the legend that says which is which."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..errors import InvalidValueError, ShapeError
from ..visual import Color

# Distinct also for colour-blind readers: Okabe and Ito's eight, the black one as a grey.
_BRIGHT: tuple[Color, ...] = (
    (0.00, 0.45, 0.70, 1.0), (0.90, 0.60, 0.00, 1.0), (0.00, 0.62, 0.45, 1.0),
    (0.80, 0.40, 0.00, 1.0), (0.80, 0.47, 0.65, 1.0), (0.34, 0.71, 0.91, 1.0),
    (0.85, 0.78, 0.15, 1.0), (0.35, 0.35, 0.35, 1.0),
)  # fmt: skip
_DARK = 0.45

PALETTE: tuple[Color, ...] = (
    *_BRIGHT,
    *((_DARK * r, _DARK * g, _DARK * b, a) for r, g, b, a in _BRIGHT),
)
"""Sixteen colours: eight hues, then the same ones dark, for the 16 postures of a general arm."""

# Okabe and Ito's hues, of such lightness that any two of them, and any of them and ink, red and
# grey, are at least 17 apart (CIE 1976) for eyes without one of the three kinds of cones as well.
# Those that are farthest apart come first, yellow, which is pale on white, last.
_LINES: tuple[Color, ...] = (
    (0.02, 0.32, 0.63, 1.0), (0.86, 0.27, 0.04, 1.0), (0.00, 0.72, 0.33, 1.0),
    (0.74, 0.53, 0.78, 1.0), (0.41, 0.28, 0.35, 1.0), (0.37, 0.61, 0.98, 1.0),
    (1.00, 0.49, 0.00, 1.0), (0.72, 0.78, 0.28, 1.0),
)  # fmt: skip

LINE_COLORS: tuple[Color, ...] = (
    *_LINES,
    *((_DARK * r, _DARK * g, _DARK * b, a) for r, g, b, a in _LINES),
)
"""Of lines on white paper: eight hues, then the same ones dark. Lines differ in dashes as well."""

INK: Color = (0.1, 0.1, 0.1, 1.0)
PALE: Color = (0.51, 0.51, 0.51, 1.0)
ALERT: Color = (0.67, 0.13, 0.20, 1.0)
"""Texts and totals; helping lines; what lies beyond a limit."""

BAND: Color = (0.88, 0.88, 0.88, 1.0)
GRID: Color = (0.92, 0.92, 0.92, 1.0)
"""Areas behind the data; the grid."""

SIGNED_MAP, POSITIVE_MAP = "PuOr", "viridis"
"""Matplotlib's names of the maps of values with and without sign, for colour-blind readers too."""

Legend = tuple[tuple[str, Color], ...]
"""Entries of a legend: a text and the colour it stands for."""


def as_legend(texts: Any, colors: Sequence[Color | None]) -> Legend:
    """Texts beside the colours they explain."""
    if texts is None:
        return ()
    if isinstance(texts, str) or not hasattr(texts, "__len__") or not hasattr(texts, "__iter__"):
        raise InvalidValueError(f"legend: expected a list of texts, got {type(texts).__name__}.")
    words = [str(text) for text in texts]
    if len(words) != len(colors):
        raise ShapeError(
            f"legend: expected one text for each of the {len(colors)} postures drawn, got "
            f"{len(words)}."
        )
    own: Color = (0.72, 0.74, 0.78, 1.0)
    return tuple((text, color or own) for text, color in zip(words, colors, strict=True))
