"""Motions through points and in space, Fourier series, and the way from poses to joints."""

import pickle
import re
import sys
from itertools import pairwise

import numpy as np
import pytest
from identities.random_robots import random_pose
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from robotmodels import se3
from robotmodels.errors import InvalidValueError, NotARotationError, ShapeError
from robotmodels.igm import igm
from robotmodels.kinematics import dgm, jacobian
from robotmodels.robots import load
from robotmodels.se3.orientation import rotation_vectors_of
from robotmodels.trajectories import (
    MotionLimits,
    PathEventKind,
    SplineEnds,
    TimeLaw,
    blended_lines,
    blended_poses,
    cartesian_trajectory,
    circle,
    circular_arc,
    cubic_spline,
    fourier,
    fourier_basis,
    joint_path,
    quintic_spline,
    straight_line,
    trapezoidal,
)
from robotmodels.trajectories.follow import following
from robotmodels.trajectories.path_events import inverted
from robotmodels.trajectories.pose_trajectory import rotation_about


def central(f, t, h=1e-5):
    return (f(t + h) - f(t - h)) / (2 * h)


def twist_of(pose, t, h=1e-5):
    """Velocity of a pose by central differences, world axes."""
    after, before = pose(t + h), pose(t - h)
    w = rotation_vectors_of(after[:, :3, :3] @ np.swapaxes(before[:, :3, :3], -1, -2)) / (2 * h)
    return np.hstack(((after[:, :3, 3] - before[:, :3, 3]) / (2 * h), w))


# --- rotations -----------------------------------------------------------------------------------


def test_rotation_vectors_are_exact_at_every_angle(rng):
    for angle in (0.0, 1e-300, 1e-12, 1e-8, 0.3, 3.0, np.pi - 1e-9, np.pi - 1e-14, np.pi):
        u = rng.normal(size=(50, 3))
        u /= np.linalg.norm(u, axis=-1, keepdims=True)
        R = rotation_about(u, np.full(50, angle))
        r = rotation_vectors_of(R)
        assert np.abs(np.linalg.norm(r, axis=-1) - angle).max() < 1e-14
        size = np.linalg.norm(r, axis=-1)
        back = rotation_about(
            np.where(size[:, None] > 0, r / np.maximum(size, 1e-310)[:, None], u), size
        )
        # four roundings of the angle, and of the entries
        assert np.abs(back - R).max() < 4.0 * np.finfo(float).eps * (1.0 + angle)
        if 1e-12 <= angle < 3.1:
            assert np.abs(r / angle - u).max() < 1e-12


# --- ctraj ---------------------------------------------------------------------------------------


def test_cartesian_trajectory_is_a_trapezoid_with_slerp(rng):
    T0, T1 = random_pose(rng), random_pose(rng)
    T = cartesian_trajectory(T0, T1, 50)
    x = np.arange(50) / 49.0
    s = np.where(
        x < 1 / 3, 2.25 * x**2, np.where(x < 2 / 3, 1.5 * x - 0.25, 1 - 2.25 * (1 - x) ** 2)
    )
    turn = Slerp([0.0, 1.0], Rotation.from_matrix([T0[:3, :3], T1[:3, :3]]))(s).as_matrix()
    assert np.abs(T[:, :3, :3] - turn).max() < 1e-14
    size = np.abs([T0[:3, 3], T1[:3, 3]]).max()
    missed = T[:, :3, 3] - T0[:3, 3] - s[:, None] * (T1 - T0)[:3, 3]
    assert np.abs(missed).max() < 16.0 * np.finfo(float).eps * size
    assert np.array_equal(T[[0, -1]], [T0, T1])
    assert (T[:, 3] == [0.0, 0.0, 0.0, 1.0]).all()


def test_cartesian_trajectory_shapes_and_laws(rng):
    T0, T1 = random_pose(rng), random_pose(rng)
    assert cartesian_trajectory(T0, T1, 0).shape == (0, 4, 4)
    assert np.array_equal(cartesian_trajectory(T0, T1, 1), [T0])
    assert np.array_equal(cartesian_trajectory(T0, T0, 5), [T0] * 5)
    many = cartesian_trajectory(np.stack([T0, T1, T0]), T1, 7)
    assert many.shape == (3, 7, 4, 4)
    assert np.array_equal(many[0], cartesian_trajectory(T0, T1, 7))
    assert cartesian_trajectory(np.zeros((0, 4, 4)), T1, 7).shape == (0, 7, 4, 4)
    x = np.linspace(0.0, 1.0, 9)
    for law, s in ((TimeLaw.LINEAR, x), (TimeLaw.CUBIC, 3 * x**2 - 2 * x**3),
                   (TimeLaw.QUINTIC, 10 * x**3 - 15 * x**4 + 6 * x**5)):  # fmt: skip
        T = cartesian_trajectory(T0, T1, 9, law)
        assert np.abs(T[:, :3, 3] - T0[:3, 3] - s[:, None] * (T1 - T0)[:3, 3]).max() < 1e-14
    half = cartesian_trajectory(np.eye(4), se3.rotation("y", np.pi), 5)
    assert np.abs(half[2] - se3.rotation("y", np.pi / 2)).max() < 1e-15
    with pytest.raises(InvalidValueError, match="whole number"):
        cartesian_trajectory(T0, T1, 2.5)
    with pytest.raises(InvalidValueError, match="whole number"):
        cartesian_trajectory(T0, T1, -1)
    with pytest.raises(NotARotationError):
        cartesian_trajectory(2 * T0, T1, 5)
    with pytest.raises(InvalidValueError, match="limits"):
        cartesian_trajectory(T0, T1, 5, TimeLaw.JERK_LIMITED)


# --- splines -------------------------------------------------------------------------------------


