"""Time scaling, random profiles and the planner: closed forms, another program, checks by idm."""

import pickle

import numpy as np
import pytest
from identities.random_robots import random_model
from test_time_optimal import FREE, ORACLE, planar

import robotmodels as rm
from robotmodels import trajectories as tr
from robotmodels.errors import InvalidValueError, NotARotationError, ShapeError
from robotmodels.obstacles import Plane, Sphere, clearance
from robotmodels.trajectories import (
    Cost,
    MotionLimits,
    PlanStatus,
    Pose,
    ScalingStatus,
    kinodynamic,
    plan_search,
    random_profile,
    time_optimal,
    time_scaled,
)
from robotmodels.trajectories.path_limits import PathLimits
from robotmodels.trajectories.time_scaling import stretched, torque_parts, windows_of

CASES = {
    "A": ([0, 0], [1, 0.5], [120, 40], 9.81),
    "B": ([0, 0], [1.5, 0.5], [60, 20], 0.0),
    "C": ([-1.2, 0.3], [1.0, -0.8], [90, 40], 9.81),
    "D": ([0, 0], [1.57, -1.57], [30, 10], 0.0),
}
PUMA_TORQUE = np.array([97.0, 186.0, 89.0, 24.0, 20.0, 21.0])
START = np.array([0.0, -0.5, -0.3, 0.2, 0.5, 0.0])
END = np.array([1.2, -1.4, 0.8, -0.6, 0.9, 1.0])


@pytest.fixture(autouse=True)
def _evaluations_and_not_seconds(monkeypatch):
    """A search ends by its evaluations, 40 for each second, however busy the machine is."""
    monkeypatch.setattr(plan_search, "RATE", 40)


def torques(model, motion, samples=10_001):
    at = motion.at(np.linspace(0.0, motion.duration, samples))
    v = np.where(np.abs(at.v) > 1e-12 * np.abs(at.v).max(), at.v, 0.0)  # no dry friction at rest
    return rm.idm(model, at.q, v, at.a)


# --- time scaling -------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_torques_of_a_stretched_profile_are_quadratic_in_the_inverse_duration(seed):
    rng = np.random.default_rng(seed)
    model = random_model(rng, f=5, tree=seed % 2 == 1, drive=True)
    profile = random_profile(rng.normal(size=model.n), rng.normal(size=model.n), 3, rng=rng)
    fraction = np.linspace(0, 1, 41)
    problem = PathLimits(model.n, model, None, 1e9, True, True)
    A, B, C = torque_parts(problem, stretched(profile.motion, 1.7), fraction)
    for T in (0.3, 1.0, 4.0):
        q, v, a = stretched(profile.motion, T).derivatives(fraction * T, (0, 1, 2))
        tau = rm.idm(model, q, v, a)
        v_is_zero = np.abs(v) < 1e-12  # dry friction is not determined there
        error = np.abs(A / T**2 + B / T + C - tau)[~v_is_zero]
        assert error.max() <= 1e-12 * np.abs(tau).max() * max(1.0, 1.0 / T**2)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("seed", range(4))
def test_the_least_duration_is_the_root_that_bisection_finds(seed):
    rng = np.random.default_rng(seed)
    model = random_model(rng, f=4, drive=True)
    ends = rng.normal(size=(2, model.n))
    law = ("spline", "quintic", "trapezoid", "spline")[seed]
    profile = random_profile(*ends, 3, law=law, rng=rng)
    q = profile.q(np.linspace(0, 1, 101))
    torque = 5.0 + 1.3 * np.abs(rm.gravity_torque(model, q) + model.drive.offset).max(axis=0)
    torque += model.drive.Fc
    scaled = time_scaled(profile, model, torque)
    assert scaled.status is ScalingStatus.SCALED

    def over(T):
        problem = PathLimits(model.n, model, None, torque, True, True)
        parts = torque_parts(problem, profile.motion, np.linspace(0, 1, 20_001))
        return (np.abs(parts[0] / T**2 + parts[1] / T + parts[2]) / torque).max()

    low, high = 0.5 * scaled.duration, 2.0 * scaled.duration
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if over(middle) > 1.0 else (low, middle)
    assert high <= scaled.duration * (1 + 1e-9)
    assert high == pytest.approx(scaled.duration, rel=1e-3)
    assert (scaled.windows[:, 0] <= scaled.duration * (1 + 1e-9)).all()
    assert (scaled.windows[:, 1] >= scaled.duration * (1 - 1e-9)).all()
    assert (np.abs(torques(model, scaled.trajectory)) <= torque * (1 + 1e-6)).all()
    assert scaled.trajectory.q([0.0, scaled.duration]) == pytest.approx(ends, abs=1e-9)


