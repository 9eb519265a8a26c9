"""Bounds of velocities and accelerations: exact scales, least motions, joints that can stop."""

import numpy as np
import pytest
from identities.random_robots import random_model, random_state
from scipy.optimize import linprog, nnls

import robotmodels as rm
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.kinematics.inverse.bounds import JointBounds
from robotmodels.kinematics.inverse.levels import Level, level_velocities
from robotmodels.kinematics.inverse.methods import DampedInverse, PseudoInverse
from robotmodels.kinematics.inverse.twist_task import TwistTask

EXACT = PseudoInverse()


def largest_scale(A, start, way, lower, upper):
    """Largest s in [0, 1] with ``A v = start + s way`` inside bounds, by a simplex; None: none."""
    n = A.shape[1]
    if not len(A):
        return 1.0
    found = linprog(
        np.r_[np.zeros(n), -1.0],
        A_eq=np.c_[A, -way],
        b_eq=start,
        bounds=[*zip(lower, upper, strict=True), (0.0, 1.0)],
        method="highs-ds",
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    assert found.status in (0, 2)
    return found.x[-1] if found.status == 0 else None


def optimality_error(A, v, wish, lower, upper, weights=1.0):
    """How far v is from the least ``|v - wish|`` with its A v inside the bounds (multipliers)."""
    n = v.size
    above = np.eye(n)[v >= upper - 1e-11]
    below = -np.eye(n)[v <= lower + 1e-11]
    # wish - v = A^T y + (upper bounds) - (lower bounds), multipliers of bounds not negative
    columns = np.concatenate([A, -A, above, below]).T
    if not columns.size:
        return np.linalg.norm(wish - v)
    return nnls(columns, weights * (wish - v), maxiter=10000)[1]


def influenced(J, free=None):
    """Orthonormal combinations of the rows of J that motions in the free space change."""
    W = J if free is None else J @ free
    U, S, _ = np.linalg.svd(W)
    rank = int((1e-10 * max(np.abs(J).max(), 1e-300) < S).sum())
    return U[:, :rank].T


def null_space(J):
    _, S, Vt = np.linalg.svd(J)
    return Vt[int((S > 1e-10).sum()) :].T


KINDS = ["regular", "singular", "integers", "some stopped", "integers and zeros", "half open",
         "on the border", "a joint that does nothing"]  # fmt: skip


def a_case(rng, kind, m, n):
    J, rate = rng.normal(size=(m, n)), rng.normal(size=m) * 10.0 ** rng.uniform(-2, 1)
    lower, upper = -rng.uniform(0.0, 1.0, size=n), rng.uniform(0.0, 1.0, size=n)
    if kind == "singular" and m > 1:
        J[-1] = J[0] + (J[1] if m > 2 else 0.0)
        rate = J @ rng.normal(size=n)
    elif kind in ("integers", "integers and zeros"):
        J = np.round(J)
        rate = J @ np.round(rng.normal(size=n))
        if kind == "integers and zeros":
            lower, upper = np.round(2 * lower), np.round(2 * upper)
    elif kind == "some stopped":
        lower, upper = (np.where(rng.random(n) < 0.4, 0.0, x) for x in (lower, upper))
    elif kind == "half open":
        lower = np.where(rng.random(n) < 0.5, -np.inf, lower)
        upper = np.where(rng.random(n) < 0.5, np.inf, upper)
    elif kind == "on the border":
        rate = J @ np.where(rng.random(n) < 0.5, lower, upper)
    elif kind == "a joint that does nothing":
        J[:, rng.integers(n)] = 0.0
    wish = rng.normal(size=n) * rng.choice([0.0, 1.0, 5.0])
    return J, rate, lower, upper, wish


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("m", "n"), [(6, 6), (6, 7), (6, 9), (3, 7), (3, 3), (1, 8), (2, 1)])
def test_the_scale_is_the_largest_and_the_motion_the_least(kind, m, n):
    rng = np.random.default_rng([m, n, KINDS.index(kind)])
    slowed = 0
    for _ in range(9):
        J, rate, lower, upper, wish = a_case(rng, kind, m, n)
        found = level_velocities([Level(J[None], rate[None])], wish, lower, upper, method=EXACT)
        v, s = found.v[0], found.scale[0, 0]
        assert ((lower <= v) & (v <= upper)).all()
        assert not found.mixed.any()
        U = influenced(J)
        A, way = U @ J, U @ rate
        expected = largest_scale(A, np.zeros(len(U)), way, lower, upper)
        assert s == pytest.approx(expected, rel=0, abs=1e-9)
        np.testing.assert_allclose(
            A @ v, s * way, rtol=0, atol=1e-11 * (1 + np.abs(way).max(initial=0.0))
        )
        assert optimality_error(A, v, wish, lower, upper) < 1e-8 * (1 + np.abs(wish).max())
        np.testing.assert_array_equal(found.limited[0], (v == lower) | (v == upper))
        slowed += s < 1.0 - 1e-9
    if kind == "regular" and m == 6:
        assert slowed > 0


