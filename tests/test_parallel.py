"""Parallel robots: descriptions, inverse and direct models, all assembly modes, velocities."""

import pickle
from collections import Counter

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from robotmodels import parallel as pr
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.parallel import kernels_homotopy

TURN = np.deg2rad([-90.0, 30.0, 150.0])
RING = np.c_[np.cos(TURN), np.sin(TURN), 0.0 * TURN]
BASE, TRIANGLE = [[0, 0], [2, 0], [1, 1.7]], [[-0.3, -0.2], [0.3, -0.25], [0.05, 0.3]]


def random_gough(rng, kind="general"):
    base, platform = rng.normal(size=(2, 6, 3))
    if "planar" in kind:
        platform[:, 2] = 0.0
    if kind == "planar base and platform":
        base[:, 2] = 0.0
    if kind == "shared anchor":
        platform[1] = platform[0]
    return pr.gough(base, platform)


ROBOTS = {
    "gough": random_gough(np.random.default_rng(1)),
    "SSM": pr.gough_symmetric(1.0),
    "3-RPR": pr.planar_3rpr(BASE, TRIANGLE),
    "3-RRR": pr.planar_3rrr(BASE, TRIANGLE, [0.8, 0.7, 0.9], 0.9),
    "five-bar": pr.five_bar([[-0.2, 0.0], [0.2, 0.05]], [0.4, 0.45], [0.6, 0.55]),
    "delta": pr.delta(0.164 * RING, 0.044 * RING, TURN, 0.524, 1.244),
}
GOOD = ROBOTS["SSM"]
DIETMAIER = (
    [
        [0, 0, 0], [1.107915, 0, 0], [0.549094, 0.756063, 0], [0.735077, -0.223935, 0.525991],
        [0.514188, -0.526063, -0.368418], [0.590473, 0.094733, -0.205018],
    ],
    [
        [0, 0, 0], [0.542805, 0, 0], [0.956919, -0.528915, 0], [0.665885, -0.353482, 1.402538],
        [0.478359, 1.158742, 0.107672], [-0.137087, -0.235121, 0.353913],
    ],
    [1, 0.645275, 1.086284, 1.503439, 1.281933, 0.771071],
)  # fmt: skip


def poses_near_home(robot, count, size=0.1, seed=0):
    X = robot.coordinates(robot.home)
    return robot.pose(X + size * np.random.default_rng(seed).uniform(-1, 1, (count, X.size)))


def moved(T, twist):
    """Poses moved by small screws about their origins."""
    out = np.array(T)
    out[..., :3, :3] = Rotation.from_rotvec(twist[..., 3:]).as_matrix() @ out[..., :3, :3]
    out[..., :3, 3] += twist[..., :3]
    return out


def twists(robot, count, seed=1):
    V = np.zeros((count, 6))
    V[:, list(robot.columns)] = np.random.default_rng(seed).normal(size=(count, robot.m))
    return V


def leg_errors(base, platform, T, lengths):
    anchors = np.einsum("...ij,kj->...ki", T[..., :3, :3], platform) + T[..., None, :3, 3]
    return np.abs(np.linalg.norm(anchors - base, axis=-1) - lengths).max(axis=-1)


# --- inverse and direct models -------------------------------------------------------------------


