"""Exciting trajectories: gradients, limits, quality beside random motions, and the budget."""

import pickle
import re
import subprocess
import sys
import time

import numpy as np
import pytest
from identities.random_robots import random_model, random_state

import robotmodels as rm
from robotmodels.errors import FrameNotFoundError, InvalidValueError, ShapeError
from robotmodels.identification import WorkspaceBox, exciting_trajectory
from robotmodels.identification.excitation import excitation_limits, search
from robotmodels.identification.excitation.limits import box_distances, excitation_torques
from robotmodels.identification.excitation.motions import MotionBasis
from robotmodels.identification.excitation.objective import (
    ExcitationProblem,
    MotionRegressor,
    log_volume,
    smooth_condition,
)
from robotmodels.identification.excitation.result import ExcitationStatus
from robotmodels.trajectories import MotionLimits

ROBOTS = {
    "serial": {"f": 4},
    "coupled wrist": {"prismatic": False, "transmission": True, "f": 4},
    "tree": {"tree": True, "f": 6, "tip": "any"},
    "fixed frames": {"tree": True, "fixed": True, "f": 6},
    "one joint": {"f": 1},
}


def robot(kind, seed=0):
    return random_model(np.random.default_rng(seed), drive=True, **ROBOTS[kind])


def quick(name="planar_2r", **options):
    few = {"starts": 1, "baseline": 3, "iterations": 20, "rng": 0}
    return exciting_trajectory(rm.load(name), **{**few, **options})


def slope(function, x, direction, step=1e-6):
    return (function(x + step * direction) - function(x - step * direction)) / (2.0 * step)


