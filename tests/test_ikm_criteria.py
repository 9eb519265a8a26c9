"""Criteria: gradients by differences, and what a seven-joint arm does with them."""

import numpy as np
import pytest
from hypothesis import given
from identities.random_robots import models, random_state, seeds

import robotmodels as rm
from robotmodels.errors import InvalidValueError, ShapeError
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


def gradient_by_differences(criterion, model, q, h=1e-3):
    """Of fourth order."""
    columns = []
    for e in h * np.eye(model.n):
        near = criterion.value(model, q + e) - criterion.value(model, q - e)
        far = criterion.value(model, q + 2 * e) - criterion.value(model, q - 2 * e)
        columns.append((8 * near - far) / (12 * h))
    return np.stack(columns, axis=-1)


def smooth_criteria(model, rng):
    """Criteria with whether large values are good, without kinks."""
    n, frame = model.n, int(rng.integers(1, model.f + 1))
    yield PostureCriterion(rng.normal(size=n), rng.uniform(0.0, 2.0, size=n), gain=0.7), -0.7
    yield JointLimitCriterion(gain=0.3), -0.3
    yield JointLimitCriterion(gain=2.0, lower=-1.0, upper=np.full(n, 3.0)), -2.0
    yield ManipulabilityCriterion(gain=2.0), 2.0
    yield ManipulabilityCriterion(0.5, frame, "local", [1, 1, 0, 0, 0, 1], length=0.4), 0.5


@given(model=models(), seed=seeds)
def test_gradients_are_those_of_the_values(model, seed):
    rng = np.random.default_rng(seed)
    q, _, _ = random_state(model, rng, 3)
    for criterion, sign in smooth_criteria(model, rng):
        assert isinstance(criterion, Criterion)
        g = criterion.gradient(model, q)
        d = sign * gradient_by_differences(criterion, model, q)
        if (
            isinstance(criterion, ManipulabilityCriterion)
            and (criterion.value(model, q) < 0.02).any()
        ):
            continue  # |w| bends at a singular position
        np.testing.assert_allclose(g, d, rtol=0, atol=1e-8 * (1 + np.abs(g).max()))


@pytest.mark.nightly
@given(model=models(), seed=seeds)
def test_gradients_of_criteria_that_set_in(model, seed):
    """Values with kinks in the second derivative, by small differences."""
    rng = np.random.default_rng(seed)
    q, _, _ = random_state(model, rng, 3)
    low = rng.normal(size=3)
    shapes = [Sphere(rng.normal(size=3), 0.1), Plane(low, rng.normal(size=3)), Box(low, low + 0.5)]
    frame = int(rng.integers(0, model.f + 1))
    for criterion, sign in (
        (NearLimitCriterion(0.9, gain=0.5), -0.5),
        (ObstacleCriterion(shapes, influence=2.0, gain=0.4, radius=0.02), -0.4),
        (ObstacleCriterion(shapes, 3.0, segments=[(frame, None), (frame, frame)]), -1.0),
    ):
        assert isinstance(criterion, Criterion)
        g = criterion.gradient(model, q)
        d = sign * gradient_by_differences(criterion, model, q, 1e-5)
        if (
            isinstance(criterion, ObstacleCriterion)
            and (criterion.clearance(model, q) < -0.09).any()
        ):
            continue  # beside the centre of a sphere its distance bends
        np.testing.assert_allclose(g, d, rtol=0, atol=1e-4 * (1 + np.abs(g).max()))


def test_values_by_hand():
    model = rm.load("planar_3r")
    q = np.array([0.5, 1.0, -1.0])
    limits = JointLimitCriterion(lower=[-1.0, -np.inf, 2.0], upper=[2.0, 5.0, 2.0])
    assert limits.value(model, q) == 0.0  # in the middle; half open; no range
    assert limits.value(model, [2.0, 9.0, 9.0]) == 0.25
    np.testing.assert_array_equal(limits.gradient(model, [2.0, 9.0, 9.0]), [-1 / 3, 0.0, 0.0])
    near = NearLimitCriterion(margin=0.25, lower=-4.0, upper=4.0)
    np.testing.assert_allclose(near.value(model, [3.0, 3.5, -4.0]), 0.125 + 0.5)
    np.testing.assert_allclose(near.gradient(model, [2.9, 3.5, -4.0]), [0.0, -0.5, 1.0])
    assert PostureCriterion([0.0, 0.0, 0.0], [1.0, 0.0, 2.0]).value(model, q) == 1.125


