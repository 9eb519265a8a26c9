"""Workspaces, singular curves, aspects, cuspidality: published results, identities, refusals."""

import gc
import pickle
import weakref
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
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


def test_a_cusp_is_a_triple_root():
    found = pf.cusps(WENGER)
    assert len(found) == 4
    assert found.residual.max() < 1e-12
    moved = pf.cusps(WENGER.with_base(rotation("x", 0.7) @ translation(0.3, -0.2, 0.5)))
    np.testing.assert_allclose(np.sort(moved.q, axis=0), np.sort(found.q, axis=0), atol=1e-9)
    for q in found.q:
        # along the direction in which the arm moves the tool not, the position changes as s^3
        J = rm.jacobian(WENGER, q)[:3]
        v = np.linalg.svd(J)[2][2]
        left = np.linalg.svd(J)[0][:, 2]
        p = lambda s: rm.dgm(WENGER, q + s * v)[:3, 3]  # noqa: B023, E731
        second = left @ (p(1e-3) - 2 * p(0) + p(-1e-3)) / 1e-6
        assert abs(second) < 1e-5


def test_nodes_change_where_published():
    arm = three(2, 2.6, 1)
    found = pf.nodes(arm)
    assert len(found) > 0
    p = rm.dgm(arm, found.q)[..., :3, 3]  # two configurations reach one point of the section
    points = np.stack((np.hypot(p[..., 0], p[..., 1]), p[..., 2]), axis=-1)
    np.testing.assert_allclose(points[:, 0], points[:, 1], atol=1e-9)
    assert np.abs(found.q[:, 0] - found.q[:, 1]).max() > 1e-3
    A, B = np.hypot(3, 1), np.hypot(1, 1)
    for E in ((A - B) / 2, (A + B) / 2):
        counts = [len(pf.nodes(three(2, d4, 1))) for d4 in (E - 0.01, E + 0.01)]
        assert counts[0] != counts[1]


@pytest.mark.nightly
def test_curves_that_lie_on_each_other_have_no_nodes():
    for alpha in ((0, np.pi / 2, 0), (0, 0, np.pi / 2), (0, np.pi / 2, np.pi / 2)):
        for d in ((0, 0, 0.5), (0, 1, 0.5)):
            table = DHTable(antecedent=[0, 1, 2], sigma=[0, 0, 0], alpha=alpha, d=d,
                            theta=[0, 0.3, 0.2], r=[0, 0, 0])  # fmt: skip
            arm = rm.RobotModel.from_table(table, tool=translation(0.6, 0.1, 0.2))
            assert len(pf.nodes(arm)) <= 4


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


def test_curves_are_singular_and_cut_by_limits():
    curves = pf.singular_curves(WENGER)
    assert sorted(k.value for k in curves.kind) == ["boundary", "internal"]
    for q in curves.joint:
        assert np.linalg.svd(rm.jacobian(WENGER, q)[:, :3], compute_uv=False)[:, 2].max() < 1e-9
    curves = pf.singular_curves(planar(1.0, 0.6, lower=[-1, -2], upper=[1, 2]))
    assert [k.value for k in curves.kind].count("limit") == 4
    for q in curves.joint:
        assert (np.abs(q) <= [1 + 1e-9, 2 + 1e-9]).all()


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
    points = [[[1, 1, 0], [0, 0, 3], [1, 1, 1e-3]]]  # the last off the plane
    np.testing.assert_array_equal(w.contains(points), [[True, False, False]])


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
    w = pf.workspace(LIMITED, resolution=300)
    assert w.grid_area == pytest.approx(w.area, rel=2e-3)
    assert sum(map(shoelace, w.boundary())) == pytest.approx(w.area, rel=1e-5)
    integral = 4.0 * 0.8 * (1 - np.cos(2.0))  # of |sin q2| over the box
    assert w.area_of(1) + 2 * w.area_of(2) == pytest.approx(integral, rel=1e-6)


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