@pytest.mark.parametrize("name", ROBOTS)
def test_every_mode_comes_back_from_the_direct_models(name):
    robot = ROBOTS[name]
    T = poses_near_home(robot, 6)
    np.testing.assert_allclose(robot.pose(robot.coordinates(T)), T, atol=1e-14)
    legs = pr.igm(robot, T)
    assert legs.count.tolist() == [2**robot.m if robot.has_cranks else 1] * 6
    assert legs.mode[0].tolist() == list(range(legs.q.shape[1]))
    for k in range(legs.q.shape[1]):
        q = legs.q[:, k]
        near = pr.dgm(robot, q, T0=moved(T, 1e-3 * twists(robot, 6)))
        assert (near.status == pr.PoseStatus.CONVERGED).all()
        np.testing.assert_allclose(near.T, T, atol=1e-11)
        modes = pr.assembly_modes(robot, q)
        away = np.where(modes.valid, np.abs(modes.T - T[:, None]).max(axis=(-1, -2)), 9.0)
        assert away.min(axis=1).max() < 1e-11
        assert np.nanmax(modes.residual) < 1e-12
        assert (modes.status == pr.AssemblyStatus.ALL).all()
        shaped = pr.assembly_modes(robot, q.reshape(2, 3, -1).tolist())
        np.testing.assert_array_equal(shaped.T, modes.T.reshape(2, 3, *modes.T.shape[1:]))
    for result in (robot, legs, modes, near):
        assert pickle.loads(pickle.dumps(result)) == result
        assert len(repr(result).splitlines()) <= 6
    assert pr.inverse_jacobian(robot, T[:0]).shape == (0, robot.m, 6)
    assert pr.assembly_modes(robot, legs.q[:0, 0]).count.shape == (0,)


def test_delta_of_the_flexpicker():
    """R. L. Williams II, "The Delta parallel robot: kinematics solutions", 2016, snapshots."""
    side, wB, wP, uP = 0.076, 0.164, 0.022, 0.044
    hips = wB * RING
    platform = [[0, -uP, 0], [side / 2, wP, 0], [-side / 2, wP, 0]]
    robot = pr.delta(hips, platform, TURN, 0.524, 1.244)
    for place, degrees in (([0, 0, -0.9], [-20.5] * 3), ([0.3, 0.5, -1.1], [47.5, -11.6, 21.4])):
        q = pr.igm(robot, robot.pose(place)).q[0]
        np.testing.assert_allclose(np.rad2deg(q), degrees, atol=0.06)
    for degrees, place in (([0, 0, 0], [0, 0, -1.065]), ([10, 20, 30], [0.108, -0.180, -1.244])):
        modes = pr.assembly_modes(robot, np.deg2rad(degrees))
        assert modes.count == 2
        lower = modes.T[modes.T[:, 2, 3].argmin(), :3, 3]
        np.testing.assert_allclose(lower, place, atol=1e-3)  # dimensions and answers in mm


def test_iterative_model_keeps_the_mode_near_home():
    robot = ROBOTS["SSM"]
    rng = np.random.default_rng(3)
    axis = rng.normal(size=(2000, 3))
    axis *= np.deg2rad(20) * rng.uniform(0, 1, (2000, 1)) / np.linalg.norm(axis, axis=1)[:, None]
    X = np.c_[robot.home[:3, 3] + rng.uniform(-0.2, 0.2, (2000, 3)), axis]
    T = robot.pose(X)
    q = pr.igm(robot, T).q[:, 0]
    for start in (None, robot.home):
        found = pr.dgm(robot, q, start)
        assert (found.status == 0).all()
        assert found.iterations.max() <= 6
        np.testing.assert_allclose(found.T, T, atol=1e-12)
    assert found.reason(3) == pr.PoseStatus.CONVERGED.sentence


def test_iterative_model_says_when_it_left_the_mode_or_found_nothing():
    robot, rng = ROBOTS["SSM"], np.random.default_rng(0)
    X = np.c_[rng.uniform(-0.3, 0.3, (400, 3)), rng.uniform(-1.5, 1.5, (400, 3))]
    X[:, 2] += 1.0
    T = robot.pose(X)
    start, q = T[:200], pr.igm(robot, T[200:]).q[:, 0]
    found = pr.dgm(robot, q, start)
    assert set(found.status.tolist()) == {0, 1, 2}
    some = found.status != pr.PoseStatus.NOT_CONVERGED
    same = found.det * pr.determinant(robot, start) > 0
    np.testing.assert_array_equal(same[some], found.status[some] == pr.PoseStatus.CONVERGED)
    reached = pr.igm(robot, found.T[some]).q[:, 0]
    np.testing.assert_allclose(reached, q[some], atol=1e-12)
    none = pr.dgm(robot, [0.1, 0.1, 0.1, 5.0, 5.0, 5.0])
    assert none.status == pr.PoseStatus.NOT_CONVERGED
    assert np.isnan(none.T).all()