def test_windows_are_found_by_trying_durations():
    rng = np.random.default_rng(5)
    A, B, C = rng.normal(size=(3, 400, 2))
    A[:40], B[20:60] = 0.0, 0.0
    bound = np.array([1.0, 0.7])
    windows = windows_of((A, B, C), bound, 0.05)
    T = np.geomspace(0.05, 1e4, 40_001)
    for i in range(400):
        tau = A[i] / T[:, None] ** 2 + B[i] / T[:, None] + C[i]
        good = (np.abs(tau) <= bound).all(axis=1)
        if not good.any():
            assert windows[i, 0] == np.inf or np.diff(windows[i]) < 1e-2 * windows[i, 0]
            continue
        first = int(good.argmax())
        assert windows[i, 0] == pytest.approx(T[first], rel=4e-4)
        end = np.flatnonzero(~good[first:])
        last = T[first + end[0]] if end.size else np.inf
        assert windows[i, 1] == pytest.approx(last, rel=4e-4)


def test_speeds_bound_the_duration_too_and_weak_motors_are_named():
    arm = rm.load("ur5e")
    move = tr.quintic(np.zeros(6), np.full(6, 0.1), duration=3.0)
    limits = MotionLimits(velocity=0.5, acceleration=20.0)
    assert time_scaled(move, arm, None, limits).duration == pytest.approx(0.375)
    # the same path as a motion by functions
    functions = tr.Trajectory.from_functions(move.q, 3.0, move.v, move.a)
    by_torque, again = (time_scaled(x, arm, arm.table.effort * 0.5) for x in (move, functions))
    assert again.duration == pytest.approx(by_torque.duration, rel=1e-9)
    weak = time_scaled(tr.quintic([0, 0], [1, 1], duration=1.0), planar(), 20.0)
    assert weak.status is ScalingStatus.NOT_HELD_STILL
    assert weak.trajectory is None
    assert "joint 1" in weak.reason()
    for result in (weak, by_torque):
        assert pickle.loads(pickle.dumps(result)) == result
    for arguments in (
        (move, arm, np.inf),
        (move, arm, -1.0),
        (move, planar(), 1.0),
        (np.zeros(3), arm, 1.0),
        (tr.quintic([0.0], [0.0], duration=0.0), arm, 1.0),
        (tr.quintic(np.ones(6), np.ones(6), duration=1.0), arm, 150.0),
    ):
        with pytest.raises((InvalidValueError, ShapeError)):
            time_scaled(*arguments)


def test_random_profiles():
    ends = np.array([[0.0, 1.0], [1.0, -1.0]])
    for law in ("spline", "trapezoid", "quintic"):
        for nodes in (0, 1, 4):
            profile = random_profile(*ends, nodes, law, rng=nodes)
            assert profile.duration == pytest.approx(1.0, rel=1e-12)
            assert profile.q([0.0, 1.0]) == pytest.approx(ends, abs=1e-12)
            assert profile.v([0.0, 1.0]) == pytest.approx(np.zeros((2, 2)), abs=1e-9)
            assert random_profile(*ends, nodes, law, rng=nodes) == profile
    a, b = (random_profile(*ends, rng=k).q(0.5) for k in (1, 2))
    assert not np.allclose(a, b)
    assert random_profile(0.0, 1.0).q(1.0) == pytest.approx(1.0)
    for arguments in (([0.0], [0.0]), ([0.0], [1.0], -1), ([0.0], [1.0], 2, "sine")):
        with pytest.raises(InvalidValueError):
            random_profile(*arguments)


# --- the planner --------------------------------------------------------------------------------


