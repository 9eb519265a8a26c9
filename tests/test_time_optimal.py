"""Time-optimal motion along a path: other programs, closed forms, identities, refused input."""

import dataclasses
import itertools
import json
import pickle
from pathlib import Path

import numpy as np
import pytest
from identities.random_robots import random_model

import robotmodels as rm
from robotmodels import trajectories as tr
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.friction import CoulombFriction, ViscousFriction
from robotmodels.trajectories import MotionLimits, TimingStatus, time_optimal

ORACLE = json.loads((Path(__file__).parent / "oracles/kinodynamic.json").read_text())
VIA = [[0, 0], [0.5, 1.0], [1.0, 0.5]]
FREE = MotionLimits()


def planar(gravity=9.81, **drive):
    """The planar 2R of the oracle, in a vertical plane."""
    inertia = rm.InertialParameters.from_com(
        [5.0, 3.0], [[0.5, 0, 0]] * 2, [np.diag([0, 0, 0.42]), np.diag([0, 0, 0.25])]
    )
    model = rm.load("planar_2r").with_inertia(inertia).with_gravity((0, -gravity, 0))
    if not drive:
        return model
    zero = {name: np.zeros(2) for name in ("Ia", "Fv", "Fc", "offset")}
    return model.with_drive(rm.DriveParameters(**(zero | drive)))


def line(q0, q1):
    return tr.linear(q0, q1, duration=1.0)


@pytest.mark.parametrize("seed", range(2))
def test_torques_are_held_between_the_points_with_limits_at_both_ends(seed):
    rng = np.random.default_rng(seed)
    model = random_model(rng, f=4, tree=seed % 2 == 1, drive=True)
    model = model.with_drive(dataclasses.replace(model.drive, Fc=np.zeros(model.n)))
    path = spline(rng, model.n)
    q = path.q(np.linspace(0, path.duration, 201))
    torque = 3.0 + 2.0 * np.abs(rm.gravity_torque(model, q) + model.drive.offset).max(axis=0)
    for points in (60, 200):
        timed = time_optimal(path, FREE, model, torque, points=points, both_ends=True)
        assert used(model, timed.trajectory, torque).max() <= 1.001
        alone = time_optimal(path, FREE, model, torque, points=points)
        assert timed.duration <= 1.05 * alone.duration
        greatest = used(model, alone.trajectory, torque).max()
        assert ("times its limit" in alone.reason()) == (greatest > 1.02)
        assert pickle.loads(pickle.dumps(timed)) == timed != alone


def spline(rng, n, points=5):
    return tr.cubic_spline(rng.uniform(-1, 1, (points, n)), np.arange(points), ends="not_a_knot")


def used(model, motion, torque, samples=10_001):
    """Greatest share of a torque at many times; at rest dry friction is not determined."""
    at = motion.at(np.linspace(0.0, motion.duration, samples)[1:-1])
    return (np.abs(rm.idm(model, at.q, at.v, at.a)) / torque).max(axis=1)


@pytest.mark.parametrize(("points", "most"), [(60, 2e-3), (200, 4e-4)])
def test_velocities_are_kept_between_the_points(points, most, rng):
    for n in (3, 6):
        limits = MotionLimits(rng.uniform(0.5, 2.0, n), rng.uniform(5.0, 20.0, n))
        timed = time_optimal(spline(rng, n), limits, points=points)
        v = timed.trajectory.v(np.linspace(0.0, timed.duration, 20_001))
        assert (np.abs(v) / limits.velocity).max() <= 1.0 + most


PATHS = {
    "spline": tr.cubic_spline(VIA, [0, 1, 2], ends="natural"),
    "not_a_knot": tr.cubic_spline([*VIA, [0.2, 0.1]], [0, 1, 2, 3], ends="not_a_knot"),
    "line": line([0, 0], [1, 0.5]),
}


@pytest.mark.parametrize("case", ORACLE["along"], ids=lambda c: f"{c['path']}-{c['points']}")
def test_durations_are_those_of_toppra_on_the_same_grid(case):
    timed = time_optimal(
        PATHS[case["path"]], FREE, planar(case["gravity"]), [120.0, 40.0], points=case["points"]
    )
    assert timed.status is TimingStatus.OPTIMAL
    assert timed.duration == pytest.approx(case["duration"], rel=1e-5)


