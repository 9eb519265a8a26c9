"""Interaction matrices against exact projection, closed forms of the literature, refused input."""

import pickle
from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from robotmodels import visual_servoing as vs
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.se3 import inverse, rotation, translation

SQUARE = np.array([[-0.1, -0.1, 0.0], [0.1, -0.1, 0.0], [0.1, 0.1, 0.0], [-0.1, 0.1, 0.0]])
PLATE = [[-0.2, -0.15, 0], [0.25, -0.1, 0], [0.2, 0.18, 0], [-0.1, 0.2, 0], [-0.3, 0.05, 0]]


def pose(rng, tilt=0.9):
    """A random pose with the object well in front of the camera."""
    T = np.eye(4)
    turn = Rotation.from_rotvec([0.0, 0.0, rng.uniform(-3.0, 3.0)])
    T[:3, :3] = (turn * Rotation.from_rotvec(0.5 * tilt * rng.normal(size=3))).as_matrix()
    T[:3, 3] = [*rng.uniform(-0.3, 0.3, 2), rng.uniform(1.5, 2.5)]
    return T


def hat(twist):
    v, w = twist[:3], twist[3:]
    return np.array(
        [[0, -w[2], w[1], v[0]], [w[2], 0, -w[0], v[1]], [-w[1], w[0], 0, v[2]], [0, 0, 0, 0]]
    )


def seen_after(T, twist):
    """Pose of the object after a motion of the camera in its own axes: matrix exponential."""
    return expm(-hat(np.asarray(twist))) @ T


def differences(feature, T, h=1e-5):
    period, columns = feature._periods(), []
    for direction in h * np.eye(6):
        ds = feature.measure(seen_after(T, direction)) - feature.measure(seen_after(T, -direction))
        columns.append(ds - period * np.round(ds / np.where(period > 0.0, period, 1.0)))
    return np.array(columns).T / (2.0 * h)


def features():
    rng = np.random.default_rng(7)
    pairs = rng.uniform(-0.3, 0.3, (3, 2, 3))
    return {
        "points": vs.Points(rng.uniform(-0.3, 0.3, (4, 3))),
        "lines": vs.Lines(pairs),
        "segments": vs.Segments(pairs),
        "circle": vs.Circle([0.1, 0.0, 0.1], [0.1, 0.2, 1.0], 0.2),
        "sphere": vs.Sphere([0.1, 0.1, 0.0], 0.2),
        "cylinder": vs.Cylinder([0.1, 0.1, 0.0], [1.0, 0.3, 0.2], 0.1),
        "moments of a polygon": vs.Moments(PLATE),
        "moments of points": vs.Moments(points=rng.uniform(-0.3, 0.3, (6, 3))),
        "pose": vs.PoseError(),
        "pose to another": vs.PoseError(pose(rng)),
        "point in space": vs.Point3D([0.1, 0.2, 0.3]),
        "plane in space": vs.Plane3D([0.1, 0.2, 1.0], 0.3),
        "2 1/2-D": vs.PointAndRotation([0.1, 0.2, 0.0], pose(rng)),
    }


FEATURES = features()
every = pytest.mark.parametrize("feature", FEATURES.values(), ids=FEATURES.keys())


# --- interaction matrices ------------------------------------------------------------------------


@every
def test_interaction_is_the_derivative_of_the_measurement(feature):
    rng = np.random.default_rng(1)
    poses = [pose(rng, tilt) for tilt in (0.0, 0.9) for _ in range(12)]
    L = feature.interaction(poses)
    assert L.shape == (24, feature.size, 6)
    for T, matrix in zip(poses, L, strict=True):
        assert abs(matrix - differences(feature, T)).max() < 1e-7 * max(1.0, abs(matrix).max())
    # features are values and take batches
    again = pickle.loads(pickle.dumps(feature))
    assert (again, hash(again)) == (feature, hash(feature))
    assert len(repr(feature).splitlines()) <= 6
    shaped = np.reshape(poses, (4, 6, 4, 4))
    assert np.allclose(feature.interaction(shaped.tolist()), L.reshape(4, 6, -1, 6))
    assert np.allclose(feature.measure(shaped)[1, 2], feature.measure(poses[8]), rtol=0, atol=1e-12)
    assert feature.measure(shaped[:0]).shape == (0, 6, feature.size)