@pytest.mark.sampled(1)
@pytest.mark.parametrize("name", CASES)
def test_free_motions_are_as_quick_as_those_of_optimal_control(name):
    q0, q1, torque, g = CASES[name]
    calls = []
    plan = kinodynamic(planar(g), q0, q1, FREE, torque, rng=0, seconds=100.0, progress=calls.append)
    assert plan.status is PlanStatus.FOUND
    assert 0.99 <= plan.duration / ORACLE["free"][name] <= 1.05
    use = np.abs(torques(planar(g), plan.trajectory)).max(axis=0) / torque
    assert use.max() <= 1.001
    assert plan.torque_use == pytest.approx(use, abs=1e-3)
    assert plan.trajectory.q([0.0, plan.duration]) == pytest.approx(np.array([q0, q1]), abs=1e-9)
    assert plan.trajectory.v([0.0, plan.duration]) == pytest.approx(np.zeros((2, 2)), abs=1e-6)
    assert plan.cost == plan.duration
    assert plan.history.shape == (plan.evaluations, 3)
    assert (np.diff(plan.history[:, 2]) <= 0.0).all()
    straight = time_optimal(tr.linear(q0, q1, duration=1.0), FREE, planar(g), torque)
    assert plan.duration < straight.duration
    assert calls == sorted(calls)
    assert calls[-1] == 1.0


@pytest.mark.nightly
def test_a_profile_is_stretched_where_that_is_asked_for():
    q0, q1, torque, g = CASES["A"]
    given = {"torque": torque, "rng": 1, "seconds": 20.0}
    profile = kinodynamic(planar(g), q0, q1, FREE, timing="profile", **given)
    assert profile.status is PlanStatus.FOUND
    optimal = kinodynamic(planar(g), q0, q1, FREE, timing="optimal", **given)
    assert optimal.duration <= profile.duration
    again = time_scaled(profile.trajectory, planar(g), torque)
    assert again.duration == pytest.approx(profile.duration, rel=1e-9)
    along = time_optimal(profile.trajectory, FREE, planar(g), torque, points=400)
    assert along.duration <= profile.duration
    assert kinodynamic(planar(g), q0, q1, FREE, timing="profile", **given) == profile
    by_descent = kinodynamic(planar(g), q0, q1, FREE, method="descent", **given)
    assert by_descent.duration <= 1.05 * ORACLE["free"]["A"]


@pytest.mark.nightly
def test_six_joints_through_a_point_and_around_a_body():
    puma = rm.load("puma560")
    limits = MotionLimits(velocity=5.0)
    quintic = time_scaled(tr.quintic(START, END, duration=1.0), puma, PUMA_TORQUE, limits)
    straight = time_optimal(  # limits kept between the points of the grid too, as of a plan
        tr.linear(START, END, duration=1.0), limits, puma, PUMA_TORQUE, points=400, both_ends=True
    )
    plan = kinodynamic(puma, START, END, limits, PUMA_TORQUE, seconds=30.0)
    assert plan.duration <= 0.9 * quintic.duration
    assert plan.duration <= straight.duration
    assert (np.abs(torques(puma, plan.trajectory)) <= 1.001 * PUMA_TORQUE).all()
    assert plan.trajectory.check(limits, 1e-3).violations() == ()
    via = np.array([0.8, -0.5, 0.2, 0.3, 0.2, 0.5])
    through = kinodynamic(puma, START, END, limits, PUMA_TORQUE, via=[via], seconds=8.0)
    assert through.trajectory.q(through.via_times[0]) == pytest.approx(via, abs=1e-9)
    assert through.duration > plan.duration
    middle = rm.dgm(puma, straight.trajectory.q(straight.duration / 2))[:3, 3]
    ball = Sphere(middle, 0.08)
    around = kinodynamic(
        puma, START, END, limits, PUMA_TORQUE, obstacles=ball, clearance=0.03, seconds=20.0
    )
    assert around.status is PlanStatus.FOUND
    q = around.trajectory.q(np.linspace(0, around.duration, 10_000))
    assert clearance(puma, q, ball).min() >= 0.03 - 1e-6
    assert (np.abs(torques(puma, around.trajectory)) <= 1.001 * PUMA_TORQUE).all()


