"""Poses: elementary motions, roll-pitch-yaw at gimbal lock, and what counts as a rotation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from identities.random_robots import random_pose, random_rotation, seeds

import robotmodels.se3 as se3
from robotmodels.errors import NotARotationError, ShapeError

EPS = np.finfo(np.float64).eps
angles = st.one_of(
    st.sampled_from([k * np.pi / 2 for k in range(-4, 5)]), st.floats(-10.0, 10.0, width=64)
)


@pytest.mark.parametrize("axis", "xyz")
@given(angle=angles)
def test_rotation_turns_about_its_axis(axis, angle):
    """Rodrigues' formula, and the axis stays where it is."""
    u = np.eye(3)["xyz".index(axis)]
    K = se3.skew(u)
    wanted = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    T = se3.rotation(axis, angle)
    assert np.abs(T[:3, :3] - wanted).max() < 4 * EPS
    assert np.array_equal(T[:3, :3] @ u, u)
    assert np.array_equal(T[3], [0, 0, 0, 1])


@pytest.mark.parametrize("k", range(-5, 6))
def test_right_angles_are_exact(k):
    """cos(pi/2) is 6e-17 in floating point; tables are full of right angles."""
    assert set(np.unique(se3.rotation("x", k * np.pi / 2))) <= {-1.0, 0.0, 1.0}


@given(st.tuples(angles, st.floats(-np.pi / 2, np.pi / 2), angles))
def test_rpy_gives_the_rotation_back(rpy):
    R = se3.from_rpy(rpy)[:3, :3]
    assert np.abs(se3.from_rpy(se3.to_rpy(R))[:3, :3] - R).max() < 8 * EPS


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("gap", [0.0, 1e-17, 1e-16, 1e-12, 1e-8, 1e-4])
def test_rpy_is_exact_at_and_near_gimbal_lock(sign, gap, rng):
    for _ in range(50):
        roll, yaw = rng.uniform(-np.pi, np.pi, size=2)
        R = se3.from_rpy([roll, sign * (np.pi / 2 - gap), yaw])[:3, :3]
        assert np.abs(se3.from_rpy(se3.to_rpy(R))[:3, :3] - R).max() < 8 * EPS


def test_rpy_order_is_that_of_urdf():
    """Fixed axes: roll about x first, then pitch about y, then yaw about z."""
    T = se3.from_rpy([0.1, 0.2, 0.3], [1, 2, 3])
    wanted = se3.rotation("z", 0.3) @ se3.rotation("y", 0.2) @ se3.rotation("x", 0.1)
    assert np.allclose(T[:3, :3], wanted[:3, :3], atol=1e-16)
    assert T[:3, 3].tolist() == [1, 2, 3]


@given(seeds)
def test_inverse_undoes(seed):
    rng = np.random.default_rng(seed)
    T = np.array([random_pose(rng) for _ in range(3)])
    assert np.abs(se3.inverse(T) @ T - np.eye(4)).max() < 1e-14
    assert se3.inverse(T[0]).shape == (4, 4)


@given(seeds)
def test_skew_is_the_vector_product(seed):
    p, u = np.random.default_rng(seed).normal(size=(2, 4, 3))
    assert np.allclose((se3.skew(p) @ u[:, :, None])[:, :, 0], np.cross(p, u), atol=1e-15)


@given(seeds, st.floats(1e-13, 2e-7))
def test_slightly_off_rotations_are_projected(seed, size):
    """What leaves is a rotation to rounding, and as near as what came in was off."""
    rng = np.random.default_rng(seed)
    T = np.array([random_pose(rng), random_pose(rng)])
    noisy = T.copy()
    noisy[:, :3, :3] += rng.uniform(-size, size, size=(2, 3, 3))
    noisy[:, 3, :] += rng.uniform(-size, size, size=(2, 4))
    clean = se3.as_pose(noisy)
    R = clean[:, :3, :3]
    assert np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max() < 4e-15
    assert np.abs(R - T[:, :3, :3]).max() < 10 * size + 4e-15
    assert np.array_equal(clean[:, :3, 3], noisy[:, :3, 3])
    if size > 1e-12:
        assert np.array_equal(clean[:, 3], [[0, 0, 0, 1]] * 2)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda T: T.__setitem__((slice(3), slice(3)), 1.001 * T[:3, :3]), r"det R = 1\.003"),
        (lambda T: T.__setitem__((slice(3), 2), -T[:3, 2]), "det R = -1;"),
        (lambda T: T.__setitem__((slice(3), slice(3)), 0.0), "det R = 0"),
        (lambda T: T.__setitem__((0, 1), T[0, 1] + 1e-5), "nearest_pose.* makes a typed"),
        (lambda T: T.__setitem__((3, 3), 2.0), "last row"),
        (lambda T: T.__setitem__((3, 0), 0.1), "last row"),
    ],
    ids=["scaled", "mirror", "zero", "off by 1e-5", "w = 2", "perspective"],
)
def test_what_is_not_a_pose_is_refused(spoil, words, rng):
    T = np.array([random_pose(rng), random_pose(rng)])
    spoil(T[1])
    with pytest.raises(NotARotationError, match=words) as caught:
        se3.as_pose(T, "base")
    assert str(caught.value).startswith("base: ")
    if "last row" not in words:
        assert "(row 1)" in str(caught.value), "the error must point at the pose that is wrong"
    with pytest.raises(NotARotationError):
        se3.as_single_pose(T[1], "base")


def test_pinocchio_poses_are_accepted(rng):
    pin = pytest.importorskip("pinocchio")
    M = pin.SE3(random_rotation(rng), rng.normal(size=3))
    assert np.array_equal(se3.as_pose(M), M.homogeneous)


# --- MATLAB's order -------------------------------------------------------------------------------


def test_pages_of_a_mat_file(tmp_path, rng):
    """What MATLAB wrote, with the last axis that it drops from a single page."""
    from scipy.io import loadmat, savemat

    T = np.array([random_pose(rng) for _ in range(3)])
    savemat(tmp_path / "poses.mat", {"T": se3.poses_to_matlab(T), "one": T[0]})
    content = loadmat(tmp_path / "poses.mat")
    assert np.array_equal(se3.poses_from_matlab(content["T"]), T)
    assert np.array_equal(se3.poses_from_matlab(content["one"]), T[:1])


@pytest.mark.parametrize(
    ("read", "value", "words"),
    [
        *((se3.as_pose, x, r"expected shape \(\.\.\., 4, 4\)")
          for x in (np.eye(3), np.zeros((2, 4)), [1, 2], 5.0)),
        (se3.poses_from_matlab, np.zeros((5, 4, 4)), "MATLAB.s order .*use it as it is"),
        *((se3.poses_from_matlab, np.zeros(x), "got shape")
          for x in ((3, 3, 5), (4, 4, 2, 2), (16,))),
    ],
)  # fmt: skip
def test_poses_of_another_shape_are_refused(read, value, words):
    with pytest.raises(ShapeError, match=words):
        read(value)