def test_splines_meet_points_and_end_states(rng):
    points, times = rng.normal(size=(7, 3)), np.cumsum([0.0, 0.3, 1.0, 0.5, 0.4, 2.0, 0.7])
    v0, v1, a0, a1 = rng.normal(size=(4, 3))
    three = cubic_spline(points, times, v0=v0, v1=v1)
    five = quintic_spline(points, times, v0=v0, v1=v1, a0=a0, a1=a1)
    for path, smooth in ((three, 2), (five, 4)):
        assert np.abs(path.q(times) - points).max() < 1e-12
        assert np.abs(path.v([0.0, times[-1]]) - [v0, v1]).max() < 1e-10
        parts = (path.q, path.v, path.a, path.jerk)
        t = np.linspace(0.02, 0.98, 40) * times[-1]
        t = t[np.abs(t[:, None] - times).min(axis=-1) > 1e-4]
        for low, high in pairwise(parts):
            assert np.abs(central(low, t) - high(t)).max() < 1e-5 * np.abs(high(t)).max()
        for part in parts[: smooth + 1]:
            jump = part(times[1:-1] + 1e-9) - part(times[1:-1] - 1e-9)
            assert np.abs(jump).max() < 1e-5 * np.abs(part(t)).max()
    assert np.abs(five.a([0.0, times[-1]]) - [a0, a1]).max() < 1e-9
    t = np.linspace(0.0, times[-1], 90)
    theirs = CubicSpline(times, points, bc_type=((1, v0), (1, v1)))
    assert np.abs(three.q(t) - theirs(t)).max() < 1e-13
    assert np.abs(three.a(t) - theirs(t, 2)).max() < 1e-11 * np.abs(theirs(t, 2)).max()
    # a polynomial of its own order is given back
    p = np.polynomial.Polynomial(rng.normal(size=6))
    exact = quintic_spline(p(times), times, v0=p.deriv()(0), v1=p.deriv()(times[-1]),
                           a0=p.deriv(2)(0), a1=p.deriv(2)(times[-1]))  # fmt: skip
    assert (
        np.abs(
            exact.q(t) / np.maximum(1.0, np.abs(p(t))) - p(t) / np.maximum(1.0, np.abs(p(t)))
        ).max()
        < 1e-9
    )


def test_ends_of_cubic_splines(rng):
    points = rng.normal(size=(5, 2))
    natural = cubic_spline(points, np.arange(5.0), ends=SplineEnds.NATURAL)
    assert np.abs(natural.a([0.0, 4.0])).max() < 1e-12
    ring = np.vstack((points, points[:1]))
    loop = cubic_spline(ring, np.arange(6.0), ends=SplineEnds.PERIODIC)
    assert np.abs(loop.v(0.0) - loop.v(5.0)).max() < 1e-12
    assert np.abs(loop.a(0.0) - loop.a(5.0)).max() < 1e-11
    with pytest.raises(InvalidValueError, match="ends where it began"):
        cubic_spline(points, np.arange(5.0), ends=SplineEnds.PERIODIC)
    with pytest.raises(InvalidValueError, match="clamped"):
        cubic_spline(points, np.arange(5.0), v0=1.0, ends=SplineEnds.NATURAL)


@pytest.mark.parametrize("make", [cubic_spline, quintic_spline])
def test_splines_are_as_quick_as_their_limits_allow(make, rng):
    for _ in range(20):
        points = rng.normal(size=(6, 3))
        limits = MotionLimits([1.0, 2.0, 3.0], 4.0, 40.0, acceleration_lower=-2.0)
        path = make(points, limits=limits)
        report = path.check(limits, 1e-12)
        assert report.kept
        assert report.stretch > 1.0 - 1e-9  # some limit is used in full
        times = path.motion.breaks[0]
        assert np.abs(path.q(times) - points).max() < 1e-12
        with pytest.raises(InvalidValueError, match=r"least factor on the times is 1\.11"):
            make(points, times * 0.9, limits)
    with pytest.raises(InvalidValueError, match="same"):
        make([0.0, 1.0, 1.0], limits=MotionLimits(1.0, 1.0))
    with pytest.raises(InvalidValueError, match="times"):
        make([0.0, 1.0, 2.0], limits=MotionLimits(1.0, 1.0), v0=0.5)
    with pytest.raises(InvalidValueError, match="ascend"):
        make([0.0, 1.0, 2.0], [0.0, 1.0, 1.0])
    with pytest.raises(InvalidValueError, match="times, limits"):
        make([0.0, 1.0])
    with pytest.raises(ShapeError, match="at least two"):
        make([0.0], [0.0])


# --- lines with blends ---------------------------------------------------------------------------


@pytest.mark.parametrize("smooth", [False, True])
def test_blends_keep_limits_and_pass_beside_the_points(smooth, rng):
    for _ in range(60):
        points = rng.normal(size=(int(rng.integers(2, 8)), 3))
        limits = MotionLimits(
            rng.uniform(0.5, 2.0, 3),
            rng.uniform(0.5, 8.0, 3),
            rng.uniform(5.0, 50.0, 3) if smooth else np.inf,
            acceleration_lower=-rng.uniform(0.5, 8.0, 3),
        )
        path = blended_lines(points, limits=limits, smooth=smooth)
        assert path.check(limits, 1e-10).kept
        T = path.duration
        assert np.abs(path.q([0.0, T]) - points[[0, -1]]).max() < 1e-12
        assert np.abs(path.v([0.0, T])).max() < 1e-12
        breaks, lengths = path.motion.breaks[0], path.motion.lengths[0]
        for k in range(1, len(points) - 1):
            # the middle of the blend, and the formula of the distance
            middle, tb = breaks[2 * k] + 0.5 * lengths[2 * k], lengths[2 * k]
            change = path.v(breaks[2 * k] + tb) - path.v(breaks[2 * k])
            away = (3 / 32 if smooth else 1 / 8) * change * tb
            assert np.abs(path.q(middle) - points[k] - away).max() < 1e-9
        order = (path.q, path.v, path.a) if smooth else (path.q, path.v)
        for part in order:
            inner = breaks[1:-1]
            assert np.abs(part(inner + 1e-11) - part(inner - 1e-11)).max() < 1e-7
        slow = blended_lines(points, 1.3 * T, limits, smooth=smooth)
        assert abs(slow.duration - 1.3 * T) < 1e-12 * T
        with pytest.raises(InvalidValueError, match="least is"):
            blended_lines(points, 0.9 * T, limits, smooth=smooth)


