"""Workspaces, singular curves, aspects, cuspidality: published results, identities, refusals."""

import gc
import pickle
import weakref
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import robotmodels as rm
from robotmodels import performance as pf
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.geometry import DHTable
from robotmodels.obstacles import Plane, Sphere
from robotmodels.se3 import rotation, translation

POSITION = [1, 1, 1, 0, 0, 0]
PLANE = [1, 1, 0, 0, 0, 0]
KINDS = ("primary", "secondary")


def three(d3, d4, r2, alpha3=np.pi / 2, r3=0.0, **limits):
    """3R arm: orthogonal by default, with d2 = 1."""
    table = DHTable(
        antecedent=[0, 1, 2], sigma=[0, 0, 0], alpha=[0, -np.pi / 2, alpha3], d=[0, 1, d3],
        theta=[0, 0, 0], r=[0, r2, r3], **limits,
    )  # fmt: skip
    return rm.RobotModel.from_table(table, tool=translation(d4, 0, 0))


def planar(*lengths, **limits):
    """Planar arm with turning joints."""
    n = len(lengths)
    table = DHTable(antecedent=range(n), sigma=[0] * n, d=[0, *lengths[:-1]], **limits)
    return rm.RobotModel.from_table(table, tool=translation(lengths[-1], 0, 0))


def published_cusps(d3, d4, r2):
    """Number of cusps by the surfaces of Baili, Wenger and Chablat, and the distance to one."""
    A, B = np.hypot(d3 + 1, r2), np.hypot(d3 - 1, r2)
    s = d3**2 + r2**2
    C1 = np.sqrt((s - (s**2 - d3**2 + r2**2) / (A * B)) / 2)
    C2, C3 = A * d3 / (1 + d3), B * d3 / abs(d3 - 1)
    count = 0 if d4 < C1 else 4 if d4 < C2 else 2 if d4 < C3 else 4 if d3 > 1 else 0
    return count, min(abs(d4 - C) for C in (C1, C2, C3))


def shoelace(line):
    x, y = line[:-1].T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


WENGER = three(2, 1.5, 1)
TWO = planar(1.0, 0.6)
LIMITED = planar(1.0, 0.8, lower=[-1, -2], upper=[1, 2])
SLIDES = rm.RobotModel.from_table(
    DHTable(antecedent=[0, 1, 2], sigma=[1, 1, 1], alpha=[0, np.pi / 2, np.pi / 2],
            theta=[0, np.pi / 2, 0], lower=[0, 0, 0], upper=[1, 2, 3])
)  # fmt: skip
BESIDE_A_SURFACE = [
    (1.4208042100585268, 3.914961079872775, 1.0800949603707881),
    (2.945455114852277, 3.1149256430854053, 0.6594088334143562),
    (0.5086990916, 1.8479154978, 1.7129785869),
    (1.907760080309011, 1.913408770344491, 0.28177146725972213),
    (1.2582322765569636, 5.23462489563347, 1.0424207609817377),
    (1.0327, 5.6669, 0.1764),
    (0.9249800320642823, 14.166352940981108, 1.146668561691413),
]
SWEEP = [(2, d4, 1) for d4 in (0.1, 0.25, 1.6, 2.0, 2.15, 2.7, 3.1)]


def random_arms(count, seed=7):
    """Parameters (d3, d4, r2) farther than 1e-3 from a surface."""
    rng, found = np.random.default_rng(seed), []
    while len(found) < count:
        p = rng.uniform(0.1, 3, 3)
        if published_cusps(*p)[1] > 1e-3:
            found.append(tuple(p))
    return found


# --- singular curves, cusps, nodes ---------------------------------------------------------------


@pytest.mark.nightly
def test_numbers_of_cusps_of_orthogonal_arms():
    for p in (*random_arms(25), *SWEEP, *BESIDE_A_SURFACE):
        found = pf.cusps(three(*p))
        assert (*p, len(found)) == (*p, published_cusps(*p)[0])
        assert found.status is pf.SectionStatus.FOUND


@pytest.mark.nightly
def test_cusps_and_cuspidality_of_500_orthogonal_arms():
    for p in random_arms(500, 8):
        count, found = published_cusps(*p)[0], pf.cuspidality(three(*p))
        assert (*p, len(pf.cusps(three(*p)))) == (*p, count)
        assert (*p, found.status.name) == (*p, "CUSPIDAL" if count else "NOT_CUSPIDAL")
        assert count == 0 or proof_holds(three(*p), found, slice(0, 3))


def test_a_cusp_is_a_triple_root():
    found = pf.cusps(WENGER)
    assert len(found) == 4
    assert found.residual.max() < 1e-12
    for q in found.q:
        # along the direction in which the arm moves the tool not, the position changes as s^3
        J = rm.jacobian(WENGER, q)[:3]
        v = np.linalg.svd(J)[2][2]
        left = np.linalg.svd(J)[0][:, 2]
        p = lambda s: rm.dgm(WENGER, q + s * v)[:3, 3]  # noqa: B023, E731
        second = left @ (p(1e-3) - 2 * p(0) + p(-1e-3)) / 1e-6
        assert abs(second) < 1e-5


