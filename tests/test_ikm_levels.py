"""Strict priorities between tasks, and the tasks themselves, by differences of poses."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from identities.random_robots import models, random_model, random_state, seeds

import robotmodels as rm
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.kinematics.inverse.distance_task import DistanceTask
from robotmodels.kinematics.inverse.function_task import FunctionTask
from robotmodels.kinematics.inverse.joint_task import JointTask
from robotmodels.kinematics.inverse.levels import Level, level_velocities, stacked
from robotmodels.kinematics.inverse.linear_task import LinearTask
from robotmodels.kinematics.inverse.methods import (
    DampedInverse,
    Damping,
    FilteredInverse,
    PseudoInverse,
)
from robotmodels.kinematics.inverse.position_task import PositionTask
from robotmodels.kinematics.inverse.tasks import Task
from robotmodels.kinematics.inverse.twist_task import TwistTask
from robotmodels.kinematics.lengths import characteristic_length

EXACT = PseudoInverse()
METHODS = [
    PseudoInverse(),
    FilteredInverse(0.3),
    DampedInverse(0.3, 0.1),
    DampedInverse(damping=Damping.CONSTANT, largest=0.2),
    DampedInverse(0.3, 0.1, Damping.SMALLEST_SINGULAR_VALUE),
    DampedInverse(0.3, 0.1, Damping.MANIPULABILITY),
    DampedInverse(0.3, 0.1, largest_speed=0.5),
]


def a_level(rng, N, m, n):
    return Level(rng.normal(size=(N, m, n)), rng.normal(size=(N, m)))


def done(level, v):
    return np.einsum("kij,kj->ki", level.J, v)


# --- one level ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("m", "n"), [(1, 1), (3, 7), (6, 6), (6, 7), (6, 3), (2, 9), (8, 5)])
def test_one_level_is_the_weighted_pseudo_inverse(rng, m, n):
    level = a_level(rng, 20, m, n)
    weights = rng.uniform(0.2, 5.0, size=n)
    z = rng.normal(size=(20, n))
    found = level_velocities([level], z, joint_weights=weights, method=EXACT)
    root = np.sqrt(weights)
    for i in range(20):
        J, rate = level.J[i], level.rate[i]
        inverse = np.linalg.pinv(J / root) / root[:, None]
        expected = inverse @ rate + (np.eye(n) - inverse @ J) @ z[i]
        np.testing.assert_allclose(found.v[i], expected, atol=1e-12 * np.linalg.cond(J) ** 2)
        np.testing.assert_allclose(found.error[0][i], rate - J @ found.v[i], atol=1e-13)
        values = np.zeros(m)
        values[: min(m, n)] = np.linalg.svd(J / root, compute_uv=False)
        np.testing.assert_allclose(found.singular_values[0][i], values, atol=1e-13)
    assert (found.scale == 1.0).all()
    assert not found.limited.any()
    assert not found.mixed.any()


def test_rows_are_weighted(rng):
    """Where not all can be met, rows of a larger weight are met better: weighted least squares."""
    level = a_level(rng, 10, 5, 3)
    weights = rng.uniform(0.1, 10.0, size=5)
    found = level_velocities([Level(level.J, level.rate, weights=weights)], method=EXACT)
    for J, rate, v in zip(level.J, level.rate, found.v, strict=True):
        expected = np.linalg.lstsq(J * weights[:, None], rate * weights)[0]
        np.testing.assert_allclose(v, expected, atol=1e-11)


def test_what_is_regular_is_exact_under_the_default(rng):
    found = level_velocities([a_level(rng, 200, 3, 7)])
    regular = found.singular_values[0][:, -1] > 0.04
    assert regular.sum() > 150
    assert np.abs(found.error[0][regular]).max() < 1e-13


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_the_null_space_of_a_damped_level_is_exact(rng, method):
    """The secondary motion does not move the task, though that is damped."""
    level = a_level(rng, 50, 3, 7)
    graded = Level(level.J * np.array([1.0, 1e-3, 1e-7])[:, None], level.rate)
    z = rng.normal(size=(50, 7))
    quiet = level_velocities([graded], method=method).v
    busy = level_velocities([graded], z, method=method).v
    tolerance = 1e-13 * (1.0 + np.abs(busy).max(axis=1, keepdims=True))
    assert (np.abs(done(graded, busy) - done(graded, quiet)) <= tolerance).all()
    # all that the task leaves is taken: four dimensions of seven
    assert np.linalg.matrix_rank(busy - quiet) == 7
    assert np.linalg.norm(busy - quiet, axis=1).min() > 0.1


# --- priorities --------------------------------------------------------------------------------


def difficult_levels(rng, N, n):
    """Levels of which later ones repeat, contradict and nearly repeat earlier ones."""
    first, second = a_level(rng, N, 3, n), a_level(rng, N, 2, n)
    same = Level(first.J[:, ::-1], rng.normal(size=(N, 3)))
    nearly = Level(first.J[:, :1] + 1e-7 * rng.normal(size=(N, 1, n)), rng.normal(size=(N, 1)))
    mixture = Level(first.J[:, :2] + second.J, rng.normal(size=(N, 2)))
    return [first, nearly, same, second, mixture, a_level(rng, N, 6, n)]


@pytest.mark.parametrize("method", METHODS, ids=repr)
@pytest.mark.parametrize("n", [4, 7, 9])
def test_lower_levels_never_disturb_higher_ones(rng, method, n):
    levels = difficult_levels(rng, 30, n)
    z = rng.normal(size=(30, n))
    whole = level_velocities(levels, z, method=method)
    for k in range(1, len(levels)):
        part = level_velocities(levels[:k], method=method)
        for level, error, expected in zip(levels, whole.error, part.error, strict=False):
            tolerance = 1e-12 * (1.0 + np.abs(whole.v).max(axis=1, keepdims=True))
            assert (np.abs(error - expected) <= tolerance).all()
            assert level.rate.shape == error.shape


@given(model=models(max_frames=9), seed=seeds, method=st.sampled_from(METHODS))
def test_lower_levels_never_disturb_higher_ones_on_robots(model, seed, method):
    rng = np.random.default_rng(seed)
    q, _, _ = random_state(model, rng, 4)
    tasks = [
        TwistTask(rng.normal(size=6), mask=[1, 1, 1, 0, 0, 0]),
        TwistTask(rng.normal(size=6), mask=[0, 0, 0, 1, 1, 0], reference="local"),
        PositionTask(rng.normal(size=3), frame=int(rng.integers(1, model.f + 1))),
        TwistTask(rng.normal(size=6)),
        JointTask([0.3], joints=[0]),
    ]
    levels = [task.level(model, q) for task in tasks]
    whole = level_velocities(levels, rng.normal(size=model.n), method=method)
    for k in range(1, len(levels)):
        part = level_velocities(levels[:k], method=method)
        for a, b, level in zip(whole.error, part.error, levels, strict=False):
            size = 1.0 + np.abs(level.J).max() * np.abs(whole.v).max()
            np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * size)


def test_each_level_is_met_as_well_as_the_higher_ones_let_it(rng):
    """Against nested least squares: the error of each level is the least possible."""
    n = 7
    levels = [a_level(rng, 20, m, n) for m in (2, 3, 1, 4)]
    found = level_velocities(levels, method=EXACT)
    for i in range(20):
        v, free = np.zeros(n), np.eye(n)
        for level, error in zip(levels, found.error, strict=True):
            J, rate = level.J[i], level.rate[i]
            v = v + free @ np.linalg.lstsq(J @ free, rate - J @ v, rcond=1e-10)[0]
            np.testing.assert_allclose(error[i], rate - J @ v, atol=1e-9)
            _, S, Vt = np.linalg.svd(J @ free)
            free = free @ Vt[(S > 1e-10).sum() :].T
        np.testing.assert_allclose(found.v[i], v, atol=1e-9)


def test_the_least_motion_that_meets_all_levels(rng):
    """Regular levels together are one level."""
    levels = [a_level(rng, 20, 2, 7), a_level(rng, 20, 3, 7)]
    together = level_velocities([stacked(levels)], method=EXACT)
    np.testing.assert_allclose(level_velocities(levels, method=EXACT).v, together.v, atol=1e-10)


@pytest.mark.parametrize("gap", [0.0, 1e-12, 1e-9, 1e-6, 1e-3])
def test_algorithmic_singularities_are_damped(rng, gap):
    """A lower task that nearly repeats a higher one moves the joints slowly, the rest exactly."""
    n, method = 7, DampedInverse(threshold=0.04, largest=0.02)
    first = a_level(rng, 50, 3, n)
    lower = Level(
        np.concatenate([first.J[:, :1] + gap * rng.normal(size=(50, 1, n)),
                        rng.normal(size=(50, 2, n))], axis=1),
        rng.normal(size=(50, 3)),
    )  # fmt: skip
    alone = level_velocities([first], method=method)
    found = level_velocities([first, lower], method=method)
    np.testing.assert_allclose(found.error[0], alone.error[0], rtol=0, atol=1e-12)
    rest = lower.rate - done(lower, alone.v)
    added = np.linalg.norm(found.v - alone.v, axis=1)
    assert (added <= method.gain * np.linalg.norm(rest, axis=1) * (1 + 1e-12)).all()
    # the two rows that nothing contradicts are met where they are regular
    regular = found.singular_values[1][:, 1] > 0.04
    assert regular.sum() > 30
    U = np.linalg.svd(lower.J @ (np.eye(n) - np.linalg.pinv(first.J) @ first.J))[0]
    good = np.einsum("kij,ki->kj", U[:, :, :2], found.error[1])[regular]
    assert np.abs(good).max() < 1e-11


def test_no_level_leaves_the_secondary_motion(rng):
    z = rng.normal(size=(3, 4))
    np.testing.assert_array_equal(level_velocities([], z).v, z)
    np.testing.assert_array_equal(
        level_velocities([], z, lower=[-0.1] * 4, upper=[0.1] * 4).v, np.clip(z, -0.1, 0.1)
    )


def test_batches_are_rows(rng):
    levels = [a_level(rng, 12, 3, 7), a_level(rng, 12, 6, 7)]
    z, high = rng.normal(size=(12, 7)), rng.uniform(0.1, 1.0, size=(12, 7))
    for bounds in ((None, None), (-high, high)):
        whole = level_velocities(levels, z, *bounds)
        for i in range(12):
            one = level_velocities(
                [Level(level.J[i : i + 1], level.rate[i : i + 1]) for level in levels],
                z[i], *(None if b is None else b[i] for b in bounds),
            )  # fmt: skip
            np.testing.assert_array_equal(one.v[0], whole.v[i])
            np.testing.assert_array_equal(one.scale[0], whole.scale[i])
            np.testing.assert_array_equal(one.limited[0], whole.limited[i])
    empty = level_velocities([a_level(rng, 0, 3, 7)], lower=[-1.0] * 7, upper=[1.0] * 7)
    assert empty.v.shape == (0, 7)
    assert empty.error[0].shape == (0, 3)


def test_what_is_wrong_is_named(rng):
    level = a_level(rng, 2, 3, 5)
    for call, error, words in (
        (lambda: Level(level.J[0], level.rate[0]), ShapeError, "(N, m, n)"),
        (lambda: Level(level.J, level.rate[:, :2]), ShapeError, "rate"),
        (lambda: Level(level.J, level.rate, weights=[1.0, 0.0, 1.0]), InvalidValueError, "weights"),
        (lambda: Level(level.J * np.nan, level.rate), InvalidValueError, "J"),
        (lambda: level_velocities([level, a_level(rng, 2, 3, 4)]), ShapeError, "same number"),
        (lambda: level_velocities([level, a_level(rng, 3, 3, 5)]), ShapeError, "same number"),
        (lambda: level_velocities([TwistTask(np.zeros(6))]), InvalidValueError, "task.level"),
        (lambda: level_velocities([]), InvalidValueError, "without a level"),
        (lambda: level_velocities([level], np.zeros(4)), ShapeError, "secondary"),
        (lambda: level_velocities([level], lower=np.zeros(5)), InvalidValueError, "both"),
        (lambda: level_velocities([level], lower=np.ones(5), upper=np.zeros(5)),
         InvalidValueError, "lower <= upper"),
        (lambda: level_velocities([level], lower=np.full(5, np.nan), upper=np.zeros(5)),
         InvalidValueError, "nan"),
        (lambda: level_velocities([level], lower=np.zeros(5), upper=np.zeros((3, 5))),
         ShapeError, "upper"),
        (lambda: level_velocities([level], joint_weights=np.zeros(5)),
         InvalidValueError, "joint_weights"),
        (lambda: level_velocities([level], method="damped"), InvalidValueError, "method"),
        (lambda: stacked([]), InvalidValueError, "at least one"),
    ):  # fmt: skip
        with pytest.raises(error) as caught:
            call()
        assert words in str(caught.value)


# --- tasks -------------------------------------------------------------------------------------


def elbow(q):
    """Gradients of sin(q1) q2 and of the sum of squares."""
    first = np.zeros_like(q)
    first[:, 0] = np.cos(q[:, 0]) * q[:, 1]
    first[:, 1] = np.sin(q[:, 0])
    return np.stack([first, 2.0 * q], axis=1)


def some_tasks(model, rng):
    frame = int(rng.integers(1, model.f + 1))
    other = int(rng.integers(0, model.f + 1))
    point = rng.normal(size=3)

    def position(q):
        T = rm.dgm(model, q, frame)
        return T[..., :3, :3] @ point + T[..., :3, 3]

    def distance(q):
        apart = rm.dgm(model, q)[..., :3, 3] - rm.dgm(model, q, other)[..., :3, 3]
        return np.linalg.norm(apart, axis=-1, keepdims=True)

    yield PositionTask(np.zeros(3), frame, point), position
    yield PositionTask(np.zeros(3), frame, point, mask=[0, 1, 1]), lambda q: position(q)[..., 1:]
    yield DistanceTask(0.0, first=other), distance
    yield JointTask([0.0], joints=[model.n - 1]), lambda q: q[..., -1:]
    if model.n >= 2:
        yield (
            FunctionTask(elbow, [0.0, 0.0]),
            lambda q: np.stack([np.sin(q[..., 0]) * q[..., 1], (q**2).sum(axis=-1)], axis=-1),
        )


def derivatives(f, q, v, a, h):
    """First and second time derivative of f along q + v t + a t^2 / 2, of fourth order."""
    values = [f(q + v * t + 0.5 * a * t * t) for t in (-2 * h, -h, 0.0, h, 2 * h)]
    first = np.dot([1.0, -8.0, 0.0, 8.0, -1.0], np.moveaxis(values, 0, -2)) / (12 * h)
    second = np.dot([-1.0, 16.0, -30.0, 16.0, -1.0], np.moveaxis(values, 0, -2)) / (12 * h * h)
    return first, second


@given(model=models(), seed=seeds)
def test_tasks_are_derivatives_of_what_they_name(model, seed):
    rng = np.random.default_rng(seed)
    q, v, a = random_state(model, rng, 3)
    v, a = v / (1.0 + np.abs(v).max()), a / (1.0 + np.abs(a).max())
    for task, function in some_tasks(model, rng):
        assert isinstance(task, Task)
        if isinstance(task, DistanceTask) and (function(q) < 0.2).any():
            continue  # differences of a distance near zero say nothing
        first, _ = derivatives(function, q, v, a, 1e-3)
        _, second = derivatives(function, q, v, a, 1e-2)
        level, above = task.level(model, q), task.acceleration_level(model, q, v)
        size = 1.0 + np.abs(level.J).max() ** 2
        np.testing.assert_allclose(done(level, v), first, rtol=0, atol=1e-8 * size)
        drift = 0.0 if above.drift is None else above.drift
        np.testing.assert_allclose(done(above, a) + drift, second, rtol=0, atol=2e-5 * size)
        np.testing.assert_array_equal(level.J, above.J)


@given(model=models(), seed=seeds, reference=st.sampled_from(["world_aligned", "local", "world"]))
def test_twist_tasks_are_rows_of_the_jacobian(model, seed, reference):
    rng = np.random.default_rng(seed)
    q, v, _ = random_state(model, rng, 2, 3)
    mask = rng.integers(0, 2, size=6)
    mask[rng.integers(6)] = 1
    frame, rows = int(rng.integers(0, model.f + 1)), np.flatnonzero(mask)
    task = TwistTask(np.arange(6.0), frame, reference, mask, length=0.5)
    level, above = task.level(model, q), task.acceleration_level(model, q, v)
    J = rm.jacobian(model, q, frame, reference).reshape(6, 6, model.n)[:, rows]
    rate = rm.jacobian_rate(model, q, v, frame, reference)
    np.testing.assert_allclose(level.J, J, atol=1e-14)
    np.testing.assert_array_equal(level.rate, np.tile(np.arange(6.0)[rows], (6, 1)))
    np.testing.assert_array_equal(level.weights, np.array([2.0] * 3 + [1.0] * 3)[rows])
    drift = np.einsum("abij,abj->abi", rate, v)[..., rows].reshape(6, -1)
    np.testing.assert_allclose(above.drift, drift, atol=1e-12)
    assert level.drift is None


def test_rates_broadcast_against_configurations():
    model = rm.load("panda")
    q = np.zeros((2, 3, 7))
    rate = np.arange(18.0).reshape(2, 3, 3)
    np.testing.assert_array_equal(PositionTask(rate).level(model, q).rate, rate.reshape(6, 3))
    assert DistanceTask(np.zeros((2, 1))).level(model, q).rate.shape == (6, 1)
    assert JointTask(np.zeros((3, 2)), joints=[0, 5]).level(model, q).rate.shape == (6, 2)
    assert PositionTask(np.zeros(3)).level(model, np.empty((0, 7))).J.shape == (0, 3, 7)
    with pytest.raises(ShapeError, match=r"rate: its shape \(4, 3\)"):
        PositionTask(np.zeros((4, 3))).level(model, q)


def test_lengths_make_prismatic_joints_and_positions_comparable():
    model = rm.load("stanford_arm")
    length = characteristic_length(model)
    level = JointTask([0.0, 0.0], joints=[1, 2]).level(model, np.zeros(6))
    np.testing.assert_array_equal(level.weights, [1.0, 1.0 / length])
    named = JointTask([0.0], joints=[model.table.joint_names[2]], length=2.0)
    np.testing.assert_array_equal(named.level(model, np.zeros(6)).weights, [0.5])
    np.testing.assert_array_equal(named.level(model, np.zeros(6)).J[0, 0], np.eye(6)[2])


def test_a_matrix_is_a_task_of_its_own(rng):
    model = rm.load("panda")
    q, v = rng.normal(size=(2, 4, 7))
    task = LinearTask(rng.normal(size=(2, 7)), [1.0, 2.0], drift=[3.0, 4.0], weights=[1.0, 5.0])
    level, above = task.level(model, q), task.acceleration_level(model, q, v)
    np.testing.assert_array_equal(level.J, np.tile(task.J, (4, 1, 1)))
    np.testing.assert_array_equal(above.drift, [[3.0, 4.0]] * 4)
    assert level.drift is None
    each = LinearTask(rng.normal(size=(4, 2, 7)), np.zeros(2))
    np.testing.assert_array_equal(each.level(model, q).J, each.J)


def test_accelerations_meet_tasks_of_second_order(rng):
    """Integrated over a short time the tool's twist and the elbow change as was asked."""
    model = rm.load("panda")
    q, v = rng.uniform(-0.8, 0.8, size=7) + np.array([0, 0, 0, -1.5, 0, 1.5, 0]), rng.normal(size=7)
    wanted, elbow_rate = rng.normal(size=6), 0.7
    levels = [
        TwistTask(wanted).acceleration_level(model, q, v),
        PositionTask([0.0, 0.0, elbow_rate], frame=4, mask=[0, 0, 1])
        .acceleration_level(model, q, v),
    ]  # fmt: skip
    a = level_velocities(levels, method=EXACT).v[0]

    def twist(t):
        return rm.dkm(model, q + v * t + 0.5 * a * t * t, v + a * t)

    def height(t):
        return rm.dgm(model, q + v * t + 0.5 * a * t * t, 4)[2, 3]

    h = 1e-3
    rate = (8 * (twist(h) - twist(-h)) - (twist(2 * h) - twist(-2 * h))) / (12 * h)
    np.testing.assert_allclose(rate, wanted, atol=1e-7)
    second = (height(h) - 2 * height(0.0) + height(-h)) / h**2
    np.testing.assert_allclose(second, elbow_rate, atol=1e-4)