# --- gradients ------------------------------------------------------------------------------------


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ROBOTS)
def test_regressor_of_a_motion_and_its_gradients(kind, seed, smooth):
    """The rows of each sample depend on that sample alone; any choice of columns."""
    model, rng = robot(kind, seed), np.random.default_rng(seed)
    motion = random_state(model, rng, 4)
    names = [str(name) for name in rng.permutation(rm.parameter_names(model))]
    names = names[: max(3, 2 * len(names) // 3)]
    regressor = MotionRegressor(model, names, True, np.full(model.n, 0.3) if smooth else None)
    W = regressor.matrix(*motion)
    if not smooth:
        assert np.array_equal(W, rm.torque_regressor(model, *motion, columns=names))
    G = rng.normal(size=W.shape)
    for k, found in enumerate(regressor.gradients(*motion, G)):
        for j in range(model.n):

            def value(x, k=k, j=j):
                moved = [y.copy() for y in motion]
                moved[k][:, j] = x
                return (G * regressor.matrix(*moved)).sum(axis=(1, 2))

            expected = slope(value, motion[k][:, j], np.ones(4), 1e-5)
            size = max(1.0, 0.1 * np.abs(G).sum())
            assert np.allclose(found[:, j], expected, rtol=1e-7, atol=1e-8 * size)
    empty = np.zeros((0, model.n))
    assert regressor.gradients(empty, empty, empty, G[:0])[0].shape == (0, model.n)


@pytest.mark.parametrize("power", [2.0, 60.0, None])
@pytest.mark.parametrize("equal", [False, True])
def test_gradients_of_criteria(power, equal):
    def function(W):
        return log_volume(W) if power is None else smooth_condition(W, power)

    rng = np.random.default_rng(3)
    W = rng.normal(size=(40, 6)) * np.logspace(0, 1.5, 6)
    if equal:  # the three least singular values are the same, where a condition number has a kink
        U, s, Vt = np.linalg.svd(W, full_matrices=False)
        s[-3:] = s[-1]
        W = U * s @ Vt
    _, gradient = function(W)
    for _ in range(5):
        D = rng.normal(size=W.shape)
        expected = slope(lambda x: function(x)[0], W, D)
        assert np.isclose((gradient * D).sum(), expected, rtol=1e-5, atol=1e-8)


def test_smooth_condition_is_an_upper_bound_that_closes():
    W, powers = np.random.default_rng(4).normal(size=(50, 8)), np.array([2.0, 8.0, 60.0, 200.0])
    gap = [smooth_condition(W, power)[0] for power in powers] - np.log(np.linalg.cond(W))
    assert np.all(np.diff(gap) < 0.0)
    assert np.all((gap >= -1e-12) & (gap <= 2.0 * np.log(8) / powers))
    assert np.isclose(log_volume(W)[0], -np.linalg.slogdet(W.T @ W)[1] / 16.0)


BOXES = (
    WorkspaceBox([-0.3, -0.3, -np.inf], [0.3, 0.3, 0.4]),
    WorkspaceBox([-0.2] * 3, [0.4] * 3, (1, 4), inside=False),
)


@pytest.mark.parametrize("criterion", ["condition", "log_det"])
@pytest.mark.parametrize("kind", ["fourier", "spline"])
@pytest.mark.parametrize("name", ["serial", "coupled wrist", "fixed frames"])
def test_gradient_of_the_search(name, kind, criterion):
    model, rng = robot(name, 8), np.random.default_rng(6)
    base = rm.base_parameters(model, drive=("Ia", "Fv", "Fc"))
    limits = MotionLimits(2.0, 8.0, 80.0, lower=-1.5, upper=2.0).for_joints(model.n)
    torques = np.abs(rm.idm(model, *random_state(model, rng, 200))).mean(axis=0)
    weight, basis = rng.uniform(0.5, 2.0, (model.n, len(base))), MotionBasis(kind, 4.0, 4)
    problem = ExcitationProblem(
        model, basis, base, criterion, limits, torques, BOXES, 40, weight, 0.01
    )
    x = 0.6 * rng.normal(size=problem.units.size)
    value, gradient = problem.value(x, 8.0, 50.0)
    assert value > problem.value(x, 8.0, 0.0)[0] + 1.0  # every limit is exceeded somewhere
    for _ in range(3):
        d = rng.normal(size=x.size)
        expected = slope(lambda y: problem.value(y, 8.0, 50.0)[0], x, d, 2e-7)
        assert np.isclose(gradient @ d, expected, rtol=3e-5, atol=1e-5 * np.linalg.norm(gradient))
    sharp = MotionRegressor(model, rm.parameter_names(model), True)
    motion = problem.motion(x)[:3]
    torque = sharp.matrix(*motion) @ rm.parameter_vector(model)
    assert np.allclose(torque, rm.idm(model, *motion), atol=1e-9 * np.abs(torque).max())


@pytest.mark.parametrize("inside", [True, False])
def test_distances_of_boxes_and_their_gradients(inside):
    model, rng = robot("serial", 11), np.random.default_rng(11)
    box = WorkspaceBox([-0.3, -0.2, 0.0], [0.2, np.inf, 0.5], [2, model.f], inside=inside)
    q = rng.uniform(-2.0, 2.0, (300, model.n))
    values, by_q = box_distances(model, box, q)
    points = np.stack([rm.dgm(model, q, frame)[:, :3, 3] for frame in box.frames], axis=1)
    beyond = np.maximum(box.lower - points, points - box.upper)
    clear = -beyond.max(axis=2)
    if not inside:
        far = np.linalg.norm(np.maximum(beyond, 0.0), axis=2)
        clear = np.where(far > 0.0, far, -clear)
    assert np.allclose(values.min(axis=1), clear.min(axis=1))
    assert np.allclose(box.clearance(points), clear)
    d = rng.normal(size=model.n)
    expected = slope(lambda x: box_distances(model, box, x)[0], q, d)
    assert np.isclose(by_q @ d, expected, atol=1e-6).mean() > 0.999


# --- motions --------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["fourier", "spline"])
def test_motions_are_closed_and_rest_at_their_ends(kind):
    basis = MotionBasis(kind, 3.0, 5)
    X = np.random.default_rng(0).normal(size=(basis.count, 2))
    trajectory, t = basis.trajectory(X), np.linspace(0.0, 3.0, 50)
    for order, values in enumerate(trajectory.motion.derivatives(t, (0, 1, 2, 3))):
        assert np.allclose(basis.at(t, order) @ X, values, atol=1e-9 * np.abs(values).max())
        if order in (1, 2):
            assert np.abs(values[[0, -1]]).max() < 1e-10 * np.abs(values).max()
    assert np.allclose(trajectory.q(0.0), trajectory.q(3.0))
    still = basis.trajectory(basis.constant(np.array([0.5, -1.0])))
    assert np.allclose(still.q(t), [0.5, -1.0])
    assert np.abs(still.v(t)).max() < 1e-12


def test_fourier_series_may_move_at_the_ends():
    assert MotionBasis("fourier", 1.0, 1, rest=False).count == 3
    assert np.abs(quick(harmonics=2, rest=False).trajectory.v(0.0)).max() > 1e-3


# --- results --------------------------------------------------------------------------------------


def keeps_limits(found):
    """Every limit on a grid of its own, boxes included."""
    t = np.linspace(0.0, found.basis.duration, 6007)
    q, v, a = (f(t) for f in (found.trajectory.q, found.trajectory.v, found.trajectory.a))
    of, room = found.limits.motion.limits, 1.0 + 1e-9
    assert found.limits.kept, found.limits.violations()
    assert ((q <= of.upper + 1e-9) & (q >= of.lower - 1e-9)).all()
    assert ((np.abs(v) <= room * of.velocity) & (np.abs(a) <= room * of.acceleration)).all()
    torque = np.abs(rm.idm(found.model, q, v, a)).max(axis=0)
    assert (torque <= room * np.minimum(found.limits.torque_limits, found.limits.torque)).all()
    return q


@pytest.fixture(scope="module")
def rx90():
    return quick("rx90", starts=2, baseline=20, iterations=60)


def test_rx90_is_excited_far_better_than_by_chance(rx90):
    assert rx90.condition < 32.0
    assert rx90.condition < 0.75 * rx90.baseline_conditions[0]
    assert len(rx90.baseline) == 20
    assert all(start.after.condition < start.before.condition for start in rx90.starts)
    assert sum(rx90.starts[0].stages) == len(rx90.starts[0].history)
    keeps_limits(rx90)
    assert "joint 1, 2, 3, 4, 5, 6" in rx90.notes[0]
    # its numbers are those of the base regressor
    t = np.arange(500) * 0.02
    motion = [f(t) for f in (rx90.trajectory.q, rx90.trajectory.v, rx90.trajectory.a)]
    full = rm.torque_regressor(rx90.model, *motion, drive=("Ia", "Fv", "Fc"))
    W = rx90.base.reduce(full).reshape(-1, len(rx90.base))
    assert np.isclose(np.linalg.cond(W), rx90.condition, rtol=1e-9)
    assert np.isclose(np.linalg.cond(W / np.linalg.norm(W, axis=0)), rx90.scaled_condition)
    assert np.isclose(np.linalg.slogdet(W.T @ W / len(t))[1], rx90.log_det)


def test_results_are_values_and_repeat_with_their_seed(rx90):
    again = pickle.loads(pickle.dumps(rx90))
    assert not again.coefficients.flags.writeable
    assert np.array_equal(again.trajectory.q(1.0), rx90.trajectory.q(1.0))
    assert again.condition == rx90.condition
    assert "every limit is kept" in str(rx90)
    assert repr(rx90).startswith("<ExcitingTrajectory of 'rx90': condition number")
    one, two, other = (quick(harmonics=3, rng=seed).coefficients for seed in (1, 1, 2))
    assert np.array_equal(one, two)
    assert not np.array_equal(one, other)


@pytest.mark.parametrize("criterion", ["condition", "log_det"])
@pytest.mark.parametrize("kind", ["fourier", "spline"])
def test_tight_torques_and_boxes_are_kept(kind, criterion):
    boxes = [
        WorkspaceBox([-np.inf, -np.inf, 0.1], [np.inf] * 3, ("tool", "wrist_3_joint")),
        WorkspaceBox([0.2, 0.2, -1.0], [2.0, 2.0, 2.0], inside=False),
    ]
    torques = np.array([120.0, 130.0, 80.0, 20.0, 20.0, 20.0])
    limits = MotionLimits.of_model(rm.load("ur10e"), acceleration=5.0)
    options = {"kind": kind, "criterion": criterion, "boxes": boxes, "torque_limits": torques}
    found = quick("ur10e", limits=limits, rng=3, **options)
    q = keeps_limits(found)
    assert np.array_equal(found.limits.torque_limits, torques)
    for box, clearance in zip(boxes, found.limits.clearance, strict=True):
        assert box_distances(found.model, box, q)[0].min() >= clearance - 1e-9 >= 0.0
    assert found.quality.of(criterion) < min(quality.of(criterion) for quality in found.baseline)


@pytest.mark.parametrize(("name", "b"), [("tx40", 61), ("panda", 69)])
def test_coupled_wrist_and_seven_joints(name, b):
    found = quick(name, drive=True, iterations=25)
    assert len(found.base) == b
    assert found.condition < 60.0
    keeps_limits(found)


def test_weights_count():
    drive, sigma = ("Ia", "Fv", "Fc"), np.array([1.0, 0.2])
    base = rm.base_parameters(rm.load("planar_2r"), drive=drive)
    options = {"starts": 2, "baseline": 6, "iterations": 60, "harmonics": 3}
    scale = np.where(np.arange(len(base)) == 0, 30.0, 1.0)
    plain, weighted = quick(**options), quick(base=base, sigma=sigma, scale=scale, **options)
    assert plain.quality.weighted_condition == pytest.approx(plain.condition)
    t = np.arange(300) * 10.0 / 300
    motion = [f(t) for f in (plain.trajectory.q, plain.trajectory.v, plain.trajectory.a)]
    W = rm.torque_regressor(plain.model, *motion, drive=drive, columns=base)
    of_plain = np.linalg.cond((W * scale / sigma[:, None]).reshape(-1, len(base)))
    assert weighted.quality.weighted_condition < of_plain
    assert plain.condition < weighted.condition


def test_what_cannot_be_done_is_a_status_that_names_the_limits():
    box, torques = WorkspaceBox([-3, -3, 0.6], [3, 3, 0.8]), [330, 0.5, 0.5, 56, 56, 56]
    found = quick("ur10e", torque_limits=torques, boxes=box, iterations=5)
    assert found.status is ExcitationStatus.INFEASIBLE
    assert re.search("joint 2: torque .*, allowed 0.5", " ".join(found.limits.violations()))
    assert not found.limits.kept
    assert found.baseline == ()
    assert any("larger torque_limits" in note for note in found.notes)
    assert "limits that are not kept" in str(found)


def test_limits_of_jerk_are_kept():
    t = np.linspace(0.0, 10.0, 4001)
    free, bound = (
        quick(kind="spline", limits=MotionLimits(2.0, 6.0, jerk, lower=-2.0, upper=2.0))
        for jerk in (np.inf, 2.0)
    )
    assert bound.limits.kept
    assert np.abs(free.trajectory.jerk(t)).max() > 2.5
    assert 1.0 < np.abs(bound.trajectory.jerk(t)).max() <= 2.0


def test_missing_limits_are_assumed_and_noted():
    limits, notes = excitation_limits(rm.load("stanford_arm"))
    assert np.isfinite([limits.lower, limits.upper, limits.velocity, limits.acceleration]).all()
    assert limits.velocity[[2, 0]].tolist() == [1.0, np.pi]
    assert len(notes) == 2
    given = MotionLimits(1.0, 3.0, lower=-1.0, upper=[1.0, np.inf])
    kept, notes = excitation_limits(rm.load("planar_2r"), given)
    assert kept.upper[1] == pytest.approx(2.0 * np.pi - 1.0)
    assert kept.acceleration.tolist() == [3.0, 3.0]
    assert notes == ("No limit of position is given for joint 2; 3.142 is taken.",)
    bare = rm.load("tx40").with_inertia(None)
    torques, notes = excitation_torques(bare, None)
    assert np.isinf(torques).all()
    assert "no inertial parameters" in notes[0]
    with pytest.raises(InvalidValueError, match="with_inertia"):
        excitation_torques(bare, 10.0)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"harmonics": 1}, InvalidValueError, "at least 2"),
        ({"kind": "spline", "points": 2}, InvalidValueError, "at least 3"),
        ({"kind": "spline", "rest": False}, InvalidValueError, "rest"),
        ({"points": 4}, InvalidValueError, "harmonics="),
        ({"kind": "bezier"}, InvalidValueError, "'fourier', 'spline'"),
        ({"criterion": "best"}, InvalidValueError, "'condition', 'log_det'"),
        ({"duration": 0.0}, InvalidValueError, "duration"),
        ({"duration": None}, InvalidValueError, "duration"),
        ({"samples": 3}, InvalidValueError, "take more"),
        ({"margin": 0.7}, InvalidValueError, "margin"),
        ({"starts": 0}, InvalidValueError, "starts"),
        ({"iterations": 1.5}, InvalidValueError, "iterations"),
        ({"sigma": [1.0, 0.0]}, InvalidValueError, "sigma"),
        ({"scale": [1.0]}, ShapeError, "scale"),
        ({"torque_limits": [1.0, 2.0, 3.0]}, ShapeError, "torque_limits"),
        ({"torque_limits": -1.0}, InvalidValueError, "torque_limits"),
        ({"limits": MotionLimits(0.0)}, InvalidValueError, "no range"),
        ({"limits": MotionLimits([1.0, 1.0, 1.0])}, ShapeError, "limits"),
        ({"boxes": WorkspaceBox([0] * 3, [1] * 3, "hand")}, FrameNotFoundError, "hand"),
        ({"boxes": [3]}, InvalidValueError, "WorkspaceBox"),
        ({"base": "all"}, InvalidValueError, "base"),
        ({"base": rm.base_parameters(rm.load("rx90"))}, InvalidValueError, "others"),
        ({"progress": 3}, InvalidValueError, "progress"),
    ],
)
def test_mistakes_are_named(options, error, message):
    with pytest.raises(error, match=message):
        quick(**options)


