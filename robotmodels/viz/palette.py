"""Colours that tell postures or robots apart, and the legend that says which is which."""

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

Legend = tuple[tuple[str, Color], ...]
"""Entries of a legend: a text and the colour it stands for."""


def as_legend(texts: Any, colors: Sequence[Color | None]) -> Legend:
    """Texts beside the colours they explain.

    Parameters
    ----------
    texts : sequence of str, or None
        What the caller passed.
    colors : sequence of Color or None
        What is to be explained; None where a robot keeps its own colours.

    Returns
    -------
    tuple of (str, Color)
        Empty without texts.

    Raises
    ------
    ShapeError, InvalidValueError
        Not one text for each colour.

    Examples
    --------
    >>> as_legend(["elbow up"], [PALETTE[0]])
    (('elbow up', (0.0, 0.45, 0.7, 1.0)),)
    """
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