def test_limits_and_reach_are_statuses():
    robot = pr.gough_symmetric(1.0, lower=0.8, upper=1.4)
    heights = np.array([1.0, 5.0])
    T = robot.pose([[0, 0, z, 0, 0, 0] for z in heights])
    legs = pr.igm(robot, T)
    assert legs.status.tolist() == [pr.LegStatus.REACHED, pr.LegStatus.OUTSIDE_LIMITS]
    assert legs.within_limits[:, 0].tolist() == [True, False]
    far = pr.igm(ROBOTS["delta"], ROBOTS["delta"].pose([[0, 0, -1.0], [3.0, 0, -1.0]]))
    assert far.count.tolist() == [8, 0]
    assert far.reason(1) == pr.LegStatus.OUT_OF_REACH.sentence
    assert np.isnan(far.q[1]).all()
    modes = pr.assembly_modes(ROBOTS["SSM"], [[1, 1, 1, 1, 1, 9.0], [1.0] * 6])
    assert (modes.count > 0).tolist() == [False, True]
    assert "do not meet" in modes.reason(0)
    # angles count modulo whole turns
    turned = pr.five_bar([[-0.2, 0], [0.2, 0]], 0.4, 0.6, lower=np.pi, upper=4 * np.pi)
    assert pr.igm(turned, turned.home).within_limits.all()
    # a straight leg counts once
    robot = pr.five_bar([[-0.2, 0.0], [0.2, 0.0]], [0.4, 0.4], [0.6, 0.8])
    T = robot.pose(robot.base[0, :2] + [0.6, 0.8])  # 0.4 + 0.6 from the first axis
    assert pr.igm(robot, T).count == 2
    assert pr.classify_singularity(robot, T).kind == pr.SingularityKind.SERIAL
    with pytest.raises(InvalidValueError, match="leg 1 is straight"):
        pr.inverse_jacobian(robot, T)


# --- assembly modes ------------------------------------------------------------------------------


def test_forty_assembly_modes_of_dietmaier():
    """P. Dietmaier, "The Stewart-Gough platform of general geometry can have 40 real postures",
    Advances in Robot Kinematics 1998."""
    base, platform, lengths = map(np.array, DIETMAIER)
    modes = pr.assembly_modes(pr.gough(base, platform), lengths)
    assert modes.count == modes.complex_count == 40
    assert leg_errors(base, platform, modes.T, lengths).max() < 1e-12
    apart = np.abs(modes.T[:, None] - modes.T).max(axis=(-1, -2)) + 9.0 * np.eye(40)
    assert apart.min() > 1e-3
    assert modes.status == pr.AssemblyStatus.ALL


def test_paths_that_jumped_are_tracked_again(monkeypatch):
    attempts, paths = [], kernels_homotopy.paths

    def jumping(*arguments):
        paths(*arguments)
        if not attempts:  # a real end, whose conjugate is itself, is found twice and another lost
            arguments[-2][0, 0] = arguments[-2][0, 1]
        attempts.append(len(arguments[0]))

    monkeypatch.setattr(kernels_homotopy, "paths", jumping)
    base, platform, lengths = map(np.array, DIETMAIER)
    assert pr.assembly_modes(pr.gough(base, platform), lengths).count == 40
    assert sum(attempts) == 2