def test_a_rate_of_the_gradient_may_be_given(rng):
    model = random_model(rng, f=4, prismatic=False)
    q, v, _ = random_state(model, rng, 3)
    given_rate = FunctionTask(lambda q: 2 * q, [0.0], lambda q, v: 2 * v)
    differences = FunctionTask(lambda q: 2 * q, [0.0])
    drift = given_rate.acceleration_level(model, q, v).drift
    np.testing.assert_allclose(drift[:, 0], 2 * (v**2).sum(axis=1), atol=1e-12)
    np.testing.assert_allclose(differences.acceleration_level(model, q, v).drift, drift, atol=1e-10)
    still = differences.acceleration_level(model, q, 0 * v).drift
    np.testing.assert_array_equal(still, np.zeros((3, 1)))


def test_coinciding_origins_have_no_distance_to_change():
    model = rm.load("rx90")
    level = DistanceTask(0.2, first=4, second=5).level(model, np.full(6, 0.3))
    np.testing.assert_array_equal(level.J, np.zeros((1, 1, 6)))
    found = level_velocities([level])
    np.testing.assert_array_equal(found.v, np.zeros((1, 6)))
    np.testing.assert_array_equal(found.error[0], [[0.2]])


def test_wrong_tasks_are_named(rng):
    model = rm.load("panda")
    q = np.zeros(7)
    for call, error, words in (
        (lambda: TwistTask(np.zeros(5)), ShapeError, "rate"),
        (lambda: TwistTask(np.zeros(6), mask=np.zeros(6)), InvalidValueError, "mask"),
        (lambda: TwistTask(np.zeros(6), mask=[1, 1, 1]), ShapeError, "mask"),
        (lambda: TwistTask(np.zeros(6), reference="tool"), InvalidValueError, "reference"),
        (lambda: TwistTask(np.zeros(6), frame="no").level(model, q), KeyError, "no"),
        (lambda: TwistTask(np.zeros(6), length=0.0).level(model, q), InvalidValueError, "length"),
        (lambda: PositionTask(np.zeros(3), mask=[2, 0, 0]), InvalidValueError, "mask"),
        (lambda: PositionTask(np.zeros(3), point=[0, 0]), ShapeError, "point"),
        (lambda: DistanceTask(np.nan), InvalidValueError, "rate"),
        (lambda: JointTask([0.0], joints="panda_joint1"), InvalidValueError, "sequence"),
        (lambda: JointTask([0.0, 0.0], joints=[1, 1]), InvalidValueError, "different"),
        (lambda: JointTask([0.0], joints=[0.5]), InvalidValueError, "columns"),
        (lambda: JointTask([0.0, 1.0], joints=[0]), ShapeError, "rate"),
        (lambda: JointTask([0.0], joints=[7]).level(model, q), InvalidValueError, "0 to 6"),
        (lambda: JointTask([0.0], joints=[-1]).level(model, q), InvalidValueError, "0 to 6"),
        (lambda: JointTask([0.0], joints=["nope"]).level(model, q), InvalidValueError, "'nope'"),
        (lambda: JointTask([0, 0], joints=[0, model.table.joint_names[0]]).level(model, q),
         InvalidValueError, "twice"),
        (lambda: LinearTask([1.0], [1.0]), ShapeError, "(..., m, n)"),
        (lambda: LinearTask(np.zeros((1, 6)), [1.0]).level(model, q), ShapeError, "7 columns"),
        (lambda: LinearTask(np.zeros((2, 1, 7)), [1.0]).level(model, np.zeros((3, 7))),
         ShapeError, "broadcast"),
        (lambda: FunctionTask(np.zeros(7), [0.0]), InvalidValueError, "LinearTask"),
        (lambda: FunctionTask(lambda q: q, 0.0), ShapeError, "(..., m)"),
        (lambda: FunctionTask(lambda q: q[:, :3], [0.0]).level(model, q), ShapeError, "gradient"),
        (lambda: FunctionTask(lambda q: q, [0.0], 3.0), InvalidValueError, "gradient_rate"),
        (lambda: TwistTask(np.zeros(6)).acceleration_level(model, q, np.zeros((2, 7))),
         ShapeError, "shape of q"),
        (lambda: TwistTask(np.zeros(6)).level(model, np.zeros(6)), ShapeError, "q"),
    ):  # fmt: skip
        with pytest.raises(error) as caught:
            call()
        assert words in str(caught.value)


@settings(max_examples=10)
@given(seed=seeds)
def test_many_joints_and_many_levels(seed):
    rng = np.random.default_rng(seed)
    levels = [a_level(rng, 3, int(rng.integers(0, 7)), 25) for _ in range(8)]
    found = level_velocities(levels, rng.normal(size=25), method=EXACT)
    used = 0
    for level, error in zip(levels, found.error, strict=True):
        used += level.m
        if used <= 20:
            assert np.abs(error).max(initial=0.0) < 1e-9
