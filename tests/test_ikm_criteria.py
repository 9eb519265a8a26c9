"""What `ikm` takes beside tasks: criteria of the free motion, and bounds of the joints."""

import numpy as np
import pytest
from hypothesis import given
from identities.random_robots import models, random_state, seeds

import robotmodels as rm
from robotmodels.kinematics import (
    Criterion,
    JointBounds,
    JointLimitCriterion,
    ManipulabilityCriterion,
    NearLimitCriterion,
    ObstacleCriterion,
    PostureCriterion,
)
from robotmodels.obstacles import Box, Plane, Sphere

# --- criteria ----------------------------------------------------------------------------------


def gradient_by_differences(criterion, model, q, h):
    """Of fourth order."""
    columns = []
    for e in h * np.eye(model.n):
        near = criterion.value(model, q + e) - criterion.value(model, q - e)
        far = criterion.value(model, q + 2 * e) - criterion.value(model, q - 2 * e)
        columns.append((8 * near - far) / (12 * h))
    return np.stack(columns, axis=-1)


def smooth_criteria(model, rng):
    """Criteria and their gains, negative where small values are good."""
    n, frame = model.n, int(rng.integers(1, model.f + 1))
    yield PostureCriterion(rng.normal(size=n), rng.uniform(0.0, 2.0, size=n), gain=0.7), -0.7
    yield JointLimitCriterion(gain=0.3), -0.3
    yield JointLimitCriterion(gain=2.0, lower=-1.0, upper=np.full(n, 3.0)), -2.0
    yield ManipulabilityCriterion(gain=2.0), 2.0
    yield ManipulabilityCriterion(0.5, frame, "local", [1, 1, 0, 0, 0, 1], length=0.4), 0.5


def criteria_with_a_margin(model, rng):
    """Criteria whose second derivatives have steps."""
    low = rng.normal(size=3)
    shapes = [Sphere(rng.normal(size=3), 0.1), Plane(low, rng.normal(size=3)), Box(low, low + 0.5)]
    frame = int(rng.integers(0, model.f + 1))
    yield NearLimitCriterion(0.9, gain=0.5), -0.5
    yield ObstacleCriterion(shapes, influence=2.0, gain=0.4, radius=0.02), -0.4
    yield ObstacleCriterion(shapes, 3.0, segments=[(frame, None), (frame, frame)]), -1.0


@pytest.mark.parametrize(
    ("criteria", "step", "tolerance"),
    [
        (smooth_criteria, 1e-3, 1e-8),
        pytest.param(criteria_with_a_margin, 1e-5, 1e-4, marks=pytest.mark.nightly),
    ],
)
@given(model=models(), seed=seeds)
def test_gradients_are_those_of_the_values(criteria, step, tolerance, model, seed):
    rng = np.random.default_rng(seed)
    q, _, _ = random_state(model, rng, 3)
    for criterion, gain in criteria(model, rng):
        assert isinstance(criterion, Criterion)
        # |w| bends at a singular position, a distance beside the centre of a sphere
        value = getattr(criterion, "clearance", criterion.value)(model, q)
        least = {ManipulabilityCriterion: 0.02, ObstacleCriterion: -0.09}.get(type(criterion), 0.0)
        if (value < least).any():
            continue
        g = criterion.gradient(model, q)
        d = gain * gradient_by_differences(criterion, model, q, step)
        np.testing.assert_allclose(g, d, rtol=0, atol=tolerance * (1 + np.abs(g).max()))


def test_values_by_hand():
    model = rm.load("planar_3r")
    q = np.array([0.5, 1.0, -1.0])
    limits = JointLimitCriterion(lower=[-1.0, -np.inf, 2.0], upper=[2.0, 5.0, 2.0])
    assert limits.value(model, q) == 0.0  # in the middle; half open; no range
    assert limits.value(model, [2.0, 9.0, 9.0]) == 0.25
    np.testing.assert_array_equal(limits.gradient(model, [2.0, 9.0, 9.0]), [-1 / 3, 0.0, 0.0])
    near = NearLimitCriterion(margin=0.25, lower=-4.0, upper=4.0)
    np.testing.assert_allclose(near.value(model, [3.0, 3.5, -4.0]), 0.125 + 0.5)
    assert PostureCriterion([0.0, 0.0, 0.0], [1.0, 0.0, 2.0]).value(model, q) == 1.125
    arm = rm.load("planar_2r")  # two links of a metre in the plane of x and y
    table, point = Plane([0.0, -0.1, 0.0], [0.0, 3.0, 0.0]), Sphere([2.3, 0.4, 0.0])
    both = ObstacleCriterion([table, point], influence=1.0)
    assert both.clearance(arm, [0.0, 0.0]) == pytest.approx(0.1)
    # the elbow and the tip at 0.1 from the plane, the tip at 0.5 from the point
    assert both.value(arm, [0.0, 0.0]) == pytest.approx(0.5 * (2 * 0.9**2 + 0.5**2))
    still = ObstacleCriterion([point], segments=[(0, 1)])
    assert still.clearance(arm, np.zeros((4, 2))).tolist() == [np.inf] * 4
    assert still.gradient(arm, np.zeros((4, 2))).tolist() == [[0.0, 0.0]] * 4


