"""Singular configurations: what is lost and gained at known ones, and the search for them."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from identities.random_robots import models, random_pose, random_state

import robotmodels as rm
from robotmodels.kinematics import (
    NearestStatus,
    SearchOutcome,
    SelfMotionKind,
    SingularityKind,
    SingularityStatus,
    WorkspaceSide,
    classify_singularity,
    jacobian_rank,
    nearest_singularity,
    singularity_flags,
)

PI = np.pi
SHOULDER, ELBOW, WRIST, OTHER = SingularityKind
UNDECIDED, BOUNDARY = WorkspaceSide.UNDECIDED, WorkspaceSide.BOUNDARY
FINITE, INFINITESIMAL = SelfMotionKind.FINITE, SelfMotionKind.INFINITESIMAL
# RX-90: S23 RL4 - C2 D3 = 0 with RL4 = D3 where q2 + q3 = pi/2 - q2
RX90 = {
    "wrist": [0.1, 0.2, 0.3, 0.4, 0.0, 0.6],
    "elbow": [0.1, 0.2, -PI / 2, 0.4, 0.5, 0.6],
    "shoulder": [0.1, 0.3, PI / 2 - 0.6, 0.4, 0.5, 0.6],
}
IIWA = np.array([0.1, 0.4, 0.3, 0.8, 0.5, 0.9, 0.7])


def iiwa(**values):
    q = IIWA.copy()
    for name, value in values.items():
        q[int(name[1]) - 1] = value
    return q


# robot, configuration: order, kinds, side, first words
KNOWN = {
    "ur5 wrist": ("ur5", [0.1, -1, 1.2, 0.4, 0, 0.6], 1, (WRIST,), UNDECIDED),
    "ur5 elbow": ("ur5", [0.1, -1, 0, 0.4, 0.5, 0.6], 1, (ELBOW,), BOUNDARY),
    "puma elbow": (
        "puma560", [0.1, 0.2, -PI / 2 + np.arctan2(0.0203, 0.4318), 0.4, 0.5, 0.6],
        1, (ELBOW,), BOUNDARY,
    ),
    "stanford axis": ("stanford_arm", [0.1, 0, 0.3, 0.4, 0.5, 0.6], 1, (SHOULDER,), BOUNDARY),
    "scara stretched": ("cobra_s600", [0.1, 0, 0.1, 0.4], 1, (ELBOW,), BOUNDARY),
    "scara folded": ("cobra_s600", [0.1, PI, 0.1, 0.4], 1, (ELBOW,), BOUNDARY),
    "planar stretched": ("planar_3r", [0.1, 0, 0.3], 1, (ELBOW,), BOUNDARY),
    "gantry wrist": ("gantry", [0.5, 0.5, 0.5, 0.1, 0, 0.3], 1, (WRIST,), UNDECIDED),
    "iiwa elbow": ("iiwa14", iiwa(q4=0), 1, (ELBOW,), UNDECIDED),
    "iiwa shoulder": ("iiwa14", iiwa(q2=0, q3=PI / 2), 1, (SHOULDER,), WorkspaceSide.INTERIOR),
    "iiwa wrist": ("iiwa14", iiwa(q6=0, q5=PI / 2), 1, (WRIST,), WorkspaceSide.INTERIOR),
    "iiwa both ends": ("iiwa14", iiwa(q2=0, q6=0), 1, (SHOULDER, WRIST), UNDECIDED),
}  # fmt: skip


def check_duality(arm, report, mask=None):
    """Lost wrenches do no work, self-motions move nothing: the definitions, by the Jacobian."""
    J = rm.jacobian(arm, report.q)
    scale = max(1.0, float(np.abs(J).max()))
    rows = report.lost_in_world.wrenches
    if rows.size:
        assert np.abs(rows @ J).max() < 1e-8 * scale
    asked = slice(None) if mask is None else np.array(mask, bool)
    for motion in report.self_motions:
        assert np.abs(J[asked] @ motion.velocity).max() < 1e-8 * scale
    # in the chosen frame: the twists of the joints there, from the poses alone
    lost = report.lost
    links = rm.link_poses(arm, report.q)
    poses = {None: rm.dgm(arm, report.q), 0: arm.base, -1: np.eye(4)}
    poses |= {j + 1: T for j, T in enumerate(links)}
    A, P, T = poses[lost.axes], poses[lost.point], poses[None]
    lever = P[:3, 3] - T[:3, 3]
    v = J[:3] + np.cross(J[3:].T, lever).T
    there = np.vstack([A[:3, :3].T @ v, A[:3, :3].T @ J[3:]])
    if lost.wrenches.size:
        assert np.abs(lost.wrenches @ there).max() < 1e-8 * scale


@pytest.mark.parametrize("name", RX90)
def test_rx90_by_name(name):
    arm = rm.load("rx90")
    report = classify_singularity(arm, RX90[name])
    assert report.status is SingularityStatus.SINGULAR
    assert (report.dimension, report.rank, report.order, report.gained) == (6, 5, 1, 1)
    assert report.kinds == (SingularityKind[name.upper()],)
    assert report.weakest < 1e-15
    assert report.gap > 1e10
    check_duality(arm, report)
    assert len(report.self_motions) == 1
    motion = report.self_motions[0]
    if name == "wrist":
        assert report.words == ("wrist: axes 4 and 6 are aligned",)
        np.testing.assert_allclose(motion.velocity, [0, 0, 0, 1, 0, -1], atol=1e-13)
        assert (motion.joints, motion.kind, report.side) == ((4, 6), FINITE, UNDECIDED)
        # in R4 the moment is about x4 alone: the turn about x4 is what the wrist has lost
        book = classify_singularity(arm, RX90[name], axes=4, point=4).lost
        assert (book.axes, book.point) == (4, 4)
        wrench = book.wrenches[0] / book.wrenches[0, 3]
        np.testing.assert_allclose(wrench[3:], [1, 0, 0], atol=1e-13)
    elif name == "elbow":
        assert report.words[0].endswith("the arm is stretched or folded")
        assert (report.lost.axes, report.lost.point) == (4, 4)
        np.testing.assert_allclose(report.lost.wrenches, [[0, 0, 1, 0, 0, 0]], atol=1e-13)
        np.testing.assert_allclose(report.lost.twists, [[0, 0, 1, 0, 0, 0]], atol=1e-13)
        assert {2, 3} <= set(motion.joints)
        assert 1 not in motion.joints
        assert (motion.kind, report.side) == (INFINITESIMAL, BOUNDARY)
        # the arm can only be shortened
        shoulder = rm.link_poses(arm, report.q)[1, :3, 3]
        outwards = rm.dgm(arm, report.q)[:3, 3] - shoulder
        assert report.open_twist[:3] @ outwards < -0.5
    else:
        assert report.words == ("shoulder: the wrist centre is on axis 1",)
        assert report.lost.axes in (2, 3)  # along the parallel axes 2 and 3, at the wrist centre
        np.testing.assert_allclose(report.lost.wrenches, [[0, 0, 1, 0, 0, 0]], atol=1e-13)
        assert motion.joints == (1, 4, 5, 6)
        assert (motion.kind, report.side) == (FINITE, UNDECIDED)
    assert report.words[0] in str(report)


@pytest.mark.parametrize("name", KNOWN)
def test_known_singular_configurations(name):
    robot, q, order, kinds, side = KNOWN[name]
    arm = rm.load(robot)
    report = classify_singularity(arm, q)
    assert report.order == order, report
    assert report.kinds == kinds, report
    assert report.side is side, report
    assert len(report.self_motions) == arm.n - report.rank
    check_duality(arm, report)


def test_lost_directions_have_the_sign_of_the_book():
    """SCARA and planar arms, stretched along x: the radial direction, seen in a link's axes."""
    scara = classify_singularity(rm.load("cobra_s600"), [0.1, 0, 0.1, 0.4])
    assert scara.lost.combinations == ("vx",)
    assert scara.lost.carried == ("fx",)
    assert "the tool point is in the plane of axes 1 and 2" in scara.words[0]
    np.testing.assert_allclose(scara.open_twist[:2], -0.6 * np.array([np.cos(0.1), np.sin(0.1)]))
    folded = classify_singularity(rm.load("cobra_s600"), [0.1, PI, 0.1, 0.4])
    assert folded.open_twist[0] > 0.5
    mask = [1, 1, 1, 0, 0, 0]
    planar = rm.load("planar_2r")
    report = classify_singularity(planar, [0.1, 0.0], mask=mask)
    check_duality(planar, report, mask)
    assert report.kinds == (ELBOW,)
    assert report.side is BOUNDARY
    np.testing.assert_allclose(report.self_motions[0].velocity, [-0.5, 1.0])
    np.testing.assert_allclose(report.lost_in_world.wrenches[0, :2], [1.0, np.tan(0.1)])
    whole = classify_singularity(planar, [0.1, 0.0], mask=[1] * 6)
    assert whole.status is SingularityStatus.REGULAR


