"""Makers of parallel robots from their dimensions.

Anchors are points, not radii, so that measured robots need no symmetry.

Parameters
----------
base, hips : array_like, shape (m, 3), or (m, 2) of planar robots
    Anchors of the legs, or axes of the cranks, on the base in world coordinates, m.
platform : array_like, shape (m, 3), or (m, 2) of planar robots
    Anchors of the legs on the platform in its own frame, m.
proximal, distal, upper_arm, forearm : array_like, scalar or shape (m,)
    Lengths of cranks and rods, m.
azimuth : array_like, shape (3,)
    Directions of a Delta's arms seen from above, from the x axis, rad: an arm at q = 0 points
    outward and level, at q = pi/2 downward (-z). Cranks of planar robots count from the x axis.
lower, upper : array_like, scalar or shape (m,), optional
    Limits of the actuated lengths, m, or angles, rad; default none.
home : array_like, shape (4, 4), optional
    Reference pose, from which the direct model starts. Default: centres of the anchors above each
    other, at medium lengths.
radius, platform_radius, base_angle, platform_angle : float
    Radii of the circles of anchors, m, of the platform by default 0.6 of the base's; angles between
    the anchors of a pair, rad. The pairs of the base are around 0, 120 and 240 deg, those of the
    platform around 60, 180 and 300 deg.
kind : {"SSM", "TSSM", "MSSM"}
    Simplified symmetric manipulator; triangular, whose platform is a triangle; minimal, with two
    triangles. Angles of triangles are ignored.

Returns
-------
ParallelRobot
    The description. Legs that coincide, anchors that all coincide and limits that do not ascend
    are refused.

References
----------
Book sections 2.2.2 (planar robots) and 2.2.3 (robots in space).

Examples
--------
>>> gough_symmetric(1.0, 0.5, kind="TSSM", lower=0.7, upper=1.5)
<Gough-Stewart platform: 6 legs of actuated length, length 0.7 to 1.5, without masses>
>>> five_bar([[0, 0], [0.5, 0]], [0.4, 0.4], [0.6, 0.6]).freedoms
('vx', 'vy')
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, as_each, as_exact, as_floats, as_number
from .._choices import one_of
from ..errors import InvalidValueError, ShapeError
from .legs import leg_states
from .robot import Family, ParallelRobot, pose_at

Points = ArrayLike
Limit = ArrayLike | None
_YAWS = np.pi * np.array([0, 1, -1, 2, -2, 3, -3, 4, -4, 5, -5, 6, -6, 8, -8, 10, -10, 12]) / 12


def gough(
    base: Points, platform: Points, lower: Limit = None, upper: Limit = None, home: Limit = None
) -> ParallelRobot:
    """Gough-Stewart platform (hexapod): six legs of actuated length between any points."""
    return _robot(Family.GOUGH, (base, platform), (lower, upper, home))


def gough_symmetric(
    radius: float,
    platform_radius: float | None = None,
    base_angle: float = 0.35,
    platform_angle: float = 0.35,
    kind: str = "SSM",
    lower: Limit = None,
    upper: Limit = None,
    home: Limit = None,
) -> ParallelRobot:
    """Gough-Stewart platform whose anchors lie on two circles in pairs."""
    big = as_number(radius, "radius", above=0.0)
    given = 0.6 * big if platform_radius is None else platform_radius
    small, third = as_number(given, "platform_radius", above=0.0), 2.0 * np.pi / 3.0
    one_of(kind, ("SSM", "TSSM", "MSSM"), "kind")
    wide = as_number(0.0 if kind == "MSSM" else base_angle, "base_angle", least=0.0, below=third)
    narrow = platform_angle if kind == "SSM" else 0.0
    narrow = as_number(narrow, "platform_angle", least=0.0, below=third)
    sides, pairs = np.array([-0.5, 0.5]), third * np.arange(3)[:, None]
    a = (pairs + wide * sides).ravel()
    b = np.roll((pairs + 0.5 * third + narrow * sides).ravel(), 1)
    base, platform = (np.stack((np.cos(x), np.sin(x), 0.0 * x), axis=1) for x in (a, b))
    return gough(big * base, small * platform, lower, upper, home)


def planar_3rpr(
    base: Points, platform: Points, lower: Limit = None, upper: Limit = None, home: Limit = None
) -> ParallelRobot:
    """Planar robot with three legs of actuated length between revolute joints."""
    return _robot(Family.PLANAR_3RPR, (base, platform), (lower, upper, home))


def planar_3rrr(
    base: Points,
    platform: Points,
    proximal: ArrayLike,
    distal: ArrayLike,
    lower: Limit = None,
    upper: Limit = None,
    home: Limit = None,
) -> ParallelRobot:
    """Planar robot with three legs of an actuated crank and a rod."""
    points, limits = (base, platform), (lower, upper, home)
    return _robot(Family.PLANAR_3RRR, points, limits, (proximal, distal))


def five_bar(
    base: Points,
    proximal: ArrayLike,
    distal: ArrayLike,
    lower: Limit = None,
    upper: Limit = None,
    home: Limit = None,
) -> ParallelRobot:
    """Planar five-bar robot: two cranks and rods that meet in the tool point.

    In working mode 0 the elbows point away from each other where the tool is to the left of the
    line from the first axis to the second.
    """
    points, limits = (base, np.zeros((2, 2))), (lower, upper, home)
    return _robot(Family.FIVE_BAR, points, limits, (proximal, distal))


def delta(
    hips: Points,
    platform: Points,
    azimuth: ArrayLike,
    upper_arm: ArrayLike,
    forearm: ArrayLike,
    lower: Limit = None,
    upper: Limit = None,
    home: Limit = None,
) -> ParallelRobot:
    """Delta robot: a platform that translates, on three arms with pairs of parallel rods.

    In working mode 0 all knees point outward.
    """
    points, limits = (hips, platform), (lower, upper, home)
    turn = as_exact(azimuth, (3,), "azimuth")
    return _robot(Family.DELTA, points, limits, (upper_arm, forearm), turn)


def _robot(
    family: Family,
    points: tuple[Points, Points],
    limits: tuple[Limit, Limit, Limit],
    arms: tuple[ArrayLike, ArrayLike] | None = None,
    turn: Array | float = 0.0,
) -> ParallelRobot:
    """Check dimensions and complete what is left out."""
    elbow = {Family.GOUGH: [1.0] * 6, Family.FIVE_BAR: [1.0, -1.0], Family.DELTA: [-1.0] * 3}
    signs = np.array(elbow.get(family, [1.0] * 3))
    m, flat = len(signs), 2 not in family.value[1]
    names = ("base", "platform", "proximal", "distal")
    if family is Family.DELTA:
        names = ("hips", "platform", "upper_arm", "forearm")
    a, b = map(as_floats, points, names[:2])
    for name, P in zip(names[:2], (a, b), strict=True):
        if P.shape != (m, 2 if flat else 3):
            raise ShapeError(
                f"{name}: expected {m} points, shape ({m}, {2 if flat else 3}), got {P.shape}."
            )
        if 5 in family.value[1] and np.ptp(P, axis=0).max() == 0.0:
            raise InvalidValueError(f"{name}: all anchors coincide, so that it could turn freely.")
    a, b = (np.pad(P, ((0, 0), (0, 3 - P.shape[1]))) for P in (a, b))
    size = max(np.ptp(a, axis=0).max(), np.ptp(b, axis=0).max())
    for i, j in combinations(range(m if family is not Family.DELTA else 0), 2):
        if np.abs(a[i] - a[j]).max() + np.abs(b[i] - b[j]).max() <= 1e-12 * size:
            raise InvalidValueError(
                f"base, platform: legs {i + 1} and {j + 1} coincide; give each its own anchors."
            )
    crank, rod = (
        np.zeros(m) if arms is None else as_each(as_floats(value, name), m, name, above=0.0)
        for value, name in zip(arms or (0, 0), names[2:], strict=True)
    )
    low, high = checked_limits(*limits[:2], m, arms is None)
    outward = np.stack((np.cos(turn), np.sin(turn), 0.0 * np.cos(turn)), axis=-1) + np.zeros((m, 3))
    downward = np.tile((0.0, 0.0, -1.0) if family is Family.DELTA else (0.0, 1.0, 0.0), (m, 1))
    given = se3.as_single_pose(limits[2], "home")
    robot = ParallelRobot(family, a, b, crank, rod, outward, downward, signs, low, high, given)
    robot.checked(given, "home")
    return robot if limits[2] is not None else replace(robot, home=_home(robot))


def checked_limits(lower: Limit, upper: Limit, m: int, is_length: bool) -> tuple[Array, Array]:
    """Limits of q, infinite or zero where there are none."""
    least = 0.0 if is_length else -np.inf
    low = as_each(least if lower is None else lower, m, "lower", least)
    high = as_each(np.inf if upper is None else upper, m, "upper", least)
    if not (low <= high).all():
        raise InvalidValueError(f"lower, upper: expected lower below upper, got {low} and {high}.")
    return low, high


def _home(robot: ParallelRobot) -> Array:
    """A pose with the centres above each other, far from singular positions."""
    a, b, crank, rod = robot.base, robot.platform, robot.crank, robot.rod
    place = a.mean(axis=0) - b.mean(axis=0)
    if robot.family is Family.GOUGH:
        middle = 0.5 * (robot.lower + robot.upper)
        square = (middle**2).mean() if np.isfinite(middle).all() else None
        normal = np.linalg.svd(a - place - b.mean(axis=0))[2][2]
        normal = normal if normal[2] >= 0.0 else -normal
        place = place + height_above(robot, place, normal, square) * normal
    elif robot.family is Family.FIVE_BAR:
        along, reach = a[1] - a[0], (crank + rod).min()
        half = 0.5 * np.linalg.norm(along)
        d = max(0.75 * reach, 0.5 * (np.abs(crank - rod).max() + reach), 1.02 * half)
        place = place + np.sqrt(d * d - half * half) * np.cross([0, 0, 0.5], along) / half
    elif robot.family is Family.DELTA:
        across = (place - a + b - crank[:, None] * robot.outward)[:, :2]
        square = (rod**2 - (across**2).sum(axis=1)).min()
        place[2] -= np.sqrt(max(square, 0.25 * rod.min() ** 2))
    twist = np.zeros((len(_YAWS), 6))
    twist[:, :3], twist[:, 5] = place, _YAWS if 5 in robot.columns else 0.0
    T = pose_at(twist)
    legs = leg_states(robot, T)
    J = legs.rows / np.repeat([1.0, robot.length], 3)
    det = np.abs(np.linalg.det(J[..., list(robot.columns)])) * legs.reached
    inside = ((legs.q >= robot.lower) & (legs.q <= robot.upper)).all(axis=1)
    score = det * np.where(inside, 1.0, 1e-3)
    return T[np.argmax(score >= 0.2 * score.max())] + 0.0  # the least rotation of the good ones


def height_above(robot: ParallelRobot, place: Array, normal: Array, square: Any = None) -> Any:
    """Height at which the mean square of six lengths is given, or the radius of the base.

    Shapes: place, normal (3,), square (...) -> (...).
    """
    d = robot.platform + place - robot.base
    d = d - (d @ normal).mean() * normal
    radius2 = ((robot.base - robot.base.mean(axis=0)) ** 2).sum(axis=1).mean()
    rest = (d * d).sum(axis=1).mean()
    wanted = rest + radius2 if square is None else square
    return np.sqrt(np.maximum(wanted - rest, 0.09 * radius2))