def test_the_least_motion_is_weighted(rng):
    for _ in range(40):
        J, rate, lower, upper, wish = a_case(rng, "regular", 3, 7)
        weights = rng.uniform(0.1, 10.0, size=7)
        found = level_velocities([Level(J[None], rate[None])], wish, lower, upper, weights, EXACT)
        v, s = found.v[0], found.scale[0, 0]
        assert ((lower <= v) & (v <= upper)).all()
        assert s == pytest.approx(largest_scale(J, 0 * rate, rate, lower, upper), rel=0, abs=1e-9)
        np.testing.assert_allclose(J @ v, s * rate, atol=1e-11)
        assert optimality_error(J, v, wish, lower, upper, weights) < 1e-8


def test_wide_bounds_change_nothing(rng):
    levels = [Level(rng.normal(size=(20, m, 7)), rng.normal(size=(20, m))) for m in (3, 6)]
    z = rng.normal(size=(20, 7))
    for method in (EXACT, DampedInverse()):
        free = level_velocities(levels, z, method=method)
        for bound in (1e6, np.inf):
            held = level_velocities(levels, z, [-bound] * 7, [bound] * 7, method=method)
            np.testing.assert_allclose(held.v, free.v, rtol=0, atol=1e-11)
            np.testing.assert_array_equal(held.scale, np.ones((20, 2)))
            assert not held.limited.any()


def test_no_room_is_no_motion(rng):
    level = Level(rng.normal(size=(5, 3, 7)), rng.normal(size=(5, 3)))
    found = level_velocities([level, level], rng.normal(size=7), np.zeros(7), np.zeros(7))
    np.testing.assert_array_equal(found.v, np.zeros((5, 7)))
    np.testing.assert_array_equal(found.scale[:, 0], np.zeros(5))
    assert found.limited.all()


def test_a_damped_level_keeps_its_damped_direction(rng):
    """Near a singular position the part that damping asks for is what is scaled."""
    J = rng.normal(size=(30, 6, 7))
    J[:, 5] = J[:, 4] + 1e-3 * rng.normal(size=(30, 7))
    level = Level(J, rng.normal(size=(30, 6)))
    method = DampedInverse(0.1, 0.05)
    free = level_velocities([level], method=method)
    held = level_velocities([level], lower=[-0.1] * 7, upper=[0.1] * 7, method=method)
    for i in range(30):
        s = held.scale[i, 0]
        np.testing.assert_allclose(J[i] @ held.v[i], s * (J[i] @ free.v[i]), atol=1e-12)
        way = np.linalg.svd(J[i])[2][:6]
        expected = largest_scale(way, np.zeros(6), way @ free.v[i], [-0.1] * 7, [0.1] * 7)
        assert s == pytest.approx(expected, rel=0, abs=1e-9)


@pytest.mark.parametrize("sizes", [(3, 3), (3, 2, 2), (2, 6), (6, 3)])
@pytest.mark.parametrize("n", [7, 9])
def test_levels_under_bounds(sizes, n):
    """Lower levels leave higher ones as they are and take the largest part that is left."""
    rng = np.random.default_rng([n, *sizes])
    kinds = {"whole": 0, "part": 0, "mixed": 0}
    for _ in range(9):
        levels = [Level(rng.normal(size=(1, m, n)), rng.normal(size=(1, m))) for m in sizes]
        lower, upper = -rng.uniform(0.1, 1.0, size=n), rng.uniform(0.1, 1.0, size=n)
        wish = rng.normal(size=n)
        fixed, told = np.empty((0, n)), np.empty(0)
        for k, level in enumerate(levels, start=1):
            found = level_velocities(levels[:k], wish, lower, upper, method=EXACT)
            v, s = found.v[0], found.scale[0, -1]
            assert ((lower <= v) & (v <= upper)).all()
            np.testing.assert_allclose(fixed @ v, told, rtol=0, atol=1e-10)
            # joints that the higher levels hold at a bound
            stuck = held_joints(fixed, told, lower, upper)
            rows = np.concatenate([fixed, np.eye(n)[stuck]])
            U = influenced(level.J[0], null_space(rows))
            A, rate = U @ level.J[0], U @ level.rate[0]
            whole = np.concatenate([fixed, A])
            way = np.r_[0 * told, rate]
            expected = largest_scale(whole, np.r_[told, 0 * rate], way, lower, upper)
            assert found.mixed[0, -1] == (expected is None)
            start = np.zeros(len(U))
            if expected is None:
                quiet = level_velocities(levels[: k - 1], None, lower, upper, method=EXACT).v[0]
                start = A @ quiet
                way = np.r_[0 * told, rate - start]
                expected = largest_scale(whole, np.r_[told, start], way, lower, upper)
                kinds["mixed"] += 1
            assert s == pytest.approx(expected, rel=0, abs=1e-8)
            np.testing.assert_allclose(A @ v, start + s * way[len(told) :], rtol=0, atol=1e-10)
            kinds["part" if s < 1 else "whole"] += 1
            fixed = np.concatenate([fixed, level.J[0]])
            told = fixed @ v
        # of all motions that do this it is the nearest to the wish
        assert optimality_error(fixed, v, wish, lower, upper) < 1e-8
    assert kinds["whole"] > 0
    assert kinds["part"] > 0