@pytest.mark.parametrize(
    ("kind", "bound"),
    [("general", 40), ("planar platform", 40), ("planar base and platform", 40),
     ("shared anchor", 40), ("TSSM", 16), ("MSSM", 16)],
)  # fmt: skip
def test_lists_of_random_platforms_are_complete(kind, bound):
    """Triangular platforms have sixteen solutions."""
    rng = np.random.default_rng(7)
    for _ in range(6):
        robot = random_gough(rng, kind)
        if bound == 16:
            base, platform = rng.normal(size=(2, 3, 3))
            base = base[[0, 1, 1, 2, 2, 0]] if kind == "MSSM" else rng.normal(size=(6, 3))
            robot = pr.gough(base, platform[[0, 0, 1, 1, 2, 2]])
        T = moved(np.eye(4), rng.normal(size=6))
        modes = pr.assembly_modes(robot, pr.igm(robot, T).q[0])
        assert modes.complex_count == bound
        assert modes.count % 2 == 0
        assert np.abs(modes.T - T).max(axis=(-1, -2)).min() < 1e-9
        if kind == "planar base and platform":  # solutions are mirrored at the base
            p = np.einsum("kij,j->ki", modes.T[:, :3, :3], robot.platform.mean(axis=0))
            z = p[:, 2] + modes.T[:, 2, 3] - robot.base[0, 2]
            np.testing.assert_allclose(np.sort(z), np.sort(-z), atol=1e-9)
    if bound == 16:
        symmetric = pr.gough_symmetric(1.0, kind=kind)
        q = pr.igm(symmetric, moved(symmetric.home, 0.2 * rng.normal(size=6))).q[0]
        assert pr.assembly_modes(symmetric, q).complex_count == bound


def test_postures_that_nearly_coincide_are_both_listed():
    robot = random_gough(np.random.default_rng(5))
    height = np.linspace(-4, 4, 200)

    def pose(z):
        return robot.pose([0.1, 0.2, z, 0.3, 0.1, 0.2])

    det = pr.determinant(robot, np.array([pose(z) for z in height]))
    k = np.flatnonzero(np.diff(np.sign(det)))[0]
    z0 = brentq(lambda z: float(pr.determinant(robot, pose(z))), height[k], height[k + 1])
    for off in (1e-3, 1e-5):
        T = pose(z0 + off)
        modes = pr.assembly_modes(robot, pr.igm(robot, T).q[0])
        away = np.sort(np.abs(modes.T - T).max(axis=(-1, -2)))
        assert (away < 10 * off).sum() == 2
        assert away[0] < 1e-8
        assert modes.det.min() < 0 < modes.det.max()
        assert modes.complex_count == 40


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_singular_poses_of_similar_platforms_are_exact_solutions(factor):
    """All lines of the legs meet in a point, also at infinity: solutions of high multiplicity."""
    for seed in range(5):
        flat = np.random.default_rng(seed).normal(size=(6, 3)) * [1.0, 1.0, 0.0]
        for base in (flat, np.random.default_rng(seed).normal(size=(6, 3))):
            robot = pr.gough(base, factor * base)
            T = robot.pose([0.1, 0.2, 0.9, 0, 0, 0])
            lengths = pr.igm(robot, T).q[0]
            modes = pr.assembly_modes(robot, lengths)
            assert modes.status == pr.AssemblyStatus.ALL
            assert leg_errors(robot.base, robot.platform, modes.T, lengths).max() < 1e-12
            assert np.abs(modes.T - T).max(axis=(1, 2)).min() < 1e-3


def test_robots_that_move_with_locked_legs_are_degenerate():
    rng, ring = np.random.default_rng(0), GOOD.base
    line = rng.normal(size=(6, 1)) * rng.normal(size=3)
    # singular everywhere, whether or not the legs can have these lengths
    for base, platform in ((line, rng.normal(size=(6, 3))), (ring, ring), (ring, 0.5 * ring)):
        for last in (1.0, 1.1):
            modes = pr.assembly_modes(pr.gough(base, platform), [1.0] * 5 + [last])
            assert modes.status == pr.AssemblyStatus.DEGENERATE
    for base in rng.normal(size=(3, 6, 3)):  # equal legs: the platform moves without turning
        modes = pr.assembly_modes(pr.gough(base, base), [1.0] * 6)
        assert modes.status == pr.AssemblyStatus.DEGENERATE
    # Bricard's line-symmetric octahedron is not singular everywhere, but flexible
    corner = rng.normal(size=(3, 3))
    octahedron = pr.gough(corner[[0, 0, 1, 1, 2, 2]], (corner * [-1, -1, 1])[[1, 2, 0, 2, 0, 1]])
    q = pr.igm(octahedron, np.eye(4)).q[0]
    assert pr.assembly_modes(octahedron, q).status == pr.AssemblyStatus.DEGENERATE
    assert pr.assembly_modes(octahedron, q + 0.01 * np.arange(6)).complex_count == 16