def test_cusps_do_not_depend_on_base_and_first_joint():
    base = rotation("x", 0.7) @ translation(0.3, -0.2, 0.5)
    moved = pf.cusps(WENGER.with_base(base))
    np.testing.assert_allclose(np.sort(moved.q, axis=0), np.sort(pf.cusps(WENGER).q, axis=0),
                               atol=1e-9)  # fmt: skip


def test_nodes_change_where_published():
    A, B = np.hypot(3, 1), np.hypot(1, 1)
    for E in ((A - B) / 2, (A + B) / 2):
        counts = [len(pf.nodes(three(2, d4, 1))) for d4 in (E - 0.01, E + 0.01)]
        assert counts[0] != counts[1]


def test_two_configurations_of_a_node_reach_one_point():
    found = pf.nodes(three(2, 2.6, 1))
    assert len(found) > 0
    assert found.residual.max() < 1e-9
    p = rm.dgm(three(2, 2.6, 1), found.q)[..., :3, 3]
    rho = np.hypot(p[..., 0], p[..., 1])
    np.testing.assert_allclose(rho[:, 0], rho[:, 1], atol=1e-9)
    np.testing.assert_allclose(p[:, 0, 2], p[:, 1, 2], atol=1e-9)
    assert np.abs(found.q[:, 0] - found.q[:, 1]).max() > 1e-3


@pytest.mark.nightly
def test_curves_that_lie_on_each_other_have_no_nodes():
    for alpha in ((0, np.pi / 2, 0), (0, 0, np.pi / 2), (0, np.pi / 2, np.pi / 2)):
        for d in ((0, 0, 0.5), (0, 1, 0.5)):
            table = DHTable(antecedent=[0, 1, 2], sigma=[0, 0, 0], alpha=alpha, d=d,
                            theta=[0, 0.3, 0.2], r=[0, 0, 0])  # fmt: skip
            arm = rm.RobotModel.from_table(table, tool=translation(0.6, 0.1, 0.2))
            assert len(pf.nodes(arm)) <= 4


def random_arm(sigma, seed):
    """An arm whose slides have narrow limits."""
    rng, n, slides = np.random.default_rng(seed), len(sigma), np.array(sigma) == 1
    ends = np.where(slides, 0.15, np.pi)
    table = DHTable(
        antecedent=range(n), sigma=sigma, alpha=[0, *rng.uniform(-1.6, 1.6, n - 1)],
        d=[0, *rng.uniform(0.1, 1.0, n - 1)], theta=np.where(slides, rng.uniform(-3, 3, n), 0.0),
        r=np.where(slides, 0.0, rng.uniform(-0.5, 0.5, n)), lower=-ends, upper=ends,
    )  # fmt: skip
    return rm.RobotModel.from_table(table, tool=translation(0.8, 0.1, 0.0))


@pytest.mark.sampled(2)
@pytest.mark.parametrize("sigma", [(0, 0, 1), (0, 1, 0), (1, 0, 0), (0, 0, 1, 0, 0, 0)])
def test_changes_of_posture_keep_the_limits_of_slides(sigma):
    slides = np.array(sigma) == 1
    for seed in range(3):
        arm = random_arm(sigma, seed)
        found = pf.cuspidality(arm, poses=10)
        path = found.path[:, slides]
        assert (np.abs(path) <= 0.15 + 1e-8).all()
        if found.status == pf.CuspidalityStatus.CUSPIDAL:
            np.testing.assert_allclose(*rm.dgm(arm, found.ends)[:, :3, 3], atol=1e-9)


def test_few_postures_prove_nothing():
    """An arm with a wrist that is cuspidal: by one pose its signs seem to be labels."""
    table = DHTable(
        antecedent=range(6), sigma=[0] * 6, alpha=np.array([0, -1, 1, 1, -1, 1]) * np.pi / 2,
        d=[0, 1, 2, 0, 0, 0], theta=[0] * 6, r=[0, 1, 0, 1.5, 0, 0],
    )  # fmt: skip
    arm, status = rm.RobotModel.from_table(table), pf.CuspidalityStatus
    for seed in range(4):
        assert pf.cuspidality(arm, seed, poses=1).status != status.NOT_CUSPIDAL
    assert pf.cuspidality(arm).status == status.CUSPIDAL


def test_curves_are_singular_and_their_kind_holds():
    curves = pf.singular_curves(WENGER)
    assert sorted(k.value for k in curves.kind) == ["boundary", "internal"]
    for q, kind in zip(curves.joint, curves.kind, strict=True):
        s = np.linalg.svd(rm.jacobian(WENGER, q)[:, :3], compute_uv=False)[:, 2]
        assert s.max() < 1e-9
        assert kind in pf.CurveKind


