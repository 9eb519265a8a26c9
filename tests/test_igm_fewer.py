"""Arms of one to five joints against their own direct model and an independent search."""

from functools import cache

import numpy as np
import pytest

from robotmodels import se3
from robotmodels.igm.alike import prepare_alike
from robotmodels.igm.dependent import DependentJoints
from robotmodels.igm.families import prepare
from robotmodels.igm.fewer import FewerJoints, prepare_fewer
from robotmodels.igm.loop import JointChain, joint_chain
from robotmodels.igm.self_motion import settle_families
from robotmodels.igm.solver import Tolerances, postures
from robotmodels.kinematics import dgm
from robotmodels.robots import load

EXACT = Tolerances()
CATALOGUE = ("lab_rr", "lab_rrt", "lab_trr", "planar_2r", "planar_3r", "cobra_s600", "xarm5")
# joint kinds, and which constants between joints leave neighbouring axes parallel
RANDOM = (
    "R", "P", "RR", "RP", "PR", "PP", "RR/1",
    "RRR", "RRP", "RPR", "PRR", "RPP", "PRP", "PPR", "PPP", "RRR/12", "RRP/1", "RPR/1",
    "RRRR", "RRRP/12", "RRPR/1", "PRRR/23", "RPRP", "PPRR", "PPPR",
    "RRRRR/23", "RRRRR/4", "PRRRR/2",
)  # fmt: skip
SLOW = ("RRRRR", "RRRRP")  # no closed form