def test_six_modes_of_the_planar_robot_of_innocenti():
    """C. Innocenti and V. Parenti-Castelli, "Singularity-free evolution from one configuration to
    another in serial and fully-parallel manipulators", J. of Mechanical Design 120 (1998)."""
    a, b, c = 17.04, 16.54, 20.84
    x = (a * a + c * c - b * b) / (2 * a)
    robot = pr.planar_3rpr(
        [[0, 0], [15.91, 0], [0, 10]], [[0, 0], [a, 0], [x, np.sqrt(c * c - x * x)]]
    )
    q = [14.98, 15.38, 12.0]
    modes = pr.assembly_modes(robot, q)
    assert (modes.count, np.sign(modes.det).sum()) == (6, 0)
    assert (np.diff(robot.coordinates(modes.T)[:, 2]) > 0).all()
    assert leg_errors(robot.base, robot.platform, modes.T, q).max() < 1e-12


def test_planar_lists_are_even_and_equal_to_a_search():
    rng = np.random.default_rng(4)
    counts = Counter()
    for k in range(200):
        robot = pr.planar_3rpr(*rng.normal(size=(2, 3, 2)))
        T = robot.pose(rng.normal(size=3))
        q = pr.igm(robot, T).q[0]
        modes = pr.assembly_modes(robot, q)
        counts[int(modes.count)] += 1
        assert modes.complex_count == 6
        assert np.abs(modes.T - T).max(axis=(-1, -2)).min() < 1e-8
        if k < 20:
            starts = robot.pose(rng.uniform(-4, 4, (4000, 3)))
            found = pr.dgm(robot, q, starts)
            T = found.T[found.status != 1]
            away = np.abs(T[:, None] - modes.T).max(axis=(-1, -2))
            assert away.min(axis=1).max() < 1e-7
            assert set(away.argmin(axis=1)) == set(range(int(modes.count)))
    assert set(counts) == {2, 4, 6}


def test_similar_triangles_have_at_most_four_modes():
    rng = np.random.default_rng(6)
    for scale in (0.5, 1.0, 1.7):
        for _ in range(10):
            base = rng.normal(size=(3, 2))
            robot = pr.planar_3rpr(base, scale * base)
            T = robot.pose(rng.normal(size=3))
            q = pr.igm(robot, T).q[0]
            modes = pr.assembly_modes(robot, q)
            assert modes.complex_count == 4
            assert modes.count in (2, 4)
            assert np.abs(modes.T - T).max(axis=(-1, -2)).min() < 1e-9
            # with w_i = (s e^{i phi} - 1) a_i, k_i and the lengths are of first degree in cos phi:
            # the equation of first degree in |s e^{i phi} - 1|^2 has degree two in it
            u = (np.abs(scale * np.exp(1j * robot.coordinates(modes.T)[:, 2]) - 1) ** 2).round(9)
            assert len(set(u)) <= 2
    equal = pr.planar_3rpr(base, base)
    assert pr.assembly_modes(equal, [1.0] * 3).status == pr.AssemblyStatus.DEGENERATE


def test_planar_robots_of_special_geometry():
    rng = np.random.default_rng(3)
    for pair in ([0, 0, 1], [0, 1, 1], [0, 1, 0]):  # anchors that two legs share
        base, platform = rng.normal(size=(2, 3, 2))
        for robot in (
            pr.planar_3rpr(base[pair], platform),
            pr.planar_3rpr(base, platform[pair]),
            pr.planar_3rpr(base, 1.2 * base[pair]),
        ):
            T = robot.pose(rng.normal(size=3))
            modes = pr.assembly_modes(robot, pr.igm(robot, T).q[0])
            assert modes.complex_count == 4
            assert np.abs(modes.T - T).max(axis=(-1, -2)).min() < 1e-8
    # base and platform on lines: mirrored pairs, one of them with equal orientation
    robot = pr.planar_3rpr([[0, 0], [1, 0], [3, 0]], [[0, 0], [0.5, 0], [0.9, 0]])
    modes = pr.assembly_modes(robot, pr.igm(robot, robot.pose([0.4, 1.1, 0.0])).q[0])
    for pose in robot.pose([[0.4, 1.1, 0.0], [0.4, -1.1, 0.0]]):
        assert np.abs(modes.T - pose).max(axis=(-1, -2)).min() < 1e-9