@pytest.mark.parametrize("own", [tr.linear, tr.quintic])
@pytest.mark.parametrize("end", [[1.0, -2.0], [-0.2, 0.05]])
def test_a_straight_path_is_the_coordinated_trapezoid(own, end):
    limits = MotionLimits(
        velocity=[1.0, 2.0], acceleration=[2.0, 3.0], acceleration_lower=[-1.0, -2.0]
    )
    exact = tr.trapezoidal([0, 0], end, limits=limits).duration
    gaps = []
    for points in (100, 200, 400, 800, 1600):
        timed = time_optimal(own([0, 0], end, duration=3.0), limits, points=points)
        assert abs(timed.duration / exact - 1.0) <= timed.grid_gap
        gaps.append(timed.grid_gap)
    assert gaps[-1] <= gaps[0] / 8.0
    assert timed.trajectory.q(timed.duration) == pytest.approx(end, abs=1e-9)
    assert timed.trajectory.check(limits, 1e-6).kept


def test_the_gap_falls_as_the_intervals_under_torques():
    path, model = PATHS["spline"], planar()
    timed = [time_optimal(path, FREE, model, [120, 40], points=N) for N in (100, 200, 400, 800)]
    gaps = np.array([t.grid_gap for t in timed])
    assert ((gaps[:-1] / gaps[1:] > 1.6) & (gaps[:-1] / gaps[1:] < 2.4)).all()
    exact = 2 * timed[3].duration - timed[2].duration  # extrapolated
    assert all(abs(t.duration - exact) <= 1.2 * t.grid_gap * exact for t in timed)


@pytest.mark.parametrize("seed", range(4))
def test_random_robots_use_their_torques_and_no_more(seed):
    rng = np.random.default_rng(seed)
    model = random_model(rng, f=4, tree=seed % 2 == 1, drive=True)
    path = spline(rng, model.n)
    q = path.q(np.linspace(0, path.duration, 201))
    rest = np.zeros(q.shape)
    torque = 3.0 + 2.0 * np.abs(rm.idm(model, q, rest, rest)).max(axis=0) + model.drive.Fc
    timed = time_optimal(path, FREE, model, torque, points=400, both_ends=True)
    assert timed.status is TimingStatus.OPTIMAL
    share = used(model, timed.trajectory, torque)
    # between points, where the inertia along the path vanishes, it is exceeded for moments
    assert np.quantile(share, 0.98) <= 1.01
    assert np.median(share) >= 0.99
    assert (timed.active != "").mean() >= 0.95
    assert (timed.rate <= timed.maximum_rate * (1 + 1e-9)).all()
    motion = timed.trajectory  # the motion is on the path
    t = np.linspace(0, motion.duration, 50)
    own = motion.motion.law.derivatives(t, (0,))[0][:, 0]
    assert motion.q(t) == pytest.approx(path.q(own), abs=1e-12)


def test_the_own_timing_of_a_path_is_dropped():
    """Also of motions that rest or jump in it, turn back, or are functions of time."""
    model, torque = planar(), [120, 40]
    rests = tr.Trajectory.from_functions(
        lambda t: np.outer(0.5 + 4 * (t - 0.5) ** 3, [1, 0.5]),
        1.0,
        lambda t: np.outer(12 * (t - 0.5) ** 2, [1, 0.5]),
    )
    blends = tr.blended_lines([[0, 0], [0.5, 0.25], [1, 0.5]], segment_times=[1, 3],
                              blend_times=[0.1, 0.0, 0.1])  # fmt: skip
    laws = [own([0, 0], [1, 0.5], duration=3.0) for own in (tr.linear, tr.quintic)]
    paths = (*laws, rests, blends)
    timed = [time_optimal(path, FREE, model, torque, points=400).duration for path in paths]
    assert np.ptp(timed) < 2e-3 * timed[0]
    back = tr.cubic_spline([[0, 0], [1, 0.5], [0, 0]], times=[0, 1, 2], ends="not_a_knot")
    turned = time_optimal(back, FREE, planar(0.0), torque, points=400)
    assert turned.trajectory.q(turned.duration) == pytest.approx([0, 0], abs=1e-9)
    # the inertia of joint 2 along the path changes its sign
    path = tr.cubic_spline([[0, 0], [1, -1.2], [2, -1.6]], [0, 1, 2], ends="not_a_knot")
    durations = []
    for points in range(50, 60):
        timed = time_optimal(path, FREE, planar(0.0), [400, 6], points=points)
        assert np.isfinite(timed.trajectory.at(np.linspace(0, timed.duration, 99)).a).all()
        durations.append(timed.duration)
    assert np.ptp(durations) < 0.01 * durations[0]