@pytest.mark.nightly
def test_limits_and_torques_in_the_cost_slow_the_motion_down():
    q0, q1, torque, g = CASES["B"]
    ends = np.array([q0, q1])
    for limits in (
        MotionLimits(lower=ends.min(axis=0) - 0.1, upper=ends.max(axis=0) + 0.1),
        MotionLimits(velocity=3.0, acceleration=20.0, jerk=100.0),
    ):
        kept = kinodynamic(planar(g), q0, q1, limits, torque, seconds=20.0)
        assert kept.trajectory.check(limits, 1e-6).kept
    plans = [
        kinodynamic(planar(g), q0, q1, FREE, torque, cost=Cost(1.0, w), timing=t, seconds=10.0)
        for w in (0.0, 3.0)
        for t in ("optimal", "profile")
    ]
    for quick, slow in ((plans[0], plans[2]), (plans[1], plans[3])):
        assert slow.duration > 1.1 * quick.duration
        square = np.mean(((torques(planar(g), slow.trajectory) / torque) ** 2).sum(axis=1))
        assert slow.cost == pytest.approx(slow.duration * (1 + 3 * square), rel=1e-6)
        square = np.mean(((torques(planar(g), quick.trajectory) / torque) ** 2).sum(axis=1))
        assert slow.cost < quick.duration * (1 + 3 * square)


def test_ends_as_poses_choose_the_posture():
    model, torque = planar(0.0), [60, 20]
    goal = rm.dgm(model, [0.4, 1.2])
    chosen = kinodynamic(model, [0, -1.0], Pose(goal), FREE, torque, seconds=20.0)
    assert rm.dgm(model, chosen.trajectory.q(chosen.duration)) == pytest.approx(goal, abs=1e-9)
    far = goal.copy()
    far[0, 3] += 9.0
    lost = kinodynamic(model, [0, 0], Pose(far), FREE, torque, seconds=25.0)
    assert lost.status is PlanStatus.NONE_FOUND
    assert "q1" in lost.reason()
    with pytest.raises(NotARotationError):
        Pose(2.0 * np.eye(4))
    assert pickle.loads(pickle.dumps(Pose(goal))) == Pose(goal)


def test_ends_that_are_not_allowed_have_a_status():
    model = planar()
    weak = kinodynamic(model, [0, 0], [1, 1], FREE, [50, 40])
    assert weak.status is PlanStatus.ENDS_NOT_HELD
    assert "q0" in weak.reason()
    assert "joint 1" in weak.reason()
    assert weak.evaluations == 0
    strong = [120, 40]
    floor = Plane([0, -0.1, 0], [0, 1, 0])
    hit = kinodynamic(model, [0.5, 0], [-0.6, 0.2], FREE, strong, obstacles=[floor])
    assert hit.status is PlanStatus.ENDS_IN_COLLISION
    assert "q1" in hit.reason()
    for plan in (weak, hit):
        assert pickle.loads(pickle.dumps(plan)) == plan


LIGHT = rm.RobotModel.from_table(rm.DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.5]))
WEIGHED = {"torque": np.inf, "cost": Cost(1.0, 1.0), "limits": MotionLimits(1.0)}


@pytest.mark.filterwarnings("error::RuntimeWarning", "ignore:.*no masses")
@pytest.mark.parametrize(
    ("word", "change"),
    [
        ("q0", {"q0": [0.0]}),
        ("q1", {"q1": [0.0, np.nan]}),
        ("same", {"q1": [0.0, 0.0]}),
        (r"via\[1\]", {"via": [[0.5, 0.5], [0.5, 0.5]]}),
        ("via", {"via": Pose(np.eye(4))}),
        ("outside its limits", {"limits": MotionLimits(upper=0.5)}),
        ("obstacles", {"obstacles": [3]}),
        ("cost", {"cost": 1.0}),
        ("timing", {"timing": "slow"}),
        ("model", {"model": "rx90"}),
        ("torques", WEIGHED),
        ("inertia", {"model": LIGHT, "timing": "optimal"}),
        ("inertia", {"model": LIGHT, "timing": "profile"}),
    ],
)
def test_refused_input(word, change):
    given = {"model": planar(), "q0": [0, 0], "q1": [1, 1], "limits": FREE, "torque": [120, 40]}
    with pytest.raises((InvalidValueError, ShapeError), match=word):
        kinodynamic(**(given | change), seconds=0.3)
