"""Exciting trajectories: gradients, limits that are kept, and random motions that are beaten."""

import pickle

import numpy as np
import pytest
from identities.random_robots import random_model, random_state

import robotmodels as rm
from robotmodels.errors import FrameNotFoundError, InvalidValueError, ShapeError
from robotmodels.identification.excitation import (
    ExcitationCriterion,
    ExcitationStatus,
    MotionBasis,
    MotionKind,
    WorkspaceBox,
    excitation_limits,
    exciting_trajectory,
)
from robotmodels.identification.excitation.bounds import excitation_torques
from robotmodels.identification.excitation.boxes import box_slacks, clearances
from robotmodels.identification.excitation.criterion import log_volume, smooth_condition
from robotmodels.identification.excitation.problem import ExcitationProblem, Stage
from robotmodels.identification.excitation.stacked import StackedRegressor
from robotmodels.kernels.regressor_gradient import regressor_gradients
from robotmodels.kernels.torque_regressor import torque_regressors
from robotmodels.trajectories import MotionLimits

KINDS = {
    "serial": {},
    "revolute": {"prismatic": False},
    "tree": {"tree": True, "f": 7, "tip": "any"},
    "fixed frames": {"tree": True, "fixed": True, "f": 8},
    "one joint": {"f": 1},
}


def of_kind(kind, seed=0, **options):
    return random_model(np.random.default_rng(seed), **{**KINDS[kind], **options})


def slope(function, x, direction, step=1e-6):
    return (function(x + step * direction) - function(x - step * direction)) / (2.0 * step)


# --- the kernel -----------------------------------------------------------------------------------


def regressors(model, q, v, a, place, columns):
    W = np.empty((len(q), model.n, columns))
    torque_regressors(q, v, a, *model.chain, model.gravity, place, W)
    return W


def gradients(model, q, v, a, place, G):
    out = [np.zeros(q.shape) for _ in range(3)]
    regressor_gradients(q, v, a, *model.chain, model.gravity, place, G, *out)
    return out


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", KINDS)
def test_kernel_is_the_derivative_of_the_regressor_entry_by_entry(kind, seed):
    model, rng = of_kind(kind, seed), np.random.default_rng(seed)
    q, v, a = random_state(model, rng, 3)
    place = np.arange(10 * model.f)
    G = rng.normal(size=(3, model.n, place.size))
    found = gradients(model, q, v, a, place, G)
    step = 1e-5
    for k in range(3):
        for j in range(model.n):
            ahead, behind = ([x.copy() for x in (q, v, a)] for _ in range(2))
            ahead[k][:, j] += step
            behind[k][:, j] -= step
            change = regressors(model, *ahead, place, place.size)
            change -= regressors(model, *behind, place, place.size)
            # the brute force loop: every entry of the regressor by itself
            expected = [
                sum(G[i, r, c] * change[i, r, c] / (2.0 * step)
                    for r in range(model.n) for c in range(place.size))
                for i in range(3)
            ]  # fmt: skip
            scale = max(1.0, np.abs(G).sum() * 0.1)
            assert np.allclose(found[k][:, j], expected, rtol=1e-7, atol=1e-8 * scale)


def test_kernel_takes_a_choice_of_columns_and_adds_to_its_output():
    model, rng = of_kind("tree"), np.random.default_rng(1)
    q, v, a = random_state(model, rng, 4)
    every = np.arange(10 * model.f)
    some = rng.choice(every, 17, replace=False)
    place = np.full(every.size, -1)
    place[some] = np.arange(17)
    G = rng.normal(size=(4, model.n, 17))
    whole = np.zeros((4, model.n, every.size))
    whole[:, :, some] = G
    out = [np.full(q.shape, 2.0) for _ in range(3)]
    regressor_gradients(q, v, a, *model.chain, model.gravity, place, G, *out)
    for value, expected in zip(out, gradients(model, q, v, a, every, whole), strict=True):
        assert np.allclose(value - 2.0, expected, atol=1e-11)
    empty = np.zeros((0, model.n))
    assert gradients(model, empty, empty, empty, every, whole[:0])[0].shape == (0, model.n)


def test_kernel_of_accelerations_is_the_mass_matrix():
    model, rng = of_kind("tree"), np.random.default_rng(2)
    q, v, a = random_state(model, rng, 1)
    row = rng.normal(size=model.n)
    G = row[:, None] * model.inertia.values.ravel()
    *_, of_a = gradients(model, q, v, a, np.arange(10 * model.f), G[None])
    assert np.allclose(of_a[0], rm.mass_matrix(model, q[0], drive=False) @ row, atol=1e-11)


