"""Uniform bodies along the links, pseudo-inertia matrices, and the check of a prior.

Source: P. Wensing, S. Kim and J.-J. Slotine, "Linear matrix inequalities for physically consistent
inertial parameter identification", IEEE RA-L 3(1), 2018.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..errors import InertiaError, InvalidValueError
from ..inertia import InertialParameters
from ..inertia.consistency import pseudo_inertia
from ..model import RobotModel, check_model
from ..se3 import skew

_SLENDERNESS = 0.08
"""Default radius of the bars, part of the summed lengths of the robot."""
_SINGULAR = 1e-12
"""Singularity tolerance of a pseudo-inertia: smallest eigenvalue relative to the largest."""


def uniform_bodies(
    model: RobotModel, mass: float, radius: float | None = None
) -> InertialParameters:
    """Uniform solids along the links: a prior for parameters without effect on the torques.

    Each link is a round bar with spherical ends from the origin of its frame to those of the frames
    it carries, and to the tool at the tip; a sphere where it has no length. All have one density.

    Parameters
    ----------
    mass : float
        Mass of all moving links together, kg.
    radius : float, optional
        Radius of the bars, metres; default 0.08 of the summed lengths of the robot.

    Returns
    -------
    InertialParameters
        Physical parameters of f frames.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> bodies = uniform_bodies(load("rx90"), mass=100.0)
    >>> float(bodies.mass.sum().round(9)), bool(bodies.is_physical.all())
    (100.0, True)
    """
    check_model(model)
    chain = model.chain
    ends: list[list[Array]] = [[] for _ in range(model.f + 1)]
    for k in range(model.f):
        ends[int(chain.antecedent[k])].append(chain.position[k])
    ends[model.tip].append(np.asarray(model.tool[:3, 3]))
    reach = np.linalg.norm(chain.position, axis=1).sum() + np.linalg.norm(model.tool[:3, 3])
    thick = _SLENDERNESS * float(reach or 1.0) if radius is None else float(radius)
    for name, value in (("mass", mass), ("radius", thick)):
        if not (np.isfinite(value) and value > 0):
            raise InvalidValueError(f"{name}: expected a positive number, got {value}.")
    values = np.array([_solid(ends[j], thick) for j in range(1, model.f + 1)])
    return InertialParameters(values * (mass / values[:, 9].sum()))


def check_definite(bodies: InertialParameters, name: str, frames: Sequence[str] = ()) -> Array:
    """Pseudo-inertias of bodies; raise for bodies without mass or extent. Shapes: -> (f, 4, 4)."""
    P = pseudo_inertia(bodies.values)
    bad = np.flatnonzero(~has_extent(bodies))
    for j in bad[:1].tolist():
        link = f"link {j + 1}" + (f" ({frames[j]})" if len(frames) > j else "")
        more = f" So are {bad.size - 1} more." if bad.size > 1 else ""
        raise InertiaError(
            f"{name}: {link} is not a body with mass and extent in three directions: its mass is "
            f"{float(bodies.mass[j]):.4g} kg ({bodies.consistency().links[j]}).{more} Pass "
            f"{name}=uniform_bodies(model, mass=...), or a CAD model of every link."
        )
    return P


def has_extent(bodies: InertialParameters) -> NDArray[np.bool_]:
    """Whether bodies have mass and extent in three directions. Shapes: -> (f,) bool."""
    values = np.linalg.eigvalsh(pseudo_inertia(bodies.values))
    return values[:, 0] > _SINGULAR * np.maximum(values[:, -1], 1e-300)


def _solid(ends: list[Array], radius: float) -> Array:
    """Ten parameters of bars from the origin to the ends, density 1."""
    ball = 4.0 / 3.0 * np.pi * radius**3
    total = _body(ball, np.zeros(3), 0.4 * ball * radius**2 * np.eye(3))
    for end in ends:
        length = float(np.linalg.norm(end))
        if length > 0:
            mass, u = np.pi * radius**2 * length, end / length
            along = np.outer(u, u)
            across = mass * (3.0 * radius**2 + length**2) / 12.0
            central = 0.5 * mass * radius**2 * along + across * (np.eye(3) - along)
            total += _body(mass, 0.5 * end, central)
    return total


def _body(mass: float, centre: Array, central: Array) -> Array:
    S = skew(centre)
    J = central - mass * S @ S
    return np.array([*J[np.triu_indices(3)], *(mass * centre), mass])
