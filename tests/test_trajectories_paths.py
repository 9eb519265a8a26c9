"""Motions in space, and the way from poses to joints."""

import pickle
from functools import partial

import numpy as np
import pytest
from identities.random_robots import random_pose
from scipy.spatial.transform import Rotation, Slerp

from robotmodels import se3
from robotmodels.errors import InvalidValueError, NotARotationError, ShapeError
from robotmodels.kinematics import dgm, jacobian
from robotmodels.robots import load
from robotmodels.se3.orientation import rotation_vectors_of
from robotmodels.trajectories import (
    MotionLimits,
    PathEventKind,
    TimeLaw,
    blended_poses,
    cartesian_trajectory,
    circle,
    circular_arc,
    joint_path,
    straight_line,
)
from robotmodels.trajectories.pose_trajectory import rotation_about


def twist_of(pose, t, h=1e-5):
    """Velocity of a pose by central differences, world axes."""
    after, before = pose(t + h), pose(t - h)
    w = rotation_vectors_of(after[:, :3, :3] @ np.swapaxes(before[:, :3, :3], -1, -2)) / (2 * h)
    return np.hstack(((after[:, :3, 3] - before[:, :3, 3]) / (2 * h), w))


# --- in space ------------------------------------------------------------------------------------

SPACE = MotionLimits([0.5, 1.0], [1.5, 3.0])


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


def test_cartesian_trajectory_is_a_trapezoid_with_slerp(rng):
    T0, T1 = random_pose(rng), random_pose(rng)
    T = cartesian_trajectory(T0, T1, 50)
    x = np.arange(50) / 49.0
    ramps = np.where(x < 2 / 3, 1.5 * x - 0.25, 1 - 2.25 * (1 - x) ** 2)
    s = np.where(x < 1 / 3, 2.25 * x**2, ramps)
    turn = Slerp([0.0, 1.0], Rotation.from_matrix([T0[:3, :3], T1[:3, :3]]))(s).as_matrix()
    assert np.abs(T[:, :3, :3] - turn).max() < 1e-14
    missed = T[:, :3, 3] - T0[:3, 3] - s[:, None] * (T1 - T0)[:3, 3]
    assert np.abs(missed).max() < 16.0 * np.finfo(float).eps * np.abs([T0, T1]).max()
    assert np.array_equal(T[[0, -1]], [T0, T1])
    assert (T[:, 3] == [0.0, 0.0, 0.0, 1.0]).all()
    assert np.array_equal(cartesian_trajectory(T0, T1, 1), [T0])
    half = cartesian_trajectory(np.eye(4), se3.rotation("y", np.pi), 5)
    assert np.abs(half[2] - se3.rotation("y", np.pi / 2)).max() < 1e-15
    with pytest.raises(NotARotationError, match="T0"):
        cartesian_trajectory(2 * T0, T1, 5)
    with pytest.raises(InvalidValueError, match="limits"):
        cartesian_trajectory(T0, T1, 5, "jerk_limited")


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
    for make in (
        lambda limits: straight_line(A, B, limits=limits),
        lambda limits: circle(A, [0, 1, 0], [0, 0, 1], 1.0, limits=limits, turning=True),
        lambda limits: blended_poses([A, B], limits),
    ):
        for limits, words in (
            (no_turn, "velocity of rotation"),
            (MotionLimits(velocity=1.0, acceleration=[0.0, 2.0]), "acceleration of translation"),
            (MotionLimits([0.5, 1.0, 1.0], 2.0), "translation .m. and rotation .rad."),
        ):
            with pytest.raises((InvalidValueError, ShapeError), match=words):
                make(limits)
    # what does not move needs no limit, also where rounding sees a rotation
    rounded = np.eye(4)
    rounded[0, 1], rounded[1, 0] = 1e-16, -1e-16
    for start in (A, rounded):
        end = se3.translation(1, 0, 0)
        assert straight_line(start, end, limits=no_turn).duration > 2.0
        assert blended_poses([start, end], no_turn).duration > 2.0


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
    ask = partial(circle, T0, [0.1, 0.2, 0.3], [1.0, 1.0, 0.5], limits=SPACE)
    for turning in (False, True):
        check_motion(ask(7.0, turning=turning))
    full = ask()
    assert np.abs(full.pose(full.duration) - T0).max() < 1e-14
    for axis, words in (([0, 0, 0], "no length"), (T0[:3, 3] - [0.1, 0.2, 0.3], "on the axis")):
        with pytest.raises(InvalidValueError, match=words):
            circle(T0, [0.1, 0.2, 0.3], axis, duration=1.0)