def test_blends_of_two_points_are_the_trapezoid(rng):
    for _ in range(100):
        L, V, A = 10.0 ** rng.uniform(-1.0, 1.0, 3)
        limits = MotionLimits(V, A)
        path, best = blended_lines([0.0, L], limits=limits), trapezoidal(0.0, L, limits=limits)
        assert abs(path.duration / best.duration - 1.0) < 1e-11
        t = np.linspace(0.0, 1.0, 21) * min(path.duration, best.duration)
        assert np.abs(path.q(t) - best.q(t)).max() < 1e-10 * L


def test_blends_of_given_times():
    path = blended_lines([[0.0], [1.0], [3.0]], segment_times=[1.0, 2.0], blend_times=0.5)
    assert path.duration == 3.5
    assert np.abs(path.q(1.25) - 1.0).max() < 1e-12  # equal velocities: no corner, no blend
    with pytest.raises(InvalidValueError, match="overlap"):
        blended_lines([0.0, 1.0, 0.0], segment_times=1.0, blend_times=1.2)
    with pytest.raises(InvalidValueError, match="blend_times"):
        blended_lines([0.0, 1.0], segment_times=1.0)
    with pytest.raises(InvalidValueError, match="smooth=True"):
        blended_lines([0.0, 1.0], limits=MotionLimits(1.0, 1.0, 1.0))
    with pytest.raises(InvalidValueError, match="velocity"):
        blended_lines([0.0, 1.0], limits=MotionLimits(acceleration=1.0))
    with pytest.raises(InvalidValueError, match="not kept"):
        blended_lines([0.0, 1.0], limits=MotionLimits(0.5, 9.0), segment_times=1.0)
    with pytest.raises(InvalidValueError, match="Give limits"):
        blended_lines([0.0, 1.0])
    stay = blended_lines([[1.0, 2.0]] * 3, limits=MotionLimits(1.0, 1.0))
    assert stay.duration == 0.0
    assert np.array_equal(stay.q(0.0), [1.0, 2.0])


# --- Fourier series ------------------------------------------------------------------------------


def test_fourier_series_and_its_derivatives(rng):
    a, b, mean = rng.normal(size=(5, 3)), rng.normal(size=(5, 3)), rng.normal(size=3)
    move = fourier(a, b, mean, period=7.0, periods=2.0)
    assert move.duration == 14.0
    t = rng.uniform(-20.0, 40.0, 60)
    k, w = np.arange(1, 6), 2 * np.pi / 7.0
    S, C = np.sin(t[:, None] * k * w), np.cos(t[:, None] * k * w)
    assert np.abs(move.q(t) - mean - (S / (k * w)) @ a + (C / (k * w)) @ b).max() < 1e-12
    parts = (move.q, move.v, move.a, move.jerk)
    for order, part in enumerate(parts):
        if order:
            assert np.abs(central(parts[order - 1], t) - part(t)).max() < 1e-7 * (5 * w) ** 4
        basis = fourier_basis(t, 5, 7.0, order)
        assert np.abs(basis @ np.vstack((mean, a, b)) - part(t)).max() < 1e-12 * (5 * w) ** order
        dense = part(np.linspace(0.0, 7.0, 20001))
        low, high = move.motion.extremes(order)
        assert np.abs(dense.min(axis=0) - low).max() < 1e-5 * np.abs(low).max()
        assert (low <= dense.min(axis=0) + 1e-12 * np.abs(low)).all()
        assert (high >= dense.max(axis=0) - 1e-12 * np.abs(high)).all()
    assert np.abs(move.q(t) - move.q(t + 7.0)).max() < 1e-12
    assert move.check(MotionLimits(100.0, 1000.0)).kept
    assert not move.check(MotionLimits(0.1)).kept
    one = fourier([1.0], [0.5], 0.2)
    assert one.q(0.0).shape == ()
    assert np.array_equal(pickle.loads(pickle.dumps(move)).q(t), move.q(t))
    with pytest.raises(ShapeError):
        fourier(a, b[:4], mean)
    with pytest.raises(InvalidValueError, match="above 0"):
        fourier(a, b, mean, period=0.0)


# --- in space ------------------------------------------------------------------------------------

SPACE = MotionLimits([0.5, 1.0], [1.5, 3.0])


def check_motion(move, limits=SPACE, corner=1e-4):
    """Twist and acceleration are the derivatives of the poses, and keep the limits."""
    t = np.linspace(0.003, 0.997, 301) * move.duration
    assert np.abs(twist_of(move.pose, t) - move.twist(t)).max() < corner
    h = 1e-6
    numeric = (move.twist(t + h) - move.twist(t - h)) / (2 * h)
    off = np.abs(numeric - move.acceleration(t)).max(axis=-1)
    assert (off < 1e-4).mean() > 0.97  # not where the acceleration jumps
    for k, rows in enumerate((slice(0, 3), slice(3, 6))):
        speed = np.linalg.norm(move.twist(t)[:, rows], axis=-1)
        pull = np.linalg.norm(move.acceleration(t)[:, rows], axis=-1)
        assert speed.max() <= limits.velocity[k] * (1 + 1e-12)
        assert pull.max() <= limits.acceleration[k] * (1 + 1e-12)