def test_workspaces_of_other_kinds():
    w, other = (pf.workspace(three(2, 1.5, r2), resolution=60) for r2 in (1, -1))
    assert set(np.unique(w.count)) == {0, 2, 4}
    np.testing.assert_array_equal(w.count, rm.igm(WENGER, w.poses, mask=POSITION).count)
    assert w.grid_area == pytest.approx(w.area, rel=5e-3)
    mirrored = other.count.reshape(60, 60)[:, ::-1].ravel()
    assert (w.count == mirrored).mean() > 0.999
    assert w.volume_of(4) == pytest.approx(other.volume_of(4), rel=1e-6)
    puma, R = rm.load("puma560"), rotation("y", 0.4)[:3, :3]
    w = pf.workspace(puma, kind="orientation", orientation=R, resolution=10, limits=False)
    np.testing.assert_array_equal(w.count, rm.igm(puma, w.poses).count)
    w = pf.workspace(puma, limits=False, resolution=100)
    assert w.status is pf.WorkspaceStatus.REACHED_ONLY
    assert set(np.unique(w.count)) == {0, 1}
    p = rm.dgm(puma, np.random.default_rng(1).uniform(-3, 3, (300, 6)))[:, :3, 3]
    assert w.contains(p).mean() > 0.93
    assert not w.contains(2.5 * p / np.linalg.norm(p, axis=1)[:, None]).any()
    # limits of the first joint make space of a section
    arm = three(2, 1.5, 1, lower=[-1, -9, -9], upper=[1, 9, 9])
    w = pf.workspace(arm, resolution=12)
    assert w.points.shape == (1728, 3)
    np.testing.assert_array_equal(pf.accessibility(arm, w.poses, "position").count, w.count)
    free, whole = (
        pf.workspace(TWO, kind, free=body, resolution=40)
        for kind, body in (("free", Sphere([1.0, 0.4, 0.0], 0.2)), ("positions", None))
    )
    assert (free.count <= whole.count).all()
    assert not free.contains([1.0, 0.4])
    none = pf.workspace(TWO, kind="free", free=Sphere([0, 0, 0], 5.0), resolution=20)
    assert none.status is pf.WorkspaceStatus.EMPTY
    assert none.area == 0.0
    four = planar(1.0, 0.8, 0.5, 0.3)
    w = pf.workspace(four, "orientation", orientation=np.eye(3), limits=False, resolution=8)
    assert w.status is pf.WorkspaceStatus.REACHED_ONLY
    w = pf.workspace(SLIDES, resolution=40)
    assert w.volume == pytest.approx(6.0, rel=0.1)
    assert abs(w.volume / 6.0 - 1.0) < w.grid_error < 0.3


def test_what_is_not_defined_has_a_status():
    one, iiwa, rr = planar(1.0), rm.load("iiwa14"), rm.load("lab_rr")
    assert pf.workspace(one).status is pf.WorkspaceStatus.NOT_DEFINED
    assert pf.cusps(one).status is pf.SectionStatus.NOT_DEFINED
    assert pf.singular_curves(rm.load("puma560")).status is pf.SectionStatus.NOT_DEFINED
    for arm in (iiwa, rr):
        found = pf.aspects(arm, limits=False)
        assert found.status is pf.AspectStatus.NOT_DEFINED
        assert (found.of(np.zeros(arm.n)) == -1).all()
    assert pf.regions(iiwa, "t", limits=False).status is pf.RegionStatus.NOT_DEFINED
    assert pf.cuspidality(iiwa).status is pf.CuspidalityStatus.NOT_DEFINED
    assert pf.cuspidality(SLIDES).status is pf.CuspidalityStatus.NOT_CUSPIDAL
    assert pf.aspects(SLIDES).count == 1
    assert pf.isotropy_index(TWO, [0.3, 1.1], [1, 1, 0, 0, 0, 1]) == 0.0  # more rows than joints
    fixed = rm.RobotModel.from_table(DHTable(antecedent=[0], sigma=[2]), tool=translation(1, 0, 0))
    home = rm.dgm(fixed, np.zeros((2, 0)))
    assert (pf.accessibility(fixed, home, "every_orientation").count <= 1).all()
    assert pf.isotropy_index(fixed, np.zeros((2, 0)), POSITION).tolist() == [0.0, 0.0]
    assert pf.global_index(fixed, measure="joints") == 0.0


# --- accessibility -------------------------------------------------------------------------------