@pytest.mark.parametrize("name", RX90)
def test_invariance_under_base_and_tool(name):
    rng = np.random.default_rng(4)
    arm = rm.load("rx90")
    here = classify_singularity(arm, RX90[name], axes=4, point=4)
    moved = arm.with_base(random_pose(rng))
    there = classify_singularity(moved, RX90[name], axes=4, point=4)
    np.testing.assert_allclose(there.singular_values, here.singular_values, atol=1e-13)
    np.testing.assert_allclose(there.lost.wrenches, here.lost.wrenches, atol=1e-11)
    assert (there.kinds, there.words, there.side) == (here.kinds, here.words, here.side)
    check_duality(moved, there)
    tooled = moved.with_tool(random_pose(rng, 0.2))
    report = classify_singularity(tooled, RX90[name], length=0.9, axes=4, point=4)
    assert (report.kinds, report.words, report.side) == (here.kinds, here.words, here.side)
    np.testing.assert_allclose(report.lost.wrenches, here.lost.wrenches, atol=1e-11)
    check_duality(tooled, report)
    wrist = classify_singularity(tooled, RX90[name], frame=6)
    assert wrist.kinds == here.kinds


def test_flags():
    arm = rm.load("rx90")
    q = random_state(arm, np.random.default_rng(0), 2, 2)[0]
    q[..., 4] = [[0.0, 1e-4], [0.5, 1.0]]
    found = singularity_flags(arm, q)
    np.testing.assert_array_equal(found.rank, [[5, 6], [6, 6]])
    np.testing.assert_array_equal(found.order, [[1, 0], [0, 0]])
    sigma = jacobian_rank(arm, q).singular_values
    ratio = sigma[..., 5] / sigma[..., 0]
    np.testing.assert_allclose(found.weakest, ratio, atol=1e-15)
    np.testing.assert_array_equal(found.status, np.where(found.rank < 6, 2, ratio < 1e-2))
    assert {*found.status.flat} == {0, 1, 2}
    assert found.reason((0, 1)) == SingularityStatus.NEAR_SINGULAR.sentence


