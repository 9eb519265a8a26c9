"""The closed forms of six-joint arms against their own direct model and against the oracles."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

import robotmodels as rm
from robotmodels.igm.closed_form import closed_form_postures, plan_loop
from robotmodels.igm.loop import JointChain, joint_chain
from robotmodels.igm.structure import Family
from robotmodels.robots import load

CONCURRENT = (
    "gantry", "rx90", "tx40", "puma560", "stanford_arm", "kr6_r900", "irb120", "irb140", "irb6640",
    "erd:kinova", "erd:centauro_left_arm", "erd:centauro_right_arm", "erd:anymal_kinova_arm",
)  # fmt: skip
PARALLEL = (
    "ur5", "ur3e", "ur5e", "ur10e", "ur16e", "erd:ur3", "erd:ur3_gripper", "erd:ur3_limited",
    "erd:ur5", "erd:ur5_gripper", "erd:ur5_limited", "erd:ur10", "erd:ur10_limited", "erd:so100",
    "erd:so101", "erd:b1_z1_arm",
)  # fmt: skip
SPHERICAL_WRISTS = ("rx90", "tx40", "puma560", "stanford_arm", "kr6_r900", "irb120", "irb140")
SQUARE_WRISTS = ("ur5", "ur3e", "ur5e", "ur10e", "ur16e")
TINY = (1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
ORACLES = Path(__file__).parent / "oracles"


@cache
def arm(name):
    chain = joint_chain(load(name))
    return chain, plan_loop(chain)


def poses(chain, q):
    """Tool in R_0 at ``q (..., 6)``."""
    M = np.zeros((*q.shape, 4, 4))
    turning = chain.sigma == 0
    c, s = np.where(turning, np.cos(q), 1.0), np.where(turning, np.sin(q), 0.0)
    M[..., 0, 0], M[..., 0, 1], M[..., 1, 0], M[..., 1, 1] = c, -s, s, c
    M[..., 2, 2] = M[..., 3, 3] = 1.0
    M[..., 2, 3] = np.where(turning, 0.0, q)
    T = np.broadcast_to(chain.D[0], (*q.shape[:-1], 4, 4))
    for k in range(6):
        T = T @ M[..., k, :, :] @ chain.D[k + 1]
    return T


def random_postures(chain, count, seed=0):
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, 6))
    q[:, chain.sigma == 1] *= 0.2
    return q


def well_placed(chain, q):
    """The postures of q whose first joints and elbow are at no singularity.

    With the wrist angle at 1: what is left to the wrist alone is singular in the test.
    """
    away = q.copy()
    away[:, 4] = 1.0
    U = poses(chain, away)[:, :3]
    J = [(poses(chain, away + 1e-6 * step)[:, :3] - U).reshape(-1, 12) * 1e6 for step in np.eye(6)]
    return q[np.linalg.svd(np.stack(J, axis=-1), compute_uv=False)[:, -1] > 0.05][:40]


def gaps(chain, found, q):
    """Largest difference in a joint between postures (N, 8, 6) and ``q (N, 6)``; NaN kept."""
    d = found - q[:, None]
    return np.abs(np.where(chain.sigma == 0, (d + np.pi) % (2 * np.pi) - np.pi, d)).max(axis=-1)


def closed_form(plan, chain, U, references=None):
    """Postures, which of them there are, and which of their joints are free."""
    wanted = np.broadcast_to(0.0 if references is None else references, (len(U), 6))
    found = closed_form_postures(plan, chain, U, wanted)
    return found.q, found.valid, found.free


def solved(name, q, references=None):
    """Postures of the poses of q; every one of them meets its pose."""
    chain, plan = arm(name)
    U = poses(chain, q)
    found, valid, free = closed_form(plan, chain, U, references)
    error = np.abs(poses(chain, found) - U[:, None]).max(axis=(-1, -2))
    assert np.all(np.isnan(found) == ~valid[..., None])
    assert np.all(np.diff(valid.astype(int), axis=1) <= 0)
    turns = found[..., chain.sigma == 0]
    assert not np.any(turns[valid] > np.pi)
    assert not np.any(turns[valid] <= -np.pi)
    return found, valid, free, np.where(valid, error, 0.0)


# --- anywhere ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CONCURRENT + PARALLEL)
def test_every_posture_of_random_poses(name):
    chain, plan = arm(name)
    assert plan.family is (Family.CONCURRENT if name in CONCURRENT else Family.PARALLEL)
    q = random_postures(chain, 300)
    found, valid, free, error = solved(name, q)
    assert error.max() <= 1e-12
    assert np.nanmin(gaps(chain, found, q), axis=1).max() < 1e-6
    assert np.all(valid.sum(axis=1) % 2 == 0)
    assert not free.any()
    # the postures of one pose are the same set from whichever of them the pose was made
    for k in range(8):
        there = valid[:, k]
        if there.any():
            again, count, _, _ = solved(name, found[there, k])
            np.testing.assert_array_equal(count.sum(axis=1), valid[there].sum(axis=1))
            assert np.nanmin(gaps(chain, again, q[there]), axis=1).max() < 1e-5


def test_other_arms_have_no_plan():
    ours = [name for name in rm.robots() if not name.startswith("erd:")]
    others = {name for name in ours if joint_chain(load(name)).k == 6}
    others = others.difference(CONCURRENT + PARALLEL)
    assert others == {"crx10ia", "crx10ia_l", "xarm6"}
    for name in (*others, "erd:bravo7_no_ee", "cobra_s600", "iiwa14"):
        assert arm(name)[1] is None


@pytest.mark.parametrize(
    "sigma",
    [(0, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 0), (1, 1, 1)],
)
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_wrist_behind_or_before_any_three_joints(sigma, mirrored):
    rng = np.random.default_rng(5)
    D = np.tile(np.eye(4), (7, 1, 1))
    for k in range(7):
        D[k, :3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        D[k, :3, 0] *= np.linalg.det(D[k, :3, :3])
        if k not in (4, 5):
            D[k, :3, 3] = rng.uniform(-0.5, 0.5, 3)
    # frames of the wrist apart along their axes: only the axes meet
    D[4, :3, 3] = 0.3 * np.array([0.0, 0.0, 1.0])
    D[3] = D[3] @ np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -0.3], [0, 0, 0, 1.0]])
    D[5, :3, 3] = 0.2 * D[5, :3, 2]
    kinds = np.array([*sigma, 0, 0, 0])
    if mirrored:
        D, kinds = np.ascontiguousarray(np.linalg.inv(D)[::-1]), kinds[::-1].copy()
    chain = JointChain(np.arange(6), kinds, D, np.eye(4))
    plan = plan_loop(chain)
    assert plan is not None
    assert plan.family is Family.CONCURRENT
    q = random_postures(chain, 200)
    U = poses(chain, q)
    found, valid, _ = closed_form(plan, chain, U)
    error = np.abs(poses(chain, found) - U[:, None]).max(axis=(-1, -2))
    assert error[valid].max() < 1e-11
    assert np.nanmin(gaps(chain, found, q), axis=1).max() < 1e-6
    assert np.all(valid.sum(axis=1) % 2 == 0)


# --- singular postures ---------------------------------------------------------------------------


def branches(name, tiny):
    """Whether the wrist angles ``tiny`` and ``-tiny`` are found with the first joints of q."""
    chain, _ = arm(name)
    q = well_placed(chain, random_postures(chain, 200, seed=1))
    q[:, 4] = tiny
    found, valid, _, error = solved(name, q)
    assert error.max() <= 1e-12
    d = np.abs(found - q[:, None])
    d = np.where(chain.sigma == 0, np.minimum(d, 2 * np.pi - d), d)
    # the three of a triangle move with the wrist's other branch; joint 0 does not
    same_arm = valid & (d[..., [0, 1, 2] if name in SPHERICAL_WRISTS else [0]].max(axis=-1) < 1e-6)
    # the wrist angle is met to rounding, which is all the pose says about it
    return [
        (same_arm & (np.abs(found[..., 4] - sign * tiny) < 1e-3 * tiny + 3e-13)).any(axis=1)
        for sign in (1.0, -1.0)
    ]


@pytest.mark.parametrize("name", SPHERICAL_WRISTS + SQUARE_WRISTS)
@pytest.mark.parametrize("tiny", TINY)
def test_both_branches_beside_an_aligned_wrist(name, tiny):
    own, other = branches(name, tiny)
    assert own.size >= 20
    assert own.all()
    if name in SPHERICAL_WRISTS:
        assert other.all()
    else:
        # the other branch may be out of the triangle's reach, as it is at a regular pose nearby
        assert other.sum() >= own.size // 2
        assert np.sum(other != branches(name, 2e-3)[1]) <= 1


@pytest.mark.parametrize("name", SPHERICAL_WRISTS)
def test_an_aligned_wrist_takes_the_reference(name):
    chain, _ = arm(name)
    q = well_placed(chain, random_postures(chain, 200, seed=2))
    q[:, 4] = 0.0
    found, _, free, error = solved(name, q, references=q)
    assert error.max() <= 1e-12
    gap = gaps(chain, found, q)
    assert np.nanmin(gap, axis=1).max() < 1e-6
    assert free[np.arange(len(q)), np.nanargmin(gap, axis=1), 3].all()


@pytest.mark.parametrize("name", SQUARE_WRISTS)
def test_an_axis_parallel_to_the_three_takes_the_reference(name):
    chain, _ = arm(name)
    q = well_placed(chain, random_postures(chain, 200, seed=3))
    q[:, 4] = np.where(np.arange(len(q)) % 2, 0.0, np.pi)
    found, _, free, error = solved(name, q, references=q)
    assert error.max() <= 1e-12
    gap = gaps(chain, found, q)
    assert np.nanmin(gap, axis=1).max() < 1e-5
    assert free[np.arange(len(q)), np.nanargmin(gap, axis=1), 1].all()
    # a reference out of reach is replaced by the nearest angle that is not
    _, valid, _, _ = solved(name, q, references=q + np.array([0, 2.5, 0, 0, 0, 0]))
    assert valid.any(axis=1).all()


def test_a_wrist_centre_on_the_first_axis_takes_the_reference():
    chain, _ = arm("rx90")
    q = random_postures(chain, 40, seed=4)
    q[:, 1] = 0.5 * (0.5 * np.pi - q[:, 2])  # 0.45 cos(q2) = 0.45 sin(q2 + q3)
    found, _, free, error = solved("rx90", q, references=q)
    assert error.max() <= 1e-12
    gap = gaps(chain, found, q)
    assert np.nanmin(gap, axis=1).max() < 1e-6
    assert free[np.arange(40), np.nanargmin(gap, axis=1), 0].all()


def farthest(place):
    """Joint value at which a distance is largest."""
    grid = np.linspace(-np.pi, np.pi, 73)
    k = int(np.argmax([place(x) for x in grid]))
    best = minimize_scalar(
        lambda x: -place(x), bounds=(grid[k] - 0.1, grid[k] + 0.1), method="bounded",
        options={"xatol": 1e-10},
    )  # fmt: skip
    # the slope changes sign there: more digits than the extreme itself gives
    return brentq(lambda x: place(x + 1e-4) - place(x - 1e-4), best.x - 1e-3, best.x + 1e-3)


@pytest.mark.parametrize("name", ["rx90", "puma560", "ur5"])
def test_a_stretched_elbow(name):
    """The next joint as far from joint 2 as joint 3 can bring it: two postures in one."""
    chain, _ = arm(name)
    D = chain.D

    def distance(x):
        R = np.eye(4)
        R[:2, :2] = [[np.cos(x), -np.sin(x)], [np.sin(x), np.cos(x)]]
        return np.linalg.norm((D[2] @ R @ D[3])[:3, 3])

    q = random_postures(chain, 40, seed=6)
    q[:, 2] = farthest(distance)
    found, valid, _, error = solved(name, q)
    assert error.max() <= 1e-9
    assert valid.any(axis=1).all()
    assert np.nanmin(gaps(chain, found, q), axis=1).max() < 1e-4


# --- far, wrong and unusual ----------------------------------------------------------------------


@pytest.mark.parametrize("name", ["rx90", "ur5", "gantry", "stanford_arm"])
def test_poses_that_are_not_finite_have_no_posture_and_do_not_disturb_others(name):
    chain, plan = arm(name)
    U = poses(chain, random_postures(chain, 5000, seed=7))
    whole, valid, _ = closed_form(plan, chain, U)
    U[17, 0, 3] = np.nan
    U[4000, 1, 1] = np.inf
    found, there, _ = closed_form(plan, chain, U)
    assert not there[[17, 4000]].any()
    rest = np.setdiff1d(np.arange(5000), [17, 4000])
    np.testing.assert_array_equal(there[rest], valid[rest])
    np.testing.assert_array_equal(found[rest], whole[rest])


@pytest.mark.parametrize("name", ["rx90", "ur5"])
def test_out_of_reach(name):
    chain, plan = arm(name)
    U = poses(chain, random_postures(chain, 20, seed=8))
    U[:, :3, 3] += 50.0
    found, valid, free = closed_form(plan, chain, U)
    assert not valid.any()
    assert np.isnan(found).all()
    assert not free.any()
    empty = closed_form(plan, chain, np.zeros((0, 4, 4)))
    assert [part.shape for part in empty] == [(0, 8, 6), (0, 8), (0, 8, 6)]


@pytest.mark.parametrize(("name", "file"), [("rx90", "igm_rx90"), ("ur5", "igm_ur5")])
def test_the_oracles_postures(name, file):
    chain, plan = arm(name)
    oracle = json.loads((ORACLES / f"{file}.json").read_text())
    for case in oracle["cases"]:
        found, valid, _ = closed_form(plan, chain, np.array([case["T"]]))
        wanted = np.array(case["solutions"])
        assert valid.sum() == case["n_solutions"] == len(wanted)
        for posture in wanted:
            assert np.nanmin(gaps(chain, found, posture[None])) < 1e-6
