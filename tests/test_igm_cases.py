"""Few poses of few arms, quick also where kernels run as plain Python: every step must be right."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robotmodels import se3
from robotmodels.igm.constraints import Components
from robotmodels.igm.kernels.elimination import eigenproblems
from robotmodels.igm.loop import JointChain
from robotmodels.igm.pose_search import pose_search, search_space
from robotmodels.igm.solver import Tolerances


@pytest.mark.parametrize("swapped", [0, 1])
@pytest.mark.parametrize("slide", [None, 0, 1, 3, 4])
@pytest.mark.parametrize("seed", range(2))
def test_the_matrix_of_a_general_arm_has_its_posture_among_its_eigenvalues(seed, slide, swapped):
    """A loop closed at random joint values: tan((q_2 - angle) / 2) is an eigenvalue.

    And the equations hold: six in joints 2, 3, 4 alone, eight that tell of joints 0 and 1.
    """
    rng = np.random.default_rng(seed)
    kinds = np.zeros(6, dtype=np.int64)
    if slide is not None:
        kinds[slide] = 1
    q = rng.uniform(-2.0, 2.0, 6)
    links, T = np.tile(np.eye(4), (6, 1, 1)), np.eye(4)
    for k in range(6):
        turn = se3.rotation("z", q[k]) if kinds[k] == 0 else se3.translation(0.0, 0.0, q[k])
        T = T @ turn
        if k < 5:
            links[k] = se3.from_rpy(rng.uniform(-2.0, 2.0, 3), rng.uniform(-0.7, 0.7, 3))
            T = T @ links[k]
    links[5] = se3.inverse(T)
    M, P, Q = np.zeros((1, 16, 16)), np.empty((1, 14, 27)), np.empty((1, 14, 8))
    order, angle, quality = np.empty((1, 8), dtype=np.int64), np.empty(1), np.empty(1)
    eigenproblems(kinds, links[None], swapped, M, (P, Q, order, angle, quality))
    assert quality[0] > 1e-6
    asked = np.tan(0.5 * (q[2] - angle[0]))
    assert np.abs(np.linalg.eigvals(M[0]) - asked).min() < 1e-7 * max(1.0, abs(asked))
    basis = [
        (1.0, x, x * x) if kind else (1.0, np.cos(x), np.sin(x))
        for kind, x in zip(kinds, q, strict=True)
    ]
    left = P[0] @ np.kron(basis[2], np.kron(basis[3], basis[4]))
    right = np.kron(basis[0], basis[1])[1:][order[0]]
    np.testing.assert_allclose(left[8:], 0.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(left[:8], np.triu(Q[0, :8]) @ right, rtol=0, atol=1e-12)


def test_rotation_vectors_of_the_iteration_keep_their_sign_up_to_half_a_turn(rng):
    """Each of the four ways to the quaternion, whichever component is the largest."""

    one = JointChain(np.zeros(0, int), np.zeros(0, int), np.eye(4)[None], np.eye(4))
    space = search_space(one, np.zeros(0), np.zeros(0), False, 0, 0)
    axes = np.vstack((np.eye(3), -np.eye(3), rng.normal(size=(60, 3))))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    for axis in axes:
        for angle in (1e-9, 0.4, 2.0, 3.0, np.pi - 1e-3):
            R = Rotation.from_rotvec(angle * axis).as_matrix()
            T = np.eye(4)[None]
            T[0, :3, :3] = R
            found = pose_search(
                space, Components(), (Tolerances(), 0, 0), T, np.zeros((1, 0)), True
            ).error[0, 3:]
            np.testing.assert_allclose(found, angle * axis, rtol=0, atol=1e-14 * max(1.0, angle))