def test_measurements_are_projections():
    rng = np.random.default_rng(3)
    for _ in range(20):
        T = pose(rng)
        rho, theta = vs.Lines([[[0.1, 0.2, 0.0], [0.3, -0.1, 0.2]]]).measure(T)
        X = np.linspace([0.1, 0.2, 0.0], [0.3, -0.1, 0.2], 5) @ T[:3, :3].T + T[:3, 3]
        x, y = X[:, 0] / X[:, 2], X[:, 1] / X[:, 2]
        assert abs(x * np.cos(theta) + y * np.sin(theta) - rho).max() < 1e-12

        # points of a circle and of a sphere's outline are on their ellipses
        t = np.linspace(0.0, 6.0, 9)[:, None]
        circle = 0.2 * (np.cos(t) * [1, 0, 0] + np.sin(t) * [0, 1, 0]) @ T[:3, :3].T + T[:3, 3]
        on_ellipse(circle, vs.Circle([0, 0, 0], [0, 0, 1], 0.2).measure(T))
        c = T[:3, 3]
        d, ray = np.linalg.norm(c), c / np.linalg.norm(c)
        side = np.cross(ray, [1.0, 0.0, 0.0])
        side /= np.linalg.norm(side)
        rim = 0.2 * np.sqrt(1.0 - (0.2 / d) ** 2)
        outline = (1.0 - (0.2 / d) ** 2) * c + rim * (
            np.cos(t) * side + np.sin(t) * np.cross(ray, side)
        )
        on_ellipse(outline, vs.Sphere([0, 0, 0], 0.2).measure(T))

        # every line of a cylinder's outline touches it
        axis = T[:3, 0]
        s = vs.Cylinder([0, 0, 0], [1, 0, 0], 0.1).measure(T)
        for rho, theta in s.reshape(2, 2):
            n = np.array([np.cos(theta), np.sin(theta), -rho])
            n /= np.linalg.norm(n)
            assert abs(n @ axis) < 1e-12
            assert abs(n @ c) == pytest.approx(0.1, abs=1e-12)


def on_ellipse(X, s):
    d = X[:, :2] / X[:, 2:] - s[:2]
    M = np.linalg.inv([[s[2], s[4]], [s[4], s[3]]])
    assert abs(np.einsum("ki,ij,kj->k", d, M, d) - 4.0).max() < 1e-9


def test_moments_are_those_of_many_small_cells():
    T = pose(np.random.default_rng(4))
    image = np.array(PLATE, float) @ T[:3, :3].T + T[:3, 3]
    image = image[:, :2] / image[:, 2:]
    k = (np.arange(200) + 0.5) / 200  # a fan of triangles, each divided finely
    u, v = (a.ravel() for a in np.meshgrid(k, k))
    v, weight, cells = v * (1.0 - u), 1.0 - u, []
    for b, c in pairwise(image[1:]):
        a = image[0]
        area = abs(np.linalg.det([b - a, c - a])) * weight / 40000
        cells.append((area, *(a[:, None] + np.outer(b - a, u) + np.outer(c - a, v))))
    w, x, y = np.concatenate(cells, axis=1)
    area, dx, dy = w.sum(), x - (w @ x) / w.sum(), y - (w @ y) / w.sum()
    mu20, mu02, mu11 = w @ dx**2, w @ dy**2, w @ (dx * dy)
    skew = np.sqrt(area) / (mu20 + mu02) ** 1.5
    expected = {
        "area": area, "x": (w @ x) / area, "y": (w @ y) / area,
        "n20": mu20 / area, "n02": mu02 / area, "n11": mu11 / area,
        "alpha": 0.5 * np.arctan2(2 * mu11, mu20 - mu02),
        "c_x": skew * (w @ (dx**3 + dx * dy**2)), "c_y": skew * (w @ (dy**3 + dy * dx**2)),
    }  # fmt: skip
    moments = vs.Moments(PLATE, components=tuple(expected))
    assert moments.measure(T) == pytest.approx(list(expected.values()), abs=1e-4)
    for corners in ([*PLATE, PLATE[0]], PLATE[::-1]):  # closed, and in the other sense
        same = vs.Moments(corners, components=moments.components).measure(T)
        assert same == pytest.approx(moments.measure(T))