def test_boxes_are_checked():
    for lower, upper, error in (
        ([0.0] * 2, [1.0] * 3, ShapeError),
        ([0.0] * 3, [1.0, 1.0, 0.0], InvalidValueError),
        ([-np.inf] * 3, [np.inf] * 3, InvalidValueError),
    ):
        with pytest.raises(error):
            WorkspaceBox(lower, upper)


# --- the budget -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["rx90", "panda"])
def test_the_budget_bounds_the_multiplications_of_any_robot(name, monkeypatch):
    budget, seen = 7e8, []
    value = ExcitationProblem.value

    def counting(self, *arguments):
        seen.append(self.work)
        return value(self, *arguments)

    monkeypatch.setattr(ExcitationProblem, "value", counting)
    monkeypatch.setattr(search, "BUDGET", budget)
    one = exciting_trajectory(rm.load(name), rng=0)
    evaluations = len(seen)
    assert 0.5 * budget < sum(seen) < 1.2 * budget
    assert len(one.starts) == 1
    assert len(one.baseline) <= 24
    assert one.status is ExcitationStatus.LIMIT_OF_ITERATIONS
    assert any("more iterations (iterations=" in note for note in one.notes)
    assert any("benefit of more starts cannot be estimated" in note for note in one.notes)
    assert one.limits.kept
    assert one.condition < one.baseline_conditions[0]
    twice = exciting_trajectory(rm.load(name), rng=0, starts=2)
    assert len(seen) - evaluations == pytest.approx(2 * evaluations, rel=0.25)
    assert twice.condition <= one.condition


