"""Bounds of velocities and accelerations: joints that can stop before their limits."""

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.kinematics import JointBounds


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