@pytest.mark.parametrize("law", [law for law in TimeLaw if law is not TimeLaw.LINEAR])
def test_straight_line(law, rng):
    limits = SPACE if law is not TimeLaw.JERK_LIMITED else MotionLimits([0.5, 1.0], [1.5, 3.0], 9.0)
    T0, T1 = random_pose(rng), random_pose(rng)
    move = straight_line(T0, T1, limits=limits, law=law)
    check_motion(move)
    assert np.array_equal(move.pose([0.0, move.duration]), [T0, T1])
    assert np.array_equal(move.pose([-1.0, 99.0]), [T0, T1])
    assert not move.twist([-1.0, 99.0]).any()
    with pytest.raises(InvalidValueError, match="least is"):
        straight_line(T0, T1, 0.9 * move.duration, limits, law)


def test_limits_in_space_are_of_translation_and_rotation():
    A, B = np.eye(4), se3.translation(0.3, 0, 0) @ se3.rotation("z", 0.5)
    no_turn = MotionLimits(velocity=[0.5, 0.0], acceleration=2.0)
    no_way = MotionLimits(velocity=1.0, acceleration=[0.0, 2.0])
    three = MotionLimits(velocity=[0.5, 1.0, 1.0], acceleration=2.0)
    for make in (
        lambda limits: straight_line(A, B, limits=limits),
        lambda limits: circular_arc(A, [0.1, 0.2, 0.0], B, limits=limits),
        lambda limits: circle(A, [0, 1, 0], [0, 0, 1], 1.0, limits=limits, turning=True),
        lambda limits: blended_poses([A, B], limits),
    ):
        for limits, words in (
            (no_turn, "velocity of rotation"),
            (no_way, "acceleration of translation"),
            (three, "translation .m. and rotation .rad."),
        ):
            with pytest.raises((InvalidValueError, ShapeError), match=words) as refusal:
                make(limits)
            assert not re.search("joint [0-9]|[0-9] joints", str(refusal.value))
    # what does not move needs no limit, also where rounding sees a rotation
    rounded = np.eye(4)
    rounded[0, 1], rounded[1, 0] = 1e-16, -1e-16
    assert rotation_vectors_of(rounded[:3, :3]).any()
    for start in (A, rounded):
        end = se3.translation(1, 0, 0)
        assert straight_line(start, end, limits=no_turn).duration > 2.0
        assert blended_poses([start, end], no_turn).duration > 2.0


def test_straight_line_of_a_duration_is_ctraj(rng):
    T0, T1 = random_pose(rng), random_pose(rng)
    move = straight_line(T0, T1, duration=3.0)
    grid = move.resample(50)
    assert np.abs(np.asarray(grid) - cartesian_trajectory(T0, T1, 50)).max() < 1e-14
    assert len(grid) == 50
    assert straight_line(T0, T0, limits=SPACE).duration == 0.0
    turn = straight_line(np.eye(4), se3.rotation("z", 1.0), limits=MotionLimits([0.0, 1.0], 2.0))
    assert abs(turn.duration - 1.5) < 1e-12  # no translation: its limit does not matter
    assert pickle.loads(pickle.dumps(move)) == move
    with pytest.raises(InvalidValueError, match="alike both ways"):
        straight_line(T0, T1, limits=MotionLimits(1.0, 1.0, velocity_lower=-2.0))
    with pytest.raises(InvalidValueError, match="duration, limits"):
        straight_line(T0, T1)


def test_circles(rng):
    T0, T1 = random_pose(rng), random_pose(rng)
    through = rng.normal(size=3)
    arc = circular_arc(T0, through, T1, limits=SPACE)
    check_motion(arc)
    P = arc.pose(np.linspace(0.0, arc.duration, 2001))[:, :3, 3]
    r = np.linalg.norm(P - arc.path.centre, axis=-1)
    assert np.ptp(r) < 1e-12 * r.max()
    step = np.linalg.norm(np.diff(P, axis=0), axis=-1).max()
    assert np.linalg.norm(P - through, axis=-1).min() < step
    assert np.array_equal(arc.pose([0.0, arc.duration]), [T0, T1])
    for turning in (False, True):
        ring = circle(T0, [0.1, 0.2, 0.3], [1.0, 1.0, 0.5], 7.0, limits=SPACE, turning=turning)
        check_motion(ring)
    full = circle(T0, [0.1, 0.2, 0.3], [1.0, 1.0, 0.5], limits=SPACE)
    assert np.abs(full.pose(full.duration) - T0).max() < 1e-14
    with pytest.raises(InvalidValueError, match="one line"):
        circular_arc(np.eye(4), [1.0, 0.0, 0.0], se3.translation(2.0, 0.0, 0.0), 1.0)
    with pytest.raises(InvalidValueError, match="no length"):
        circle(T0, [0, 0, 0], [0, 0, 0], duration=1.0)
    with pytest.raises(InvalidValueError, match="on the axis"):
        circle(np.eye(4), [0, 0, 1], [0, 0, 1], duration=1.0)