def test_level_curves_have_their_level_and_go_on_beyond_their_ends():
    from robotmodels.performance.arms import section_arm
    from robotmodels.performance.level_curves import level_set

    arm = section_arm(WENGER)
    lines, touch = level_set(WENGER, arm, False, 0.5).curves()
    assert lines
    assert not touch
    for line in lines:
        np.testing.assert_allclose(arm.values(line.x)[:, 6], 0.5, atol=1e-9)
        part = line.part(len(line.x) - 10, len(line.x) + 10)
        assert np.abs(np.diff(part.x, axis=0)).max() < 0.1


def test_limits_cut_curves_and_add_their_own():
    curves = pf.singular_curves(planar(1.0, 0.6, lower=[-1, -2], upper=[1, 2]))
    assert [k.value for k in curves.kind].count("limit") == 4
    for q in curves.joint:
        assert (np.abs(q) <= [1 + 1e-9, 2 + 1e-9]).all()


# --- workspaces ----------------------------------------------------------------------------------


def test_annulus():
    w = pf.workspace(TWO)
    assert w.area == pytest.approx(4 * np.pi * 0.6, rel=1e-6)
    assert w.grid_area == pytest.approx(w.area, rel=1e-3)
    assert abs(w.grid_area / w.area - 1.0) < w.grid_error < 1e-2  # a bound, not an estimate
    assert w.area_of(2) == pytest.approx(w.area, rel=1e-9)
    assert w.area_of(1) == 0
    loops = w.boundary()
    assert sum(map(shoelace, loops)) == pytest.approx(w.area, rel=1e-6)
    np.testing.assert_array_equal(w.contains([[1, 1], [1.7, 0], [0.1, 0]]), [True, False, False])
    np.testing.assert_array_equal(w.contains([[[1, 1, 0], [0, 0, 3]]]), [[True, False]])


def test_counts_of_the_published_arm_are_those_of_igm():
    w = pf.workspace(WENGER, resolution=60)
    assert set(np.unique(w.count)) == {0, 2, 4}
    assert w.coordinates == "half plane"
    T = np.tile(np.eye(4), (len(w.points), 1, 1))
    T[:, [0, 2], 3] = w.points
    np.testing.assert_array_equal(w.count, rm.igm(WENGER, T, mask=POSITION).count)
    assert w.grid_area == pytest.approx(w.area, rel=5e-3)


@pytest.mark.parametrize(
    "arm",
    [WENGER, three(0.5, 0.4, 0.7), three(1.3, 0.9, 0.4, alpha3=1.1, r3=0.3), TWO],
    ids=["wenger", "short", "general", "planar"],
)
def test_change_of_variables(arm):
    """The integral of |det J| over the joints is that of the number of postures over space."""
    w = pf.workspace(arm, resolution=10)
    n = 400
    angle = -np.pi + 2 * np.pi * (np.arange(n) + 0.5) / n
    q = np.zeros((n * n, arm.n))
    q[:, -2:] = np.stack(np.meshgrid(angle, angle), -1).reshape(-1, 2)
    J = rm.jacobian(arm, q)[:, : 3 if arm.n == 3 else 2]
    integral = np.abs(np.linalg.det(J)).mean() * (2 * np.pi) ** arm.n
    of = w.volume_of if arm.n == 3 else w.area_of
    assert sum(k * of(k) for k in range(5)) == pytest.approx(integral, rel=1e-4)


def test_limits_bound_an_area():
    arm = planar(1.0, 0.8, lower=[-1, -2], upper=[1, 2])
    w = pf.workspace(arm, resolution=300)
    assert w.grid_area == pytest.approx(w.area, rel=2e-3)
    assert sum(map(shoelace, w.boundary())) == pytest.approx(w.area, rel=1e-5)
    integral = 4.0 * 0.8 * (1 - np.cos(2.0))  # of |sin q2| over the box
    assert w.area_of(1) + 2 * w.area_of(2) == pytest.approx(integral, rel=1e-6)


def test_first_joint_with_limits_makes_space():
    arm = three(2, 1.5, 1, lower=[-1, -9, -9], upper=[1, 9, 9])
    w = pf.workspace(arm, resolution=20)
    assert w.points.shape == (8000, 3)
    assert np.isnan(w.area)
    T = np.tile(np.eye(4), (8000, 1, 1))
    T[:, :3, 3] = w.points
    found = pf.accessibility(arm, T, level="position")
    np.testing.assert_array_equal(found.count, w.count)


def test_primary_space_of_a_planar_arm_is_a_disc_and_a_ring():
    arm = planar(1, 0.8, 0.3)
    w = pf.workspace(arm, kind="primary", mask=PLANE)
    r = np.hypot(*w.points.T)
    inside = (r < 0.1 - 1e-3) | ((r > 0.5 + 1e-3) & (r < 1.5 - 1e-3))
    outside = ((r > 0.1 + 1e-3) & (r < 0.5 - 1e-3)) | (r > 1.5 + 1e-3)
    assert w.count[inside].min() == 2
    assert w.count[outside].max() == 0
    assert w.area == pytest.approx(np.pi * (0.1**2 + 1.5**2 - 0.5**2), rel=1e-3)
    w, rest = (pf.workspace(arm, kind, mask=PLANE, resolution=40) for kind in KINDS)
    assert not ((w.count > 0) & (rest.count > 0)).any()