@settings(max_examples=15)
@given(case=models(max_frames=7))
def test_reports_of_random_robots(case):
    """At any configuration the report is consistent with the Jacobian."""
    q = random_state(case, np.random.default_rng(3))[0]
    report = classify_singularity(case, q)
    sigma = report.singular_values
    assert report.order == report.dimension - report.rank == report.gained
    moving = int(sum(case.table.sigma[j - 1] != 2 for j in case.twin.frame(None).path))
    assert len(report.self_motions) == moving - report.rank
    if len(sigma) > report.rank and sigma[0] > 0:
        assert sigma[report.rank] <= 1e-8 * sigma[0]
    check_duality(case, report)
    str(report)


def test_a_report_is_a_value_and_its_axes_can_be_chosen():
    arm, q = rm.load("rx90"), RX90["elbow"]
    assert pickle.loads(pickle.dumps(classify_singularity(arm, q))).kinds == (ELBOW,)
    in_arm = classify_singularity(arm, q, mask=[1, 1, 1, 0, 0, 0], axes=4)
    assert in_arm.lost.combinations == ("vz",)


# --- search ------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(2))
def test_rx90_closed_forms(seed):
    """The three surfaces C3 = 0, S5 = 0 and S23 RL4 - C2 D3 = 0, each at its nearest point."""
    arm = rm.load("rx90")
    q = np.random.default_rng(seed).uniform(-1.3, 1.3, size=6)
    found = nearest_singularity(arm, q)
    assert found.outcome is SearchOutcome.FOUND
    assert (np.diff(found.distance) >= 0).all()
    assert (found.residual <= 1e-10).all()
    assert (found.stationarity <= 1e-7).all()
    wrist, elbow, shoulder = (found.of(kind) for kind in (WRIST, ELBOW, SHOULDER))
    np.testing.assert_allclose(found.distance[wrist], abs(q[4]), atol=1e-9)
    np.testing.assert_allclose(found.q[wrist], np.where(np.arange(6) == 4, 0, q), atol=1e-9)
    np.testing.assert_allclose(
        found.distance[elbow], min(abs(q[2] - PI / 2), abs(q[2] + PI / 2)), atol=1e-9
    )
    # with RL4 = D3 the shoulder is singular where 2 q2 + q3 = pi/2, and where the arm is folded
    away = 2 * q[1] + q[2] - PI / 2
    expected = abs(away - 2 * PI * np.rint(away / (2 * PI))) / np.sqrt(5)
    folded = abs(q[2] - PI / 2)
    np.testing.assert_allclose(found.distance[shoulder], min(expected, folded), atol=1e-8)
    S23, C2 = np.sin(found.q[shoulder, 1] + found.q[shoulder, 2]), np.cos(found.q[shoulder, 1])
    assert abs(0.45 * S23 - 0.45 * C2) < 1e-9
    # direction and distance lead there, and the weakest singular value rises on the way back
    np.testing.assert_allclose(q + found.distance[:, None] * found.direction, found.q, atol=1e-12)
    np.testing.assert_allclose(found.escape, -found.direction, atol=1e-6)
    for i in range(found.count):
        ahead = singularity_flags(arm, found.q[i] + 1e-4 * found.escape[i])
        top = jacobian_rank(arm, found.q[i]).singular_values[0]
        np.testing.assert_allclose(ahead.weakest * top, 1e-4 * found.slope[i], rtol=1e-2)
    assert "wrist" in str(found)