@pytest.mark.parametrize("law", TimeLaw)
@pytest.mark.nightly
def test_circles_use_their_limits_in_full(law, rng):
    """The lengths of the vectors are sampled; no other shape of the law is quicker."""
    jumps = law in (TimeLaw.LINEAR, TimeLaw.BANG_BANG, TimeLaw.TRAPEZOIDAL)
    for radius in (0.1, 2.0):
        V, A, J = rng.uniform(0.3, 1.5), rng.uniform(1.0, 4.0), rng.uniform(10.0, 60.0)
        limits = MotionLimits([V, 4.0], [A, 9.0], np.inf if jumps else [J, 90.0])
        start = random_pose(rng)
        start[:3, 3] = [radius, 0.0, 0.0]
        move = circle(start, [0, 0, 0.2], [0, 0, 1.0], 2.5, limits=limits, law=law, turning=True)
        T, motion = move.duration, move.law.motion
        t = np.unique(np.concatenate((np.linspace(0.0, T, 20001), motion.breaks[0])))
        eps = 1e-12 * T
        t = np.clip(np.concatenate((t - eps, t + eps)), 0.0, T)  # both sides of jumps
        s = move.law.at(t)
        L, r = 2.5 * radius, radius
        v, a, j = (np.linalg.norm(x, axis=-1) for x in (
            move.twist(t)[:, :3], move.acceleration(t)[:, :3],
            np.stack((L * s.jerk - (L * s.v) ** 3 / r**2, 3 * L * L * s.v * s.a / r), axis=-1),
        ))  # fmt: skip
        shares = [v.max() / V, 2.5 * np.abs(s.v).max() / 4.0, a.max() / A]
        shares += [2.5 * np.abs(s.a).max() / 9.0] if law is not TimeLaw.LINEAR else []
        shares += [] if jumps else [j.max() / J, 2.5 * np.abs(s.jerk).max() / 90.0]
        assert max(shares) <= 1.0 + 1e-12
        assert max(shares) > 1.0 - 1e-6
        with pytest.raises(InvalidValueError, match="least is"):
            circle(start, [0, 0, 0.2], [0, 0, 1.0], 2.5, 0.99 * T, limits, law, turning=True)
        slow = circle(start, [0, 0, 0.2], [0, 0, 1.0], 2.5, 2.0 * T, limits, law, turning=True)
        assert slow.duration == 2.0 * T


def test_trapezoid_on_a_circle_is_the_quickest(rng):
    """A scan of cruise velocities, each with the acceleration that is left beside the centre's."""
    for _ in range(20):
        r, A, angle = rng.uniform(0.1, 2.0), rng.uniform(1.0, 4.0), rng.uniform(0.3, 6.0)
        L, V = r * angle, rng.uniform(0.3, 3.0)
        limits = MotionLimits([V, np.inf], [A, np.inf])
        move = circle(se3.translation(r, 0, 0), [0, 0, 0], [0, 0, 1], angle, limits=limits)
        v = np.linspace(0.0, min(V, np.sqrt(A * r)), 20002)[1:-1]
        along = np.sqrt(A * A - (v * v / r) ** 2)
        times = np.where(v * v / along <= L, L / v + v / along, np.inf)
        assert move.duration <= times.min() * (1.0 + 1e-12)
        assert move.duration >= times.min() / 1.001


@pytest.mark.parametrize("smooth", [False, True])
def test_blended_poses(smooth, rng):
    for _ in range(6):
        poses = np.stack([random_pose(rng) for _ in range(5)])
        move = blended_poses(poses, SPACE, smooth=smooth)
        check_motion(move)
        assert np.array_equal(move.pose([0.0, move.duration]), poses[[0, -1]])
        assert np.abs(move.twist([0.0, move.duration])).max() < 1e-12
        slow = blended_poses(poses, SPACE, 1.5 * move.duration, smooth=smooth)
        assert abs(slow.duration / move.duration - 1.5) < 1e-12
        with pytest.raises(InvalidValueError, match="least is"):
            blended_poses(poses, SPACE, 0.5 * move.duration, smooth=smooth)
        # half way between corners the motion is on its line
        corners, k = move.path.times, 2
        middle = 0.5 * (corners[k] + corners[k + 1])
        line = cartesian_trajectory(poses[k], poses[k + 1], 3, TimeLaw.LINEAR)
        assert np.abs(move.pose(middle) - line[1]).max() < 1e-12
    positions = poses.copy()
    positions[:, :3, :3] = np.eye(3)
    move = blended_poses(positions, SPACE, smooth=smooth)
    assert np.abs(move.pose(np.linspace(0, move.duration, 9))[:, :3, :3] - np.eye(3)).max() < 1e-15
    with pytest.raises(InvalidValueError, match="jerk"):
        blended_poses(poses, MotionLimits(1.0, 1.0, 1.0))
    with pytest.raises(ShapeError, match="at least two"):
        blended_poses(poses[:1], SPACE)


# --- from poses to joints ------------------------------------------------------------------------

Q = {
    "rx90": [0.1, 0.2, -0.5, 0.4, 0.7, 0.6],
    "ur5": [0.1, -1.2, 1.3, 0.4, 0.8, 0.6],
    "lab_rr": [0.2, -0.4],
    "lab_rrt": [0.2, -0.4, 0.3],
    "lab_trr": [0.2, -0.4, 0.9],
}


@pytest.mark.parametrize("name", Q)
def test_joint_path_follows_the_branch_it_starts_on(name):
    arm, q = load(name), np.array(Q[name])
    way = q + np.linspace(0.0, 0.4, 150)[:, None]
    way[:, 0] += 2 * np.pi if name not in ("lab_trr",) else 0.0
    path = joint_path(arm, dgm(arm, way), way[0])
    assert np.abs(path.q - way).max() < 1e-9
    assert path.status.shape == (150,)
    assert not path.of_kind(PathEventKind.JUMP)
    assert np.isnan(path.t).all()
    assert np.isnan(path.v).all()