def test_orientation_workspace_is_that_of_igm():
    arm = rm.load("puma560")
    R = rotation("y", 0.4)[:3, :3]
    w = pf.workspace(arm, kind="orientation", orientation=R, resolution=10, limits=False)
    T = np.tile(np.eye(4), (1000, 1, 1))
    T[:, :3, :3], T[:, :3, 3] = R, w.points
    np.testing.assert_array_equal(w.count, rm.igm(arm, T).count)


def test_positions_of_an_arm_with_six_joints():
    w = pf.workspace(rm.load("puma560"), limits=False, resolution=100)
    assert w.status is pf.WorkspaceStatus.REACHED_ONLY
    assert set(np.unique(w.count)) == {0, 1}
    rng = np.random.default_rng(1)
    p = rm.dgm(rm.load("puma560"), rng.uniform(-3, 3, (300, 6)))[:, :3, 3]
    assert w.contains(p).mean() > 0.93
    assert not w.contains(2.5 * p / np.linalg.norm(p, axis=1)[:, None]).any()


def test_free_workspace_and_an_empty_one():
    body = Sphere([1.0, 0.4, 0.0], 0.2)
    w = pf.workspace(TWO, kind="free", free=body, resolution=40)
    whole = pf.workspace(TWO, resolution=40)
    assert (w.count <= whole.count).all()
    assert (w.count < whole.count).any()
    assert not w.contains([1.0, 0.4])
    none = pf.workspace(TWO, kind="free", free=Sphere([0, 0, 0], 5.0), resolution=20)
    assert none.status is pf.WorkspaceStatus.EMPTY
    assert none.area == 0.0


def test_a_mirrored_arm_has_a_mirrored_workspace():
    arm, other = three(2, 1.5, 1), three(2, 1.5, -1)
    a, b = (pf.workspace(x, resolution=40) for x in (arm, other))
    grid = b.count.reshape(40, 40)[:, ::-1].ravel()
    assert (a.count == grid).mean() > 0.999
    assert a.volume_of(4) == pytest.approx(b.volume_of(4), rel=1e-6)
    assert len(pf.cusps(other)) == 4


# --- accessibility -------------------------------------------------------------------------------


def test_accessibility_says_why():
    arm = planar(1, 0.6, lower=[-0.5, 0], upper=[0.5, 2])
    T = rm.dgm(arm, [[0.2, 1.0], [2.5, 1.0], [0.2, 1.0]])
    T[2, :3, 3] *= 3
    found = pf.accessibility(arm, T, level="position")
    assert [found.reason(i) for i in range(3)] == [
        s.sentence
        for s in (
            pf.AccessStatus.ACCESSIBLE,
            pf.AccessStatus.ONLY_OUTSIDE_LIMITS,
            pf.AccessStatus.OUT_OF_REACH,
        )
    ]
    wall = Plane([0.0, -2.0, 0.0], [0.0, 1.0, 0.0])
    assert pf.accessibility(arm, T[0], "position", free=wall).count == 1
    blocked = pf.accessibility(arm, T[0], "position", free=lambda q: q[:, 0] > 9)
    assert blocked.status == pf.AccessStatus.ONLY_IN_COLLISION
    assert pf.accessibility(arm, np.zeros((0, 4, 4))).count.shape == (0,)


def test_accessible_poses_and_orientations():
    arm = rm.load("puma560")
    q = np.random.default_rng(2).uniform(-2, 2, (5, 6))
    T = rm.dgm(arm, q)
    assert (pf.accessibility(arm, T, limits=False).count == rm.igm(arm, T).count).all()
    places = [translation(x, 0, 0.672) for x in (0.5, 0.8, 2.0)]
    arm = arm.with_tool(translation(0, 0, 0.2))
    found = pf.accessibility(arm, places, "every_orientation", limits=False)
    assert found.status.tolist() == [0, 4, 1]
    assert found.count[0] > 0


# --- aspects -------------------------------------------------------------------------------------


def test_aspects_of_known_arms():
    for arm, count in ((TWO, 2), (WENGER, 2), (rm.load("puma560"), 8), (rm.load("ur5e"), 8)):
        found = pf.aspects(arm, limits=False)
        assert found.count == count
        assert found.is_complete
        assert found.volume.sum() == pytest.approx((2 * np.pi) ** arm.n, rel=1e-9)


def test_the_postures_of_a_puma_are_in_eight_aspects():
    arm = rm.load("puma560")
    q = np.random.default_rng(3).uniform(-3, 3, (50, 6))
    found = rm.igm(arm, rm.dgm(arm, q))
    label = np.sort(pf.aspects(arm, limits=False).of(found.q), axis=1)
    sure = (label >= 0).all(axis=1)
    assert sure.sum() > 40
    assert (label[sure] == np.arange(8)).all()