# --- criteria and the stacked regressor -----------------------------------------------------------


@pytest.mark.parametrize(
    "function",
    [lambda W: smooth_condition(W, 2.0), lambda W: smooth_condition(W, 60.0), log_volume],
    ids=["sum", "nearly the condition number", "volume"],
)
@pytest.mark.parametrize("equal", [False, True])
def test_gradients_of_criteria(function, equal):
    rng = np.random.default_rng(3)
    W = rng.normal(size=(40, 6)) * np.logspace(0, 1.5, 6)
    if equal:  # the three least singular values are the same, where a condition number has a kink
        U, s, Vt = np.linalg.svd(W, full_matrices=False)
        s[-3:] = s[-1]
        W = U * s @ Vt
    _, gradient = function(W)
    for _ in range(5):
        D = rng.normal(size=W.shape)
        expected = slope(lambda x: function(x)[0], W, D, 1e-6)
        assert np.isclose((gradient * D).sum(), expected, rtol=1e-5, atol=1e-8)


def test_smooth_condition_is_an_upper_bound_that_closes():
    W = np.random.default_rng(4).normal(size=(50, 8))
    exact = np.log(np.linalg.cond(W))
    values = [smooth_condition(W, power)[0] for power in (2.0, 8.0, 60.0, 200.0)]
    assert np.all(np.diff(values) < 0.0)
    assert all(
        exact - 1e-12 <= value <= exact + 2.0 * np.log(8) / power
        for value, power in zip(values, (2.0, 8.0, 60.0, 200.0), strict=True)
    )
    assert np.isclose(log_volume(W)[0], -np.linalg.slogdet(W.T @ W)[1] / 16.0)


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("transmission", [False, True])
@pytest.mark.parametrize("kind", ["serial", "tree"])
def test_stacked_regressor_and_what_it_pulls_back(kind, transmission, smooth):
    model = of_kind(kind, 5, drive=True, transmission=transmission, f=5)
    rng = np.random.default_rng(5)
    q, v, a = random_state(model, rng, 4)
    base = rm.base_parameters(model)
    width = np.full(model.n, 0.3) if smooth else None
    regressor = StackedRegressor(model, base.names, True, width)
    W = regressor.matrix(q, v, a)
    if not smooth:
        assert np.array_equal(W, rm.torque_regressor(model, q, v, a, columns=base))
    G = rng.normal(size=W.shape)
    pulled = regressor.pulled_back(q, v, a, G)
    for k, one in enumerate(pulled):
        D = rng.normal(size=one.shape)

        def along(step, k=k, D=D):
            motion = [q, v, a]
            motion[k] = motion[k] + step * D
            return float((G * regressor.matrix(*motion)).sum())

        expected = (along(1e-6) - along(-1e-6)) / 2e-6
        assert np.isclose((one * D).sum(), expected, rtol=1e-6, atol=1e-5)


# --- the whole function ---------------------------------------------------------------------------


def problem_of(model, kind, criterion, boxes=(), tight=1.0):
    rng = np.random.default_rng(6)
    way = MotionKind[kind.upper()]
    base = rm.base_parameters(model, drive=("Ia", "Fv", "Fc"))
    limits, _ = excitation_limits(
        model, MotionLimits(2.0, 8.0, 80.0, lower=-1.5, upper=2.0).for_joints(model.n)
    )
    q, v, a = random_state(model, rng, 200)
    torques = tight * np.abs(rm.idm(model, q, v, a)).mean(axis=0)
    return ExcitationProblem(
        model, MotionBasis(way, 4.0, 4), base, ExcitationCriterion[criterion.upper()], limits,
        torques, boxes, 40, rng.uniform(0.5, 2.0, model.n), rng.uniform(0.5, 2.0, len(base)), 0.01,
    )  # fmt: skip


ROBOTS = {
    "serial with prismatic joints": lambda: of_kind("serial", 7, f=4, drive=True),
    "coupled wrist": lambda: of_kind("revolute", 8, f=4, drive=True, transmission=True),
    "tree with fixed frames": lambda: of_kind("fixed frames", 9, f=6, drive=True),
}


