"""Trajectories where numbers are hard: uneven times, far ends, flat arcs, vanishing harmonics."""

import numpy as np
import pytest
from identities.random_robots import random_pose

from robotmodels import trajectories
from robotmodels.errors import InvalidValueError
from robotmodels.se3.orientation import rotation_vectors_of
from robotmodels.trajectories import (
    MotionLimits,
    SplineEnds,
    Synchronisation,
    TimeLaw,
    blended_lines,
    blended_poses,
    circular_arc,
    cubic_spline,
    fourier,
    jerk_limited,
    quintic_spline,
    smoothed_trapezoidal,
    trapezoidal,
)
from robotmodels.trajectories.point_to_point import along_line
from robotmodels.trajectories.pose_trajectory import FixedAxisPath, axis_and_angle, rotation_about

# --- blends of poses -----------------------------------------------------------------------------


def along_x(*x):
    T = np.tile(np.eye(4), (len(x), 1, 1))
    T[:, 0, 3] = x
    return T


def integrated(move, T):
    """Pose at the end from the twist alone: a fourth-order Magnus series on short intervals."""
    times, half = move.path.times, 0.5 * move.path.blends
    marks = np.unique(np.clip(np.concatenate((times - half, times + half)), 0.0, move.duration))
    parts = np.linspace(marks[:-1], marks[1:], 257)
    a, b = parts[:-1].T.ravel(), parts[1:].T.ravel()
    middle, h, off = 0.5 * (a + b), (b - a)[:, None], (b - a) / np.sqrt(12.0)
    one, two = move.twist(middle - off), move.twist(middle + off)
    turn = 0.5 * h * (one + two)[:, 3:] + np.cross(two[:, 3:], one[:, 3:]) * h**2 * np.sqrt(3) / 12
    last = T.copy()
    last[:3, 3] += (0.5 * h * (one + two)[:, :3]).sum(axis=0)
    for R in rotation_about(*axis_and_angle(turn)):
        last[:3, :3] = R @ last[:3, :3]
    return last


def step_speeds(move, samples=4001):
    """Greatest speeds of translation and rotation between neighbouring samples."""
    t = np.linspace(0.0, move.duration, samples)
    T = move.pose(t)
    turn = rotation_vectors_of(T[1:, :3, :3] @ np.swapaxes(T[:-1, :3, :3], -1, -2))
    steps = np.stack((np.diff(T[:, :3, 3], axis=0), turn))
    return np.linalg.norm(steps, axis=-1).max(axis=-1) / t[1]


def assert_sound(T, limits, smooth):
    move = blended_poses(T, limits, smooth=smooth)
    assert np.abs(integrated(move, T[0]) - T[-1]).max() < 1e-8
    assert (step_speeds(move) < limits.velocity * (1.0 + 1e-6)).all()
    # the given ends are put in at the ends: the poses beside them show whether they had to be
    beside = np.array([np.nextafter(0.0, 1.0), np.nextafter(move.duration, 0.0)])
    assert np.abs(move.pose(beside) - T[[0, -1]]).max() < 1e-12
    assert np.abs(move.twist(beside)).max() < 1e-9
    t = np.linspace(0.0, move.duration, 2001)
    a = move.acceleration(t).reshape(-1, 2, 3)
    bound = limits.acceleration * (1.0 + 1e-9)
    assert (np.linalg.norm(a, axis=-1).max(axis=0) < bound).all()


@pytest.mark.parametrize("smooth", [False, True])
def test_a_long_blend_beside_a_short_one_makes_no_jump(smooth):
    limits = MotionLimits(velocity=[1.0, 1.0], acceleration=[0.6, 1.0])
    assert_sound(along_x(0.0, 1.0, 2.0), limits, smooth)
    assert_sound(along_x(0.0, 1.0, 2.0, 2.5, 1.0), limits, smooth)