@pytest.mark.parametrize("arm", [WENGER, three(0.7, 1.4, 0.3), rm.load("puma560")],
                         ids=["wenger", "four", "puma"])  # fmt: skip
def test_aspects_are_constant_along_regular_paths(arm):
    divided = pf.aspects(arm, limits=False)
    rows = slice(0, 3 if arm.n == 3 else 6)
    rng, seen = np.random.default_rng(4), 0
    for _ in range(300):
        a, b = rng.uniform(-3, 3, (2, arm.n))
        path = a + np.linspace(0, 1, 300)[:, None] * (b - a) * 0.5
        s = np.linalg.svd(rm.jacobian(arm, path)[:, rows], compute_uv=False)[:, -1]
        if s.min() > np.abs(np.diff(s)).max() * 2:
            seen += 1
            assert np.ptp(divided.of(path)) == 0
    assert seen > 20


def test_limits_and_obstacles_divide_the_joint_space():
    gap = lambda q: np.abs(q[:, 1]) > 0.3  # noqa: E731
    arm = planar(1, 0.6, lower=[-1, -3], upper=[1, 3])
    parts = pf.free_components(arm, gap)
    assert parts.count == 2
    assert parts.volume.sum() == pytest.approx(2 * 5.4, rel=1e-2)
    np.testing.assert_array_equal(parts.of([[0, 0], [2, 1], [0, 1]]) >= 0, [False, False, True])
    # without limits the gap at zero leaves a way around
    assert pf.free_components(TWO, gap, limits=False).count == 1
    assert pf.free_components(TWO, lambda q: q[:, 0] > 9).status is pf.AspectStatus.NO_FREE_SPACE


def test_cells_without_a_core_belong_to_the_next_part():
    from robotmodels.performance.aspects import _connected

    code, certain = np.zeros((200, 200), np.int64), np.ones((200, 200), np.bool_)
    code[:, 100:] = 1
    code[50, 98] = 1
    certain[:, 97:103] = False
    labels, separates = _connected(code, certain, np.zeros(2, np.bool_))
    assert separates
    assert labels.max() == 2
    assert labels[50, 98] == labels[50, 150] != labels[50, 10]


def test_aspects_of_redundant_arms_are_not_defined():
    for name in ("iiwa14", "lab_rr"):
        found = pf.aspects(rm.load(name), limits=False)
        assert found.status is pf.AspectStatus.NOT_DEFINED
        assert found.count == 0
        assert (found.of(np.zeros(rm.load(name).n)) == -1).all()


# --- cuspidality ---------------------------------------------------------------------------------


def proof_holds(arm, found, rows):
    """The path joins two postures of one pose, and is regular at many points between its own."""
    t = np.linspace(0, 1, 20)[:, None, None]
    q = (found.path[:-1] + t * np.diff(found.path, axis=0)).reshape(-1, arm.n)
    J = rm.jacobian(arm, q)[:, rows]
    T = rm.dgm(arm, found.ends)
    away = np.abs((np.diff(found.ends, axis=0) + np.pi) % (2 * np.pi) - np.pi).max()
    same = T[:, :3, 3] if rows.stop == 3 else T
    return (
        np.ptp(np.sign(np.linalg.det(J))) == 0
        and np.abs(same[0] - same[1]).max() < 1e-8
        and away > 1e-3
        and found.margin > 0
    )


def test_an_orthogonal_arm_is_cuspidal_if_and_only_if_it_has_cusps():
    for p in random_arms(12):
        count, found = published_cusps(*p)[0], pf.cuspidality(three(*p))
        assert (*p, found.status.name) == (*p, "CUSPIDAL" if count else "NOT_CUSPIDAL")
        assert count == 0 or proof_holds(three(*p), found, slice(0, 3))


def test_a_level_curve_proves_it_where_straight_lines_do_not():
    found = pf.cuspidality(three(*BESIDE_A_SURFACE[0]), poses=1)
    assert found.status is pf.CuspidalityStatus.CUSPIDAL
    assert proof_holds(three(*BESIDE_A_SURFACE[0]), found, slice(0, 3))


@pytest.mark.parametrize("name", ["puma560", "rx90", "irb6640", "ur5e", "planar_2r"])
def test_arms_whose_factors_are_labels_are_not_cuspidal(name):
    found = pf.cuspidality(rm.load(name), poses=50)
    assert found.status is pf.CuspidalityStatus.NOT_CUSPIDAL
    assert len(found.path) == 0


def test_labels_are_a_proof_only_where_they_are_signs_of_factors():
    from robotmodels.performance.cuspidality import _signs_are_labels, sign_factors

    arm, rng = rm.load("puma560"), np.random.default_rng(0)
    found = rm.igm(arm, rm.dgm(arm, rng.uniform(-3, 3, (40, 6))))
    regular = found.valid & ~found.double
    q, labels = found.q[regular], found.branch[regular]
    assert _signs_are_labels(sign_factors(arm), q, labels)
    assert not _signs_are_labels(sign_factors(arm), q, rng.permutation(labels))


