"""Six joints with two or three prismatic ones against their own direct model and searches."""

from functools import cache
from itertools import combinations

import numpy as np
import pytest

from robotmodels.igm.loop import JointChain, joint_chain
from robotmodels.igm.prismatic import prepare_prismatic
from robotmodels.igm.solver import Tolerances, postures
from robotmodels.robots import load
from robotmodels.se3 import inverse

TOLERANCES = Tolerances()
TWO, THREE = list(combinations(range(6), 2)), list(combinations(range(6), 3))


def chain_of(D, slides):
    sigma = np.isin(np.arange(6), slides).astype(np.int64)
    return JointChain(np.arange(6), sigma, D, np.eye(4))


@cache
def random_arm(seed, slides):
    rng = np.random.default_rng(seed)
    D = np.tile(np.eye(4), (7, 1, 1))
    R = np.linalg.qr(rng.normal(size=(7, 3, 3)))[0]
    D[:, :3, :3] = R * np.linalg.det(R)[:, None, None]
    D[:, :3, 3] = rng.uniform(-0.5, 0.5, (7, 3))
    return chain_of(D, slides)


def square_arm(rng, slides):
    """Axes at right angles or parallel, many lengths zero."""
    D = np.tile(np.eye(4), (7, 1, 1))
    about_x = {0: np.eye(3), 1: [[1, 0, 0], [0, 0, -1], [0, 1, 0]]}
    about_y = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
    for d in D:
        turn = rng.integers(0, 4)
        d[:3, :3] = about_y if turn == 3 else about_x[int(turn > 0)]
        d[:3, 3] = rng.choice([0.0, 0.0, 0.2, 0.3, 0.5], 3)
    return chain_of(D, slides)


def poses_and_jacobians(chain, q):
    M = np.zeros((*q.shape, 4, 4))
    turning = chain.sigma == 0
    c, s = np.where(turning, np.cos(q), 1.0), np.where(turning, np.sin(q), 0.0)
    M[..., 0, 0], M[..., 0, 1], M[..., 1, 0], M[..., 1, 1] = c, -s, s, c
    M[..., 2, 2] = M[..., 3, 3] = 1.0
    M[..., 2, 3] = np.where(turning, 0.0, q)
    T = np.broadcast_to(chain.D[0], (*q.shape[:-1], 4, 4))
    axes, origins = [], []
    for j in range(6):
        axes.append(T[..., :3, 2])
        origins.append(T[..., :3, 3])
        T = T @ M[..., j, :, :] @ chain.D[j + 1]
    J = np.zeros((*q.shape[:-1], 6, 6))
    for j in range(6):
        J[..., :3, j] = axes[j]
        if turning[j]:
            J[..., :3, j] = np.cross(axes[j], T[..., :3, 3] - origins[j])
            J[..., 3:, j] = axes[j]
    return T, J


def poses(chain, q):
    return poses_and_jacobians(chain, q)[0]


def draw(chain, N, rng):
    q = rng.uniform(-np.pi, np.pi, (N, 6))
    return np.where(chain.sigma == 0, q, 0.25 * q)


def apart(chain, a, b):
    d = np.abs(a - b)
    return np.where(chain.sigma == 0, np.minimum(d, 2 * np.pi - d), d).max(axis=-1)


def searched(chain, U, rng, starts=300):
    """Postures by damped Newton steps from many random starts."""
    q = draw(chain, starts, rng)
    for _ in range(60):
        T, J = poses_and_jacobians(chain, q)
        E = U[:3, :3] @ np.swapaxes(T[:, :3, :3], -1, -2)
        turn = [E[:, 2, 1] - E[:, 1, 2], E[:, 0, 2] - E[:, 2, 0], E[:, 1, 0] - E[:, 0, 1]]
        e = np.concatenate([U[:3, 3] - T[:, :3, 3], 0.5 * np.stack(turn, -1)], axis=1)
        step = (np.linalg.pinv(J, rcond=1e-9) @ e[..., None])[..., 0]
        largest = np.maximum(np.abs(step).max(axis=1), 1e-9)[:, None]
        q = q + step * np.minimum(1.0, 0.5 / largest)
    q = np.where(chain.sigma == 0, np.remainder(q + np.pi, 2 * np.pi) - np.pi, q)
    found = []
    for one in q[np.abs(poses(chain, q) - U).max(axis=(1, 2)) < 1e-9]:
        if all(apart(chain, one, other) > 1e-5 for other in found):
            found.append(one)
    return found


def solved(chain, q, references=None):
    """Postures of the poses of q; every one meets its pose and is there once, packed."""
    solver, U = prepare_prismatic(chain), poses(chain, q)
    references = np.zeros(q.shape) if references is None else references
    found = postures(solver, U, references, TOLERANCES)
    assert np.all(np.diff(found.valid.astype(int), axis=1) <= 0)
    n, r = np.nonzero(found.valid)
    # rounding grows with how far the slides run out
    far = 1.0 + np.abs(found.q[n, r][:, chain.sigma == 1]).max(axis=1, initial=0.0)
    error = np.abs(poses(chain, found.q[n, r]) - U[n]).max(axis=(1, 2))
    assert np.all(error < 1e-12 * far)
    turns = found.q[n, r][:, chain.sigma == 0]
    assert np.all((turns > -np.pi) & (turns <= np.pi))
    return U, found


