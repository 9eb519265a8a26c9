"""Random profiles of motion: the candidates of a search for the best motion.

References
----------
Seed book sections 4.4.2.2 and 4.4.3.
"""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from .._choices import chosen
from ..errors import InvalidValueError
from ..kinematics.singular.task import generator_of, whole_number
from .blends import blended_lines
from .checks import joint_vectors
from .splines import cubic_spline, quintic_spline
from .trajectory import Trajectory

_LEAST_RAMP = 0.1  # of the time between two points


class ProfileLaw(Enum):
    """Laws of random profiles; the value describes the law."""

    SPLINE = "cubic spline through the nodes, at rest at the ends"
    TRAPEZOID = "constant velocities between the nodes, constant accelerations near them"
    QUINTIC = "fifth-order spline through the nodes, at rest without acceleration at the ends"


def random_profile(
    q0: ArrayLike,
    q1: ArrayLike,
    nodes: int = 4,
    law: ProfileLaw | str = ProfileLaw.SPLINE,
    rng: np.random.Generator | int | None = None,
) -> Trajectory:
    """Random motion from rest to rest between two configurations, in one second.

    The nodes are evenly spaced in time, at positions drawn uniformly around the straight line: by
    up to half of the way of their joint, and at least a tenth of the longest way of all joints.

    Parameters
    ----------
    q0, q1 : array_like, shape () or (n,)
        Configurations at the ends, rad or m.
    nodes : int
        Number of free configurations between the ends.
    law : ProfileLaw or str
        ``"spline"``, ``"trapezoid"`` (with random durations of its accelerations; the nodes are
        passed at a distance) or ``"quintic"``.
    rng : Generator or int, optional
        Random numbers, or their seed; by default a fixed one.

    Returns
    -------
    Trajectory
        Of n joints, or scalar, with a duration of 1 s; `time_scaled` gives it the least duration.

    Raises
    ------
    ShapeError, InvalidValueError
        Vectors that do not fit, ends that are the same, a number of nodes below zero.

    Examples
    --------
    >>> from robotmodels.trajectories import random_profile
    >>> profile = random_profile([0.0, 0.0], [1.0, 0.5], nodes=3, rng=1)
    >>> profile.duration, profile.q([0.0, 1.0]).round(9).tolist()
    (1.0, [[0.0, 0.0], [1.0, 0.5]])
    """
    law = chosen(ProfileLaw, law, "law")
    count, generator = whole_number(nodes, "nodes", 0), generator_of(rng)
    ends, batch, scalar = joint_vectors(q0=q0, q1=q1)
    if batch:
        raise InvalidValueError(f"q0, q1: expected one motion, got a batch of shape {batch}.")
    start, end = ends["q0"][0], ends["q1"][0]
    if not np.any(start != end):
        raise InvalidValueError("q0, q1: the ends are the same, so there is no way between them.")
    points = start + np.linspace(0.0, 1.0, count + 2)[:, None] * (end - start)
    points[1:-1] += half_width(start, end) * generator.uniform(-1.0, 1.0, (count, start.size))
    given = points[:, 0] if scalar else points
    times = np.linspace(0.0, 1.0, count + 2)
    if law is ProfileLaw.SPLINE:
        return cubic_spline(given, times)
    if law is ProfileLaw.QUINTIC:
        return quintic_spline(given, times)
    # the ramps at both ends of a line fill at most its time; the first and last begin half before
    share = generator.uniform(_LEAST_RAMP, 1.0, count + 2)
    step = 1.0 / (count + 1 + 0.5 * (share[0] + share[-1]))
    return blended_lines(
        given, duration=1.0, segment_times=np.full(count + 1, step), blend_times=share * step
    )


def half_width(start: Array, end: Array) -> Array:
    """How far nodes are drawn from the straight line (n,)."""
    way = np.abs(end - start)
    return np.maximum(0.5 * way, 0.1 * way.max())