def test_joint_velocities_on_a_straight_line():
    arm, q = load("rx90"), np.array(Q["rx90"])
    move = straight_line(dgm(arm, q), dgm(arm, q + 0.3), duration=2.0)
    path = joint_path(arm, move, q, samples=401)
    assert path.complete
    assert np.abs(dgm(arm, path.q) - move.resample(401).T).max() < 1e-12
    numeric = (path.q[2:] - path.q[:-2]) / (path.t[2:] - path.t[:-2])[:, None]
    assert np.abs(numeric - path.v[1:-1]).max() < 1e-3 * np.abs(path.v).max()
    twist = np.einsum("kij,kj->ki", jacobian(arm, path.q), path.v)
    assert np.abs(twist - move.twist(path.t)).max() < 1e-12
    same = joint_path(arm, move.resample(401).T, q, t=path.t)
    assert np.abs(same.q - path.q).max() < 1e-12
    assert np.abs(same.v[1:-1] - path.v[1:-1]).max() < 1e-3 * np.abs(path.v).max()
    assert np.array_equal(np.asarray(path), path.q)
    assert pickle.loads(pickle.dumps(path)) == path
    without = joint_path(arm, T := move.resample(5).T, q)  # times and velocities are NaN
    assert pickle.loads(pickle.dumps(without)) == without != joint_path(arm, T[:4], q)


def test_a_branch_is_chosen_that_goes_through():
    arm, q = load("rx90"), np.array(Q["rx90"])
    path = joint_path(arm, cartesian_trajectory(dgm(arm, q), dgm(arm, q + 0.1), 200))
    assert path.complete
    assert np.abs(np.diff(path.q, axis=0)).max() < 0.05


def test_leaving_the_reach_is_located_and_explained():
    arm = load("lab_trr")
    near, far = dgm(arm, [0.0, -0.4, 0.9]), dgm(arm, [0.0, -0.4, 0.9])
    far[0, 3] = 0.9  # the two links reach 0.4 from the axis
    move = straight_line(near, far, duration=1.0, law=TimeLaw.LINEAR)
    path = joint_path(
        arm, move, [0.0, -0.4, 0.9], samples=101, mask=[1, 1, 1, 0, 0, 0], singular_below=0.3
    )
    assert not path.complete
    (event,) = path.of_kind(PathEventKind.OUT_OF_REACH)
    assert event.last == 100
    assert "too far" in event.detail
    assert np.isnan(path.q[event.first :]).all()
    assert np.isfinite(path.q[: event.first]).all()
    x = move.pose(event.start)[[0, 2], 3] - [0.0, 0.5]
    assert abs(np.hypot(*x) - 0.4) < 1e-8
    assert "leaves the reach" in repr(path)
    # stretched at the edge: singular, and infinitely fast
    assert path.of_kind(PathEventKind.SINGULAR)[-1].last == event.first - 1


def test_a_run_out_of_reach_tells_its_worst_pose():
    arm, q = load("rx90"), np.radians([0, 60, -110, 0, 50, 0])
    A = dgm(arm, q)
    B = A.copy()
    B[:3, 3] += 0.5
    T = cartesian_trajectory(A, B, 30)
    miss = np.linalg.norm(np.nan_to_num(igm(arm, T).missing)[:, :3], axis=-1)
    (event,) = joint_path(arm, T, q).of_kind(PathEventKind.OUT_OF_REACH)
    assert event.last == 29
    assert miss.argmax() == 29
    assert miss[29] > 0.7
    assert "pose 29: " in event.detail
    assert f"misses it by {miss[29]:.4g} m" in event.detail
    # there and back: the worst is neither the first nor the last
    (event,) = joint_path(arm, np.concatenate((T, T[::-1])), q).of_kind(PathEventKind.OUT_OF_REACH)
    assert event.first < 29 < event.last
    assert f"misses it by {miss[29]:.4g} m" in event.detail
    # the orientation of a planar arm turns away: by degrees
    planar = load("lab_rr")
    C = dgm(planar, [0.2, -0.4])
    T = np.stack([C @ se3.rotation("x", angle) for angle in (0.0, 0.1, 0.3, 0.2)])
    (event,) = joint_path(planar, T, [0.2, -0.4]).of_kind(PathEventKind.OUT_OF_REACH)
    assert (event.first, event.last) == (1, 3)
    assert "pose 2: " in event.detail
    assert f"off by {np.degrees(0.3):.4g} deg" in event.detail


def test_passing_a_singular_wrist_changes_the_posture():
    arm = load("rx90")
    qa, qb = np.array([0.1, 0.3, 1.2, 0.0, 0.4, 0.2]), np.array([0.1, 0.3, 1.2, 0.0, -0.4, 0.2])
    for samples in (40, 201):  # with and without a sample on the singular position
        path = joint_path(arm, straight_line(dgm(arm, qa), dgm(arm, qb), 2.0), qa, samples=samples)
        assert path.complete
        assert np.abs(path.q[-1] - qb).max() < 1e-9
        middle = samples / 2
        (event,) = path.of_kind(PathEventKind.SINGULAR)
        assert event.first <= middle <= event.last + 1
        assert len(path.of_kind(PathEventKind.CHANGES_POSTURE)) == 1


def test_too_fast_near_a_singular_wrist():
    arm = load("rx90")
    arm = arm.with_table(
        type(arm.table)(**{f: getattr(arm.table, f) for f in (
            "antecedent", "sigma", "mu", "gamma", "b", "beta", "alpha", "d", "theta", "r", "names",
            "lower", "upper", "effort")}, velocity=np.full(6, 3.0))
    )  # fmt: skip
    qa, qb = np.array([0.1, 0.3, 1.2, 0.01, 0.4, 0.2]), np.array([0.1, 0.3, 1.2, -0.01, -0.4, 0.2])
    move = straight_line(dgm(arm, qa), dgm(arm, qb) @ se3.rotation("y", 0.01), 0.5)
    path = joint_path(arm, move, qa, samples=500)
    fast = path.of_kind(PathEventKind.TOO_FAST)
    assert fast
    assert "times its greatest velocity" in fast[0].detail
    assert (np.abs(path.v[fast[0].first]) > 3.0).any()
    assert (np.abs(path.v[0 : fast[0].first]) <= 3.0).all()