def held_joints(A, b, lower, upper):
    """Joints that cannot move where ``A v = b`` and the bounds hold, by two programmes each."""
    n = lower.size
    if not len(A):
        return np.zeros(n, bool)
    widths = []
    for j in range(n):
        ends = []
        for sign in (1.0, -1.0):
            # the equations hold but for rounding
            found = linprog(
                sign * np.eye(n)[j],
                A_ub=np.concatenate([A, -A]),
                b_ub=np.concatenate([b, -b]) + 1e-9,
                bounds=[*zip(lower, upper, strict=True)],
                method="highs-ds",
                options={"primal_feasibility_tolerance": 1e-10, "presolve": False},
            )
            assert found.status == 0
            ends.append(found.x[j])
        widths.append(ends[1] - ends[0])
    return np.array(widths) < 1e-6


def test_bounds_that_drive_back_are_kept(rng):
    """Bounds without zero: some motion is forced, the level takes what is left of its way."""
    mixed = 0
    for _ in range(60):
        J, rate, lower, upper, wish = a_case(rng, "regular", 6, 7)
        j = rng.integers(7)
        lower[j], upper[j] = 0.2, 0.5
        found = level_velocities([Level(J[None], rate[None])], wish, lower, upper, method=EXACT)
        v, s = found.v[0], found.scale[0, 0]
        assert ((lower <= v) & (v <= upper)).all()
        expected = largest_scale(J, np.zeros(6), rate, lower, upper)
        assert found.mixed[0, 0] == (expected is None)
        start = np.zeros(6)
        if expected is None:
            start = J @ np.clip(0.0, lower, upper)
            expected = largest_scale(J, start, rate - start, lower, upper)
            mixed += 1
        assert s == pytest.approx(expected, rel=0, abs=1e-9)
        np.testing.assert_allclose(J @ v, start + s * (rate - start), atol=1e-11)
    assert 10 < mixed < 60


def test_a_drift_that_cannot_be_held_is_met_in_part(rng):
    J, rate = rng.normal(size=(1, 6, 7)), np.zeros((1, 6))
    drift = 100.0 * rng.normal(size=(1, 6))
    bound = np.ones(7)
    found = level_velocities([Level(J, rate, drift)], None, -bound, bound, method=EXACT)
    assert found.mixed[0, 0]
    assert 0.0 < found.scale[0, 0] < 1.0
    s = largest_scale(J[0], np.zeros(6), -drift[0], -bound, bound)
    assert found.scale[0, 0] == pytest.approx(s, rel=0, abs=1e-10)
    np.testing.assert_allclose(J[0] @ found.v[0], -s * drift[0], atol=1e-10)
    np.testing.assert_allclose(found.error[0], rate - drift - (J @ found.v[0]), atol=1e-12)


@pytest.mark.parametrize("f", [2, 6, 8])
def test_robots_never_exceed_their_limits(f):
    rng = np.random.default_rng(f)
    for tree in (False, True):
        model = random_model(rng, f=f, tree=tree, fixed=tree)
        q, _, _ = random_state(model, rng, 200)
        bounds = JointBounds(step=0.01)
        lower, upper = bounds.velocity_bounds(model, q)
        levels = [TwistTask(3.0 * rng.normal(size=(200, 6))).level(model, q)]
        levels.append(TwistTask(rng.normal(size=6), frame=1).level(model, q))
        found = level_velocities(levels, rng.normal(size=model.n), lower, upper)
        assert ((lower <= found.v) & (found.v <= upper)).all()
        assert (np.abs(found.v) <= model.table.velocity).all()
        inside = ~bounds.outside(model, q)
        ahead = q + 0.01 * found.v
        assert (ahead <= model.upper + 1e-12)[inside].all()
        assert (ahead >= model.lower - 1e-12)[inside].all()
        assert found.limited.any()