def test_accessibility_says_why():
    arm = planar(1, 0.6, lower=[-0.5, 0], upper=[0.5, 2])
    T = rm.dgm(arm, [[0.2, 1.0], [2.5, 1.0], [0.2, 1.0]])
    T[2, :3, 3] *= 3
    found = pf.accessibility(arm, T, level="position")
    S = pf.AccessStatus
    assert found.status.tolist() == [S.ACCESSIBLE, S.ONLY_OUTSIDE_LIMITS, S.OUT_OF_REACH]
    wall = Plane([0.0, -2.0, 0.0], [0.0, 1.0, 0.0])
    assert pf.accessibility(arm, T[0], "position", free=wall).count == 1
    blocked = pf.accessibility(arm, T[0], "position", free=lambda q: q[:, 0] > 9)
    assert blocked.status == pf.AccessStatus.ONLY_IN_COLLISION
    assert pf.accessibility(arm, np.zeros((0, 4, 4))).count.shape == (0,)
    for lower, upper in ((-np.inf, 1.0), (-1.0, np.inf)):
        arm = planar(1.0, 0.6, lower=[lower] * 2, upper=[upper] * 2)
        poses = rm.dgm(arm, [[2.0, 0.5], [-2.0, -2.0]])
        assert pf.accessibility(arm, poses, "position").count.tolist() == [2, 2]
        assert pf.feasible_path(arm, poses[:1]).reached.all()


def test_redundant_arms_reach_what_they_reach_within_their_limits(rng):
    lower, upper = [-0.5, 0.3, -1.5, 0.2], [1.5, 2.0, -0.2, 1.0]
    arm = planar(0.5, 0.4, 0.4, 0.3, lower=lower, upper=upper)
    T = rm.dgm(arm, rng.uniform(lower, upper, (25, 4)))
    for mask in (PLANE, [1, 1, 0, 0, 0, 1]):
        found = pf.accessibility(arm, T, mask=mask)
        assert not found.status.any()
        assert (found.count > 0).all()


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
    scara, mask = rm.load("cobra_s600"), [1, 1, 1, 0, 0, 1]
    w = pf.workspace(scara, "primary", mask=mask, limits=False, resolution=10)
    assert w.count.max() == 2  # in every orientation about one axis
    w = pf.workspace(WENGER, mask=PLANE, limits=False, resolution=40)
    assert w.coordinates == "plane"
    assert w.contains(w.points).sum() == (w.count > 0).sum()


# --- aspects -------------------------------------------------------------------------------------


def test_aspects_of_known_arms():
    puma = rm.load("puma560")
    for arm, count in ((TWO, 2), (WENGER, 2), (puma, 8), (rm.load("ur5e"), 8)):
        found = pf.aspects(arm, limits=False)
        assert found.count == count
        assert found.is_complete
        assert found.volume.sum() == pytest.approx((2 * np.pi) ** arm.n, rel=1e-9)
    q = np.random.default_rng(3).uniform(-3, 3, (50, 6))
    postures = rm.igm(puma, rm.dgm(puma, q)).q
    label = np.sort(pf.aspects(puma, limits=False).of(postures), axis=1)
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


@pytest.mark.parametrize(
    "arms",
    [
        (BESIDE_A_SURFACE[0], *random_arms(8)),  # of the first a level curve is the proof
        pytest.param(random_arms(500, 8), marks=pytest.mark.nightly),
    ],
    ids=["few", "many"],
)
def test_an_orthogonal_arm_is_cuspidal_if_and_only_if_it_has_cusps(arms):
    for p in (*arms, *BESIDE_A_SURFACE[1:], *SWEEP):
        count, cusps = published_cusps(*p)[0], pf.cusps(three(*p))
        assert (*p, len(cusps), cusps.status.name) == (*p, count, "FOUND")
        if p in arms:
            found = pf.cuspidality(three(*p))
            assert (*p, found.status.name) == (*p, "CUSPIDAL" if count else "NOT_CUSPIDAL")
            assert count == 0 or proof_holds(three(*p), found, slice(0, 3))


