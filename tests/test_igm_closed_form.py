"""The closed forms of six-joint arms against their own direct model."""

from functools import cache
from itertools import product

import numpy as np
import pytest
from numba import config

import robotmodels as rm
from robotmodels.igm.closed_form import closed_form_postures, plan_loop
from robotmodels.igm.loop import JointChain, joint_chain
from robotmodels.igm.motion import jacobians
from robotmodels.igm.motion import tool_poses as poses
from robotmodels.igm.structure import Family

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
MANY = 3 if config.DISABLE_JIT else 300


@cache
def chain_of(name):
    return joint_chain(rm.load(name))


def random_postures(chain, count, seed=0):
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, 6))
    q[:, chain.sigma == 1] *= 0.2
    return q


def gaps(chain, a, b):
    """Largest difference in a joint; NaN kept."""
    d = a - b
    return np.abs(np.where(chain.sigma == 0, (d + np.pi) % (2 * np.pi) - np.pi, d)).max(axis=-1)


def solved(chain, q, references, within):
    """Postures of the poses of q: every one meets its pose, none is there twice."""
    U = poses(chain, q)
    found = closed_form_postures(plan_loop(chain), chain, U, references)
    rows, there = found.q, found.valid
    assert np.array_equal(np.isfinite(rows), np.broadcast_to(there[..., None], rows.shape))
    assert np.all(np.diff(there.astype(int), axis=1) <= 0)
    i, s = np.nonzero(there)
    np.testing.assert_allclose(poses(chain, rows[i, s]), U[i], rtol=0, atol=within)
    turns = rows[i, s][:, chain.sigma == 0]
    assert np.all((turns > -np.pi) & (turns <= np.pi))
    apart = gaps(chain, rows[:, :, None], rows[:, None]) + 10.0 * np.eye(8)
    assert np.nanmin(apart, initial=1.0) > 1e-7
    assert np.nanmin(gaps(chain, rows, q[:, None]), axis=1).max() < 1e-6
    return found


@pytest.mark.parametrize("name", CONCURRENT + PARALLEL)
def test_every_posture_of_random_poses(name):
    chain = chain_of(name)
    assert plan_loop(chain).family is Family[("PARALLEL", "CONCURRENT")[name in CONCURRENT]]
    q = random_postures(chain, MANY)
    found = solved(chain, q, np.zeros(q.shape), 1e-12)
    count = found.valid.sum(axis=1)
    assert np.all(count % 2 == 0)
    assert not found.free.any()
    # the postures of one pose are the same set from whichever of them the pose was made
    other = found.q[np.arange(len(q)), count - 1]
    again = closed_form_postures(plan_loop(chain), chain, poses(chain, other), q)
    np.testing.assert_array_equal(again.valid.sum(axis=1), count)
    assert np.nanmin(gaps(chain, again.q, q[:, None]), axis=1).max() < 1e-5


def test_other_arms_have_no_closed_form():
    arms = {name for name in rm.robots() if not name.startswith("erd:") and chain_of(name).k == 6}
    others = arms.difference(CONCURRENT + PARALLEL)
    assert others == {"crx10ia", "crx10ia_l", "xarm6"}
    for name in (*others, "erd:bravo7_no_ee", "cobra_s600", "iiwa14"):
        assert plan_loop(chain_of(name)) is None


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("sigma", list(product((0, 1), repeat=3)), ids=str)
def test_wrists_behind_or_before_any_three_joints(sigma, mirrored):
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
    assert plan_loop(chain).family is Family.CONCURRENT
    q = random_postures(chain, MANY)
    found = solved(chain, q, np.zeros(q.shape), 1e-11)
    assert np.all(found.valid.sum(axis=1) % 2 == 0)


@pytest.mark.parametrize("name", SPHERICAL_WRISTS)
def test_an_aligned_wrist_takes_the_reference(name):
    chain = chain_of(name)
    q = random_postures(chain, 60, seed=2)
    q[:, 4] = 0.0
    # the wrist alone is singular
    q = q[np.linalg.svd(jacobians(chain, q), compute_uv=False)[:, -2] > 0.05]
    found = solved(chain, q, q, 1e-12)
    own = np.nanargmin(gaps(chain, found.q, q[:, None]), axis=1)
    assert len(q) > 10
    assert found.free[np.arange(len(q)), own, 3].all()