def test_iterations_that_are_asked_for_are_made_and_counted(monkeypatch):
    monkeypatch.setattr(search, "BUDGET", 1e8)
    done = []
    found = quick(starts=2, progress=lambda *counts: done.append(counts))
    assert found.starts[0].stages.tolist() == [20, 20, 20, 20]
    assert found.status is ExcitationStatus.LIMIT_OF_ITERATIONS
    assert done == [(k, 8) for k in range(1, 9)]


SCRIPT = """
import hashlib, robotmodels as rm
from robotmodels.identification import exciting_trajectory
found = exciting_trajectory(rm.load("rx90"), starts=1, baseline=3, iterations=10, rng=5)
print(hashlib.sha256(found.coefficients.tobytes()).hexdigest())
"""


def test_the_same_bits_with_any_number_of_threads(monkeypatch):
    seen = set()
    for threads in ("1", "2"):
        monkeypatch.setenv("OPENBLAS_NUM_THREADS", threads)
        command = [sys.executable, "-c", SCRIPT]
        seen.add(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    assert len(seen) == 1


def expected_gain(found):
    """Percent that the notes expect of twice the starts."""
    (number,) = re.findall(r"lower the condition number by about (\S+) %", " ".join(found.notes))
    return float(number)


def test_twice_the_starts_bring_about_what_is_expected():
    rng = np.random.default_rng(0)
    values = rng.normal(size=(4000, 16))
    expected = np.mean([search.gain_of_twice(row[:8]) for row in values])
    assert expected == pytest.approx(np.mean(values[:, :8].min(1) - values.min(1)), rel=0.1)
    assert search.gain_of_twice(values[0, :1]) == 0.0
    # two robots, three searches each: what 8 starts found beyond their first 4
    expected, brought = [], []
    for name in ("planar_2r", "lab_trr"):
        for seed in range(3):
            options = {"harmonics": 3, "baseline": 8, "iterations": 30, "rng": seed}
            twice = exciting_trajectory(rm.load(name), starts=8, **options)
            ends = np.log([start.after.condition for start in twice.starts])
            assert expected_gain(twice) == pytest.approx(100 * search.gain_of_twice(ends), rel=0.06)
            expected.append(search.gain_of_twice(ends[:4]))
            brought.append(ends[:4].min() - ends.min())
    assert 0.25 * np.mean(expected) < np.mean(brought) < 4.0 * np.mean(expected)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "reached"), [("ur10e", 29.2), ("panda", 28.8), ("iiwa14", 37.8)])
def test_the_default_is_good_within_twenty_seconds(name, reached):
    start = time.process_time()
    found = exciting_trajectory(rm.load(name), rng=0)
    assert time.process_time() - start < 20.0
    assert found.limits.kept
    assert found.condition < 1.3 * reached
    assert found.condition < found.baseline_conditions[0]
    assert len(found.baseline) == 100
    assert 0.0 < expected_gain(found) < 20.0
