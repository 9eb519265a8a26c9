"""Clearance: by brute force on random robots, gradients by differences, and what does not count."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from identities.random_robots import models, random_state, seeds

import robotmodels as rm
from robotmodels.errors import FrameNotFoundError, InvalidValueError, ShapeError
from robotmodels.obstacles import Box, Capsule, Plane, Sphere, clearance
from robotmodels.obstacles.clearance import link_distances, origins


def bodies_of(rng):
    """A body of each kind, with its signed distance of points (M, 3) written out."""
    c, d, low = rng.normal(size=(3, 3))
    high, n = low + rng.uniform(0.2, 2.0, 3), rng.normal(size=3) / 3.0
    n /= np.linalg.norm(n)
    axis = np.linspace(c, d, 2001)

    def box(p):
        depth = np.maximum(low - p, p - high).max(axis=1)
        return np.where(depth > 0, np.linalg.norm(p - np.clip(p, low, high), axis=1), depth)

    yield Sphere(c, 0.3), lambda p: np.linalg.norm(p - c, axis=1) - 0.3
    yield Plane(0.2 * n, 3.0 * n), lambda p: p @ n - 0.2
    yield Capsule(c, d, 0.2), lambda p: np.linalg.norm(p[:, None] - axis, axis=2).min(axis=1) - 0.2
    yield Box(low, high), box


@pytest.mark.parametrize("seed", range(6))
def test_distances_of_segments_are_those_of_their_nearest_points(seed):
    rng = np.random.default_rng(seed)
    start, end = rng.normal(size=(2, 3))
    if seed % 3 == 0:
        end[: 1 + seed] = start[: 1 + seed]  # in a plane of the axes, or a point
    line = start + np.linspace(0, 1, 501)[:, None] * (end - start)
    for body, of_points in bodies_of(rng):
        distance, where, away = body.nearest(start, end)
        least = of_points(line).min()
        assert least - 4e-3 <= distance <= least + 1e-6
        nearest = start + where * (end - start)
        assert of_points(nearest[None])[0] == pytest.approx(distance, abs=1e-6)
        if distance > 0.0:
            assert np.linalg.norm(away) == pytest.approx(1.0)
            beside = of_points((nearest + 1e-5 * away)[None])[0]
            assert beside == pytest.approx(distance + 1e-5, abs=2e-6)


def test_parallel_capsules_and_boxes_with_depths_and_open_sides():
    post = Capsule([1.0, 0, 0], [1.0, 0, 3.0], 0.2)
    assert post.nearest(np.array([0, 0, 1.0]), np.array([0, 0, 2.0]))[0] == pytest.approx(0.8)
    box = Box([-1, -1, -1], [1, 1, 1])
    depth = box.nearest(np.array([-5.0, 0, 0]), np.array([5.0, 0.5, 0]))[0]
    assert depth == pytest.approx(0.25 / 1.05 - 1)
    assert box.nearest(np.array([3.0, 0, 0]), np.array([0.0, 3.0, 0]))[0] == pytest.approx(0.5**0.5)
    floor = Box([-np.inf] * 3, [np.inf, np.inf, 0.2])
    distance, t, away = floor.nearest(np.array([0.0, 0, 1]), np.array([9.0, 0, 0.5]))
    assert (distance, t, away.tolist()) == (pytest.approx(0.3), 1.0, [0.0, 0.0, 1.0])
    assert floor.nearest(np.zeros((2, 3)), np.zeros((2, 3)))[0].tolist() == [-0.2, -0.2]


@given(model=models(), seed=seeds)
def test_origins_and_their_jacobians_are_those_of_the_kinematic_models(model, seed):
    q, _, _ = random_state(model, np.random.default_rng(seed), 2)
    frames = [0, *range(1, model.f + 1), None]
    P, J = origins(model, q, frames)
    for k, frame in enumerate(frames):
        np.testing.assert_allclose(P[:, k], rm.dgm(model, q, frame)[:, :3, 3], atol=1e-12)
        np.testing.assert_allclose(J[:, k], rm.jacobian(model, q, frame)[:, :3], atol=1e-12)


@given(model=models(), seed=seeds)
def test_gradients_are_those_of_the_distances(model, seed):
    """At random configurations, but where another point becomes the nearest."""
    rng = np.random.default_rng(seed)
    q, _, _ = random_state(model, rng, 3)
    bodies, d = [body for body, _ in bodies_of(rng)], rng.normal(size=model.n)
    (distance, slope), (a, _), (b, _), (c, _), (e, _) = (
        link_distances(model, q + h * d, bodies, self_collision=True)
        for h in (0.0, 1e-6, -1e-6, 1e-5, -1e-5)
    )
    close, far = (a - b) / 2e-6, (c - e) / 2e-5
    smooth = (np.abs(close - far) < 1e-5 * (1.0 + np.abs(far))) & (np.abs(distance) > 1e-6)
    np.testing.assert_allclose((slope @ d)[smooth], far[smooth], atol=1e-4)
    assert (~smooth).sum() <= 4 + 0.3 * smooth.size


def rods(model, q):
    """Points of every link, shape (S, K, 3)."""
    points = np.stack([rm.dgm(model, q, k)[:3, 3] for k in (*range(model.f + 1), None)])
    first = [*model.table.antecedent, model.tip]
    t = np.linspace(0, 1, 401)[:, None, None]
    return (points[first] + t * (points[1:] - points[first])).swapaxes(0, 1)


@pytest.mark.parametrize("name", ["rx90", "stanford_arm"])
@pytest.mark.nightly
def test_clearance_of_robots_by_brute_force(name):
    arm = rm.load(name).with_tool(rm.se3.translation(0.05, 0, 0.3))
    rng, bent = np.random.default_rng(7), []
    for q in rng.uniform(-3, 3, (7, arm.n)):
        points = rods(arm, q)
        long = [rod for rod in points if np.ptp(rod, axis=0).max() > 1e-9]
        gaps = [
            np.linalg.norm(long[i][:, None] - long[j], axis=2).min()
            for j in range(len(long))
            for i in range(j - 1)  # neighbours share a joint
        ]
        bent.append(clearance(arm, q, [], 0.03, self_collision=True))
        assert bent[-1] == pytest.approx(min(gaps) - 0.06, abs=6e-3)
        moving = np.ptp(rods(arm, q + 0.3) - points, axis=(1, 2)) > 1e-9
        for body, of_points in bodies_of(rng):
            ends = of_points(points[:, [0, -1]].reshape(-1, 3))
            if isinstance(body, Plane) or ends.min() < 0.06:
                continue  # an end that is fixed in the body does not count
            least = min(of_points(rod).min() for rod in points[moving])
            assert clearance(arm, q, body, 0.05) == pytest.approx(least - 0.05, abs=6e-3)
    assert min(bent) < 0.0 < max(bent)
    assert clearance(rm.load("planar_2r"), [0.0, 3.1], [], self_collision=True) == np.inf


def test_what_no_joint_moves_does_not_count():
    arm = rm.load("planar_2r")  # two links of a metre in the plane of x and y
    table = Plane([0.0, -0.1, 0.0], [0.0, 3.0, 0.0])
    assert clearance(arm, [np.pi / 2, 0.0], table) == pytest.approx(1.1)
    assert clearance(arm, [-np.pi / 2, 0.0], table) == pytest.approx(-1.9)
    # a pedestal under the base: touched by the fixed end, which is ignored
    pedestal, beside = Capsule([0, 0, -1], [0, 0, 0], 0.2), Sphere([-0.3, 0.0, 0.0], 0.2)
    assert clearance(arm, [0.0, 0.0], pedestal) == pytest.approx(0.8)
    assert clearance(arm, [0.0, np.pi], pedestal) == pytest.approx(-0.2)
    assert clearance(arm, [0.0, 0.0], beside) == pytest.approx(0.1)
    assert clearance(arm, np.zeros((4, 2)), beside, segments=[(0, 1)]).tolist() == [np.inf] * 4
    assert clearance(arm, [0.0, 0.0], beside, segments=[(None, None)]) == pytest.approx(2.1)


def test_mistakes_are_named_and_values_stay_read_only():
    arm, q = rm.load("rx90"), np.zeros(6)
    for call, error, words in (
        (lambda: Sphere([0, 0], 0.1), ShapeError, "center"),
        (lambda: Sphere([0, 0, 0], -0.1), InvalidValueError, "radius"),
        (lambda: Plane([0, 0, 0], [0, 0, 0]), InvalidValueError, "normal"),
        (lambda: Box([0, 0, 0], [1, -1, 1]), InvalidValueError, "lower below upper"),
        (lambda: Box([-np.inf] * 3, [np.inf] * 3), InvalidValueError, "finite"),
        (lambda: clearance(arm, q, ["floor"]), InvalidValueError, r"obstacles\[0\]"),
        (lambda: clearance(arm, q, [], [0.1, 0.1]), ShapeError, "radius"),
        (lambda: clearance(arm, q, [], segments=[3]), InvalidValueError, "pairs"),
        (lambda: clearance(arm, q, [], segments=[(0, 99)]), FrameNotFoundError, "99"),
        (lambda: clearance(arm, np.zeros(5), []), ShapeError, "q"),
    ):
        with pytest.raises(error, match=words):
            call()
    for body, _ in bodies_of(np.random.default_rng(0)):
        again = pickle.loads(pickle.dumps(body))
        for name in body.__dataclass_fields__:
            np.testing.assert_allclose(getattr(again, name), getattr(body, name), rtol=1e-15)
            assert name == "radius" or not getattr(again, name).flags.writeable