def test_spheres_and_circles_that_touch_miss_or_coincide():
    five = pr.five_bar([[0, 0], [1.0, 0]], 0.3, 0.5)
    assert pr.assembly_modes(five, [np.pi / 2, np.pi / 2]).count == 1  # the rods are stretched
    apart = pr.assembly_modes(five, [np.pi, 0.0])
    assert (apart.count, apart.status) == (0, 0)
    folded = pr.five_bar([[0, 0], [0.6, 0]], 0.3, 0.5)
    assert pr.assembly_modes(folded, [0.0, np.pi]).status == pr.AssemblyStatus.DEGENERATE
    line = pr.delta([[0, 0, 0], [1, 0, 0], [2, 0, 0.0]], np.zeros((3, 3)), [0, 0, 0], 0.3, 1.5)
    modes = pr.assembly_modes(line, [0.2, 0.2, 0.2])
    assert (modes.count, modes.status) == (0, 0)  # three circles of one axis that do not meet


# --- velocities ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ROBOTS)
def test_jacobians_are_derivatives_in_every_mode(name):
    robot, h = ROBOTS[name], 1e-6
    T, V = poses_near_home(robot, 4), twists(robot, 4)
    ahead, behind = moved(T, h * V), moved(T, -h * V)
    modes = pr.igm(robot, T).mode
    for mode in modes.T:
        k = int(mode[0])
        slope = (pr.igm(robot, ahead).q[:, k] - pr.igm(robot, behind).q[:, k]) / (2 * h)
        np.testing.assert_allclose(pr.ikm(robot, T, V, mode), slope, atol=1e-7)
        rate = pr.inverse_jacobian_rate(robot, T, V, mode)
        change = pr.inverse_jacobian(robot, ahead, mode) - pr.inverse_jacobian(robot, behind, mode)
        np.testing.assert_allclose(rate, change / (2 * h), atol=1e-6)
        np.testing.assert_allclose(pr.dkm(robot, T, slope, mode), V, atol=1e-6)
        A = twists(robot, 4, seed=5)
        second = pr.ikm_second_order(robot, T, V, A, mode)
        rates = pr.ikm(robot, T, V, mode)
        np.testing.assert_allclose(pr.dkm_second_order(robot, T, rates, second, mode), A, atol=1e-9)


# --- mistakes ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: pr.gough(GOOD.base, GOOD.platform[[0, 0, 0, 0, 0, 0]]), "all"),
        (lambda: pr.gough(GOOD.base[:5], GOOD.platform[:5]), "6 points"),
        (lambda: pr.gough(GOOD.base[[0, 0, 1, 2, 3, 4]], GOOD.platform[[0, 0, 1, 2, 3, 4]]),
         "legs 1 and 2"),
        (lambda: pr.gough(GOOD.base, GOOD.platform, 2, 1), "lower below upper"),
        (lambda: pr.assembly_modes(GOOD, [1, 1, 1, 1, 1, -1.0]), "negative"),
        (lambda: pr.igm(ROBOTS["delta"], GOOD.pose([0, 0, -1, 0.1, 0, 0])),
         "translates only"),
        (lambda: pr.igm(ROBOTS["3-RPR"], GOOD.home), "plane"),
        (lambda: pr.inverse_jacobian(ROBOTS["delta"], ROBOTS["delta"].pose([9, 0, 0])),
         "out of reach"),
        (lambda: pr.workspace(GOOD, limits=False), "unlimited"),
    ],
)  # fmt: skip
def test_mistakes_say_what_to_do(call, words):
    with pytest.raises((InvalidValueError, ShapeError), match=words):
        call()