def test_moments_of_a_parallel_plane_have_the_published_rows():
    """F. Chaumette 2004, with the depth Z: area and centre of gravity; an, xn, yn decouple."""
    T = translation(0.1, -0.2, 2.0) @ rotation("z", 0.4)
    words = ("area", "x", "y", "n20", "n02", "n11")
    moments = vs.Moments(PLATE, components=words)
    a, x, y, n20, n02, n11 = moments.measure(T)
    Z = 2.0
    rows = [
        [0, 0, 2 * a / Z, 3 * a * y, -3 * a * x, 0],
        [-1 / Z, 0, x / Z, x * y + 4 * n11, -(1 + x * x + 4 * n20), y],
        [0, -1 / Z, y / Z, 1 + y * y + 4 * n02, -x * y - 4 * n11, -x],
    ]
    assert abs(moments.interaction(T)[:3] - rows).max() < 1e-12
    normed = vs.Moments(PLATE, components=("xn", "yn", "an"))
    L = normed.interaction(T)
    assert abs(L[:, :3] + np.eye(3)).max() < 1e-12
    assert normed.measure(T)[2] == pytest.approx(Z)


def test_a_sphere_of_known_depth_has_its_exact_matrix():
    sphere = vs.Sphere([0.1, 0.1, 0.0], 0.2)
    for T in (pose(np.random.default_rng(k)) for k in range(5)):
        Z = (T[:3, :3] @ sphere.centre + T[:3, 3])[2]
        law = vs.Task(sphere, translation(0, 0, 1), depth=float(Z))
        exact = vs.camera_velocity(vs.Task(sphere, translation(0, 0, 1)), T)
        assert vs.camera_velocity(law, sphere.measure(T)).v == pytest.approx(exact.v, abs=1e-9)


def test_bare_matrices_are_those_of_the_features():
    T = pose(np.random.default_rng(6))
    assert vs.interaction_point([0.1, 0.2], 0.0, 1.0).shape == (2, 2, 6)
    # any plane through a line gives the same matrix
    ends = np.array([[0.1, 0.2, 0.0], [0.3, -0.1, 0.2]])
    P, Q = ends @ T[:3, :3].T + T[:3, 3]
    line = vs.Lines([ends])
    for direction in ([1.0, 0.2, 0.1], [0.0, 1.0, -0.5]):
        n = np.cross(Q - P, direction)
        L = vs.interaction_line(*line.measure(T), [*n, -n @ P])
        assert np.allclose(L, line.interaction(T))
    m = np.zeros((3, 3))
    m[0, 0], m[1, 0], m[0, 1] = 0.5, 0.1, 0.2
    row = vs.interaction_moment(m, 0, 0, [0, 0, 1, -2.0])
    assert row.tolist() == [[0, 0, 0.5, 3 * 0.2, -3 * 0.1, 0]]


def test_rotation_vector():
    rng = np.random.default_rng(8)
    for size in (0.0, 1e-9, 1e-4, 0.02, 0.1, 1.0, 3.0, np.pi):
        u = rng.normal(size=3)
        tu = size * u / np.linalg.norm(u)
        L = vs.interaction_theta_u(tu)
        assert abs(L[:, :3]).max() == 0.0
        assert L[:, 3:] @ tu == pytest.approx(tu, abs=1e-12)  # L theta-u = theta-u
        R = Rotation.from_rotvec(tu).as_matrix()
        if 0.0 < size < 3.1:
            for k in range(3):
                turn = [Rotation.from_rotvec(s * 1e-5 * np.eye(3)[k]).as_matrix() for s in (1, -1)]
                plus, minus = (Rotation.from_matrix(R @ M).as_rotvec() for M in turn)
                assert L[:, 3 + k] == pytest.approx((plus - minus) / 2e-5, abs=1e-6)


def test_learnt_matrices():
    rng = np.random.default_rng(9)
    square, T = vs.Points(SQUARE), pose(rng)
    dX = 1e-5 * rng.normal(size=(20, 6))
    dS = [square.measure(seen_after(T, x)) - square.measure(T) for x in dX]
    L = vs.estimate_interaction(dS, dX)
    assert abs(L - square.interaction(T)).max() < 1e-3
    with pytest.raises(InvalidValueError, match="spans 5 of 6"):
        vs.estimate_interaction(np.zeros((9, 2)), np.c_[rng.normal(size=(9, 5)), np.zeros(9)])
    # Broyden: the secant holds, directions across the motion stay
    A, ds, dx = rng.normal(size=(8, 6)), rng.normal(size=8), rng.normal(size=6)
    B = vs.broyden(A, ds, dx)
    assert pytest.approx(ds) == B @ dx
    across = rng.normal(size=6)
    across -= across @ dx / (dx @ dx) * dx
    assert pytest.approx(A @ across) == B @ across
    assert (vs.broyden(A, ds, np.zeros(6)) == A).all()