@pytest.mark.parametrize("name", ["crx10ia", "xarm6"])
def test_cuspidal_arms_with_six_joints(name):
    arm = rm.load(name)
    found = pf.cuspidality(arm, poses=30)
    assert found.status is pf.CuspidalityStatus.CUSPIDAL
    assert proof_holds(arm, found, slice(0, 6))


def test_the_bound_holds_for_random_pairs():
    from robotmodels.performance.singularity import bound_of

    rng = np.random.default_rng(5)
    for arm in (WENGER, rm.load("crx10ia"), rm.load("ur5e"), rm.load("lab_rrt")):
        rows = np.arange(6) < (3 if arm.n == 3 else 6)
        bound = bound_of(arm, rows, np.full(arm.n, 3.0))
        a = rng.uniform(-3, 3, (2000, arm.n))
        b = a + rng.normal(0, 0.05, a.shape)
        b = np.clip(b, -3, 3)
        change = np.abs(bound.least(a) - bound.least(b))
        assert (change <= np.abs(a - b) @ bound.slopes + 1e-12).all()


def test_bound_of_the_proof():
    from robotmodels.performance.singularity import bound_of, certified

    bound = bound_of(TWO, np.array(PLANE, bool))
    assert certified(bound, np.array([[0.0, 0.5], [1.0, -0.5]])) == 0.0
    path = np.array([[0.0, 0.5], [1.0, 1.5]])
    dense = path[0] + np.linspace(0, 1, 500)[:, None] * (path[1] - path[0])
    assert 0.0 < certified(bound, path) <= bound.least(dense).min()


def test_cuspidality_of_a_redundant_arm_is_not_defined():
    found = pf.cuspidality(rm.load("iiwa14"))
    assert found.status is pf.CuspidalityStatus.NOT_DEFINED


# --- regions -------------------------------------------------------------------------------------


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    ("arm", "free"),
    [(LIMITED, None), (WENGER, None), (LIMITED, Sphere([1.2, 0.3, 0], 0.2))],
    ids=["limits", "cuspidal", "obstacle"],
)
def test_every_path_in_a_t_region_is_followed(arm, free):
    w = pf.workspace(arm, "positions" if free is None else "free", free=free, resolution=50)
    n, t = (pf.regions(arm, c, w) for c in "nt")
    assert t.count >= 1
    assert all(any((cells <= outer).all() for outer in n.cells) for cells in t.cells)
    rng, followed = np.random.default_rng(6), 0
    frame = w.frame[:3]
    for cells in t.cells[:3]:
        inside = np.flatnonzero(cells)
        for _ in range(25):
            ends = w.points[rng.choice(inside, 2)]
            line = ends[0] + np.linspace(0, 1, 100)[:, None] * (ends[1] - ends[0])
            at = np.floor((line - w.points[0]) / w.size + 0.5).astype(int)
            if cells.reshape(w.shape)[tuple(at.T)].all():
                T = np.tile(np.eye(4), (100, 1, 1))
                T[:, :3, 3] = line @ frame[:, :2].T + frame[:, 3]
                assert pf.feasible_path(arm, T, mask=POSITION).status == 0
                followed += 1
    assert followed > 10


def test_components_make_n_regions():
    gap = lambda q: np.abs(q[:, 0]) > 0.3  # noqa: E731
    w = pf.workspace(LIMITED, "free", free=gap, resolution=50)
    assert pf.regions(LIMITED, "n", w).count == 2
    assert pf.regions(rm.load("iiwa14"), "t", limits=False).status is pf.RegionStatus.NOT_DEFINED


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: pf.workspace("puma560"), InvalidValueError, "load it first"),
        (lambda: pf.workspace(TWO, "everything"), InvalidValueError, "kind: expected one of"),
        (lambda: pf.workspace(TWO, resolution=0), InvalidValueError, "at least 2"),
        (lambda: pf.workspace(TWO, resolution=10**6), InvalidValueError, "at most"),
        (lambda: pf.workspace(TWO, limits=1), InvalidValueError, "True or False"),
        (lambda: pf.workspace(TWO, "free"), InvalidValueError, "obstacles"),
        (lambda: pf.workspace(TWO, "orientation"), InvalidValueError, "rotation"),
        (lambda: pf.workspace(TWO, free=lambda q: 1), ShapeError, "bool"),
        (lambda: pf.workspace(rm.load("gantry").with_table(_unlimited())), InvalidValueError,
         "slides without limits"),
        (lambda: pf.workspace(three(2, 1, 1, lower=[-1] * 3, upper=[1] * 3), section="plane"),
         InvalidValueError, "section='space'"),
        (lambda: pf.accessibility(TWO, np.eye(3)), ShapeError, "4, 4"),
        (lambda: pf.accessibility(TWO, np.eye(4), "reach"), InvalidValueError, "level"),
        (lambda: pf.cuspidality(TWO, poses=0), InvalidValueError, "at least 1"),
        (lambda: pf.feasible_path(TWO, np.eye(4)), ShapeError, "N, 4, 4"),
        (lambda: pf.regions(WENGER, "t", pf.workspace(TWO, resolution=5)), InvalidValueError,
         "workspace of"),
        (lambda: pf.dexterity_map(TWO, index="beauty"), InvalidValueError, "index"),
    ],
)  # fmt: skip
def test_mistakes_are_refused(call, error, words):
    with pytest.raises(error, match=words):
        call()