def test_manipulability_is_the_root_of_the_determinant(rng):
    model = rm.load("panda")
    q = rng.uniform(model.lower, model.upper, size=(600, 7))  # more than one chunk
    J = rm.jacobian(model, q)
    expected = np.sqrt(np.linalg.det(J @ J.swapaxes(1, 2)))
    criterion = ManipulabilityCriterion()
    np.testing.assert_allclose(criterion.value(model, q), expected, atol=1e-12)
    g = criterion.gradient(model, q)
    np.testing.assert_allclose(g[550], criterion.gradient(model, q[550]), atol=1e-13)
    # w = |sin q2| of two links of a metre; with all six rows the joints are fewer
    arm = rm.load("planar_2r")
    planar = ManipulabilityCriterion(mask=[1, 1, 0, 0, 0, 0])
    np.testing.assert_allclose(planar.value(arm, [0.4, 0.3]), np.sin(0.3), atol=1e-15)
    np.testing.assert_allclose(planar.gradient(arm, [0.4, 0.3]), [0.0, np.cos(0.3)], atol=1e-14)
    J = rm.jacobian(arm, [0.4, 0.3])
    np.testing.assert_allclose(
        ManipulabilityCriterion().value(arm, [0.4, 0.3]), np.sqrt(np.linalg.det(J.T @ J))
    )


def test_obstacle_values_by_hand():
    arm = rm.load("planar_2r")  # two links of a metre in the plane of x and y
    table, point = Plane([0.0, -0.1, 0.0], [0.0, 3.0, 0.0]), Sphere([2.3, 0.4, 0.0])
    both = ObstacleCriterion([table, point], influence=1.0)
    assert both.clearance(arm, [0.0, 0.0]) == pytest.approx(0.1)
    # the elbow and the tip at 0.1 from the plane, the tip at 0.5 from the point
    assert both.value(arm, [0.0, 0.0]) == pytest.approx(0.5 * (2 * 0.9**2 + 0.5**2))
    assert ObstacleCriterion(table).gradient(arm, [0.3, 0.1]).tolist() == [0.0, 0.0]
    still = ObstacleCriterion([point], segments=[(0, 1)])
    assert still.clearance(arm, np.zeros((4, 2))).tolist() == [np.inf] * 4
    assert still.value(arm, [0.0, 0.0]) == 0.0
    assert still.gradient(arm, np.zeros((4, 2))).shape == (4, 2)


# --- a seven-joint arm -------------------------------------------------------------------------


TRACKED = 4e-3
"""Error in m and rad along a line that is followed in steps of 20 ms, corrected at 5 / s."""


def follow(model, q, way, duration=4.0, count=200, criterion=None, bounds=None):
    """Postures along a straight line of the tool, its orientation kept; the largest error."""
    q, step = np.array(q), duration / count
    start = rm.dgm(model, q)
    path, errors = [q], []
    for k in range(count):
        now = rm.dgm(model, q)
        away = start[:3, 3] + way * (k / count) - now[:3, 3]
        R = start[:3, :3] @ now[:3, :3].T
        turn = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
        errors.append(max(np.abs(away).max(), np.abs(turn).max()))
        twist = np.r_[way / duration + 5.0 * away, 5.0 * turn]
        q = q + step * rm.ikm(model, q, twist, secondary=criterion, limits=bounds).v
        path.append(q)
    return np.array(path), max(errors)