@pytest.mark.parametrize("smooth", [False, True])
def test_blended_poses_go_where_their_twist_takes_them(rng, smooth):
    for _ in range(30):
        m = int(rng.integers(2, 6))
        T = np.stack([random_pose(rng) for _ in range(m)])
        if rng.random() < 0.3:
            T[-1, :3, :3] = T[0, :3, :3]  # translations alone
            T[1:-1, :3, :3] = T[0, :3, :3]
        v, a = 10.0 ** rng.uniform(-1.0, 1.0, (2, 2))
        assert_sound(T, MotionLimits(velocity=v, acceleration=a), smooth)


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("x", [(0, 0, 1), (0, 1, 1), (0, 1, 1, 2), (0, 0, 1, 1, 1, 0)])
@pytest.mark.parametrize("a", [0.6, 3.0])
def test_blends_stop_at_a_pose_given_twice(x, a, smooth):
    assert_sound(along_x(*x), MotionLimits(velocity=[1.0, 1.0], acceleration=[a, 1.0]), smooth)
    limits = MotionLimits(velocity=1.0, acceleration=a)
    path = blended_lines(np.array(x, float), limits=limits, smooth=smooth)
    # as long as the moves one after the other
    moves = [abs(d) for d in np.diff(x) if d]
    ramp = 1.0 / a if not smooth else 1.5 / a
    each = [d + ramp if d >= ramp else 2.0 * np.sqrt(d * ramp) for d in moves]
    assert path.duration == pytest.approx(sum(each), rel=1e-9)
    slow = blended_lines(np.array(x, float), 2.0 * path.duration, limits, smooth=smooth)
    assert slow.duration == pytest.approx(2.0 * path.duration, rel=1e-12)


# --- harmonics -----------------------------------------------------------------------------------


@pytest.mark.parametrize("small", [1e-320, 1e-200, 1e-30, 1e-17, 1e-16, 1e-15, 1e-12, 1e-8, 1e-4])
@pytest.mark.nightly
def test_extremes_of_a_series_whose_last_harmonics_vanish(rng, small):
    swing = fourier([[1.0], [small]], [[0.0], [0.0]], period=2.0)
    low, high = swing.motion.extremes(0)
    assert -low == pytest.approx([1.0 / np.pi], rel=2.0 * small + 1e-15)
    assert high == pytest.approx([1.0 / np.pi], rel=2.0 * small + 1e-15)
    t = np.linspace(0.0, 2.0, 20001)
    for H in (2, 5, 9):
        for vanishing in range(1, H):
            a, b = rng.normal(size=(2, H, 2))
            a[-vanishing:] *= small
            b[-vanishing:] *= small
            motion = fourier(a, b, period=2.0).motion
            for order in range(4):
                (x,) = motion.derivatives(t, (order,))
                (curve,) = motion.derivatives(t, (order + 2,))
                low, high = motion.extremes(order)
                scale = np.abs(x).max(axis=0)
                # the extreme is at most half a step from a sample
                beyond = np.abs(curve).max(axis=0) * t[1] ** 2 / 8.0 + 1e-13 * scale
                assert (low <= x.min(axis=0) + 1e-14 * scale).all()
                assert (x.min(axis=0) - beyond <= low).all()
                assert (high >= x.max(axis=0) - 1e-14 * scale).all()
                assert (high <= x.max(axis=0) + beyond).all()


def test_extremes_of_a_series_of_next_to_nothing():
    for size in (0.0, 1e-320, 1e-300, 1e300):
        motion = fourier([[size], [0.5 * size]], [[0.0], [0.0]], mean=[1.0], period=2.0).motion
        (v,) = motion.derivatives(np.linspace(0.0, 2.0, 2001), (1,))
        low, high = motion.extremes(1)
        assert high == pytest.approx(1.5 * size, rel=1e-2)
        assert (low <= v.min() * (1.0 - 1e-14) + 1e-14 * size).all()
        assert (low >= v.min() - 1e-5 * size - 5e-324).all()


# --- ends of long motions ------------------------------------------------------------------------


def test_a_short_last_piece_of_a_long_motion_ends_at_rest():
    fast = MotionLimits(velocity=1.0, acceleration=1e4)
    move = trapezoidal([0.0], [1000.0], limits=fast)
    assert np.array_equal(move.v(move.duration), [0.0])
    assert np.array_equal(move.q(move.duration), [1000.0])
    move = smoothed_trapezoidal([0.0], [1000.0], limits=fast)
    assert np.abs(move.at(move.duration).v).max() < 1e-12
    assert np.abs(move.at(move.duration).a).max() < 1e-12
    move = jerk_limited([0.0], [1000.0], limits=MotionLimits(1.0, 1e3, 1e6))
    assert np.abs(move.at(move.duration).a).max() < 1e-12
    # and what does not end at rest ends as it is asked to
    v1, a1 = np.array([0.5]), np.array([-3.0])
    move = jerk_limited([0.0], [1000.0], limits=MotionLimits(1.0, 10.0, 100.0), v1=v1, a1=a1)
    assert np.abs(move.v(move.duration) - v1).max() < 1e-12
    assert np.abs(move.a(move.duration) - a1).max() < 1e-11