def test_manipulability_is_the_root_of_the_determinant(rng):
    model = rm.load("panda")
    q = rng.uniform(model.lower, model.upper, size=(600, 7))  # more than one chunk
    J = rm.jacobian(model, q)
    expected = np.sqrt(np.linalg.det(J @ J.swapaxes(1, 2)))
    criterion = ManipulabilityCriterion()
    np.testing.assert_allclose(criterion.value(model, q), expected, atol=1e-12)
    g = criterion.gradient(model, q)
    np.testing.assert_allclose(g[550], criterion.gradient(model, q[550]), atol=1e-13)
    # fewer joints than rows
    arm = rm.load("planar_2r")
    J = rm.jacobian(arm, [0.4, 0.3])
    np.testing.assert_allclose(criterion.value(arm, [0.4, 0.3]), np.sqrt(np.linalg.det(J.T @ J)))
    # w = |sin q2| of two links of a metre, with its slope where it is zero too
    planar = ManipulabilityCriterion(mask=[1, 1, 0, 0, 0, 0])
    np.testing.assert_allclose(abs(planar.gradient(arm, [0.4, 0.0])), [0.0, 1.0], atol=1e-14)


# --- bounds ------------------------------------------------------------------------------------


def test_velocity_bounds_by_hand():
    model = rm.load("planar_2r")
    bounds = JointBounds(velocity=[1.0, 2.0], lower=-1.0, upper=[1.0, np.inf], step=0.5)
    low, high = bounds.velocity_bounds(model, [[0.0, 0.0], [0.75, -0.75], [1.1, -1.5], [9, -9]])
    # far outside the return is as fast as the joint may be
    np.testing.assert_allclose(high, [[1.0, 2.0], [0.5, 2.0], [-0.2, 2.0], [-1, 2]], atol=1e-15)
    np.testing.assert_allclose(low, [[-1.0, -2.0], [-1.0, -0.5], [-1.0, 1.0], [-1, 2]], atol=1e-15)
    assert bounds.outside(model, [1.1, -1.5]).tolist() == [True, True]
    assert bounds.conflicts(model, [9.0, -9.0]).all()


LOWER, UPPER = np.array([-1.0, -1.0, 0.0]), np.array([1.0, 0.5, 0.01])
SPEED = [1.5, 0.3, np.inf]


def random_command(rng, low, high):
    """Mostly at a bound, else anything between."""
    kind = rng.random(low.shape)
    return np.where(kind < 0.5, high, np.where(kind < 0.7, low, low + rng.random() * (high - low)))


@pytest.mark.sampled(3)
@pytest.mark.parametrize("step", [0.002, 0.05, 0.7])
@pytest.mark.parametrize("acceleration", [None, 1.0, [0.5, 3.0, 100.0]], ids=str)
def test_joints_always_stop_in_time(step, acceleration):
    """Whatever is commanded within the bounds, positions, speeds and accelerations are kept."""
    model, rng = rm.load("planar_3r"), np.random.default_rng(1)
    bounds = JointBounds(SPEED, LOWER, UPPER, acceleration, step)
    q = rng.uniform(LOWER, UPPER, size=(60, 3))
    v = np.zeros_like(q)
    for _ in range(120):
        low, high = bounds.acceleration_bounds(model, q, v)
        assert (low <= high).all()
        assert not bounds.conflicts(model, q, v, accelerations=True).any()
        a = random_command(rng, low, high)
        for t in np.linspace(0.0, step, 7):  # between the samples, too
            there = q + v * t + 0.5 * a * t * t
            assert ((there >= LOWER - 1e-12) & (there <= UPPER + 1e-12)).all()
        q, v = q + v * step + 0.5 * a * step**2, v + a * step
        assert (np.abs(v) <= np.array(SPEED) + 1e-12).all()
        assert acceleration is None or (np.abs(a) <= np.array(acceleration) + 1e-12).all()
    # and they are not held back more than that: each limit is reached
    q, v = q[:2], v[:2]
    for _ in range(int(60 / step) if step > 0.01 else 4000):
        a = np.minimum(bounds.acceleration_bounds(model, q, v)[1], 1e6)
        q, v = q + v * step + 0.5 * a * step**2, v + a * step
    np.testing.assert_allclose(q, np.broadcast_to(UPPER, q.shape), atol=1e-6)


@pytest.mark.parametrize("step", [0.002, 0.05, 0.7])
def test_commanded_velocities_change_no_faster_than_they_can(step):
    model, rng = rm.load("planar_3r"), np.random.default_rng(2)
    A = np.array([0.5, 3.0, 100.0])
    bounds = JointBounds(SPEED, LOWER, UPPER, A, step)
    q = rng.uniform(LOWER, UPPER, size=(100, 3))
    v = np.zeros_like(q)
    for _ in range(300):
        low, high = bounds.velocity_bounds(model, q, v)
        assert not bounds.conflicts(model, q, v).any()
        command = random_command(rng, low, high)
        assert (np.abs(command - v) <= A * step * (1 + 1e-12)).all()
        q, v = q + command * step, command
        assert ((q >= LOWER - 1e-12) & (q <= UPPER + 1e-12)).all()


def test_limits_that_exclude_each_other_are_conflicts():
    model = rm.load("planar_2r")
    bounds = JointBounds(1.0, -1.0, 1.0, acceleration=5.0, step=0.01)
    q, v = [0.99, 0.0], [1.0, 1.2]
    # the first joint brakes as it can; the second, too fast, as well
    np.testing.assert_array_equal(bounds.acceleration_bounds(model, q, v), [[-5.0, -5.0]] * 2)
    assert bounds.conflicts(model, q, v, accelerations=True).all()
    np.testing.assert_allclose(bounds.velocity_bounds(model, q, v)[1], [0.95, 1.15])
    assert bounds.conflicts(model, q, v).tolist() == [True, True]
    assert bounds.conflicts(model, [0.0, 0.0], [0.5, -0.5]).tolist() == [False, False]