@cache
def arm(word):
    """An arm of the catalogue, or one with random constants: rotated base, offsets and tool."""
    if word.islower():
        return joint_chain(load(word))
    kinds, _, parallel = word.partition("/")
    rng = np.random.default_rng(sum(map(ord, word)))
    D = np.tile(np.eye(4), (len(kinds) + 1, 1, 1))
    for i in range(len(D)):
        D[i, :3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        D[i, :3, 0] *= np.linalg.det(D[i, :3, :3])
        D[i, :3, 3] = rng.uniform(-0.5, 0.5, 3)
    for i in map(int, parallel):
        D[i, :3, :3] = se3.rotation("z", rng.uniform(-3, 3))[:3, :3]
    return JointChain(
        np.arange(len(kinds)), np.array([int(kind == "P") for kind in kinds]), D, np.eye(4)
    )


@cache
def solver(word):
    return prepare_fewer(arm(word), prepare)


def tool(chain, q):
    """Tool in R_0 at ``q (..., k)``, multiplied out here on its own."""
    T = np.broadcast_to(chain.D[0], (*q.shape[:-1], 4, 4))
    for k in range(chain.k):
        M = np.zeros((*q.shape[:-1], 4, 4))
        c, s = (np.cos(q[..., k]), np.sin(q[..., k])) if chain.sigma[k] == 0 else (1.0, 0.0)
        M[..., 0, 0], M[..., 0, 1], M[..., 1, 0], M[..., 1, 1] = c, -s, s, c
        M[..., 2, 2] = M[..., 3, 3] = 1.0
        M[..., 2, 3] = 0.0 if chain.sigma[k] == 0 else q[..., k]
        T = T @ M @ chain.D[k + 1]
    return T


def random_q(chain, count, seed=0):
    rng = np.random.default_rng(seed)
    q = rng.uniform(-np.pi, np.pi, (count, chain.k))
    return np.where(chain.sigma == 0, q, 0.2 * q)


def gaps(chain, found, q):
    """Largest difference in a joint between postures (..., k); angles round the circle."""
    d = found - q
    return np.abs(np.where(chain.sigma == 0, (d + np.pi) % (2 * np.pi) - np.pi, d)).max(axis=-1)


def lost(chain, found, q, within):
    """Poses of ``q (N, k)`` for which no posture is near it."""
    near = np.where(found.valid, gaps(chain, found.q, q[:, None]), np.inf)
    return np.flatnonzero(near.min(axis=1, initial=np.inf) > within)


def check(chain, U, found, accuracy=1e-9):
    """What every answer owes: packed rows, angles in (-pi, pi], poses met, distinct postures."""
    valid = found.valid
    assert np.all(np.isnan(found.q) == ~valid[..., None])
    assert np.all(np.diff(valid.astype(int), axis=1) <= 0)
    turns = found.q[valid][:, chain.sigma == 0]
    assert np.all((turns > -np.pi) & (turns <= np.pi))
    n, s = np.nonzero(valid)
    error = np.abs(tool(chain, found.q[n, s]) - U[n]).max(axis=(1, 2), initial=0.0)
    assert np.all(error <= accuracy)
    assert np.all(found.residual[n, s] <= accuracy)
    for i in range(valid.shape[1]):
        for j in range(i):
            both = valid[:, i] & valid[:, j]
            assert np.all(gaps(chain, found.q[both, i], found.q[both, j]) > 1e-6)
    assert not np.any(found.free & ~valid[..., None])
    assert not np.any((found.double | found.family) & ~valid)


def newton_postures(chain, U, starts=100):
    """All postures that damped Newton steps reach from spread starts, slopes by differences."""

    def missing(q):
        T = tool(chain, q)
        return np.concatenate(
            [(T[:, :3, 3] - U[:3, 3]), (T[:, :3, :3] - U[:3, :3]).reshape(-1, 9)], axis=1
        )

    q = random_q(chain, starts, 9)
    damping, e = np.full(starts, 1e-2), missing(q)
    for _ in range(80):
        J = np.stack([(missing(q + d) - missing(q - d)) / 2e-6 for d in 1e-6 * np.eye(chain.k)], -1)
        Jt = np.swapaxes(J, 1, 2)
        step = np.linalg.solve(
            Jt @ J + damping[:, None, None] * np.eye(chain.k), -Jt @ e[..., None]
        )
        trial = missing(q + step[..., 0])
        better = np.sum(trial**2, axis=1) < np.sum(e**2, axis=1)
        q, e = np.where(better[:, None], q + step[..., 0], q), np.where(better[:, None], trial, e)
        damping = np.clip(np.where(better, 0.2, 5.0) * damping, 1e-9, 1e6)
    distinct = []
    for x in q[np.abs(e).max(axis=1) < 1e-8]:
        if all(gaps(chain, x, y) > 1e-3 for y in distinct):
            distinct.append(x)
    return np.array(distinct).reshape(-1, chain.k)


@pytest.mark.parametrize("word", CATALOGUE + RANDOM + SLOW)
def test_random_poses_give_their_posture_back(word):
    chain = arm(word)
    assert isinstance(solver(word), FewerJoints)
    assert str(6 - chain.k) in solver(word).method
    q = random_q(chain, 60 if word in SLOW else 300)
    U = tool(chain, q)
    found = postures(solver(word), U, np.zeros_like(q), EXACT)
    check(chain, U, found, 1e-11)
    assert lost(chain, found, q, 1e-6).size == 0
    assert not found.family.any()
    one = postures(solver(word), U[:1], np.zeros((1, chain.k)), EXACT)
    S = found.valid[0].sum()
    np.testing.assert_array_equal(one.valid[0].sum(), S)
    np.testing.assert_array_equal(one.q[0, :S], found.q[0, :S])


@pytest.mark.parametrize(
    "word", ["lab_rrt", "planar_3r", "cobra_s600", "xarm5", "RRR", "RPR/1", "RRRR", "RRRRR/23"]
)
def test_as_many_postures_as_an_independent_search(word):
    chain = arm(word)
    q = random_q(chain, 3, 1)
    U = tool(chain, q)
    found = postures(solver(word), U, np.zeros_like(q), EXACT)
    for n in range(len(q)):
        others = newton_postures(chain, U[n])
        assert len(others) == found.valid[n].sum()
        mine = found.q[n, found.valid[n]]
        assert gaps(chain, mine[None], others[:, None]).min(axis=1).max() < 1e-5


@pytest.mark.parametrize(
    "word", ["lab_rrt", "lab_trr", "cobra_s600", "xarm5", "RRR", "RRP", "RRRR"]
)
def test_round_angles_and_what_lies_beside_them(word):
    # right angles everywhere: arms stretched, folded, axes aligned
    chain, rng = arm(word), np.random.default_rng(2)
    q = rng.integers(-1, 3, (150, chain.k)) * np.pi / 2
    q = np.where(chain.sigma == 1, 0.1 * q, q)
    for aside in (0.0, 1e-9, 1e-6, 1e-3):
        beside = q + aside * rng.normal(size=q.shape)
        U = tool(chain, beside)
        found = postures(solver(word), U, beside, EXACT)
        check(chain, U, found)
        assert lost(chain, found, beside, 1e-5).size == 0


def test_a_stretched_arm_is_a_double_root():
    # the elbow of a SCARA straight: both postures are one
    chain = arm("cobra_s600")
    for elbow, double in ((0.0, True), (0.4, False)):
        U = tool(chain, np.array([[0.3, elbow, 0.1, 0.5]]))
        found = postures(solver("cobra_s600"), U, np.zeros((1, 4)), EXACT)
        assert found.valid.sum() == (1 if double else 2)
        assert bool(found.double[found.valid].all()) == double
        assert not found.family.any()


def test_unreachable_poses_have_no_posture():
    chain = arm("lab_trr")
    U = tool(chain, random_q(chain, 20))
    for aside in (1e-6, 1e-3, 0.3):
        away = U.copy()
        away[:, 0, 3] += aside * 2.0  # out of the plane of the arm, or too far in it
        away[:, :3, :3] = away[:, :3, :3] @ se3.rotation("x", aside)[:3, :3]
        found = postures(solver("lab_trr"), away, np.zeros((20, 3)), EXACT)
        assert not found.valid.any()


def test_the_pose_of_the_exercise_with_four_digits():
    arm_of_lab = load("lab_trr")
    A = dgm(arm_of_lab, [-0.3, -np.pi / 4, -np.pi / 4]).round(4)
    U = joint_chain(arm_of_lab).base @ A
    found = postures(solver("lab_trr"), U[None], np.zeros((1, 3)), Tolerances(1e-4, 1e-4))
    assert found.valid.sum() == 1
    np.testing.assert_allclose(found.q[0, 0], [-0.3, -np.pi / 4, -np.pi / 4], atol=1e-4)
    assert 1e-6 < found.residual[0, 0] <= 1e-4
    assert not postures(solver("lab_trr"), U[None], np.zeros((1, 3)), EXACT).valid.any()


@pytest.mark.parametrize("word", ["lab_rr", "lab_trr", "xarm5", "RRR", "PRR", "RRRR", "RRRRR/23"])
def test_poses_with_few_digits(word):
    chain, rng = arm(word), np.random.default_rng(3)
    q = random_q(chain, 100, 3)
    q[:40] = np.where(chain.sigma == 0, (q[:40] / np.pi).round() * np.pi / 2, q[:40])
    U = tool(chain, q)
    U[:, :3, 3] += rng.uniform(-1e-5, 1e-5, (100, 3))
    for n in range(100):
        U[n, :3, :3] = U[n, :3, :3] @ se3.from_rpy(rng.uniform(-1e-5, 1e-5, 3))[:3, :3]
    found = postures(solver(word), U, q, Tolerances(1e-4, 1e-4))
    check(chain, U, found, 2e-4)
    # beside a fold an angle is good to the root of what the pose is off by
    assert lost(chain, found, q, 3e-2).size == 0
    # no posture more, none less, but for pairs that the digits cannot tell apart
    exact = postures(solver(word), tool(chain, q), q, EXACT)
    n, i, j = np.nonzero(exact.valid[:, :, None] & exact.valid[:, None])
    close = (i < j) & (gaps(chain, exact.q[n, i], exact.q[n, j]) < 0.03)
    clear = np.setdiff1d(np.arange(40, 100), n[close])
    assert clear.size > 50
    np.testing.assert_array_equal(found.valid[clear].sum(axis=1), exact.valid[clear].sum(axis=1))


def test_a_superfluous_joint_takes_its_reference():
    # four parallel axes: the plane asks for three
    chain = arm("RRRR/123")
    planar = prepare_fewer(chain, prepare)
    assert isinstance(planar, DependentJoints)
    q = random_q(chain, 30)
    U = tool(chain, q)
    found = postures(planar, U, q, EXACT)
    check(chain, U, found)
    assert lost(chain, found, q, 1e-6).size == 0
    assert found.family[found.valid].all()
    assert found.free[found.valid][:, 0].all()
    # the reference out of reach: a member of the family, then the nearest one
    references = np.zeros_like(q)
    found = postures(planar, U, references, EXACT)
    assert found.valid.any(axis=1).sum() >= 29
    settled = settle_families(chain, U, found, references, EXACT)
    check(chain, U, settled)
    assert settled.free[settled.valid][:, 0].all()


def test_joints_that_a_singular_pose_frees():
    # the tool of the plane arm folded back onto its first axis: joints 1 and 3 turn against
    # each other
    chain = arm("planar_3r")
    U = tool(chain, np.array([[0.4, np.pi, 0.7]]))
    references = np.array([[0.9, 0.0, 0.0]])
    found = postures(solver("planar_3r"), U, references, EXACT)
    check(chain, U, found)
    assert found.family[found.valid].all()
    settled = settle_families(chain, U, found, references, EXACT)
    assert settled.valid.sum() == 1
    np.testing.assert_allclose(settled.q[0, 0], [0.9, np.pi, 0.2], atol=1e-9)
    np.testing.assert_array_equal(settled.free[0, 0], [True, False, False])


def test_the_same_virtual_joints_for_other_numbers():
    chain = arm("RRRRR/23")
    D = chain.D.copy()
    D[5, :3, 3] += 0.1
    D[1, :3, 3] -= 0.05
    other = JointChain(chain.columns, chain.sigma, D, chain.base)
    alike = prepare_alike(solver("RRRRR/23"), other, prepare)
    assert [way.layout[:5] for way in alike.ways] == [
        way.layout[:5] for way in solver("RRRRR/23").ways
    ]
    q = random_q(other, 50)
    found = postures(alike, tool(other, q), np.zeros_like(q), EXACT)
    check(other, tool(other, q), found)
    assert lost(other, found, q, 1e-6).size == 0


def test_no_pose_and_no_arm():
    chain = arm("RRR")
    found = postures(solver("RRR"), np.zeros((0, 4, 4)), np.zeros((0, 3)), EXACT)
    assert found.q.shape[0] == 0
    assert found.q.shape[2] == chain.k
    for k in (0, 6, 7):
        none = JointChain(
            np.arange(k), np.zeros(k, np.int64), np.tile(np.eye(4), (k + 1, 1, 1)), np.eye(4)
        )
        assert prepare_fewer(none, prepare) is None