def test_limits_are_respected():
    arm = rm.load("rx90")
    q = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    free = nearest_singularity(arm, q)
    lower, upper = arm.lower.copy(), arm.upper.copy()
    upper[1], lower[4] = 0.45, 0.1  # the nearest shoulder has q2 = 0.548, the wrist q5 = 0
    tight = arm.with_table(arm.table.replace(lower=lower, upper=upper))
    found = nearest_singularity(tight, q, limits=True)
    assert (found.q >= lower - 1e-12).all()
    assert (found.q <= upper + 1e-12).all()
    i = found.of(SHOULDER)
    assert found.status[i] == NearestStatus.AT_LIMIT
    np.testing.assert_allclose(found.q[i, 1], 0.45, atol=1e-9)
    # along 2 q2 + q3 = pi/2 to the limit of q2
    expected = np.hypot(0.45 - q[1], PI / 2 - 2 * 0.45 - q[2])
    np.testing.assert_allclose(found.distance[i], expected, atol=1e-8)
    assert found.distance[i] > free.distance[free.of(SHOULDER)]
    # a start outside the limits
    outside = nearest_singularity(tight, q + 3.0, limits=True)
    assert outside.count
    assert (outside.q <= upper + 1e-12).all()


def test_given_configuration_that_is_singular():
    arm = rm.load("rx90")
    found = nearest_singularity(arm, RX90["wrist"])
    assert found.outcome is SearchOutcome.ALREADY_SINGULAR
    assert found.distance[0] < 1e-12
    assert found.kind[0] == (WRIST,)
    np.testing.assert_allclose(np.abs(found.escape[0]), [0, 0, 0, 0, 1, 0], atol=1e-9)
    i = found.of(ELBOW)
    assert i is not None
    assert found.of(SHOULDER) is not None
    assert (found.residual < 1e-10).all()