@pytest.mark.parametrize("law", TimeLaw)
def test_end_states_of_random_motions_are_exact(rng, law):
    jumps = law in (TimeLaw.BANG_BANG, TimeLaw.TRAPEZOIDAL)
    for i in range(100):
        q0, q1 = rng.normal(size=(2, 3)) * 10.0 ** rng.uniform(-3.0, 3.0)
        v, a, j = 10.0 ** rng.uniform([-2.0, -2.0, -1.0], [2.0, 4.0, 6.0])
        limits = MotionLimits(v, a) if jumps else MotionLimits(v, a, j)
        how = (Synchronisation.COORDINATED, Synchronisation.SAME_TIME)[i % 2]
        move = along_line(law, q0, q1, None, limits, how)
        ends = move.at([0.0, move.duration])
        peak = [np.abs(np.stack(move.motion.extremes(order))).max() for order in range(3)]
        assert np.abs(ends.q - [q0, q1]).max() < 1e-12 * peak[0]
        if law is not TimeLaw.LINEAR:
            assert np.abs(ends.v).max() < 1e-12 * peak[1]
        if not jumps and law not in (TimeLaw.LINEAR, TimeLaw.CUBIC):
            assert np.abs(ends.a).max() < 1e-12 * peak[2]
        # no jump where one piece follows another, nor where the times of breaks are rounded
        if law is not TimeLaw.LINEAR:
            inner = move.motion.breaks.ravel()
            inner = inner[inner > 0.0]
            width = 4.0 * np.spacing(move.duration)
            beside = np.stack((np.nextafter(inner, 0.0), inner))
            gap = np.abs(np.diff(move.v(beside), axis=0)).max()
            assert gap <= width * peak[2] + 1e-12 * peak[1]


# --- joints that wait ----------------------------------------------------------------------------


def test_a_law_that_ends_with_a_jump_is_refused_where_a_joint_waits():
    independent = Synchronisation.INDEPENDENT
    limits = MotionLimits(velocity=1.0, acceleration=1.0, jerk=1.0)
    with pytest.raises(InvalidValueError, match=r"CUBIC ends .* waits.*joint 1: jerk"):
        along_line(TimeLaw.CUBIC, [0, 0.0], [1, 3.0], None, limits, independent)
    with pytest.raises(InvalidValueError, match=r"LINEAR ends .* joint 2: acceleration"):
        along_line(TimeLaw.LINEAR, [0, 0.0], [3, 1.0], None, limits.without_jerk(), independent)
    # no joint waits after a motion; no limit is broken by the jump
    along_line(TimeLaw.CUBIC, [0, 0.0, 0.0], [3, 3.0, 0.0], None, limits, independent)
    along_line(TimeLaw.CUBIC, [0, 0.0], [1, 3.0], 9.0, limits, independent)
    along_line(TimeLaw.LINEAR, [0, 0.0], [3, 1.0], None, MotionLimits(velocity=1.0), independent)


@pytest.mark.parametrize("law", TimeLaw)
def test_independent_motions_that_are_made_keep_their_limits(rng, law):
    made = 0
    for _ in range(60):
        q0, q1 = rng.normal(size=(2, 3))
        q1 = np.where(rng.random(3) < 0.3, q0, q1)
        v, a, j = 10.0 ** rng.uniform(-1.0, 1.0, 3)
        a, j = (x if rng.random() < 0.5 else np.inf for x in (a, j))
        below = {"jerk_lower": -1.0} if rng.random() < 0.3 else {}
        limits = MotionLimits(v, a, j, **below)
        try:
            move = along_line(law, q0, q1, None, limits, Synchronisation.INDEPENDENT)
        except InvalidValueError:
            continue
        made += 1
        assert move.check(limits).kept
    assert made


# --- splines -------------------------------------------------------------------------------------


def rounding_of(path):
    """Rounding error (K, n) of the coefficients of each piece, of the sum of their moduli.

    A coefficient is a sum of the states at the ends of its piece with factors up to 15, a state
    one of the coefficients with factors up to 20.
    """
    return 100.0 * np.finfo(float).eps * np.abs(path.motion.coefficients).sum(axis=1)