@pytest.mark.parametrize("law", TimeLaw)
def test_circles_keep_limits_of_the_vectors_of_jerk_too(law, rng):
    jumps = law in (TimeLaw.LINEAR, TimeLaw.BANG_BANG, TimeLaw.TRAPEZOIDAL)
    for r in (0.1, 2.0):
        V, A, J = rng.uniform(0.3, 1.5), rng.uniform(1.0, 4.0), rng.uniform(10.0, 60.0)
        limits = MotionLimits([V, 4.0], [A, 9.0], np.inf if jumps else [J, 90.0])
        ask = partial(circle, se3.translation(r, 0, 0), [0, 0, 0.2], [0, 0, 1.0], 2.5, law=law)
        move, L = ask(limits=limits, turning=True), 2.5 * r
        s = move.law.at(t := np.linspace(0.0, move.duration, 9999)[1:-1])
        jerk = (L * s.jerk - (L * s.v) ** 3 / r**2, 3 * L * L * s.v * s.a / r)
        rows = (move.twist(t)[:, :3], move.acceleration(t)[:, :3], np.stack(jerk, axis=-1))
        for vectors, most in list(zip(rows, (V, A, J), strict=True))[: 2 if jumps else 3]:
            assert np.linalg.norm(vectors, axis=-1).max() <= most * (1.0 + 1e-9)
        quick = L / min(V, np.sqrt(A * r)) + V / A + 2.0 * np.sqrt(V / J)
        assert move.duration < 2.2 * quick
        with pytest.raises(InvalidValueError, match="least is"):
            ask(0.99 * move.duration, limits, turning=True)


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
        assert times.min() / 1.001 <= move.duration <= times.min() * 1.002


@pytest.mark.parametrize("height", [0.6, 1e-3, 1e-5, 3e-9])
@pytest.mark.parametrize("side", [1e-3, 1.0, 1e3])
def test_flat_arcs_meet_their_points(rng, height, side):
    """At both ends, in the middle and in one plane, however far away the centre is."""
    R, p = random_pose(rng)[:3, :3], side * rng.normal(size=3)
    T0, T1 = random_pose(rng), random_pose(rng)
    m, e = p + side * R @ [0.5, height, 0.0], p + side * R @ [1.0, 0.0, 0.0]
    T0[:3, 3], T1[:3, 3] = p, e
    path = circular_arc(T0, m, T1, duration=1.0).path
    size = max(side, np.abs(p).max())
    # the last pose is put in at the end: the one beside it shows whether it had to be
    X = path.poses(np.array([1e-15, 0.5, 1.0 - 1e-15]))[:, :3, 3]
    assert np.abs(X - [p, m, e]).max() < 2e-14 * size
    X = path.poses(np.linspace(0.0, 1.0, 201))[:, :3, 3]
    assert np.abs(((X - p) @ R)[:, 2]).max() < 2e-14 * size
    with pytest.raises(InvalidValueError, match=r"one line.*straight_line"):
        circular_arc(T0, p + side * R @ [0.4, 1e-10, 0.0], T1, duration=1.0)


def along_x(*x):
    T = np.tile(np.eye(4), (len(x), 1, 1))
    T[:, 0, 3] = x
    return T


def assert_sound(T, limits, smooth):
    move = blended_poses(T, limits, smooth=smooth)
    check_motion(move, limits, 1e-4 * max(1.0, limits.acceleration.max()))
    # the given ends are put in at the ends: the poses beside them show whether they had to be
    beside = np.array([np.nextafter(0.0, 1.0), np.nextafter(move.duration, 0.0)])
    assert np.abs(move.pose(beside) - T[[0, -1]]).max() < 1e-12
    assert np.abs(move.twist(beside)).max() < 1e-9


@pytest.mark.parametrize("smooth", [False, True])
def test_blended_poses_go_where_their_twist_takes_them(rng, smooth):
    for _ in range(12):
        m = int(rng.integers(2, 6))
        T = np.stack([random_pose(rng) for _ in range(m)])
        if rng.random() < 0.3:
            T[:, :3, :3] = T[0, :3, :3]  # translations alone
        v, a = 10.0 ** rng.uniform(-1.0, 1.0, (2, 2))
        assert_sound(T, MotionLimits(velocity=v, acceleration=a), smooth)
    # a long blend beside a short one, poses given twice
    limits = MotionLimits(velocity=[1.0, 1.0], acceleration=[0.6, 1.0])
    for x in ((0, 1, 2), (0, 1, 2, 2.5, 1), (0, 0, 1), (0, 1, 1, 2), (0, 0, 1, 1, 1, 0)):
        assert_sound(along_x(*x), limits, smooth)
    move = blended_poses(T, SPACE, smooth=smooth)
    slow = blended_poses(T, SPACE, 1.5 * move.duration, smooth=smooth)
    assert abs(slow.duration / move.duration - 1.5) < 1e-12
    for call, error, words in (
        (lambda: blended_poses(T, SPACE, 0.5 * move.duration, smooth=smooth), None, "least is"),
        (lambda: blended_poses(T, MotionLimits(1.0, 1.0, 1.0)), None, "jerk"),
        (lambda: blended_poses(T[:1], SPACE), ShapeError, "at least two"),
    ):
        with pytest.raises(error or InvalidValueError, match=words):
            call()


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
    J = jacobian(arm, path.q)
    J[:, :3] /= np.linalg.norm(J[:, :3], axis=1).max()
    both = np.linalg.norm(J, axis=(1, 2)) * np.linalg.norm(np.linalg.inv(J), axis=(1, 2))
    np.testing.assert_allclose(path.conditioning, 6.0 / both, rtol=1e-9)
    same = joint_path(arm, move.resample(401).T, q, t=path.t)
    assert np.abs(same.q - path.q).max() < 1e-12
    assert np.abs(same.v[1:-1] - path.v[1:-1]).max() < 1e-3 * np.abs(path.v).max()
    assert np.array_equal(np.asarray(path), path.q)
    assert pickle.loads(pickle.dumps(path)) == path
    without = joint_path(arm, T := move.resample(5).T, q)  # times and velocities are NaN
    assert pickle.loads(pickle.dumps(without)) == without != joint_path(arm, T[:4], q)


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
    again = joint_path(arm, move.pose(path.t), path.q[0], t=path.t, mask="position")
    assert np.isfinite(again.v[: event.first]).all()  # the velocity beside the gap too
    # stretched at the edge: singular, and infinitely fast
    assert path.of_kind(PathEventKind.SINGULAR)[-1].last == event.first - 1