def test_reversed_and_scaled_paths():
    model, torque, path, k = planar(), np.array([120.0, 40.0]), PATHS["spline"], 1.7
    back = tr.cubic_spline(VIA[::-1], [0, 1, 2], ends="natural")
    there = [time_optimal(p, FREE, model, torque, both_ends=True).duration for p in (path, back)]
    assert there[0] == pytest.approx(there[1], rel=1e-9)
    one, two = (
        time_optimal(
            path,
            MotionLimits(velocity=1.5 * f, acceleration=30.0 * f**2),
            planar(9.81 * f**2),
            torque * f**2,
        ).duration
        for f in (1.0, k)
    )
    assert one == pytest.approx(k * two, rel=1e-9)


def test_friction_takes_the_sign_of_the_motion_and_grows_with_the_speed():
    path, torque = PATHS["spline"], np.array([150.0, 60.0])
    plain = planar()
    dry = planar(Fc=[10.0, 4.0])
    for model in (dry, planar(Fc=[10.0, 4.0], Fv=[8.0, 5.0]), planar(Ia=[1.0, 0.5], Fv=[9.0, 2.0])):
        timed = time_optimal(path, FREE, model, torque, points=400, both_ends=True)
        assert timed.duration > time_optimal(path, FREE, plain, torque, points=400).duration
        share = used(model, timed.trajectory, torque, samples=4001)
        assert 0.99 < share.max() < 1.02
        assert (timed.active != "").mean() >= 0.95
        alone = time_optimal(path, FREE, model, torque, points=400).trajectory
        at = alone.at(alone.motion.law.breaks[0][1:-1])  # at the points of the grid itself
        share = (np.abs(rm.idm(model, at.q, at.v, at.a)) / torque).max(axis=1)
        assert share.max() <= 1.0 + 1e-4
        assert np.median(share) >= 1.0 - 1e-4
    slow, limit = line([0.0, 0.0], [1.0, 1e-5]), [120.0, 40.0]  # the second joint hardly moves
    models = (planar(Fc=[0.0, 20.0]), planar(offset=[0.0, 20.0]), plain)
    durations = [time_optimal(slow, FREE, m, limit).duration for m in models]
    assert durations[0] == pytest.approx(durations[1], rel=1e-9)
    assert durations[0] > durations[2] * 1.001
    without = time_optimal(path, FREE, dry, torque, friction=False).duration
    assert without == pytest.approx(time_optimal(path, FREE, plain, torque).duration, rel=1e-12)
    own = CoulombFriction([10.0, 4.0]) + ViscousFriction([8.0, 5.0])
    by_model = time_optimal(path, FREE, planar(Fc=[10.0, 4.0], Fv=[8.0, 5.0]), torque)
    assert time_optimal(path, FREE, plain, torque, friction=own).duration == pytest.approx(
        by_model.duration, rel=1e-8
    )


def test_rates_at_the_ends():
    limits, path = MotionLimits(velocity=2.0, acceleration=3.0), line([0.0], [1.0])
    timed = time_optimal(path, limits, start_rate=0.8, end_rate=0.5)
    assert timed.trajectory.v([0.0, timed.duration])[:, 0] == pytest.approx([0.8, 0.5])
    for end in ("start_rate", "end_rate"):
        slow = time_optimal(path, limits, **{end: 3.0})
        assert slow.status is TimingStatus.NOT_CONTROLLABLE
        assert f"{end} 3 " in slow.reason()