def test_splines_of_uneven_times_meet_their_points(rng):
    times = np.array([0.0, 1e-3, 1.0, 1.001, 2.0, 50.0, 50.1, 60.0])
    points = rng.normal(size=(8, 3))
    for make in (cubic_spline, quintic_spline):
        path = make(points, times)
        assert np.array_equal(path.q(times[:-1]), points[:-1])
        missed = path.motion.coefficients.sum(axis=1) - points[1:]
        assert (np.abs(missed) < rounding_of(path)).all()
    for _ in range(200):
        times = np.cumsum(np.concatenate(((0.0,), 10.0 ** rng.uniform(-1.0, 1.0, 7))))
        v0, v1, a0, a1 = rng.normal(size=(4, 3))
        path = quintic_spline(points, times, v0=v0, v1=v1, a0=a0, a1=a1)
        # points are met, the derivatives go on from piece to piece and end as they are asked to
        slopes, h = path.motion.coefficients, path.motion.lengths[0][:, None]
        for order in range(5):
            first, last = slopes[:, 0] / h**order, slopes.sum(axis=1) / h**order
            # times differ a hundredfold: the last derivatives lose digits to it
            size = np.abs(slopes).sum(axis=1) / h**order
            allowed = (1e-12 if order < 3 else 1e-8) * size
            assert (np.abs(first[1:] - last[:-1]) < allowed[1:] + allowed[:-1]).all()
            if order < 3:
                start, end = (points[[0, -1]], (v0, v1), (a0, a1))[order]
                assert (np.abs(first[0] - start) < allowed[0]).all()
                assert (np.abs(last[-1] - end) < allowed[-1]).all()
            slopes = np.arange(1.0, 6 - order)[:, None] * slopes[:, 1:]


# --- arcs ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("height", [0.6, 0.1, 1e-3, 1e-5, 1e-7, 3e-9])
@pytest.mark.parametrize("side", [1e-3, 1.0, 1e3])
@pytest.mark.nightly
def test_flat_arcs_meet_their_points(rng, height, side):
    limits = MotionLimits(velocity=[side, 1.0], acceleration=[side, 1.0])
    for _ in range(10):
        T0, T1 = random_pose(rng), random_pose(rng)
        R = random_pose(rng)[:3, :3]
        x, rise = rng.uniform(0.2, 0.8), height * rng.choice([-1.0, 1.0])
        p = np.zeros(3) if side < 1.0 else side * rng.normal(size=3)
        m = p + side * R @ [x, 4.0 * x * (1.0 - x) * rise, 0.0]
        e = p + side * R @ [1.0, 0.0, 0.0]
        T0[:3, 3], T1[:3, 3] = p, e
        move = circular_arc(T0, m, T1, limits=limits)
        path = move.path
        assert isinstance(path, FixedAxisPath)
        size = max(side, np.abs(p).max())
        # the last pose is put in at the end: the one beside it shows whether it had to be
        beside = path.poses(np.array([1.0 - 1e-15]))[0, :3, 3]
        assert np.abs(beside - e).max() < 1e-14 * size
        s = np.linspace(0.0, 1.0, 201)
        X = path.poses(s)[:, :3, 3]
        near = int(np.abs(np.linalg.norm(X - m, axis=-1)).argmin())
        # on the way of the points: through the middle one
        fine = np.linspace(s[max(near - 1, 0)], s[min(near + 1, 200)], 3)
        for _ in range(60):
            way = np.linalg.norm(path.poses(fine)[:, :3, 3] - m, axis=-1)
            k = int(way.argmin())
            width = 0.6 * (fine[1] - fine[0])
            fine = np.clip(fine[k] + np.array([-width, 0.0, width]), 0.0, 1.0)
        assert way.min() < 1e-14 * size
        # with as much curvature as the three points have, everywhere
        local = (X - p) @ R
        chord_m = x * (1.0 - x) - (4.0 * x * (1.0 - x) * rise) ** 2
        offset = chord_m / (2.0 * 4.0 * x * (1.0 - x) * rise)  # of the centre, below the chord
        u, w = local[:, 0] / side, local[:, 1] / side
        assert np.abs(u * (1.0 - u) - w * w - 2.0 * offset * w).max() < max(
            1e-13, 4e-15 * size / side * max(1.0, abs(offset))
        )
        assert np.abs(local[:, 2]).max() < 1e-14 * size


def test_points_of_no_arc_are_refused(rng):
    for offset in (0.0, 5.0, 1e5):
        for height in (0.0, 1e-10, 1e-12):
            R, p = random_pose(rng)[:3, :3], offset * rng.normal(size=3)
            T0, T1 = np.eye(4), np.eye(4)
            T0[:3, 3], T1[:3, 3] = p, p + R @ [1.0, 0.0, 0.0]
            with pytest.raises(InvalidValueError, match="straight_line"):
                circular_arc(T0, p + R @ [0.4, height, 0.0], T1, duration=1.0)