LINES = [
    ([1.45, -0.74, -1.41, -0.72, 0.58, 2.38, 0.22], [0.2, 0.19, -0.53]),
    ([1.54, -0.82, 0.94, -2.44, -0.92, 2.71, -0.52], [-0.04, 0.18, -0.57]),
    ([1.49, -0.37, -0.63, -2.42, 0.7, 0.98, -1.57], [-0.11, -0.2, -0.56]),
]


@pytest.mark.parametrize("line", range(len(LINES)))
def test_an_arm_stays_inside_its_limits_along_a_line(line):
    """The least motion leaves the ranges; the null space, or bounds, keep it inside."""
    model = rm.load("panda")
    q, way = (np.array(x) for x in LINES[line])

    def margin(path):
        return np.minimum(path - model.lower, model.upper - path).min()

    plain, error = follow(model, q, way)
    assert margin(plain) < -0.04
    assert error < TRACKED
    for criterion in (JointLimitCriterion(gain=10.0), NearLimitCriterion(0.5, gain=5.0)):
        better, error = follow(model, q, way, criterion=criterion)
        assert margin(better) > 0.04
        assert error < TRACKED
        np.testing.assert_allclose(
            rm.dgm(model, better[-1])[:3], rm.dgm(model, plain[-1])[:3], atol=2 * TRACKED
        )
    held, error = follow(model, q, way, bounds=JointBounds(step=4.0 / 200))
    assert margin(held) >= -1e-12
    assert margin(held) < 1e-6  # it goes to the limit and along it
    assert error < TRACKED


def test_wrong_criteria_are_named():
    model = rm.load("panda")
    q, ball = np.zeros(7), Sphere([0, 0, 0], 0.1)
    for call, error, words in (
        (lambda: PostureCriterion(np.zeros((2, 7))), ShapeError, "q_ref"),
        (lambda: PostureCriterion(q, -np.ones(7)), InvalidValueError, "weights"),
        (lambda: PostureCriterion(q, gain=0.0), InvalidValueError, "gain"),
        (lambda: PostureCriterion(np.zeros(6)).value(model, q), ShapeError, "q_ref"),
        (lambda: JointLimitCriterion(gain=-1.0), InvalidValueError, "gain"),
        (lambda: JointLimitCriterion(lower=np.nan), InvalidValueError, "NaN"),
        (lambda: JointLimitCriterion(upper=np.ones(6)).value(model, q), ShapeError, "(7,)"),
        (lambda: JointLimitCriterion(lower=1.0, upper=0.0).value(model, q),
         InvalidValueError, "lower <= upper"),
        (lambda: NearLimitCriterion(margin=1.5), InvalidValueError, "margin"),
        (lambda: NearLimitCriterion(margin=0.0), InvalidValueError, "margin"),
        (lambda: ManipulabilityCriterion(mask=[0] * 6), InvalidValueError, "mask"),
        (lambda: ManipulabilityCriterion(reference="base"), InvalidValueError, "reference"),
        (lambda: ManipulabilityCriterion(length=0.0), InvalidValueError, "length"),
        (lambda: ManipulabilityCriterion(frame="x").value(model, q), KeyError, "'x'"),
        (lambda: ObstacleCriterion([]), InvalidValueError, "at least one"),
        (lambda: ObstacleCriterion([(0, 0, 0)]), InvalidValueError, "expected Sphere"),
        (lambda: ObstacleCriterion([ball], influence=0.0), InvalidValueError, "influence"),
        (lambda: ObstacleCriterion([ball], radius=-1.0), InvalidValueError, "radius"),
        (lambda: ObstacleCriterion([ball], segments=[3]), InvalidValueError, "pairs"),
        (lambda: ObstacleCriterion([ball], segments=[(0, 99)]).value(model, q), KeyError, "99"),
        (lambda: JointLimitCriterion().value(model, np.zeros(6)), ShapeError, "q"),
        (lambda: JointLimitCriterion().value("panda", q), InvalidValueError, "load"),
    ):  # fmt: skip
        with pytest.raises(error) as caught:
            call()
        assert words in str(caught.value)