def _unlimited():
    from dataclasses import replace

    table = rm.load("gantry").table
    return replace(table, lower=np.full(6, -np.inf), upper=np.full(6, np.inf))


def test_arms_of_one_joint_and_slides():
    one = planar(1.0)
    w = pf.workspace(one)
    assert w.status is pf.WorkspaceStatus.NOT_DEFINED
    assert w.count.size == 0
    assert pf.cusps(one).status is pf.SectionStatus.NOT_DEFINED
    assert pf.singular_curves(rm.load("puma560")).status is pf.SectionStatus.NOT_DEFINED
    w = pf.workspace(SLIDES, resolution=40)
    assert w.volume == pytest.approx(6.0, rel=0.1)
    assert abs(w.volume / 6.0 - 1.0) < w.grid_error < 0.3
    assert pf.cuspidality(SLIDES).status is pf.CuspidalityStatus.NOT_CUSPIDAL
    assert pf.aspects(SLIDES).count == 1


@pytest.mark.parametrize(
    "make",
    [
        lambda: pf.workspace(TWO, resolution=6),
        lambda: pf.singular_curves(TWO),
        lambda: pf.cusps(WENGER),
        lambda: pf.aspects(TWO, resolution=20),
        lambda: pf.cuspidality(TWO),
        lambda: pf.regions(TWO, "n", pf.workspace(TWO, resolution=20)),
        lambda: pf.accessibility(TWO, np.eye(4)),
        lambda: pf.feasible_path(TWO, rm.dgm(TWO, [[0.1, 1.0], [0.2, 1.0]])),
        lambda: pf.polytope(rm.load("ur5e"), np.ones(6), mask="position"),
    ],
)
def test_results_are_values(make):
    found = make()
    again = pickle.loads(pickle.dumps(found))
    assert len(repr(found).splitlines()) <= 6
    assert found.reason(*([] if not isinstance(found, pf.Accessibility) else [()]))
    assert again == found
    assert hash(again) == hash(found)
    arrays = [getattr(again, name) for name in again.__slots__]
    assert not any(a.flags.writeable for a in arrays if isinstance(a, np.ndarray))


# --- cases that were wrong once ------------------------------------------------------------------


def test_a_limit_on_one_side():
    for lower, upper in ((-np.inf, 1.0), (-1.0, np.inf)):
        arm = planar(1.0, 0.6, lower=[lower] * 2, upper=[upper] * 2)
        poses = rm.dgm(arm, [[2.0, 0.5], [-2.0, -2.0]])
        found = pf.accessibility(arm, poses, "position")
        assert found.count.tolist() == [2, 2]
        assert pf.feasible_path(arm, poses[:1]).reached.all()


def test_a_plane_that_is_not_the_section_has_its_own_grid():
    w = pf.workspace(WENGER, mask=PLANE, limits=False, resolution=40)
    assert w.coordinates == "plane"
    assert w.points.min() < -4.0  # a disc about the first axis, not half a plane
    reach = pf.workspace(WENGER, limits=False, resolution=40).points[:, 0].max()
    assert w.area == pytest.approx(w.grid_area)
    assert w.contains(w.points).sum() == (w.count > 0).sum()
    assert w.area == pytest.approx(np.pi * reach**2, rel=0.2)


def test_maps_and_means_are_values():
    w = pf.workspace(TWO, resolution=10)
    found = pf.dexterity_map(TWO, w)
    again = pickle.loads(pickle.dumps(found))
    assert again == found
    assert len(repr(found).splitlines()) == 1
    best, mean = found
    assert best.shape == mean.shape == (100,)
    mean = pf.global_index(TWO, over=w)
    assert pickle.loads(pickle.dumps(mean)).spread == mean.spread > 0.0
    with pytest.raises(AttributeError):
        mean.spread = 1.0


def test_more_rows_than_joints_are_not_isotropic():
    assert pf.isotropy_index(TWO, [0.3, 1.1], [1, 1, 0, 0, 0, 1]) == 0.0


def test_an_arm_without_joints():
    fixed = rm.RobotModel.from_table(DHTable(antecedent=[0], sigma=[2]), tool=translation(1, 0, 0))
    home = rm.dgm(fixed, np.zeros((2, 0)))
    assert (pf.accessibility(fixed, home, "every_orientation").count <= 1).all()
    assert pf.isotropy_index(fixed, np.zeros((2, 0)), POSITION).tolist() == [0.0, 0.0]
    assert pf.global_index(fixed, measure="joints") == 0.0
    with pytest.raises(InvalidValueError, match="nothing is reached"):
        pf.global_index(fixed)