def test_passing_a_singular_wrist_changes_the_posture():
    arm = load("rx90")
    qa, qb = np.array([0.1, 0.3, 1.2, 0.0, 0.4, 0.2]), np.array([0.1, 0.3, 1.2, 0.0, -0.4, 0.2])
    for samples in (40, 201):  # with and without a sample on the singular position
        line = straight_line(dgm(arm, qa), dgm(arm, qb), 2.0)
        path = joint_path(arm, line, qa, samples=samples, singular_below=1e-9)
        assert path.complete
        assert np.abs(path.q[-1] - qb).max() < 1e-9
        middle = samples / 2
        (event,) = path.of_kind(PathEventKind.SINGULAR)
        assert event.first <= middle <= event.last + 1
        assert len(path.of_kind(PathEventKind.CHANGES_POSTURE)) == 1


@pytest.mark.parametrize(
    ("name", "q"),
    [
        ("panda", [0.1, -0.3, 0.2, -2.0, 0.1, 1.8, 0.5]),
        ("iiwa14", [0.1, 0.4, 0.3, -1.4, 0.5, 1.0, 0.7]),
        ("lwr4_plus", [0.1, 0.4, 0.3, -1.4, 0.5, 1.0, 0.7]),
    ],
)
def test_redundant_arms_go_on_smoothly(name, q):
    arm = load(name)
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
    if name == "panda":  # no arm angle: least steps
        null = np.linalg.svd(jacobian(arm, 0.5 * (path.q[1:] + path.q[:-1])))[2][:, -1]
        assert np.abs(np.einsum("ki,ki->k", null, step)).max() < 1e-3 * np.abs(step).max()


def test_limits_and_speeds_that_are_exceeded_are_events():
    arm = load("kr6_r900")
    q = np.array([arm.upper[0] - 0.1, -1.0, 1.0, 0.4, 0.7, 0.6])
    way = np.tile(q, (50, 1))
    way[:, 0] += np.linspace(0.0, 0.4, 50)
    path = joint_path(arm, dgm(arm, way), q, t=np.linspace(0.0, 0.01, 50))
    (event,) = path.of_kind(PathEventKind.OUTSIDE_LIMITS)
    assert event.first == 13
    assert "Joint 1 is outside" in event.detail
    assert np.abs(path.q - way).max() < 1e-9
    assert not path.complete
    (fast,) = path.of_kind(PathEventKind.TOO_FAST)
    share = 0.4 / 0.01 / arm.table.velocity[0]
    assert (fast.first, fast.last) == (0, 49)
    assert f"Joint 1 needs {share:.4g} times its greatest velocity" in fast.detail


def test_a_start_elsewhere_is_a_jump_and_a_guess_chooses_the_branch():
    arm, q = load("rx90"), np.array(Q["rx90"])
    T = cartesian_trajectory(dgm(arm, q), dgm(arm, q + 0.1), 20)
    for start in (None, q + 0.09, q + 2 * np.pi * np.eye(6)[0]):  # whole turns are kept
        assert not joint_path(arm, T, start).events
    path = joint_path(arm, T, q + np.array([0.0, 0.3, 1.0, 0.0, 0.0, 0.0]))
    (event,) = path.events
    assert (event.kind, event.first, event.last) == (PathEventKind.JUMP, 0, 0)
    assert not path.complete
    guessed = joint_path(arm, T, q_near=q + 0.3)
    np.testing.assert_allclose(guessed.q[0], q, rtol=0, atol=1e-9)
    assert not guessed.events
    empty = joint_path(arm, T[:0])
    assert (empty.q.shape, empty.complete) == ((0, 6), True)
    assert joint_path(arm, T[:1], q).q.shape == (1, 6)
    line = straight_line(T[0], T[0], 1.0)
    for words, poses, more in (
        ("N, 4, 4", T[0], {}),
        ("q_start", T, {"q_start": q[:5]}),
        ("ascend", T, {"t": np.zeros(20)}),
        ("own times", line, {"t": [0.0, 1.0]}),
        ("q_near", T, {"q_start": q, "q_near": q}),
    ):
        with pytest.raises((ShapeError, InvalidValueError), match=words):
            joint_path(arm, poses, **more)
