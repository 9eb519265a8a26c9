"""The Jacobian as a product of three matrices."""

import numpy as np
from hypothesis import given
from identities.random_robots import models, random_state, robot_size

import robotmodels as rm
from robotmodels.kinematics import jacobian_factors


def check(model, q, projection, intermediate, frame=None):
    size = np.max([robot_size(model, row) for row in q.reshape(-1, model.n)])
    factors = jacobian_factors(model, q, projection, intermediate, frame)
    expected = rm.jacobian(model, q, frame)
    np.testing.assert_allclose(factors.jacobian, expected, rtol=0, atol=1e-13 * size)
    return factors


@given(model=models(max_frames=6))
def test_product_is_the_jacobian_for_every_pair(model):
    q, *_ = random_state(model, np.random.default_rng(1), 2)
    for i in range(model.f + 1):
        for j in range(model.f + 1):
            factors = check(model, q, i, j)
            # the first two have full rank: unit determinant, the inverse written down
            np.testing.assert_allclose(np.linalg.det(factors.rotation), 1.0, atol=1e-12)
            np.testing.assert_allclose(np.linalg.det(factors.transport), 1.0, atol=1e-12)
            lever = factors.transport[..., :3, 3:]
            np.testing.assert_allclose(lever, -np.swapaxes(lever, -1, -2), atol=0)
    for frame in range(model.f + 1):
        check(model, q, None, None, frame)


@given(model=models(max_frames=6, tree=True))
def test_third_matrix_is_the_jacobian_of_the_point_at_the_intermediate_frame(model):
    """Independently: the twist of the tool's body at O_j, in the axes of i, joint by joint."""
    q, *_ = random_state(model, np.random.default_rng(2), 3)
    i, j = model.f // 2, model.f
    factors = jacobian_factors(model, q, i, j)
    R = rm.dgm(model, q, i)[..., :3, :3]
    to_j = rm.dgm(model, q, j)[..., :3, 3] - rm.dgm(model, q)[..., :3, 3]
    J = rm.jacobian(model, q)
    v = J[..., :3, :] + np.cross(J[..., 3:, :], to_j[..., None], axis=-2)
    size = np.max([robot_size(model, row) for row in q])
    expected = np.concatenate(
        [np.swapaxes(R, -1, -2) @ v, np.swapaxes(R, -1, -2) @ J[..., 3:, :]], axis=-2
    )
    np.testing.assert_allclose(factors.reduced, expected, rtol=0, atol=2e-13 * size)


def test_rx90_is_the_books():
    """3J_{6,4}: zeros where the book has them, and the entries of the arm block."""
    model = rm.load("rx90")
    q = np.random.default_rng(3).uniform(-3, 3, size=(20, 6))
    factors = jacobian_factors(model, q)
    assert (factors.projection, factors.intermediate) == ("joint_3", "joint_4")
    J = factors.reduced
    D3 = RL4 = 0.45
    _, t2, t3, t4, t5, _ = q.T
    S23, C23 = np.sin(t2 + t3), np.cos(t2 + t3)
    zero, one = np.zeros(20), np.ones(20)
    expected = np.stack(
        [
            [zero, zero, S23 * RL4 - np.cos(t2) * D3, S23, C23, zero],
            [np.sin(t3) * D3 - RL4, np.cos(t3) * D3, zero, zero, zero, one],
            [-RL4 * one, zero, zero, zero, zero, one],
            [zero, zero, zero, zero, one, zero],
            [zero, zero, zero, -np.sin(t4), zero, -np.cos(t4)],
            [zero, zero, zero, -np.cos(t4) * np.sin(t5), np.cos(t5), np.sin(t4) * np.sin(t5)],
        ],
        axis=0,
    ).transpose(2, 1, 0)
    np.testing.assert_allclose(np.abs(J), np.abs(expected), atol=1e-15)
    det = -D3 * RL4 * np.cos(t3) * np.sin(t5) * (S23 * RL4 - np.cos(t2) * D3)
    np.testing.assert_allclose(np.abs(np.linalg.det(J)), np.abs(det), atol=1e-15)


def test_joint_velocities_matrix_by_matrix(rng):
    model = rm.load("tx40")
    q = rng.uniform(-2, 2, size=(50, 6))
    v = rng.normal(size=(50, 6))
    factors = jacobian_factors(model, q)
    np.testing.assert_allclose(factors.inverse_times(rm.dkm(model, q, v)), v, atol=1e-9)
    # redundant: least norm, as of the pseudo-inverse of the whole Jacobian
    model = rm.load("iiwa14")
    q, twist = rng.uniform(-2, 2, size=7), rng.normal(size=6)
    expected = np.linalg.pinv(rm.jacobian(model, q)) @ twist
    np.testing.assert_allclose(
        jacobian_factors(model, q).inverse_times(twist), expected, atol=1e-10
    )
    # singular: bounded, and exact for a twist that is possible
    model = rm.load("rx90")
    q, v = np.array([0.1, 0.2, 0.3, 0.4, 0.0, 0.6]), rng.normal(size=6)
    twist = rm.dkm(model, q, v)
    found = jacobian_factors(model, q).inverse_times(twist)
    np.testing.assert_allclose(rm.dkm(model, q, found), twist, atol=1e-12)
    assert np.linalg.norm(found) <= np.linalg.norm(v)