def test_components_that_leave_a_family():
    poses = [translation(0.1, 0, 0), translation(0.1, 1, 0)]
    found = pf.accessibility(TWO, poses, mask=[1, 0, 0, 0, 0, 0])
    assert (found.status == pf.AccessStatus.ACCESSIBLE).all()
    found = pf.feasible_path(WENGER, poses, mask=[1, 0, 0, 0, 0, 0])
    assert found.status is pf.PathStatus.NOT_DEFINED
    tilted = rm.RobotModel.from_table(
        DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 1], alpha=[0.5, 0]),
        tool=translation(0.5, 0, 0),
    )
    assert pf.accessibility(tilted, rm.dgm(tilted, [0.3, 0.7]), mask=PLANE).count == 2


def test_every_orientation_about_one_axis():
    scara = rm.load("cobra_s600")
    T = rm.dgm(scara, [[0.3, 0.5, 0.05, 0.2]])
    mask = [1, 1, 1, 0, 0, 1]
    assert pf.accessibility(scara, T, "every_orientation", limits=False, mask=mask).count == 2
    w = pf.workspace(scara, "primary", mask=mask, limits=False, resolution=10)
    assert w.count.max() == 2


def test_obstacles_are_kept_by_value():
    bodies = [Sphere([1.2, 0, 0], 0.2)]
    w = pf.workspace(TWO, "free", free=bodies, resolution=6)
    again = pickle.loads(pickle.dumps(w))
    bodies.clear()
    assert again == w
    assert len(w.free) == 1
    assert w != pf.workspace(TWO, "free", free=Sphere([1.2, 0, 0], 0.3), resolution=6)


def test_an_orientation_of_a_redundant_arm_is_not_counted():
    arm = planar(1.0, 0.8, 0.5, 0.3)
    w = pf.workspace(arm, "orientation", orientation=np.eye(3), limits=False, resolution=8)
    assert w.status is pf.WorkspaceStatus.REACHED_ONLY
    assert w.count.max() == 1


@pytest.mark.parametrize(
    "call",
    [
        lambda: pf.cuspidality(WENGER, rng="x"),
        lambda: pf.cuspidality(WENGER, rng=-1),
        lambda: pf.workspace(TWO, resolution=6).area_of(1.5),
        lambda: pf.workspace(TWO, section="space"),
        lambda: pf.regions(TWO, over=pf.workspace(TWO, resolution=6), free=Sphere([1, 0, 0], 0.2)),
        lambda: pf.regions(TWO, over=pf.workspace(TWO, resolution=6), limits=False),
    ],
)
def test_arguments_that_would_be_ignored_are_refused(call):
    with pytest.raises(InvalidValueError, match="expected"):
        call()


# --- long calls ----------------------------------------------------------------------------------


LONG = {
    "workspace": lambda **o: pf.workspace(rm.load("puma560"), resolution=25, **o),
    "primary": lambda **o: pf.workspace(TWO, "primary", mask=PLANE, resolution=20, **o),
    "accessibility": lambda **o: pf.accessibility(TWO, rm.dgm(TWO, np.ones((40000, 2))), **o),
    "aspects": lambda **o: pf.aspects(WENGER, **o),
    "free_components": lambda **o: pf.free_components(TWO, Sphere([1.0, 0.4, 0.0], 0.2), **o),
    "regions": lambda **o: pf.regions(TWO, "t", pf.workspace(TWO, resolution=20), **o),
    "cuspidality": lambda **o: pf.cuspidality(WENGER, poses=5, **o),
    "dexterity_map": lambda **o: pf.dexterity_map(
        WENGER, pf.workspace(WENGER, resolution=150), **o
    ),
    "global_index": lambda **o: pf.global_index(TWO, "manipulability", "joints", **o),
}


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", LONG)
def test_long_calls_are_the_same_with_many_workers_and_report_progress(name, pools):
    done = []
    alone = LONG[name](progress=done.append)
    assert done == sorted(done)
    assert done[-1] == pytest.approx(1.0) or name == "cuspidality"
    for pool in pools:
        assert LONG[name](executor=pool) == alone


@pytest.fixture(scope="module")
def pools():
    with (
        ThreadPoolExecutor(3) as threads,
        ProcessPoolExecutor(2, get_context("spawn")) as processes,
    ):
        yield threads, processes


@pytest.mark.parametrize("option", [{"executor": 4}, {"progress": 3}])
def test_workers_of_the_wrong_kind_are_refused(option):
    with pytest.raises(InvalidValueError, match="expected a"):
        pf.aspects(TWO, **option)


def test_caches_keep_no_model_alive():
    """Of this room; the formulas of the last sixteen robots are kept by `explain_singularities`."""
    arm = three(2, 1.5, 1.01)
    assert pf.workspace(arm, resolution=5).area > 0.0
    pf.free_components(arm, resolution=30)
    pf.nodes(arm)
    gone = weakref.ref(arm)
    del arm
    gc.collect()
    assert gone() is None
