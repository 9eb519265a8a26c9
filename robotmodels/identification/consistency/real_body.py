"""The real body whose ten parameters fit equations best.

Source: P. Wensing, S. Kim and J.-J. Slotine, "Linear matrix inequalities for physically consistent
inertial parameter identification", IEEE RA-L 3(1), 2018, (7).
"""

from __future__ import annotations

import numpy as np

from ..._arrays import Array
from ...estimation.conic import Cone, ConeOutcome, Constraint, solve_cones, triangle_of
from ...inertia import InertialParameters
from ...minimal_parameters.prior import pseudo_inertias

_MARGIN = 1e-7
"""Smallest eigenvalue of the pseudo-inertia, relative to that of a body of the load's size."""
_UNIQUE = 1e-12
"""Weight of what makes parameters unique that the equations do not show."""
_RADIUS = 0.1
"""Metres: size of a body, for units."""


def nearest_body(F: Array, t: Array) -> Array | None:
    """Physically consistent inertial parameters with the least ``|F x - t|``.

    Shapes: F (k, 10), t (k,) -> (10,).
    """
    free = np.linalg.lstsq(F / _units(1.0), t, rcond=1e-12)[0]
    mass = max(float(np.abs(free).max(initial=0.0)), 1e-6)
    unit = _units(mass)
    whiten = np.diag([1.0 / _RADIUS] * 3 + [1.0]) / np.sqrt(mass)
    basis = pseudo_inertias(InertialParameters(np.eye(10)))
    maps = np.stack([whiten @ B @ whiten for B in basis])
    real = Constraint(
        Cone.SEMIDEFINITE, -triangle_of(maps).T, -_MARGIN * triangle_of(np.eye(4)),
        ("The pseudo-inertia of the load is singular to the margin.",),
    )  # fmt: skip
    size = float(np.abs(F * unit).max(initial=0.0)) or 1.0
    found = solve_cones(
        np.diag(_UNIQUE / unit**2), np.zeros(10), [real], unit, fit=(F / size, t / size)
    )
    return found.x if found.outcome is ConeOutcome.SOLVED else None


def _units(mass: float) -> Array:
    return mass * np.array([_RADIUS**2] * 6 + [_RADIUS] * 3 + [1.0])