def test_limits_of_jerk_and_of_the_rates_of_torques():
    limits = MotionLimits(velocity=1.0, acceleration=2.0, jerk=10.0)
    timed = time_optimal(line([0.0], [1.0]), limits)
    assert timed.trajectory.check(limits, 0.011).kept
    exact = tr.jerk_limited([0.0], [1.0], limits=limits).duration
    assert exact * 0.995 <= timed.duration <= 1.03 * exact
    assert (timed.active == "rate").any()
    path, model, torque = PATHS["spline"], planar(), np.array([120.0, 40.0])
    before = time_optimal(path, FREE, model, torque, points=100)
    for factor in (60.0, 20.0, 8.0):
        rate = factor * torque
        timed = time_optimal(path, FREE, model, torque, rate, points=100, both_ends=True)
        t = np.linspace(0, timed.duration, 4001)
        tau = rm.idm(model, *(getattr(timed.trajectory, x)(t) for x in "qva"))
        slope = np.abs(np.diff(tau, axis=0)) / t[1]
        assert np.quantile(slope / rate, 0.95) <= 1.02
        assert (np.abs(tau) / torque).max() <= 1.06
        assert timed.duration > before.duration
        before = timed
    by_friction = time_optimal(path, FREE, planar(Fv=[5.0, 2.0]), torque, 20 * torque, points=60)
    assert by_friction.status is TimingStatus.OPTIMAL


def test_gravity_beyond_the_torques_is_named_first():
    model = planar()
    held = np.abs(rm.gravity_torque(model, [0.0, 0.0]))
    timed = time_optimal(PATHS["line"], FREE, model, 0.9 * held)
    assert timed.status is TimingStatus.NOT_HELD_STILL
    assert timed.trajectory is None
    assert np.isnan(timed.duration)
    for part in ("s = 0", "joint 1", f"{held[0]:.6g}", "margin of -6.867"):
        assert part in timed.reason(), part
    assert time_optimal(PATHS["line"], FREE, model, 0.0).status is TimingStatus.NOT_HELD_STILL
    # through the horizontal it cannot be held, and has no run-up either
    over = time_optimal(line([-1.5, 0], [1.5, 0]), FREE, model, [30, 20])
    assert over.status is TimingStatus.NOT_HELD_STILL
    # a swing through a posture in which it could not be held
    swing = time_optimal(line([-2.2, 0], [-0.9, 0]), FREE, model, [52, 20])
    assert swing.status is TimingStatus.OPTIMAL


def test_paths_that_no_motion_follows():
    model = planar(0.0)
    kink = tr.blended_lines([[0, 0], [0.5, 0.5], [1, 0]], segment_times=[1, 1],
                            blend_times=[0.1, 0.0, 0.1])  # fmt: skip
    for path in (kink, tr.Trajectory.from_functions(lambda t: np.c_[t, np.abs(t - 1)], 2.0)):
        timed = time_optimal(path, FREE, model, [50, 20])
        assert timed.status is TimingStatus.PATH_NOT_SMOOTH
        assert f"s = {path.duration / 2:.3g}" in timed.reason()
    # no torque at joint 2, which the path moves: it stops where it begins
    passive = time_optimal(PATHS["line"], FREE, model, [50, 0.0])
    assert passive.status is TimingStatus.NOT_CONTROLLABLE
    still = time_optimal(PATHS["line"], MotionLimits(velocity=[0.0, 1.0], acceleration=1.0))
    assert still.status is TimingStatus.NOT_CONTROLLABLE


def test_a_path_of_poses_needs_the_robot():
    arm = rm.load("ur5e")
    q = np.array([0.3, -1.2, 1.4, -1.0, -1.3, 0.2])
    T0 = rm.dgm(arm, q)
    T1 = T0.copy()
    T1[:3, 3] += [-0.1, 0.15, 0.1]
    move = tr.straight_line(T0, T1, duration=2.0)
    limits = MotionLimits.of_model(arm, acceleration=20.0)
    timed = time_optimal(move, limits, arm)
    assert timed.status is TimingStatus.OPTIMAL
    T = rm.dgm(arm, timed.trajectory.q(np.linspace(0, timed.duration, 40)))
    along = np.linalg.norm(np.cross(T[:, :3, 3] - T0[:3, 3], T1[:3, 3] - T0[:3, 3]), axis=1)
    assert along.max() < 1e-6
    with pytest.raises(InvalidValueError, match="model"):
        time_optimal(move, limits)
    far = T1.copy()
    far[0, 3] += 3.0
    lost = time_optimal(tr.straight_line(T0, far, duration=2.0), limits, arm)
    assert lost.status is TimingStatus.PATH_NOT_SMOOTH
    assert "out of reach" in lost.reason().lower()