def test_a_jump_is_reported():
    arm, q = load("rx90"), np.array(Q["rx90"])
    T = np.concatenate((dgm(arm, q + np.linspace(0, 0.1, 20)[:, None]),
                        dgm(arm, q + 1.5 + np.linspace(0, 0.1, 20)[:, None])))  # fmt: skip
    path = joint_path(arm, T, q)
    assert [(e.first, e.last) for e in path.of_kind(PathEventKind.JUMP)] == [(19, 20)]
    assert not path.complete


def test_a_jump_across_what_is_out_of_reach_is_between_poses_with_postures():
    arm, q = load("ur5"), np.radians([0, -60, 80, -20, 60, 10])
    A = dgm(arm, q)
    B = A.copy()
    B[:2, 3] *= -1.0
    path = joint_path(arm, straight_line(A, B, duration=2.0), q)
    (gap,) = path.of_kind(PathEventKind.OUT_OF_REACH)
    (jump,) = path.of_kind(PathEventKind.JUMP)
    assert (jump.first, jump.last) == (gap.first - 1, gap.last + 1)
    step = np.abs(path.q[jump.last] - path.q[jump.first])
    assert step.max() > 0.5 * np.pi
    assert jump.detail == (
        f"Joint {step.argmax() + 1} steps by {step.max():.4g}; in between, at pose {gap.first} to "
        f"{gap.last}, the path is out of reach."
    )
    assert (jump.start, jump.stop) == (path.t[jump.first], path.t[jump.last])


def test_a_start_elsewhere_is_reported():
    arm, q = load("rx90"), np.array(Q["rx90"])
    T = cartesian_trajectory(dgm(arm, q), dgm(arm, q + 0.1), 20)
    assert not joint_path(arm, T, q + 0.09).events
    assert not joint_path(arm, T, q + 2 * np.pi * np.eye(6)[0]).events  # whole turns are kept
    assert not joint_path(arm, T).events
    away = np.array([0.0, 0.3, 1.0, 0.0, 0.0, 0.0])
    path = joint_path(arm, T, q + away)
    (event,) = path.events
    assert (event.kind, event.first, event.last) == (PathEventKind.JUMP, 0, 0)
    assert event.detail == "Joint 3 is 1 away from q_start."
    assert not path.complete


def test_redundant_arm_goes_on_from_its_posture():
    arm = load("iiwa14")
    q = np.array([0.1, 0.4, 0.3, -1.4, 0.5, 1.0, 0.7])
    move = straight_line(dgm(arm, q), dgm(arm, q + 0.1), duration=2.0)
    path = joint_path(arm, move, q, samples=40)
    assert np.abs(path.q[0] - q).max() < 1e-9
    assert np.abs(dgm(arm, path.q) - move.resample(40).T).max() < 1e-9
    assert np.abs(np.diff(path.q, axis=0)).max() < 0.05
    assert not path.of_kind(PathEventKind.JUMP)


@pytest.mark.parametrize(
    ("name", "q"),
    [
        ("panda", [0.1, -0.3, 0.2, -2.0, 0.1, 1.8, 0.5]),
        ("iiwa14", [0.1, 0.4, 0.3, -1.4, 0.5, 1.0, 0.7]),
        ("lwr4_plus", [0.1, 0.4, 0.3, -1.4, 0.5, 1.0, 0.7]),
    ],
)
def test_redundant_arms_go_on_smoothly(name, q, monkeypatch):
    arm = load(name)
    calls = []
    module = sys.modules["robotmodels.trajectories.joint_path"]
    monkeypatch.setattr(module, "igm", lambda *a, **k: calls.append(a[2]) or igm(*a, **k))
    start = dgm(arm, q)
    end = start @ se3.rotation("x", 0.2)
    end[:3, 3] += [0.06, 0.06, -0.05]
    move = straight_line(start, end, duration=1.0)
    path = joint_path(arm, move, q, samples=500)
    assert path.complete
    assert not path.of_kind(PathEventKind.CHANGES_POSTURE)
    assert np.abs(path.q[0] - q).max() < 1e-9
    assert np.abs(dgm(arm, path.q) - move.resample(500).T).max() < 2e-9
    step = np.diff(path.q, axis=0)
    assert np.abs(step).max() < 0.005
    assert np.abs(np.diff(path.v, axis=0)).max() < 0.02 * np.abs(path.v).max()
    if name == "panda":  # no arm angle: least steps, all postures of the first pose only
        assert len(calls) == 1
        null = np.linalg.svd(jacobian(arm, 0.5 * (path.q[1:] + path.q[:-1])))[2][:, -1]
        assert np.abs(np.einsum("ki,ki->k", null, step)).max() < 1e-3 * np.abs(step).max()


def test_redundant_arms_find_back_into_their_reach():
    arm, q = load("panda"), np.array([0.1, -0.3, 0.2, -2.0, 0.1, 1.8, 0.5])
    near = dgm(arm, q)
    far = near.copy()
    far[0, 3] += 0.5
    out = cartesian_trajectory(near, far, 12)
    path = joint_path(arm, np.concatenate((out, out[::-1])), q)
    (gap,) = path.of_kind(PathEventKind.OUT_OF_REACH)
    reached = np.isfinite(path.q).all(axis=-1)
    assert 0 < gap.first < 12 <= gap.last < 23
    assert np.array_equal(np.flatnonzero(~reached), np.arange(gap.first, gap.last + 1))
    assert (
        np.abs(dgm(arm, path.q[reached]) - np.concatenate((out, out[::-1]))[reached]).max() < 2e-9
    )
    back = path.of_kind(PathEventKind.JUMP)
    assert bool(back) == bool(
        np.abs(path.q[gap.last + 1] - path.q[gap.first - 1]).max() > np.pi / 2
    )


