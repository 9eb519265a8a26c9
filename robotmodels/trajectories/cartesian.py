"""Motions of the tool in space: lines, circles and blended lines through poses, under limits.

Parameters
----------
T0, T1 : array_like, shape (4, 4)
    First and last pose, m.
poses : array_like, shape (m, 4, 4)
    Corners of `blended_poses`, at least two, m.
limits : MotionLimits, optional
    Of translation in m, then of rotation in rad, for instance ``MotionLimits([0.5, 1.0],
    [2.0, 4.0])``; they bound the lengths of the vectors of velocity, acceleration and jerk.

References
----------
Book section 4.3.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, as_count, as_exact, as_number
from .._choices import as_instance, chosen
from ..errors import InvalidValueError, ShapeError
from ..se3.orientation import rotation_vectors_of
from .blends import PARABOLA, QUARTIC, full_speed, joined, rates_of, schedule
from .laws import LineLimits, TimeLaw, law_of_limits
from .limits import MotionLimits, limits_along, ranges_of, slowed
from .motions import PiecewisePolynomial
from .point_to_point import along_line
from .pose_trajectory import (
    BlendedPoses,
    FixedAxisPath,
    PoseTrajectory,
    arc,
    rotation_about,
)
from .trajectory import Trajectory

_MOVES = ("translation", "rotation")

_NO_TURN = 1e-15
"""Rounding of the angle between two equal orientations, rad."""

_FLAT = 1e-9
"""Height of three points beside their longest side below which they are on a line. Down to it an
arc passes them within some 1e-15 of their coordinates, however far away its centre is."""


_SPEEDS = 60
"""Speeds that are tried on a circle."""


def cartesian_trajectory(
    T0: Any, T1: Any, N: int, law: TimeLaw | str = TimeLaw.TRAPEZOIDAL
) -> Array:
    """Poses on the straight line between two poses, at equal steps of time.

    Also called ``ctraj`` (`TimeLaw.LINEAR`: ``trinterp``). The position moves on a line, the
    orientation turns about one fixed axis by the shorter way (slerp), both by the same law, by
    default a trapezoid of velocity whose ramps take a third of the time each.

    Returns
    -------
    ndarray, shape (N, 4, 4)
        Both ends included; a single one is ``T0``.

    Examples
    --------
    >>> from robotmodels.se3 import rotation, translation
    >>> T = cartesian_trajectory(np.eye(4), translation(0.3, 0, 0) @ rotation("z", 1.0), 50)
    >>> T.shape, bool((T[0] == np.eye(4)).all())
    ((50, 4, 4), True)
    """
    path = arc(se3.as_single_pose(T0, "T0"), se3.as_single_pose(T1, "T1"))
    along = along_line(law, 0.0, 1.0, 1.0, None)
    s = along.q(np.linspace(0.0, 1.0, as_count(N, "N", 0, 10**7)))
    s[1:][-1:] = 1.0  # the last pose is met to the last digit
    return path.poses(s)


def straight_line(
    T0: Any,
    T1: Any,
    duration: float | None = None,
    limits: MotionLimits | None = None,
    law: TimeLaw | str = TimeLaw.TRAPEZOIDAL,
) -> PoseTrajectory:
    """Straight line from rest to rest, with the shorter rotation about a fixed axis.

    Also called ``ctraj``, MOVEL. One law of time moves the position and the orientation.

    Examples
    --------
    >>> from robotmodels.se3 import rotation, translation
    >>> T1 = translation(1.0, 0, 0) @ rotation("z", 0.5)
    >>> move = straight_line(np.eye(4), T1, limits=MotionLimits([0.5, 1.0], [1.0, 2.0]))
    >>> move.duration, move.twist(1.0).round(9) + 0.0
    (2.50..., array([0.5 , 0.  , 0.  , 0.  , 0.  , 0.25]))
    """
    path = arc(se3.as_single_pose(T0, "T0"), se3.as_single_pose(T1, "T1"))
    return _timed(path, duration, limits, law)


def circular_arc(
    T0: Any,
    through: ArrayLike,
    T1: Any,
    duration: float | None = None,
    limits: MotionLimits | None = None,
    law: TimeLaw | str = TimeLaw.TRAPEZOIDAL,
) -> PoseTrajectory:
    """Arc of the circle through three points, with a rotation about a fixed axis.

    Also called MOVEC. ``through (3,)`` is the position on the arc between the poses, m. The
    orientation takes the shorter rotation from the first to the last. Points that are on a line to
    within 1e-9 of their longest side, or to within their rounding, are an error.
    """
    first, last = se3.as_single_pose(T0, "T0"), se3.as_single_pose(T1, "T1")
    p, m, e = first[:3, 3], as_exact(through, (3,), "through"), last[:3, 3]
    a, b, c = m - p, e - p, e - m
    cross = np.cross(a, b)
    size = float(np.linalg.norm(cross))
    side = max(float(np.linalg.norm(x)) for x in (a, b, c))
    rounding = 64.0 * np.finfo(float).eps * max(float(np.abs(x).max()) for x in (p, m, e))
    if size <= side * max(_FLAT * side, rounding):
        raise InvalidValueError(
            "through: the three points lie on one line, or within a billionth of its length of it, "
            "which is no circle; take straight_line, or circle for a whole turn."
        )
    # Angles at the points are halves of the arcs opposite, which keeps their digits where the
    # centre is far away. With this normal the points come in their order.
    half = float(np.arctan2(size, a @ c))
    chord, lean = (b, half) if b @ b >= a @ a else (a, float(np.arctan2(size, b @ c)))
    chord = chord / np.linalg.norm(chord)
    normal = cross / size
    normal -= chord * (normal @ chord)
    normal /= np.linalg.norm(normal)
    forward: Array = np.cos(lean) * chord - np.sin(lean) * np.cross(normal, chord)
    radius = float(np.linalg.norm(a) * np.linalg.norm(b) * np.linalg.norm(c)) / (2.0 * size)
    centre: Array = p + radius * np.cross(normal, forward)
    return _timed(arc(first, last, centre, normal, 2.0 * half), duration, limits, law)


def circle(
    T0: Any,
    centre: ArrayLike,
    axis: ArrayLike,
    angle: float = 2.0 * np.pi,
    duration: float | None = None,
    limits: MotionLimits | None = None,
    law: TimeLaw | str = TimeLaw.TRAPEZOIDAL,
    turning: bool = False,
) -> PoseTrajectory:
    """Circle about an axis, any angle.

    The axis goes through ``centre (3,)``, m, in the direction of ``axis (3,)``; the tool turns
    about it to the right by ``angle``, rad. With ``turning`` the orientation turns with it, instead
    of being kept. A pose on the axis is an error.
    """
    first = se3.as_single_pose(T0, "T0")
    point, direction = as_exact(centre, (3,), "centre"), as_exact(axis, (3,), "axis")
    size = float(np.linalg.norm(direction))
    if size == 0.0:
        raise InvalidValueError("axis: expected a direction, got a vector of no length.")
    n = direction / size
    foot = point + n * (n @ (first[:3, 3] - point))
    if np.linalg.norm(first[:3, 3] - foot) <= 1e-12 * max(1.0, float(np.abs(first[:3, 3]).max())):
        raise InvalidValueError("T0: its origin is on the axis, so that the circle has no radius.")
    sweep = as_number(angle, "angle")
    last = first.copy()
    R = rotation_about(n, np.array(sweep))
    last[:3, 3] = foot + R @ (first[:3, 3] - foot)
    if sweep == 0.0:
        return _timed(arc(first, first), duration, limits, law)
    if not turning:
        return _timed(arc(first, last, foot, n, sweep), duration, limits, law)
    last[:3, :3] = R @ first[:3, :3]
    # the turn goes all the way round with the position, where the shorter way would not
    path = FixedAxisPath(first, last, np.zeros(3), foot, n, sweep, n, sweep)
    return _timed(path, duration, limits, law)


def blended_poses(
    poses: Any, limits: MotionLimits, duration: float | None = None, smooth: bool = False
) -> PoseTrajectory:
    """Straight lines through poses, joined by blends that do not meet the inner poses.

    Position and orientation follow the same lines and the same blends. The motion passes an inner
    position at a distance of ``blend time * change of velocity / 8`` (3/32 of it with ``smooth``
    blends, whose acceleration is continuous). A longer ``duration`` slows the whole motion down
    evenly; limits of jerk are refused.
    """
    T = se3.as_pose(poses, "poses")
    if T.ndim != 3 or len(T) < 2:
        raise ShapeError(f"poses: expected at least two, shape (m, 4, 4), got {T.shape}.")
    bounds = _of_space(limits)
    if bounds is None or np.isfinite(bounds.jerk).any():
        raise InvalidValueError(
            "limits: give limits of velocity and acceleration, and none of jerk; blends of poses "
            "keep no limit of jerk."
        )
    step = np.empty((len(T) - 1, 6))
    step[:, :3] = np.diff(T[:, :3, 3], axis=0)
    step[:, 3:] = rotation_vectors_of(T[1:, :3, :3] @ np.swapaxes(T[:-1, :3, :3], -1, -2))
    step[np.linalg.norm(step[:, 3:], axis=-1) <= _NO_TURN, 3:] = 0.0
    size = np.stack((np.linalg.norm(step[:, :3], axis=-1), np.linalg.norm(step[:, 3:], axis=-1)))
    least_T = full_speed(size.T, bounds, _MOVES)
    if (size.any(axis=1) & np.isinf(bounds.acceleration)).any():
        raise InvalidValueError("limits: blends need limits of acceleration.")
    times, tb = schedule(least_T, lambda t: _pose_blends(step, t, bounds, smooth))
    times, tb = slowed(times, tb, duration, True)
    each = np.eye(len(step))  # a coordinate for each line
    progress = joined(np.tri(len(T), len(step), -1), each, times, tb, smooth)
    path = BlendedPoses(T, step, progress)
    end = path.end
    clock = PiecewisePolynomial(np.array([[0.0, end]]), np.array([[[0.0], [end]]]))
    # the path's parameter is the time itself, and the tool rests outside of it
    return PoseTrajectory(path, Trajectory(clock, scalar=True, holds=True))


def _timed(
    path: FixedAxisPath, duration: float | None, limits: MotionLimits | None, law: TimeLaw | str
) -> PoseTrajectory:
    """Motion along a path from rest to rest by a law."""
    law, bounds = chosen(TimeLaw, law, "law"), _of_space(limits)
    turn = abs(path.turn)
    size = np.array([path.length, turn if turn > _NO_TURN else 0.0])
    along = None
    if bounds is not None:
        along = limits_along(bounds, size, _MOVES)
        if path.radius > 0.0 and np.isfinite([bounds.acceleration[0], bounds.jerk[0]]).any():
            along = _on_circle(law, path, bounds, along)
        V, A, B, J, K, _ = along
        along = MotionLimits(*np.array([V, A, J, -V, -B, -K]))
    return PoseTrajectory(path, along_line(law, 0.0, float(size.any()), duration, along))


def _on_circle(
    law: TimeLaw, path: FixedAxisPath, limits: MotionLimits, along: LineLimits
) -> LineLimits:
    """Limits along a circle, for the greatest speed and the part of the jerk that do best.

    On a circle of radius r and length L the acceleration is ``(L s'', (L s')^2 / r)`` along it and
    towards the centre, the jerk ``(L s''' - (L s')^3 / r^2, 3 L^2 s' s'' / r)``.
    """
    L, r, A, J = path.length, path.radius, limits.acceleration[0], limits.jerk[0]
    best, least = along, np.inf
    most = min(along.velocity * L, np.sqrt(A * r), np.cbrt(J * r * r))
    parts = np.linspace(0.1, 0.9, 9) if np.isfinite(J) else np.ones(1)
    for speed in (most * np.linspace(0.0, 1.0, _SPEEDS + 1)[1:]).tolist():
        for part in parts.tolist():
            pull = min(np.sqrt(max(A * A - (speed**2 / r) ** 2, 0.0)), part * J * r / (3.0 * speed))
            jolt = np.inf if np.isinf(J) else np.sqrt(1.0 - part**2) * J - speed**3 / r**2
            if pull > 0.0 and jolt > 0.0:
                up = [min(x, pull / L) for x in along[1:3]]
                up += [min(x, jolt / L) for x in along[3:5]]
                up = [min(along.velocity, speed / L), *up]
                bounds = LineLimits(*up, along.back)  # type: ignore[call-arg]
                T = float(law_of_limits(law, 1.0, bounds).durations.sum())
                best, least = (bounds, T) if least > T else (best, least)
    return best


def _of_space(limits: MotionLimits | None) -> MotionLimits | None:
    """Limits of translation and rotation, the same forth and back."""
    if limits is None:
        return None
    as_instance(limits, MotionLimits, "limits")
    if limits.velocity.shape not in ((), (1,), (2,)):
        raise ShapeError(
            "limits: expected limits of two quantities, translation (m) and rotation (rad), or one "
            f"number for both, got limits of {limits.velocity.size}; those of joints do not bound "
            "a path in space."
        )
    bounds = limits.for_joints(2)
    if any((least != -most).any() for _, least, most in ranges_of(bounds)[1:]):
        raise InvalidValueError("limits: a path in space needs limits equal in both directions.")
    if np.isfinite(bounds.lower).any() or np.isfinite(bounds.upper).any():
        raise InvalidValueError("limits: a path in space has no limits of position.")
    return bounds


def _pose_blends(step: Array, T: Array, limits: MotionLimits, smooth: bool) -> Array:
    """Least times of the blends of poses, shape (m,)."""
    v, none = rates_of(step, T), np.zeros((1, 6))
    before, after = np.vstack((none, v)), np.vstack((v, none))
    peak = QUARTIC if smooth else PARABOLA
    change = after - before
    # the two rotations do not commute: what is left of the product of their rates is not faded.
    # f2 f2'' + f1' f2' is at most 1/2 for the parabola, and 0.456 for the smooth step
    crossed = np.linalg.norm(np.cross(before[:, 3:], after[:, 3:]), axis=-1) * (
        0.46 if smooth else 0.5
    )
    A, alpha = limits.acceleration
    left = alpha - crossed
    turn = np.linalg.norm(change[:, 3:], axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        by_turn = np.where(turn > 0.0, np.where(left > 0.0, peak * turn / left, np.inf), 0.0)
        move = np.linalg.norm(change[:, :3], axis=-1)
        by_move = np.where(move > 0.0, peak * move / A, 0.0)
    return np.maximum(by_turn, by_move)
