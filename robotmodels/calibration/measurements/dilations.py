"""Whether measurements determine the scale.

Source: Seed book section 1.4.5.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_exact
from .measurement import Measurement

_MEETING = 1e-9
"""Distances by which places miss each other, relative to the largest, that are rounding."""


def have_common_place(A: Array, b: Array) -> bool:
    """Whether ``A c = b`` has a solution: points, lines and planes that contain one place.

    Shapes: A (m, 3), b (m,).
    """
    if not len(b):
        return True
    c = np.linalg.lstsq(A, b, rcond=1e-10)[0]
    return bool(np.abs(A @ c - b).max() <= _MEETING * max(float(np.abs(b).max()), 1e-3))


def length_is_known(
    measurements: Iterable[Measurement], base_origin: ArrayLike | None = None
) -> bool:
    """Whether measurements give the scale of a robot, all of them together."""
    measurements = tuple(measurements)
    if any(m.knows_length for m in measurements):
        return True
    parts = [m.dilation_centres for m in measurements]
    if base_origin is not None:
        parts.append((np.eye(3), as_exact(base_origin, (3,), "base_origin")))
    A = np.concatenate([np.zeros((0, 3)), *(part[0] for part in parts)])
    b = np.concatenate([np.zeros(0), *(part[1] for part in parts)])
    return not have_common_place(A, b)
