"""Rotation about a fixed axis: from one orientation to another by the shortest turn.

Seed book section 4.3 and eq. [1.9]: the orientation of a straight-line motion turns about one
axis, fixed in space, from the first orientation to the last.
"""

from __future__ import annotations

import numpy as np

from .._arrays import Array
from ..se3 import skew


def rotation_about(axis: Array, angle: Array) -> Array:
    """Rotations by an angle about a unit axis (Rodrigues' formula, seed eq. [1.9])."""
    K = skew(axis)
    angle = np.asarray(angle, dtype=np.float64)[..., None, None]
    # 1 - cos by the half angle, which keeps its digits at small angles
    return np.eye(3) + np.sin(angle) * K + (2.0 * np.sin(0.5 * angle) ** 2) * (K @ K)


def axis_and_angle(vector: Array) -> tuple[Array, Array]:
    """Unit axis and angle of rotation vectors; the axis of no rotation is z."""
    angle = np.linalg.norm(vector, axis=-1)
    turns = (angle > 0.0)[..., None]
    axis = np.where(turns, vector / np.where(turns, angle[..., None], 1.0), (0.0, 0.0, 1.0))
    return axis, angle