@settings(max_examples=8)
@given(case=models(max_frames=7, limits=False))
def test_search_on_random_robots(case):
    """What is found is singular, and the way to it is normal to the set it is on."""
    home = random_state(case, np.random.default_rng(5))[0]
    found = nearest_singularity(case, home, starts=16, most=4)
    for i in range(found.count):
        report = classify_singularity(case, found.q[i])
        assert report.order >= 1
        assert found.residual[i] <= 1e-10
        if found.status[i] != NearestStatus.NEAREST or found.codimension[i] != 1:
            continue
        if found.distance[i] < 1e-6 or found.slope[i] < 1e-3:
            continue
        step = 1e-3 * found.escape[i]
        ahead = singularity_flags(case, found.q[i] + step).weakest * report.singular_values[0]
        np.testing.assert_allclose(ahead, 1e-3 * found.slope[i], rtol=0.1)
        np.testing.assert_allclose(found.escape[i], -found.direction[i], atol=1e-5)


KINDS = (
    "lab_rr", "lab_rrt", "lab_trr", "planar_2r", "planar_3r", "gantry", "rx90", "tx40", "puma560",
    "stanford_arm", "cobra_s600", "ur5", "kr6_r900", "iiwa14", "xarm5",
)  # fmt: skip


@pytest.mark.sampled(5)
@pytest.mark.parametrize("name", KINDS)
def test_kinds_are_those_of_the_factors_that_vanish(name):
    """At zeros of each factor alone, and of those of each condition together."""
    arm = rm.load(name)
    explained = rm.explain_singularities(arm)
    rng = np.random.default_rng(5)
    slides = arm.table.sigma[arm.table.joint_rows] == 1
    looked = 0
    for condition in explained.conditions:
        for k in range(2):
            q = np.where(slides, rng.uniform(0.2, 0.8, arm.n), rng.uniform(-2.5, 2.5, arm.n))
            own = condition.factors
            if any(f.never_zero or f.solved_joint is None for f in own):
                continue
            for factor in own:
                zeros = factor.zeros(q)
                zeros = zeros[~np.isnan(zeros)]
                if len(zeros):
                    q[factor.solved_joint] = zeros[k % len(zeros)]
            # factors of shared joints, or none of these values
            if max(float(np.abs(f.values(q))) for f in own) > 1e-12:
                continue
            looked += 1
            report = classify_singularity(arm, q)
            vanishing = {f.kind for f in own}
            if len(own) == 1:
                vanishing = {f.kind for f in explained.factors if np.abs(f.values(q)) < 1e-9}
            assert report.status is SingularityStatus.SINGULAR
            assert set(report.kinds) == vanishing, report
            assert [text.split(":")[0] for text in report.words[: len(report.kinds)]] == [
                kind.value for kind in report.kinds
            ]
    assert looked


def test_weak_directions_and_the_sets_near_by():
    """Near a singular configuration: near which sets, and which direction is weak."""
    arm = rm.load("rx90")
    report = classify_singularity(arm, [0, 1, -1.571, 0, 0.5, 0])
    assert (report.status, report.kinds) == (SingularityStatus.NEAR_SINGULAR, ())
    assert report.near_kinds == (ELBOW,)
    assert report.weak.where == "axes of R4, at the origin of R4"
    assert report.weak.rounded(0.02) == ("vz",)
    assert "near elbow: " in str(report)
    # the weak wrench is felt, but hardly
    felt = report.weak.wrenches[0]
    J = rm.jacobian(arm, report.q, frame=4, reference="local")
    assert 1e-6 < np.linalg.norm(felt @ J[:, :4]) < 1e-3
    both = classify_singularity(arm, [0, 1, -1.571, 0, 0, 0])
    assert (both.kinds, both.near_kinds) == ((WRIST,), (ELBOW,))
    assert (both.order, len(both.lost.wrenches), len(both.weak.wrenches)) == (1, 1, 1)
    for q in ([0.1, 0.2, 0.3, 0.4, 0.5, 0.6], RX90["wrist"]):
        report = classify_singularity(arm, q)
        assert (report.near_kinds, report.near_words, len(report.weak.wrenches)) == ((), (), 0)
    beside = classify_singularity(arm, RX90["shoulder"] + 1e-3 * np.eye(6)[1])
    assert (beside.kinds, beside.near_kinds) == ((), (SHOULDER,))
    planar = classify_singularity(rm.load("planar_2r"), [0.3, 1e-3])
    assert planar.near_kinds == (ELBOW,)