# --- limits as bounds --------------------------------------------------------------------------


def test_velocity_bounds_by_hand():
    model = rm.load("planar_2r")
    bounds = JointBounds(velocity=[1.0, 2.0], lower=-1.0, upper=[1.0, np.inf], step=0.5)
    low, high = bounds.velocity_bounds(model, [[0.0, 0.0], [0.75, -0.75], [1.1, -1.5]])
    np.testing.assert_allclose(high, [[1.0, 2.0], [0.5, 2.0], [-0.2, 2.0]], atol=1e-15)
    np.testing.assert_allclose(low, [[-1.0, -2.0], [-1.0, -0.5], [-1.0, 1.0]], atol=1e-15)
    assert bounds.outside(model, [1.1, -1.5]).tolist() == [True, True]
    # far outside the return is as fast as the joint may be
    np.testing.assert_array_equal(bounds.velocity_bounds(model, [9.0, -9.0])[1], [-1.0, 2.0])
    np.testing.assert_array_equal(bounds.velocity_bounds(model, [9.0, -9.0])[0], [-1.0, 2.0])
    assert bounds.conflicts(model, [9.0, -9.0]).all()


def test_without_a_step_joints_stop_at_the_limit():
    model = rm.load("planar_2r")
    bounds = JointBounds(velocity=1.0, lower=-1.0, upper=1.0)
    low, high = bounds.velocity_bounds(model, [[1.0, -1.0], [0.999, 1.5]])
    np.testing.assert_array_equal(high, [[0.0, 1.0], [1.0, 0.0]])
    np.testing.assert_array_equal(low, [[-1.0, 0.0], [-1.0, -1.0]])
    braking = JointBounds(velocity=1.0, lower=-1.0, upper=1.0, acceleration=2.0)
    np.testing.assert_allclose(braking.velocity_bounds(model, [0.99, 1.0])[1], [0.2, 0.0])


def test_small_steps_are_the_braking_distance():
    model = rm.load("planar_2r")
    for step in (1e-3, 1e-5):
        bounds = JointBounds(lower=-1.0, upper=1.0, acceleration=2.0, step=step)
        high = bounds.velocity_bounds(model, [0.5, -0.9])[1]
        np.testing.assert_allclose(high, np.sqrt([2.0, 7.6]), rtol=2 * step)


def random_command(rng, low, high):
    """Mostly at a bound, else anything between."""
    kind = rng.random(low.shape)
    return np.where(kind < 0.5, high, np.where(kind < 0.7, low, low + rng.random() * (high - low)))


@pytest.mark.parametrize("step", [0.002, 0.05, 0.7])
@pytest.mark.parametrize("acceleration", [None, 1.0, [0.5, 3.0, 100.0]], ids=str)
def test_joints_always_stop_in_time(step, acceleration):
    """Whatever is commanded within the bounds, positions, speeds and accelerations are kept."""
    model, rng = rm.load("planar_3r"), np.random.default_rng(1)
    lower, upper = np.array([-1.0, -1.0, 0.0]), np.array([1.0, 0.5, 0.01])
    bounds = JointBounds([1.5, 0.3, np.inf], lower, upper, acceleration, step)
    q = rng.uniform(lower, upper, size=(60, 3))
    v = np.zeros_like(q)
    for _ in range(120):
        low, high = bounds.acceleration_bounds(model, q, v)
        assert (low <= high).all()
        assert not bounds.conflicts(model, q, v, accelerations=True).any()
        a = random_command(rng, low, high)
        for t in np.linspace(0.0, step, 7):  # between the samples, too
            assert (q + v * t + 0.5 * a * t * t <= upper + 1e-12).all()
            assert (q + v * t + 0.5 * a * t * t >= lower - 1e-12).all()
        q, v = q + v * step + 0.5 * a * step**2, v + a * step
        assert (np.abs(v[:, :2]) <= np.array([1.5, 0.3]) + 1e-12).all()
        if acceleration is not None:
            assert (np.abs(a) <= np.array(acceleration) + 1e-12).all()
    # and they are not held back more than that: each limit is reached
    q, v = q[:2], v[:2]
    for _ in range(int(60 / step) if step > 0.01 else 4000):
        a = np.minimum(bounds.acceleration_bounds(model, q, v)[1], 1e6)
        q, v = q + v * step + 0.5 * a * step**2, v + a * step
    np.testing.assert_allclose(q, np.broadcast_to(upper, q.shape), atol=1e-6)