@pytest.mark.parametrize("criterion", ["condition", "log_det"])
@pytest.mark.parametrize("kind", ["fourier", "spline"])
@pytest.mark.parametrize("robot", ROBOTS)
def test_gradient_of_the_search(robot, kind, criterion):
    model = ROBOTS[robot]()
    boxes = (
        WorkspaceBox([-0.3, -0.3, -np.inf], [0.3, 0.3, 0.4]),
        WorkspaceBox([-0.2] * 3, [0.4] * 3, (1, model.f), inside=False),
    )
    problem = problem_of(model, kind, criterion, boxes)
    rng = np.random.default_rng(10)
    x = 0.6 * rng.normal(size=problem.units.size)
    stage = Stage(8.0, 50.0)
    value, gradient = problem.value(x, stage)
    assert value > problem.value(x, Stage(8.0, 0.0))[0] + 1.0  # every limit is exceeded somewhere
    for _ in range(3):
        d = rng.normal(size=x.size)
        expected = slope(lambda y: problem.value(y, stage)[0], x, d, 2e-7)
        assert np.isclose(gradient @ d, expected, rtol=3e-5, atol=1e-5 * np.linalg.norm(gradient))


def test_torques_of_the_search_are_those_of_the_model():
    model = ROBOTS["coupled wrist"]()
    problem = problem_of(model, "fourier", "condition")
    q, v, a = problem.motion(np.random.default_rng(0).normal(size=problem.units.size))[:3]
    sharp = StackedRegressor(model, problem.regressor.chosen.names, True)
    torque = sharp.matrix(q, v, a) @ problem.values
    assert np.allclose(torque, rm.idm(model, q, v, a), atol=1e-9 * np.abs(torque).max())


@pytest.mark.parametrize("inside", [True, False])
def test_box_slacks_have_the_sign_of_the_clearance(inside):
    model, rng = of_kind("serial", 11), np.random.default_rng(11)
    box = WorkspaceBox([-0.3, -0.2, 0.0], [0.2, np.inf, 0.5], inside=inside)
    q = rng.uniform(-2.0, 2.0, (300, model.n))
    ((values, by_q),) = box_slacks(model, box, q)
    clear = clearances(model, box, q)[:, 0]
    # rounded edges keep out a little farther
    assert np.all(values.min(axis=1) <= clear + 1e-12)
    assert np.all(values.min(axis=1) >= clear - 0.02)
    assert (clear > 0.0).any() or not inside
    d = rng.normal(size=model.n)
    step = 1e-6
    ahead, behind = (box_slacks(model, box, q + s * d)[0][0] for s in (step, -step))
    assert np.allclose(by_q @ d, (ahead - behind) / (2.0 * step), atol=1e-6)


# --- motions --------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", MotionKind)
def test_motions_are_closed_and_rest_at_their_ends(kind):
    basis = MotionBasis(kind, 3.0, 5)
    X = np.random.default_rng(0).normal(size=(basis.count, 2))
    trajectory = basis.trajectory(X)
    t = np.linspace(0.0, 3.0, 50)
    for order, values in enumerate(trajectory.motion.derivatives(t, (0, 1, 2, 3))):
        assert np.allclose(basis.at(t, order) @ X, values, atol=1e-9 * np.abs(values).max())
        if order in (1, 2):
            assert np.abs(values[[0, -1]]).max() < 1e-10 * np.abs(values).max()
    assert np.allclose(trajectory.q(0.0), trajectory.q(3.0))
    still = basis.trajectory(basis.centred(np.array([0.5, -1.0])))
    assert np.allclose(still.q(t), [0.5, -1.0])
    assert np.abs(still.v(t)).max() < 1e-12


def test_fourier_series_may_move_at_the_ends():
    assert MotionBasis(MotionKind.FOURIER, 1.0, 1, rest=False).count == 3
    free = exciting_trajectory(
        rm.load("planar_2r"), harmonics=2, rest=False, starts=1, baseline=4, iterations=20, rng=0
    )
    assert np.abs(free.trajectory.v(0.0)).max() > 1e-3


# --- results --------------------------------------------------------------------------------------


def keeps_limits(found, factor=1.0):
    """Every limit on a grid of its own."""
    t = np.linspace(0.0, found.basis.duration, 6007)
    q, v, a = (f(t) for f in (found.trajectory.q, found.trajectory.v, found.trajectory.a))
    of = found.limits.motion.limits
    room = 1.0 + 1e-9
    assert (q <= of.upper + 1e-9).all()
    assert (q >= of.lower - 1e-9).all()
    assert (np.abs(v) <= room * of.velocity).all()
    assert (np.abs(a) <= room * of.acceleration).all()
    torque = np.abs(rm.idm(found.model, q, v, a)).max(axis=0)
    assert (torque <= room * found.limits.torque_limits).all()
    assert (torque <= room * found.limits.torque).all()
    return q, v, a


@pytest.fixture(scope="module")
def rx90():
    return exciting_trajectory(rm.load("rx90"), starts=2, baseline=20, iterations=60, rng=0)