# --- virtual links -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("feature", "link_class", "name"),
    [
        (vs.Points([[0.1, 0.0, 0.0]]), 4, "sphere in a cylinder"),
        (vs.Lines([[[0, 0, 0], [1, 0, 0]]]), 4, "line contact"),
        (vs.Points(SQUARE[:2]), 2, ""),
        (vs.Points(SQUARE[:3]), 0, "rigid"),
        (vs.Sphere([0, 0, 0], 0.2), 3, "ball joint"),
        (vs.Circle([0, 0, 0], [0, 0.3, 1], 0.2), 1, "revolute"),
        (vs.Cylinder([0, 0, 0], [1, 0, 0], 0.1), 2, "cylindrical joint"),
        (vs.Plane3D([0, 0, 1], 0.1), 3, "planar joint"),
        (vs.Lines([[[0, 0, 0], [1, 0, 0]], [[0, 0.1, 0], [1, 0.1, 0]]]), 2, ""),
        (vs.Points([[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]]), 1, "revolute"),
    ],
)
def test_virtual_links(feature, link_class, name):
    rng = np.random.default_rng(10)
    T = pose(rng)
    link = vs.virtual_link(feature, T)
    assert (link.link_class, link.rank) == (link_class, 6 - link_class)
    assert link.kernel_twists.shape == (link_class, 6)
    assert name in (link.name, "")
    s = feature.measure(T)
    for twist in link.kernel_twists:  # quadratic change along the kernel, linear across
        assert abs(feature.measure(seen_after(T, 1e-6 * twist)) - s).max() < 1e-10
    _, sizes, Vt = np.linalg.svd(feature.interaction(T))
    for size, twist in zip(sizes[: link.rank], Vt, strict=False):
        moved = np.linalg.norm(feature.measure(seen_after(T, 1e-6 * twist)) - s)
        assert moved == pytest.approx(1e-6 * size, rel=0.01)
    links = vs.virtual_link(vs.Circle([0, 0, 0], [0, 0, 1], 0.2), [translation(0, 0, 1), T])
    assert links.rank.tolist() == [3, 5]  # seen centred it has a larger class
    assert links.kernel_twists.shape == (2, 3, 6)
    assert np.isnan(links.kernel_twists[1, 1:]).all()


# --- refused input -------------------------------------------------------------------------------

GOAL = translation(0.0, 0.0, 0.5)
TASK = vs.Task(vs.Points(SQUARE), GOAL)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: vs.Camera(focal=0), "focal"),
        (lambda: vs.interaction_point(0, 0, 0), "Z"),
        (lambda: vs.Circle([0, 0, 0], [1, 0, 0], 0.1).measure(GOAL), "edge-on"),
        (lambda: vs.Cylinder([0, 0, 0], [1, 0, 0], 1).measure(GOAL), "inside"),
        (lambda: vs.Moments([[0, 0, 0], [1, 0, 0], [2, 0, 0]]), "area"),
        (lambda: vs.Moments(SQUARE[[0, 2, 1, 3]]), "cross|area"),
        (lambda: vs.Moments(SQUARE, components=5), "components: expected some of area"),
        (lambda: vs.Moments(SQUARE, components=[["area"]]), "each once"),
        (lambda: vs.TargetMotion(kalman="no"), "kalman: expected True or False"),
        (lambda: vs.Task(vs.Points(SQUARE), vs.Sphere([0, 0, 0], 1)), r"Sphere; give its measure"),
        (lambda: vs.Task(vs.Points(SQUARE), np.ones(8), interaction="mean"),
         "desired pose"),
        (lambda: vs.camera_velocity(TASK, np.ones(8)), 'depth="true"'),
        (lambda: vs.p3p([[0, 0, 0], [1, 0, 0], [2, 0, 0]], np.eye(3)[:, :2]),
         "on a line"),
        (lambda: vs.pnp(SQUARE, 300 + 900 * SQUARE[:, :2]), "normalise"),
        (lambda: vs.refine_pose(SQUARE, SQUARE[:, :2], inverse(GOAL)), "front"),
        (lambda: vs.homography(np.ones((5, 2)), np.ones((5, 2))), "determine"),
        (lambda: vs.Task(vs.Sphere([0, 0, 0], 1.0), GOAL @ translation(0, 0, 1), depth=0.5),
         "depth"),
        (lambda: vs.camera_velocity(vs.Hybrid(vs.Task(vs.Points(SQUARE), GOAL, depth=0.5), vs.Task(
            vs.Points(SQUARE[::-1]), GOAL, depth=0.5)), np.ones(8)), "second"),
    ],
)  # fmt: skip
def test_refused(call, words):
    with pytest.raises((InvalidValueError, ShapeError), match=words):
        call()