@pytest.mark.parametrize("step", [0.002, 0.05, 0.7])
def test_commanded_velocities_change_no_faster_than_they_can(step):
    model, rng = rm.load("planar_3r"), np.random.default_rng(2)
    lower, upper = np.array([-1.0, -1.0, 0.0]), np.array([1.0, 0.5, 0.01])
    A = np.array([0.5, 3.0, 100.0])
    bounds = JointBounds([1.5, 0.3, np.inf], lower, upper, A, step)
    q = rng.uniform(lower, upper, size=(100, 3))
    v = np.zeros_like(q)
    for _ in range(300):
        low, high = bounds.velocity_bounds(model, q, v)
        assert not bounds.conflicts(model, q, v).any()
        command = random_command(rng, low, high)
        assert (np.abs(command - v) <= A * step * (1 + 1e-12)).all()
        q, v = q + command * step, command
        assert ((lower - 1e-12 <= q) & (q <= upper + 1e-12)).all()


def test_limits_that_exclude_each_other_are_told():
    model = rm.load("planar_2r")
    bounds = JointBounds(1.0, -1.0, 1.0, acceleration=5.0, step=0.01)
    q, v = [0.99, 0.0], [1.0, 1.2]
    low, high = bounds.acceleration_bounds(model, q, v)
    # the first joint brakes as it can; the second, too fast, as well
    np.testing.assert_array_equal(high, [-5.0, -5.0])
    np.testing.assert_array_equal(low, [-5.0, -5.0])
    assert bounds.conflicts(model, q, v, accelerations=True).all()
    np.testing.assert_allclose(bounds.velocity_bounds(model, q, v)[1], [0.95, 1.15])
    assert bounds.conflicts(model, q, v).tolist() == [True, True]
    assert bounds.conflicts(model, [0.0, 0.0], [0.5, -0.5]).tolist() == [False, False]


def test_the_default_limits_are_the_robots():
    model = rm.load("panda")
    q = 0.5 * (model.lower + model.upper)
    low, high = JointBounds().velocity_bounds(model, np.tile(q, (2, 3, 1)))
    assert high.shape == (2, 3, 7)
    np.testing.assert_array_equal(high[1, 2], model.table.velocity)
    np.testing.assert_array_equal(low, -high)
    free = rm.load("planar_2r")
    low, high = JointBounds(step=0.1, acceleration=1.0).velocity_bounds(free, [9.0, -9.0])
    np.testing.assert_array_equal(high, [np.inf, np.inf])
    np.testing.assert_array_equal(low, [-np.inf, -np.inf])
    assert JointBounds().velocity_bounds(model, np.empty((0, 7)))[0].shape == (0, 7)


def test_wrong_limits_are_named():
    model = rm.load("panda")
    q = np.zeros(7)
    for call, error, words in (
        (lambda: JointBounds(velocity=-1.0), InvalidValueError, "velocity"),
        (lambda: JointBounds(velocity=np.nan), InvalidValueError, "velocity"),
        (lambda: JointBounds(upper=np.ones((2, 7))), ShapeError, "upper"),
        (lambda: JointBounds(acceleration=0.0), InvalidValueError, "acceleration"),
        (lambda: JointBounds(step=0.0), InvalidValueError, "step"),
        (lambda: JointBounds(step=np.inf), InvalidValueError, "step"),
        (lambda: JointBounds(velocity=[1.0, 2.0]).velocity_bounds(model, q), ShapeError, "(7,)"),
        (lambda: JointBounds(lower=2.0, upper=1.0).velocity_bounds(model, q),
         InvalidValueError, "lower <= upper"),
        (lambda: JointBounds().acceleration_bounds(model, q, q), InvalidValueError, "step"),
        (lambda: JointBounds().velocity_bounds(model, q, q), InvalidValueError, "acceleration"),
        (lambda: JointBounds(step=0.1).conflicts(model, q, accelerations=True),
         InvalidValueError, "v:"),
        (lambda: JointBounds().velocity_bounds(model, np.zeros(6)), ShapeError, "q"),
        (lambda: JointBounds(acceleration=1.0, step=0.1).velocity_bounds(
            model, np.zeros((2, 7)), np.zeros((3, 7))), ShapeError, "broadcast"),
    ):  # fmt: skip
        with pytest.raises(error) as caught:
            call()
        assert words in str(caught.value)