def lost(chain, q, found):
    d = np.where(found.valid, apart(chain, np.nan_to_num(found.q), q[:, None]), np.inf)
    return int(np.sum(d.min(axis=1) > 1e-6))


@pytest.mark.parametrize("slides", THREE)
def test_three_prismatic_joints_anywhere(slides, rng):
    chain = random_arm(sum(slides), slides)
    q = draw(chain, 300, rng)
    _, found = solved(chain, q)
    assert lost(chain, q, found) == 0
    # a wrist reaches an orientation in two ways, and each leaves one set of lengths
    assert np.all(found.valid.sum(axis=1) == 2)
    assert not found.family.any()


@pytest.mark.parametrize("slides", TWO)
def test_two_prismatic_joints_anywhere(slides, rng):
    chain = random_arm(20 + sum(slides), slides)
    q = draw(chain, 100, rng)
    _, found = solved(chain, q)
    assert lost(chain, q, found) == 0
    assert np.all((found.valid.sum(axis=1) + found.double.sum(axis=1)) % 2 == 0)


@pytest.mark.parametrize("slides", [(0, 5), (1, 3), (3, 4)])
def test_the_count_is_that_of_an_independent_search(slides, rng):
    chain = random_arm(40 + sum(slides), slides)
    q = draw(chain, 2, rng)
    U, found = solved(chain, q)
    for n in range(2):
        others = searched(chain, U[n], rng)
        rows = found.q[n][found.valid[n]]
        assert all(apart(chain, one, rows).min() < 1e-6 for one in others)
        # starts reach postures with slides run out far seldom
        assert np.sum(np.abs(rows[:, chain.sigma == 1]).max(axis=1) < 2.0) <= len(others)


def test_arms_with_axes_at_right_angles(rng):
    solved_arms = 0
    for _ in range(60):
        slides = tuple(sorted(rng.choice(6, rng.integers(2, 4), replace=False)))
        chain = square_arm(rng, slides)
        q = draw(chain, 20, rng)
        smallest = np.linalg.svd(poses_and_jacobians(chain, q)[1], compute_uv=False)[:, -1]
        if np.median(smallest) < 1e-6:
            continue
        assert prepare_prismatic(chain) is not None
        _, found = solved(chain, q)
        alone = ~found.family.any(axis=1)
        assert alone.any()
        part = q[alone]
        d = np.where(found.valid, apart(chain, np.nan_to_num(found.q), q[:, None]), np.inf)
        assert d[alone].min(axis=1).max() < 1e-6, part
        solved_arms += 1
    assert solved_arms > 5


def test_reversed_arms_agree(rng):
    for slides in ((1, 4), (0, 2, 3)):
        chain = random_arm(7, slides)
        back = JointChain(
            chain.columns,
            np.ascontiguousarray(chain.sigma[::-1]),
            np.ascontiguousarray(inverse(chain.D)[::-1]),
            chain.base,
        )
        q = draw(chain, 30, rng)
        _, found = solved(chain, q)
        _, other = solved(back, -q[:, ::-1])
        np.testing.assert_array_equal(found.valid.sum(axis=1), other.valid.sum(axis=1))


def test_an_aligned_wrist_takes_the_reference(rng):
    chain = joint_chain(load("gantry"))
    q = draw(chain, 10, rng)
    q[:, 4] = 0.0
    references = np.full((10, 6), 0.4)
    _, found = solved(chain, q, references)
    assert found.family.any(axis=1).all()
    assert np.all(found.free[found.family] == [0, 0, 0, 1, 0, 0])
    assert np.abs(found.q[found.family][:, 3] - 0.4).max() < 1e-12


def test_two_slides_turned_parallel(rng):
    # P R P ...: joint 2 turns the directions of both slides into one
    rng = np.random.default_rng(3)
    D = random_arm(3, (0, 2, 4)).D.copy()
    D[1, :3, :3] = D[2, :3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    chain = chain_of(D, (0, 2, 4))
    q = draw(chain, 4, rng)
    q[:, 1] = 0.0
    references = np.full((4, 6), 0.7)
    _, found = solved(chain, q, references)
    assert found.family.any(axis=1).all()
    assert np.all(found.free[found.family] == [1, 0, 0, 0, 0, 0])
    assert np.abs(found.q[found.family][:, 0] - 0.7).max() < 1e-12
    assert not found.family.all()


def test_which_arms_are_declined():
    assert prepare_prismatic(joint_chain(load("rx90"))) is None
    assert prepare_prismatic(joint_chain(load("lab_trr"))) is None
    assert prepare_prismatic(random_arm(0, (0, 1, 2, 3))) is None
    assert prepare_prismatic(random_arm(0, (3,))) is None
    D = random_arm(0, (0, 1)).D.copy()
    D[1, :3, :3] = np.eye(3)  # two slides in a row, parallel
    assert prepare_prismatic(chain_of(D, (0, 1))) is None
    D = random_arm(0, (0, 1, 2)).D.copy()
    D[4, :3, :3] = np.eye(3)  # revolute axes parallel
    assert prepare_prismatic(chain_of(D, (0, 1, 2))) is None


@pytest.mark.parametrize("slides", [(0, 1), (0, 1, 2)])
def test_no_poses(slides):
    solver = prepare_prismatic(random_arm(1, slides))
    found = postures(solver, np.empty((0, 4, 4)), np.empty((0, 6)), TOLERANCES)
    assert found.q.shape[0] == 0
    assert found.q.shape[2] == 6