# --- closing, and the end of the time ------------------------------------------------------------


@pytest.mark.parametrize("size", [1e-9, 1e-3, 1.0, 1e3])
def test_periodic_splines_close_beside_their_own_size(rng, size):
    points = size * rng.normal(size=(5, 2))
    times = np.arange(6.0)
    reach = np.ptp(points, axis=0)
    nearly = np.vstack((points, points[:1] + 0.5e-9 * reach))
    loop = cubic_spline(nearly, times, ends=SplineEnds.PERIODIC)
    assert np.abs(loop.q(0.0) - loop.q(5.0)).max() < 1e-14 * size
    wide = nearly.copy()
    wide[-1, 1] += 2e-9 * reach[1]
    with pytest.raises(InvalidValueError, match=r"joint 2 ends .* beside its start"):
        cubic_spline(wide, times, ends=SplineEnds.PERIODIC)
    # a joint that stays has rounding alone
    points[:, 1] = np.pi * size
    ring = np.vstack((points, points[:1]))
    ring[-1, 1] = np.nextafter(ring[-1, 1], np.inf)
    cubic_spline(ring, times, ends=SplineEnds.PERIODIC)


def test_a_rounding_after_the_end_is_the_end(rng):
    for T in (1e-3, 1.0, 0.3, 1e3):
        move = cubic_spline(rng.normal(size=(3, 2)), [0.0, 0.4 * T, T], v0=1.0, v1=2.0)
        for t, end in ((np.nextafter(T, np.inf), T), (T + 2.0 * np.spacing(T), T), (-1e-20, 0.0)):
            for part in (move.q, move.v, move.a, move.jerk):
                assert np.array_equal(part(t), part(end))
                assert np.array_equal(part([t, 0.2 * T]), part([end, 0.2 * T]))
        for t in (T * (1.0 + 1e-14), -1e-14 * T):
            with pytest.raises(InvalidValueError, match="does not rest"):
                move.q(t)
    many = np.cumsum(np.full(3, 0.1))  # 0.30000000000000004
    short = cubic_spline([0.0, 1.0], [0.0, 0.3], v1=2.0)
    assert short.v(many)[-1] == pytest.approx(2.0, rel=1e-12)


@pytest.mark.parametrize("unit", [1e-40, 1e-20, 1e20, 1e40])
@pytest.mark.parametrize("name", ["cubic", "quintic", "smoothed_trapezoidal", "jerk_limited"])
def test_times_do_not_depend_on_the_unit_of_length(name, unit):
    law = getattr(trajectories, name)
    for V, A, J in ((1.0, 1.0, 1.0), (1.0, 0.3, 7.0), (0.2, 5.0, 0.1)):
        one = law([0.0], [1.0], limits=MotionLimits(V, A, J))
        other = law([0.0], [unit], limits=MotionLimits(V * unit, A * unit, J * unit))
        assert other.duration == pytest.approx(one.duration, rel=1e-12)
        t = np.linspace(0.0, 1.0, 7) * min(one.duration, other.duration)
        np.testing.assert_allclose(other.q(t) / unit, one.q(t), rtol=1e-9, atol=1e-14)


@pytest.mark.parametrize("name", ["linear", "cubic", "quintic", "smoothed_trapezoidal"])
def test_motions_of_extreme_size_are_refused(name):
    law = getattr(trajectories, name)
    for way, options in (
        (1e300, {"limits": MotionLimits(1e-9, 1.0, 1.0)}),
        (1.0, {"duration": 1e-200}),
        (1.0, {"limits": MotionLimits(1e300, 1e308, 1.0)}),
    ):
        with pytest.raises(InvalidValueError, match=r"1e-50 to 1e\+50"):
            law([0.0], [way], **options)


@pytest.mark.parametrize("name", ["cubic", "quintic", "jerk_limited"])
@pytest.mark.parametrize(
    ("way", "speed", "limits"),
    [(1e300, 1e-10, (1e-9, 1.0, 1.0)), (1e-200, 1e-205, (1.0, 1e-200, 1.0)),
     (1.0, 1e-205, (1.0, 1.0, 1.0)), (1.0, 0.1, (1e100, 1.0, 1.0))],
)  # fmt: skip
def test_extreme_states_at_the_ends_are_refused(name, way, speed, limits):
    with pytest.raises(InvalidValueError, match=r"1e-50 to 1e\+50"):
        getattr(trajectories, name)([0.0], [way], limits=MotionLimits(*limits), v0=[speed])