@pytest.mark.parametrize(
    ("word", "change"),
    [
        ("infinite", {"limits": MotionLimits()}),
        ("nothing limits", {"limits": MotionLimits([np.inf, 1.0]), "path": line([0, 0], [1, 0])}),
        ("outside its limits", {"limits": MotionLimits(1.0, 1.0, upper=0.2)}),
        ("cubic_spline", {"path": np.zeros((3, 2))}),
        ("no length", {"path": line([0, 0], [0, 0])}),
        ("model", {"torque": 5.0}),
        ("torque", {"model": planar(), "torque": [-1.0, 1.0]}),
        ("torque", {"model": planar(), "torque": [1.0, 1.0, 1.0]}),
        ("6 joints", {"model": rm.load("rx90")}),
        ("above zero", {"model": planar(), "torque": 9e2, "torque_rate": 0.0}),
        ("start_rate", {"start_rate": -1.0}),
        ("friction", {"friction": "dry", "model": planar(), "torque": 9e2}),
    ],
)
def test_refused_input(word, change):
    given = {"path": PATHS["line"], "limits": MotionLimits(1.0, 1.0)} | change
    with pytest.raises((InvalidValueError, ShapeError), match=word):
        time_optimal(**given)


# --- motions by functions, and splines that are one polynomial at the ends ----------------------


def test_a_motion_of_functions():
    def q(t):
        return np.stack((np.sin(t), np.cos(2 * t)), axis=-1)

    motion, t = tr.Trajectory.from_functions(q, 3.0), np.linspace(0, 3, 301)
    assert motion.v(t) == pytest.approx(np.stack((np.cos(t), -2 * np.sin(2 * t)), -1), abs=1e-9)
    assert motion.a(t) == pytest.approx(np.stack((-np.sin(t), -4 * np.cos(2 * t)), -1), abs=1e-6)
    given = tr.Trajectory.from_functions(np.sin, 3.0, np.cos, lambda t: -np.sin(t))
    assert given.scalar
    assert given.check(MotionLimits(velocity=1.0, acceleration=1.0)).kept
    assert not motion.check(MotionLimits(velocity=1.0)).kept
    for words, *arguments in (
        ("q", lambda t: np.zeros((2, 2)), 1.0),
        ("finite", lambda t: np.where(t > 0.4, np.nan, t), 1.0),
        ("functions", np.sin, 1.0, None, np.cos),
        ("duration", np.sin, 0.0),
    ):
        with pytest.raises((ShapeError, InvalidValueError), match=words):
            tr.Trajectory.from_functions(*arguments)


def test_a_path_moved_along_by_a_law_has_the_derivatives_of_both():
    timed = time_optimal(PATHS["spline"], FREE, planar(), [120, 40], points=50)
    motion, h = timed.trajectory, 1e-6
    breaks = motion.motion.law.breaks[0]
    t = 0.5 * (breaks[:-1] + breaks[1:])
    parts = (motion.q, motion.v, motion.a, motion.jerk)
    for value, slope in itertools.pairwise(parts):
        measured = (value(t + h) - value(t - h)) / (2 * h)
        assert slope(t) == pytest.approx(measured, abs=1e-6 * np.abs(measured).max())
    low, high = motion.motion.extremes(1)
    v = motion.v(np.linspace(0, motion.duration, 20_001))
    assert low == pytest.approx(v.min(axis=0), rel=1e-3, abs=1e-9)
    assert high == pytest.approx(v.max(axis=0), rel=1e-3, abs=1e-9)
    assert np.isinf(motion.motion.extremes(3)[1]).all()  # its acceleration jumps