def test_least_singular_values_have_a_lipschitz_bound_that_proves_paths(rng):
    from robotmodels.performance.singularity import bound_of, certified

    for arm in (WENGER, rm.load("crx10ia"), rm.load("ur5e"), rm.load("lab_rrt")):
        rows = np.arange(6) < (3 if arm.n == 3 else 6)
        bound = bound_of(arm, rows, np.full(arm.n, 3.0))
        a = rng.uniform(-3, 3, (2000, arm.n))
        b = np.clip(a + rng.normal(0, 0.05, a.shape), -3, 3)
        change = np.abs(bound.least(a) - bound.least(b))
        assert (change <= np.abs(a - b) @ bound.slopes + 1e-12).all()
    bound = bound_of(TWO, np.array(PLANE, bool))
    assert certified(bound, np.array([[0.0, 0.5], [1.0, -0.5]])) == 0.0
    path = np.array([[0.0, 0.5], [1.0, 1.5]])
    dense = path[0] + np.linspace(0, 1, 500)[:, None] * (path[1] - path[0])
    assert 0.0 < certified(bound, path) <= bound.least(dense).min()


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
    if arm is LIMITED and free is None:
        gap = pf.workspace(arm, "free", free=lambda q: np.abs(q[:, 0]) > 0.3, resolution=50)
        assert pf.regions(arm, "n", gap).count == 2
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


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: pf.workspace("puma560"), InvalidValueError, "load it first"),
        (lambda: pf.workspace(TWO, resolution=10**6), InvalidValueError, "whole number"),
        (lambda: pf.workspace(TWO, "free"), InvalidValueError, "obstacles"),
        (lambda: pf.workspace(TWO, mask=[1, 1, 0, 0, 0, 1]), InvalidValueError, "orientation"),
        (lambda: pf.workspace(TWO, resolution=6).contains([np.nan, 0]), InvalidValueError, "nan"),
        (lambda: pf.workspace(TWO, free=lambda q: 1), ShapeError, "bool"),
        (lambda: pf.workspace(rm.load("gantry").with_table(
            replace(rm.load("gantry").table, lower=[-np.inf] * 6, upper=[np.inf] * 6)
        )), InvalidValueError, "slides without limits"),
        (lambda: pf.workspace(three(2, 1, 1, lower=[-1] * 3, upper=[1] * 3), section="plane"),
         InvalidValueError, "section='space'"),
        (lambda: pf.workspace(SLIDES, resolution=5).boundary(), InvalidValueError, "cells only"),
        (lambda: pf.feasible_path(TWO, np.eye(4)), ShapeError, "N, 4, 4"),
        (lambda: pf.feasible_path(TWO, [np.eye(4)], through_singular="no"), InvalidValueError,
         "through_singular: expected True or False"),
        (lambda: pf.regions(WENGER, "t", pf.workspace(TWO, resolution=5)), InvalidValueError,
         "workspace of"),
        (lambda: pf.regions(TWO, over=pf.workspace(TWO, resolution=6), limits=False),
         InvalidValueError, "expected"),
        (lambda: pf.global_index(TWO, over=pf.workspace(TWO, "free", free=lambda q: q[:, 0] > 9,
                                                        resolution=4)),
         InvalidValueError, "nothing is reached"),
    ],
)  # fmt: skip
def test_mistakes_are_refused(call, error, words):
    with pytest.raises(error, match=words):
        call()


def test_results_are_values_and_caches_keep_no_model():
    bodies, w = [Sphere([1.2, 0, 0], 0.2)], pf.workspace(TWO, resolution=6)
    free = pf.workspace(TWO, "free", free=bodies, resolution=6)
    bodies.clear()  # obstacles are kept by value
    assert len(free.free) == 1
    for found in (
        w, free, pf.singular_curves(TWO), pf.cusps(WENGER), pf.aspects(TWO, resolution=20),
        pf.cuspidality(TWO), pf.regions(TWO, "n", w), pf.accessibility(TWO, np.eye(4)),
        pf.feasible_path(TWO, rm.dgm(TWO, [[0.1, 1.0], [0.2, 1.0]])), pf.dexterity_map(TWO, w),
        pf.polytope(rm.load("ur5e"), np.ones(6), mask="position"), pf.global_index(TWO, over=w),
    ):  # fmt: skip
        again = pickle.loads(pickle.dumps(found))
        assert len(repr(found).splitlines()) <= 6
        assert again == found
        assert hash(again) == hash(found)
        arrays = [getattr(again, name) for name in again.__slots__]
        assert not any(a.flags.writeable for a in arrays if isinstance(a, np.ndarray))
    arm = three(2, 1.5, 1.01)
    assert pf.workspace(arm, resolution=5).area > 0.0
    pf.free_components(arm, resolution=30)
    pf.nodes(arm)
    gone = weakref.ref(arm)
    del arm
    gc.collect()
    assert gone() is None


def test_components_that_leave_a_family():
    poses = [translation(0.1, 0, 0), translation(0.1, 1, 0)]
    found = pf.accessibility(TWO, poses, mask=[1, 0, 0, 0, 0, 0])
    assert (found.status == pf.AccessStatus.ACCESSIBLE).all()
    tilted = rm.RobotModel.from_table(
        DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 1], alpha=[0.5, 0]),
        tool=translation(0.5, 0, 0),
    )
    assert pf.accessibility(tilted, rm.dgm(tilted, [0.3, 0.7]), mask=PLANE).count == 2


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
