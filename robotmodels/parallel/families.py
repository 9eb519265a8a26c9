"""Makers of parallel robots from their dimensions.

Anchors are points, not radii, so that measured robots need no symmetry.

Parameters
----------
base : array_like, shape (m, 3), or (m, 2) of planar robots
    Anchors of the legs on the base in world coordinates, m.
platform : array_like, shape (m, 3), or (m, 2) of planar robots
    Anchors of the legs on the platform in its own frame, m.
lower, upper : array_like, scalar or shape (m,), optional
    Limits of the actuated lengths, m, or angles, rad; default none.
home : array_like, shape (4, 4), optional
    Reference pose, from which the direct model starts and beside which singular poses count.
    Default: centres of the anchors above each other, at medium lengths.

Returns
-------
ParallelRobot
    The description.

Raises
------
ShapeError, InvalidValueError, NotARotationError
    Wrong number of legs, NaN, lengths that are not positive, two legs that coincide, anchors that
    all coincide, limits that are negative or not ascending.

References
----------
Seed book sections 2.2.2 (planar robots) and 2.2.3 (robots in space).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, as_core, as_exact, as_floats, as_number, as_reals
from ..errors import InvalidValueError, ShapeError
from .robot import Family, ParallelRobot, pose_of

Limit = ArrayLike | None
_X, _Y, _DOWN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)
_YAWS = np.pi * np.array([0, 1, -1, 2, -2, 3, -3, 4, -4, 5, -5, 6, -6, 8, -8, 10, -10, 12]) / 12


def gough(
    base: ArrayLike,
    platform: ArrayLike,
    lower: Limit = None,
    upper: Limit = None,
    home: ArrayLike | None = None,
) -> ParallelRobot:
    """Gough-Stewart platform (hexapod): six legs of actuated length between any points.

    Examples
    --------
    >>> import numpy as np
    >>> a, b = np.deg2rad([10, 110, 130, 230, 250, 350]), np.deg2rad([50, 70, 170, 190, 290, 310])
    >>> points = [np.c_[np.cos(x), np.sin(x), 0 * x] for x in (a, b)]
    >>> gough(points[0], 0.6 * points[1], lower=0.7, upper=1.5)
    <Gough-Stewart platform: 6 legs of actuated length, length 0.7 to 1.5, without masses>
    """
    return _robot(Family.GOUGH, base, platform, lower, upper, home)


def gough_symmetric(
    radius: float,
    platform_radius: float | None = None,
    base_angle: float = 0.35,
    platform_angle: float = 0.35,
    kind: str = "SSM",
    lower: Limit = None,
    upper: Limit = None,
    home: ArrayLike | None = None,
) -> ParallelRobot:
    """Gough-Stewart platform whose anchors lie on two circles in pairs.

    Parameters
    ----------
    radius, platform_radius : float
        Radii of the circles of anchors, m; the platform's is 0.6 of the base's by default.
    base_angle, platform_angle : float
        Angle between the two anchors of a pair, from 0 to below 2 pi/3, rad. The pairs of the base
        are around 0, 120 and 240 deg, those of the platform around 60, 180 and 300 deg.
    kind : {"SSM", "TSSM", "MSSM"}
        Simplified symmetric manipulator; triangular, whose platform is a triangle; minimal, with
        two triangles. Angles of triangles are ignored.
    lower, upper, home
        See the head of the file.

    Returns
    -------
    ParallelRobot
        The description.

    Examples
    --------
    >>> gough_symmetric(1.0, 0.5, kind="TSSM").platform[1:3].round(3)
    array([[ 0.25 ,  0.433,  0.   ],
           [ 0.25 ,  0.433,  0.   ]])
    """
    big = as_number(radius, "radius", above=0.0)
    small = 0.6 * big if platform_radius is None else as_number(platform_radius, "platform_radius")
    kinds = ("SSM", "TSSM", "MSSM")
    if kind not in kinds:
        raise InvalidValueError(f"kind: expected one of {', '.join(kinds)}, got {kind!r:.40}.")
    if small <= 0.0:
        raise InvalidValueError(f"platform_radius: expected above 0, got {platform_radius!r}.")
    third = 2.0 * np.pi / 3.0
    spread = [as_number(x, n, least=0.0, below=third) for x, n in (
        (0.0 if kind == "MSSM" else base_angle, "base_angle"),
        (platform_angle if kind == "SSM" else 0.0, "platform_angle"),
    )]  # fmt: skip
    pairs = third * np.arange(3)
    a = np.stack((pairs - 0.5 * spread[0], pairs + 0.5 * spread[0]), axis=1).ravel()
    b = pairs + 0.5 * third
    b = np.stack((b - 0.5 * spread[1], b + 0.5 * spread[1]), axis=1).ravel()
    circle = [np.stack((np.cos(x), np.sin(x), 0.0 * x), axis=1) for x in (a, np.roll(b, 1))]
    return gough(big * circle[0], small * circle[1], lower, upper, home)


def planar_3rpr(
    base: ArrayLike,
    platform: ArrayLike,
    lower: Limit = None,
    upper: Limit = None,
    home: ArrayLike | None = None,
) -> ParallelRobot:
    """Planar robot with three legs of actuated length between revolute joints.

    Examples
    --------
    >>> planar_3rpr([[0, 0], [2, 0], [1, 1.7]], [[0, 0], [1, 0], [0, 1]]).m
    3
    """
    return _robot(Family.PLANAR_3RPR, base, platform, lower, upper, home)


def planar_3rrr(
    base: ArrayLike,
    platform: ArrayLike,
    proximal: ArrayLike,
    distal: ArrayLike,
    lower: Limit = None,
    upper: Limit = None,
    home: ArrayLike | None = None,
) -> ParallelRobot:
    """Planar robot with three legs of an actuated crank and a rod; angles from the x axis.

    Parameters
    ----------
    base, platform, lower, upper, home
        See the head of the file.
    proximal, distal : array_like, scalar or shape (3,)
        Lengths of cranks and rods, m.

    Returns
    -------
    ParallelRobot
        The description.

    Examples
    --------
    >>> planar_3rrr([[0, 0], [2, 0], [1, 1.7]], [[0, 0], [1, 0], [0, 1]], 0.8, 0.9).crank
    array([0.8, 0.8, 0.8])
    """
    arms = _arms(proximal, distal, 3)
    return _robot(Family.PLANAR_3RRR, base, platform, lower, upper, home, arms, [1.0] * 3)


def five_bar(
    base: ArrayLike,
    proximal: ArrayLike,
    distal: ArrayLike,
    lower: Limit = None,
    upper: Limit = None,
    home: ArrayLike | None = None,
) -> ParallelRobot:
    """Planar five-bar robot: two cranks and rods that meet in the tool point; angles from x.

    Parameters
    ----------
    base : array_like, shape (2, 2)
        Axes of the cranks, m.
    proximal, distal : array_like, scalar or shape (2,)
        Lengths of cranks and rods, m.
    lower, upper, home
        See the head of the file.

    Returns
    -------
    ParallelRobot
        The description; in working mode 0 both elbows point away from each other where the tool is
        to the left of the line from the first axis to the second.

    Examples
    --------
    >>> five_bar([[0, 0], [0.5, 0]], [0.4, 0.4], [0.6, 0.6]).freedoms
    ('vx', 'vy')
    """
    arms = _arms(proximal, distal, 2)
    zero = np.zeros((2, 2))
    return _robot(Family.FIVE_BAR, base, zero, lower, upper, home, arms, [1.0, -1.0])


def delta(
    hips: ArrayLike,
    platform: ArrayLike,
    azimuth: ArrayLike,
    upper_arm: ArrayLike,
    forearm: ArrayLike,
    lower: Limit = None,
    upper: Limit = None,
    home: ArrayLike | None = None,
) -> ParallelRobot:
    """Delta robot: a platform that translates, on three arms with pairs of parallel rods.

    Parameters
    ----------
    hips, platform : array_like, shape (3, 3)
        Centres of the hip axes in the world, and of the rods' joints on the platform, m.
    azimuth : array_like, shape (3,)
        Directions of the arms seen from above, from the x axis, rad. An arm at q = 0 points
        outward and level, at q = pi/2 downward (-z).
    upper_arm, forearm : array_like, scalar or shape (3,)
        Lengths of arms and rods, m.
    lower, upper, home
        See the head of the file.

    Returns
    -------
    ParallelRobot
        The description; in working mode 0 all knees point outward.

    Examples
    --------
    >>> turn = np.deg2rad([-90.0, 30.0, 150.0])
    >>> ring = np.c_[np.cos(turn), np.sin(turn), 0.0 * turn]
    >>> delta(0.16 * ring, 0.04 * ring, turn, 0.52, 1.24).m
    3
    """
    turn = as_exact(azimuth, (3,), "azimuth")
    outward = np.stack((np.cos(turn), np.sin(turn), np.zeros(3)), axis=1)
    arms = _arms(upper_arm, forearm, 3)
    elbow = [-1.0] * 3
    return _robot(Family.DELTA, hips, platform, lower, upper, home, arms, elbow, outward)


def _robot(
    family: Family,
    base: ArrayLike,
    platform: ArrayLike,
    lower: Limit,
    upper: Limit,
    home: ArrayLike | None,
    arms: tuple[Array, Array] | None = None,
    elbow: Any = None,
    outward: Array | None = None,
) -> ParallelRobot:
    """Check dimensions and complete what is left out."""
    m = {Family.GOUGH: 6, Family.FIVE_BAR: 2}.get(family, 3)
    flat = 2 not in family.value[1]
    a, b = _points(base, m, flat, "base"), _points(platform, m, flat, "platform")
    size = max(np.ptp(a, axis=0).max(), np.ptp(b, axis=0).max())
    for name, points in (("base", a), ("platform", b)):
        if family not in (Family.DELTA, Family.FIVE_BAR) and np.ptp(points, axis=0).max() == 0.0:
            raise InvalidValueError(f"{name}: all anchors coincide, so that it could turn freely.")
    if family is Family.FIVE_BAR and np.ptp(a, axis=0).max() == 0.0:
        raise InvalidValueError("base: the two axes coincide.")
    for i in range(m):
        for j in range(i):
            apart = np.abs(a[i] - a[j]).max() + np.abs(b[i] - b[j]).max()
            if apart <= 1e-12 * size and family is not Family.DELTA:
                raise InvalidValueError(
                    f"base, platform: legs {j + 1} and {i + 1} have the same anchors on both; give "
                    "each leg its own points."
                )
    none = np.zeros(m)
    crank, rod = (none, none) if arms is None else arms
    low, high = (
        checked_limit(x, m, n, arms is None) for x, n in ((lower, "lower"), (upper, "upper"))
    )
    if not (low <= high).all():
        raise InvalidValueError(f"lower, upper: expected lower below upper, got {low} and {high}.")
    u = np.tile(_X, (m, 1)) if outward is None else outward
    w = np.tile(_DOWN if family is Family.DELTA else _Y, (m, 1))
    signs = np.ones(m) if elbow is None else np.array(elbow)
    given = np.eye(4) if home is None else se3.as_single_pose(home, "home")
    robot = ParallelRobot(family, a, b, crank, rod, u, w, signs, low, high, given)
    if home is not None:
        robot.checked(given, "home")
        return robot
    return ParallelRobot(family, a, b, crank, rod, u, w, signs, low, high, _home(robot))


def _points(points: ArrayLike, m: int, flat: bool, name: str) -> Array:
    """Anchors as (m, 3)."""
    P = as_floats(points, name)
    if P.shape != (m, 2 if flat else 3):
        raise ShapeError(
            f"{name}: expected {m} points, shape ({m}, {2 if flat else 3}), got {P.shape}."
        )
    return np.pad(P, ((0, 0), (0, 1))) if flat else as_core(P, (3,), name)


def _arms(proximal: ArrayLike, distal: ArrayLike, m: int) -> tuple[Array, Array]:
    """Lengths of cranks and rods."""
    both = []
    for value, name in ((proximal, "proximal"), (distal, "distal")):
        given = as_floats(value, name)
        if given.shape not in ((), (m,)):
            raise ShapeError(f"{name}: expected a number or shape ({m},), got {given.shape}.")
        if not (given > 0.0).all():
            raise InvalidValueError(f"{name}: expected lengths above 0 m, got {value!r:.60}.")
        both.append(np.broadcast_to(given, (m,)).copy())
    return both[0], both[1]


def checked_limit(value: Limit, m: int, name: str, is_length: bool) -> Array:
    """Limits of q, infinite or zero where there are none."""
    if value is None:
        none = np.inf if name == "upper" else (0.0 if is_length else -np.inf)
        return np.full(m, none)
    given = as_reals(value, name)
    if given.shape not in ((), (m,)):
        raise ShapeError(f"{name}: expected a number or shape ({m},), got {given.shape}.")
    if np.isnan(given).any() or (is_length and (given < 0.0).any()):
        raise InvalidValueError(
            f"{name}: expected {'lengths that are not negative' if is_length else 'angles'}, "
            f"without NaN, got {value!r:.60}."
        )
    return np.broadcast_to(given, (m,)).copy()


def _home(robot: ParallelRobot) -> Array:
    """A pose with the centres above each other, far from singular positions."""
    from .legs import leg_states

    a, b = robot.base, robot.platform
    place = a.mean(axis=0) - b.mean(axis=0)
    twist = np.zeros((len(_YAWS), 6))
    if robot.family is Family.GOUGH:
        normal = np.linalg.svd(a - a.mean(axis=0))[2][2]
        normal = normal if normal[2] >= 0.0 else -normal
        place = place + height_above(robot, place, normal, _middle(robot)) * normal
    elif robot.family is Family.FIVE_BAR:
        along = a[1] - a[0]
        half, reach = 0.5 * np.linalg.norm(along), (robot.crank + robot.rod).min()
        least = np.abs(robot.crank - robot.rod).max()
        d = max(0.75 * reach, 0.5 * (least + reach), 1.02 * half)
        h = np.sqrt(max(d * d - half * half, 0.0))
        place = place + h * np.array([-along[1], along[0], 0.0]) / (2.0 * half)
    elif robot.family is Family.DELTA:
        across = (place - a + b - robot.crank[:, None] * robot.outward)[:, :2]
        square = (robot.rod**2 - (across**2).sum(axis=1)).min()
        place[2] -= np.sqrt(max(square, 0.25 * robot.rod.min() ** 2))
    twist[:, :3] = place
    if 5 in robot.columns:
        twist[:, 5] = _YAWS
    T = pose_of(twist)
    legs = leg_states(robot, T, np.zeros(len(T), np.int64))
    J = legs.rows[..., list(robot.columns)]
    if 5 in robot.columns:
        J[..., 3 if robot.m == 6 else 2 :] /= robot.length
    det = np.abs(np.linalg.det(np.where(legs.reached[:, None, None], J, 0.0)))
    inside = ((legs.q >= robot.lower) & (legs.q <= robot.upper)).all(axis=1)
    score = det * np.where(inside, 1.0, 1e-3)
    good = np.flatnonzero(score >= 0.2 * score.max())  # the least rotation of the good ones
    return T[good[0]] + 0.0


def _middle(robot: ParallelRobot) -> float | None:
    """Mean square of the middle lengths of the legs, where there are limits."""
    middle = 0.5 * (robot.lower + robot.upper)
    return float((middle**2).mean()) if np.isfinite(middle).all() else None


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
