"""The closed forms of six-joint arms against their own direct model and against the oracles."""

from functools import cache

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.igm.closed_form import closed_form_postures, plan_loop
from robotmodels.igm.loop import JointChain, joint_chain
from robotmodels.igm.motion import tool_poses as poses
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


@cache
def arm(name):
    chain = joint_chain(load(name))
    return chain, plan_loop(chain)


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
    error = np.abs(poses(chain, found.reshape(-1, 6)).reshape(len(q), 8, 4, 4) - U[:, None])
    error = error.max(axis=(-1, -2))
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
    error = np.abs(poses(chain, found.reshape(-1, 6)).reshape(200, 8, 4, 4) - U[:, None])
    assert error[valid].max() < 1e-11
    assert np.nanmin(gaps(chain, found, q), axis=1).max() < 1e-6
    assert np.all(valid.sum(axis=1) % 2 == 0)


# --- singular postures ---------------------------------------------------------------------------


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


# --- far, wrong and unusual ----------------------------------------------------------------------