def test_limits_and_whole_turns():
    arm = load("kr6_r900")
    q = np.array([arm.upper[0] - 0.1, -1.0, 1.0, 0.4, 0.7, 0.6])
    way = np.tile(q, (50, 1))
    way[:, 0] += np.linspace(0.0, 0.4, 50)
    path = joint_path(arm, dgm(arm, way), q)
    (event,) = path.of_kind(PathEventKind.OUTSIDE_LIMITS)
    assert event.first == 13
    assert "Joint 1 is outside" in event.detail
    assert np.abs(path.q - way).max() < 1e-9
    assert not path.complete


def test_joint_path_shapes_and_refusals():
    arm = load("rx90")
    empty = joint_path(arm, np.zeros((0, 4, 4)))
    assert empty.q.shape == (0, 6)
    assert empty.complete
    T = dgm(arm, np.array([Q["rx90"]] * 3))
    one = joint_path(arm, T[:1], Q["rx90"])
    assert one.q.shape == (1, 6)
    with pytest.raises(ShapeError):
        joint_path(arm, T[0])
    with pytest.raises(ShapeError):
        joint_path(arm, T, Q["rx90"][:5])
    with pytest.raises(InvalidValueError, match="ascend"):
        joint_path(arm, T, t=[0.0, 0.0, 1.0])
    with pytest.raises(InvalidValueError, match="own times"):
        joint_path(arm, straight_line(T[0], T[0], 1.0), t=[0.0, 1.0])
    with pytest.raises(InvalidValueError, match="RobotModel"):
        joint_path("rx90", T)


def test_small_inverses_beside_lapack(rng):
    for n in (1, 3, 6):
        A = rng.normal(size=(200, n, n))
        A[:, :, 0] *= 10.0 ** rng.uniform(-8.0, 2.0, (200, 1))
        inverse, conditioning, sign = inverted(A)
        want = np.linalg.inv(A)
        norm = np.linalg.norm
        bound = 1e-14 * np.linalg.cond(A) * norm(want, axis=(1, 2))
        assert (norm(inverse - want, axis=(1, 2)) <= bound).all()
        by_norms = n / (norm(A, axis=(1, 2)) * norm(want, axis=(1, 2)))
        assert np.abs(conditioning / by_norms - 1.0).max() < 1e-6
        assert np.array_equal(sign, np.sign(np.linalg.det(A)))
    A[7, 2] = 0.0  # one singular matrix: the others are as before
    pseudo, conditioning, sign = inverted(A)
    assert conditioning[7] < 1e-15
    assert sign[7] == 0.0
    assert np.abs(pseudo[7] - np.linalg.pinv(A[7])).max() < 1e-8 * np.abs(pseudo[7]).max()
    assert np.abs(pseudo[8] - inverse[8]).max() <= bound[8]


def test_postures_go_on_by_the_shortest_step(rng):
    q = rng.uniform(-np.pi, np.pi, (1, 5, 4)) + np.zeros((40, 1, 1))
    q[:, :, 0] += np.linspace(0.0, 1.0, 40)[:, None]  # all turn through the half turn
    q[:, :, :2] = np.remainder(q[:, :, :2] + np.pi, 2 * np.pi) - np.pi
    order = np.array([rng.permutation(5) if k % 7 == 3 else np.arange(5) for k in range(40)])
    mixed = np.take_along_axis(q, order[..., None], axis=1)
    valid = np.ones((40, 5), np.bool_)
    valid[20] = order[20] != 2  # one branch is lost
    after = following(mixed, valid, np.array([True, True, True, False]))
    for k in range(39):
        for s in range(5):
            if valid[k, s] and valid[k + 1, list(order[k + 1]).index(order[k, s])]:
                assert order[k + 1, after[k, s]] == order[k, s]
    assert following(mixed[:1], valid[:1], np.ones(4, np.bool_)).shape == (0, 5)


def test_postures_go_on_where_they_change_least():
    """A way through a half turn is short, and beside a length of metres angles count by chords."""
    revolute, valid = np.array([True, False]), np.ones((2, 3), np.bool_)
    now = [[3.0, 0.0], [-1.0, 0.2], [0.5, -0.3]]
    later = np.array([[-3.1, 0.0], [-0.9, 0.2], [0.6, -0.3]])
    for order in ([0, 1, 2], [2, 0, 1], [1, 0, 2]):
        after = following(np.array([now, later[order]]), valid, revolute)
        np.testing.assert_array_equal(after[0], np.argsort(order))
    # the nearest by the chord is another one than by twice the chord's angle, or by signed lengths
    q = np.array([[[0.0, 0.0]] * 3, [[3.0, 0.0], [0.0, 1.5], [1.0, -3.0]]])
    np.testing.assert_array_equal(following(q, valid, revolute)[0], [1, 1, 1])
    # near enough for all: nothing is compared, though another one would be nearer
    q = np.array([[[0.0, 0.0], [0.01, 0.0], [1.0, 1.0]], [[0.04, 0.0], [0.0, 0.0], [1.0, 1.04]]])
    np.testing.assert_array_equal(following(q, valid, revolute)[0], [0, 1, 2])


def test_a_guess_chooses_the_branch_and_is_no_posture_of_the_path():
    arm = load("rx90")
    q = np.array([0.3, 0.5, 1.3, 0.4, 0.7, 0.2])
    T = dgm(arm, q + np.linspace(0.0, 0.2, 20)[:, None])
    path = joint_path(arm, T, q_near=q + 0.3)
    np.testing.assert_allclose(path.q[0], q, rtol=0, atol=1e-9)
    assert not path.of_kind(PathEventKind.JUMP)
    assert joint_path(arm, T, q + 0.3).of_kind(PathEventKind.JUMP)
    with pytest.raises(InvalidValueError, match="q_near"):
        joint_path(arm, T, q, q)