def test_rx90_is_excited_far_better_than_by_chance(rx90):
    assert rx90.condition < 32.0
    assert rx90.condition < 0.75 * rx90.baseline_conditions[0]
    assert len(rx90.baseline) == 20
    assert rx90.limits.kept
    assert all(start.after.condition < start.before.condition for start in rx90.starts)
    assert sum(rx90.starts[0].stages) == len(rx90.starts[0].history)
    keeps_limits(rx90)
    ends = [f([0.0, 10.0]) for f in (rx90.trajectory.v, rx90.trajectory.a)]
    assert max(np.abs(end).max() for end in ends) < 1e-10
    assert "joint 1, 2, 3, 4, 5, 6" in rx90.notes[0]


def test_condition_numbers_are_those_of_the_base_regressor(rx90):
    t = np.arange(500) * 0.02
    q, v, a = (f(t) for f in (rx90.trajectory.q, rx90.trajectory.v, rx90.trajectory.a))
    drive = ("Ia", "Fv", "Fc")
    full = rm.torque_regressor(rx90.model, q, v, a, drive=drive)
    W = rx90.base.reduce(full).reshape(-1, len(rx90.base))
    assert np.isclose(np.linalg.cond(W), rx90.condition, rtol=1e-9)
    assert np.isclose(np.linalg.cond(W / np.linalg.norm(W, axis=0)), rx90.scaled_condition)
    assert np.isclose(np.linalg.slogdet(W.T @ W / len(t))[1], rx90.log_det)


def test_results_are_values(rx90):
    again = pickle.loads(pickle.dumps(rx90))
    assert not again.coefficients.flags.writeable
    assert np.array_equal(again.trajectory.q(1.0), rx90.trajectory.q(1.0))
    assert again.condition == rx90.condition
    assert "every limit is kept" in str(rx90)
    assert repr(rx90).startswith("<ExcitingTrajectory of 'rx90': condition number")


def test_the_same_seed_gives_the_same_motion():
    one, two, other = (
        exciting_trajectory(
            rm.load("planar_2r"), harmonics=3, starts=2, baseline=6, iterations=30, rng=seed
        )
        for seed in (1, 1, 2)
    )
    assert np.array_equal(one.coefficients, two.coefficients)
    assert not np.array_equal(one.coefficients, other.coefficients)


@pytest.mark.parametrize("criterion", ["condition", "log_det"])
@pytest.mark.parametrize("kind", ["fourier", "spline"])
def test_tight_torques_and_boxes_are_kept(kind, criterion):
    model = rm.load("ur10e")
    boxes = [
        WorkspaceBox([-np.inf, -np.inf, 0.1], [np.inf] * 3, ("tool", "wrist_3_joint")),
        WorkspaceBox([0.2, 0.2, -1.0], [2.0, 2.0, 2.0], inside=False),
    ]
    torques = np.array([120.0, 130.0, 80.0, 20.0, 20.0, 20.0])
    found = exciting_trajectory(
        model, kind=kind, criterion=criterion, boxes=boxes, torque_limits=torques, starts=1,
        baseline=4, iterations=25, limits=MotionLimits.of_model(model, acceleration=5.0), rng=3,
    )  # fmt: skip
    assert found.limits.kept, found.limits
    q, _, _ = keeps_limits(found)
    assert np.array_equal(found.limits.torque_limits, torques)
    for k, box in enumerate(boxes):
        clear = clearances(model, box, q).min()
        assert clear >= 0.0
        assert clear >= found.limits.clearance[k] - 1e-9
    better = [one.of(found.criterion) for one in found.baseline]
    assert found.quality.of(found.criterion) < min(better)


def test_coupled_wrist_and_seven_joints():
    for name, b in (("tx40", 61), ("panda", 69)):
        found = exciting_trajectory(
            rm.load(name), drive=True, starts=1, baseline=3, iterations=25, rng=0
        )
        assert len(found.base) == b
        assert found.condition < 60.0
        assert found.limits.kept
        keeps_limits(found)


def test_weights_count():
    model = rm.load("planar_2r")
    base = rm.base_parameters(model, drive=("Ia", "Fv", "Fc"))
    options = {"starts": 2, "baseline": 6, "iterations": 60, "rng": 0, "harmonics": 3}
    plain = exciting_trajectory(model, **options)
    scale = np.where(np.arange(len(base)) == 0, 30.0, 1.0)
    weighted = exciting_trajectory(model, base=base, sigma=[1.0, 0.2], scale=scale, **options)
    assert plain.quality.weighted_condition == pytest.approx(plain.condition)
    t = np.arange(300) * 10.0 / 300
    W = rm.torque_regressor(
        model, plain.trajectory.q(t), plain.trajectory.v(t), plain.trajectory.a(t),
        drive=("Ia", "Fv", "Fc"), columns=base,
    )  # fmt: skip
    of_plain = np.linalg.cond((W * scale / np.array([1.0, 0.2])[:, None]).reshape(-1, len(base)))
    assert weighted.quality.weighted_condition < of_plain
    assert plain.condition < weighted.condition


