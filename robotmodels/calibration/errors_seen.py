"""How far prediction and measurement are apart: by block, in metres and radians."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._arrays import Array
from .measurements import Linearised
from .problem import Problem, linearised


class ErrorSummary(NamedTuple):
    """Size of residuals of one unit, over blocks: the length of their rows of that unit.

    Attributes
    ----------
    rms, mean, largest : float
        Root mean square, mean and largest length, m or rad.
    blocks : int
        How many blocks.

    Examples
    --------
    >>> summary_of(np.array([3.0, 4.0])).mean
    3.5
    """

    rms: float
    mean: float
    largest: float
    blocks: int


def summary_of(lengths: Array) -> ErrorSummary:
    """Summarise lengths of residuals. Shapes: lengths (B,)."""
    if not len(lengths):
        return ErrorSummary(np.nan, np.nan, np.nan, 0)
    return ErrorSummary(
        float(np.sqrt(np.mean(lengths**2))), float(lengths.mean()), float(lengths.max()),
        len(lengths),
    )  # fmt: skip


class BlockErrors(NamedTuple):
    """Lengths of the residuals of every block; NaN where a kind has no rows of the unit.

    Attributes
    ----------
    position, angle : ndarray, shape (B,)
        Metres; radians.

    Examples
    --------
    >>> BlockErrors(np.array([0.001]), np.array([np.nan])).summary("m").rms
    0.001
    """

    position: Array
    angle: Array

    def summary(self, unit: str) -> ErrorSummary:
        """Over the blocks that have rows of a unit, ``"m"`` or ``"rad"``."""
        values = self.position if unit == "m" else self.angle
        return summary_of(values[~np.isnan(values)])


def block_errors(problem: Problem, xi: Array, fixtures: Array) -> BlockErrors:
    """Lengths of residuals at given parameters; known distances are left out."""
    parts = linearised(problem, xi, fixtures)
    seen = [(m, part) for m, part in zip(problem.measurements, parts, strict=True) if m.views]
    if not seen:
        return BlockErrors(np.zeros(0), np.zeros(0))
    return BlockErrors(
        np.concatenate([_lengths(part, m.units, "m") for m, part in seen]),
        np.concatenate([_lengths(part, m.units, "rad") for m, part in seen]),
    )


def _lengths(part: Linearised, units: tuple[str, ...], unit: str) -> Array:
    of_unit = np.array([u == unit for u in units])
    if not of_unit.any():
        return np.full(len(part.residual), np.nan)
    return np.linalg.norm(part.residual[:, of_unit], axis=1)
