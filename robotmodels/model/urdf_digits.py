"""Whether a URDF keeps the inertia of a link: it is stated about the centre of mass there."""

from __future__ import annotations

import numpy as np

from .._arrays import Array
from ..urdf.write import holds_inertia

_SMALLEST_MASS = 1e-12


def keeps_inertia(row: Array) -> bool:
    """Whether ten parameters survive the way through a URDF, so that Pinocchio may have them."""
    return holds_inertia(row) and _keeps_digits(row)


def _keeps_digits(row: Array) -> bool:
    """Whether ten parameters survive the way through the centre of mass, where a URDF has them.

    First moments over hardly any mass, as identification may give them, put the centre of mass
    far away: the tensor about it is so large that the digits of the one about the origin cancel.
    """
    M, moments = row[9], row[6:9]
    if 0.0 < M < _SMALLEST_MASS:
        return False  # Pinocchio takes masses below its epsilon for zero in sums
    # up to two digits, for a robot of about a metre
    with np.errstate(over="ignore"):  # masses near the largest float
        return bool(moments @ moments <= 100.0 * M * (np.abs(row[:6]).sum() + M))