def test_what_cannot_be_done_is_a_status_that_names_the_limits():
    model = rm.load("ur10e")
    found = exciting_trajectory(
        model, torque_limits=[330, 0.5, 0.5, 56, 56, 56],
        boxes=WorkspaceBox([-3, -3, 0.6], [3, 3, 0.8]), starts=1, baseline=3, iterations=5, rng=0,
    )  # fmt: skip
    assert found.status is ExcitationStatus.INFEASIBLE
    broken = " ".join(found.limits.violations())
    assert "joint 2: torque" in broken
    assert "allowed 0.5" in broken
    assert not found.limits.kept
    assert found.baseline == ()
    assert any("larger torque_limits" in note for note in found.notes)
    assert "limits that are not kept" in str(found)


def test_limits_of_jerk_are_kept():
    options = {"kind": "spline", "starts": 1, "baseline": 3, "iterations": 20, "rng": 0}
    t = np.linspace(0.0, 10.0, 4001)
    free, bound = (
        exciting_trajectory(
            rm.load("planar_2r"), limits=MotionLimits(2.0, 6.0, jerk, lower=-2.0, upper=2.0),
            **options,
        )
        for jerk in (np.inf, 2.0)
    )  # fmt: skip
    assert bound.limits.kept
    assert np.abs(free.trajectory.jerk(t)).max() > 2.5
    assert 1.0 < np.abs(bound.trajectory.jerk(t)).max() <= 2.0


def test_limits_that_are_missing_are_taken_and_said():
    limits, notes = excitation_limits(rm.load("stanford_arm"))
    assert np.isfinite([limits.lower, limits.upper, limits.velocity, limits.acceleration]).all()
    assert limits.velocity[2] == 1.0
    assert limits.velocity[0] == np.pi
    assert len(notes) == 2
    given = MotionLimits(1.0, 3.0, lower=-1.0, upper=[1.0, np.inf])
    kept, notes = excitation_limits(rm.load("planar_2r"), given)
    assert kept.upper[1] == pytest.approx(2.0 * np.pi - 1.0)
    assert kept.acceleration.tolist() == [3.0, 3.0]
    assert notes == ("No limit of position is given for joint 2; 3.142 is taken.",)


def test_limits_of_torque_need_masses():
    bare = rm.load("tx40").with_inertia(None)
    limits, notes = excitation_torques(bare, None)
    assert np.isinf(limits).all()
    assert "no inertial parameters" in notes[0]
    with pytest.raises(InvalidValueError, match="with_inertia"):
        excitation_torques(bare, 10.0)


def test_progress_counts_the_stages():
    seen = []
    exciting_trajectory(
        rm.load("planar_2r"), harmonics=2, starts=2, baseline=2, iterations=3, rng=0,
        progress=lambda done, of: seen.append((done, of)),
    )  # fmt: skip
    assert seen == [(k, 8) for k in range(1, 9)]


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
        ({"samples": 3}, InvalidValueError, "take more"),
        ({"margin": 0.7}, InvalidValueError, "margin"),
        ({"starts": 0}, InvalidValueError, "starts"),
        ({"iterations": 1.5}, InvalidValueError, "iterations"),
        ({"sigma": [1.0, 0.0]}, InvalidValueError, "sigma"),
        ({"scale": [1.0]}, ShapeError, "scale"),
        ({"torque_limits": [1.0, 2.0, 3.0]}, ShapeError, "torque_limits"),
        ({"torque_limits": -1.0}, InvalidValueError, "torque_limits"),
        ({"limits": MotionLimits(0.0)}, InvalidValueError, "no room"),
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
        exciting_trajectory(rm.load("planar_2r"), **{"baseline": 1, "starts": 1} | options)


@pytest.mark.parametrize(
    ("lower", "upper", "error"),
    [
        ([0.0] * 2, [1.0] * 3, ShapeError),
        ([0.0] * 3, [1.0, 1.0, 0.0], InvalidValueError),
        ([np.nan, 0, 0], [1.0] * 3, InvalidValueError),
        ([-np.inf] * 3, [np.inf] * 3, InvalidValueError),
    ],
)
def test_boxes_are_checked(lower, upper, error):
    with pytest.raises(error):
        WorkspaceBox(lower, upper)
